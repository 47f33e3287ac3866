//! What soft bodies cost and how deep they are pressed in under hard contact: dough of 5 kPa that rests, is rolled over,
//! pressed and hit.
//!
//! `cargo run --release -p bodies --example contact_study [case]… [tiny|small|large]… [self] [steps=N] [frames=N] [pascal=N] [quiet]`;
//! threads by `RAYON_NUM_THREADS`. Cases: rest (on the ground), plate (on a mesh), roll (a pin that rolls on by ten
//! thicknesses a frame, 1 cm into the dough), press (a plate down to 60 % of the height and up again), fist (a sphere a
//! third of the way in, ten thicknesses a frame), knead (a pin at twice the pace, half the way in), slap (a plate that
//! comes to half the height within a frame). A line a frame, then a line a case.

#![allow(clippy::disallowed_methods, reason = "measures time and is no node")]

use bodies::soft::{Body, Frame, Material, Mesh, Scaled, Solver, State};
use bodies::touch::{Ground, Obstacle, Pose, Rub, Scene, Skin};
use cpu_time::ProcessTime;
use nalgebra::Vector3;
use std::time::Instant;

const FRAME: f64 = 1.0 / 24.0;
const THICKNESS: f64 = 1e-3;
/// Of the dough.
const SIZE: [f64; 3] = [0.24, 0.06, 0.12];

type V3 = Vector3<f64>;
type Points = Vec<[f64; 3]>;
type Triangles = Vec<[u32; 3]>;
/// Where a tool is at a frame: a turn about z, then a shift.
type Place = fn(f64) -> (f64, [f64; 3]);

/// Cells of six tetrahedra, the lowest corner at `at`, and their surface.
fn dough(cells: [u32; 3], at: [f64; 3]) -> (Points, Vec<[u32; 4]>, Triangles) {
    let counts = cells.map(|n| n + 1);
    let (mut points, mut tets) = (Points::new(), Vec::new());
    for z in 0..counts[2] {
        for y in 0..counts[1] {
            for x in 0..counts[0] {
                points.push(std::array::from_fn(|axis| {
                    at[axis] + SIZE[axis] * f64::from([x, y, z][axis]) / f64::from(cells[axis])
                }));
            }
        }
    }
    for z in 0..cells[2] {
        for y in 0..cells[1] {
            for x in 0..cells[0] {
                let corner =
                    |bits: u32| x + (bits & 1) + counts[0] * (y + (bits >> 1 & 1) + counts[1] * (z + (bits >> 2)));
                for [a, b] in [[1, 3], [3, 2], [2, 6], [6, 4], [4, 5], [5, 1]] {
                    tets.push([corner(0), corner(a), corner(b), corner(7)]);
                }
            }
        }
    }
    let place = |corner: u32| V3::from(points[corner as usize]);
    let mut faces: Vec<([u32; 3], [u32; 3])> = Vec::new();
    for [a, b, c, d] in &tets {
        for ([p, q, r], inner) in [([*a, *b, *c], *d), ([*a, *b, *d], *c), ([*a, *c, *d], *b), ([*b, *c, *d], *a)] {
            let up = (place(q) - place(p)).cross(&(place(r) - place(p))).dot(&(place(inner) - place(p))) < 0.0;
            let face = if up { [p, q, r] } else { [p, r, q] };
            let mut key = face;
            key.sort_unstable();
            faces.push((key, face));
        }
    }
    faces.sort_unstable();
    let outer = faces.chunk_by(|a, b| a.0 == b.0).filter(|group| group.len() == 1).map(|group| group[0].1).collect();
    (points, tets, outer)
}

/// A cylinder along z.
fn cylinder(around: u32, radius: f64, length: f64) -> (Points, Triangles) {
    let (mut points, mut triangles) = (Points::new(), Triangles::new());
    for k in 0..around {
        let (sine, cosine) = libm::sincos(std::f64::consts::TAU * f64::from(k) / f64::from(around));
        points.extend([-0.5, 0.5].map(|end| [radius * cosine, radius * sine, end * length]));
    }
    points.extend([[0.0, 0.0, -0.5 * length], [0.0, 0.0, 0.5 * length]]);
    for k in 0..around {
        let (a, b) = (2 * k, 2 * ((k + 1) % around));
        triangles.extend([[a, b, b + 1], [a, b + 1, a + 1], [2 * around, b, a], [2 * around + 1, a + 1, b + 1]]);
    }
    (points, triangles)
}

/// A sphere of rings between two poles.
fn sphere(around: u32, rings: u32, radius: f64) -> (Points, Triangles) {
    let (mut points, mut triangles) = (Points::new(), Triangles::new());
    for ring in 1..rings {
        let (sine, cosine) = libm::sincos(std::f64::consts::PI * f64::from(ring) / f64::from(rings));
        for k in 0..around {
            let (s, c) = libm::sincos(std::f64::consts::TAU * f64::from(k) / f64::from(around));
            points.push([radius * sine * c, radius * cosine, radius * sine * s]);
        }
    }
    let (top, last) = (points.len() as u32, (rings - 2) * around);
    points.extend([[0.0, radius, 0.0], [0.0, -radius, 0.0]]);
    for k in 0..around {
        let next = (k + 1) % around;
        for ring in 0..rings - 2 {
            let [a, b, c, d] =
                [ring * around + k, ring * around + next, (ring + 1) * around + k, (ring + 1) * around + next];
            triangles.extend([[a, b, c], [b, d, c]]);
        }
        triangles.extend([[top, next, k], [top + 1, last + k, last + next]]);
    }
    (points, triangles)
}

/// A box about the origin.
fn slab(size: [f64; 3]) -> (Points, Triangles) {
    let corner = |bits: u32| std::array::from_fn(|axis| size[axis] * (f64::from(bits >> axis & 1) - 0.5));
    let mut triangles = Triangles::new();
    for [a, b, c, d] in [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]] {
        triangles.extend([[a, b, c], [a, c, d]]);
    }
    ((0..8).map(corner).collect(), triangles)
}

/// What does something to the dough: its mesh about the origin, and where it is.
struct Tool {
    points: Points,
    triangles: Triangles,
    at: Place,
    ground: bool,
    frames: u32,
}

impl Tool {
    fn of(case: &str) -> Self {
        let middle = [0.5 * SIZE[0], 0.5 * SIZE[2]];
        assert!(middle == [0.12, 0.06], "the tools are made for this dough");
        let ((points, triangles), at, ground, frames): (_, Place, _, _) = match case {
            "rest" => (slab([0.1, 0.1, 0.1]), |_| (0.0, [9.0, 9.0, 9.0]), true, 240),
            "plate" => (slab([1.03, 0.1, 1.01]), |_| (0.0, [0.12, -0.05, 0.06]), false, 240),
            "roll" => {
                let at = |frame: f64| {
                    let way = frame * 10.0 * THICKNESS;
                    (-way / 0.05, [-0.08 + way, 0.1, 0.06])
                };
                (cylinder(48, 0.05, 0.3), at, true, 42)
            }
            "press" => {
                let at = |frame: f64| {
                    let down = if frame < 24.0 { frame / 24.0 } else { (36.0 - frame) / 12.0 };
                    (0.0, [0.12, 0.06 + 2.0 * THICKNESS + 0.01 - 0.024 * down, 0.06])
                };
                (slab([0.5, 0.02, 0.5]), at, true, 48)
            }
            "fist" => {
                let at = |frame: f64| {
                    let down = if frame < 8.0 { frame } else { (16.0 - frame).max(-10.0) };
                    (0.0, [0.11, 0.06 + 0.04 + 0.055 - 0.01 * down - 0.001, 0.055])
                };
                (sphere(32, 16, 0.04), at, true, 24)
            }
            "knead" => {
                let at = |frame: f64| {
                    let way = frame * 20.0 * THICKNESS;
                    (-way / 0.05, [-0.08 + way, 0.075, 0.06])
                };
                (cylinder(48, 0.05, 0.3), at, true, 24)
            }
            "slap" => {
                let at = |frame: f64| {
                    let down = (frame - 2.0).clamp(0.0, 1.0) - 0.3 * (frame - 6.0).max(0.0);
                    (0.0, [0.12, 0.06 + 0.02 + 0.01 - 0.05 * down, 0.06])
                };
                (slab([0.5, 0.02, 0.5]), at, true, 24)
            }
            _ => panic!("`{case}`; expected rest, plate, roll, press, fist, knead or slap"),
        };
        Self { points, triangles, at, ground, frames }
    }

    fn at(&self, frame: f64) -> Points {
        let (angle, shift) = (self.at)(frame);
        let (s, c) = libm::sincos(angle);
        self.points.iter().map(|[x, y, z]| [c * x - s * y + shift[0], s * x + c * y + shift[1], z + shift[2]]).collect()
    }

    /// How deep the deepest of `points` is inside of it at `frame`; it is convex.
    fn deepest(&self, points: &Points, frame: f64) -> f64 {
        let pose = self.at(frame);
        let planes: Vec<(V3, V3)> = self
            .triangles
            .iter()
            .map(|corners| {
                let [a, b, c] = corners.map(|corner| V3::from(pose[corner as usize]));
                (a, (b - a).cross(&(c - a)).normalize())
            })
            .collect();
        let depth = |p: &[f64; 3]| planes.iter().map(|(a, n)| n.dot(&(a - V3::from(*p)))).fold(f64::INFINITY, f64::min);
        points.iter().map(depth).fold(0.0, f64::max)
    }
}

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let number = |name: &str| words.iter().find_map(|word| word.strip_prefix(name)?.parse::<u32>().ok());
    let is_asked = |name: &str| words.iter().any(|word| word == name);
    let (steps, limit) = (number("steps=").unwrap_or(0), number("frames=").unwrap_or(u32::MAX));
    let sizes = [("tiny", [12, 3, 6]), ("small", [26, 7, 12]), ("large", [54, 14, 27])];
    let cases = ["rest", "plate", "roll", "press", "fist", "knead", "slap"];
    let (any_size, any_case) = (sizes.iter().any(|s| is_asked(s.0)), cases.iter().any(|c| is_asked(c)));
    for case in cases.into_iter().filter(|case| !any_case || is_asked(case)) {
        for (name, cells) in sizes.into_iter().filter(|(name, _)| is_asked(name) || (!any_size && *name == "small")) {
            run(
                case,
                name,
                cells,
                steps,
                limit,
                number("pascal=").unwrap_or(5000),
                [is_asked("self"), is_asked("quiet")],
            );
        }
    }
}

fn run(case: &str, name: &str, cells: [u32; 3], steps: u32, limit: u32, pascal: u32, [own, quiet]: [bool; 2]) {
    let plain = |value| Scaled { value, mask: None };
    let (points, tets, faces) = dough(cells, [0.0, THICKNESS, 0.0]);
    let material = Material { density: plain(1000.0), stiffness: plain(f64::from(pascal)), damping: plain(0.01) };
    let body = Body::new(&Mesh { points: &points, tets: &tets, ..Mesh::default() }, &material, &[]).expect("dough");
    let skins = [Skin::new(&points, &faces, &body.springs()).expect("dough")];
    let mut skin_points: Vec<u32> = faces.iter().flatten().copied().collect();
    skin_points.sort_unstable();
    skin_points.dedup();
    let tool = Tool::of(case);
    let ground = Ground { up: [0.0, 1.0, 0.0], height: 0.0, thickness: THICKNESS, friction: 0.5 };
    let mut state = State::at_rest(&body);
    let mut solver = Solver::new(&body);
    let (mut wall, mut cpu, mut newton, mut caps, mut through, mut taken) = (0.0, 0.0, 0, 0, 0.0_f64, 0);
    let (mut slowest, mut fastest, mut resting) = (0.0_f64, 0.0_f64, 0.0_f64);
    if !quiet {
        println!(
            "frame steps newton    cg  residual caps contacts overlap÷gap inside÷gap volume turned fastest m/s    ms"
        );
    }
    let frames = tool.frames.min(limit);
    for frame in 0..frames {
        let poses = [0.0, 1.0].map(|share| Pose { share, positions: tool.at(f64::from(frame) + share) });
        let obstacles = [Obstacle::new(&tool.triangles, &poses, FRAME, THICKNESS, 0.5).expect("a tool")];
        let own = own.then_some(Rub { thickness: THICKNESS, friction: 0.5 });
        let ground = tool.ground.then_some(ground);
        let scene = Scene { skins: &skins, obstacles: &obstacles, ground, own, ..Scene::default() };
        let asked = Frame { seconds: FRAME, contacts: Some(&scene), substeps: steps, ..Frame::default() };
        let clocks = (Instant::now(), ProcessTime::now());
        let report = solver.step(&body, &mut state, &asked);
        let (ms, cpu_ms) = (clocks.0.elapsed().as_secs_f64() * 1e3, clocks.1.elapsed().as_secs_f64() * 1e3);
        let outer: Points = skin_points.iter().map(|index| state.positions[*index as usize]).collect();
        let inside = tool.deepest(&outer, f64::from(frame + 1));
        let low = outer.iter().map(|p| -p[1]).fold(0.0, f64::max);
        let inside = inside.max(if tool.ground { low } else { 0.0 });
        let speed = state.velocities.iter().map(|v| V3::from(*v).norm()).fold(0.0, f64::max);
        (wall, cpu, newton, caps) = (wall + ms, cpu + cpu_ms, newton + report.newton, caps + report.caps_hit);
        (through, slowest, fastest) = (through.max(inside), slowest.max(ms), fastest.max(speed));
        taken += report.substeps;
        if 2 * frame >= frames {
            resting = resting.max(speed);
        }
        if !quiet {
            println!(
                "{frame:5} {:5} {:6} {:5} {:9.1e} {:4} {:8} {:11.3} {:10.3} {:6.3} {:6} {speed:11.2e} {ms:5.1}",
                report.substeps,
                report.newton,
                report.cg,
                report.residual,
                report.caps_hit,
                report.contacts,
                report.deepest_overlap / THICKNESS,
                inside / THICKNESS,
                report.volume_ratio,
                report.inverted_tets,
            );
        }
    }
    let each = |sum: f64| sum / f64::from(frames);
    println!(
        "{case:6} {name:6} {:6} particles: {:.1} ms a frame (cpu {:.1}, slowest {slowest:.1}), {:.1} steps, {:.1} newton, \
         {caps} caps, inside {:.3} gaps, fastest {fastest:.2}, in the second half {:.1e} g·dt",
        body.len(),
        each(wall),
        each(cpu),
        each(f64::from(taken)),
        each(f64::from(newton)),
        through / THICKNESS,
        resting / (9.81 * FRAME),
    );
}
