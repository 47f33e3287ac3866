//! One step of a damped spring, exact for a target that moves linearly from its previous to its current position.
//!
//! The equation x'' = −2ζω(x' − d·τ') − ω²(x − τ) has, with ξ = x − τ, velocities per step p = v·dt and a target that
//! moves by D, the solution ξ₁ = aξ₀ + bp₀ + kD, p₁ = cξ₀ + ep₀ + lD. All six coefficients depend on ω·dt and ζ only.
//! The formulas used avoid cancellation: near ζ = 1 and for ω·dt from 1e-12 to 1e12 they keep ten digits. f64,
//! dimensionless.

/// What the damper resists.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Drag {
    /// Motion relative to the target: d = 1.
    Target,
    /// All motion, as in still air: d = 0.
    World,
}

/// The six coefficients of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Response {
    pub(super) a: f64,
    pub(super) b: f64,
    pub(super) c: f64,
    pub(super) e: f64,
    pub(super) k: f64,
    pub(super) l: f64,
}

impl Response {
    /// A spring so stiff that it follows exactly.
    pub(super) const RIGID: Self = Self { a: 0.0, b: 0.0, c: 0.0, e: 0.0, k: 0.0, l: 1.0 };

    /// Coefficients of a step with `phase` = ω·dt ≥ 0 at damping ratio `zeta` > 0.
    pub(super) fn new(phase: f64, zeta: f64, drag: Drag) -> Self {
        if !phase.is_finite() || !zeta.is_finite() {
            return Self::RIGID;
        }
        // s = e^(−ζθ)·sin(σθ)/σ, or sinh, and a = e^(−ζθ)(cos σθ + ζ sin(σθ)/σ); `left` is 1 − a.
        let (a, e, s, b, left);
        if zeta < 1.0 {
            let sigma = ((1.0 - zeta) * (1.0 + zeta)).sqrt();
            let (decay, turn) = (libm::exp(-zeta * phase), sigma * phase);
            let (sine, cosine) = libm::sincos(turn);
            b = if turn > 0.0 { decay * (sine / turn) } else { decay };
            s = b * phase;
            a = decay * cosine + zeta * s;
            e = decay * cosine - zeta * s;
            let half = libm::sin(0.5 * turn);
            left = (-libm::expm1(-zeta * phase) + 2.0 * decay * half * half) - zeta * s;
        } else {
            let sigma = ((zeta - 1.0) * (zeta + 1.0)).sqrt();
            // The two roots, whose product is 1.
            let fast = zeta + sigma;
            let slow = 1.0 / fast;
            let (decay, apart) = (libm::exp(-slow * phase), 2.0 * sigma * phase);
            b = if apart > 0.0 { decay * (-libm::expm1(-apart) / apart) } else { decay };
            s = b * phase;
            a = decay + slow * s;
            e = libm::exp(-fast * phase) - slow * s;
            left = -libm::expm1(-slow * phase) - slow * s;
        }
        let c = -phase * s;
        match drag {
            Drag::Target => Self { a, b, c, e, k: -b, l: 1.0 - e },
            Drag::World => {
                let lag = if phase > 0.0 { 2.0 * zeta / phase * left } else { 0.0 };
                Self { a, b, c, e, k: -(b + lag), l: left }
            }
        }
    }
}

/// Number of steps with `phase` = ω·dt after which less than `tolerance` of the initial displacement and velocity
/// remains, for every damping ratio between the two `zetas`; the largest integer if that never happens.
///
/// A bound, not an estimate: starting with |x| ≤ 1 and |v| ≤ ω, |x| stays below `tolerance` after that number. It
/// follows from the slowest root, ω(ζ − √(ζ² − 1)) or ζω, and a term for nearly equal roots near ζ = 1.
pub fn steps_to_forget(phase: f64, zetas: [f64; 2], tolerance: f64) -> u32 {
    // The slowest root decays fastest at ζ = 1 and more slowly on both sides, so the ends of the range are the worst.
    let phases = zetas.map(|zeta| phase_to_forget(zeta, tolerance));
    let steps = (phases[0].max(phases[1]) / phase).ceil();
    // The cast saturates; NaN (0 ÷ 0) occurs only if there is nothing to decay.
    steps as u32
}

/// ω·t after which (1 + (1 + ζ)·m)·e^(−rωt) ≤ `tolerance`, where r is the slowest root and m bounds the factor by which
/// the two roots together exceed it: ωt, but no more than their distance allows.
fn phase_to_forget(zeta: f64, tolerance: f64) -> f64 {
    let (root, most) = match zeta < 1.0 {
        true => (zeta, 1.0 / ((1.0 - zeta) * (1.0 + zeta)).sqrt()),
        false => {
            let sigma = ((zeta - 1.0) * (zeta + 1.0)).sqrt();
            (1.0 / (zeta + sigma), 0.5 / sigma)
        }
    };
    let mut phase = 0.0;
    // Each iteration approaches the solution from below.
    for _ in 0..100 {
        let grown = 1.0 + (1.0 + zeta) * most.min(phase);
        let next = (libm::log(grown / tolerance) / root).max(0.0);
        if next <= phase {
            break;
        }
        phase = next;
    }
    phase
}
