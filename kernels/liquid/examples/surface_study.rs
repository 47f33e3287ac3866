//! What the surface of a liquid costs and how exact it is:
//! `cargo run --release -p liquid --features studies --example surface_study [name]`.

#![allow(clippy::disallowed_methods, reason = "it measures time")]

use std::f64::consts::PI;
use std::time::Instant;

use liquid::extract::{Placement, extract};
use liquid::level_set::{LevelSet, PhiSampler, PhiView};
use liquid::markers::Markers;
use liquid::rows::CellRows;
use numerics::trig;
use numerics::vector::{Vec3, length, scale, sub};
use rayon::ThreadPoolBuilder;
use rayon::prelude::*;

fn main() {
    let asked = std::env::args().nth(1);
    let all: [(&str, fn()); 4] =
        [("extract", extraction), ("zalesak", zalesak), ("slotted", slotted_sphere), ("leveque", leveque)];
    for (name, study) in all {
        if asked.as_deref().is_none_or(|asked| asked == name) {
            study();
        }
    }
}

/// The shortest time of five runs, in ms.
fn shortest(mut run: impl FnMut()) -> f64 {
    let time = |_| {
        let start = Instant::now();
        run();
        start.elapsed().as_secs_f64() * 1e3
    };
    (0..5).map(time).fold(f64::INFINITY, f64::min)
}

type Shape<'a> = &'a dyn Fn(Vec3) -> f32;

/// A sphere and a torus as meshes: volume, and vertices a ms on one thread and on two.
fn extraction() {
    println!("shape      placement   vertices  volume     1 thread: ms, vertices/ms  2 threads: ms");
    for size in [64, 128] {
        let n = size as f32;
        let centre = [0.505 * n, 0.494 * n, 0.502 * n];
        let sphere = |p: Vec3| length(sub(p, centre)) - 0.35 * n;
        let torus = |p: Vec3| {
            let [x, y, z] = sub(p, centre);
            length([length([x, 0.0, z]) - 0.25 * n, y, 0.0]) - 0.1 * n
        };
        let side = f64::from(n);
        let volumes =
            [4.0 / 3.0 * PI * 0.35 * 0.35 * 0.35, 2.0 * PI * PI * 0.25 * 0.01].map(|share| share * side * side * side);
        let shapes: [(&str, Shape<'_>, f64); 2] = [("sphere", &sphere, volumes[0]), ("torus", &torus, volumes[1])];
        for (name, shape, exact) in shapes {
            for placement in [Placement::Mean, Placement::Projected] {
                let rows = CellRows::cuboid([0; 3], [size; 3]);
                let phi: Vec<f32> =
                    rows.iter().map(|cell| shape(cell.map(|n| n as f32 + 0.5)).clamp(-5.0, 5.0)).collect();
                let view = PhiView { rows: &rows, phi: &phi, outside: 5.0, low: [0; 3], high: [size; 3] };
                let mesh = extract(view, placement);
                let [one, two] = [1, 2].map(|threads| {
                    let pool = ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
                    pool.install(|| shortest(|| drop(extract(view, placement))))
                });
                let (vertices, error) = (mesh.points.len(), 100.0 * (mesh.volume() / exact - 1.0));
                let rate = vertices as f64 / one;
                let placement = format!("{placement:?}");
                println!(
                    "{name:6} {size:3} {placement:10} {vertices:9} {error:8.3} % {one:14.2} {rate:12.0} {two:14.2}"
                );
            }
        }
    }
}

/// Velocity on the faces of a cube of cells, read trilinearly.
struct Faces {
    size: usize,
    along: [Vec<f32>; 3],
}

impl Faces {
    /// From a velocity in a unit cube, times `dt`, in cells.
    fn new(size: usize, dt: f32, velocity: impl Fn(Vec3) -> Vec3 + Sync) -> Self {
        let n = size + 1;
        let h = 1.0 / size as f32;
        let along = [0, 1, 2].map(|axis| {
            let face = |at: usize| {
                let mut point = [at % n, at / n % n, at / n / n].map(|x| (x as f32 + 0.5) * h);
                point[axis] -= 0.5 * h;
                velocity(point)[axis] * dt / h
            };
            (0..n * n * n).into_par_iter().map(face).collect()
        });
        Self { size, along }
    }

    fn at(&self, point: Vec3) -> Vec3 {
        let n = self.size + 1;
        std::array::from_fn(|axis| {
            let (mut index, mut share) = (0, [0.0; 3]);
            for (along, stride) in [1, n, n * n].into_iter().enumerate() {
                let x = (point[along] - if along == axis { 0.0 } else { 0.5 }).clamp(0.0, self.size as f32 - 0.001);
                index += (x as usize) * stride;
                share[along] = x - (x as usize) as f32;
            }
            let [u, v, w] = share;
            let value = |more: usize| self.along[axis][index + more];
            let mix = |a: f32, b: f32, t: f32| a + t * (b - a);
            let row = |more: usize| mix(value(more), value(more + 1), u);
            mix(mix(row(0), row(n), v), mix(row(n * n), row(n * n + n), v), w)
        })
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
        for step in done..*report {
            let pulse = (flow.pulse)(step);
            let start = Instant::now();
            markers.step(&mut set, &|p: Vec3| scale(flow.faces.at(p), pulse), flow.reach);
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

/// A flow: the way in a step, its share in step n, how far it moves anything, and after which steps to report.
struct Moves<'a> {
    faces: &'a Faces,
    pulse: &'a dyn Fn(u32) -> f32,
    reach: f32,
    reports: &'a [u32],
}

fn leveque() {
    for size in [64, 100, 128] {
        let n = size as f32;
        let steps = 6 * size;
        let faces = Faces::new(size as usize, 3.0 / steps as f32, |p| {
            let [a, b, c] = p.map(|x| trig::sin(PI as f32 * x));
            let [d, e, f] = p.map(|x| trig::sin(2.0 * PI as f32 * x));
            [2.0 * a * a * e * f, -d * b * b * f, -d * e * c * c]
        });
        let pulse = |step: u32| trig::cos(PI as f32 * (step as f32 + 0.5) / steps as f32);
        let shape = |p: Vec3| length(sub(p, [0.35 * n; 3])) - 0.15 * n;
        let flow = Moves { faces: &faces, pulse: &pulse, reach: 1.0, reports: &[steps / 2, steps] };
        track(&format!("LeVeque {size}"), [0; 3], [size as i32; 3], shape, flow);
    }
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
fn turning(size: usize, steps: u32) -> Faces {
    let angle = 2.0 * std::f32::consts::PI / steps as f32;
    Faces::new(size, angle, |[x, y, _]| [0.5 - y, x - 0.5, 0.0])
}

fn zalesak() {
    let steps = 628;
    let flow =
        Moves { faces: &turning(100, steps), pulse: &|_| 1.0, reach: 0.75, reports: &[steps, 2 * steps, 10 * steps] };
    let shape = |p: Vec3| slotted(p, [50.0, 75.0, 0.0], 2, 1.0);
    track("Zalesak 100²", [0; 3], [100, 100, 2], shape, flow);
}

fn slotted_sphere() {
    let steps = 402;
    let flow = Moves { faces: &turning(64, steps), pulse: &|_| 1.0, reach: 0.75, reports: &[steps, 2 * steps] };
    let shape = |p: Vec3| slotted(p, [32.0, 48.0, 32.0], 3, 0.64);
    track("slotted 64³", [0; 3], [64; 3], shape, flow);
}
