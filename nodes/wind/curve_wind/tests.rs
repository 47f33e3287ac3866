use super::*;
use conformance::{Bench, BenchResult, bench, conforms};
use engine::graph::Scene;
use numerics::vector;

/// A straight curve up from the origin, of `segments` segments and length 1.
fn upright(segments: usize) -> Geometry {
    let cv = |k: usize| [0.0, k as f32 / segments as f32, 0.0];
    Component::curves(vec![segments as u32 + 1], (0..=segments).map(cv).collect()).unwrap().into()
}

/// A field of upright curves, a metre apart.
fn field(n: usize) -> Geometry {
    let cvs = (0..n * n).flat_map(|i| (0..5).map(move |k| [(i % n) as f32, 0.25 * k as f32, (i / n) as f32]));
    Component::curves(vec![5; n * n], cvs.collect()).unwrap().into()
}

fn calm(curves: Geometry) -> Bench {
    bench(&NODE).input(CURVES, curves).set(NOISE, None)
}

/// Angle of each segment of the first curve to the wind along x, radians.
fn angles(out: &BenchResult) -> Vec<f64> {
    let cvs = &out.curves().positions()[out.curves().runs().range(0)];
    let angle = |pair: &[[f32; 3]]| {
        let d: [f64; 3] = std::array::from_fn(|k| f64::from(pair[1][k]) - f64::from(pair[0][k]));
        libm::atan2((d[1] * d[1] + d[2] * d[2]).sqrt(), d[0])
    };
    cvs.windows(2).map(angle).collect()
}

#[test]
fn conforms_to_its_declaration() {
    conforms(&NODE);
}

const RIGHT: f64 = std::f64::consts::FRAC_PI_2;

#[test]
fn the_angle_of_segment_k_is_multiplied_by_one_minus_g_to_the_k() {
    // W2 by hand: at every CV the rest of a straight curve turns by g times the remaining angle, so segment k = 1…
    // has 90° · (1 − g)^k: 45, 22.5, 11.25, 5.625 for g = ½.
    let out = calm(upright(4)).set(GLOBAL_ROTATE, 0.5.into()).cook();
    for (k, angle) in angles(&out).iter().enumerate() {
        let left = RIGHT / f64::from(2 << k);
        assert!((angle - left).abs() < 4e-6, "segment {}: {angle} rad, expected {left}", k + 1);
    }
    assert!((out.metrics["max_angle"] - (RIGHT - RIGHT / 16.0)).abs() < 4e-6);
    assert!(out.metrics["length_error"] < 1e-6);
}

#[test]
fn resolution_free_bends_the_same_for_any_number_of_cvs() {
    let tip = |segments: usize| {
        let out = calm(upright(segments)).set(MODE, Mode::ResolutionFree).cook();
        out.curves().positions()[segments]
    };
    let fine = tip(1024);
    let [coarse, finer] = [8, 16].map(|segments| vector::length(vector::sub(tip(segments), fine)));
    assert!(coarse < 1e-2, "{coarse}");
    assert!((3.0..5.0).contains(&(coarse / finer)), "order 2: {coarse} to {finer}");
}

#[test]
fn the_envelope_scales_the_turn_and_counts_as_one_if_missing() {
    let with = |envelope: f32| {
        let mut curves = upright(1);
        curves.part_mut(Kind::Curves).unwrap().set(ENVELOPE, vec![envelope; 2]).unwrap();
        angles(&calm(curves).cook())[0]
    };
    assert!((with(0.5) - RIGHT * 0.75).abs() < 1e-6);
    assert_eq!(with(0.0), RIGHT);
    assert_eq!(with(-3.0), RIGHT, "an envelope below 0 counts as 0");
    assert_eq!(with(1.0), angles(&calm(upright(1)).cook())[0]);
}

#[test]
fn masks_scale_per_cv_and_missing_ones_are_refused() {
    let mut curves = upright(1);
    curves.part_mut(Kind::Curves).unwrap().set(Attr::<f32>::point("soft"), vec![0.5, 1.0]).unwrap();
    let masked = Maskable { value: 0.5, attribute: Some("soft".into()) };
    let out = calm(curves).set(GLOBAL_ROTATE, masked.clone()).cook();
    assert!((angles(&out)[0] - RIGHT * 0.75).abs() < 1e-6);
    let error = calm(upright(1)).set(GLOBAL_ROTATE, masked.clone()).try_cook().unwrap_err();
    assert_eq!(error.fact, "`global_rotate` is masked by `soft`, which the curves do not have");
    let mut curves = upright(1);
    curves.part_mut(Kind::Curves).unwrap().set(Attr::<[f32; 3]>::element("soft"), vec![[0.5; 3]]).unwrap();
    let error = calm(curves).set(GLOBAL_ROTATE, masked).try_cook().unwrap_err();
    assert_eq!(
        error.to_string(),
        "`global_rotate` is masked by `soft`, which is one float3 for each curve; expected one float for each CV"
    );
}

/// A mask of whole numbers, of each CV or of each curve, is that of the floats with these values.
#[test]
fn a_mask_may_be_whole_numbers_or_numbers_of_curves() {
    let with = |set: &dyn Fn(&mut Component)| {
        let mut curves = field(2);
        set(curves.part_mut(Kind::Curves).unwrap());
        let masked = Maskable { value: 0.5, attribute: Some("soft".into()) };
        calm(curves).set(GLOBAL_ROTATE, masked).cook().curves().positions().to_vec()
    };
    let of = |curve: usize| [0.0_f32, 1.0, 2.0, 0.5][curve];
    let floats = with(&|curves| curves.set(Attr::point("soft"), (0..20).map(|cv| of(cv / 5)).collect()).unwrap());
    let curves = with(&|curves| curves.set(Attr::element("soft"), (0..4).map(of).collect()).unwrap());
    assert_eq!(floats, curves);
    let ones = with(&|curves| curves.set(Attr::point("soft"), (0..20).map(|cv| of(cv / 5).floor()).collect()).unwrap());
    let whole = |count: usize| (0..count).map(|row| of(row * 4 / count) as i32).collect::<Vec<i32>>();
    assert_eq!(ones, with(&|curves| curves.set(Attr::point("soft"), whole(20)).unwrap()));
    assert_eq!(ones, with(&|curves| curves.set(Attr::element("soft"), whole(4)).unwrap()));
    assert_ne!(ones, floats);
}

/// Curves of the group bend as without one; the others keep their bits, and so does the part of a curve before its first
/// CV in the group.
#[test]
fn outside_a_group_curves_keep_their_bits() {
    let mut curves = field(3);
    let part = curves.part_mut(Kind::Curves).unwrap();
    part.set(Attr::<i32>::element("third"), (0..9).map(|curve| curve % 3).collect()).unwrap();
    part.set(Attr::<f32>::point("tips"), (0..45).map(|cv| if cv % 5 >= 2 { 0.5 } else { 0.0 }).collect()).unwrap();
    let windy = |name: &str| bench(&NODE).input(CURVES, curves.clone()).set(GROUP, name.into()).cook();
    let at = |out: &BenchResult, cv: usize| out.curves().positions()[cv].map(f32::to_bits);
    let (still, all, third) = (curves.curves().unwrap().positions(), windy(""), windy("third"));
    for (cv, still) in still.iter().enumerate() {
        let expected = if cv / 5 % 3 == 0 { still.map(f32::to_bits) } else { at(&all, cv) };
        assert_eq!(at(&third, cv), expected, "CV {cv}");
    }
    let tips = windy("tips");
    for (cv, still) in still.iter().enumerate() {
        assert_eq!(at(&tips, cv) == still.map(f32::to_bits), cv % 5 <= 2, "CV {cv}");
    }
    assert!(tips.metrics["length_error"] < 1e-6);
}

/// Where the mask is 0 the wind blows straight, where it is 1 as without a mask.
#[test]
fn a_mask_scales_the_noise_where_it_is() {
    let with = |amplitude: f32, mask: Option<fn(usize) -> f32>| {
        let mut curves = field(2);
        let part = curves.part_mut(Kind::Curves).unwrap();
        let attribute = mask.map(|mask| {
            part.set(Attr::element("noisy"), (0..4).map(mask).collect()).unwrap();
            Name::from("noisy")
        });
        let bench = bench(&NODE).input(CURVES, curves).set(AMPLITUDE, Maskable { value: amplitude, attribute });
        bench.cook().curves().positions().to_vec()
    };
    let (straight, noisy) = (with(0.0, None), with(0.8, None));
    let mixed = with(0.8, Some(|curve| (curve % 2) as f32));
    for curve in 0..4 {
        let expected = if curve % 2 == 0 { &straight } else { &noisy };
        assert_eq!(mixed[curve * 5..][..5], expected[curve * 5..][..5], "curve {curve}");
        assert_ne!(straight[curve * 5 + 4], noisy[curve * 5 + 4]);
    }
}

#[test]
fn half_blend_is_half_the_turn_and_keeps_lengths() {
    let whole = angles(&calm(upright(4)).cook());
    let out = calm(upright(4)).set(BLEND, 0.5.into()).cook();
    for (half, whole) in angles(&out).iter().zip(whole) {
        assert!((RIGHT - half - 0.5 * (RIGHT - whole)).abs() < 4e-6);
    }
    assert!(out.metrics["length_error"] < 1e-6);
}

#[test]
fn without_a_turn_the_same_arrays_pass_through() {
    let curves = field(2);
    for share in [GLOBAL_ROTATE, BLEND] {
        let out = bench(&NODE).input(CURVES, curves.clone()).set(share, 0.0.into()).cook();
        let column = |part: &Component| part.table(Owner::Point).column("P").unwrap().address();
        assert_eq!(column(out.curves()), column(curves.curves().unwrap()));
    }
}

#[test]
fn noise_scrolls_downwind() {
    // After a second at 2 m/s, the noise that was at x is at x + 2: curve 2 bends as curve 0 did.
    let windy = bench(&NODE).input(CURVES, field(4)).set(SCROLL, 2.0);
    let shape = |out: &BenchResult, curve: usize| {
        let cvs = &out.curves().positions()[out.curves().runs().range(curve)];
        cvs.iter().map(|cv| vector::sub(*cv, cvs[0])).collect::<Vec<_>>()
    };
    let (early, late) = (windy.clone().at(10.0).cook(), windy.at(34.0).cook());
    for (a, b) in shape(&early, 0).iter().zip(shape(&late, 2)) {
        assert!((0..3).all(|k| (a[k] - b[k]).abs() < 1e-5), "{a:?} {b:?}");
    }
    assert_ne!(shape(&early, 0), shape(&late, 0));
}

#[test]
fn a_keyed_scroll_does_not_jump() {
    // From 1 to 100 m/s within a frame: the pattern must not move farther than its speed allows.
    let windy = bench(&NODE).input(CURVES, field(3)).set(FREQUENCY, 0.001).keyed(SCROLL, &[(10.0, 1.0), (11.0, 100.0)]);
    let frames = windy.frames(8..=14);
    let moved = |pair: &[BenchResult]| {
        let points = pair.iter().map(|out| out.curves().positions()).collect::<Vec<_>>();
        points[0].iter().zip(points[1]).map(|(a, b)| (a[0] - b[0]).abs()).fold(0.0, f32::max)
    };
    // 100 m/s × 1/24 s × 0.001 cells a metre is 0.004 cells; the field's slope is below 4 a cell.
    assert!(frames.windows(2).map(moved).fold(0.0, f32::max) < 0.02);
}

#[test]
fn frames_cooked_alone_have_the_same_bits() {
    let windy = bench(&NODE)
        .input(CURVES, field(5))
        .keyed(WIND_DIR, &[(1.0, [1.0, 0.0, 0.0]), (20.0, [0.0, 0.2, 1.0])])
        .keyed(SCROLL, &[(1.0, 0.5), (20.0, 3.0)]);
    let bits = |out: &BenchResult| out.curves().table(Owner::Point).column("P").unwrap().to_bytes();
    let in_order = windy.frames(1..=20);
    for frame in [20_i64, 7, 13, 1] {
        let alone = windy.clone().threads(if frame == 7 { 1 } else { 7 }).at(frame as f64).cook();
        assert_eq!(bits(&alone), bits(&in_order[frame as usize - 1]), "frame {frame}");
    }
}

#[test]
fn rest_noise_sticks_to_a_moving_animal() {
    let moving = |frame: Frame| {
        let mut curves = field(3);
        for row in curves.part_mut(Kind::Curves).unwrap().edit(P).unwrap() {
            row[0] += 0.37 * (frame.number() - 1.0) as f32;
        }
        curves
    };
    let windy = bench(&NODE).moving(CURVES, moving).set(SCROLL, 0.0);
    let bend = |space: Space, frame: f64| {
        let out = windy.clone().set(NOISE_SPACE, space).at(frame).cook();
        let cvs = out.curves().positions();
        [cvs[4][0] - cvs[0][0], cvs[4][1] - cvs[0][1]]
    };
    let close = |a: [f32; 2], b: [f32; 2]| (a[0] - b[0]).abs() < 1e-5 && (a[1] - b[1]).abs() < 1e-5;
    assert!(close(bend(Space::Rest, 1.0), bend(Space::Rest, 9.0)));
    assert!(!close(bend(Space::World, 1.0), bend(Space::World, 9.0)));
}

#[test]
fn rest_noise_needs_the_curves_of_the_first_frame_or_a_pref() {
    let cooked = |has_rest: bool| {
        let growing = move |frame: Frame| {
            let mut geometry = field(if frame.number() < 2.0 { 2 } else { 3 });
            let curves = geometry.part_mut(Kind::Curves).unwrap();
            if has_rest {
                curves.set(PREF, curves.positions().to_vec()).unwrap();
            }
            geometry
        };
        bench(&NODE).moving(CURVES, growing).set(NOISE_SPACE, Space::Rest).at(2.0).try_cook()
    };
    let refused = cooked(false).expect_err("the curves at rest are unknown");
    let fact =
        "without `Pref`, the shape at rest of `curves` is that of the first frame, which has other points or elements";
    assert_eq!(refused.fact, fact);
    assert_eq!(refused.hint.unwrap(), "give the curves a `Pref`, or set `noise_space` to \"world\"");
    assert!(cooked(true).is_ok());
}

#[test]
fn the_origin_of_the_scene_moves_the_noise_only() {
    let windy = bench(&NODE).input(CURVES, field(2));
    let at = |origin: [f64; 3], shift: f32| {
        let mut curves = field(2);
        curves.part_mut(Kind::Curves).unwrap().edit(P).unwrap().iter_mut().for_each(|row| row[0] += shift);
        let scene = Scene { origin, ..Scene::default() };
        let out = bench(&NODE).input(CURVES, curves).scene(scene).cook();
        out.curves().positions().iter().map(|row| [row[0] - shift, row[1], row[2]]).collect::<Vec<_>>()
    };
    let (near, far) = (at([0.0; 3], 8.0), at([8.0, 0.0, 0.0], 0.0));
    assert!(near.iter().zip(&far).all(|(a, b)| (0..3).all(|k| (a[k] - b[k]).abs() < 2e-6)));
    assert_ne!(windy.cook().curves().positions(), far);
}

#[test]
fn wind_of_any_length_and_wind_against_the_curve_give_finite_results() {
    for wind in [[1e-300, 0.0, 0.0], [1e300, 1e300, 0.0], [0.0, -1.0, 0.0], [0.0, 1.0, 0.0]] {
        let out = calm(upright(4)).set(WIND_DIR, wind).cook();
        assert!(out.curves().positions().as_flattened().iter().all(|x| x.is_finite()), "{wind:?}");
        assert!(out.metrics["length_error"] < 1e-5);
    }
    let error = calm(upright(1)).set(WIND_DIR, [0.0; 3]).try_cook().unwrap_err();
    assert_eq!(error.fact, "`wind_dir` is [0, 0, 0], which has no direction");
}

#[test]
fn empty_and_single_cv_curves_pass_through() {
    let none = Geometry::from(Component::curves(Vec::new(), Vec::new()).unwrap());
    assert_eq!(bench(&NODE).input(CURVES, none).cook().curves().point_count(), 0);
    let dots = Geometry::from(Component::curves(vec![1, 1], vec![[1.0; 3], [2.0; 3]]).unwrap());
    assert_eq!(bench(&NODE).input(CURVES, dots).cook().curves().positions(), [[1.0; 3], [2.0; 3]]);
}

#[test]
fn what_gusts_add_turns_the_wind() {
    // Wind along x, a gust of the same strength along z: with all of the turn segments lie along the diagonal.
    let mut curves = upright(3);
    curves.part_mut(Kind::Curves).unwrap().set(GUST_DIR, vec![[0.0, 0.0, 1.0]; 4]).unwrap();
    let out = calm(curves.clone()).set(GLOBAL_ROTATE, 1.0.into()).cook();
    let tip = out.curves().positions()[3];
    let half = std::f32::consts::FRAC_1_SQRT_2;
    assert!((tip[0] - half).abs() < 1e-6 && tip[1].abs() < 1e-6 && (tip[2] - half).abs() < 1e-6, "{tip:?}");
    let with = |gust: Option<[f32; 3]>| {
        let mut curves = field(3);
        if let Some(gust) = gust {
            curves.part_mut(Kind::Curves).unwrap().set(GUST_DIR, vec![gust; 45]).unwrap();
        }
        bench(&NODE).input(CURVES, curves).cook().curves().positions().to_vec()
    };
    assert_eq!(with(Some([0.0; 3])), with(None));
    assert_ne!(with(Some([0.0, 0.0, 0.2])), with(None));
}

/// Shapes of curves relative to their roots.
fn shapes(out: &BenchResult) -> Vec<[f32; 3]> {
    let cvs = out.curves().positions();
    cvs.iter().enumerate().map(|(cv, p)| vector::sub(*p, cvs[cv - cv % 5])).collect()
}

fn farthest(a: &[[f32; 3]], b: &[[f32; 3]]) -> f32 {
    a.iter().zip(b).map(|(a, b)| vector::length(vector::sub(*a, *b))).fold(0.0, f32::max)
}

#[test]
fn looped_noise_comes_again_and_does_not_jump_where_the_loop_closes() {
    let windy = bench(&NODE).input(CURVES, field(4)).set(SCROLL, 3.0).set(LOOP, 24.0);
    let at = |frame: f64| shapes(&windy.clone().at(frame).cook());
    for frame in [0.0, 1.0, 7.25, 23.0] {
        for loops in [1.0, 40.0, -1.0] {
            assert!(farthest(&at(frame), &at(frame + 24.0 * loops)) < 1e-6, "{frame} {loops}");
        }
    }
    // From the last frame to the first as from frame to frame.
    let steps: Vec<f32> = (0..24).map(|k| farthest(&at(f64::from(k)), &at(f64::from(k) + 1.0))).collect();
    let inside = steps[..23].iter().copied().fold(0.0, f32::max);
    assert!(steps[23] < 1.5 * inside && steps[23] > 0.0, "{steps:?}");
    // Keyed speeds: the loop holds as long as other params repeat.
    let keyed = windy.clone().keyed(SCROLL, &[(0.0, 1.0), (12.0, 5.0), (24.0, 1.0)]);
    let at = |frame: f64| shapes(&keyed.clone().at(frame).cook());
    assert!(farthest(&at(5.0), &at(29.0)) < 1e-6 && farthest(&at(5.0), &at(17.0)) > 1e-3);
    // At the start of a loop the pattern is that without it.
    let free = bench(&NODE).input(CURVES, field(4)).set(SCROLL, 3.0);
    assert!(farthest(&shapes(&free.at(0.0).cook()), &shapes(&windy.at(0.0).cook())) < 1e-6);
}

#[test]
fn curves_of_a_clump_bend_as_one() {
    let mut curves = field(4);
    let part = curves.part_mut(Kind::Curves).unwrap();
    part.set(Attr::<i32>::element("tuft"), (0..16).map(|curve| curve / 2 - 1).collect()).unwrap();
    let windy = |name: &str| bench(&NODE).input(CURVES, curves.clone()).set(CLUMP, name.into());
    let shape = |bench: Bench| shapes(&bench.cook());
    let (own, together) = (shape(windy("")), shape(windy("tuft")));
    assert_eq!(own[..10], together[..10], "a number below 0 is no clump");
    for curve in (2..16).step_by(2) {
        let [a, b] = [0, 5].map(|row| &together[curve * 5 + row..][..5]);
        assert!(farthest(a, b) < 1e-6 && farthest(a, &own[curve * 5..][..5]) > 1e-3);
    }
    // As the curve at the mean of both roots, half a metre from each: that of a field moved so.
    let mut moved = field(4);
    moved.part_mut(Kind::Curves).unwrap().edit(P).unwrap().iter_mut().for_each(|p| p[0] += 0.5);
    let between = shape(bench(&NODE).input(CURVES, moved));
    assert!(farthest(&between[2 * 5..][..5], &together[2 * 5..][..5]) < 1e-5);
    assert_eq!(shape(windy("tuft").set(CLUMP_BLEND, 0.0.into())), own);
    let quarter = shape(windy("tuft").set(CLUMP_BLEND, 0.25.into()));
    assert!(farthest(&quarter[10..], &own[10..]) > 1e-4 && farthest(&quarter[10..], &together[10..]) > 1e-4);
    // Found from roots at most so far apart.
    let found = shape(windy("").set(CLUMP_RADIUS, 1.01));
    assert!(farthest(&found[..5], &found[5..10]) < 1e-6 && farthest(&found[..5], &found[15..20]) > 1e-3);
    let error = windy("tuff").try_cook().unwrap_err();
    assert_eq!(error.to_string(), "`clump` is `tuff`, which the curves do not have; did you mean `tuft`?");
}

#[test]
fn waviness_may_be_masked() {
    let mut curves = field(3);
    let part = curves.part_mut(Kind::Curves).unwrap();
    part.set(Attr::<f32>::element("wavy"), (0..9).map(|curve| (curve % 2) as f32).collect()).unwrap();
    let with = |waviness: Maskable| bench(&NODE).input(CURVES, curves.clone()).set(WAVINESS, waviness).cook();
    let (straight, wavy) = (shapes(&with(0.0.into())), shapes(&with(3.0.into())));
    let mixed = shapes(&with(Maskable { value: 3.0, attribute: Some("wavy".into()) }));
    for curve in 0..9 {
        let expected = if curve % 2 == 0 { &straight } else { &wavy };
        assert_eq!(mixed[curve * 5..][..5], expected[curve * 5..][..5], "curve {curve}");
    }
    assert_ne!(straight, wavy);
}
