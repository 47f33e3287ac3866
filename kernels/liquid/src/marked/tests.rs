use numerics::vector::{length, sub};
use rayon::ThreadPoolBuilder;

use super::*;
use crate::extract::{Placement, extract};
use crate::step::{Liquid, LiquidSettings, Motion, Surroundings};

const FRAME: f64 = 1.0 / 24.0;

const FALLING: Surroundings<'_> = Surroundings::new(&|_| [0.0, -9.81, 0.0], &|_| 0.0);

fn volume(surface: &MarkedSurface) -> f64 {
    let size = f64::from(surface.resolution());
    extract(surface.level_set().view(), Placement::Projected).volume() / (size * size * size)
}

#[test]
fn a_pool_at_rest_keeps_its_markers_and_its_volume() {
    for resolution in [1, 2] {
        let domain = Domain::closed([0; 3], [10; 3]);
        let settings = LiquidSettings { tolerance: 1e-6, ..LiquidSettings::new(domain, 0.0625) };
        let surface = MarkedSurface::new(domain, resolution, |p| p[1] - 5.3, 0, 1);
        let mut liquid = Liquid::new(settings, surface);
        let (start, full) = (liquid.surface().markers().clone(), volume(liquid.surface()));
        for _ in 0..120 {
            liquid.step_frame(&FALLING, FRAME);
        }
        let now = liquid.surface().markers();
        for (id, point) in now.ids.iter().zip(&now.markers) {
            let Some(first) = start.ids.iter().position(|first| first == id) else { continue };
            assert!(length(sub(point.point, start.markers[first].point)) < 1e-3 * resolution as f32, "{id}");
        }
        let kept = start.ids.iter().filter(|id| now.ids.contains(id)).count();
        assert!(kept == start.ids.len() && kept > 100, "{kept} of {}", start.ids.len());
        let change = volume(liquid.surface()) / full - 1.0;
        assert!(change.abs() < 1e-5, "{resolution}: {change}");
    }
}

/// A ball in a box of 32 cells, under water to its middle, and what is wet of it above has a film.
#[test]
fn a_film_on_a_ball_has_no_holes_and_its_volume() {
    let ball = |p: Vec3| length(sub(p, [16.1, 13.9, 16.0])) - 8.03;
    let domain = Domain::closed([0; 3], [32; 3]);
    for thickness in [0.15_f32, 0.3, 0.6, 0.9, 1.3, 2.0] {
        let mut surface = MarkedSurface::new(domain, 1, |p| ball(p) - thickness, 0, 1);
        surface.meet(&ball);
        let mesh = surface.mesh(Some(&ball));
        let shell = |r: f64| 4.0 / 3.0 * std::f64::consts::PI * r * r * r;
        let film = shell(8.03 + f64::from(thickness)) - shell(8.03);
        let off = (mesh.volume() - film) / (4.0 * std::f64::consts::PI * 8.0 * 8.0);
        assert!(off.abs() < 0.05, "{thickness}: off by {off} cells");
        // Two closed surfaces, neither with a hole.
        assert_eq!(mesh.points.len() as i64 - mesh.quads.len() as i64, 4, "{thickness}");
        for point in &mesh.points {
            let height = ball(*point);
            // Vertices stand out by what quads miss of a ball of 8 cells radius.
            let near = 0.1 + 1.0 / (6.0 * 8.0);
            assert!(height.abs() < near || (height - thickness).abs() < near, "{thickness}: {height}");
        }
    }
}

/// Two lobes that met leave a groove, at whose foot the film is thin and its surface slopes.
#[test]
fn a_groove_in_a_film_on_a_ball_has_no_holes() {
    let ball = |p: Vec3| length(sub(p, [16.1, 13.9, 16.0])) - 8.03;
    let domain = Domain::closed([0; 3], [32; 3]);
    for (foot, slope) in [(0.1_f32, 0.5_f32), (0.3, 0.8), (0.6, 1.2)] {
        let steep = (1.0 + slope * slope).sqrt();
        let film = |p: Vec3| (ball(p) - (foot + slope * (p[2] - 16.2).abs()).min(2.0)) / steep;
        let mut surface = MarkedSurface::new(domain, 1, film, 0, 1);
        surface.meet(&ball);
        let mesh = surface.mesh(Some(&ball));
        assert_eq!(mesh.points.len() as i64 - mesh.quads.len() as i64, 4, "{foot}, {slope}");
    }
}

#[test]
fn a_pool_around_a_ball_ends_at_it() {
    let ball = |p: Vec3| length(sub(p, [16.1, 13.9, 16.0])) - 8.03;
    let domain = Domain::closed([0; 3], [32; 3]);
    let mut surface = MarkedSurface::new(domain, 1, |p| p[1] - 12.3, 0, 1);
    surface.meet(&ball);
    let phi = surface.phi_outside(&ball);
    let mesh = extract(surface.view_of(Some(&phi)), Placement::Projected);
    for point in &mesh.points {
        assert!(ball(*point) > -0.1, "{point:?}: {}", ball(*point));
    }
}

fn dam(resolution: u32) -> Liquid<MarkedSurface> {
    let domain = Domain::closed([0; 3], [24, 16, 6]);
    let block = |p: Vec3| (p[0] - 9.0).max(p[1] - 12.0);
    let surface = MarkedSurface::new(domain, resolution, block, 1, 1);
    Liquid::new(LiquidSettings::new(domain, 1.0 / 24.0), surface)
}

fn go_on(liquid: &mut Liquid<MarkedSurface>, frames: u32) {
    for _ in 0..frames {
        liquid.step_frame(&FALLING, FRAME);
    }
}

/// Bits of the velocity and of all markers.
fn bits(liquid: &Liquid<MarkedSurface>) -> Vec<u32> {
    let markers = &liquid.surface().markers().markers;
    let places = markers.iter().flat_map(|marker| marker.point.into_iter().chain(marker.normal));
    let phi = liquid.surface().level_set().phi().iter().copied();
    let faces = liquid.motion().velocity().faces().iter().flatten().copied();
    phi.chain(faces).chain(places).map(f32::to_bits).collect()
}

#[test]
fn a_dam_breaks_and_keeps_its_volume() {
    for resolution in [1, 2] {
        let mut liquid = dam(resolution);
        let full = volume(liquid.surface());
        go_on(&mut liquid, 8);
        let kept = volume(liquid.surface()) / full;
        assert!((kept - 1.0).abs() < 0.05, "{resolution}: {kept}");
        let reached = liquid.surface().markers().markers.iter().fold(0.0_f32, |most, marker| most.max(marker.point[0]));
        assert!(reached > 15.0 * resolution as f32, "{reached}");
    }
}

#[test]
fn bits_do_not_depend_on_threads() {
    let run = |threads| {
        let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut liquid = dam(2);
            go_on(&mut liquid, 4);
            bits(&liquid)
        })
    };
    let one = run(1);
    assert!(one == run(2) && one == run(7));
}

#[test]
fn a_liquid_saved_and_loaded_goes_on_with_the_same_bits() {
    for resolution in [1, 2] {
        let mut whole = dam(resolution);
        go_on(&mut whole, 3);
        let saved = postcard::to_stdvec(&(whole.surface(), whole.motion())).unwrap();
        let (surface, motion): (MarkedSurface, Motion) = postcard::from_bytes(&saved).unwrap();
        let settings = LiquidSettings::new(Domain::closed([0; 3], [24, 16, 6]), 1.0 / 24.0);
        let mut resumed = Liquid::resume(settings, surface, motion);
        assert!(bits(&whole) == bits(&resumed));
        go_on(&mut whole, 3);
        go_on(&mut resumed, 3);
        assert!(bits(&whole) == bits(&resumed) && whole.surface().markers() == resumed.surface().markers());
    }
}
