//! Thick liquid at rest in vessels with thin walls.

use crate::marked::MarkedSurface;
use crate::shape::{MovingShape, ShapeSettings, ShapeTopology};
use crate::volumes::VolumeTargets;

use super::*;
use numerics::vector::{add, scale, sub};

/// What 24 frames did to a liquid.
struct Rest {
    /// Drift of the volume, ÷ it, without correction, and in the end.
    raw: f64,
    drift: f64,
    /// Share of the volume that was lost to pieces too small for the grid, or is where it should not be in the end.
    gone: f64,
}

/// A liquid of 10 Pa·s on cells of 5 cm, of this distance in cells, at rest in a vessel of these triangles.
fn rest(
    size: Cell,
    (points, triangles): (Vec<Vec3>, Vec<[u32; 3]>),
    liquid: impl Fn(Vec3) -> f32 + Sync,
    is_outside: impl Fn(Vec3) -> bool,
) -> Rest {
    let domain = Domain::closed([0; 3], size);
    let settings = ShapeSettings { thicken: true, ..ShapeSettings::new(domain.low, domain.high) };
    let shape = MovingShape::new(&ShapeTopology::new(&points, &triangles), &points, &points, &settings);
    let (distance, solid) = (|_: f64, p: Vec3| shape.distance(0.0, p), |p: Vec3| shape.distance(0.0, p));
    let settings = LiquidSettings::new(domain, 0.05);
    let mut surface = MarkedSurface::new(domain, 1, liquid, 0, 1);
    surface.meet(&solid);
    let mut targets = VolumeTargets::new(&mut surface, settings.cell, Some(&solid));
    let full = targets.volume();
    let around = Surroundings { viscosity: &|_| 10.0, solid: Some(Solid::still(&distance)), ..FALLING };
    let (mut motion, mut rest) = (Motion::default(), Rest { raw: 0.0, drift: 0.0, gone: 0.0 });
    for _ in 0..24 {
        let mut liquid = Liquid::resume(settings.clone(), surface, motion);
        liquid.step_frame(&around, 1.0 / 24.0);
        (surface, motion) = liquid.into_parts();
        let report = targets.correct(&mut surface, Some(&solid));
        (rest.raw, rest.drift) = (report.raw_drift, report.drift);
        rest.gone += report.lost.iter().fold(0.0, |sum, piece| sum + piece.volume / full);
    }
    let phi = surface.phi_outside(&solid);
    let cells = surface.view().rows.iter().zip(&phi).filter(|(cell, _)| is_outside(Site::Centre.of(*cell)));
    let outside = cells.fold(0.0, |sum, (_, phi)| sum + f64::from((0.5 - phi).clamp(0.0, 1.0)));
    rest.gone += outside * settings.cell_volume() / full;
    rest
}

/// A box of this size inside, open above, of one shell with walls and a floor of a thickness.
fn open_shell(low: Vec3, high: Vec3, thickness: f32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let outer = (low.map(|x| x - thickness), [high[0] + thickness, high[1], high[2] + thickness]);
    let corner = |(low, high): (Vec3, Vec3), n: usize| [0, 1, 2].map(|axis| [low, high][n >> axis & 1][axis]);
    let points = (0..16).map(|n| corner(if n < 8 { outer } else { (low, high) }, n % 8)).collect();
    // Sides of a box, seen from outside.
    let sides: [[u32; 4]; 5] = [[0, 1, 5, 4], [0, 4, 6, 2], [1, 3, 7, 5], [0, 2, 3, 1], [4, 5, 7, 6]];
    let inward = sides.map(|side| [side[3], side[2], side[1], side[0]].map(|n| n + 8));
    let rim: [[u32; 4]; 4] = [[2, 6, 14, 10], [6, 7, 15, 14], [7, 3, 11, 15], [3, 2, 10, 11]];
    let quads = sides.into_iter().chain(inward).chain(rim);
    (points, quads.flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect())
}

#[test]
fn a_cup_with_thin_walls_keeps_its_liquid() {
    for (thickness, shift) in [(2.0, 0.0), (1.0, 0.5), (1.5, 0.3), (1.0, 0.0_f32)] {
        let [low, high] = [[7.0, 4.0, 7.0], [13.0, 12.0, 13.0]].map(|p: Vec3| p.map(|x| x + shift));
        let into = 0.4 * thickness;
        let liquid = block(low.map(|x| x - into), [high[0] + into, 7.0, high[2] + into]);
        let is_outside = |p: Vec3| (0..3).any(|n| p[n] < low[n] - thickness || n != 1 && p[n] > high[n] + thickness);
        let Rest { raw, drift, gone } = rest([20, 16, 20], open_shell(low, high, thickness), liquid, is_outside);
        assert!(raw.abs() < 0.03 && drift.abs() < 2e-3, "{thickness} {shift}: {raw} {drift}");
        assert!(gone < 1e-3, "{thickness} {shift}: {gone}");
    }
}

#[test]
fn a_tilted_cup_of_plates_does_not_leak() {
    let (sin, cos) = libm::sincosf(35.0_f32.to_radians());
    let about = [16.0, 12.0, 10.0];
    let turned = |p: Vec3| [about[0] + cos * p[0] - sin * p[1], about[1] + sin * p[0] + cos * p[1], about[2] + p[2]];
    let own = |p: Vec3| {
        let [x, y, z] = sub(p, about);
        [cos * x + sin * y, cos * y - sin * x, z]
    };
    // Floor and walls, one cell thick, that touch: their sizes and middles.
    let plates = [
        ([9.0, 1.0, 9.0], [0.0, -0.5, 0.0]),
        ([1.0, 8.0, 9.0], [-4.0, 4.0, 0.0]),
        ([1.0, 8.0, 9.0], [4.0, 4.0, 0.0]),
        ([9.0, 8.0, 1.0], [0.0, 4.0, -4.0]),
        ([9.0, 8.0, 1.0], [0.0, 4.0, 4.0]),
    ];
    let (mut points, mut triangles): (Vec<Vec3>, Vec<[u32; 3]>) = (Vec::new(), Vec::new());
    for (size, middle) in plates {
        let shape = numerics::shapes::block(size, [1; 3]);
        triangles.extend(shape.triangles().iter().map(|corners| corners.map(|n| n + points.len() as u32)));
        points.extend(shape.points.iter().map(|p| turned([0, 1, 2].map(|axis| p[axis] as f32 + middle[axis]))));
    }
    let inside = block([-3.9, -0.4, -3.9], [3.9, 3.0, 3.9]);
    let is_outside = |p: Vec3| {
        let [x, y, z] = own(p);
        x.abs() > 4.5 || y < -1.0 || z.abs() > 4.5
    };
    let Rest { gone, .. } = rest([32, 26, 20], (points, triangles), |p| inside(own(p)), is_outside);
    assert!(gone < 1e-2, "{gone}");
}

/// A plate of this thickness sweeps a block of thick liquid along at a speed, cells a frame; the largest share of the
/// liquid that is behind it after a frame.
fn swept(thickness: f32, cells: f32) -> f64 {
    let domain = Domain::closed([0; 3], [32, 16, 20]);
    let settings = ShapeSettings { thicken: true, ..ShapeSettings::new(domain.low, domain.high) };
    let shape = numerics::shapes::block([f64::from(thickness), 40.0, 40.0], [1; 3]);
    let at = |x: f32| -> Vec<Vec3> {
        shape.points.iter().map(|p| [p[0] as f32 + x, p[1] as f32 + 8.0, p[2] as f32 + 10.0]).collect()
    };
    let topology = ShapeTopology::new(&at(0.0), &shape.triangles());
    let settings_of = LiquidSettings::new(domain, 0.05);
    let mut surface = MarkedSurface::new(domain, 1, block([9.0, -9.0, 5.0], [19.0, 5.4, 15.0]), 0, 1);
    let full = volume(&surface.view(), &domain);
    let (mut motion, mut worst) = (Motion::default(), 0.0_f64);
    for frame in 0..6.min((18.0 / cells) as u32) {
        let start = 6.0 + cells * frame as f32;
        let moving = MovingShape::new(&topology, &at(start), &at(start + cells), &settings);
        let share = |time: f64| (24.0 * time) as f32;
        let distance = |time: f64, p: Vec3| moving.distance(share(time), p);
        let velocity = |time: f64, p: Vec3| moving.velocity(share(time), p).map(|u| u * 24.0 * 0.05);
        let around = Surroundings {
            viscosity: &|_| 100.0,
            solid: Some(Solid { distance: &distance, velocity: &velocity, speed: 24.0 * 0.05 * f64::from(cells) }),
            ..FALLING
        };
        let mut liquid = Liquid::resume(settings_of.clone(), surface, motion);
        liquid.step_frame(&around, 1.0 / 24.0);
        (surface, motion) = liquid.into_parts();
        let phi = surface.phi_outside(&|p| moving.distance(1.0, p));
        let cells_behind = surface.view().rows.iter().zip(&phi).filter(|(cell, _)| {
            domain.contains(*cell) && Site::Centre.of(*cell)[0] < start + cells - 0.5 * thickness - 0.5
        });
        let behind = cells_behind.fold(0.0, |sum, (_, phi)| sum + f64::from((0.5 - phi).clamp(0.0, 1.0)));
        worst = worst.max(behind / full);
    }
    worst
}

#[test]
fn a_thin_plate_leaves_no_liquid_behind() {
    for (thickness, cells) in [(1.0, 1.2), (1.0, 1.6), (2.0, 2.0), (1.0, 3.0), (0.2, 3.0), (1.0, 5.0), (1.0, 8.0_f32)] {
        let behind = swept(thickness, cells);
        assert!(behind < 1e-3, "{thickness} {cells}: {behind}");
    }
}

/// A plate of this thickness moves in one substep from one place to another through a block at rest of 54 cells section, from x = 9 on
/// and this long: what the solver says that it passed over, and the liquid that is behind it then, ÷ cell³.
fn passed(thickness: f32, [from, to]: [f32; 2], long: f32) -> [f64; 2] {
    let domain = Domain::closed([0; 3], [40, 16, 20]);
    let settings = ShapeSettings { thicken: true, ..ShapeSettings::new(domain.low, domain.high) };
    let shape = numerics::shapes::block([f64::from(thickness), 40.0, 40.0], [1; 3]);
    let at = |x: f32| -> Vec<Vec3> {
        shape.points.iter().map(|p| [p[0] as f32 + x, p[1] as f32 + 8.0, p[2] as f32 + 10.0]).collect()
    };
    let moving = MovingShape::new(&ShapeTopology::new(&at(from), &shape.triangles()), &at(from), &at(to), &settings);
    let share = |time: f64| (24.0 * time) as f32;
    let distance = |time: f64, p: Vec3| moving.distance(share(time), p);
    let velocity = |time: f64, p: Vec3| moving.velocity(share(time), p).map(|u| u * 24.0 * 0.05);
    let speed = 24.0 * 0.05 * f64::from(moving.sweep_near([domain.low, domain.high]));
    let solid = Some(Solid { distance: &distance, velocity: &velocity, speed });
    let around = Surroundings { viscosity: &|_| 100.0, solid, ..WEIGHTLESS };
    let surface = MarkedSurface::new(domain, 1, block([9.0, 5.0, 5.0], [9.0 + long, 11.0, 14.0]), 0, 1);
    let settings = LiquidSettings { max_substeps: 1, ..LiquidSettings::new(domain, 0.05) };
    let mut liquid = Liquid::new(settings.clone(), surface);
    let report = liquid.step_frame(&around, 1.0 / 24.0);
    assert_eq!((report.substeps, report.caps_hit), (1, 1));
    let view = liquid.surface().view();
    let behind = view.rows.iter().zip(view.phi).filter(|(cell, _)| (cell[0] as f32) < to - 0.5 * thickness);
    let behind = behind.fold(0.0, |sum, (_, phi)| sum + f64::from((0.5 - phi).clamp(0.0, 1.0)));
    [report.passed_through / settings.cell_volume(), behind]
}

#[test]
fn what_a_plate_passes_over_is_counted() {
    // Thick: it moves by eight cells and was three thick, so five cells of the block are behind it. Thin, and too far at once to
    // be seen from the block: all of it.
    for (thickness, way, long, exact) in [(3.0, [7.5, 15.5], 20.0, 5.0 * 54.0), (1.0, [3.0, 39.0], 6.0, 6.0 * 54.0)] {
        let [counted, behind] = passed(thickness, way, long);
        // By φ at their middles alone, cells at the block's edges are too full.
        assert!((counted / exact - 1.0).abs() < 0.04, "{thickness}: {counted} of {exact}");
        assert!((counted / behind - 1.0).abs() < 0.01, "{thickness}: {counted} of {behind}");
    }
    // A thin plate by eight cells is seen on its way.
    let [counted, behind] = passed(1.0, [7.5, 15.5], 20.0);
    assert_eq!([counted, behind], [0.0; 2]);
}

/// A still box between two corners, turned about z through its middle.
struct Still {
    low: Vec3,
    high: Vec3,
    turn: f32,
}

impl Still {
    /// One of any thickness, turned or not, whose lower side is within reach of the surface of a pool 6 cells deep, or below.
    fn random(n: u64) -> Self {
        let random = |k: u64| numerics::random::Key::new(n).of(k).f32();
        let size = [0, 1, 2].map(|k| {
            let range = if random(k) < 0.4 { [0.1, 2.1] } else { [2.0, 6.0] };
            range[0] + (range[1] - range[0]) * random(k + 3)
        });
        let low =
            [1.2 + (9.6 - size[0]) * random(6), 6.0 - (size[1] + 1.0) * random(7), 1.2 + (9.6 - size[2]) * random(8)];
        Self { low, high: add(low, size), turn: if n.is_multiple_of(2) { 0.0 } else { 1.5 * random(9) } }
    }

    fn mesh(&self) -> (Vec<Vec3>, Vec<[u32; 3]>) {
        let (sin, cos) = libm::sincosf(self.turn);
        let (middle, size) = (scale(add(self.low, self.high), 0.5), sub(self.high, self.low));
        let place = |p: [f64; 3]| {
            let [x, y, z] = [0, 1, 2].map(|axis| p[axis] as f32 * size[axis]);
            add(middle, [cos * x - sin * y, sin * x + cos * y, z])
        };
        let shape = numerics::shapes::block([1.0; 3], [1; 3]);
        (shape.points.iter().map(|p| place(*p)).collect(), shape.triangles())
    }

    /// The largest speed in eight frames of that pool, which should rest around the box; ÷ g·Δt.
    fn unrest(&self, resolution: u32) -> f64 {
        let (points, triangles) = self.mesh();
        let domain = Domain::closed([0; 3], [12; 3]);
        let settings = ShapeSettings { thicken: true, ..ShapeSettings::new(domain.low, domain.high) };
        let shape = MovingShape::new(&ShapeTopology::new(&points, &triangles), &points, &points, &settings);
        let distance = |_: f64, p: Vec3| shape.distance(0.0, p);
        let mut surface = MarkedSurface::new(domain, resolution, |p| p[1] - 6.0, 0, 1);
        surface.meet(&|p| shape.distance(0.0, p));
        let around = Surroundings { solid: Some(Solid::still(&distance)), ..FALLING };
        let mut liquid = Liquid::new(LiquidSettings::new(domain, 1.0 / 12.0), surface);
        fastest(&mut liquid, &around, 8)
    }
}

/// A box may end in the surface, just below it, or just above; its sides may be cut by cells or lie between them. Of 430, three
/// disturbed the pool by more than 0.1: two thinner than a cell, turned by 25°, and one of 2.7 cells, turned by 37°.
#[test]
fn a_pool_rests_around_a_box_of_any_thickness_at_any_height() {
    let lying = || {
        [0.48, 0.5, 0.52, 0.54, 0.6, 0.65].into_iter().flat_map(|top: f32| {
            [0.02, 0.05, 0.1, 0.15, 0.3].map(|thickness: f32| {
                let [low, high] = [top - thickness, top].map(|y| 12.0 * y);
                Still { low: [3.24, low, 3.0], high: [9.24, high, 9.0], turn: 0.0 }
            })
        })
    };
    let anywhere: Vec<f64> = lying().chain((0..60).map(Still::random)).map(|still| still.unrest(1)).collect();
    let finer: Vec<f64> = lying().map(|still| still.unrest(2)).collect();
    for (speeds, bounds) in [(&anywhere, [(1e-3, 8), (0.1, 1), (1.0, 0)]), (&finer, [(1e-3, 6), (0.03, 2), (0.1, 0)])] {
        for (limit, most) in bounds {
            let beyond = speeds.iter().filter(|speed| **speed > limit).count();
            assert!(beyond <= most, "{beyond} of {} above {limit}", speeds.len());
        }
    }
}
