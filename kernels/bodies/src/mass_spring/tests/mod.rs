//! The solver against closed forms, then at extremes.

use super::*;
use crate::tets::cubes;
use numerics::masked::Masked;
use numerics::random::Key;
use numerics::vector::DVec3;

mod bounce;
mod contact;
mod exact;
mod goals;
mod hostile;
mod kept;
mod riding;

/// No gravity, no volume preservation: only springs.
const BARE: SolverFrame<'static> = SolverFrame {
    seconds: 1.0 / 24.0,
    gravity: [0.0; 3],
    drag: 0.0,
    during: None,
    volume: 0.0,
    goals: &[],
    pins: &[],
    contacts: None,
    integrator: Integrator::Default,
    substeps: 0,
    bounce: None,
    force_implicit_euler: false,
    cancelled: &|| false,
};

fn plain(value: f64) -> Masked<'static, f64> {
    Masked::uniform(value)
}

fn material(density: f64, stiffness: f64, damping: f64) -> Material<'static> {
    Material { density: plain(density), stiffness: plain(stiffness), damping: plain(damping) }
}

/// A block of cubes of `side`, each cut into six tetrahedra.
fn block(cells: [u32; 3], side: f64) -> (Vec<[f64; 3]>, Vec<[u32; 4]>) {
    cubes(cells.map(|n| n as usize), [0.0; 3], cells.map(|n| f64::from(n) * side))
}

impl SoftBody {
    /// Rest position of a particle, by the caller's index.
    fn rest_point(&self, particle: usize) -> [f64; 3] {
        self.rest[self.order.index_of[particle] as usize].into()
    }
}

fn block_body(cells: [u32; 3], side: f64, material: &Material<'_>) -> SoftBody {
    let (points, tets) = block(cells, side);
    SoftBody::new(&Mesh { points: &points, tets: &tets, ..Mesh::default() }, material, &[]).unwrap()
}

/// Steps a number of frames and returns the last report.
fn steps(body: &SoftBody, state: &mut State, frame: &SolverFrame<'_>, frames: usize) -> FrameReport {
    let mut solver = BodySolver::new(body);
    let mut report = FrameReport::default();
    for _ in 0..frames {
        report = solver.step(body, state, frame);
    }
    report
}

fn is_finite(state: &State) -> bool {
    state.positions.iter().chain(&state.velocities).flatten().all(|x| x.is_finite())
}

fn momentum(body: &SoftBody, state: &State) -> DVec3 {
    let each = state.velocities.iter().zip(body.masses());
    each.fold(DVec3::zeros(), |sum, (v, mass)| sum + DVec3::from(*v) * mass)
}

/// Angular momentum about the origin.
fn angular_momentum(body: &SoftBody, state: &State) -> DVec3 {
    let motion = state.positions.iter().zip(&state.velocities).zip(body.masses());
    motion.map(|((x, v), mass)| DVec3::from(*x).cross(&DVec3::from(*v)) * mass).sum()
}

fn random(seed: u64, index: usize) -> DVec3 {
    let key = Key::new(seed).of(index as u64);
    DVec3::new(key.of(0).f64() - 0.5, key.of(1).f64() - 0.5, key.of(2).f64() - 0.5)
}
