//! The rectangle across the wind, upwind of everything, in which gusts start.

use numerics::vector::{DVec3, Vec3, to_f64};

/// A rectangle perpendicular to the wind.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    centre: DVec3,
    /// From the centre to the side, and to the upper edge.
    half: [DVec3; 2],
    /// The same directions, of length 1.
    sides: [DVec3; 2],
}

/// Cosine of the angle to the vertical beyond which a wind has no well-defined upward side.
const VERTICAL: f64 = 0.999;

impl Plane {
    /// The rectangle `distance` upwind of a box, `area` wide and high, metres; an extent of 0 is that of the box as
    /// seen along the wind. `wind` has length 1. Its first side is level, its second as upright as possible; under a
    /// wind straight up or down they are z and x.
    pub fn new([low, high]: [Vec3; 2], wind: [f64; 3], distance: f64, area: [f64; 2]) -> Self {
        let ([low, high], wind) = ([to_f64(low), to_f64(high)], DVec3::from(wind));
        let (centre, half) = (low * 0.5 + high * 0.5, high * 0.5 - low * 0.5);
        let extent = |direction: DVec3| direction.abs().dot(&half);
        let level = if wind.y.abs() < VERTICAL { DVec3::y() } else { DVec3::x() }.cross(&wind);
        let across = level / level.norm();
        let up = wind.cross(&across);
        let side = |direction: DVec3, size: f64| direction * if size > 0.0 { 0.5 * size } else { extent(direction) };
        let upwind = extent(wind) + distance;
        Self { centre: centre - wind * upwind, half: [side(across, area[0]), side(up, area[1])], sides: [across, up] }
    }

    /// The point at `position` of the rectangle, −1..1 along each side.
    pub fn at(&self, position: [f64; 2]) -> [f64; 3] {
        (self.centre + self.half[0] * position[0] + self.half[1] * position[1]).into()
    }

    /// The direction in the rectangle at this fraction of a revolution from its first side to its second, of length 1.
    pub fn direction(&self, revolution: f64) -> [f64; 3] {
        let angle = std::f64::consts::TAU * revolution;
        (self.sides[0] * libm::cos(angle) + self.sides[1] * libm::sin(angle)).into()
    }
}
