//! Difficult colliders: thin, fast, inside out, duplicated, with holes, reversed; and curves that start inside them.

use super::*;

/// Level squares of 4 m at these heights.
fn sheets(heights: &[f32]) -> Geometry {
    let corners = |y: &f32| [[-2.0, *y, -2.0], [-2.0, *y, 2.0], [2.0, *y, 2.0], [2.0, *y, -2.0]];
    let triangles =
        (0..heights.len() as u32).flat_map(|k| [[0, 1, 2], [0, 2, 3]].map(|t| t.map(|corner| 4 * k + corner)));
    mesh(&triangles.collect::<Vec<_>>(), heights.iter().flat_map(corners).collect())
}

/// Upright hairs from this height, 0.4 long.
fn grass(foot: f32, cvs: usize) -> Vec<Vec<Point>> {
    let blade = |k: usize| {
        (0..cvs).map(move |cv| [0.05 * k as f32, foot + 0.4 * cv as f32 / (cvs - 1) as f32, 0.01 * k as f32])
    };
    (0..20).map(|k| blade(k).collect()).collect()
}

fn count(cooked: &Cooked, name: &str) -> Vec<f64> {
    cooked.counts[name].clone()
}

/// Wind that presses hairs into the surface they stand on.
fn pressed() -> Scene {
    Scene::new().with("gusts", r#""base": 1"#).with("lee", r#""shield": 0"#).with(
        "wind",
        r#""global_rotate": 0.8, "noise": "none", "wind_dir": { "keyframes": [[1, [1, -0.5, 0]], [3, [0, -0.5, 1]]] }"#,
    )
}

pub(super) fn curves_that_start_inside_a_collider_are_counted_and_do_not_get_deeper() {
    let sunken = |share: f32, length: f32| {
        let sunken = move |_| moved(curves(&hairs(20, 5, length)), |p| p.map(|x| share * x));
        pressed().fur(sunken)
    };
    let unlifted = |scene: Scene| scene.with("out", r#""offset_root": 0"#);
    let between = |foot: f32, heights: &'static [f32]| {
        let scene = pressed().fur(move |_| curves(&grass(foot, 5))).skin(|_| sheets(heights));
        scene.with("out", r#""offset_root": 0, "loft": 0"#)
    };
    let cooked = hold(
        "24",
        [
            ("roots below the skin", unlifted(sunken(0.9, 0.3))),
            ("roots below the skin, lifted", sunken(0.9, 0.3)),
            ("curves wholly inside the skin", unlifted(sunken(0.2, 0.1))),
            ("through three sheets", between(0.0, &[0.05, 0.15, 0.25])),
            ("between two sheets", between(0.01, &[0.0, 0.5])),
        ],
    );
    assert_eq!(count(&cooked[0], "started_inside"), [20.0; 3]);
    assert_eq!(count(&cooked[1], "crossings_left"), [0.0; 3], "lifted out, they are free");
    assert_eq!(
        count(&cooked[2], "started_inside"),
        [0.0; 3],
        "surfaces are obstacles, not volumes: the inside is free"
    );
    assert_eq!(count(&cooked[2], "crossings_left"), [0.0; 3]);
    assert_eq!(count(&cooked[3], "started_inside"), [20.0; 3]);
    assert_eq!(count(&cooked[4], "started_inside"), [0.0; 3]);
    assert_eq!(count(&cooked[4], "crossings_left"), [0.0; 3]);
    assert!(count(&cooked[4], "contacts").iter().all(|contacts| *contacts > 0.0));
}

pub(super) fn no_kind_of_collider_is_crossed() {
    let thin = pressed().with("out", r#""loft": 0"#).fur(|_| curves(&grass(0.01, 2))).skin(|_| sheets(&[0.0, -1e-6]));
    let reversed = pressed().skin(|_| ball_of(|all| all.into_iter().map(|[a, b, c]| [a, c, b]).collect()));
    let flipping = |frame: Frame| {
        let side = if frame.floor_number() % 2 == 0 { -1.0 } else { 1.0 };
        moved(ball(), |p| p.map(|x| side * x))
    };
    let fast = |frame: Frame| moved(ball(), |[x, y, z]| [x + 3.0 * (frame.number() as f32 - 2.0), y, z]);
    // With the default loft little is met.
    let pressed = || pressed().with("out", r#""loft": 0"#);
    let cooked = hold(
        "25",
        [
            ("a sheet 1e-6 thick, CVs far apart", thin),
            ("a ball", pressed()),
            ("a ball with every face twice", pressed().skin(|_| ball_of(|all| [all.clone(), all].concat()))),
            ("a ball with its faces reversed", reversed.with("out", r#""offset_root": 0, "loft": 0"#)),
            ("a ball with holes", pressed().skin(|_| ball_of(|all| all.into_iter().step_by(3).collect()))),
            ("a ball, every other frame inside out", pressed().skin(flipping)),
            ("a ball that moves ten lengths a frame", pressed().skin(fast)),
        ],
    );
    for k in [0, 1, 2, 3] {
        assert_eq!(count(&cooked[k], "crossings_left"), [0.0; 3], "{k}");
        assert!(count(&cooked[k], "contacts").iter().all(|contacts| *contacts > 0.0), "{k}");
    }
    let bits = |cooked: &Cooked| cooked.of(2, "out").unwrap().positions().to_vec();
    assert_eq!(bits(&cooked[1]), bits(&cooked[2]), "duplicate faces have no effect");
}

pub(super) fn extreme_steps_and_offsets_keep_the_guarantees() {
    let out = |params: &str| pressed().with("out", params);
    hold(
        "7",
        [
            ("#26: collision in 1 step", out(r#""method": "steps", "rotation_steps": 1"#)),
            (
                "#26: collision in a million steps",
                out(r#""method": "steps", "rotation_steps": 1000000"#).fur(|_| curves(&hairs(1, 2, 0.3))),
            ),
            ("#27: `offset_scale` 0", out(r#""offset_scale": 0"#)),
            ("#27: `offset_scale` off", out(r#""offset_scale": -1"#)),
            ("#27: `offset_scale` 1000", out(r#""offset_scale": 1000"#)),
            ("a gap larger than the ball", out(r#""gap": 3, "offset_root": 3"#)),
            ("curves thicker than the ball", out(r#""width": 2"#)),
            ("`coherence` 1", out(r#""coherence": 1"#)),
        ],
    );
}
