//! How exact a surface stays that turns for long, and what becomes of balls, sheets and threads as thin as cells:
//! `cargo run --release -p liquid --features studies --example surface_study [name]`.

#![allow(clippy::disallowed_methods, reason = "it measures time")]

use std::f32::consts::PI;
use std::time::Instant;

use liquid::extract::{Placement, extract};
use liquid::level_set::{LevelSet, PhiSampler};
use liquid::markers::Markers;
use liquid::rows::CellRows;
use numerics::vector::{Vec3, dot, length, scale, sub};

#[allow(dead_code, reason = "the study uses part of it")]
#[path = "../../../tests/liquid/accuracy/flows.rs"]
mod flows;

use flows::FaceMovement;

fn main() {
    let asked = std::env::args().nth(1);
    let all: [(&str, fn()); 4] =
        [("zalesak", zalesak), ("slotted", slotted_sphere), ("thin", thin), ("stretched", stretched)];
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

/// Balls, round sheets and threads that move as a whole, across the grid: what their meshes enclose ÷ their volume.
fn thin() {
    let (centre, way) = ([30.2, 25.1, 40.4], [0.31, 0.53, 0.17]);
    let normal = [0.5, 0.7, 0.33].map(|x: f32| x / length([0.5, 0.7, 0.33]));
    let steps = [0, 1, 4, 16, 64];
    println!("volume ÷ true volume after {steps:?} steps of {:.2} cells", length(way));
    // Along and beside the axis.
    let from_axis = move |p: Vec3| {
        let from = sub(p, centre);
        let along = dot(from, normal);
        [along.abs(), length(sub(from, scale(normal, along)))]
    };
    let cylinder = move |p: Vec3, half: f32, radius: f32| {
        let [along, beside] = from_axis(p);
        let (a, b) = (along - half, beside - radius);
        if a > 0.0 && b > 0.0 { length([a, b, 0.0]) } else { a.max(b) }
    };
    let volume = |half: f32, radius: f32| f64::from(2.0 * half * PI * radius * radius);
    for radius in [1.0_f32, 1.3, 1.6, 2.0, 3.0] {
        let true_volume = f64::from(4.0 / 3.0 * PI * radius * radius * radius);
        follow(&format!("ball of radius {radius}"), |p| length(sub(p, centre)) - radius, |_| way, &steps, true_volume);
    }
    for thickness in [0.6_f32, 0.8, 1.0, 1.2, 1.5, 2.0] {
        let sheet = |p: Vec3| cylinder(p, 0.5 * thickness, 12.0);
        follow(&format!("sheet of {thickness}"), sheet, |_| way, &steps, volume(0.5 * thickness, 12.0));
    }
    for radius in [0.5_f32, 0.7, 1.0, 1.3, 2.0] {
        let thread = |p: Vec3| cylinder(p, 12.0, radius);
        follow(&format!("thread of radius {radius}"), thread, |_| way, &steps, volume(12.0, radius));
    }
}

/// A round sheet across the grid that the flow stretches to twice its radius, and so to a quarter of its thickness.
fn stretched() {
    let (centre, rate) = ([48.2, 47.1, 48.4], 0.02_f32);
    let normal = [0.5, 0.7, 0.33].map(|x: f32| x / length([0.5, 0.7, 0.33]));
    // Steps to a thickness ÷ that of the start of .8, .6, .5, .4, .3, .25.
    let steps: Vec<u32> =
        [1.0, 0.8, 0.6, 0.5, 0.4, 0.3, 0.25].iter().map(|share: &f32| (-share.ln() / rate) as u32).collect();
    let flow = move |p: Vec3| {
        let from = sub(p, centre);
        sub(scale(from, 0.5 * rate), scale(normal, 1.5 * rate * dot(from, normal)))
    };
    println!("sheets stretched to 1, .8, .6, .5, .4, .3, .25 of their thickness");
    for thickness in [2.0_f32, 3.0, 4.0] {
        let sheet = move |p: Vec3| {
            let from = sub(p, centre);
            let along = dot(from, normal);
            let (a, b) = (along.abs() - 0.5 * thickness, length(sub(from, scale(normal, along))) - 12.0);
            if a > 0.0 && b > 0.0 { length([a, b, 0.0]) } else { a.max(b) }
        };
        let volume = f64::from(thickness * PI * 144.0);
        follow(&format!("sheet of {thickness}"), sheet, flow, &steps, volume);
    }
}

/// Prints the volume of a shape that `flow` moves.
fn follow(
    name: &str,
    shape: impl Fn(Vec3) -> f32 + Sync,
    flow: impl Fn(Vec3) -> Vec3 + Sync,
    steps: &[u32],
    true_volume: f64,
) {
    let (low, high) = ([0; 3], [96; 3]);
    let rows = CellRows::cuboid(low, high);
    let phi = rows.tabulate(|cell| shape(cell.map(|n| n as f32 + 0.5)));
    let mut set = LevelSet::new(&rows, &phi, low, high);
    let mut markers = Markers::new(&set, 0, 1);
    let mut line = format!("{name:22}");
    for step in 0..=steps[steps.len() - 1] {
        if step > 0 {
            markers.step(&mut set, &flow, 2.0);
        }
        if steps.contains(&step) {
            let volume = extract(set.view(), Placement::Projected).volume();
            line += &format!(" {:5.2}", volume / true_volume);
        }
    }
    println!("{line}");
}
