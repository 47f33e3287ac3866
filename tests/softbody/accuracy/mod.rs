//! How accurately each law of soft bodies is met, with its limit: one table, printed, checked, and compared with
//! docs/softbody.md.
//!
//! Laws are closed forms, or computed in f64 by code that shares nothing with the solver. They are measured on the
//! node's output, stored in f32; momentum, energy and single springs, which the node does not output, on the solver's
//! state.

mod asked;
mod kept;
mod settled;
mod springs;
mod touch;

use bodies::mass_spring::{BodySolver, BodySpring, FrameReport, Material, Mesh, SoftBody, SolverFrame, State};
use numerics::masked::Masked;
use numerics::vector::DVec3;

use crate::accuracy_table::{Effort, Figure, storage};
use crate::measure::distance;
use crate::shapes;

type V = [f64; 3];

#[test]
fn soft_bodies_meet_their_laws_and_the_docs_show_the_table() {
    crate::accuracy_table::check(
        &figures(Effort::Coarse),
        "docs/softbody.md",
        include_str!("../../../docs/softbody.md"),
    );
}

/// The rows of the table, in the order of the docs.
pub(crate) fn figures(effort: Effort) -> Vec<Figure> {
    let figures =
        [springs::figures(), settled::figures(effort), kept::figures(effort), touch::figures(), asked::figures()];
    figures.into_iter().flatten().collect()
}

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
    integrator: bodies::mass_spring::Integrator::Default,
    substeps: 0,
    bounce: None,
    force_implicit_euler: false,
    cancelled: &|| false,
};

/// A block for the solver: cells, their side, E and β; as heavy as water.
fn block(cells: [u32; 3], side: f64, modulus: f64, damping: f64) -> SoftBody {
    let block = shapes::block(cells, side, [0.0; 3]);
    let points: Vec<V> = block.positions().iter().map(|p| p.map(f64::from)).collect();
    made(&points, block.tet_corners(), modulus, damping, &[])
}

fn made(points: &[V], tets: &[[u32; 4]], modulus: f64, damping: f64, joints: &[BodySpring]) -> SoftBody {
    let plain = |value| Masked::uniform(value);
    let material = Material { density: plain(1000.0), stiffness: plain(modulus), damping: plain(damping) };
    SoftBody::new(&Mesh { points, tets, ..Mesh::default() }, &material, joints).unwrap()
}

/// Steps through `frames` frames; a report for each.
fn steps(body: &SoftBody, state: &mut State, frame: &SolverFrame<'_>, frames: usize) -> Vec<FrameReport> {
    let mut solver = BodySolver::new(body);
    (0..frames).map(|_| solver.step(body, state, frame)).collect()
}

/// a + t·b.
fn plus_multiple(a: V, b: V, t: f64) -> V {
    (DVec3::from(a) + DVec3::from(b) * t).into()
}

fn mean(points: &[V]) -> V {
    points.iter().fold([0.0; 3], |sum, p| plus_multiple(sum, *p, 1.0 / points.len() as f64))
}

fn largest(values: impl IntoIterator<Item = f64>) -> f64 {
    // NaN counts as the largest.
    values.into_iter().fold(0.0, |most, x| if x > most || x.is_nan() { x } else { most })
}
