//! Curves between two shapes given back the lengths between theirs.

use numerics::vector::Vec3;

/// Turns `points`, curves somewhere between the shapes `near[0]` and `near[1]`, into ones whose segments are `share` of
/// the way between the lengths of those; directions and roots stay. Segments without a direction stay as they are.
///
/// # Panics
/// Where a slice is shorter than `starts` says.
pub fn with_lengths_between(starts: &[u32], near: [&[Vec3]; 2], share: f32, points: &mut [Vec3]) {
    let length = |d: [f64; 3]| (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
    let segment = |points: &[Vec3], k: usize| -> [f64; 3] {
        std::array::from_fn(|axis| f64::from(points[k + 1][axis]) - f64::from(points[k][axis]))
    };
    for ends in starts.windows(2).filter(|ends| ends[0] < ends[1]) {
        // How far the CV was moved, so that one that need not move keeps its bits.
        let mut moved = [0.0_f64; 3];
        let mut ahead = points[ends[0] as usize];
        for k in ends[0] as usize..ends[1] as usize - 1 {
            let [from, to] = near.map(|points| length(segment(points, k)));
            let asked = from + (to - from) * f64::from(share);
            let next = points[k + 1];
            let now: [f64; 3] = std::array::from_fn(|axis| f64::from(next[axis]) - f64::from(ahead[axis]));
            let long = length(now);
            if long > 0.0 {
                moved = std::array::from_fn(|axis| moved[axis] + now[axis] * (asked / long - 1.0));
            }
            points[k + 1] = std::array::from_fn(|axis| (f64::from(next[axis]) + moved[axis]) as f32);
            ahead = next;
        }
    }
}
