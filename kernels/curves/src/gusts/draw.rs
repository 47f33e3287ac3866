//! Which gusts are alive at a moment, and their random parameters: a pure function of a seed, a gust's index, its round
//! and the moment.
//!
//! A gust's start is drawn once; where it repeats every so many frames, all else is redrawn each round. Rounds extend
//! without end in both directions of time, and those alive are found by a division, so frame 1,000,000 costs as much as
//! frame 1. Limit: [`MOST_LIVING`] gusts at a moment; beyond it a gust's newest rounds are kept and the others counted.

use numerics::random::Key;

/// Ranges that gusts are drawn from; each from its lower to its upper end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Draw {
    /// Seed of all random numbers.
    pub seed: u64,
    /// Number of gusts.
    pub gusts: u32,
    /// Metres.
    pub radius: [f32; 2],
    /// Fraction of the radius by which noise may dent a gust, clamped to 0..1.
    pub noise: [f32; 2],
    /// First frame of a gust's first round.
    pub start: [f64; 2],
    /// Frames at full strength.
    pub life: [f64; 2],
    /// Frames of decay from full strength to 0.
    pub decay: [f64; 2],
    /// Frames from a round to the next; below [`SHORTEST_ROUND`] there is one round only.
    pub repeat: f64,
    /// Number of rounds after which the same random numbers come again; 0: never.
    pub period: u32,
}

impl Draw {
    /// The same gusts, all of whose rounds come again every `frames`: with `repeat` as many rounds as fit best, else one.
    #[must_use]
    pub fn looped(self, frames: f64) -> Self {
        let fit = if self.repeat < SHORTEST_ROUND { 1.0 } else { (frames / self.repeat).round().clamp(1.0, 1e9) };
        Self { repeat: frames / fit, period: fit as u32, ..self }
    }
}

/// The shortest time from a round to the next, in frames: the finest step that frames can take.
const SHORTEST_ROUND: f64 = 1.0 / 5040.0;

/// Largest number of gusts alive at a moment: bounds the memory for any settings.
pub const MOST_LIVING: u64 = 1 << 16;

/// A gust alive at a moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gust {
    /// Its first frame.
    pub start: f64,
    /// 1 through its life, then falling to 0.
    pub strength: f32,
    /// Metres.
    pub radius: f32,
    /// Fraction of the radius by which noise may dent it, 0..1.
    pub noise: f32,
    /// Position of its speed within the range, 0..1.
    pub speed: f64,
    /// Start on the launch plane: −1..1 along each side.
    pub position: [f64; 2],
    /// Seed of its noise.
    pub salt: u32,
    /// Where across the wind it blows besides: a fraction of a revolution, 0..1.
    pub side: f64,
}

/// All gusts alive at a moment, ordered by index, then by round.
#[must_use]
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Living {
    /// The gusts.
    pub gusts: Vec<Gust>,
    /// Rounds beyond [`MOST_LIVING`] that may be alive but were left out.
    pub dropped: u64,
}

/// Uses of random numbers.
#[derive(Clone, Copy)]
enum Draws {
    Start,
    Round,
    Radius,
    Noise,
    Speed,
    Life,
    Decay,
    Across,
    Up,
    Salt,
    Side,
}

impl Draw {
    /// The gusts alive at `frame`.
    pub fn at(&self, frame: f64) -> Living {
        let mut living = Living::default();
        let most = (MOST_LIVING / u64::from(self.gusts.max(1))).max(1) as i64;
        for index in 0..self.gusts {
            let key = Key::new(self.seed).of(u64::from(index));
            let start = between(key.of(Draws::Start as u64), self.start);
            let [first, last] = self.rounds(start, frame);
            let kept = first.max(last.saturating_sub(most - 1));
            living.dropped = living.dropped.saturating_add(kept.abs_diff(first));
            for round in kept..=last {
                let start = if round == 0 { start } else { start + round as f64 * self.repeat };
                let drawn = if self.period > 0 { round.rem_euclid(i64::from(self.period)) } else { round };
                let key = key.of(Draws::Round as u64).of(drawn as u64);
                living.gusts.extend(self.gust(key, start, frame));
            }
        }
        living
    }

    /// The first and the last round that may be alive at `frame`; none is if the first is after the last.
    fn rounds(&self, start: f64, frame: f64) -> [i64; 2] {
        if self.repeat < SHORTEST_ROUND {
            return [0, 0];
        }
        let longest = self.life[1] + self.decay[1];
        let since = |age: f64| (frame - start - age) / self.repeat;
        // One more on each side; each round then checks whether it is alive.
        [since(longest).floor() as i64, since(0.0).ceil() as i64]
    }

    /// One round; `None` if it is not alive.
    fn gust(&self, key: Key, start: f64, frame: f64) -> Option<Gust> {
        let of = |draw: Draws| key.of(draw as u64);
        let strength =
            strength(frame - start, between(of(Draws::Life), self.life), between(of(Draws::Decay), self.decay));
        if strength <= 0.0 {
            return None;
        }
        let side = |draw: Draws| 2.0 * of(draw).f64() - 1.0;
        Some(Gust {
            start,
            strength,
            radius: of(Draws::Radius).between(self.radius),
            noise: of(Draws::Noise).between(self.noise).clamp(0.0, 1.0),
            speed: of(Draws::Speed).f64(),
            position: [side(Draws::Across), side(Draws::Up)],
            salt: of(Draws::Salt).u32(),
            side: of(Draws::Side).f64(),
        })
    }
}

/// Uniform between both ends.
fn between(key: Key, [low, high]: [f64; 2]) -> f64 {
    (low + (high - low) * key.f64()).clamp(low.min(high), high.max(low))
}

/// 1 from age 0 to `life`, then falling linearly to 0 over `decay`.
fn strength(age: f64, life: f64, decay: f64) -> f32 {
    if age < 0.0 || age >= life + decay {
        return 0.0;
    }
    if age < life { 1.0 } else { (1.0 - (age - life) / decay) as f32 }
}
