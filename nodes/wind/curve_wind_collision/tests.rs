use super::*;
use conformance::{Bench, bench, conformance};
use engine::time::Frame;

fn floor(height: f32) -> Geometry {
    let points = vec![[-9.0, height, -9.0], [-9.0, height, 9.0], [9.0, height, 9.0], [9.0, height, -9.0]];
    Component::mesh(vec![4], vec![0, 1, 2, 3], points).unwrap().into()
}

fn curve(points: &[[f32; 3]]) -> Geometry {
    Component::curves(vec![points.len() as u32], points.to_vec()).unwrap().into()
}

fn goal() -> Geometry {
    curve(&[[0.0, 0.5, 0.0], [0.6, -0.3, 0.0]])
}

fn laid_down() -> Bench {
    bench(&NODE).input(CURVES, goal()).input(REST, curve(&[[0.0, 0.5, 0.0], [0.0, 1.5, 0.0]]))
}

#[test]
fn conforms_to_its_declaration() {
    // With loft, segments of the suite's curves meet nothing.
    conformance(&NODE).with(|bench| bench).with(|bench| bench.set(LOFT, 0.1.into())).run();
}

#[test]
fn a_hair_stops_one_gap_above_a_floor() {
    // From half its length above the floor a segment turns down to 30°, minus the gap ÷ its length.
    for gap in [1e-4_f32, 1e-2] {
        let out = laid_down().input(COLLIDERS, floor(0.0)).set(GAP, gap.into()).set(LOFT, 0.0.into()).cook();
        let tip = out.curves().positions()[1];
        let angle = std::f64::consts::FRAC_PI_6 - f64::from(gap);
        assert!((f64::from(tip[0]) - libm::cos(angle)).abs() < 1e-6, "{tip:?}");
        assert_eq!(out.metrics["contacts"], 1.0);
        assert_eq!(out.metrics["crossings_left"], 0.0);
    }
}

#[test]
fn all_colliders_stop_curves_and_the_first_is_the_default_skin() {
    let both = laid_down().input(COLLIDERS, floor(-5.0)).input(COLLIDERS, floor(0.0));
    let alone = laid_down().input(COLLIDERS, floor(0.0));
    assert_eq!(both.cook().curves().positions(), alone.cook().curves().positions());
    let lifted = laid_down().input(COLLIDERS, floor(0.5)).set(OFFSET_ROOT, 0.25.into()).cook();
    assert!((lifted.curves().positions()[0][1] - 0.75).abs() < 1e-6);
    let skin = laid_down().input(COLLIDERS, floor(-5.0)).input(SKIN, floor(0.4)).set(OFFSET_ROOT, 0.25.into()).cook();
    assert!((skin.curves().positions()[0][1] - 0.65).abs() < 1e-6);
}

#[test]
fn a_skin_without_colliders_still_lifts_roots() {
    let out = laid_down().input(SKIN, floor(0.4)).set(OFFSET_ROOT, 0.25.into()).cook();
    assert!((out.curves().positions()[0][1] - 0.65).abs() < 1e-6);
    assert_eq!(out.metrics["contacts"], 0.0);
}

#[test]
fn without_colliders_and_skin_the_same_arrays_pass_through() {
    let given = goal();
    let out = bench(&NODE).input(CURVES, given.clone()).input(REST, goal()).cook();
    let address = |part: &Component| part.table(Owner::Point).column("P").unwrap().address();
    assert_eq!(address(out.curves()), address(given.curves().unwrap()));
}

#[test]
fn rest_curves_that_do_not_match_are_refused() {
    let other = bench(&NODE).input(CURVES, goal()).input(REST, curve(&[[0.0; 3]; 3])).input(COLLIDERS, floor(0.0));
    let expected = "`curves` (1 curve, 2 CVs) and `rest` (1 curve, 3 CVs) are not the same curves";
    assert_eq!(other.try_cook().unwrap_err().fact, expected);
}

#[test]
fn any_number_of_steps_terminates() {
    for steps in [1, 1_000_000] {
        let out = laid_down().input(COLLIDERS, floor(0.0)).set(METHOD, Method::Steps).set(ROTATION_STEPS, steps).cook();
        assert_eq!(out.metrics["crossings_left"], 0.0, "{steps}");
    }
}

#[test]
fn any_offset_scale_is_finite_and_keeps_lengths() {
    for scale in [0.0_f32, 1.0, 1e3] {
        let out = laid_down().input(COLLIDERS, floor(0.0)).set(OFFSET_SCALE, scale.into()).cook();
        assert!(out.curves().positions().as_flattened().iter().all(|x| x.is_finite()));
        assert!(out.metrics["length_error"] < 1e-6);
        assert_eq!(out.metrics["crossings_left"], 0.0, "{scale}");
    }
}

#[test]
fn unfreed_counts_the_segments_of_each_curve_that_cross() {
    // A box of 0.2 around the root of the first curve, whose segments are longer; the second one is outside.
    let corner = |k: u32| [0, 1, 2].map(|axis| if k >> axis & 1 == 1 { 0.1 } else { -0.1 });
    let faces = vec![0, 2, 3, 1, 4, 5, 7, 6, 0, 1, 5, 4, 2, 6, 7, 3, 0, 4, 6, 2, 1, 3, 7, 5];
    let cube: Geometry = Component::mesh(vec![4; 6], faces, (0..8).map(corner).collect()).unwrap().into();
    let curves = |along: [f32; 3]| -> Geometry {
        let points = [0.0, 1.0, 2.0, 5.0, 6.0].map(|u| along.map(|x| x * u));
        Component::curves(vec![3, 2], points.to_vec()).unwrap().into()
    };
    let scene = bench(&NODE).input(CURVES, curves([1.0, 0.0, 0.0])).input(REST, curves([0.0, 1.0, 0.0]));
    let out = scene.input(COLLIDERS, cube).set(OFFSET_ROOT, 0.0.into()).cook();
    assert_eq!(out.curves().get(UNFREED_SEGMENTS), Some(&[1, 0][..]));
    assert_eq!(
        ["crossings_left", "unfreed_segments", "blended_to_rest"].map(|name| out.metrics[name]),
        [1.0, 1.0, 0.0]
    );
    let out = laid_down().cook();
    for attribute in [UNFREED_SEGMENTS, BLENDED_CURVE, LOW_ROOT] {
        assert_eq!(out.curves().get(attribute), Some(&[0][..]));
    }
}

#[test]
fn roots_in_creases_are_lifted_from_both_faces_or_counted() {
    // A groove along z, its faces this much to both sides as they rise by 1; the root lies on its edge.
    for (side, low) in [(1.0, 0.0), (0.4, 0.0), (0.2, 1.0)] {
        let points = vec![
            [0.0, 0.0, -1.0],
            [0.0, 0.0, 1.0],
            [side, 1.0, -1.0],
            [side, 1.0, 1.0],
            [-side, 1.0, -1.0],
            [-side, 1.0, 1.0],
        ];
        let groove: Geometry = Component::mesh(vec![4, 4], vec![0, 1, 3, 2, 0, 4, 5, 1], points).unwrap().into();
        let upright = curve(&[[0.0, 0.0, 0.0], [0.0, 0.5, 0.0]]);
        let scene = bench(&NODE).input(CURVES, upright.clone()).input(REST, upright).input(COLLIDERS, groove);
        let out = scene.set(OFFSET_ROOT, 0.01.into()).cook();
        let height = f64::from(out.curves().positions()[0][1]);
        let slope = f64::from(side);
        let sine = slope / (1.0 + slope * slope).sqrt();
        assert!((height - (0.01 / sine).min(0.04)).abs() < 2e-4, "{side}: {height}");
        assert_eq!(out.metrics["low_roots"], low, "{side}");
        assert_eq!(out.curves().get(LOW_ROOT), Some(&[low as i32][..]));
    }
}

#[test]
fn loft_keeps_a_share_of_the_height_of_a_curve_blown_flat() {
    let flat = || bench(&NODE).input(CURVES, curve(&[[0.0, 0.01, 0.0], [1.0, 0.01, 0.0]])).input(COLLIDERS, floor(0.0));
    let blown = || flat().input(REST, curve(&[[0.0, 0.01, 0.0], [0.0, 1.01, 0.0]]));
    for loft in [0.0_f32, 0.1, 0.5] {
        let out = blown().set(LOFT, loft.into()).cook();
        assert!((out.curves().positions()[1][1] - 0.01 - loft).abs() < 1e-6, "{loft}");
    }
    // `coherence` scales it, `offset_scale` replaces it.
    let height = |bench: Bench| bench.cook().curves().positions()[1];
    assert_eq!(
        height(blown().set(LOFT, 0.5.into()).set(COHERENCE, 1.0.into())),
        height(blown().set(COHERENCE, 1.0.into()))
    );
    assert_eq!(
        height(blown().set(LOFT, 0.5.into()).set(OFFSET_SCALE, 0.2.into())),
        height(blown().set(OFFSET_SCALE, 0.2.into()))
    );
}

#[test]
fn loft_and_offset_scale_may_be_masked() {
    let two = |ends: [[f32; 3]; 2]| -> Geometry {
        let points = [[0.0, 0.01, 0.0], ends[0], [0.0, 0.01, 3.0], ends[1]];
        let mut curves = Component::curves(vec![2, 2], points.to_vec()).unwrap();
        curves.set(Attr::<f32>::element("stands"), vec![0.5, 1.0]).unwrap();
        curves.into()
    };
    let blown = || {
        let (flat, upright) = ([[1.0, 0.01, 0.0], [1.0, 0.01, 3.0]], [[0.0, 1.01, 0.0], [0.0, 1.01, 3.0]]);
        bench(&NODE)
            .input(CURVES, two(flat))
            .input(REST, two(upright))
            .input(COLLIDERS, floor(0.0))
            .set(OFFSET_ROOT, 0.0.into())
    };
    // A share of a height of 1 m over the root; of 1.01 m over the skin.
    let stands = |value: f32| Maskable { value, attribute: Some("stands".into()) };
    for (param, share, expected) in [(LOFT, 0.4, [0.2, 0.4]), (OFFSET_SCALE, 0.4, [0.192, 0.394])] {
        let out = blown().set(param, stands(share)).cook();
        let heights = [1, 3].map(|cv| out.curves().positions()[cv][1] - 0.01);
        assert!((0..2).all(|k| (heights[k] - expected[k]).abs() < 1e-3), "{}: {heights:?}", param.name());
    }
    let flat = [stands(0.0), 0.0.into()].map(|loft| blown().set(LOFT, loft).cook().curves().positions().to_vec());
    assert_eq!(flat[0], flat[1]);
}

/// Each of two curves, one with half of the number, ends as if both had its number.
#[test]
fn coherence_gap_and_root_offset_may_be_masked() {
    let two = |ends: [[f32; 3]; 2]| -> Geometry {
        let points = [[0.0, 0.0, 0.0], ends[0], [0.0, 0.0, 3.0], ends[1]];
        let mut curves = Component::curves(vec![2, 2], points.to_vec()).unwrap();
        curves.set(Attr::<f32>::element("some"), vec![0.5, 1.0]).unwrap();
        curves.into()
    };
    let cook = |param: &Param<Maskable>, value: f32, attribute: Option<Name>| {
        let (blown, upright) = ([[0.8, -0.6, 0.0], [0.8, -0.6, 3.0]], [[0.0, 1.0, 0.0], [0.0, 1.0, 3.0]]);
        let scene = bench(&NODE).input(CURVES, two(blown)).input(REST, two(upright)).input(COLLIDERS, floor(0.0));
        let out = scene.set(LOFT, 0.0.into()).set(*param, Maskable { value, attribute }).cook();
        out.curves().positions().to_vec()
    };
    for (param, value) in [(COHERENCE, 1.0), (GAP, 0.05), (OFFSET_ROOT, 0.05)] {
        let masked = cook(&param, value, Some("some".into()));
        let (half, whole) = (cook(&param, 0.5 * value, None), cook(&param, value, None));
        assert_eq!((&masked[..2], &masked[2..]), (&half[..2], &whole[2..]), "{}", param.name());
        assert_ne!(half, whole, "{}", param.name());
    }
}

/// Of two curves blown through the floor the one in the group stops at it, as without a group; the other keeps its bits, and
/// counts nowhere.
#[test]
fn outside_a_group_curves_keep_their_bits() {
    let two = |points: [[[f32; 3]; 2]; 2], rows: [i32; 2]| -> Geometry {
        let mut curves = Component::curves(vec![2, 2], points.concat()).unwrap();
        curves.set(Attr::<i32>::element("some"), rows.to_vec()).unwrap();
        curves.into()
    };
    let goal = [[[0.0, 0.5, 0.0], [0.6, -0.3, 0.0]], [[-0.0, 0.5, 3.0], [0.6, -0.3, 3.0]]];
    let rest = goal.map(|[root, _]| [root, [root[0], 1.5, root[2]]]);
    let cook = |name: &str, rows: [i32; 2]| {
        let bench = bench(&NODE).input(CURVES, two(goal, rows)).input(REST, two(rest, [1, 1]));
        bench.input(COLLIDERS, floor(0.0)).set(GROUP, name.into()).set(LOFT, 0.0.into()).cook()
    };
    let all = cook("", [0, 0]);
    for rows in [[0, 1], [2, 0], [0, 0], [1, 1]] {
        let out = cook("some", rows);
        for (cv, now) in out.curves().positions().iter().enumerate() {
            let expected = if rows[cv / 2] == 0 { goal[cv / 2][cv % 2] } else { all.curves().positions()[cv] };
            assert_eq!(now.map(f32::to_bits), expected.map(f32::to_bits), "{rows:?}, CV {cv}");
        }
        let inside = rows.iter().filter(|row| **row != 0).count() as f64;
        assert_eq!((out.metrics["contacts"], out.metrics["crossings_left"]), (inside, 0.0));
        assert_eq!(out.curves().get(UNFREED_SEGMENTS), Some(&[0, 0][..]));
    }
}

/// Roots that are not those of `rest`, a large `offset_root` and an empty group are told.
#[test]
fn roots_off_rest_large_lifts_and_empty_groups_are_metrics() {
    let standing = || curve(&[[0.0, 0.5, 0.0], [0.0, 1.5, 0.0]]);
    let over_floor =
        |curves: Geometry| bench(&NODE).input(CURVES, curves).input(REST, standing()).input(COLLIDERS, floor(0.0));
    let down = |by: f32| curve(&[[0.0, 0.5 - by, 0.0], [0.6, -0.3, 0.0]]);
    for (by, off) in [(0.0, 0.0), (5e-5, 0.0), (3e-4, 1.0), (0.5, 1.0)] {
        let out = over_floor(down(by)).cook();
        assert!((out.metrics["roots_apart"] - f64::from(by)).abs() < 1e-7, "{by}: {}", out.metrics["roots_apart"]);
        assert_eq!(out.metrics["roots_off"], off, "{by}");
        assert!((out.metrics["root_lift"] - 1e-4).abs() < 1e-9, "{}", out.metrics["root_lift"]);
    }
    let far = laid_down().input(COLLIDERS, floor(0.0)).set(OFFSET_ROOT, 0.2.into()).cook();
    assert!((far.metrics["root_lift"] - 0.2).abs() < 1e-6, "{}", far.metrics["root_lift"]);
    for (row, empty) in [(0, 1.0), (1, 0.0)] {
        let mut curves = Component::curves(vec![2], vec![[0.0, 0.5, 0.0], [0.6, -0.3, 0.0]]).unwrap();
        curves.set(Attr::<i32>::element("some"), vec![row]).unwrap();
        let out = over_floor(curves.into()).set(GROUP, "some".into()).cook();
        assert_eq!(out.metrics["empty_group"], empty);
    }
}

/// A curve of width 0.1 whose root lies nearer to the floor than half of that, and one that `blend` leaves nearer.
#[test]
fn curves_nearer_than_half_their_width_are_counted() {
    let bench = |height: f32, blend: f32| {
        let goal = curve(&[[0.0, height, 0.0], [0.9, 0.02, 0.0], [1.8, 0.02, 0.0]]);
        let rest = curve(&[[0.0, height, 0.0], [0.0, height + 0.9, 0.0], [0.0, height + 1.8, 0.0]]);
        let bench = bench(&NODE).input(CURVES, goal).input(REST, rest).input(COLLIDERS, floor(0.0));
        bench.set(WIDTH, 0.1.into()).set(OFFSET_ROOT, 0.0.into()).set(BLEND, blend.into()).cook()
    };
    let counts = |out: &conformance::BenchResult| ["near_roots", "too_near"].map(|name| out.metrics[name]);
    assert_eq!(counts(&bench(0.3, 1.0)), [0.0, 0.0]);
    assert_eq!(counts(&bench(0.04, 1.0)), [1.0, 0.0]);
    let left = bench(0.3, 0.1);
    assert_eq!(counts(&left), [0.0, 2.0]);
    assert!(left.metrics["missing_width"] > 0.3, "{}", left.metrics["missing_width"]);
}

#[test]
fn jumps_are_the_share_of_tips_that_move_by_more_than_a_quarter_since_the_sample_before() {
    // Of two upright curves of length 1 over the floor one tip turns by 12°, then 18°: ways of 0.209 and 0.313 lengths.
    fn swinging(degrees: f32) -> Geometry {
        let (sine, cosine) = libm::sincosf(degrees.to_radians());
        let points = vec![[0.0, 0.5, 0.0], [sine, 0.5 + cosine, 0.0], [3.0, 0.5, 0.0], [3.0, 1.5, 0.0]];
        Component::curves(vec![2, 2], points).unwrap().into()
    }
    let at = |frame: Frame| swinging([0.0, 12.0, 30.0][(frame.floor_number() as usize - 1).min(2)]);
    let scene = bench(&NODE).moving(CURVES, at);
    let jumps = |frames: &[i64]| -> Vec<Option<f64>> {
        let out = scene.clone().input(REST, swinging(0.0)).input(COLLIDERS, floor(0.0)).frames(frames.iter().copied());
        out.iter().map(|out| out.metrics.get("jumps").copied()).collect()
    };
    assert_eq!(jumps(&[1, 2, 3]), [None, Some(0.0), Some(0.5)]);
    // It belongs to the request.
    assert_eq!((jumps(&[1, 3]), jumps(&[3])), (vec![None, Some(0.5)], vec![None]));
}
