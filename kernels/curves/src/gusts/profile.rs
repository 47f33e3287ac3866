//! A ramp prepared for many evaluations, sixteen at a time.
//!
//! Equal to [`Ramp::eval`] up to rounding, and exactly at the keys.

use numerics::lanes::{F32x16, LANES};
use numerics::ramp::{Interpolation, Ramp};

/// A ramp as polynomials, one for each key.
pub(super) struct Profile {
    /// The value left of the first key.
    first: f32,
    pieces: Vec<Piece>,
    /// Coefficients of t, t² and t³; t runs from 0 at a key to 1 at the next.
    powers: [f32; 3],
}

/// The interval from a key to the next; that of the last key is constant.
struct Piece {
    x: f32,
    y: f32,
    /// One over the distance to the next key; 0 if that is too short for its inverse to be finite.
    inverse: f32,
    rise: f32,
}

impl Profile {
    pub(super) fn new(ramp: &Ramp) -> Self {
        let keys = ramp.keys();
        let piece = |key: usize| {
            let [x, y] = keys[key];
            let [next_x, next_y] = *keys.get(key + 1).unwrap_or(&keys[key]);
            let inverse = 1.0 / (next_x - x);
            let joined = ramp.interpolation() != Interpolation::Constant && inverse.is_finite();
            let (inverse, rise) = if joined { (inverse, next_y - y) } else { (0.0, 0.0) };
            Piece { x, y, inverse, rise }
        };
        let powers = if ramp.interpolation() == Interpolation::Smooth { [0.0, 3.0, -2.0] } else { [1.0, 0.0, 0.0] };
        Self { first: keys[0][1], pieces: (0..keys.len()).map(piece).collect(), powers }
    }

    /// The values at sixteen arguments; undefined for NaN and infinities.
    #[inline(always)]
    pub(super) fn eval(&self, at: &F32x16) -> F32x16 {
        let [a, b, c] = self.powers;
        let mut value = F32x16::splat(self.first);
        for piece in &self.pieces {
            for lane in 0..LANES {
                let t = (at.0[lane] - piece.x) * piece.inverse;
                let here = piece.y + piece.rise * (t * (a + t * (b + t * c)));
                value.0[lane] = if at.0[lane] >= piece.x { here } else { value.0[lane] };
            }
        }
        value
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use numerics::random::Key;

    #[test]
    fn a_profile_equals_its_ramp_up_to_rounding_and_exactly_at_keys() {
        for kind in [Interpolation::Linear, Interpolation::Smooth, Interpolation::Constant] {
            for count in [1, 2, 3, 9, 60] {
                let keys: Vec<_> = (0..count).map(|i| [i as f32 / 16.0, Key::new(1).of(i).f32() - 0.5]).collect();
                let ramp = Ramp::new(keys.clone(), kind).unwrap();
                let profile = Profile::new(&ramp);
                for [x, y] in keys {
                    assert_eq!(profile.eval(&F32x16::splat(x)).0, [y; LANES]);
                }
                for round in 0..64 {
                    let at = F32x16::from_fn(|lane| Key::new(2).of(round).of(lane as u64).between([-0.5, 4.5]));
                    for (x, value) in at.0.iter().zip(profile.eval(&at).0) {
                        assert!((value - ramp.eval(*x)).abs() < 2e-6, "{kind:?} {count} at {x}");
                    }
                }
            }
        }
    }

    #[test]
    fn keys_too_close_to_divide_by_make_a_step() {
        let ramp = Ramp::new(vec![[0.0, 0.0], [1e-45, 1e30], [0.5, -1e30]], Interpolation::Linear).unwrap();
        let value = |x: f32| Profile::new(&ramp).eval(&F32x16::splat(x)).0[0];
        assert_eq!([value(-1.0), value(0.0), value(1e-45), value(0.5), value(1.0)], [0.0, 0.0, 1e30, -1e30, -1e30]);
    }
}
