//! Curve_Deform with guides that are far, coincident, degenerate or few, and Curve_Resample of anything.

use super::*;

fn posts(list: Vec<Vec<Point>>) -> Scene {
    Scene::new().posts(move |_| curves(&list))
}

pub(super) fn any_guides_give_finite_curves_of_the_same_lengths() {
    let far = |away: f32| {
        posts(
            hairs(5, 5, 0.3).into_iter().map(|hair| hair.iter().map(|p| [p[0] + away, p[1], p[2]]).collect()).collect(),
        )
    };
    let root = [0.0, 0.5, 0.0];
    let cooked = hold(
        "10",
        [
            ("one guide", posts(hairs(1, 5, 0.3))),
            ("no guides", posts(vec![])),
            ("guides 1e6 m away", far(1e6)),
            ("guides 1e30 m away", far(1e30)),
            ("guides of one CV", posts(vec![vec![root]; 3])),
            ("guides without length", posts(vec![vec![root; 4]; 3])),
            ("one guide twenty times", posts(vec![hairs(1, 5, 0.3).remove(0); 20])),
            ("guides of 2 to 200 CVs", posts((2..20).map(|k| hairs(20, k * k / 2, 0.3).remove(k)).collect())),
            ("guides 1e-30 m long", posts(hairs(20, 5, 1e-30))),
            ("guides 1e6 m long", posts(hairs(20, 5, 1e6))),
            ("a radius that reaches no guide", far(3.0).with("guided", r#""radius": 0.1"#)),
            ("32 guides of 20", posts(hairs(20, 5, 0.3)).with("guided", r#""guides": 32"#)),
        ],
    );
    // What no guide holds stands as it grew, on a skin that rests.
    let rest = curves(&hairs(20, 5, 0.3));
    for row in [1, 10] {
        assert_eq!(cooked[row].of(2, "guided").unwrap().positions(), rest.curves().unwrap().positions(), "{row}");
    }
}

pub(super) fn roots_inside_the_skin_and_thin_skins_are_no_trouble() {
    let moving = |frame: Frame| {
        let (way, side) = (40.0 * (frame.number() as f32 - 1.0), if frame.number() < 2.0 { 1.0 } else { -1.0 });
        moved(ball(), |[x, y, z]| [x + way, side * y, z])
    };
    hold(
        "10",
        [
            (
                "roots below the skin",
                posts(hairs(20, 5, 0.3)).fur(|_| moved(curves(&hairs(20, 5, 0.3)), |p| p.map(|x| 0.9 * x))),
            ),
            (
                "curves wholly inside the skin",
                posts(hairs(20, 5, 0.3)).fur(|_| moved(curves(&hairs(20, 5, 0.1)), |p| p.map(|x| 0.2 * x))),
            ),
            ("a skin that moves and turns over", posts(hairs(20, 5, 0.3)).skin(moving)),
        ],
    );
}

pub(super) fn curves_of_any_shape_are_resampled() {
    let fine = |params: &str| Scene::new().with("fine", params);
    let root = [0.0, 0.5, 0.0];
    let cooked = hold(
        "10",
        [
            ("curves resampled to 10,000 CVs", fine(r#""cvs": 10000"#)),
            ("resampled at a spacing of 1e-4", fine(r#""spacing": 1e-4"#)),
            ("resampled at a spacing of 1e30", fine(r#""spacing": 1e30"#)),
            ("resampled curves of one CV", fine("").fur(move |_| curves(&vec![vec![root]; 3]))),
            ("resampled curves of equal CVs", fine("").fur(move |_| curves(&vec![vec![root; 5]; 20]))),
            ("two CVs 1e30 m apart", fine("").fur(|_| curves(&[vec![[0.0; 3], [1e30, 0.0, 0.0]]]))),
            (
                "resampled curves of denormal length",
                fine(r#""spacing": 1e-42"#).fur(|_| curves(&[vec![[0.0; 3], [1e-41, 0.0, 0.0]]])),
            ),
        ],
    );
    let counts = |row: usize| cooked[row].of(2, "fine").unwrap().runs().counts().max();
    assert_eq!([0, 2, 3, 4].map(counts), [Some(10_000), Some(2), Some(1), Some(5)]);
}
