//! How many curves jump between consecutive frames in a smooth wind: the figures for Curve_Wind_Collision's
//! `coherence`.

use engine::geometry::Geometry;
use numerics::vector::{self, Vec3};

use crate::cooked::{BEAR, cook};

/// The fraction of curves, over all frames, that move by more than a quarter of their length since the frame before.
fn jumps(frames: &[Geometry]) -> f64 {
    let (mut jumps, mut all) = (0, 0);
    for (before, after) in frames.iter().zip(&frames[1..]) {
        let (before, after) = (before.curves().unwrap(), after.curves().unwrap());
        for cvs in after.runs().ranges() {
            let (before, after) = (&before.positions()[cvs.clone()], &after.positions()[cvs]);
            let length: f32 = after.windows(2).map(|ends| distance(ends[0], ends[1])).sum();
            jumps += u32::from(before.iter().zip(after).any(|(a, b)| distance(*a, *b) > 0.25 * length));
            all += 1;
        }
    }
    f64::from(jumps) / f64::from(all)
}

fn distance(a: Vec3, b: Vec3) -> f32 {
    vector::length(vector::sub(a, b))
}

#[test]
fn coherent_collision_adds_few_jumps_to_those_of_the_wind() {
    let collision = |name: &str, coherence: f32| {
        format!(
            r#", "{name}": {{ "type": "Curve_Wind_Collision", "params": {{ "loft": 0, "coherence": {coherence} }},
                 "inputs": {{ "curves": "wind", "rest": "fur", "colliders": ["skin"] }} }}"#
        )
    };
    let nodes = format!(
        r#"{BEAR} "wind": {{ "type": "Curve_Wind", "inputs": {{ "curves": "fur" }}, "params": {{
            "wind_dir": [1, 0.1, 0.4], "global_rotate": 0.8, "ramp_rotate": {{ "ramp": [[0, 0.4], [1, 1]] }},
            "noise": "perlin", "amplitude": 0.7, "frequency": 2, "scroll": 1.06, "octaves": 2, "waviness": 0.5 }} }}
            {} {}"#,
        collision("plain", 0.0),
        collision("coherent", 1.0)
    );
    let [wind, plain, coherent] = <[f64; 3]>::try_from(
        cook(&nodes, &["wind", "plain", "coherent"], 48).iter().map(|f| jumps(f)).collect::<Vec<_>>(),
    )
    .unwrap();
    println!(
        "jumps of more than a quarter of the length: wind {:.3} %, coherence 0 {:.3} %, 1 {:.3} %",
        100.0 * wind,
        100.0 * plain,
        100.0 * coherent
    );
    assert!((0.004..0.0055).contains(&wind), "the smoothness of the wind alone has changed: {wind}");
    assert!(coherent < 0.007 && coherent < 0.7 * plain, "{coherent} against {plain}");
}
