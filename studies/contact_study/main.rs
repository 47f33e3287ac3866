//! Depth of penetration under hard contact, and cost of individual frames, for dough of 5 kPa at rest, rolled over,
//! pressed and hit. The cost of a frame at more sizes is measured by `cargo bench --bench softbody`.
//!
//! `cargo run --release -p studies --bin contact_study [case]… [tiny|small|large]… [self] [steps=N] [frames=N]
//! [pascal=N] [volume=N] [quiet]`; threads by `RAYON_NUM_THREADS`. Cases: rest (on the ground), plate (on a mesh),
//! roll (a pin that rolls ten thicknesses a frame, 1 cm deep in the dough), press (a plate that goes down to 60 % of
//! the height and up again), fist (a sphere, a third of the height deep, ten thicknesses a frame), knead (a pin at
//! twice the speed, half the height deep), slap (a plate that moves to half the height within a frame). Prints a line
//! for each frame, then one for each case.

#![allow(clippy::disallowed_methods, reason = "measures time and is no node")]

use bodies::collision::{BodySkin, CollisionScene, ContactParams, Ground, Obstacle, ObstaclePose};
use bodies::mass_spring::{BodySolver, Material, Mesh, SoftBody, SolverFrame, State};
use bodies::tets::{boundary, cubes};
use numerics::masked::Masked;
use numerics::shapes::{Polygons, block, cylinder, sphere};
use numerics::vector::DVec3;
use std::time::Instant;

const FRAME: f64 = 1.0 / 24.0;
const THICKNESS: f64 = 1e-3;
/// Size of the dough, metres.
const SIZE: [f64; 3] = [0.24, 0.06, 0.12];

type Points = Vec<[f64; 3]>;
/// Pose of a tool at a frame: rotation about z, then translation.
type ToolPose = fn(f64) -> (f64, [f64; 3]);

/// A cylinder along z.
fn rolling_pin() -> Polygons {
    let mut pin = cylinder([0.1, 0.3, 0.1], 12);
    pin.points.iter_mut().for_each(|[_, y, z]| (*y, *z) = (-*z, *y));
    pin
}

/// A tool that acts on the dough: its mesh about the origin, and its motion.
struct Tool {
    points: Points,
    triangles: Vec<[u32; 3]>,
    at: ToolPose,
    ground: bool,
    frames: u32,
}

impl Tool {
    fn of(case: &str) -> Self {
        let middle = [0.5 * SIZE[0], 0.5 * SIZE[2]];
        assert!(middle == [0.12, 0.06], "the tools are made for this dough");
        let slab = |size| block(size, [1; 3]);
        let (shape, at, ground, frames): (_, ToolPose, _, _) = match case {
            "rest" => (slab([0.1, 0.1, 0.1]), |_| (0.0, [9.0, 9.0, 9.0]), true, 240),
            "plate" => (slab([1.03, 0.1, 1.01]), |_| (0.0, [0.12, -0.05, 0.06]), false, 240),
            "roll" => {
                let at = |frame: f64| {
                    let advance = frame * 10.0 * THICKNESS;
                    (-advance / 0.05, [-0.08 + advance, 0.1, 0.06])
                };
                (rolling_pin(), at, true, 42)
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
                (sphere([0.08; 3], 8), at, true, 24)
            }
            "knead" => {
                let at = |frame: f64| {
                    let advance = frame * 20.0 * THICKNESS;
                    (-advance / 0.05, [-0.08 + advance, 0.075, 0.06])
                };
                (rolling_pin(), at, true, 24)
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
        Self { triangles: shape.triangles(), points: shape.points, at, ground, frames }
    }

    fn at(&self, frame: f64) -> Points {
        let (angle, shift) = (self.at)(frame);
        let (s, c) = libm::sincos(angle);
        self.points.iter().map(|[x, y, z]| [c * x - s * y + shift[0], s * x + c * y + shift[1], z + shift[2]]).collect()
    }

    /// Depth of the deepest of `points` in the tool at `frame`; the tool is convex.
    fn deepest(&self, points: &Points, frame: f64) -> f64 {
        let pose = self.at(frame);
        let planes: Vec<(DVec3, DVec3)> = self
            .triangles
            .iter()
            .map(|corners| {
                let [a, b, c] = corners.map(|corner| DVec3::from(pose[corner as usize]));
                (a, (b - a).cross(&(c - a)).normalize())
            })
            .collect();
        let depth =
            |p: &[f64; 3]| planes.iter().map(|(a, n)| n.dot(&(a - DVec3::from(*p)))).fold(f64::INFINITY, f64::min);
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
                [number("pascal=").unwrap_or(5000), number("volume=").unwrap_or(1)],
                [is_asked("self"), is_asked("quiet")],
            );
        }
    }
}

fn run(
    case: &str,
    name: &str,
    cells: [usize; 3],
    steps: u32,
    limit: u32,
    [pascal, volume]: [u32; 2],
    [self_contact, quiet]: [bool; 2],
) {
    let plain = |value| Masked::uniform(value);
    let (points, tets) = cubes(cells, [0.0, THICKNESS, 0.0], SIZE);
    let narrow: Vec<[f32; 3]> = points.iter().map(|p| p.map(|x| x as f32)).collect();
    let faces: Vec<[u32; 3]> = boundary(&tets, &narrow).iter().map(|face| face.corners).collect();
    let material = Material { density: plain(1000.0), stiffness: plain(f64::from(pascal)), damping: plain(0.01) };
    let body = SoftBody::new(&Mesh { points: &points, tets: &tets, ..Mesh::default() }, &material, &[]).expect("dough");
    let skins = [BodySkin::new(&points, &faces, &body.springs()).expect("dough")];
    let mut skin_points: Vec<u32> = faces.iter().flatten().copied().collect();
    skin_points.sort_unstable();
    skin_points.dedup();
    let tool = Tool::of(case);
    let ground = Ground { up: [0.0, 1.0, 0.0], height: 0.0, thickness: THICKNESS, friction: 0.5 };
    let mut state = State::at_rest(&body);
    let mut solver = BodySolver::new(&body);
    let (mut wall, mut newton, mut caps, mut through, mut taken) = (0.0, 0, 0, 0.0_f64, 0);
    let (mut slowest, mut fastest, mut resting) = (0.0_f64, 0.0_f64, 0.0_f64);
    if !quiet {
        println!(
            "frame steps newton    cg  residual caps contacts overlap÷gap inside÷gap volume turned fastest m/s    ms"
        );
    }
    let frames = tool.frames.min(limit);
    for frame in 0..frames {
        let poses = [0.0, 1.0].map(|share| ObstaclePose { share, positions: tool.at(f64::from(frame) + share) });
        let obstacles = [Obstacle::new(&tool.triangles, &poses, FRAME, THICKNESS, 0.5).expect("a tool")];
        let self_contact = self_contact.then_some(ContactParams { thickness: THICKNESS, friction: 0.5 });
        let ground = tool.ground.then_some(ground);
        let scene =
            CollisionScene { skins: &skins, obstacles: &obstacles, ground, self_contact, ..CollisionScene::default() };
        let asked = SolverFrame {
            seconds: FRAME,
            contacts: Some(&scene),
            substeps: steps,
            volume: f64::from(volume),
            ..SolverFrame::default()
        };
        let clock = Instant::now();
        let report = solver.step(&body, &mut state, &asked);
        let ms = clock.elapsed().as_secs_f64() * 1e3;
        let outer: Points = skin_points.iter().map(|index| state.positions[*index as usize]).collect();
        let inside = tool.deepest(&outer, f64::from(frame + 1));
        let low = outer.iter().map(|p| -p[1]).fold(0.0, f64::max);
        let inside = inside.max(if tool.ground { low } else { 0.0 });
        let speed = state.velocities.iter().map(|v| DVec3::from(*v).norm()).fold(0.0, f64::max);
        (wall, newton, caps) = (wall + ms, newton + report.newton, caps + report.caps_hit);
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
        "{case:6} {name:6} {:6} particles: {:.1} ms a frame (slowest {slowest:.1}), {:.1} steps, {:.1} newton, \
         {caps} caps, inside {:.3} gaps, fastest {fastest:.2}, in the second half {:.1e} g·dt",
        body.len(),
        each(wall),
        each(f64::from(taken)),
        each(f64::from(newton)),
        through / THICKNESS,
        resting / (9.81 * FRAME),
    );
}
