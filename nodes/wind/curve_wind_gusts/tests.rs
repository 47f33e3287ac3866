//! Gusts along their paths, groups, controls; loops, sides, masks and clumps in a file of their own.

mod loops_and_clumps;

use super::*;
use conformance::{Bench, BenchResult, bench, conformance};
use curves::gusts::{ControlShape, outline};
use numerics::ramp::Interpolation;

fn span(low: f32, high: f32) -> Span {
    Span { low, high }
}

fn ramp(keys: &[[f32; 2]]) -> Arc<Ramp> {
    Arc::new(Ramp::new(keys.to_vec(), Interpolation::Linear).unwrap())
}

/// A curve along x from `from` to `to`, a CV every 1/32 m.
fn ruler(from: f32, to: f32) -> Geometry {
    let cvs = ((to - from) * 32.0) as u32 + 1;
    Component::curves(vec![cvs], (0..cvs).map(|k| [from + k as f32 / 32.0, 0.0, 0.0]).collect()).unwrap().into()
}

/// One CV.
fn dot(x: f32) -> Geometry {
    Component::curves(vec![1], vec![[x, 0.0, 0.0]]).unwrap().into()
}

/// A field of upright curves, 0.1 m apart.
fn field(n: usize) -> Geometry {
    let cv = |i: usize, k: usize| [0.1 * (i % n) as f32, 0.05 * k as f32, 0.1 * (i / n) as f32];
    Component::curves(vec![5; n * n], (0..n * n).flat_map(|i| (0..5).map(move |k| cv(i, k))).collect()).unwrap().into()
}

/// One round gust of 1 m radius at 2 m/s that starts at frame 12 and does not fade.
fn single(curves: Geometry) -> Bench {
    bench(&NODE)
        .input(CURVES, curves)
        .set(NUM_GUSTS, 1)
        .set(RADIUS_RANGE, span(1.0, 1.0))
        .set(RADIUS_NOISE_RANGE, span(0.0, 0.0))
        .set(SPEED_RANGE, span(2.0, 2.0))
        .set(START_FRAME_RANGE, span(12.0, 12.0))
        .set(LIFE_RANGE, span(1000.0, 1000.0))
}

fn envelope(out: &BenchResult) -> &[f32] {
    out.curves().get(ENVELOPE).unwrap()
}

/// Position along a ruler of the centre of a gust with `falloff` 1…0 over 1 m.
fn centre(out: &BenchResult) -> f64 {
    let (mut sum, mut weight) = (0.0, 0.0);
    for (p, value) in out.curves().positions().iter().zip(envelope(out)) {
        sum += f64::from(p[0] * value);
        weight += f64::from(*value);
    }
    sum / weight
}

fn bits(out: &BenchResult) -> Vec<u8> {
    out.curves().table(Owner::Point).column("envelope").unwrap().to_bytes()
}

/// A Gust_Control as it comes along a wire: a ball or cubes about `centre`.
fn control(shape: ControlShape, centre: [f32; 3], radius: f32, strength: f32) -> Component {
    let points =
        outline(shape, [[2.0; 3]; 2], 0).iter().map(|p| [0, 1, 2].map(|k| centre[k] + radius * p[k])).collect();
    let falling = ramp(&[[0.0, 1.0], [1.0, 0.0]]);
    gust_control::component(points, shape, 2.0, strength, &falling).unwrap()
}

/// Makes a control of what the suite wires into `controls`: its position comes from the points, its numbers from the
/// attributes, which are random if present.
fn as_control(wire: usize, given: Geometry) -> Geometry {
    let points = given.points().unwrap();
    let Some((shapes, keys)) = points.get(gust_control::SHAPE).zip(points.get(gust_control::RAMP)) else {
        return given;
    };
    let (Some(first), Some(_)) = (points.positions().get(1), points.get(gust_control::POINTS)) else { return given };
    let shape = [ControlShape::Sphere, ControlShape::Cubes][shapes[0] as usize % 2];
    let mut made = control(shape, [first[0], 0.1, first[2]], 0.1, 1.0);
    let rows = made.point_count();
    let number = |attribute: Attr<f32>| points.get(attribute).map_or(1.0, |values| values[0]);
    made.set(gust_control::STRENGTH, vec![number(gust_control::STRENGTH); rows]).unwrap();
    made.set(gust_control::OUTER, vec![1.0 + number(gust_control::OUTER); rows]).unwrap();
    // Every second control has an outer box of its own.
    for sides in [gust_control::OUTER_BELOW, gust_control::OUTER_ABOVE].into_iter().filter(|_| wire % 2 == 1) {
        if let Some(values) = points.get(sides) {
            made.set(sides, vec![values[0].map(|x| 1.0 + x.abs()); rows]).unwrap();
        }
    }
    made.set(gust_control::RAMP, (0..rows).map(|row| [[0.0, keys[0][1], 0.0], [1.0, 0.0, 0.0]][row.min(1)]).collect())
        .unwrap();
    made.into()
}

#[test]
fn conforms_to_its_declaration() {
    // The suite's curves are small: gusts of the default size cover all of them or none.
    let small = |bench: Bench| {
        bench
            .changed(CONTROLS, as_control)
            .set(NUM_GUSTS, 30)
            .set(RADIUS_RANGE, span(0.05, 0.1))
            .set(SPEED_RANGE, span(0.02, 0.2))
            .set(START_FRAME_RANGE, span(-40.0, 30.0))
            .set(LIFE_RANGE, span(5.0, 200.0))
    };
    conformance(&NODE)
        .with(|bench| bench.changed(CONTROLS, as_control))
        .with(small)
        .with(move |bench| small(bench).set(LOOP, 20.0))
        .run();
}

#[test]
fn a_gust_peaks_at_its_start_plus_distance_over_speed() {
    // Launched 3 m upwind of the CV at frame 12, at 2 m/s: it arrives after 1.5 s, at frame 48. W5: 1 at its centre, 0
    // at its boundary, which passes half a second (12 frames) before and after.
    let gust = single(dot(5.0)).set(DISTANCE, 3.0);
    let at = |frame: f64| envelope(&gust.clone().at(frame).cook())[0];
    assert!((at(48.0) - 1.0).abs() < 1e-5);
    assert!(at(47.0) < at(48.0) && at(49.0) < at(48.0));
    // A quarter of the radius away: 1 − (3/16 − 2/64).
    assert!((at(45.0) - 0.84375).abs() < 1e-5 && (at(51.0) - 0.84375).abs() < 1e-5);
    assert!((at(42.0) - 0.5).abs() < 1e-5 && (at(54.0) - 0.5).abs() < 1e-5);
    for outside in [1.0, 36.0, 35.9, 60.0, 60.1, 90.0] {
        assert!(at(outside) < 1e-5, "frame {outside}");
    }
}

#[test]
fn with_distance_zero_a_gust_starts_upwind_by_the_largest_radius() {
    // The ruler begins at 0: the gust touches it when it starts, and 12 frames later its centre is there.
    let gust = single(ruler(0.0, 4.0));
    assert_eq!(gust.clone().at(12.0).cook().metrics["reached_points"], 0.0);
    assert!((f64::from(envelope(&gust.at(24.0).cook())[0]) - 1.0).abs() < 1e-5);
}

#[test]
fn gusts_add_to_the_base_and_scale_the_incoming_envelope() {
    let mut curves = dot(5.0);
    curves.part_mut(Kind::Curves).unwrap().set(ENVELOPE, vec![0.5]).unwrap();
    let gust = single(curves).set(DISTANCE, 3.0).set(FALLOFF, ramp(&[[0.0, 0.25]]));
    let at = |bench: Bench, frame: f64| envelope(&bench.at(frame).cook())[0];
    assert_eq!(at(gust.clone(), 48.0), 0.125);
    assert_eq!(at(gust.clone().set(BASE, 0.5.into()), 48.0), 0.375);
    assert_eq!(at(gust.clone().set(BASE, 0.5.into()), 1.0), 0.25);
    assert_eq!(at(gust.clone().set(BASE, 0.9.into()), 48.0), 0.5, "the sum is clamped to 1");
    assert_eq!(at(gust.set(NUM_GUSTS, 0).set(BASE, 0.5.into()), 48.0), 0.25);
}

#[test]
fn after_its_life_a_gust_fades_while_it_travels() {
    let gust = single(ruler(-8.0, 20.0)).set(LIFE_RANGE, span(24.0, 24.0)).set(DECAY_RANGE, span(12.0, 12.0));
    let at = |frame: f64| gust.clone().at(frame).cook();
    let most = |out: &BenchResult| envelope(out).iter().copied().fold(0.0, f32::max);
    let [living, dying, gone] = [36.0, 42.0, 48.0].map(at);
    assert!((most(&dying) / most(&living) - 0.5).abs() < 1e-2);
    assert_eq!((most(&gone), gone.metrics["active_gusts"]), (0.0, 0.0));
    assert_eq!((living.metrics["active_gusts"], dying.metrics["active_gusts"]), (1.0, 1.0));
    let (a, b) = (at(43.0), at(47.0));
    assert!((centre(&b) - centre(&a) - 4.0 * 2.0 / 24.0).abs() < 1e-2);
}

#[test]
fn gusts_do_not_jump_when_speed_and_wind_are_keyed() {
    // 2 m/s up to frame 20, then up to 26 m/s at frame 44: v = 2 + (f − 20). ∫ from 12: 16 + 2n + n²/2 frames·m/s.
    let keys = [(20.0, span(2.0, 2.0)), (44.0, span(26.0, 26.0))];
    let gust = single(ruler(-4.0, 30.0)).set(DISTANCE, 2.0).keyed(SPEED_RANGE, &keys);
    for frame in [31.0, 33.5, 40.0, 44.0] {
        let n = frame - 20.0;
        let way = (16.0 + 2.0 * n + 0.5 * n * n) / 24.0;
        let found = centre(&gust.clone().at(frame).cook());
        assert!((found - (way - 6.0)).abs() < 1e-3, "frame {frame}: {found} for {}", way - 6.0);
    }
    // Wind that reverses at frame 36, when the gust has travelled 4 m and starts to move back.
    let keys = [(35.0, [1.0, 0.0, 0.0]), (36.0, [1.0, 0.0, 0.0]), (37.0, [-1.0, 0.0, 0.0])];
    let gust = single(ruler(-4.0, 30.0)).set(SPEED_RANGE, span(4.0, 4.0)).keyed(WIND_DIR, &keys);
    let at = |frame: f64| centre(&gust.clone().at(frame).cook());
    assert!((at(36.0) - at(37.0)).abs() < 0.2);
    assert!((at(42.0) - at(46.0) - 4.0 / 6.0).abs() < 1e-3);
}

#[test]
fn each_gust_keeps_the_launch_plane_of_its_start() {
    // By frame 100 the wind has turned to z. A gust that starts then moves along z; one that started earlier turned
    // with the wind and keeps its launch plane.
    let keys = [(60.0, [1.0, 0.0, 0.0]), (80.0, [0.0, 0.0, 1.0])];
    let gust = |start: f32| {
        single(dot(0.0)).set(DISTANCE, 3.0).set(START_FRAME_RANGE, span(start, start)).keyed(WIND_DIR, &keys)
    };
    let reached = |bench: &Bench, frame: f64| envelope(&bench.clone().at(frame).cook())[0];
    assert!((reached(&gust(12.0), 48.0) - 1.0).abs() < 1e-5);
    assert!((reached(&gust(100.0), 136.0) - 1.0).abs() < 1e-5);
}

#[test]
fn gusts_can_start_between_frames_and_before_the_scene() {
    let at = |start: f32, frame: f64| {
        let gust = single(dot(0.0)).set(DISTANCE, 3.0).set(START_FRAME_RANGE, span(start, start));
        envelope(&gust.at(frame).cook())[0]
    };
    assert!((at(12.5, 48.5) - 1.0).abs() < 1e-5);
    assert!((at(-34.25, 1.75) - 1.0).abs() < 1e-5);
    assert!((at(-60.0, -24.0) - 1.0).abs() < 1e-5);
}

#[test]
fn repeated_gusts_return_at_any_frame() {
    let gust = single(dot(0.0)).set(DISTANCE, 3.0).set(LIFE_RANGE, span(60.0, 60.0)).set(REPEAT_EVERY, 100.0);
    for round in [-3.0, 0.0, 1.0, 12_345.0] {
        let out = gust.clone().at(48.0 + 100.0 * round).cook();
        assert!((envelope(&out)[0] - 1.0).abs() < 1e-5, "round {round}");
        assert_eq!(out.metrics["active_gusts"], 1.0);
    }
    // Six repetitions at the same time; far too many are bounded.
    let crowd = gust.clone().set(LIFE_RANGE, span(590.0, 590.0)).set(DECAY_RANGE, span(0.0, 0.0)).at(1000.0).cook();
    assert_eq!((crowd.metrics["active_gusts"], crowd.metrics["dropped_gusts"]), (6.0, 0.0));
    let flood = gust.set(LIFE_RANGE, span(1e9, 1e9)).set(REPEAT_EVERY, 0.5).cook();
    assert!(flood.metrics["dropped_gusts"] > 1e8);
}

#[test]
fn frames_cooked_alone_have_the_same_bits() {
    let gusts = bench(&NODE)
        .input(CURVES, field(20))
        .input(CONTROLS, control(ControlShape::Cubes, [1.0, 0.0, 1.0], 0.4, -0.5))
        .set(NUM_GUSTS, 30)
        .set(REPEAT_EVERY, 20.0)
        .keyed(WIND_DIR, &[(1.0, [1.0, 0.0, 0.0]), (20.0, [0.0, 0.2, 1.0])])
        .keyed(SPEED_RANGE, &[(1.0, span(0.5, 1.0)), (20.0, span(2.0, 9.0))]);
    let in_order = gusts.frames(1..=20);
    let mut reversed = gusts.frames((1..=20).rev());
    reversed.reverse();
    assert!(in_order.iter().zip(&reversed).all(|(a, b)| bits(a) == bits(b)));
    assert!(in_order.iter().all(|out| out.metrics["reached_points"] > 0.0));
    for frame in [20_i64, 7, 13, 1] {
        for threads in [1, 7] {
            let alone = gusts.clone().threads(threads).at(frame as f64).cook();
            assert_eq!(bits(&alone), bits(&in_order[frame as usize - 1]), "frame {frame}");
        }
    }
}

#[test]
fn the_launch_plane_depends_on_the_curves_of_the_first_frame_only() {
    // The curves move downwind as fast as the gust, which therefore never gets closer.
    let moving = |frame: Frame| dot(0.0 + 2.0 * (frame.number() - 1.0) as f32 / 24.0);
    let gust = single(dot(0.0));
    let with = |frame: f64| {
        let mut gust = bench(&NODE).moving(CURVES, moving);
        for (param, value) in [(RADIUS_RANGE, 1.0), (RADIUS_NOISE_RANGE, 0.0), (SPEED_RANGE, 2.0)] {
            gust = gust.set(param, span(value, value));
        }
        gust = gust.set(NUM_GUSTS, 1).set(START_FRAME_RANGE, span(1.0, 1.0)).set(LIFE_RANGE, span(1e3, 1e3));
        envelope(&gust.set(DISTANCE, 0.5).at(frame).cook())[0]
    };
    assert!((with(2.0) - 0.5).abs() < 1e-5 && (with(200.0) - 0.5).abs() < 1e-5);
    assert_eq!(envelope(&gust.at(200.0).cook()), [0.0]);
}

#[test]
fn controls_add_their_ramp_or_subtract_it() {
    let with = |controls: &[Component], base: f32| {
        let bench = bench(&NODE).input(CURVES, ruler(0.0, 4.0)).set(NUM_GUSTS, 0).set(BASE, base.into());
        let bench = controls.iter().fold(bench, |bench, control| bench.input(CONTROLS, control.clone()));
        let out = bench.cook();
        [0, 32, 48, 64, 96].map(|cv| envelope(&out)[cv])
    };
    let ball = control(ControlShape::Sphere, [1.0, 0.0, 0.0], 1.0, 1.0);
    assert_eq!(with(std::slice::from_ref(&ball), 0.0), [0.0, 1.0, 0.5, 0.0, 0.0]);
    let calm = control(ControlShape::Sphere, [1.5, 0.0, 0.0], 1.0, -0.5);
    assert_eq!(with(&[ball.clone(), calm.clone()], 0.0), [0.0, 0.75, 0.0, 0.0, 0.0]);
    assert_eq!(with(std::slice::from_ref(&calm), 1.0), [1.0, 0.75, 0.5, 0.75, 1.0]);
    // Merged into one wire they give the same result.
    assert_eq!(with(&[ball.concat(&calm).unwrap()], 0.25), with(&[ball, calm], 0.25));
}

#[test]
fn points_that_are_not_a_control_are_refused() {
    let with = |points: Component| {
        let bench =
            bench(&NODE).input(CURVES, dot(0.0)).input(CONTROLS, control(ControlShape::Sphere, [0.0; 3], 1.0, 1.0));
        bench.input(CONTROLS, points).try_cook().unwrap_err()
    };
    let error = with(Component::points(vec![[0.0; 3]; 9]));
    assert_eq!(error.fact, "wire 1 of `controls` is not a Gust_Control: its points have no `gust_points`");
    assert!(error.hint.unwrap().contains("Gust_Control"));
    let ball = control(ControlShape::Sphere, [0.0; 3], 1.0, 1.0);
    let strangers = ball.concat(&Component::points(vec![[0.0; 3]; 2])).unwrap();
    let fact =
        format!("point {} of wire 1 of `controls` does not belong to a complete Gust_Control", ball.point_count());
    assert_eq!(with(strangers).fact, fact);
    let mut odd = ball.clone();
    odd.set(gust_control::SHAPE, vec![7; ball.point_count()]).unwrap();
    assert_eq!(with(odd).fact, "`gust_shape` of point 0 of wire 1 of `controls` is 7, expected 0 or 1");
    let mut odd = ball.clone();
    odd.set(gust_control::RAMP, (0..ball.point_count()).map(|k| [-(k as f32), 0.0, 0.0]).collect()).unwrap();
    assert!(with(odd).fact.contains("is not a ramp: ramp key 1 has x -1"));
    let mut odd = ball;
    odd.set(Attr::<f32>::point("gust_shape"), vec![0.0; odd.point_count()]).unwrap();
    assert_eq!(with(odd).fact, "wire 1 of `controls` is not a Gust_Control: its `gust_…` attributes have other types");
}

#[test]
fn a_base_of_1_passes_the_envelope_through_and_writes_1_if_it_is_missing() {
    let mut curves = field(3);
    let out = single(curves.clone()).set(BASE, 1.0.into()).at(20.0).cook();
    assert_eq!((envelope(&out), out.metrics["active_gusts"]), (&[1.0; 45][..], 0.0));
    curves.part_mut(Kind::Curves).unwrap().set(ENVELOPE, vec![0.5; 45]).unwrap();
    let out = single(curves.clone()).set(BASE, 1.0.into()).at(20.0).cook();
    let column = |part: &Component| part.table(Owner::Point).column("envelope").unwrap().address();
    assert_eq!(column(out.curves()), column(curves.curves().unwrap()));
}

#[test]
fn zero_sizes_and_speeds_do_not_divide_by_zero() {
    let gust = single(field(3)).set(START_FRAME_RANGE, span(-8.0, -8.0));
    let calm = |bench: Bench| {
        let out = bench.cook();
        assert_eq!((envelope(&out), out.metrics["reached_points"]), (&[0.0; 45][..], 0.0));
    };
    calm(gust.clone().set(NUM_GUSTS, 0));
    calm(gust.clone().set(RADIUS_RANGE, span(0.0, 0.0)));
    calm(gust.clone().set(LIFE_RANGE, span(0.0, 0.0)).set(DECAY_RANGE, span(0.0, 0.0)));
    calm(gust.clone().set(FALLOFF, ramp(&[[0.0, 0.0]])));
    let still = gust.clone().set(SPEED_RANGE, span(0.0, 0.0)).set(DISTANCE, 0.5).cook();
    assert!(still.metrics["reached_points"] > 0.0, "a gust may stand still");
    let none = Geometry::from(Component::curves(Vec::new(), Vec::new()).unwrap());
    assert_eq!(single(none).at(20.0).cook().curves().point_count(), 0);
}

#[test]
fn ranges_below_0_and_backwards_are_refused() {
    let fact = |param: Param<Span>, low: f32, high: f32| {
        single(dot(0.0)).set(param, span(low, high)).try_cook().unwrap_err().to_string()
    };
    assert_eq!(fact(RADIUS_RANGE, -1.0, 1.0), "`radius_range` is [-1, 1]; expected at least 0 m");
    assert_eq!(
        fact(SPEED_RANGE, 3.0, 1.0),
        "`speed_range` is [3, 1], whose lower end is greater than its upper end; write the smaller number first"
    );
    assert!(fact(LIFE_RANGE, -5.0, 5.0).contains("expected 0…1000000000 frames"));
    assert!(fact(RADIUS_NOISE_RANGE, 0.0, 1.5).contains("expected 0…1"));
    let error = single(dot(0.0)).set(WIND_DIR, [0.0; 3]).try_cook().unwrap_err();
    assert_eq!(error.fact, "`wind_dir` is [0, 0, 0], which has no direction");
}

#[test]
fn results_do_not_depend_on_the_scale_of_the_scene() {
    let at = |scale: f32| {
        let mut curves = field(12);
        curves.part_mut(Kind::Curves).unwrap().edit(P).unwrap().iter_mut().for_each(|p| *p = p.map(|x| x * scale));
        let out = bench(&NODE)
            .input(CURVES, curves)
            .set(RADIUS_RANGE, span(0.3 * scale, 0.6 * scale))
            .set(SPEED_RANGE, span(scale, 3.0 * scale))
            .at(30.0)
            .cook();
        envelope(&out).to_vec()
    };
    let here = at(1.0);
    assert!(here.iter().any(|x| *x > 0.5));
    for scale in [1e-3, 1e3, 1e-6, 1e6] {
        assert!(here.iter().zip(at(scale)).all(|(a, b)| (a - b).abs() < 1e-4), "{scale}");
    }
}

#[test]
fn ten_thousand_gusts_terminate() {
    let out = bench(&NODE)
        .input(CURVES, field(100))
        .set(NUM_GUSTS, 10_000)
        .set(RADIUS_RANGE, span(3.0, 9.0))
        .set(DISTANCE, 0.1)
        .keyed(WIND_DIR, &[(1.0, [1.0, 0.0, 0.0]), (60.0, [1.0, 0.1, 1.0])])
        .at(60.0)
        .cook();
    assert!(out.metrics["active_gusts"] > 3000.0);
    assert!(envelope(&out).iter().all(|x| *x == 1.0));
}

#[test]
fn outside_a_group_the_envelope_keeps_its_bits() {
    let incoming: Vec<f32> = (0..180).map(|cv| cv as f32 / 180.0).collect();
    let mut curves = field(6);
    let part = curves.part_mut(Kind::Curves).unwrap();
    part.set(ENVELOPE, incoming.clone()).unwrap();
    part.set(Attr::<i32>::element("third"), (0..36).map(|curve| curve % 3).collect()).unwrap();
    part.set(Attr::<f32>::point("tips"), (0..180).map(|cv| if cv % 5 == 4 { 0.5 } else { 0.0 }).collect()).unwrap();
    let all = single(curves.clone()).at(20.0).cook();
    for name in ["third", "tips"] {
        let inside = |cv: usize| if name == "third" { !(cv / 5).is_multiple_of(3) } else { cv % 5 == 4 };
        let out = single(curves.clone()).set(GROUP, name.into()).at(20.0).cook();
        for (cv, value) in envelope(&out).iter().enumerate() {
            let expected = if inside(cv) { envelope(&all)[cv] } else { incoming[cv] };
            assert_eq!(value.to_bits(), expected.to_bits(), "{name}, CV {cv}");
        }
        assert!((1.0..all.metrics["reached_points"]).contains(&out.metrics["reached_points"]));
    }
    // Without an envelope, what is outside has 1.
    let part = curves.part_mut(Kind::Curves).unwrap();
    part.remove(Owner::Point, ENVELOPE.name);
    let out = single(curves.clone()).set(GROUP, "tips".into()).at(20.0).cook();
    assert!(envelope(&out).iter().enumerate().all(|(cv, value)| cv % 5 == 4 || *value == 1.0));
    let error = single(curves).set(GROUP, "tipz".into()).at(20.0).try_cook().unwrap_err();
    assert_eq!(error.to_string(), "`group` is `tipz`, which the curves do not have; did you mean `tips`?");
}

#[test]
fn strength_multiplies_each_influence() {
    let gust = single(dot(5.0)).set(DISTANCE, 3.0).set(FALLOFF, ramp(&[[0.0, 0.25]])).set(BASE, 0.125.into());
    let at = |bench: Bench| envelope(&bench.at(48.0).cook())[0];
    for (strength, expected) in [(0.0, 0.125), (0.5, 0.25), (1.0, 0.375), (2.0, 0.625), (9.0, 1.0)] {
        assert_eq!(at(gust.clone().set(STRENGTH, strength.into())), expected, "{strength}");
    }
    // A control of strength ½ about the CV, full at its centre: 0.125 + 2 · 0.5 · 0.25.
    let by_hand = |strength: f32| {
        let outline =
            outline(ControlShape::Sphere, [[1.0; 3]; 2], 1).into_iter().map(|[x, y, z]| [x + 5.0, y, z]).collect();
        let keys = Ramp::constant(0.25);
        let points = gust_control::component(outline, ControlShape::Sphere, 1.0, 0.5, &keys).unwrap();
        at(gust.clone().set(NUM_GUSTS, 0).input(CONTROLS, Geometry::from(points)).set(STRENGTH, strength.into()))
    };
    assert_eq!([by_hand(0.0), by_hand(1.0), by_hand(2.0)], [0.125, 0.25, 0.375]);
}

#[test]
fn gust_is_what_scales_the_envelope_which_never_exceeds_1() {
    let curves = dot(5.0);
    let felt = |incoming: Option<f32>| {
        let mut curves = curves.clone();
        if let Some(incoming) = incoming {
            curves.part_mut(Kind::Curves).unwrap().set(ENVELOPE, vec![incoming]).unwrap();
        }
        let out = single(curves).set(DISTANCE, 3.0).set(FALLOFF, ramp(&[[0.0, 0.5]])).at(48.0).cook();
        (out.curves().get(GUST).unwrap()[0], envelope(&out)[0])
    };
    assert_eq!(felt(None), (0.5, 0.5));
    assert_eq!(felt(Some(0.5)), (0.5, 0.25));
    assert_eq!(felt(Some(8.0)), (0.5, 1.0));
    assert_eq!(felt(Some(-1.0)), (0.5, 0.0));
    let calm = bench(&NODE).input(CURVES, dot(5.0)).set(BASE, 1.0.into()).cook();
    assert_eq!(calm.curves().get(GUST), Some(&[1.0][..]));
}
