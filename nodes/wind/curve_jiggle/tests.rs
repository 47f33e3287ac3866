use super::*;
use conformance::{Bench, BenchResult, bench, conforms};
use engine::graph::Scene;
use engine::param::{ParamType, Source};
use numerics::vector::{DVec3, to_f64};

/// A field of upright curves of 5 CVs, 1 m long, 3 m apart.
fn field() -> Geometry {
    let cvs = (0..9).flat_map(|i| (0..5).map(move |k| [3.0 * (i % 3) as f32, 0.25 * k as f32, 3.0 * (i / 3) as f32]));
    Component::curves(vec![5; 9], cvs.collect()).unwrap().into()
}

/// A mesh of one square under the field, and another one upside down beneath it.
fn ground() -> Geometry {
    let [a, b] = [-1.0, 8.0];
    let square = [[a, 0.0, a], [a, 0.0, b], [b, 0.0, b], [b, 0.0, a]];
    let below = square.map(|[x, y, z]| [x, y - 1.0, z]);
    let corners = vec![0, 1, 2, 3, 7, 6, 5, 4];
    Component::mesh(vec![4, 4], corners, [square, below].concat()).unwrap().into()
}

fn change(geometry: &Geometry, kind: Kind, change: impl Fn([f64; 3]) -> [f64; 3]) -> Geometry {
    let mut geometry = geometry.clone();
    for row in geometry.part_mut(kind).unwrap().edit(P).unwrap() {
        *row = change(row.map(f64::from)).map(|x| x as f32);
    }
    geometry
}

/// The field, blown along x by gusts, most at the tips.
fn blown(frame: Frame) -> Geometry {
    let t = frame.number();
    let gust = libm::sin(0.37 * t) + 0.5 * libm::sin(1.9 * t);
    change(&field(), Kind::Curves, |[x, y, z]| [x + 0.2 * gust * y * y, y, z - 0.1 * gust * y])
}

/// Rolling and travelling: a rotation about a slanting axis, and a translation.
fn rolled(t: f64, p: [f64; 3]) -> [f64; 3] {
    let (s, c) = libm::sincos(0.31 * t);
    let (p, axis) = (DVec3::from(p), DVec3::new(2.0, -1.0, 2.0) / 3.0);
    let travelled = DVec3::new(0.1 * t, libm::sin(0.5 * t), 0.0);
    (p * c + axis.cross(&p) * s + axis * axis.dot(&p) * (1.0 - c) + travelled).into()
}

fn jiggled() -> Bench {
    bench(&NODE).moving(CURVES, blown)
}

fn plain(value: f32) -> Maskable {
    value.into()
}

fn bits(out: &BenchResult) -> Vec<u8> {
    out.curves().table(Owner::Point).column("P").unwrap().to_bytes()
}

fn farthest(a: &[[f32; 3]], b: &[[f32; 3]]) -> f64 {
    let away =
        |(a, b): (&[f32; 3], &[f32; 3])| (0..3).map(|k| (f64::from(a[k]) - f64::from(b[k])).abs()).fold(0.0, f64::max);
    a.iter().zip(b).map(away).fold(0.0, f64::max)
}

/// Largest difference of a segment's length, of curves about 1 m long.
fn length_error(a: &Component, b: &Component) -> f64 {
    let length = |pair: &[[f32; 3]]| (to_f64(pair[1]) - to_f64(pair[0])).norm();
    let curve = |range: std::ops::Range<usize>| {
        let pairs = a.positions()[range.clone()].windows(2).zip(b.positions()[range].windows(2));
        pairs.map(|(a, b)| (length(a) - length(b)).abs()).fold(0.0, f64::max)
    };
    a.runs().ranges().map(curve).fold(0.0, f64::max)
}

#[test]
fn conforms_to_its_declaration() {
    conforms(&NODE);
}

#[test]
fn a_tip_follows_the_spring_equation() {
    // A curve of one segment, 1 km long, so that restoring its length moves the tip along x by only 1e-6 of its swing;
    // its target moves by 1 m from frame 4 to 5, linearly within the frame, and then stays. The reference integrates
    // the equation with d = 1 in small steps.
    let (frequency, zeta, fps) = (3.0, 0.3, 24.0);
    let tall = |frame: Frame| -> Geometry {
        let x = (frame.number() - 4.0).clamp(0.0, 1.0) as f32;
        Component::curves(vec![2], vec![[0.0; 3], [x, 1000.0, 0.0]]).unwrap().into()
    };
    let out = bench(&NODE).moving(CURVES, tall).frames(1..=30);
    let omega = 2.0 * PI * frequency;
    let (mut x, mut v) = (0.0_f64, 0.0_f64);
    for frame in 4..30 {
        let fine = 20_000;
        let dt = 1.0 / fps / f64::from(fine);
        for k in 0..fine {
            let target = |share: f64| if frame == 4 { (f64::from(k) + share) / f64::from(fine) } else { 1.0 };
            let speed = if frame == 4 { fps } else { 0.0 };
            let pull =
                |x: f64, v: f64, share: f64| -2.0 * zeta * omega * (v - speed) - omega * omega * (x - target(share));
            let (x2, v2) = (x + 0.5 * dt * v, v + 0.5 * dt * pull(x, v, 0.0));
            (x, v) = (x + dt * v2, v + dt * pull(x2, v2, 0.5));
        }
        let found = f64::from(out[frame as usize].curves().positions()[1][0]);
        assert!((found - x).abs() < 1e-5, "frame {}: {found} for {x}", frame + 1);
    }
    assert!(out[29].metrics["window_frames"] > 20.0);
}

#[test]
fn lengths_and_roots_are_kept_between_frames_too() {
    let frames: Vec<Frame> = [1.0, 5.0, 5.25, 5.5, 17.9, 18.0].map(|frame| Frame::exactly(frame).unwrap()).to_vec();
    let out = jiggled().try_frames(&frames).unwrap();
    for (frame, out) in frames.iter().zip(&out) {
        let incoming = blown(*frame);
        assert!(length_error(out.curves(), incoming.curves().unwrap()) < 1e-6, "frame {frame}");
        let roots = |part: &Component| part.runs().ranges().map(|cvs| part.positions()[cvs.start]).collect::<Vec<_>>();
        assert_eq!(roots(out.curves()), roots(incoming.curves().unwrap()), "frame {frame}");
    }
}

#[test]
fn frames_cooked_alone_or_backwards_have_the_same_bits() {
    let mut masked = field();
    let soft: Vec<f32> = (0..45).map(|k| 0.2 * (k % 7) as f32).collect();
    masked.part_mut(Kind::Curves).unwrap().set(Attr::<f32>::point("soft"), soft).unwrap();
    let moving = move |frame: Frame| {
        let mut curves = masked.clone();
        curves.part_mut(Kind::Curves).unwrap().set(P, blown(frame).curves().unwrap().positions().to_vec()).unwrap();
        curves
    };
    let skin = |frame: Frame| change(&ground(), Kind::Mesh, |p| rolled(frame.number(), p));
    let scene = Scene { last: 120, ..Scene::default() };
    let windy = bench(&NODE)
        .moving(CURVES, moving)
        .moving(SKIN, skin)
        .scene(scene)
        .set(FREQUENCY, Maskable { value: 4.0, attribute: Some("soft".into()) })
        .set(INHERIT_MOTION, 0.7.into())
        .keyed(DAMPING, &[(1.0, plain(0.8)), (60.0, plain(0.3)), (120.0, plain(2.0))]);
    let in_order = windy.frames(1..=120);
    for (frame, threads) in [(120, 1), (97, 7), (40, 1), (39, 7), (2, 1), (1, 7)] {
        let alone = windy.clone().threads(threads).at(f64::from(frame)).cook();
        assert_eq!(bits(&alone), bits(&in_order[frame as usize - 1]), "frame {frame}");
    }
}

#[test]
fn the_error_of_a_window_is_within_the_tolerance() {
    let scene = || Scene { last: 200, ..Scene::default() };
    for damping in [0.2, 1.0, 3.0] {
        let with = |tolerance: f64| {
            jiggled().scene(scene()).set(DAMPING, plain(damping)).set(TOLERANCE, tolerance).at(200.0).cook()
        };
        let exact = with(1e-12);
        for tolerance in [1e-2, 1e-4] {
            let out = with(tolerance);
            let error = farthest(out.curves().positions(), exact.curves().positions());
            // The tips swing by about 0.3 m.
            assert!(error < 0.5 * tolerance, "{damping} {tolerance}: {error}");
            assert!(out.metrics["window_frames"] < exact.metrics["window_frames"]);
        }
    }
}

#[test]
fn windows_after_a_key_of_the_frequency_are_long_enough() {
    let scene = || Scene { last: 200, ..Scene::default() };
    // Slow until frame 180; windows anchored after it would be too short if they used the frequency there.
    let keys = [(1.0, plain(0.8)), (180.0, plain(0.8)), (181.0, plain(12.0))];
    let with = |tolerance: f64| jiggled().scene(scene()).keyed(FREQUENCY, &keys).set(TOLERANCE, tolerance);
    for frame in [179.0, 181.0, 183.0, 190.0] {
        let [out, exact] = [1e-3, 1e-12].map(|tolerance| with(tolerance).at(frame).cook());
        let error = farthest(out.curves().positions(), exact.curves().positions());
        assert!(error < 1e-3, "frame {frame}: {error}");
    }
}

#[test]
fn curves_moved_rigidly_with_their_skin_do_not_swing_if_motion_is_inherited() {
    let curves = |frame: Frame| change(&field(), Kind::Curves, |p| rolled(frame.number(), p));
    let skin = |frame: Frame| change(&ground(), Kind::Mesh, |p| rolled(frame.number(), p));
    let moving = |share: f32| bench(&NODE).moving(CURVES, curves).moving(SKIN, skin).set(INHERIT_MOTION, share.into());
    for frame in [2, 9, 33, 48] {
        let targets = curves(Frame::whole(frame));
        let out = moving(1.0).at(frame as f64).cook();
        // 1e-6 of a metre and 4 ulp of the positions, up to 16 m away.
        assert!(farthest(out.curves().positions(), targets.curves().unwrap().positions()) < 1e-6 + 4.0 * 1e-6);
        let world = bench(&NODE).moving(CURVES, curves).at(frame as f64).cook();
        assert_eq!(bits(&moving(0.0).at(frame as f64).cook()), bits(&world), "frame {frame}");
        assert!(world.metrics["max_offset"] > 0.05);
        let half = moving(0.5).at(frame as f64).cook().metrics["max_offset"];
        assert!(half > 0.01 && half < world.metrics["max_offset"], "frame {frame}: {half}");
    }
}

#[test]
fn curves_on_a_rolling_skin_swing_in_wind_as_on_a_still_one() {
    let windy = |roll: bool| {
        let curves = move |frame: Frame| {
            let t = if roll { frame.number() } else { 1.0 };
            change(&blown(frame), Kind::Curves, |p| rolled(t, p))
        };
        let skin = move |frame: Frame| {
            let t = if roll { frame.number() } else { 1.0 };
            change(&ground(), Kind::Mesh, |p| rolled(t, p))
        };
        bench(&NODE).moving(CURVES, curves).moving(SKIN, skin)
    };
    let [still, rolling] = [false, true].map(|roll| windy(roll).at(30.0).cook().metrics["max_offset"]);
    assert!(still > 0.02 && (still - rolling).abs() < 1e-5, "{still} {rolling}");
}

#[test]
fn without_swing_the_same_arrays_pass_through() {
    let column = |part: &Component| part.table(Owner::Point).column("P").unwrap().address();
    let still = field();
    let off = [
        bench(&NODE).set(BLEND, plain(0.0)),
        bench(&NODE).set(RAMP, Arc::new(Ramp::constant(0.0))),
        bench(&NODE).set(RAMP, Arc::new(Ramp::constant(-1.0))),
    ];
    for off in off {
        let out = off.input(CURVES, still.clone()).cook();
        assert_eq!(column(out.curves()), column(still.curves().unwrap()));
        assert_eq!(out.metrics["window_frames"], 0.0);
    }
    let out = jiggled().set(BLEND, plain(0.0)).at(9.0).cook();
    assert_eq!(out.curves().positions(), blown(Frame::whole(9)).curves().unwrap().positions());
}

#[test]
fn curves_start_from_rest_when_a_keyed_blend_rises() {
    let keys = [(1.0, plain(1.0)), (9.0, plain(0.0)), (20.0, plain(0.0)), (21.0, plain(1.0))];
    // A constant ramp: scenes that start at other frames have other arc lengths there, which must not matter.
    let evenly = |bench: Bench| bench.set(RAMP, Arc::new(Ramp::constant(1.0))).set(TOLERANCE, 1e-9);
    let out = evenly(jiggled().keyed(BLEND, &keys)).frames(1..=48);
    assert!(out[4].metrics["max_offset"] > 0.0);
    assert_eq!(out[12].metrics["max_offset"], 0.0);
    // The same as a scene that starts at frame 20 with the wind of that time.
    let late = |frame: Frame| blown(frame.plus(19));
    let fresh = evenly(bench(&NODE).moving(CURVES, late)).frames(1..=20);
    for k in 1..20 {
        assert_eq!(bits(&out[19 + k]), bits(&fresh[k]), "frame {}", 20 + k);
    }
}

#[test]
fn with_preroll_the_scene_starts_in_motion() {
    let first = |preroll: i64| jiggled().set(PREROLL, preroll).cook();
    assert_eq!(bits(&first(0)), bits(&bench(&NODE).input(CURVES, blown(Frame::whole(1))).cook()));
    assert!(first(40).metrics["max_offset"] > 0.01);
    // Frames beyond the window have no effect.
    let window = first(0).metrics["window_frames"] as i64;
    assert_eq!(bits(&first(window)), bits(&first(10 * window)));
    // The same as a scene that starts that much earlier, except for the lengths at its first frame.
    let evenly = || jiggled().set(RAMP, Arc::new(Ramp::constant(1.0))).set(TOLERANCE, 1e-9);
    let scene = Scene { first: -39, last: 48, ..Scene::default() };
    assert_eq!(bits(&evenly().scene(scene).cook()), bits(&evenly().set(PREROLL, 40).cook()));
}

#[test]
fn masks_act_per_cv_and_missing_ones_are_refused() {
    let masked = |mask: f32| {
        move |frame: Frame| {
            let mut curves = blown(frame);
            curves.part_mut(Kind::Curves).unwrap().set(Attr::<f32>::point("mask"), vec![mask; 45]).unwrap();
            curves
        }
    };
    let by = |value: f32| Maskable { value, attribute: Some("mask".into()) };
    let with = |mask: f32| bench(&NODE).moving(CURVES, masked(mask)).at(12.0);
    let constant = |value: Maskable| Source::Constant(Maskable::erase(value));
    for param in ["frequency", "damping", "blend"] {
        let [scaled, plainly] = [by(0.8), plain(0.4)].map(|value| with(0.5).source(param, constant(value)));
        // Windows differ, since a mask may be ¼ elsewhere; here both reach the start of the scene.
        assert_eq!(bits(&scaled.set(TOLERANCE, 1e-9).cook()), bits(&plainly.set(TOLERANCE, 1e-9).cook()));
        let error = jiggled().source(param, constant(by(0.5))).at(3.0).try_cook().unwrap_err();
        assert_eq!(error.fact, format!("`{param}` is masked by `mask`, which the curves do not have"));
    }
    let window = |value: Maskable| with(1.0).set(FREQUENCY, value).cook().metrics["window_frames"];
    assert_eq!(window(by(2.0)), window(plain(0.5)));
}

#[test]
fn curves_and_skins_that_change_are_refused() {
    let other = |frame: Frame| -> Geometry {
        let count = if frame.number() < 5.0 { 3 } else { 2 };
        Component::curves(vec![count; 2], vec![[0.0; 3]; 2 * count as usize]).unwrap().into()
    };
    let error = bench(&NODE).moving(CURVES, other).at(6.0).try_cook().unwrap_err();
    assert_eq!(
        error.fact,
        "`curves` has changed since the scene's first frame: it had 2 curves of 6 points then, and has 2 curves of 4 \
         points now"
    );
    let flipped = |frame: Frame| -> Geometry {
        let corners = if frame.number() < 5.0 { vec![0, 1, 2] } else { vec![0, 2, 1] };
        Component::mesh(vec![3], corners, vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]).unwrap().into()
    };
    let error = jiggled().moving(SKIN, flipped).at(6.0).try_cook().unwrap_err();
    assert_eq!(error.fact, "`skin` is mirrored, which turns its faces inside out since the scene's first frame");
    let joined = |frame: Frame| -> Geometry {
        let corners = if frame.number() < 5.0 { vec![0, 1, 2] } else { vec![0, 1, 1] };
        Component::mesh(vec![3], corners, vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]).unwrap().into()
    };
    assert_eq!(
        jiggled().moving(SKIN, joined).at(6.0).try_cook().unwrap_err().fact,
        "`skin` has changed since the scene's first frame: it has 1 faces of 3 points with another topology"
    );
    assert!(jiggled().moving(SKIN, flipped).at(4.0).try_cook().is_ok());
}

#[test]
fn frequencies_from_a_millionth_to_a_thousand_million_hertz_and_any_damping_are_stable() {
    for frequency in [1e-6, 3.0, 1e9] {
        for damping in [1e-6, 1.0, 1e6] {
            for fps in [1e-3, 24.0, 1e6] {
                let scene = Scene { fps, last: 48, ..Scene::default() };
                let out = jiggled()
                    .scene(scene)
                    .set(FREQUENCY, plain(frequency))
                    .set(DAMPING, plain(damping))
                    .at(30.0)
                    .cook();
                let targets = blown(Frame::whole(30));
                let far = farthest(out.curves().positions(), targets.curves().unwrap().positions());
                assert!(far < 2.0, "{frequency} Hz, {damping}, {fps} fps: {far}");
                assert!(length_error(out.curves(), targets.curves().unwrap()) < 1e-6);
                if frequency == 1e9 && damping == 1.0 && fps == 24.0 {
                    assert_eq!(out.curves().positions(), targets.curves().unwrap().positions());
                }
            }
        }
    }
}

#[test]
fn empty_single_cv_and_folded_curves_work() {
    let none = Geometry::from(Component::curves(Vec::new(), Vec::new()).unwrap());
    assert_eq!(bench(&NODE).moving(CURVES, move |_| none.clone()).at(5.0).cook().curves().point_count(), 0);
    let dots = |frame: Frame| -> Geometry {
        let x = frame.number() as f32;
        Component::curves(vec![1, 2, 3], vec![[x, 0.0, 0.0]; 6]).unwrap().into()
    };
    let out = bench(&NODE).moving(CURVES, dots).at(9.0).cook();
    assert_eq!(out.curves().positions(), [[9.0, 0.0, 0.0]; 6]);
    let empty = Geometry::from(Component::mesh(Vec::new(), Vec::new(), Vec::new()).unwrap());
    assert_eq!(bits(&jiggled().input(SKIN, empty).at(9.0).cook()), bits(&jiggled().at(9.0).cook()));
}

#[test]
fn outside_a_group_curves_keep_their_bits() {
    let grouped = |frame: Frame| {
        let mut curves = blown(frame);
        let part = curves.part_mut(Kind::Curves).unwrap();
        part.set(Attr::<i32>::element("third"), (0..9).map(|curve| curve % 3).collect()).unwrap();
        curves
    };
    let swing = |name: &str| bench(&NODE).moving(CURVES, grouped).set(GROUP, name.into()).at(9.0).cook();
    let (all, third) = (swing(""), swing("third"));
    let target = blown(Frame::whole(9));
    for (cv, still) in target.curves().unwrap().positions().iter().enumerate() {
        let expected = if cv / 5 % 3 == 0 { *still } else { all.curves().positions()[cv] };
        assert_eq!(third.curves().positions()[cv].map(f32::to_bits), expected.map(f32::to_bits), "CV {cv}");
    }
    assert_ne!(all.curves().positions(), target.curves().unwrap().positions());
}

#[test]
fn curves_of_a_clump_swing_by_the_mean_of_their_swings() {
    // Curve k is blown by 0.002·k; 1, 2 and 3 are a clump, of the swing of curve 2.
    let moving = |frame: Frame| -> Geometry {
        let gust = libm::sin(0.9 * frame.number());
        let mut curves = field();
        let part = curves.part_mut(Kind::Curves).unwrap();
        for (cv, p) in part.edit(P).unwrap().iter_mut().enumerate() {
            p[0] += (0.002 * (cv / 5) as f64 * gust) as f32 * p[1];
        }
        part.set(Attr::<i32>::element("tuft"), vec![-1, 6, 6, 6, -1, 0, 0, 1, 2]).unwrap();
        curves
    };
    let at = |bench: Bench| {
        let out = bench.at(9.0).cook();
        let incoming = moving(Frame::whole(9));
        let (now, target) = (out.curves().positions().to_vec(), incoming.curves().unwrap().positions().to_vec());
        assert!(length_error(out.curves(), incoming.curves().unwrap()) < 1e-6);
        now.iter().zip(target).map(|(a, b)| f64::from(a[0]) - f64::from(b[0])).collect::<Vec<f64>>()
    };
    let jiggled = || bench(&NODE).moving(CURVES, moving);
    let (own, together) = (at(jiggled()), at(jiggled().set(CLUMP, "tuft".into())));
    assert!(own[14].abs() > 2e-4, "{}", own[14]);
    for cv in 0..45 {
        let expected = if (5..20).contains(&cv) { own[10 + cv % 5] } else { own[cv] };
        // Restoring lengths turns segments that lean differently by second order.
        assert!((25..35).contains(&cv) || (together[cv] - expected).abs() < 2e-6, "CV {cv}: {}", together[cv]);
    }
    assert_eq!(at(jiggled().set(CLUMP, "tuft".into()).set(CLUMP_BLEND, 0.0.into())), own);
    // Found by radius: roots are 3 m apart, so all curves are one clump or none.
    assert_eq!(at(jiggled().set(CLUMP_RADIUS, 2.9)), own);
    let all = at(jiggled().set(CLUMP_RADIUS, 20.0));
    assert!((0..45).all(|cv| (all[cv] - own[20 + cv % 5]).abs() < 2e-6), "the mean of 0…8 is 4");
}

#[test]
fn inherited_motion_may_be_masked_at_the_roots() {
    let mut rest = field();
    let part = rest.part_mut(Kind::Curves).unwrap();
    part.set(Attr::<f32>::element("rides"), (0..9).map(|curve| (curve % 2) as f32).collect()).unwrap();
    let curves = move |frame: Frame| change(&rest, Kind::Curves, |p| rolled(frame.number(), p));
    let skin = |frame: Frame| change(&ground(), Kind::Mesh, |p| rolled(frame.number(), p));
    let with = |share: Maskable| {
        let bench = bench(&NODE).moving(CURVES, curves.clone()).moving(SKIN, skin).set(INHERIT_MOTION, share);
        bench.at(6.0).cook().curves().positions().to_vec()
    };
    let (none, all) = (with(0.0.into()), with(1.0.into()));
    let mixed = with(Maskable { value: 1.0, attribute: Some("rides".into()) });
    for curve in 0..9 {
        let expected = if curve % 2 == 0 { &none } else { &all };
        assert_eq!(mixed[curve * 5..][..5], expected[curve * 5..][..5], "curve {curve}");
    }
    assert!(farthest(&none, &all) > 1e-2);
}
