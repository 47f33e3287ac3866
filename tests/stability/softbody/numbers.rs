//! Extreme numbers: at the ends of f32, far from the origin, outside the ranges of params, NaN and infinity.

use super::*;
use conformance::{RangeEnd, range_ends};
use engine::param::Value;

/// A cube and a plate under it, at a scale; with `thickness` at that scale if `fits`.
fn scaled(scale: f64, fits: bool) -> Scene {
    let body = changed(&cube(0.002), |_, p| p.map(|x| x * scale));
    let plate = cuboid([-0.3, -0.1, -0.3], [0.4, 0.0, 0.4]);
    let mut plate = plate.mesh().unwrap().clone();
    plate.edit(P).unwrap().iter_mut().flatten().for_each(|x| *x = (f64::from(*x) * scale) as f32);
    let plate = Geometry::from(plate);
    let scene = Scene::of(body).collider(move |_| plate.clone());
    if fits { scene.set("thickness", format!("{:e}", 1e-3 * scale)) } else { scene }
}

pub(super) fn scenes_of_any_scale_position_and_frame_rate_stay_finite() {
    let away = |offset: f64| Scene::of(changed(&cube(0.0), move |_, p| p.map(|x| x + offset))).set("ground", true);
    let at = |fps: f64| grounded(cube(0.02)).at(fps);
    hold(
        "6",
        [
            ("scene × 1e-6", scaled(1e-6, true)),
            ("scene × 1e6", scaled(1e6, true)),
            ("scene × 1e-6, params as they are", scaled(1e-6, false)),
            ("scene × 1e6, params as they are", scaled(1e6, false)),
            ("#4: scene × 1e-30", scaled(1e-30, true)),
            ("#4: scene × 1e30, params as they are", scaled(1e30, false)),
            ("#3: denormal positions", scaled(1e-40, false)),
            ("#5: 1 km away", away(1e3)),
            ("#9: a frame of 1,000 s", at(1e-3)),
            ("#9: a frame of 1 µs", at(1e6)),
            ("#9: time stands still", grounded(cube(0.02)).set("time_scale", 0)),
            ("#9: time runs a million times as fast", grounded(cube(0.02)).set("time_scale", "1e6")),
            (
                "#41: gravity near the largest number of single precision",
                grounded(cube(0.02)).set("gravity", "[0, -1e37, 0]"),
            ),
        ],
    );
    refused(
        "5",
        [
            ("features of 3 cm 1e7 m away, where single precision steps by 1 m", away(1e7), "the body has no mass"),
            (
                "#9: steps end beyond the largest number of single precision",
                Scene::of(cube(0.02)).set("time_scale", "1e30"),
                "`P` of point 0 of the mesh is NaN or infinite",
            ),
        ],
    );
}

pub(super) fn nan_and_infinity_are_refused_by_name_in_every_input() {
    let tets = |name: &'static str, bad: f32| {
        let mut body = with(cube(0.02), "soft", |_| 1.0);
        match name {
            "P" => body.edit(P).unwrap()[7][1] = bad,
            name => body.edit(Attr::<f32>::point(name)).unwrap()[7] = bad,
        }
        body
    };
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let bowl = move |_: Frame| {
            let mut bowl = cuboid([-0.1; 3], [0.0; 3]);
            bowl.part_mut(engine::geometry::Kind::Mesh).unwrap().edit(P).unwrap()[7][1] = bad;
            bowl
        };
        let soft = r#"{ "value": 1000, "attribute": "soft" }"#;
        let number = if bad.is_nan() { "1" } else { "2" };
        let named = |what: &str| -> &'static str { format!("{bad} in {what}").leak() };
        refused(
            number,
            [
                (named("a position"), Scene::of(tets("P", bad)), "`P` of point 7 of the tets is NaN or infinite"),
                (
                    named("a mask"),
                    Scene::of(tets("soft", bad)).set("stiffness", soft),
                    "`soft` of point 7 of the tets is NaN or infinite",
                ),
                (
                    named("a goal"),
                    Scene::of(cube(0.02)).goal(tets("P", bad), 2.0, 10.0, 0.0),
                    "`P` of point 7 of the tets is NaN or infinite",
                ),
                (
                    named("a pin"),
                    Scene::of(cube(0.02)).pins(1.0, move |_| vec![[bad; 3]]),
                    "`P` of point 0 of the points is NaN or infinite",
                ),
                (
                    named("a collider"),
                    Scene::of(cube(0.02)).collider(bowl),
                    "`P` of point 7 of the mesh is NaN or infinite",
                ),
            ],
        );
    }
}

pub(super) fn unsorted_duplicate_single_and_missing_keyframes_work_or_are_refused_by_name() {
    let keyed = |keys: &str| grounded(cube(0.02)).set("stiffness", format!(r#"{{ "keyframes": {keys} }}"#));
    hold(
        "8",
        [
            ("a single keyframe", keyed("[[3, 1e4]]")),
            ("stiffness from 1e-3 to 1e12 in a frame", keyed("[[2, 1e-3], [3, 1e12]]")),
        ],
    );
    for keys in ["[]", "[[3, 1e4], [1, 1e3]]", "[[2, 1e4], [2, 1e3]]"] {
        let said = keyed(keys).fault().unwrap_or_default();
        assert!(said.contains("stiffness"), "{keys}: {said}");
        page::record(PART, "8", &format!("keyframes {keys}"), Outcome::Refused, &said);
    }
}

pub(super) fn bodies_stay_finite_at_both_ends_of_every_range() {
    let node = convect::CATALOGUE.get("Softbody").unwrap();
    let goal = changed(&cube(0.002), |_, [x, y, z]| [1.2 * x, 0.7 * y, 1.2 * z]);
    // A scene in which every param has an effect.
    let busy = || {
        let top = cube(0.002).positions()[26];
        let scene = grounded(cube(0.002)).and(block([1; 3], 0.1, [0.0, 0.105, 0.0]));
        let scene = scene.goal(goal.clone(), 3.0, 100.0, 1.0).pins(1e-3, move |_| vec![top]);
        scene
            .set("coupling_radius", 0.02)
            .set("self_collision", true)
            .set("plastic_yield", 0.01)
            .set("plastic_creep", 10)
    };
    let mut ends = 0;
    for spec in node.param_specs() {
        for RangeEnd { inside, .. } in range_ends(&spec) {
            let text = match &inside {
                Value::Float(x) | Value::Masked(x, _) => format!("{x:?}"),
                Value::Int(x) => x.to_string(),
                _ => continue,
            };
            let what = format!("`{}` at {text}", spec.name);
            let at_end = busy().set(spec.name, text);
            assert_eq!(at_end.fault(), None, "{what}");
            assert_eq!(faults(&at_end, &at_end.cook(1..=4, 2)), [""; 0], "{what}");
            ends += 1;
        }
    }
    assert!(ends > 15, "{ends}");
    page::record(
        PART,
        "7",
        "every param of Softbody at both ends of its range",
        Outcome::Finite,
        &format!("{ends} ends"),
    );
}
