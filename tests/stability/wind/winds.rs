//! Wind from any direction, thousands of gusts, springs of any stiffness, any number of curves.

use super::*;
use engine::geometry::SHIELDED;

fn blowing(wind: &str) -> Scene {
    let wind = format!(r#""wind_dir": {wind}"#);
    Scene::new().with("gusts", format!(r#"{wind}, "base": 0.2"#)).with("lee", wind.clone()).with("wind", wind)
}

fn enveloped(value: f32) -> Scene {
    Scene::new().fur(move |_| {
        let mut fur = curves(&hairs(20, 5, 0.3));
        let part = fur.part_mut(Kind::Curves).unwrap();
        part.set(ENVELOPE, vec![value; part.point_count()]).unwrap();
        fur
    })
}

pub(super) fn wind_from_any_direction_bends_curves_and_keeps_their_lengths() {
    let upright = |_| {
        curves(&(0..20).map(|k| (0..5).map(|cv| [0.1 * k as f32, 0.1 * cv as f32, 0.0]).collect()).collect::<Vec<_>>())
    };
    let cooked = hold(
        "21",
        [
            (
                "wind along the curves",
                blowing("[0, 1, 0]").fur(upright).with("wind", r#""wind_dir": [0, 1, 0], "noise": "none""#),
            ),
            (
                "wind exactly against the curves",
                blowing("[0, -1, 0]").fur(upright).with("wind", r#""wind_dir": [0, -1, 0], "noise": "none""#),
            ),
            (
                "wind turning about in a frame",
                blowing(r#"{ "keyframes": [[1, [1, 0, 0]], [2, [-1, 0, 0]], [3, [1, 0, 0.001]]] }"#),
            ),
            (
                "wind turning about between frames",
                blowing(r#"{ "keyframes": [[1, [1, 0, 0]], [2.5, [-1, 0, 0.001]]] }"#),
            ),
            ("wind vector of length 1e-38", blowing("[1e-38, 0, 1e-38]")),
            ("wind vector of length 1e38", blowing("[0, 1e38, 1e38]")),
            ("curves turned all the way round at every CV", Scene::new().with("wind", r#""global_rotate": 1000"#)),
        ],
    );
    assert_eq!(cooked[0].of(0, "wind").unwrap().positions(), upright(Frame::whole(1)).curves().unwrap().positions());
    assert_ne!(cooked[1].of(0, "wind").unwrap().positions(), upright(Frame::whole(1)).curves().unwrap().positions());
    for node in ["gusts", "lee", "wind"] {
        let said = Scene::new().with(node, r#""wind_dir": [0, 0, 0]"#).fault().unwrap_or_default();
        assert!(said.contains("`wind_dir` is [0, 0, 0]"), "{node}: {said}");
        record_refused("21", &format!("no wind at `{node}`"), &said);
    }
}

pub(super) fn envelopes_out_of_range_and_thousands_of_gusts_give_finite_curves() {
    let gusts = |params: &str| Scene::new().with("gusts", format!(r#"{params}, "start_frame_range": [-100, 1]"#));
    hold(
        "22",
        [
            ("#23: envelopes below 0", enveloped(-3.0)),
            ("#23: envelopes above 1", enveloped(1e30)),
            ("10,000 gusts over each other", gusts(r#""num_gusts": 10000, "radius_range": [1, 3], "distance": 0.1"#)),
            ("gusts of radius 0", gusts(r#""radius_range": [0, 0]"#)),
            ("gusts of no life", gusts(r#""life_range": [0, 0], "decay_range": [0, 0]"#)),
            ("gusts that end at once", gusts(r#""life_range": [1, 1], "decay_range": [0, 0]"#)),
        ],
    );
    for (param, range) in [
        ("radius_range", "[-1, 1]"),
        ("speed_range", "[-1, 1]"),
        ("life_range", "[-1, 1]"),
        ("decay_range", "[-1, -1]"),
    ] {
        let said = Scene::new().with("gusts", format!(r#""{param}": {range}"#)).fault().unwrap_or_default();
        assert!(said.contains(&format!("`{param}` is {range}")), "{said}");
        record_refused("22", &format!("`{param}` {range}"), &said);
    }
}

pub(super) fn springs_of_any_stiffness_and_damping_are_stable() {
    let swing = |params: &str| Scene::new().with("swing", params);
    let cooked = hold(
        "28",
        [
            ("1e-6 Hz", swing(r#""frequency": 1e-6"#)),
            ("1e9 Hz", swing(r#""frequency": 1e9"#)),
            ("ζ 1e-6", swing(r#""damping": 1e-6"#)),
            ("ζ 1e6", swing(r#""damping": 1e6"#)),
            ("1e9 Hz, ζ 1e-6, against still air", swing(r#""frequency": 1e9, "damping": 1e-6, "drag": "world""#)),
            ("1e-6 Hz, ζ 1e6, against still air", swing(r#""frequency": 1e-6, "damping": 1e6, "drag": "world""#)),
        ],
    );
    // Such a stiff spring follows the wind up to the rounding of positions.
    let apart = |a: &Component, b: &Component| {
        let pairs = a.positions().iter().zip(b.positions());
        pairs.map(|(a, b)| (to_f64(*a) - to_f64(*b)).norm()).fold(0.0, f64::max)
    };
    assert!(apart(cooked[1].of(2, "swing").unwrap(), cooked[1].of(2, "wind").unwrap()) < 1e-6);
    assert!(apart(cooked[0].of(2, "swing").unwrap(), cooked[0].of(2, "wind").unwrap()) > 0.01);
    let said = swing(r#""damping": 0"#).fault().unwrap_or_default();
    assert!(said.contains("`damping` is 0") && said.contains("more than 0"), "{said}");
    record_refused("28", "ζ 0", &said);
}

pub(super) fn every_node_handles_curves_of_2_and_of_10_000_cvs() {
    hold(
        "29",
        [
            ("2 CVs", Scene::new().fur(|_| curves(&hairs(40, 2, 0.3)))),
            ("10,000 CVs", Scene::new().fur(|_| curves(&hairs(2, 10_000, 0.3))).with("hairs", r#""density": 1"#)),
        ],
    );
}

/// A million curves of two CVs on the ball.
fn million() -> Scene {
    let fur = |_| {
        let hair = |k: u64| {
            let up = direction(Key::new(5).of(k));
            [up.map(|x| 0.5 * x), [0.6 * up[0] + 0.02, 0.6 * up[1], 0.6 * up[2]]]
        };
        let points: Vec<[Point; 2]> = (0..1_000_000).map(hair).collect();
        Component::curves(vec![2; points.len()], points.as_flattened().to_vec()).unwrap().into()
    };
    Scene::new().fur(fur).with("hairs", r#""density": 10000"#)
}

pub(super) fn a_million_curves_pass_through_the_chain() {
    let cooked = million().cook_some(&["lee", "out"], &[1], 2);
    assert_eq!(cooked.errors, []);
    let [lee, out] = ["lee", "out"].map(|node| cooked.of(0, node).unwrap());
    assert_eq!((lee.element_count(), out.element_count()), (1_000_000, 1_000_000));
    let share = lee.get(SHIELDED).unwrap().iter().filter(|share| **share > 0.0).count();
    assert!((400_000..500_000).contains(&share), "about half of the ball should be in the lee: {share}");
    assert!(length_error(out, lee) <= 1e-5);
    let figure = format!("lengths within {:.0e}, {share} in the lee", length_error(out, lee));
    page::record(PART, "30", "a million curves through shielding and collision", Outcome::Finite, &figure);
}

pub(super) fn a_million_curves_are_attached_and_interpolated() {
    let turning =
        |frame: Frame| moved(ball(), |[x, y, z]| if frame.floor_number() == 2 { [z, y, -x] } else { [x, y, z] });
    let cooked = million().skin(turning).cook_some(&["grown", "hairs"], &[2], 2);
    assert_eq!(cooked.errors, []);
    let [grown, hairs] = ["grown", "hairs"].map(|node| cooked.of(0, node).unwrap());
    let fur = (million().fur)(Frame::whole(2));
    let turned = fur.curves().unwrap().positions().iter().map(|[x, y, z]| [*z, *y, -*x]);
    let apart = turned.zip(grown.positions()).map(|(a, b)| (to_f64(a) - to_f64(*b)).norm()).fold(0.0, f64::max);
    assert!(apart < 1e-6, "a quarter turn moves all curves rigidly: {apart}");
    assert!(hairs.element_count() > 30_000);
    let figure = format!("off by {apart:.0e} m, {} interpolated", hairs.element_count());
    page::record(PART, "30", "a million curves attached and interpolated", Outcome::Finite, &figure);
}
