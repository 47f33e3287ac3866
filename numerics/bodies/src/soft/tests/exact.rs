//! Closed forms beside those of the table of laws (tests/softbody/accuracy): a hanging chain.

use super::*;

#[test]
fn a_hanging_chain_stretches_by_the_weight_below() {
    let count = 6;
    let points: Vec<[f64; 3]> = (0..count).map(|i| [0.0, -f64::from(i), 0.0]).collect();
    let springs: Vec<Spring> =
        (1..count).map(|i| Spring { ends: [i - 1, i], stiffness: 500.0, damping: 50.0, length: 1.0 }).collect();
    let body = Body::of_springs(&points, &[2.0; 6], &springs).unwrap();
    let mut state = State::at_rest(&body);
    let pins = [Pin { particle: 0, between: [[0.0; 3]; 2] }];
    let _ = steps(&body, &mut state, &Frame { pins: &pins, volume: 0.0, ..Frame::default() }, 1000);
    for i in 1..count as usize {
        let length = state.positions[i - 1][1] - state.positions[i][1];
        let weight = 2.0 * 9.81 * f64::from(count - i as u32);
        assert!((length - 1.0 - weight / 500.0).abs() < 1e-9, "spring {i} is {length} long");
    }
}
