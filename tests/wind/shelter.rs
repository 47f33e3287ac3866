//! Changes of shelter between frames as the wind turns slowly: the figures for Curve_Wind_Shielding.

use engine::geometry::SHIELDED;

use crate::cooked::{BEAR, cook};

/// `shielded` of each curve at each of `frames` degrees.
fn turning(smooth: f32, frames: i64) -> Vec<Vec<f32>> {
    let lee = format!(
        r#"{BEAR} "lee": {{
            "type": "Curve_Wind_Shielding",
            "inputs": {{ "curves": "fur", "colliders": ["skin"] }},
            "params": {{ "smooth": {smooth}, "wind_dir": {{ "expr": ["cos(frame*pi/180)", "0", "sin(frame*pi/180)"] }} }}
        }}"#
    );
    let frames = cook(&lee, &["lee"], frames).remove(0);
    frames.iter().map(|frame| frame.curves().unwrap().get(SHIELDED).unwrap().to_vec()).collect()
}

/// The largest change of a curve's `shielded` between consecutive frames, the fraction of curves that change by more
/// than a tenth in a frame, and the mean of `shielded`.
fn changes(frames: &[Vec<f32>]) -> [f64; 3] {
    let (mut largest, mut jumps, mut pairs) = (0.0_f64, 0, 0);
    for (before, after) in frames.iter().zip(&frames[1..]) {
        for (before, after) in before.iter().zip(after) {
            let change = f64::from((after - before).abs());
            largest = largest.max(change);
            jumps += u32::from(change > 0.1);
            pairs += 1;
        }
    }
    let mean = frames.iter().flatten().map(|share| f64::from(*share)).sum::<f64>();
    [largest, f64::from(jumps) / f64::from(pairs), mean / frames.iter().map(Vec::len).sum::<usize>() as f64]
}

#[test]
fn smooth_shielding_does_not_pop_as_the_wind_turns() {
    let figures = [0.0, 0.5, 1.0].map(|smooth| (smooth, changes(&turning(smooth, 60))));
    for (smooth, [largest, jumps, mean]) in figures {
        println!(
            "smooth {smooth}: largest change {largest:.3}, more than 0.1 in {:.3} %, mean {mean:.4}",
            100.0 * jumps
        );
    }
    let [hard, .., soft] = figures.map(|(_, changes)| changes);
    assert!(soft[0] < 0.2 && soft[1] < 0.05 * hard[1], "{soft:?} against {hard:?}");
    assert!((soft[2] - hard[2]).abs() < 0.02, "the mean shelter is kept: {} and {}", soft[2], hard[2]);
}
