//! How well each law of soft bodies is met, beside how well it has to be: one table, printed, checked, and the one that
//! docs/softbody.md shows.
//!
//! Laws are closed forms, or worked in f64 by code that shares nothing with the solver. Where the node can show one, it is
//! measured on what the node gives, which is stored in f32; momentum, energy and single springs are the solver's.

mod asked;
mod kept;
mod settled;
mod springs;
mod touch;

use bodies::mass_spring::{BodySolver, BodySpring, FrameReport, Material, Mesh, SoftBody, SolverFrame, State};
use numerics::masked::Masked;
use numerics::vector::DVec3;

use super::laws::{Figure, hold, storage};
use super::{distance, shapes};

type V = [f64; 3];

#[test]
fn every_law_of_soft_bodies_is_met_or_said_to_be_missed_and_is_in_the_docs() {
    let figures =
        [springs::figures(), settled::figures(), kept::figures(), touch::figures(), asked::figures()].into_iter();
    let figures: Vec<Figure> = figures.flatten().collect();
    hold(&figures, "docs/softbody.md", include_str!("../../../docs/softbody.md"));
}

/// No gravity, no volume: springs alone.
const BARE: SolverFrame<'static> = SolverFrame {
    seconds: 1.0 / 24.0,
    gravity: [0.0; 3],
    drag: 0.0,
    volume: 0.0,
    goals: &[],
    pins: &[],
    contacts: None,
    integrator: bodies::mass_spring::Integrator::Default,
    substeps: 0,
    force_implicit_euler: false,
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

/// Steps through so many frames; gives what each reports.
fn steps(body: &SoftBody, state: &mut State, frame: &SolverFrame<'_>, frames: usize) -> Vec<FrameReport> {
    let mut solver = BodySolver::new(body);
    (0..frames).map(|_| solver.step(body, state, frame)).collect()
}

fn add(a: V, b: V, share: f64) -> V {
    std::array::from_fn(|k| a[k] + share * b[k])
}

fn mean(points: &[V]) -> V {
    points.iter().fold([0.0; 3], |sum, p| add(sum, *p, 1.0 / points.len() as f64))
}

fn largest(values: impl IntoIterator<Item = f64>) -> f64 {
    // What is no number is the largest of all.
    values.into_iter().fold(0.0, |most, x| if x > most || x.is_nan() { x } else { most })
}
