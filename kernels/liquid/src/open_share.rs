//! How much of a cell's face a solid leaves open (Batty, Bertails and Bridson 2007, section 4).

/// Shares below it count as closed: the flow through slivers would dominate the number of iterations.
pub const LEAST_OPEN_SHARE: f32 = 0.02;

/// The share of a square outside a solid, 0…1, given the signed distances of the solid (negative inside) at its corners,
/// in their order around the square. Exact where the solid's edge is straight. Shares below [`LEAST_OPEN_SHARE`] are 0.
pub fn open_share(distances: [f32; 4]) -> f32 {
    let share = share_above(distances);
    if share < LEAST_OPEN_SHARE { 0.0 } else { share }
}

/// The share of a square where a function that has these values at its corners is above 0; exact where that edge is straight.
pub(crate) fn share_above(s: [f32; 4]) -> f32 {
    let above = s.map(|s| s > 0.0);
    let is_saddle = above[0] == above[2] && above[1] == above[3] && above[0] != above[1];
    // Through a saddle runs a band of what the middle is.
    if is_saddle && s.iter().sum::<f32>() <= 0.0 {
        return 1.0 - polygon_area(s.map(|s| -s));
    }
    polygon_area(s)
}

/// The area of the polygon of the corners above 0 and the points where the square's edges cross 0.
fn polygon_area(s: [f32; 4]) -> f32 {
    const CORNERS: [[f32; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let mut points = [[0.0; 2]; 8];
    let mut count = 0;
    let mut push = |point| {
        points[count] = point;
        count += 1;
    };
    for corner in 0..4 {
        let next = (corner + 1) % 4;
        let (a, b) = (CORNERS[corner], CORNERS[next]);
        if s[corner] > 0.0 {
            push(a);
        }
        if (s[corner] > 0.0) != (s[next] > 0.0) {
            let t = s[corner] / (s[corner] - s[next]);
            push([a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])]);
        }
    }
    let twice: f32 = (0..count)
        .map(|i| {
            let ([ax, ay], [bx, by]) = (points[i], points[(i + 1) % count]);
            ax * by - bx * ay
        })
        .sum();
    (0.5 * twice).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(a: f32, b: f32) {
        assert!((a - b).abs() < 1e-6, "{a} {b}");
    }

    #[test]
    fn straight_edges_leave_their_exact_share() {
        near(open_share([1.0; 4]), 1.0);
        near(open_share([-1.0; 4]), 0.0);
        // Half a square; a quarter beside the solid; a corner triangle of ½ · 0.4².
        near(open_share([-1.0, 1.0, 1.0, -1.0]), 0.5);
        near(open_share([-3.0, 1.0, 1.0, -3.0]), 0.25);
        near(open_share([0.4, -0.6, -1.6, -0.6]), 0.08);
        near(open_share([-0.4, 0.6, 1.6, 0.6]), 1.0 - 0.08);
    }

    #[test]
    fn saddles_are_joined_through_the_middle_or_not() {
        near(open_share([1.0, -0.5, 1.0, -0.5]), 1.0 - 2.0 * 0.5 / 9.0);
        near(open_share([0.5, -1.0, 0.5, -1.0]), 2.0 * 0.5 / 9.0);
    }

    #[test]
    fn slivers_are_closed() {
        assert_eq!(open_share([0.1, -0.9, -1.9, -0.9]), 0.0);
    }
}
