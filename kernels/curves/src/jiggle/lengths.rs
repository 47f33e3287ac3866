//! Curves whose segments have the lengths of others.

use numerics::vector::{DVec3, Vec3, to_f32, to_f64};

/// Rescales the segments of `points` to the lengths that they have in `shape`. Directions and roots are kept, and so are
/// segments without a direction.
///
/// # Panics
/// If a slice is shorter than `starts` says.
pub fn with_lengths_of(shape: &[Vec3], starts: &[u32], points: &mut [Vec3]) {
    let length = |points: &[Vec3], k: usize| (to_f64(points[k + 1]) - to_f64(points[k])).norm();
    for ends in starts.windows(2).filter(|ends| ends[0] < ends[1]) {
        // Displacement of the CV so far: a CV that need not move keeps its bits.
        let mut moved = DVec3::zeros();
        let mut ahead = points[ends[0] as usize];
        for k in ends[0] as usize..ends[1] as usize - 1 {
            let asked = length(shape, k);
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
