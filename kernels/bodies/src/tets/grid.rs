//! The integer grid to which points are snapped, so that predicates are exact.
//!
//! The step is a power of two and grid planes pass through the world origin. Coordinates that are multiples of the
//! step are therefore exact, and scaling by a power of two changes nothing. Limit: other points move by up to half a
//! step, between 2⁻²⁵ and 2⁻²⁴ of the longest side of the bounding box.

/// Grid coordinates, from 0 to [`SIDE`].
pub type GridPoint = [i32; 3];

/// The largest grid coordinate.
pub const SIDE: i32 = 1 << 24;

/// Position and step of the grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SnapGrid {
    /// Origin of the grid, in steps from the world origin.
    low: [f64; 3],
    /// Step, metres.
    step: f64,
}

impl SnapGrid {
    /// The finest grid that covers all points. `None` without points, or if one is not finite.
    pub fn around(points: &[[f32; 3]]) -> Option<Self> {
        let (first, rest) = points.split_first()?;
        let wide = |p: &[f32; 3]| p.map(f64::from);
        let (mut low, mut high) = (wide(first), wide(first));
        for point in rest {
            for (axis, x) in wide(point).into_iter().enumerate() {
                low[axis] = low[axis].min(x);
                high[axis] = high[axis].max(x);
            }
        }
        if !points.as_flattened().iter().all(|x| x.is_finite()) {
            return None;
        }
        let longest = (0..3).map(|axis| high[axis] - low[axis]).fold(0.0, f64::max);
        if longest == 0.0 {
            return Some(Self { low, step: 1.0 }.settled(low));
        }
        let exponent = (longest.to_bits() >> 52) as i64 - 1023;
        let fits = |grid: &Self| grid.steps(high).iter().all(|steps| *steps <= f64::from(SIDE));
        let at = |exponent: i64| Self { low, step: power_of_two(exponent) }.settled(low);
        let fine = at(exponent - 24);
        Some(if fits(&fine) { fine } else { at(exponent - 23) })
    }

    /// A grid for no points.
    pub(super) fn unit() -> Self {
        Self { low: [0.0; 3], step: 1.0 }
    }

    fn settled(mut self, low: [f64; 3]) -> Self {
        self.low = low.map(|x| (x / self.step).round_ties_even());
        self
    }

    /// Grid coordinates before clamping.
    fn steps(&self, p: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|axis| (p[axis] / self.step).round_ties_even() - self.low[axis])
    }

    /// The nearest grid point, clamped to the grid.
    pub fn grid_point(&self, point: [f64; 3]) -> GridPoint {
        self.steps(point).map(|steps| steps.clamp(0.0, f64::from(SIDE)) as i32)
    }

    /// World position of grid coordinates, metres.
    pub fn point(&self, grid_point: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|axis| (self.low[axis] + grid_point[axis]) * self.step)
    }

    /// Step of the grid, metres.
    pub fn step(&self) -> f64 {
        self.step
    }
}

/// 2 to the `exponent`, which lies between −180 and 130 as points are f32.
fn power_of_two(exponent: i64) -> f64 {
    f64::from_bits(((exponent + 1023) as u64) << 52)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_power_of_two_box_uses_all_24_bits_exactly() {
        let grid = SnapGrid::around(&[[0.0; 3], [1.0; 3]]).unwrap();
        assert_eq!(grid.step(), 1.0 / f64::from(SIDE));
        assert_eq!(grid.grid_point([1.0, 0.5, 0.0]), [SIDE, SIDE / 2, 0]);
        assert_eq!(grid.point([f64::from(SIDE), 1.0, 0.0]), [1.0, grid.step(), 0.0]);
    }

    #[test]
    fn snapping_moves_points_by_at_most_half_a_step_at_any_scale() {
        for scale in [1e-44_f32, 1e-38, 1e-6, 1.0, 1e6, 3e38] {
            let points = [[-0.3 * scale, 0.1 * scale, 0.7 * scale], [0.9 * scale, 0.11 * scale, 0.0]];
            let grid = SnapGrid::around(&points).unwrap();
            for point in points {
                let point = point.map(f64::from);
                let grid_point = grid.grid_point(point);
                assert!(grid_point.iter().all(|x| (0..=SIDE).contains(x)), "{scale}: {grid_point:?}");
                let back = grid.point(grid_point.map(f64::from));
                assert!((0..3).all(|k| (back[k] - point[k]).abs() <= 0.5 * grid.step()), "{scale}");
            }
            assert!(grid.step() * f64::from(SIDE) <= 4.0 * f64::from(1.2 * scale), "{scale}: it is fine enough");
        }
    }

    #[test]
    fn coinciding_points_have_a_grid_and_no_points_or_nan_have_none() {
        assert_eq!(SnapGrid::around(&[[5.0, 0.0, -1.0]; 3]).unwrap().grid_point([5.0, 0.0, -1.0]), [0; 3]);
        assert_eq!(SnapGrid::around(&[]), None);
        assert_eq!(SnapGrid::around(&[[0.0; 3], [0.0, f32::NAN, 0.0]]), None);
        assert_eq!(SnapGrid::around(&[[0.0; 3], [0.0, f32::INFINITY, 0.0]]), None);
    }
}
