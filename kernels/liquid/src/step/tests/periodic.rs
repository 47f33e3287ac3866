//! Sides that repeat.

use super::plain::Still;
use super::*;
use crate::marked::MarkedSurface;
use crate::rows::Cell;
use numerics::vector::{add, length, scale, sub};

const REPEATS: [Wall; 2] = [Wall::Periodic; 2];
const SHUT: [Wall; 2] = [Wall::Closed; 2];

fn start(domain: Domain, resolution: u32, distance: impl Fn(Vec3) -> f32 + Sync) -> Liquid<MarkedSurface> {
    Liquid::new(LiquidSettings::new(domain, 0.1), MarkedSurface::new(domain, resolution, distance, 1, 1))
}

/// φ of a solver cell.
fn phi(liquid: &Liquid<MarkedSurface>, cell: Cell) -> f32 {
    let view = liquid.surface().view();
    view.rows.find(cell).map_or(view.outside, |at| view.phi[at])
}

/// Downhill for ever: a pool is accelerated along itself, and its surface stays flat.
#[test]
fn a_stream_without_end_falls_freely() {
    for axis in [0, 1, 2] {
        let (side, up) = ((axis + 1) % 3, (axis + 2) % 3);
        let (mut walls, mut high) = ([SHUT; 3], [0; 3]);
        walls[axis] = REPEATS;
        (high[axis], high[side], high[up]) = (7, 3, 8);
        let domain = Domain { walls, ..Domain::closed([0; 3], high) };
        let mut liquid = start(domain, 1, |p| p[up] - 4.3);
        let gravity = |_| {
            let mut gravity = [0.0; 3];
            (gravity[axis], gravity[up]) = (0.5, -9.81);
            gravity
        };
        let around = Surroundings { gravity: &gravity, ..WEIGHTLESS };
        let mut way = 0.0;
        for frame in 1..=100 {
            let report = liquid.step_frame(&around, 1.0 / 24.0);
            let time = f64::from(frame) / 24.0;
            for (at, cell) in liquid.motion().rows().iter().enumerate() {
                if liquid.motion().known[at] >> axis & 1 == 1 && domain.contains(cell) {
                    let speed = f64::from(liquid.motion().velocity().faces()[axis][at]);
                    assert!((speed / (0.5 * time) - 1.0).abs() < 1e-4, "{axis} {frame} {cell:?}: {speed} {report:?}");
                }
            }
            way += 0.5 * time / 24.0;
            assert_eq!(report.solves_cut_short, 0);
        }
        assert!(way > 4.0);
        for n in 0..7 {
            let mut cell = [1; 3];
            (cell[axis], cell[up]) = (n, 4);
            assert!((phi(&liquid, cell) - 0.2).abs() < 2e-3, "{axis} {n}: {}", phi(&liquid, cell));
        }
    }
}

/// Crosses a box in 24 frames; returns the largest errors of φ near the surface and of the volume, and the ids of its markers before and after.
fn crossed(domain: Domain, resolution: u32, middle: Vec3, way: Vec3) -> ([f64; 2], [Vec<u64>; 2]) {
    let mut liquid = start(domain, resolution, |p| length(sub(p, middle)) - 3.2);
    let ids = |liquid: &Liquid<MarkedSurface>| liquid.surface().markers().ids.clone();
    let before = ids(&liquid);
    liquid.set_velocity(|_| way.map(|way| 0.1 * way), &WEIGHTLESS);
    let mut drift = 0.0_f64;
    let first = volume(&liquid.surface().view(), &domain);
    for _ in 0..24 {
        liquid.step_frame(&WEIGHTLESS, 1.0 / 24.0);
        assert!((largest(&liquid) - 0.1 * f64::from(way[0])).abs() < 1e-4);
        drift = drift.max((volume(&liquid.surface().view(), &domain) / first - 1.0).abs());
    }
    let end = domain.periods().home_point(add(middle, way));
    let mut error = 0.0_f32;
    for cell in CellRows::cuboid(domain.low, domain.high).iter() {
        let exact = length(sub(Site::Centre.of(cell), end)) - 3.2;
        if exact.abs() < 0.8 {
            error = error.max((phi(&liquid, cell) - exact).abs());
        }
    }
    let after = ids(&liquid);
    ([f64::from(error), drift], [before, after])
}

/// A drop that leaves through a corner comes in at the opposite one, and is itself once it has crossed the box.
#[test]
fn a_drop_returns_after_a_period() {
    for (n, resolution) in [(14, 1), (11, 2)] {
        let size = n as f32;
        let (middle, way) = ([4.3, 5.1, 5.4], [size, -size, size]);
        let wide = Domain::closed([0, -n, 0], [2 * n, n, 2 * n]);
        let (reference, _) = crossed(wide, resolution, middle, way);
        let domain = Domain { walls: [REPEATS; 3], ..Domain::closed([0; 3], [n; 3]) };
        let (errors, [before, mut after]) = crossed(domain, resolution, middle, way);
        assert!((0..2).all(|n| errors[n] < 1.2 * reference[n]), "{errors:?} {reference:?}");
        assert!(errors[0] < 0.12 && errors[1] < 0.02, "{errors:?}");
        let all = after.len();
        assert!(all * 10 > before.len() * 9 && all * 10 < before.len() * 11, "{all} {}", before.len());
        after.sort_unstable();
        after.dedup();
        assert_eq!(after.len(), all);
    }
}

/// A ball of 3.2 cells radius whose middle is a cell from a periodic side is cut there at the start, and the cut is a
/// surface like the rest of it as it moves away from the side, or across it.
#[test]
fn a_shape_that_a_periodic_side_cuts_keeps_its_volume() {
    for (axis, resolution, way) in [(0, 1, 6.0), (1, 1, -5.0), (2, 2, 6.0), (0, 1, -5.0)] {
        let (mut walls, mut middle, mut along) = ([SHUT; 3], [6.0; 3], [0.0; 3]);
        (walls[axis], middle[axis], along[axis]) = (REPEATS, 1.0, 0.1 * way);
        let domain = Domain { walls, ..Domain::closed([0; 3], [12; 3]) };
        let mut liquid = start(domain, resolution, |p| length(sub(p, middle)) - 3.2);
        liquid.set_velocity(|_| along, &WEIGHTLESS);
        // A cap of height h of a ball of radius R: πh²(3R − h)/3.
        let (radius, height) = (3.2_f64, 4.2);
        let exact = std::f64::consts::PI * height * height * (3.0 * radius - height) / 3.0;
        for frame in 0..=24 {
            let volume = volume(&liquid.surface().view(), &domain);
            assert!((volume / exact - 1.0).abs() < 0.03, "{axis} {way} {frame}: {volume} {exact}");
            liquid.step_frame(&WEIGHTLESS, 1.0 / 24.0);
        }
        // The middle of the cut, which was beside the side.
        let mut cut = middle;
        cut[axis] = f32::rem_euclid(way * 25.0 / 24.0, 12.0);
        let markers = &liquid.surface().markers().markers;
        let size = resolution as f32;
        let is_near = |marker: &&crate::markers::Marker| length(sub(scale(marker.point, 1.0 / size), cut)) < 0.8;
        let near: Vec<_> = markers.iter().filter(is_near).collect();
        assert!(near.len() >= 2, "{axis} {way}: {} markers", near.len());
        assert!(near.iter().all(|marker| marker.normal[axis] < -0.99), "{axis} {way}: {near:?}");
    }
}

/// Where a box begins does not matter, nor whether one is two: the flow is the same in all, thin and thick, with an odd
/// number of cells too.
#[test]
fn a_box_may_begin_anywhere_and_be_two() {
    let run = |size: Cell, shift: Vec3, viscosity: f64| {
        let domain = Domain { walls: [REPEATS, SHUT, REPEATS], ..Domain::closed([0; 3], size) };
        let settings = LiquidSettings { tolerance: 1e-7, ..LiquidSettings::new(domain, 0.1) };
        // A pool with a hill on it, the period 13 by 10 cells.
        let hill = move |p: Vec3| {
            let near = |axis: usize, period: f32| {
                let away = (p[axis] - shift[axis]).rem_euclid(period);
                away.min(period - away)
            };
            let [x, z] = [near(0, 13.0), near(2, 10.0)];
            (p[1] - 3.4).min(length([x, p[1] - 3.4, z]) - 3.6)
        };
        let mut liquid = Liquid::new(settings, Still::new(domain, hill));
        let viscosity = |_| viscosity;
        let gravity = |_| [3.0, -9.81, 1.0];
        let around = Surroundings { viscosity: &viscosity, gravity: &gravity, ..WEIGHTLESS };
        for _ in 0..2 {
            let report = liquid.step_frame(&around, 1.0 / 48.0);
            assert_eq!(report.solves_cut_short, 0, "{report:?}");
        }
        liquid
    };
    for viscosity in [0.0, 300.0] {
        let first = run([13, 8, 10], [6.0, 0.0, 5.0], viscosity);
        let shifted = run([13, 8, 10], [1.0, 0.0, 9.0], viscosity);
        let doubled = run([26, 8, 10], [6.0, 0.0, 5.0], viscosity);
        let speed = |liquid: &Liquid<Still>, cell: Cell, axis: usize| {
            let motion = liquid.motion();
            motion.rows().find(cell).map_or(0.0, |at| motion.velocity().faces()[axis][at])
        };
        let fastest = largest(&first) as f32;
        assert!(fastest > 0.05);
        for (at, cell) in first.motion().rows().iter().enumerate() {
            if !first.settings.domain.contains(cell) {
                continue;
            }
            let moved = [(cell[0] + 8) % 13, cell[1], (cell[2] + 4) % 10];
            for axis in (0..3).filter(|axis| first.motion().known[at] >> axis & 1 == 1) {
                let own = speed(&first, cell, axis);
                for other in [speed(&shifted, moved, axis), speed(&doubled, cell, axis)] {
                    assert!((own - other).abs() < 1e-3 * fastest, "{viscosity} {cell:?} {axis}: {own} {other}");
                }
            }
        }
    }
}
