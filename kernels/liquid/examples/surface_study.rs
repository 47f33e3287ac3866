//! How exact a surface stays that turns for long:
//! `cargo run --release -p liquid --features studies --example surface_study [name]`.

#![allow(clippy::disallowed_methods, reason = "it measures time")]

use std::time::Instant;

use liquid::extract::{Placement, extract};
use liquid::level_set::{LevelSet, PhiSampler};
use liquid::markers::Markers;
use liquid::rows::CellRows;
use numerics::vector::{Vec3, length, sub};

#[allow(dead_code, reason = "the study uses part of it")]
#[path = "../../../tests/liquid/accuracy/flows.rs"]
mod flows;

use flows::FaceMovement;

fn main() {
    let asked = std::env::args().nth(1);
    let all: [(&str, fn()); 2] = [("zalesak", zalesak), ("slotted", slotted_sphere)];
    for (name, study) in all {
        if asked.as_deref().is_none_or(|asked| asked == name) {
            study();
        }
    }
}

/// Shares of cells that are inside, of 4³ points each.
fn shares(set: &LevelSet) -> Vec<f32> {
    let (low, high) = set.domain();
    let cells = CellRows::cuboid(low, high);
    cells.tabulate(|cell| {
        let phi = set.rows().find(cell).map_or(5.0, |at| set.phi()[at]);
        if phi.abs() > 2.0 {
            return f32::from(phi < 0.0);
        }
        let mut sampler = PhiSampler::new(set.view());
        let point = |n: usize| {
            let part = [n % 4, n / 4 % 4, n / 16];
            [0, 1, 2].map(|axis| cell[axis] as f32 + (part[axis] as f32 + 0.5) * 0.25)
        };
        (0..64).map(|n| sampler.at(point(n))).map(|phi| (0.5 - 4.0 * phi).clamp(0.0, 1.0)).sum::<f32>() / 64.0
    })
}

fn difference(a: &[f32], b: &[f32]) -> f64 {
    let sum: f64 = a.iter().zip(b).map(|(a, b)| f64::from((a - b).abs())).sum();
    sum / a.iter().map(|a| f64::from(*a)).sum::<f64>()
}

/// Parts of a mesh that no quad connects.
fn pieces(quads: &[[u32; 4]], vertices: usize) -> usize {
    let mut parent: Vec<usize> = (0..vertices).collect();
    fn root(parent: &mut [usize], mut at: usize) -> usize {
        while parent[at] != at {
            parent[at] = parent[parent[at]];
            at = parent[at];
        }
        at
    }
    for quad in quads {
        for corner in &quad[1..] {
            let (a, b) = (root(&mut parent, quad[0] as usize), root(&mut parent, *corner as usize));
            parent[a.max(b)] = a.min(b);
        }
    }
    (0..vertices).filter(|at| parent[*at] == *at).count()
}

/// Moves a level set with markers and prints what became of it after each of `reports` parts.
fn track(name: &str, low: [i32; 3], high: [i32; 3], shape: impl Fn(Vec3) -> f32 + Sync, flow: Moves<'_>) {
    let rows = CellRows::cuboid(low, high);
    let phi = rows.tabulate(|cell| shape(cell.map(|n| n as f32 + 0.5)));
    let mut set = LevelSet::new(&rows, &phi, low, high);
    let mut markers = Markers::new(&set, 0, 1);
    let before = shares(&set);
    let volume = extract(set.view(), Placement::Projected).volume();
    let (mut ms, mut done) = (0.0, 0);
    for report in flow.reports {
        for _ in done..*report {
            let start = Instant::now();
            markers.step(&mut set, &|p: Vec3| flow.faces.at(p), flow.reach);
            ms += start.elapsed().as_secs_f64() * 1e3;
        }
        done = *report;
        let mesh = extract(set.view(), Placement::Projected);
        let after = shares(&set);
        let sum = |shares: &[f32]| shares.iter().map(|share| f64::from(*share)).sum::<f64>();
        println!(
            "{name:12} step {done:4}: dV mesh {:7.3} %, shares {:7.3} %, L1 {:6.2} %, {:3} pieces, {:6} markers, {:7} cells, {:6.1} ms a step",
            100.0 * (mesh.volume() / volume - 1.0),
            100.0 * (sum(&after) / sum(&before) - 1.0),
            100.0 * difference(&before, &after),
            pieces(&mesh.quads, mesh.points.len()),
            markers.markers.len(),
            set.band().len(),
            ms / f64::from(done),
        );
    }
}

/// A flow: the movement in a step, how far it moves anything, and after which steps to report.
struct Moves<'a> {
    faces: &'a FaceMovement,
    reach: f32,
    reports: &'a [u32],
}

/// The distance from a ball (in `dimensions`) around `centre` of radius 15, cut by a slot 5 wide and 25 deep, in a box of 100.
fn slotted(p: Vec3, centre: Vec3, dimensions: usize, unit: f32) -> f32 {
    let mut from = sub(p, centre).map(|x| x / unit);
    if dimensions == 2 {
        from[2] = 0.0;
    }
    let ball = length(from) - 15.0;
    let (beside, above) = (from[0].abs() - 2.5, from[1] - 10.0);
    let slot = if beside > 0.0 && above > 0.0 { length([beside, above, 0.0]) } else { beside.max(above) };
    ball.max(-slot) * unit
}

/// Turns about the middle of the x and y axes.
fn turning(size: usize, steps: u32) -> FaceMovement {
    let angle = 2.0 * std::f32::consts::PI / steps as f32;
    FaceMovement::new(size, angle, |[x, y, _]| [0.5 - y, x - 0.5, 0.0])
}

fn zalesak() {
    let steps = 628;
    let flow = Moves { faces: &turning(100, steps), reach: 0.75, reports: &[steps, 2 * steps, 10 * steps] };
    let shape = |p: Vec3| slotted(p, [50.0, 75.0, 0.0], 2, 1.0);
    track("Zalesak 100²", [0; 3], [100, 100, 2], shape, flow);
}

fn slotted_sphere() {
    let steps = 402;
    let flow = Moves { faces: &turning(64, steps), reach: 0.75, reports: &[steps, 2 * steps] };
    let shape = |p: Vec3| slotted(p, [32.0, 48.0, 32.0], 3, 0.64);
    track("slotted 64³", [0; 3], [64; 3], shape, flow);
}
