//! Liquid stays on its side of solids, however thin.

use crate::marked::MarkedSurface;
use crate::rows::Cell;
use crate::shape::{MovingShape, ShapeSettings, ShapeTopology};
use crate::volumes::VolumeTargets;

use super::*;
use numerics::shapes::Polygons;

const FRAME: f64 = 1.0 / 24.0;

/// A still mesh, in cells, in liquid that falls on it.
struct Scene {
    points: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    domain: Domain,
    cell: f64,
    viscosity: f64,
    frames: u32,
}

/// What became of the liquid, ÷ its volume.
#[derive(Debug)]
struct Outcome {
    /// What is on the other side at the end.
    leaked: f64,
    /// What correction did not restore, at most.
    missing: f64,
}

impl Scene {
    fn in_box(size: Cell, triangles: Vec<[u32; 3]>, points: Vec<Vec3>) -> Self {
        Self { points, triangles, domain: Domain::closed([0; 3], size), cell: 0.04, viscosity: 0.001, frames: 20 }
    }

    /// The share of the liquid that is where `is_outside` says at the end, with pieces that were lost there.
    fn run(&self, liquid: impl Fn(Vec3) -> f32 + Sync, is_outside: impl Fn(Vec3) -> bool) -> Outcome {
        let settings = ShapeSettings { thicken: true, ..ShapeSettings::new(self.domain.low, self.domain.high) };
        let topology = ShapeTopology::new(&self.points, &self.triangles);
        let shape = MovingShape::new(&topology, &self.points, &self.points, &settings);
        let distance = |_: f64, p: Vec3| shape.distance(0.0, p);
        let solid = |p: Vec3| shape.distance(0.0, p);
        let mut surface = MarkedSurface::new(self.domain, 1, liquid, 0, 1);
        surface.meet(&solid);
        let mut targets = VolumeTargets::new(&mut surface, self.cell, Some(&solid));
        let full = targets.volume();
        let viscosity = |_| self.viscosity;
        let around = Surroundings { viscosity: &viscosity, solid: Some(Solid::still(&distance)), ..FALLING };
        let settings = LiquidSettings::new(self.domain, self.cell);
        let (mut motion, mut lost, mut missing) = (Motion::default(), 0.0, 0.0_f64);
        for _ in 0..self.frames {
            let mut liquid = Liquid::resume(settings.clone(), surface, motion);
            liquid.step_frame(&around, FRAME);
            (surface, motion) = liquid.into_parts();
            let report = targets.correct(&mut surface, Some(&solid));
            missing = missing.max(-report.drift);
            lost +=
                report.lost.iter().filter(|piece| is_outside(piece.place)).fold(0.0, |sum, piece| sum + piece.volume);
        }
        Outcome { leaked: (self.outside(&surface, &solid, &is_outside) + lost) / full, missing }
    }

    /// The volume, m³, where `is_outside` says.
    fn outside(
        &self,
        surface: &MarkedSurface,
        solid: &(dyn Fn(Vec3) -> f32 + Sync),
        is_outside: &impl Fn(Vec3) -> bool,
    ) -> f64 {
        let phi = surface.phi_outside(solid);
        let cells = surface.view().rows.iter().zip(&phi);
        let outside = cells.map(|(cell, phi)| (Site::Centre.of(cell), phi)).filter(|(middle, _)| is_outside(*middle));
        let share = |phi: f32| f64::from((0.5 - phi).clamp(0.0, 1.0));
        self.cell * self.cell * self.cell * outside.fold(0.0, |sum, (_, phi)| sum + share(*phi))
    }
}

/// Floor and four walls, each a sheet of its own.
fn open_box(low: Vec3, high: Vec3) -> (Vec<[u32; 3]>, Vec<Vec3>) {
    let corner = |n: usize| [[low, high][n & 1][0], [low, high][n >> 1 & 1][1], [low, high][n >> 2 & 1][2]];
    let sides = [[0, 1, 5, 4], [0, 1, 3, 2], [4, 5, 7, 6], [0, 4, 6, 2], [1, 5, 7, 3]];
    let points = sides.iter().flatten().map(|n| corner(*n)).collect();
    let triangles = (0..5).flat_map(|n| [[0, 1, 2], [0, 2, 3]].map(|of: [u32; 3]| of.map(|at| 4 * n + at))).collect();
    (triangles, points)
}

/// The lower half of a ball of these radii, closed: rings of both sides, and the rim.
fn bowl(middle: Vec3, radius: [f32; 2], height: [f32; 2]) -> (Vec<[u32; 3]>, Vec<Vec3>) {
    const AROUND: u32 = 32;
    const DOWN: u32 = 10;
    let mut points = Vec::new();
    for side in 0..2 {
        for down in 0..DOWN {
            for around in 0..AROUND {
                let [turn, fall] = [
                    std::f32::consts::TAU * around as f32 / AROUND as f32,
                    std::f32::consts::FRAC_PI_2 * down as f32 / DOWN as f32,
                ];
                let (r, h) = (radius[side] * libm::cosf(fall), height[side] * libm::sinf(fall));
                points.push([middle[0] + r * libm::cosf(turn), middle[1] - h, middle[2] + r * libm::sinf(turn)]);
            }
        }
    }
    points.extend([0, 1].map(|side| [middle[0], middle[1] - height[side], middle[2]]));
    let at = |side: u32, down: u32, around: u32| {
        if down == DOWN { 2 * DOWN * AROUND + side } else { (side * DOWN + down) * AROUND + around % AROUND }
    };
    let mut triangles = Vec::new();
    let mut quad = |a: u32, b: u32, c: u32, d: u32| {
        triangles
            .extend([[a, b, c], [a, c, d]].into_iter().filter(|of| of[0] != of[1] && of[1] != of[2] && of[0] != of[2]));
    };
    for around in 0..AROUND {
        for down in 0..DOWN {
            quad(at(0, down, around), at(0, down, around + 1), at(0, down + 1, around + 1), at(0, down + 1, around));
            quad(at(1, down, around), at(1, down + 1, around), at(1, down + 1, around + 1), at(1, down, around + 1));
        }
        quad(at(0, 0, around), at(1, 0, around), at(1, 0, around + 1), at(0, 0, around + 1));
    }
    (triangles, points)
}

/// A plate along x and z, turned around z.
fn plate(middle: Vec3, half: Vec3, turn: f32) -> (Vec<[u32; 3]>, Vec<Vec3>) {
    let shape: Polygons = numerics::shapes::block([2.0; 3], [1; 3]);
    let place = |p: [f64; 3]| {
        let [x, y, z] = [0, 1, 2].map(|axis| p[axis] as f32 * half[axis]);
        let (sin, cos) = libm::sincosf(turn);
        [middle[0] + cos * x - sin * y, middle[1] + sin * x + cos * y, middle[2] + z]
    };
    (shape.triangles(), shape.points.iter().map(|p| place(*p)).collect())
}

/// At the first position all sheets lie on faces of cells.
#[test]
fn an_open_box_of_sheets_holds_syrup() {
    for n in (0..12_u8).map(f32::from) {
        let outcome = box_of_sheets([0.137, 0.251, 0.319].map(|step| step * n % 1.0));
        assert!(outcome.leaked < 1e-4 && outcome.missing < 0.01, "{n}: {outcome:?}");
    }
}

/// Syrup that falls into an open box of sheets.
fn box_of_sheets(shift: Vec3) -> Outcome {
    let [low, high] = [[3.0, 3.0, 3.0], [13.0, 11.0, 13.0]].map(|p: Vec3| numerics::vector::add(p, shift));
    let (triangles, points) = open_box(low, high);
    let scene = Scene { viscosity: 1.0, ..Scene::in_box([17, 16, 17], triangles, points) };
    let liquid = block(low.map(|x| x + 2.0), high.map(|x| x - 2.0));
    // Sheets are a cell thick to the liquid, and a surface on them shows in the cells beside.
    let is_outside =
        |p: Vec3| (0..3).any(|axis| p[axis] < low[axis] - 1.25 || axis != 1 && p[axis] > high[axis] + 1.25);
    scene.run(liquid, is_outside)
}

#[test]
fn a_thin_bowl_holds_syrup() {
    for thickness in [1.0, 2.0] {
        let (triangles, points) = bowl([10.0, 11.0, 10.0], [9.0, 9.0 - thickness], [7.0, 7.0 - thickness]);
        let scene = Scene { viscosity: 1.0, ..Scene::in_box([20, 16, 20], triangles, points) };
        let disk = |p: Vec3| (length([p[0] - 10.0, 0.0, p[2] - 10.0]) - 5.0).max((p[1] - 9.5).abs() - 1.5);
        let is_outside = |p: Vec3| {
            let [x, y, z] = [(p[0] - 10.0) / 10.0, (p[1] - 11.0) / 8.0, (p[2] - 10.0) / 10.0];
            p[1] < 11.0 && length([x, y, z]) > 1.0
        };
        let outcome = scene.run(disk, is_outside);
        assert!(outcome.leaked < 1e-3 && outcome.missing < 0.01, "{thickness}: {outcome:?}");
    }
}

#[test]
fn a_tilted_plate_holds_water() {
    for (thickness, turn) in [(1.0, 0.35), (1.0, 0.0), (0.25, 0.35), (0.25, 0.0_f32)] {
        let (triangles, points) = plate([12.0, 8.0, 5.0], [20.0, 0.5 * thickness, 20.0], turn);
        let scene = Scene::in_box([24, 22, 10], triangles, points);
        let liquid = block([7.0, 13.0, -9.0], [17.0, 19.0, 19.0]);
        let is_outside = |p: Vec3| libm::cosf(turn) * (p[1] - 8.0) - libm::sinf(turn) * (p[0] - 12.0) < -1.5;
        let outcome = scene.run(liquid, is_outside);
        assert!(outcome.leaked < 1e-3 && outcome.missing < 0.03, "{thickness} {turn}: {outcome:?}");
    }
}
