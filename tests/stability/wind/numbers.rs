//! Extreme numbers: at the ends of f32, far from the origin, outside the ranges of params, NaN and infinity.

use super::*;
use conformance::{RangeEnd, range_ends};
use engine::geometry::{Attr, Kind, PREF};
use engine::param::Value;

/// Fur and ball together, all positions changed alike.
fn changed(change: impl Fn(Point) -> Point + Clone + Send + Sync + 'static) -> Scene {
    let of_ball = change.clone();
    Scene::new().fur(move |_| moved(curves(&hairs(20, 5, 0.3)), &change)).skin(move |_| moved(ball(), &of_ball))
}

/// A scaled scene, with params that are lengths scaled too.
fn scaled(scale: f64) -> Scene {
    let size = scale as f32;
    changed(move |p| p.map(|x| x * size))
        .with(
            "gusts",
            format!(
                r#""radius_range": [{}, {}], "speed_range": [{scale}, {scale}], "base": 0.2"#,
                0.4 * scale,
                0.8 * scale
            ),
        )
        .with("lee", format!(r#""offset": {}"#, 10.0 * scale))
        .with("wind", format!(r#""frequency": {}, "scroll": {scale}"#, 2.0 / scale))
        .with("out", format!(r#""gap": {}, "offset_root": {}"#, 1e-4 * scale, 1e-4 * scale))
        .with("hairs", format!(r#""density": {}"#, 20.0 / (scale * scale)))
}

pub(super) fn scenes_of_any_scale_and_position_are_finite_and_keep_lengths() {
    hold(
        "6",
        [
            ("scene × 1e-6", scaled(1e-6)),
            ("scene × 1e6", scaled(1e6)),
            ("scene × 1e-6, params as they are", changed(|p| p.map(|x| x * 1e-6))),
            ("scene × 1e6, params as they are", changed(|p| p.map(|x| x * 1e6)).with("hairs", r#""density": 1e-11"#)),
            ("#4: scene × 1e-30", changed(|p| p.map(|x| x * 1e-30))),
            (
                "#4: scene × 1e30",
                changed(|p| p.map(|x| x * 1e30)).with("hairs", r#""density": 1e-45"#).refused(&["hairs"]),
            ),
            ("#3: denormal positions", changed(|p| p.map(|x| x * 1e-41))),
            ("#5: 1e7 m away", changed(|p| [p[0] + 1e7, p[1] - 1e7, p[2] + 1e7])),
            ("#5: 1 km away", changed(|p| [p[0] + 900.0, p[1], p[2] - 400.0])),
        ],
    );
}

pub(super) fn any_frame_rate_gives_finite_curves() {
    let at = |fps: f64| Scene { fps, ..Scene::new() };
    hold("9", [("a frame of 1,000 s", at(1e-3)), ("a frame of 1 µs", at(1e6))]);
}

pub(super) fn nan_and_infinity_are_refused_by_name_in_every_input() {
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for name in ["P", "envelope", "Pref", "soft"] {
            let scene = Scene::new().fur(move |_| {
                let mut fur = curves(&hairs(20, 5, 0.3));
                let part = fur.part_mut(Kind::Curves).unwrap();
                let rows = part.positions().to_vec();
                part.set(ENVELOPE, vec![1.0; rows.len()]).unwrap();
                part.set(PREF, rows.clone()).unwrap();
                part.set(Attr::<f32>::point("soft"), vec![1.0; rows.len()]).unwrap();
                match name {
                    "P" | "Pref" => part.edit(Attr::<Point>::point(name)).unwrap()[7][1] = bad,
                    name => part.edit(Attr::<f32>::point(name)).unwrap()[7] = bad,
                }
                fur
            });
            let cooked = scene.cook(2);
            let expected = format!("`{name}` of point 7 of the curves is NaN or infinite");
            assert!(cooked.errors.iter().all(|(node, kind, error)| {
                node == "fur" && *kind == ErrorKind::NotFinite && error.contains(&expected)
            }));
            assert!(!cooked.errors.is_empty() && cooked.frames.iter().flatten().all(Option::is_none), "{name} {bad}");
            record_refused(if bad.is_nan() { "1" } else { "2" }, &format!("{bad} in `{name}`"), &cooked.errors[0].2);
        }
    }
}

/// A number at an end of a range, as a graph writes it.
fn json(value: &Value) -> Option<String> {
    match value {
        Value::Float(x) | Value::Masked(x, _) => Some(format!("{x:?}")),
        Value::Int(x) => Some(x.to_string()),
        Value::Span([a, b]) | Value::Vec2([a, b]) => Some(format!("[{a:?}, {b:?}]")),
        _ => None,
    }
}

pub(super) fn lengths_roots_and_bits_are_kept_at_both_ends_of_every_range() {
    let (mut ends, mut refusals) = (0, 0);
    let scene = graph(&Scene::new().nodes(), &NODES, 1);
    // The nodes whose params a scene can set.
    let ids: Vec<&'static str> = Scene::new().params.into_keys().collect();
    for (node, known) in scene.nodes.iter().filter_map(|node| Some((node, node.node()?))) {
        let Some(id) = ids.iter().copied().find(|id| **id == *node.id) else { continue };
        for spec in known.param_specs() {
            for RangeEnd { inside, .. } in range_ends(&spec) {
                let Some(text) = json(&inside) else { continue };
                // Every step costs time, and at a blend of 0 crossings are not counted.
                let dear = spec.name == "rotation_steps" && inside != Value::Int(1);
                if dear || spec.name == "blend" && id == "out" && inside.number() == 0.0 {
                    continue;
                }
                let at_end = Scene::new().with(id, format!(r#""{}": {text}"#, spec.name));
                let what = format!("`{}` of {} at {text}", spec.name, known.name);
                assert_eq!(at_end.fault(), None, "{what}");
                let cooked = at_end.cook(2);
                let refused = cooked.errors.iter().all(|(node, kind, _)| node == id && *kind == ErrorKind::Refused);
                assert!(refused, "{what}: {:?}", cooked.errors);
                check_all(&what, &cooked, &at_end);
                ends += 1;
                refusals += usize::from(!cooked.errors.is_empty());
            }
        }
    }
    assert!(ends > 40, "{ends}");
    let figure = format!("{ends} ends, refused for this scene: {refusals}");
    page::record(PART, "7", "every param of the chain at both ends of its range", Outcome::Finite, &figure);
}
