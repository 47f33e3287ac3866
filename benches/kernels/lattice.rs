//! Times of lattice deformation of a million points, and of goals on balls of tets: the minimum of several runs.
//!
//! `cargo bench --bench lattice`; threads by `RAYON_NUM_THREADS`.

#![allow(clippy::disallowed_methods, reason = "measures time and is no node")]

use bodies::goals::{GoalLimits, HeldBody, HeldBy, goal_shape};
use bodies::tets::{ClosedSurface, FillSettings, PolygonSurface};
use curves::lattice::{DeformationLattice, Extrapolation, LatticeBasis, control_points};
use numerics::random::Key;
use numerics::shapes;
use std::time::Instant;

const ROUNDS: usize = 7;

/// Milliseconds of the fastest of several runs.
fn fastest(mut run: impl FnMut()) -> f64 {
    let time = |_| {
        let start = Instant::now();
        run();
        start.elapsed().as_secs_f64() * 1e3
    };
    (0..ROUNDS).map(time).fold(f64::INFINITY, f64::min)
}

fn random(count: usize, range: [f32; 2]) -> Vec<[f32; 3]> {
    (0..count).map(|row| [0, 1, 2].map(|k| Key::new(1).of(row as u64).of(k).between(range))).collect()
}

fn main() {
    let points = random(1_000_000, [0.0, 1.0]);
    for (basis, cells) in [
        (LatticeBasis::Trilinear, 4),
        (LatticeBasis::Bernstein, 1),
        (LatticeBasis::Bernstein, 2),
        (LatticeBasis::Bernstein, 4),
        (LatticeBasis::Bernstein, 8),
    ] {
        let divisions = [cells; 3];
        let offsets = random(control_points(divisions).unwrap_or(0), [-0.1, 0.1]);
        let Some(lattice) =
            DeformationLattice::new([[0.0; 3], [1.0; 3]], divisions, &offsets, basis, Extrapolation::Hold)
        else {
            continue;
        };
        let [plain, jacobians] = [false, true].map(|wanted| fastest(|| drop(lattice.deform(&points, wanted))));
        println!("a million points, {basis:?}, {cells} divisions: {plain:.1} ms, {jacobians:.1} ms with Jacobians");
    }
    for (n, spacing) in [(8, 0.0), (8, 0.05), (16, 0.025)] {
        let ball = shapes::sphere([1.0; 3], n);
        let mut starts = vec![0];
        ball.counts.iter().for_each(|count| starts.push(starts[starts.len() - 1] + count));
        let surface: Vec<[f32; 3]> = ball.points.iter().map(|p| p.map(|x| x as f32)).collect();
        let closed =
            ClosedSurface::of(&PolygonSurface { starts: &starts, corners: &ball.corners, points: &surface }, false);
        let solid = closed.and_then(|closed| closed.fill(&FillSettings { spacing, interior: true }));
        let Ok(solid) = solid else { continue };
        let rows: Vec<i32> = (0..solid.points.len()).map(|k| if k < surface.len() { k as i32 } else { -1 }).collect();
        let shape: Vec<[f32; 3]> = surface.iter().map(|[x, y, z]| [x + y * y, 0.5 * y, z - 0.5 * x * y]).collect();
        let held =
            HeldBody { points: &solid.points, tets: &solid.tets, by: HeldBy::Points { rows: &rows, shape: &shape } };
        let mut steps = 0;
        let time = fastest(|| steps = goal_shape(&held, GoalLimits::default()).steps);
        println!(
            "goal of {} points, {} of them inside, {} tets: {time:.1} ms, {steps} steps",
            solid.points.len(),
            solid.points.len() - surface.len(),
            solid.tets.len()
        );
    }
}
