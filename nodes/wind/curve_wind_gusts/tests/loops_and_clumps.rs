//! Gusts that loop, blow to sides of their own, are masked, and are felt by clumps.

use super::*;

fn masked(value: f32, name: &str) -> Maskable {
    Maskable { value, attribute: Some(name.into()) }
}

/// Many gusts over a field of rows of twelve curves, of which the second to the tenth are clumps of three (`clump`).
fn crowd() -> Bench {
    crowd_over(field(12))
}

fn crowd_over(mut curves: Geometry) -> Bench {
    let part = curves.part_mut(Kind::Curves).unwrap();
    let clump = |curve: i32| if (1..10).contains(&(curve % 12)) { curve / 12 * 3 + (curve % 12 - 1) / 3 } else { -1 };
    part.set(Attr::<i32>::element("clump"), (0..144).map(clump).collect()).unwrap();
    part.set(Attr::<f32>::point("half"), vec![0.5; 720]).unwrap();
    part.set(Attr::<f32>::point("one"), vec![1.0; 720]).unwrap();
    bench(&NODE)
        .input(CURVES, curves)
        .set(NUM_GUSTS, 30)
        .set(RADIUS_RANGE, span(0.2, 0.4))
        .set(SPEED_RANGE, span(0.5, 1.5))
        .set(START_FRAME_RANGE, span(1.0, 40.0))
}

#[test]
fn a_loop_repeats_its_frames() {
    for (repeat, seed) in [(0.0, 1), (20.0, 2)] {
        let gusts = crowd().set(REPEAT_EVERY, repeat).set(SHEAR, 1.0.into()).set(SEED, Seed(seed)).set(LOOP, 48.0);
        for frame in [1.0, 13.5, 47.0] {
            let now = gusts.clone().at(frame).cook();
            assert!(envelope(&now).iter().any(|x| *x > 0.1));
            for loops in [1.0, 5.0, -1.0] {
                let later = gusts.clone().at(frame + 48.0 * loops).cook();
                let close = |a: &f32, b: &f32| (a - b).abs() < 1e-6;
                assert!(envelope(&now).iter().zip(envelope(&later)).all(|(a, b)| close(a, b)), "{frame} {loops}");
                let [a, b] = [&now, &later].map(|out| out.curves().get(GUST_DIR).unwrap().as_flattened());
                assert!(a.iter().zip(b).all(|(a, b)| close(a, b)), "{frame} {loops}");
            }
        }
        // Nothing jumps where the loop closes: gusts move by 0.06 m a frame, a quarter of a radius.
        let [last, first] = [48.0, 49.0].map(|frame| gusts.clone().at(frame).cook());
        let far = envelope(&last).iter().zip(envelope(&first)).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(far < 0.7, "{far}");
    }
}

#[test]
fn a_loop_with_a_keyed_wind_repeats_once_the_gusts_from_before_frame_0_are_gone() {
    let turn = |half: i32| (f64::from(1 + 24 * half), if half % 2 == 0 { [1.0, 0.0, 0.0] } else { [0.0, 0.0, 1.0] });
    let turns: Vec<_> = (0..20).map(turn).collect();
    let gusts = crowd().set(LOOP, 48.0).set(LIFE_RANGE, span(40.0, 40.0)).keyed(WIND_DIR, &turns);
    let apart = |frame: f64| {
        let [now, later] = [frame, frame + 48.0].map(|frame| gusts.clone().at(frame).cook());
        let far = envelope(&now).iter().zip(envelope(&later)).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        (far, now.metrics["unlooped_gusts"])
    };
    let (far, counted) = apart(13.0);
    assert!(far > 0.1 && counted > 0.0, "{far} {counted}");
    for frame in [110.0, 130.5] {
        let (far, counted) = apart(frame);
        assert!(far < 1e-6 && counted == 0.0, "{frame}: {far} {counted}");
    }
}

#[test]
fn each_gust_blows_to_a_side_of_its_own_by_its_influence() {
    // W5's sphere passes the CV at frame 48: influence 1 at its centre, ½ six frames before (smooth falloff at ½: ½).
    let gust = single(dot(5.0)).set(DISTANCE, 3.0);
    let side = |bench: &Bench, frame: f64| bench.clone().at(frame).cook().curves().get(GUST_DIR).map(|rows| rows[0]);
    assert_eq!(side(&gust, 48.0), Some([0.0; 3]));
    let sheared = gust.clone().set(SHEAR, 0.8.into());
    let [whole, half] = [48.0, 42.0].map(|frame| side(&sheared, frame).unwrap());
    let length = numerics::vector::length;
    assert!((length(whole) - 0.8).abs() < 1e-5 && whole[0].abs() < 1e-6, "across the wind: {whole:?}");
    assert!((0..3).all(|k| (half[k] - 0.5 * whole[k]).abs() < 1e-5));
    assert_eq!(side(&sheared, 90.0), Some([0.0; 3]));
    assert_ne!(side(&sheared.clone().set(SEED, Seed(5)), 48.0).unwrap(), whole);
    // It is there where the wind is at its full strength anyway, and is added to what comes in.
    assert_eq!(side(&sheared.clone().set(BASE, 1.0.into()), 48.0), Some(whole));
    let mut blown = dot(5.0);
    blown.part_mut(Kind::Curves).unwrap().set(GUST_DIR, vec![[1.0, 2.0, 3.0]]).unwrap();
    let with = |shear: f32| single(blown.clone()).set(DISTANCE, 3.0).set(SHEAR, shear.into());
    let found = side(&with(0.8), 48.0).unwrap();
    assert!((0..3).all(|k| (found[k] - (whole[k] + [1.0, 2.0, 3.0][k])).abs() < 1e-6));
    assert_eq!(side(&with(0.0), 48.0), Some([1.0, 2.0, 3.0]));
    // The envelope has the bits that it has without.
    assert_eq!(bits(&sheared.at(42.0).cook()), bits(&gust.at(42.0).cook()));
}

#[test]
fn shear_strength_and_base_may_be_masked() {
    let out = |bench: Bench| bench.at(30.0).cook();
    let plain = crowd().set(BASE, 0.2.into()).set(SHEAR, 0.5.into());
    let ones = [(BASE, 0.2), (STRENGTH, 1.0), (SHEAR, 0.5)];
    let ones = ones.iter().fold(crowd(), |bench, (param, value)| bench.set(*param, masked(*value, "one")));
    let (plain, ones) = (out(plain), out(ones));
    assert_eq!(bits(&plain), bits(&ones));
    assert_eq!(plain.curves().get(GUST_DIR), ones.curves().get(GUST_DIR));
    let halves =
        crowd().set(BASE, masked(0.4, "half")).set(STRENGTH, masked(2.0, "half")).set(SHEAR, masked(1.0, "half"));
    let halves = out(halves);
    assert!(envelope(&halves).iter().zip(envelope(&plain)).all(|(a, b)| (a - b).abs() < 1e-6));
    let [a, b] = [&halves, &plain].map(|out| out.curves().get(GUST_DIR).unwrap().as_flattened());
    assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6));
    assert_eq!(envelope(&out(crowd().set(BASE, masked(1.0, "half")).set(NUM_GUSTS, 0))), [0.5; 720]);
    let grouped = out(crowd().set(STRENGTH, masked(2.0, "half")).set(BASE, 0.2.into()).set(GROUP, "clump".into()));
    let part = plain.curves();
    for (cv, value) in envelope(&grouped).iter().enumerate() {
        let inside = part.get(Attr::<i32>::element("clump")).unwrap()[cv / 5] != 0;
        assert!((value - if inside { envelope(&plain)[cv] } else { 1.0 }).abs() < 1e-6, "CV {cv}");
    }
}

#[test]
fn curves_of_a_clump_feel_what_its_mean_root_feels() {
    let out = |bench: Bench| envelope(&bench.at(30.0).cook()).to_vec();
    let clumped = || crowd().set(CLUMP, "clump".into());
    let (own, together) = (out(crowd()), out(clumped()));
    // The groom with each curve at its clump's mean root, whose bounds and so whose launch plane are the same.
    let mut means = field(12);
    let alone = |curve: usize| !(1..10).contains(&(curve % 12));
    for (cv, p) in means.part_mut(Kind::Curves).unwrap().edit(P).unwrap().iter_mut().enumerate() {
        if !alone(cv / 5) {
            p[0] = 0.1 * ((cv / 5 % 12 - 1) / 3 * 3 + 2) as f32;
        }
    }
    let expected = out(crowd_over(means));
    assert!(together.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 2e-5));
    // Positions are rounded relative to a nearby CV, which may be of a curve that is drawn.
    assert!((0..720).filter(|cv| alone(cv / 5)).all(|cv| (together[cv] - own[cv]).abs() < 1e-6));
    assert_ne!(together, own);
    assert_eq!(out(clumped().set(CLUMP_BLEND, 0.0.into())), own);
    assert_eq!(out(clumped().set(CLUMP_BLEND, masked(1.0, "one"))), together);
    let found = out(crowd().set(CLUMP_RADIUS, 0.101));
    assert_ne!(found, own);
    assert!((0..5).all(|cv| (found[cv] - found[5 + cv]).abs() < 1e-6), "the first two curves are a clump");
    let error = clumped().set(CLUMP, "clamp".into()).at(30.0).try_cook().unwrap_err();
    assert_eq!(error.to_string(), "`clump` is `clamp`, which the curves do not have; did you mean `clump`?");
    let error = clumped().set(CLUMP, "half".into()).at(30.0).try_cook().unwrap_err();
    assert_eq!(error.fact, "`clump` is `half`, which is one float for each CV");
}
