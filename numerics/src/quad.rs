//! Three-vectors in `f64` with a fourth lane, so that operations on all components are single instructions.
//!
//! For inner loops over vectors whose places in memory follow no order. Components are rounded as those of
//! [`DVec3`] are; the fourth lane has no meaning.

use crate::vector::DVec3;
use std::ops::{Add, AddAssign, Mul, Sub, SubAssign};

/// x, y, z, and a lane without meaning.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(32))]
pub struct Quad([f64; 4]);

impl Quad {
    /// A vector with 0 in its fourth lane.
    #[inline(always)]
    pub fn new(v: DVec3) -> Self {
        Self([v.x, v.y, v.z, 0.0])
    }

    /// Four lanes of `f32`, exactly.
    #[inline(always)]
    pub fn widened(lanes: [f32; 4]) -> Self {
        Self(lanes.map(f64::from))
    }

    /// x, y, z.
    #[inline(always)]
    pub fn xyz(self) -> DVec3 {
        DVec3::new(self.0[0], self.0[1], self.0[2])
    }

    /// The fourth lane.
    #[inline(always)]
    pub fn fourth(self) -> f64 {
        self.0[3]
    }

    /// The same with another fourth lane.
    #[inline(always)]
    pub fn with_fourth(self, fourth: f64) -> Self {
        Self([self.0[0], self.0[1], self.0[2], fourth])
    }

    /// All lanes rounded to `f32`.
    #[inline(always)]
    pub fn narrowed(self) -> [f32; 4] {
        self.0.map(|x| x as f32)
    }

    /// The vector whose lanes are those of these numbers.
    #[inline(always)]
    pub fn permuted(self, lanes: [usize; 4]) -> Self {
        Self(lanes.map(|lane| self.0[lane]))
    }

    /// The vector product.
    #[inline(always)]
    pub fn cross(self, other: Self) -> Self {
        const LEFT: [usize; 4] = [1, 2, 0, 3];
        const RIGHT: [usize; 4] = [2, 0, 1, 3];
        self.permuted(LEFT) * other.permuted(RIGHT) - self.permuted(RIGHT) * other.permuted(LEFT)
    }

    /// The scalar product of x, y, z.
    #[inline(always)]
    pub fn dot(self, other: Self) -> f64 {
        (self * other).total()
    }

    /// x + y + z.
    #[inline(always)]
    pub fn total(self) -> f64 {
        self.0[0] + self.0[1] + self.0[2]
    }

    #[inline(always)]
    fn lanes(self, other: Self, of: impl Fn(f64, f64) -> f64) -> Self {
        Self(std::array::from_fn(|lane| of(self.0[lane], other.0[lane])))
    }
}

impl Add for Quad {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.lanes(other, |a, b| a + b)
    }
}

impl Sub for Quad {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.lanes(other, |a, b| a - b)
    }
}

/// Lane by lane.
impl Mul for Quad {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.lanes(other, |a, b| a * b)
    }
}

impl Mul<f64> for Quad {
    type Output = Self;

    #[inline(always)]
    fn mul(self, by: f64) -> Self {
        Self(self.0.map(|a| a * by))
    }
}

impl AddAssign for Quad {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl SubAssign for Quad {
    #[inline(always)]
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn components_have_the_bits_of_three_vectors() {
        let [a, b] = [[0.1, -0.7, 1e-9], [3.3, 0.2, -1.7]].map(DVec3::from);
        let [p, q] = [a, b].map(Quad::new);
        assert_eq!([(p + q).xyz(), (p - q).xyz(), (p * 0.3).xyz()], [a + b, a - b, a * 0.3]);
        assert_eq!((p.dot(q), p.total()), (a.dot(&b), a.x + a.y + a.z));
        assert_eq!([(p * q).xyz(), p.cross(q).xyz()], [a.component_mul(&b), a.cross(&b)]);
        let (mut sum, mut quad) = (a, p);
        sum += b;
        sum -= a * 0.1;
        quad += q;
        quad -= p * 0.1;
        assert_eq!(quad.xyz(), sum);
        let turned = p.with_fourth(7.0).permuted([3, 0, 0, 1]);
        assert_eq!((turned.xyz(), turned.fourth()), (DVec3::new(7.0, a.x, a.x), a.y));
        assert_eq!(p.narrowed()[..3], a.map(|x| x as f32).as_slice()[..]);
        let wide = Quad::widened([0.5, 0.1, -2.0, 7.0]);
        assert_eq!((wide.xyz(), wide.fourth()), (DVec3::new(0.5, f64::from(0.1_f32), -2.0), 7.0));
    }
}
