//! Extreme numbers: at the ends of f32, far from the origin, outside the ranges of params, NaN and infinity.

use super::*;
use engine::geometry::{Attr, Kind, PREF};
use engine::param::Shape;

/// Fur and ball together, all positions changed alike.
fn changed(change: impl Fn(Point) -> Point + Clone + Send + Sync + 'static) -> Scene {
    let of_ball = change.clone();
    Scene::new().fur(move |_| moved(curves(&hairs(20, 5, 0.3)), &change)).skin(move |_| moved(ball(), &of_ball))
}

/// At a scale, with the params that are lengths at that scale.
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

#[test]
fn a_scene_of_any_size_and_place_is_finite_and_keeps_its_lengths() {
    hold([
        ("1e-6", scaled(1e-6)),
        ("1e6", scaled(1e6)),
        ("1e-6, params as they are", changed(|p| p.map(|x| x * 1e-6))),
        ("1e6, params as they are", changed(|p| p.map(|x| x * 1e6)).with("hairs", r#""density": 1e-11"#)),
        ("1e-30", changed(|p| p.map(|x| x * 1e-30))),
        ("1e30", changed(|p| p.map(|x| x * 1e30)).with("hairs", r#""density": 1e-45"#).refused(&["hairs"])),
        ("denormal", changed(|p| p.map(|x| x * 1e-41))),
        ("1e7 m away", changed(|p| [p[0] + 1e7, p[1] - 1e7, p[2] + 1e7])),
        ("1 km away", changed(|p| [p[0] + 900.0, p[1], p[2] - 400.0])),
    ]);
}

#[test]
fn any_frame_rate_gives_finite_curves() {
    let at = |fps: f64| Scene { fps, ..Scene::new() };
    hold([("a frame of 1,000 s", at(1e-3)), ("a frame of 1 µs", at(1e6))]);
}

#[test]
fn nan_and_infinity_are_refused_by_name_in_every_input() {
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
        }
    }
}

#[test]
fn params_accept_both_ends_of_their_range_and_refuse_values_just_outside() {
    let (mut ends, mut outside) = (0, 0);
    for (id, name) in [
        ("gusts", "Curve_Wind_Gusts"),
        ("lee", "Curve_Wind_Shielding"),
        ("wind", "Curve_Wind"),
        ("swing", "Curve_Jiggle"),
        ("out", "Curve_Wind_Collision"),
        ("hairs", "Curve_Interpolate"),
    ] {
        let node = convect::CATALOGUE.nodes().find(|node| node.name == name).unwrap();
        for spec in node.param_specs() {
            let hard = spec.facts.hard;
            let (whole, written): (bool, fn(f64) -> String) = match spec.shape {
                Shape::Float | Shape::Masked => (false, |x| format!("{x:?}")),
                Shape::Int => (true, |x| format!("{x}")),
                Shape::Span | Shape::Vec2 => (false, |x| format!("[{x:?}, {x:?}]")),
                _ => continue,
            };
            let set = |x: f64| Scene::new().with(id, format!(r#""{}": {}"#, spec.name, written(x)));
            let fault = |x: f64| set(x).fault();
            for (end, out) in [(hard.low, -1.0), (hard.high, 1.0)] {
                if !end.is_finite() {
                    continue;
                }
                let step = if whole { 1.0 } else { 1e-6 * end.abs().max(1e-3) };
                let open = hard.open && out < 0.0;
                let (inside, beyond) = if open { (end + step, end) } else { (end, end + out * step) };
                assert_eq!(fault(inside), None, "`{}` of {name} takes {inside}", spec.name);
                // A thousand million steps are as dear as they sound, and at a blend of 0 crossings are not looked for.
                if !(spec.name == "rotation_steps" && out > 0.0 || id == "out" && spec.name == "blend" && out < 0.0) {
                    let cooked = set(inside).cook(2);
                    let refused = cooked.errors.iter().all(|(node, kind, _)| node == id && *kind == ErrorKind::Refused);
                    assert!(refused, "`{}` of {name} at {inside}: {:?}", spec.name, cooked.errors);
                    check_all(&format!("`{}` of {name} at {inside}", spec.name), &cooked, &set(inside));
                }
                let said = fault(beyond).unwrap_or_default();
                assert!(
                    said.contains(&format!("`{}`", spec.name)) && said.contains("expected"),
                    "{name}, {beyond}: {said}"
                );
                (ends, outside) = (ends + 1, outside + 1);
            }
        }
    }
    assert!(ends > 40 && outside > 40, "{ends} {outside}");
}
