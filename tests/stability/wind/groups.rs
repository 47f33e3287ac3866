//! Groups and clumps of nothing, of all, and of absurd numbers; loops, shear and fading at extremes.

use super::*;
use engine::geometry::Attr;

const GROUPED: [&str; 5] = ["gusts", "lee", "wind", "swing", "out"];

/// Fur with attributes: `none` and `all` of curves, `tips` of CVs, `odd` numbers of clumps.
fn fur() -> Geometry {
    let mut fur = curves(&hairs(20, 5, 0.3));
    let part = fur.part_mut(Kind::Curves).unwrap();
    part.set(Attr::<i32>::element("none"), vec![0; 20]).unwrap();
    part.set(Attr::<i32>::element("all"), vec![-7; 20]).unwrap();
    part.set(Attr::<f32>::point("tips"), (0..100).map(|cv| if cv % 5 == 4 { 1e-45 } else { 0.0 }).collect()).unwrap();
    let odd = |curve: i32| [i32::MIN, i32::MAX, -1, 0, i32::MAX - 1][curve as usize % 5];
    part.set(Attr::<i32>::element("odd"), (0..20).map(odd).collect()).unwrap();
    part.set(Attr::<f32>::point("huge"), (0..100).map(|cv| [0.0, 1e30, -1e30, 3e38, 1e-45][cv % 5]).collect()).unwrap();
    fur
}

/// The scene with the same params added to some nodes.
fn with_all(nodes: &[&'static str], added: &str) -> Scene {
    let scene = Scene::new().fur(|_| fur());
    nodes.iter().fold(scene, |scene, node| {
        let before = scene.params.get(node).cloned().unwrap_or_default();
        let comma = if before.is_empty() { "" } else { ", " };
        scene.with(node, format!("{before}{comma}{added}"))
    })
}

pub(super) fn an_empty_group_changes_no_bit_and_a_full_one_is_none() {
    let cooked = hold(
        "10",
        [
            ("without groups", with_all(&[], "")),
            ("an empty group", with_all(&GROUPED, r#""group": "none""#)),
            ("a group of all", with_all(&GROUPED, r#""group": "all""#)),
            ("a group of tips", with_all(&GROUPED, r#""group": "tips""#)),
        ],
    );
    let still = fur();
    for (node, frame) in GROUPED.iter().flat_map(|node| (0..3).map(move |frame| (*node, frame))) {
        let points = |row: usize| cooked[row].of(frame, node).unwrap().positions();
        assert_eq!(points(1), still.curves().unwrap().positions(), "{node}");
        assert_eq!(points(2), points(0), "{node}");
    }
}

pub(super) fn clumps_of_any_numbers_hold() {
    let clumped = |added: &str| with_all(&["gusts", "wind", "swing"], added);
    let cooked = hold(
        "10",
        [
            ("without clumps", with_all(&[], "")),
            ("clumps with odd numbers", clumped(r#""clump": "odd""#)),
            ("all curves in one clump", clumped(r#""clump": "all", "clump_radius": 1"#)),
            ("a clump radius of 1e30", clumped(r#""clump_radius": 1e30"#)),
            ("a clump radius of 1e-45", clumped(r#""clump_radius": 1e-45"#)),
            (
                "clumps with a huge mask",
                clumped(r#""clump_radius": 0.3, "clump_blend": { "value": 1, "attribute": "huge" }"#),
            ),
            (
                "clumps of curves of one CV",
                clumped(r#""clump_radius": 1"#).fur(|_| curves(&vec![vec![[0.0, 0.5, 0.0]]; 3])),
            ),
            ("clumps of no curves", clumped(r#""clump_radius": 1"#).fur(|_| curves(&[]))),
            (
                "clumps, fur and skin × 1e30",
                clumped(r#""clump_radius": 1e29"#)
                    .refused(&["hairs"])
                    .with("hairs", r#""density": 1e-45"#)
                    .fur(|_| moved(curves(&hairs(20, 5, 0.3)), |p| p.map(|x| x * 1e30)))
                    .skin(|_| moved(ball(), |p| p.map(|x| x * 1e30))),
            ),
        ],
    );
    let points = |row: usize| cooked[row].of(2, "swing").unwrap().positions();
    // Numbers below 0 are alone: so are all of `all`. A radius below all distances finds nothing.
    assert!(points(2) == points(0) && points(4) == points(0));
    assert!(points(1) != points(0) && points(3) != points(0));
}

pub(super) fn loops_shear_and_fading_hold_at_any_size() {
    let gusts = |added: &str| with_all(&["gusts"], added);
    let lee = |added: &str| with_all(&["lee"], added);
    hold(
        "10",
        [
            ("a loop of a tick", with_all(&["gusts", "wind"], r#""loop": 0.0002"#)),
            ("a loop of 1e-30 frames", with_all(&["gusts", "wind"], r#""loop": 1e-30"#)),
            ("a loop of 1e9 frames", with_all(&["gusts", "wind"], r#""loop": 1e9"#)),
            ("many rounds in a loop", gusts(r#""loop": 48, "repeat_every": 0.0003, "num_gusts": 3"#)),
            ("shear of 1e30", gusts(r#""shear": 1e30"#)),
            ("shear of -3e38", gusts(r#""shear": -3e38"#)),
            (
                "huge masks",
                gusts(
                    r#""shear": { "value": 1, "attribute": "huge" }, "strength": { "value": 1, "attribute": "huge" }"#,
                ),
            ),
            ("a huge base", with_all(&[], "").with("gusts", r#""base": { "value": 1, "attribute": "huge" }"#)),
            ("a distance of 1e-45", lee(r#""distance": 1e-45"#)),
            ("a distance of 1e30", lee(r#""distance": 1e30, "falloff": 1e30"#)),
            ("cones that fade", lee(r#""distance": 0.3, "falloff": 0, "smooth": 1"#)),
            ("huge waves", with_all(&["wind"], r#""waviness": { "value": 1, "attribute": "huge" }"#)),
            ("a huge loft", with_all(&["out"], r#""loft": { "value": 1, "attribute": "huge" }"#)),
            ("a huge offset", with_all(&["out"], r#""offset_scale": { "value": 1, "attribute": "huge" }"#)),
            ("huge inheritance", with_all(&["swing"], r#""inherit_motion": { "value": 1, "attribute": "huge" }"#)),
        ],
    );
}
