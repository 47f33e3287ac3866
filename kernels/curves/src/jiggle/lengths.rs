//! Interpolated curves whose segments have interpolated lengths.

use numerics::vector::{DVec3, Vec3, to_f32, to_f64};

/// Rescales the segments of `points`, which lie between the shapes `near[0]` and `near[1]`, to the length interpolated
/// at `share` between those of the two. Directions and roots are kept, and so are segments without a direction.
///
/// # Panics
/// If a slice is shorter than `starts` says.
pub fn with_lengths_between(starts: &[u32], near: [&[Vec3]; 2], share: f32, points: &mut [Vec3]) {
    let length = |points: &[Vec3], k: usize| (to_f64(points[k + 1]) - to_f64(points[k])).norm();
    for ends in starts.windows(2).filter(|ends| ends[0] < ends[1]) {
        // Displacement of the CV so far: a CV that need not move keeps its bits.
        let mut moved = DVec3::zeros();
        let mut ahead = points[ends[0] as usize];
        for k in ends[0] as usize..ends[1] as usize - 1 {
            let [from, to] = near.map(|points| length(points, k));
            let asked = from + (to - from) * f64::from(share);
            let next = points[k + 1];
            let now = to_f64(next) - to_f64(ahead);
            let long = now.norm();
            if long > 0.0 {
                moved += now * (asked / long - 1.0);
            }
            points[k + 1] = to_f32(to_f64(next) + moved);
            ahead = next;
        }
    }
}
