//! The whole chain, rotated, moved and scaled with its scene.

use engine::geometry::Component;
use numerics::vector::{DVec3, to_f64};

use super::{Figure, storage};
use crate::cooked::cook;

/// A change of a scene: first scaled, then rotated about x, y and z, then moved.
struct Change {
    scale: f64,
    /// Degrees.
    turn: [f64; 3],
    translation: [f64; 3],
}

/// Length of the longest curve, and of the shortest segment, before the change.
const LENGTH: f64 = 0.4;
const SEGMENT: f64 = 0.05;

const NONE: Change = Change { scale: 1.0, turn: [0.0; 3], translation: [0.0; 3] };

impl Change {
    fn turned(&self, mut v: [f64; 3]) -> [f64; 3] {
        for axis in 0..3 {
            let (s, c) = libm::sincos(self.turn[axis].to_radians());
            let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
            (v[a], v[b]) = (v[a] * c - v[b] * s, v[a] * s + v[b] * c);
        }
        v
    }

    fn of(&self, p: [f32; 3]) -> [f64; 3] {
        let p = self.turned(p.map(|x| f64::from(x) * self.scale));
        (DVec3::from(p) + DVec3::from(self.translation)).into()
    }

    /// The chain on a furry ball in a wind that turns, with a gust placed by hand.
    fn scene(&self, noise: &str) -> String {
        let Self { scale, turn, translation } = self;
        let moved = |name: &str| {
            format!(
                r#""{name}": {{ "type": "Transform", "inputs": {{ "geometry": "{name}_here" }},
                     "params": {{ "scale": [{scale}, {scale}, {scale}], "rotate": {turn:?}, "translate": {translation:?} }} }},"#
            )
        };
        let [from, to] = [[1.0, 0.1, -0.2], [0.8, -0.3, 0.6]].map(|wind| self.turned(wind));
        let wind = format!(r#""wind_dir": {{ "keyframes": [[1, {from:?}], [12, {to:?}]] }}"#);
        format!(
            r#"
            "ball_here": {{ "type": "Mesh_Primitive", "params": {{ "shape": "sphere", "size": [2, 2, 2], "divisions": 12 }} }},
            "fur_here": {{ "type": "Curve_Scatter", "inputs": {{ "skin": "ball_here" }},
                          "params": {{ "density": 40, "length": [0.2, 0.4] }} }},
            "gust_here": {{ "type": "Gust_Control", "params": {{ "scale": [1, 0.8, 1.4], "rotate": [10, 20, 30],
                           "translate": {{ "keyframes": [[1, [-1, 0, 0.3]], [12, [1, 0.4, 0]]] }} }} }},
            {} {} {}
            "gusts": {{ "type": "Curve_Wind_Gusts", "inputs": {{ "curves": "fur", "controls": ["gust"] }},
                       "params": {{ "num_gusts": 0, "base": 0.3 }} }},
            "lee": {{ "type": "Curve_Wind_Shielding", "inputs": {{ "curves": "gusts", "colliders": ["ball"] }},
                     "params": {{ {wind}, "offset": {}, "shield": 0.7 }} }},
            "wind": {{ "type": "Curve_Wind", "inputs": {{ "curves": "lee" }},
                      "params": {{ {wind}, {noise} }} }},
            "swing": {{ "type": "Curve_Jiggle", "inputs": {{ "curves": "wind", "skin": "ball" }} }},
            "out": {{ "type": "Curve_Wind_Collision",
                     "inputs": {{ "curves": "swing", "rest": "fur", "colliders": ["ball"] }},
                     "params": {{ "gap": {}, "offset_root": {}, "coherence": 1 }} }}"#,
            moved("ball"),
            moved("fur"),
            moved("gust"),
            10.0 * scale,
            1e-4 * scale,
            1e-3 * scale,
        )
    }
}

/// Distance between the results of wind, swing and collision for the changed scene and the changed results for the
/// original scene, relative to the longest curve; each with the error that rounding of stored positions may cause.
fn errors(change: &Change, noise: &str) -> Vec<[f64; 2]> {
    let stages = ["wind", "swing", "out"];
    let [here, there] = [&NONE, change].map(|change| cook(&change.scene(noise), &stages, 12));
    let mut errors = Vec::new();
    for (here, there) in here.iter().flatten().zip(there.iter().flatten()) {
        let [here, there]: [&Component; 2] = [here, there].map(|frame| frame.curves().unwrap());
        let storage = (storage(there.positions()) / change.scale).max(storage(here.positions())) / SEGMENT;
        errors.extend(here.positions().iter().zip(there.positions()).map(|(a, b)| {
            let a = change.of(*a);
            let apart = (DVec3::from(a) - to_f64(*b)).norm();
            [apart / (LENGTH * change.scale), storage]
        }));
    }
    errors
}

pub(super) fn figures() -> Vec<Figure> {
    let calm = r#""noise": "none""#;
    let turned = Change { turn: [20.0, -50.0, 70.0], ..NONE };
    let moved = Change { translation: [8.0, -4.0, 16.0], ..NONE };
    let scaled = |scale: f64| errors(&Change { scale, ..NONE }, calm);
    vec![
        Figure::stored(
            "the whole chain: change if scene and wind are rotated together",
            errors(&turned, calm),
            1e-5,
            " L",
        ),
        Figure::stored("if they are moved by 18 m", errors(&moved, calm), 1e-5, " L"),
        Figure::stored(
            "if they are moved by 18 m, with noise sampled at `Pref`",
            errors(&moved, r#""noise_space": "rest""#),
            1e-5,
            " L",
        ),
        Figure::stored("if they are scaled to a thousandth", scaled(1e-3), 1e-5, " L"),
        Figure::stored("if they are scaled by a thousand", scaled(1e3), 1e-5, " L"),
    ]
}
