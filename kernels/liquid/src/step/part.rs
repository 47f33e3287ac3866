//! Which part of its shape a source fills.
//!
//! A rate that does not fill all of the shape at once fills the middle of it: an ellipsoid as long and wide as the shape, cut
//! off by it, which grows until what it adds is what the rate gives. Where the liquid inside moves at an imposed velocity,
//! its section then becomes rate ÷ velocity.

use numerics::vector::{Vec3, length, sub};

/// Half the size, in cells, of the smallest part that is filled where no liquid is: the surface would lose a smaller one.
pub(super) const LEAST: f32 = 1.0;

/// A part of a shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Part {
    Whole,
    Middle(Ellipsoid),
}

impl Part {
    /// About the distance of a place from the part, where the shape is this far, in cells.
    pub(super) fn distance(&self, point: Vec3, shape: f32) -> f32 {
        match self {
            Self::Whole => shape,
            Self::Middle(middle) => shape.max(middle.distance(point)),
        }
    }
}

/// In cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ellipsoid {
    pub centre: Vec3,
    /// Half of its lengths.
    pub axes: Vec3,
}

impl Ellipsoid {
    /// An ellipsoid of the same proportions, `size` times as large but nowhere thinner than [`LEAST`]; below 0, the least one
    /// made smaller.
    pub(super) fn sized(&self, size: f32) -> Self {
        let axes = self.axes.map(|axis| if size < 0.0 { (1.0 + size) * LEAST } else { (size * axis).max(LEAST) });
        Self { axes, ..*self }
    }

    /// The largest of its sections across a direction, of any length.
    pub(super) fn section(&self, direction: Vec3) -> f64 {
        let reach = length([0, 1, 2].map(|axis| self.axes[axis] * direction[axis])) / length(direction);
        let product: f32 = self.axes.iter().product();
        std::f64::consts::PI * f64::from(product / reach)
    }

    /// The distance from it, exact to the first order where it is next to 0.
    fn distance(&self, point: Vec3) -> f32 {
        let way = sub(point, self.centre);
        let scaled: Vec3 = std::array::from_fn(|axis| way[axis] / self.axes[axis]);
        let (far, slope) = (length(scaled), length(std::array::from_fn(|axis| scaled[axis] / self.axes[axis])));
        let least = self.axes.into_iter().fold(f32::INFINITY, f32::min);
        if far < 1e-3 { -least } else { (far - 1.0) * far / slope }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_ellipsoid_has_its_distance_and_sections() {
        let one = Ellipsoid { centre: [1.0, 2.0, 3.0], axes: [4.0, 2.0, 1.0] };
        for (at, distance) in [([5.5, 2.0, 3.0], 0.5), ([1.0, 2.0, 3.0], -1.0), ([1.0, 2.0, 2.25], -0.25)] {
            assert!((one.distance(at) - distance).abs() < 0.06, "{at:?} {}", one.distance(at));
        }
        let near = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 1e-6, "{a} {b}");
        near(one.section([0.0, 0.0, -3.0]), 8.0 * std::f64::consts::PI);
        near(one.section([0.5, 0.0, 0.0]), 2.0 * std::f64::consts::PI);
        assert_eq!(one.sized(0.5).axes, [2.0, 1.0, LEAST]);
        assert_eq!(one.sized(-0.5).axes, [0.5 * LEAST; 3]);
    }
}
