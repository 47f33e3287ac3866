//! Changes of rest lengths: plastic flow, goals that become the rest shape, and tearing.
//!
//! The rest length of a spring is the length in the rest shape times a plastic factor, its dent. They are kept apart
//! so that a body can take on a goal as its rest shape and keep its dents. Each function returns the energy it
//! dissipated or added.

use super::body::{SoftBody, volume};
use super::springs::{self, RestLengths};
use super::state::State;

/// Bounds on the plastic factor of a spring.
const DENT_RANGE: [f64; 2] = [0.1, 10.0];

/// Parameters of plastic flow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plasticity {
    /// Strain above which a spring flows; 0: never.
    pub yield_strain: f64,
    /// Rate at which the strain above that decays, 1/s.
    pub creep: f64,
}

/// Applies plastic flow for `seconds`; returns the elastic energy it dissipates, joules.
///
/// `drawn` is the shape that goals pull towards, by the caller's indices, NaN for particles without goal. Lengths
/// between the rest length and the drawn one are transitional and cause no flow; strain is measured from the nearer
/// of the two.
pub fn flow(
    body: &SoftBody,
    state: &mut State,
    plasticity: Plasticity,
    seconds: f64,
    drawn: Option<&[[f64; 3]]>,
) -> f64 {
    let flows = plasticity.yield_strain > 0.0 && plasticity.creep > 0.0 && seconds > 0.0;
    if !flows {
        return 0.0;
    }
    let share = -libm::expm1(-plasticity.creep * seconds);
    let before = elastic(body, state);
    let x = body.to_solver_order(&state.positions);
    let drawn = drawn.map(|drawn| body.to_solver_order(drawn));
    for spring in 0..body.ends.len() {
        let (length, dent) = (state.lengths[spring], state.dents[spring]);
        let meant = match &drawn {
            Some(drawn) if spring < body.mesh_spring_count => springs::spring_length(body, drawn, spring),
            _ => f64::NAN,
        };
        // The minimum or maximum of a number and NaN is the number.
        let (least, most) = (length.min(meant) * dent, length.max(meant) * dent);
        if least > 0.0 && !state.torn[spring] {
            let now = springs::spring_length(body, &x, spring);
            let strain = now / now.clamp(least, most) - 1.0;
            let above = (strain.abs() - plasticity.yield_strain).max(0.0).copysign(strain);
            let dent = dent * (1.0 + share * above).max(0.0);
            if dent.is_finite() {
                state.dents[spring] = dent.clamp(DENT_RANGE[0], DENT_RANGE[1]);
            }
        }
    }
    before - elastic(body, state)
}

/// Blends the rest shape towards `shape` (by the caller's indices) by the fraction `share`; `keep` is the fraction of
/// the dents, in the logarithm, that remains. Explicit springs keep their rest lengths, and so do springs at
/// particles whose target is not finite. Returns the energy added, joules, negative if it decreases.
pub fn reset(body: &SoftBody, state: &mut State, shape: &[[f64; 3]], share: f64, keep: f64) -> f64 {
    let before = elastic(body, state);
    let (share, keep) = (share.clamp(0.0, 1.0), keep.clamp(0.0, 1.0));
    let goal = body.to_solver_order(shape);
    let blend = |from: f64, to: f64| if share >= 1.0 { to } else { from + (to - from) * share };
    for spring in 0..body.mesh_spring_count {
        let length = springs::spring_length(body, &goal, spring);
        if !length.is_finite() {
            continue;
        }
        state.lengths[spring] = blend(state.lengths[spring], length);
        if keep < 1.0 {
            state.dents[spring] = libm::pow(state.dents[spring], 1.0 - share * (1.0 - keep));
        }
    }
    for (tet, corners) in body.tets.iter().enumerate() {
        let volume = volume(corners.map(|corner| goal[corner as usize]));
        // A tetrahedron that is inverted in the goal keeps its rest volume.
        if volume.is_finite() && volume > 0.0 {
            state.volumes[tet] = blend(state.volumes[tet], volume);
        }
    }
    elastic(body, state) - before
}

/// Tears explicit springs that are longer than `stretch` times their rest length and longer than `reach` metres;
/// returns how many.
pub fn tear(body: &SoftBody, state: &mut State, stretch: f64, reach: f64) -> u32 {
    let x = body.to_solver_order(&state.positions);
    let mut torn = 0;
    for spring in body.mesh_spring_count..body.ends.len() {
        let most = (stretch * state.lengths[spring] * state.dents[spring]).max(reach);
        if !state.torn[spring] && springs::spring_length(body, &x, spring) > most {
            state.torn[spring] = true;
            torn += 1;
        }
    }
    torn
}

/// Elastic energy of the springs, joules.
fn elastic(body: &SoftBody, state: &State) -> f64 {
    let lengths = state.rest_lengths();
    let rest = RestLengths { lengths: &lengths, torn: &state.torn };
    let x = body.to_solver_order(&state.positions);
    body.spring_partition.sum((), |part, ()| {
        let intact = body.spring_partition.range(part).filter(|at| rest.is_intact(*at as u32));
        intact.map(|at| springs::stored(body, &rest, at, springs::spring_length(body, &x, at))).sum()
    })
}
