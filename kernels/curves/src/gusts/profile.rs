//! A ramp made ready for many evaluations, sixteen at a time.
//!
//! The values of [`Ramp::eval`] to rounding, and exactly those of its keys at its keys.

use numerics::lanes::{F32x16, LANES};
use numerics::ramp::{Interpolation, Ramp};

/// A ramp as polynomials, one from each key on.
pub(super) struct Profile {
    /// The value left of the first key.
    first: f32,
    parts: Vec<Part>,
    /// Of t, t² and t³, t the share of the way from a key to the next.
    powers: [f32; 3],
}

/// From a key to the next; the last key's holds its value.
struct Part {
    x: f32,
    y: f32,
    /// One over the way to the next key; 0 where that is too short to have one.
    inverse: f32,
    rise: f32,
}

impl Profile {
    pub(super) fn new(ramp: &Ramp) -> Self {
        let keys = ramp.keys();
        let part = |place: usize| {
            let [x, y] = keys[place];
            let [next_x, next_y] = *keys.get(place + 1).unwrap_or(&keys[place]);
            let inverse = 1.0 / (next_x - x);
            let joined = ramp.interpolation() != Interpolation::Constant && inverse.is_finite();
            let (inverse, rise) = if joined { (inverse, next_y - y) } else { (0.0, 0.0) };
            Part { x, y, inverse, rise }
        };
        let powers = if ramp.interpolation() == Interpolation::Smooth { [0.0, 3.0, -2.0] } else { [1.0, 0.0, 0.0] };
        Self { first: keys[0][1], parts: (0..keys.len()).map(part).collect(), powers }
    }

    /// The values at sixteen places; of no meaning at a NaN or an infinity.
    #[inline(always)]
    pub(super) fn eval(&self, at: &F32x16) -> F32x16 {
        let [a, b, c] = self.powers;
        let mut value = F32x16::splat(self.first);
        for part in &self.parts {
            for lane in 0..LANES {
                let t = (at.0[lane] - part.x) * part.inverse;
                let here = part.y + part.rise * (t * (a + t * (b + t * c)));
                value.0[lane] = if at.0[lane] >= part.x { here } else { value.0[lane] };
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
    fn it_is_the_ramp_to_rounding_and_at_its_keys_to_the_bit() {
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
    fn keys_closer_than_numbers_can_tell_are_a_step() {
        let ramp = Ramp::new(vec![[0.0, 0.0], [1e-45, 1e30], [0.5, -1e30]], Interpolation::Linear).unwrap();
        let value = |x: f32| Profile::new(&ramp).eval(&F32x16::splat(x)).0[0];
        assert_eq!([value(-1.0), value(0.0), value(1e-45), value(0.5), value(1.0)], [0.0, 0.0, 1e30, -1e30, -1e30]);
    }
}
