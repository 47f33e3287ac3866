use std::f32::consts::TAU;

use rayon::ThreadPoolBuilder;

use super::*;
use crate::marked::MarkedSurface;
use crate::rows::{Cell, CellRows};
use crate::step::{Liquid, LiquidSettings, LiquidSource, SourceShape, Surroundings};
use crate::velocity::{MacVelocity, Site};
use numerics::vector::{length, sub};

const FRAME: f64 = 1.0 / 24.0;
const STILL: Surroundings<'_> = Surroundings::new(&|_| [0.0; 3], &|_| 0.0);
const FALLING: Surroundings<'_> = Surroundings::new(&|_| [0.0, -9.81, 0.0], &|_| 0.0);

fn honey() -> LiquidMaterial {
    LiquidMaterial { viscosity: Some(10.0), density: Some(1400.0), phase: 1 }
}

fn marked(domain: Domain, distance: impl Fn(Vec3) -> f32 + Sync) -> MarkedSurface {
    MarkedSurface::new(domain, 1, distance, 0, 1)
}

/// A velocity on all faces of a domain, in cells a substep.
fn flow(domain: &Domain, velocity: impl Fn(Vec3) -> Vec3 + Sync) -> MacVelocity {
    let rows = CellRows::cuboid(domain.low, domain.high.map(|x| x + 1));
    let faces = rows.tabulate_each(|cell| [0, 1, 2].map(|axis| velocity(Site::FACES[axis].of(cell))[axis]));
    MacVelocity::new(rows, faces)
}

/// Sixty substeps a turn: to 1e-4 of a cell where the turn's velocity is exact between faces.
#[test]
fn tracers_in_a_turn_end_where_the_turn_puts_them() {
    let domain = Domain::closed([0; 3], [32, 32, 4]);
    let around = |[x, y, _]: Vec3| [-(y - 16.0), x - 16.0, 0.0];
    let velocity = flow(&domain, around);
    let surface = marked(domain, |_| -5.0);
    let start: Vec<Vec3> = (1..14).map(|n| [16.0 + n as f32, 16.0, 0.3 * n as f32]).collect();
    let mut tracers = TracerPoints::new(start.clone());
    let flow = Moving { velocity: &velocity, step: TAU / 60.0, periods: domain.periods(), solid: None };
    for _ in 0..15 {
        tracers.advance(&flow, crate::step::Surface::view(&surface), &domain);
    }
    for (point, start) in tracers.points().iter().zip(&start) {
        let exact = [16.0, start[0], start[2]];
        assert!(length(sub(*point, exact)) < 2e-3 * (start[0] - 16.0), "{point:?} {exact:?}");
    }
}

#[test]
fn tracers_at_rest_and_in_the_air_stay() {
    let domain = Domain::closed([0; 3], [8; 3]);
    let mut liquid = Liquid::new(LiquidSettings::new(domain, 0.1), marked(domain, |p| p[1] - 4.3));
    let start = vec![[1.2, 3.0, 5.0], [4.0, 0.0, 8.0], [2.0, 7.5, 2.0]];
    liquid.set_tracers(start.clone());
    for _ in 0..12 {
        liquid.step_frame(&FALLING, FRAME);
    }
    let tracers = liquid.motion().tracers();
    assert!(tracers.points().iter().zip(&start).all(|(a, b)| length(sub(*a, *b)) < 1e-3), "{tracers:?}");
    assert_eq!(tracers.points()[2], start[2]);
}

#[test]
fn tracers_leave_through_open_walls_alone() {
    let mut domain = Domain::closed([0; 3], [8; 3]);
    domain.walls[0][1] = Wall::Open;
    let velocity = flow(&domain, |_| [1.0, 1.0, 0.0]);
    let surface = marked(domain, |_| -5.0);
    let mut tracers = TracerPoints::new(vec![[7.5, 2.0, 2.0], [2.0, 7.5, 2.0], [1.0, 1.0, 1.0]]);
    for _ in 0..2 {
        tracers.advance(
            &Moving { velocity: &velocity, step: 1.0, periods: domain.periods(), solid: None },
            crate::step::Surface::view(&surface),
            &domain,
        );
    }
    assert_eq!(tracers.numbers(), [1, 2]);
    assert_eq!(tracers.points(), [[4.0, 8.0, 2.0], [3.0, 3.0, 1.0]]);
}

/// In a box that repeats along x, what goes out comes in again, and no material is lost.
#[test]
fn points_come_in_at_the_other_side_of_a_box_that_repeats() {
    let mut domain = Domain::closed([0; 3], [8, 6, 6]);
    domain.walls[0] = [Wall::Periodic; 2];
    let settings = LiquidSettings::new(domain, 0.1);
    let mut liquid = Liquid::new(settings, marked(domain, |_| -5.0));
    liquid.set_velocity(|_| [1.0, 0.0, 0.0], &STILL);
    liquid.set_tracers(vec![[1.0, 2.0, 2.0], [7.5, 3.0, 3.0]]);
    let is_heavy = |p: Vec3| (p[0] - 4.0).abs() < 2.0;
    let heavy = LiquidMaterial { density: Some(2000.0), viscosity: None, phase: 1 };
    liquid.set_materials(|p| if is_heavy(p) { heavy } else { LiquidMaterial::default() });
    // 1.2 m: one and a half times round.
    for _ in 0..12 {
        liquid.step_frame(&STILL, 0.1);
    }
    let exact = [[5.0, 2.0, 2.0], [3.5, 3.0, 3.0]];
    assert!(liquid.motion().tracers().points().iter().zip(exact).all(|(p, exact)| length(sub(*p, exact)) < 0.01));
    let materials = liquid.motion().materials().unwrap();
    let all = || materials.points().iter().zip(materials.materials());
    assert!(all().all(|(p, _)| (0.0..=8.0).contains(&p[0])));
    let right = all().filter(|(p, material)| is_heavy(**p) == (*material != heavy)).count();
    assert!(right as f64 > 0.99 * materials.points().len() as f64, "{right} of {}", materials.points().len());
    let speeds = &liquid.motion().velocity().faces()[0];
    assert!(speeds.iter().all(|u| *u == 0.0 || (u - 1.0).abs() < 1e-3));
}

/// A turning flow draws a square out; each liquid keeps its volume, and nothing in between comes up.
#[test]
fn materials_are_not_mixed() {
    let domain = Domain::closed([0; 3], [24, 24, 3]);
    let surface = marked(domain, |_| -5.0);
    let view = crate::step::Surface::view(&surface);
    let is_honey = |p: Vec3| (p[0] - 8.0).abs() < 4.0 && (p[1] - 12.0).abs() < 4.0;
    let mut materials =
        MaterialPoints::filling(&view, |p| if is_honey(p) { honey() } else { LiquidMaterial::default() });
    // A turn whose rate falls off with the radius, 0 at the walls.
    let velocity = flow(&domain, |[x, y, _]| {
        let (x, y) = (x - 12.0, y - 12.0);
        let rate = (1.0 - (x * x + y * y) / 130.0).max(0.0);
        [-rate * y, rate * x, 0.0]
    });
    let rows = CellRows::cuboid(domain.low, domain.high);
    let level_set = vec![-5.0; rows.len()];
    let mut volumes = Vec::new();
    for _ in 0..60 {
        materials.advance(&Moving { velocity: &velocity, step: 0.1, periods: domain.periods(), solid: None }, &domain);
        let cells = materials.settle(&rows, &level_set, view, &domain, [0.0, 1000.0]);
        volumes.push(cells.density.iter().map(|density| f64::from(density - 1000.0) / 400.0).sum::<f64>());
        let count = materials.points().len();
        assert!(count >= 4 * rows.len() && count <= 15 * rows.len(), "{count}");
    }
    assert!(materials.materials().all(|material| material == honey() || material == LiquidMaterial::default()));
    let exact = 8.0 * 8.0 * 3.0;
    assert!(volumes.iter().all(|volume| (volume / exact - 1.0).abs() < 0.04), "{volumes:?}");
}

#[test]
fn cells_have_the_harmonic_mean_of_viscosities_and_the_mean_of_densities() {
    let domain = Domain::closed([0; 3], [2, 1, 1]);
    let surface = marked(domain, |_| -5.0);
    let view = crate::step::Surface::view(&surface);
    let mut materials = MaterialPoints::filling(&view, |p| match p[0] < 0.5 {
        true => LiquidMaterial { viscosity: Some(1e6), density: Some(3000.0), phase: 1 },
        false => LiquidMaterial::default(),
    });
    let rows = CellRows::cuboid(domain.low, domain.high);
    let cells = materials.settle(&rows, &[-5.0; 2], view, &domain, [2.0, 1000.0]);
    assert!((cells.viscosity[0] - 4.0).abs() < 1e-4 && cells.viscosity[1] == 2.0, "{cells:?}");
    assert_eq!(cells.density, [2000.0, 1000.0]);
    let found = materials.closest_to(&[[0.1, 0.5, 0.5], [1.9, 0.5, 0.5], [-3.0, 0.0, 0.0], [1e30; 3]]);
    let found: Vec<_> = found.iter().map(|material| material.density).collect();
    assert_eq!(found, [Some(3000.0), None, Some(3000.0), None]);
    assert_eq!(MaterialPoints::default().closest_to(&[[0.0; 3]]), [LiquidMaterial::default()]);
}

fn shape<'a>(distance: &'a (dyn Fn(f64, Vec3) -> f32 + Sync)) -> SourceShape<'a> {
    SourceShape { distance, bounds: [[-99; 3] as Cell, [99; 3]] }
}

/// What fills air is the source's; what was there stays as it was.
#[test]
fn a_source_fills_its_shape_with_its_own_material() {
    let domain = Domain::closed([0; 3], [12; 3]);
    let mut liquid = Liquid::new(LiquidSettings::new(domain, 0.1), marked(domain, |p| p[1] - 3.0));
    liquid.set_materials(|_| LiquidMaterial::default());
    let ball = |_: f64, p: Vec3| length(sub(p, [6.0, 4.0, 6.0])) - 3.2;
    let material = |_: f64| honey();
    let sources = [LiquidSource { material: &material, ..LiquidSource::new(shape(&ball), None) }];
    liquid.step_frame(&Surroundings { sources: &sources, ..STILL }, 0.01);
    let materials = liquid.motion().materials().unwrap();
    let all = || materials.points().iter().zip(materials.materials());
    assert!(all().all(|(p, material)| if p[1] > 3.0 { material == honey() } else { material != honey() }));
    let filled = all().filter(|(_, material)| *material == honey()).count() as f64 / 8.0;
    let account = liquid.sources()[0].moved / 0.001;
    assert!((filled / account - 1.0).abs() < 0.15, "{filled} of {account}");
}

/// What comes out of liquid mixes with it, and is as much of the liquid as was given.
#[test]
fn what_is_poured_takes_the_place_of_its_share() {
    let domain = Domain::closed([0; 3], [12; 3]);
    let mut liquid = Liquid::new(LiquidSettings::new(domain, 0.1), marked(domain, |p| p[1] - 6.0));
    liquid.set_materials(|_| LiquidMaterial::default());
    let ball = |_: f64, p: Vec3| length(sub(p, [6.0, 3.0, 6.0])) - 2.5;
    let rate = |from: f64, to: f64| 0.2 * (to - from);
    let brine = LiquidMaterial { density: Some(1200.0), viscosity: None, phase: 1 };
    let material = |_: f64| brine;
    let sources = [LiquidSource { material: &material, ..LiquidSource::new(shape(&ball), Some(&rate)) }];
    let around = Surroundings { sources: &sources, ..FALLING };
    let mut given = 0.0;
    for _ in 0..16 {
        liquid.step_frame(&around, FRAME);
        given += liquid.sources()[0].moved / 0.001;
    }
    let mut cells = vec![[0.0_f64; 2]; 12 * 12 * 12];
    let materials = liquid.motion().materials().unwrap();
    for (point, material) in materials.points().iter().zip(materials.materials()) {
        let [x, y, z] = point.map(|x| (x as usize).min(11));
        cells[x + 12 * (y + 12 * z)][usize::from(material == brine)] += 1.0;
    }
    let new: f64 = cells.iter().map(|[old, new]| new / (old + new).max(1.0)).sum();
    assert!((new / given - 1.0).abs() < 0.1, "{new} of {given}");
}

/// A column of two liquids with tracers that falls into a source.
fn splash(threads: usize, resumed: bool) -> (Vec<u32>, TracerPoints, Vec<Vec3>) {
    let work = || {
        let domain = Domain::closed([0; 3], [14, 10, 4]);
        let settings = LiquidSettings::new(domain, 0.1);
        let mut liquid = Liquid::new(settings.clone(), marked(domain, |p| (p[0] - 5.0).max(p[1] - 8.0)));
        liquid.set_materials(|p| if p[1] < 4.0 { honey() } else { LiquidMaterial::default() });
        liquid.set_tracers((0..40).map(|n| [0.1 * n as f32, 0.2 * n as f32, 0.1 * n as f32]).collect());
        let ball = |_: f64, p: Vec3| length(sub(p, [10.0, 2.0, 2.0])) - 2.0;
        let sources = [LiquidSource::new(shape(&ball), None)];
        for frame in 0..6 {
            liquid.step_frame(&Surroundings { sources: &sources, ..FALLING }, FRAME);
            if resumed && frame == 2 {
                let (surface, motion) = liquid.into_parts();
                liquid = Liquid::resume(settings.clone(), surface, motion);
            }
        }
        let bits = liquid.motion().velocity().faces().iter().flatten().map(|u| u.to_bits()).collect();
        let points = liquid.motion().materials().unwrap().points().to_vec();
        (bits, liquid.motion().tracers().clone(), points)
    };
    ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(work)
}

#[test]
fn bits_do_not_depend_on_threads_nor_on_a_pause() {
    let one = splash(1, false);
    assert!(one == splash(3, false) && one == splash(2, true));
    let moved = one.1.points().iter().enumerate().filter(|(n, p)| (p[0] - 0.1 * *n as f32).abs() > 0.3).count();
    assert!(moved > 10, "{moved}");
}
