//! Ramps: a function of x given by keys, constant before the first and after the last.
//!
//! Exact at every key, and the same bits for one value as for sixteen. `Smooth` is a smoothstep on each interval (slope 0
//! at every key), so it never overshoots. Limit: keys within ±1e30, so that differences do not overflow.

use crate::lanes::{F32x16, LANES};
use std::{error, fmt};

/// How a ramp interpolates between keys.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interpolation {
    /// Linear.
    #[default]
    Linear,
    /// By 3t² − 2t³ of each interval.
    Smooth,
    /// Keeps a key's value until the next key.
    Constant,
}

/// Validated keys and their interpolation.
#[derive(Clone, Debug, PartialEq)]
pub struct Ramp {
    keys: Vec<[f32; 2]>,
    interpolation: Interpolation,
}

/// Largest magnitude of a key's x and y.
const LARGEST: f32 = 1e30;

/// Up to this number of keys all are tried on all lanes at once; above, a binary search per lane.
const FEW_KEYS: usize = 24;

/// Intervals tried in one pass over the lanes: most ramps have no more.
const AT_ONCE: usize = 4;

/// What is wrong with the keys of a ramp; `key` counts from 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RampError {
    /// No key at all.
    Empty,
    /// NaN, infinite, or beyond ±1e30.
    OutOfRange {
        /// Which.
        key: usize,
        /// Its first such number.
        value: f32,
    },
    /// Not right of the key before it.
    Unordered {
        /// Which.
        key: usize,
        /// Its x.
        x: f32,
        /// The x of the key before.
        before: f32,
    },
}

impl fmt::Display for RampError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Empty => write!(f, "a ramp has no key; expected at least one `[x, y]`"),
            Self::OutOfRange { key, value } => {
                write!(f, "ramp key {key} has {value}; expected a number within ±{LARGEST:e}")
            }
            Self::Unordered { key, x, before } => {
                write!(f, "ramp key {key} has x {x}; expected more than {before} of the key before")
            }
        }
    }
}

impl error::Error for RampError {}

impl Ramp {
    /// A ramp through `keys` (`[x, y]`, x strictly increasing), or the first thing wrong with them.
    pub fn new(keys: Vec<[f32; 2]>, interpolation: Interpolation) -> Result<Self, RampError> {
        if keys.is_empty() {
            return Err(RampError::Empty);
        }
        for (key, pair) in keys.iter().enumerate() {
            // A NaN is not within anything.
            if let Some(&value) = pair.iter().find(|value| !(-LARGEST..=LARGEST).contains(*value)) {
                return Err(RampError::OutOfRange { key, value });
            }
        }
        for (before, pair) in keys.windows(2).enumerate() {
            if pair[1][0] <= pair[0][0] {
                let [before_x, x] = [pair[0][0], pair[1][0]];
                return Err(RampError::Unordered { key: before + 1, x, before: before_x });
            }
        }
        Ok(Self { keys, interpolation })
    }

    /// `value` everywhere; NaN and values beyond ±1e30 count as 0.
    pub fn constant(value: f32) -> Self {
        let y = if (-LARGEST..=LARGEST).contains(&value) { value } else { 0.0 };
        Self { keys: vec![[0.0, y]], interpolation: Interpolation::Constant }
    }

    /// The keys, `[x, y]`, by x.
    pub fn keys(&self) -> &[[f32; 2]] {
        &self.keys
    }

    /// The interpolation between keys.
    pub fn interpolation(&self) -> Interpolation {
        self.interpolation
    }

    /// The largest value, which is that of a key, as no interpolation overshoots.
    pub fn max(&self) -> f32 {
        self.keys.iter().map(|key| key[1]).fold(f32::NEG_INFINITY, f32::max)
    }

    /// The smallest value, likewise.
    pub fn min(&self) -> f32 {
        self.keys.iter().map(|key| key[1]).fold(f32::INFINITY, f32::min)
    }

    /// The value, if all keys have the same.
    pub fn is_constant(&self) -> Option<f32> {
        let first = self.keys[0][1];
        self.keys.iter().all(|key| key[1] == first).then_some(first)
    }

    /// The value at `x`; that of the first key for NaN.
    pub fn eval(&self, x: f32) -> f32 {
        let right = self.keys.partition_point(|key| key[0] <= x);
        let left = self.keys[right.saturating_sub(1)];
        // Left of the first key and right of the last, both ends of the interval are the same key.
        let next = if right == 0 { left } else { *self.keys.get(right).unwrap_or(&left) };
        between(left, next, x, self.interpolation)
    }

    /// [`Ramp::eval`] on every lane.
    #[inline(always)]
    pub fn eval_lanes(&self, at: &F32x16) -> F32x16 {
        if self.keys.len() > FEW_KEYS {
            return F32x16::from_fn(|lane| self.eval(at.0[lane]));
        }
        // Left of the first key, both ends of the interval are that key.
        let [x, y] = self.keys[0].map(F32x16::splat);
        let mut found = [x, y, x, y];
        for start in (0..self.keys.len()).step_by(AT_ONCE) {
            for candidate in self.intervals(start) {
                let begun = at.0.map(|x| if candidate[0] <= x { u32::MAX } else { 0 });
                for part in 0..4 {
                    let value = candidate[part].to_bits();
                    for lane in 0..LANES {
                        // By bits: of a choice of numbers the compiler may make a branch for each lane.
                        let before = found[part].0[lane].to_bits();
                        found[part].0[lane] = f32::from_bits((value & begun[lane]) | (before & !begun[lane]));
                    }
                }
            }
        }
        let [x0, y0, x1, y1] = &found;
        let mut share = F32x16::from_fn(|lane| way(x0.0[lane], x1.0[lane], at.0[lane]));
        // One loop for each kind: a branch inside a loop would prevent its vectorisation.
        match self.interpolation {
            Interpolation::Linear => {}
            Interpolation::Smooth => share = F32x16::from_fn(|lane| smooth(share.0[lane])),
            Interpolation::Constant => return *y0,
        }
        F32x16::from_fn(|lane| y0.0[lane] + (y1.0[lane] - y0.0[lane]) * share.0[lane])
    }

    /// The intervals that begin at key `start` and the following ones, as pairs of keys; that of the last key is constant,
    /// those beyond it are never selected.
    #[inline(always)]
    fn intervals(&self, start: usize) -> [[f32; 4]; AT_ONCE] {
        std::array::from_fn(|i| match (self.keys.get(start + i), self.keys.get(start + i + 1)) {
            (Some(&[x0, y0]), Some(&[x1, y1])) => [x0, y0, x1, y1],
            (Some(&[x, y]), None) => [x, y, x, y],
            (None, _) => [f32::NAN; 4],
        })
    }
}

/// The value at `x` of the interval from key `left` to key `right`, which may be the same key.
fn between(left: [f32; 2], right: [f32; 2], x: f32, interpolation: Interpolation) -> f32 {
    let share = way(left[0], right[0], x);
    let share = match interpolation {
        Interpolation::Linear => share,
        Interpolation::Smooth => smooth(share),
        Interpolation::Constant => return left[1],
    };
    left[1] + (right[1] - left[1]) * share
}

/// The share of the way from `left` to `right` at which `x` lies; 0 if they are one place.
#[inline(always)]
fn way(left: f32, right: f32, x: f32) -> f32 {
    let width = right - left;
    let share = (x - left) / width;
    if width > 0.0 { share } else { 0.0 }
}

/// 3t² − 2t³.
#[inline(always)]
fn smooth(t: f32) -> f32 {
    t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Key;

    const KINDS: [Interpolation; 3] = [Interpolation::Linear, Interpolation::Smooth, Interpolation::Constant];

    #[test]
    fn values_between_two_keys_are_those_worked_by_hand() {
        let at = |kind| Ramp::new(vec![[1.0, 10.0], [3.0, 20.0]], kind).unwrap();
        assert_eq!(at(Interpolation::Linear).eval(1.5), 12.5);
        // 3/16 − 2/64 = 0.15625 of the rise.
        assert_eq!(at(Interpolation::Smooth).eval(1.5), 11.5625);
        assert_eq!(at(Interpolation::Smooth).eval(2.0), 15.0);
        assert_eq!(at(Interpolation::Constant).eval(2.99), 10.0);
    }

    #[test]
    fn ramps_are_exact_at_keys_and_constant_beyond_them() {
        let keys = vec![[-0.3, 0.7], [0.1, -0.2], [0.35, 1.1], [0.9, 1.1]];
        for kind in KINDS {
            let ramp = Ramp::new(keys.clone(), kind).unwrap();
            assert!(keys.iter().all(|&[x, y]| ramp.eval(x) == y), "{kind:?}");
            for (x, y) in [(-9.0, 0.7), (f32::NEG_INFINITY, 0.7), (9.0, 1.1), (f32::INFINITY, 1.1)] {
                assert_eq!(ramp.eval(x), y, "{kind:?} at {x}");
            }
            assert_eq!(ramp.eval(f32::NAN), 0.7);
        }
    }

    #[test]
    fn lanes_give_the_bits_of_one_value_for_few_keys_and_many() {
        for count in [1, 2, 5, FEW_KEYS, FEW_KEYS + 1, 200] {
            let keys: Vec<_> = (0..count).map(|i| [i as f32 * 0.01, Key::new(1).of(i as u64).f32()]).collect();
            for kind in KINDS {
                let ramp = Ramp::new(keys.clone(), kind).unwrap();
                for round in 0..64u64 {
                    let mut x = F32x16::from_fn(|lane| Key::new(2).of(round).of(lane as u64).between([-0.2, 2.2]));
                    x.0[3] = keys[count / 2][0];
                    x.0[4] = f32::NAN;
                    let lanes = ramp.eval_lanes(&x);
                    for lane in 0..LANES {
                        assert_eq!(lanes.0[lane].to_bits(), ramp.eval(x.0[lane]).to_bits());
                    }
                }
            }
        }
    }

    #[test]
    fn faults_name_the_key_and_what_was_expected() {
        let fault = |keys: &[[f32; 2]]| Ramp::new(keys.to_vec(), Interpolation::Linear).unwrap_err().to_string();
        assert_eq!(fault(&[]), "a ramp has no key; expected at least one `[x, y]`");
        assert_eq!(fault(&[[0.0, 1.0], [0.5, f32::NAN]]), "ramp key 1 has NaN; expected a number within ±1e30");
        assert_eq!(
            fault(&[[0.0, 1.0], [1.0, 0.0], [1.0, 2.0]]),
            "ramp key 2 has x 1; expected more than 1 of the key before"
        );
        assert!(fault(&[[f32::INFINITY, 0.0]]).starts_with("ramp key 0 has inf"));
    }

    #[test]
    fn extremes_stay_finite() {
        let keys = vec![[-1e30, -1e30], [0.0, 1e30], [f32::MIN_POSITIVE / 8.0, -1e30]];
        for kind in KINDS {
            let ramp = Ramp::new(keys.clone(), kind).unwrap();
            for x in [-1e30, -1.0, 0.0, f32::MIN_POSITIVE / 16.0, 1e-38, f32::MAX] {
                assert!(ramp.eval(x).is_finite());
            }
        }
    }

    #[test]
    fn minimum_maximum_and_constancy_are_known() {
        let ramp = Ramp::new(vec![[0.0, 0.2], [0.5, 3.0], [1.0, 1.0]], Interpolation::Smooth).unwrap();
        assert_eq!((ramp.min(), ramp.max(), ramp.is_constant()), (0.2, 3.0, None));
        let flat = Ramp::new(vec![[0.0, 0.3], [1.0, 0.3]], Interpolation::Smooth).unwrap();
        assert_eq!((flat.is_constant(), flat.eval(0.37)), (Some(0.3), 0.3));
        assert_eq!(Ramp::constant(f32::NAN).is_constant(), Some(0.0));
    }
}
