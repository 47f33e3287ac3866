//! Cages around surfaces that cannot be filled, and around some that can.

use super::super::{Cage, CagedSurface, PolygonSurface, ShellSide, SurfaceFault};
use super::slivers::knot;
use super::{Mesh, ball, block, joined};
use crate::embedding::embed;
use numerics::shapes;
use numerics::vector::{DVec3, to_f64};
use std::f64::consts::{FRAC_PI_3, PI, TAU};

fn try_cage(mesh: &Mesh, spacing: f64) -> Result<Cage, SurfaceFault> {
    let starts = mesh.starts();
    let surface = PolygonSurface { starts: &starts, corners: &mesh.corners, points: &mesh.points };
    CagedSurface::of(surface, spacing, true).map(|caged| caged.fill())
}

/// A cage with the properties of every cage.
fn cage(mesh: &Mesh, spacing: f64) -> Cage {
    let cage = try_cage(mesh, spacing).unwrap();
    let solid = &cage.tets;
    assert_eq!((solid.tets.len(), solid.bodies.len()), (cage.fill.len(), solid.slivers.len()));
    assert!(cage.fill.iter().all(|fill| (0.0625..=1.0).contains(fill)));
    assert!(solid.slivers.iter().all(|sliver| !*sliver) && solid.tets.iter().all(|tet| volume(&cage, tet) > 0.0));
    // Congruent tets: 60° and 90°, 3 × inradius ÷ circumradius = 3⁄√10.
    assert!((solid.measured.min_dihedral - FRAC_PI_3).abs() < 1e-4, "{}", solid.measured.min_dihedral);
    assert!((solid.measured.quality_median - 3.0 / 10.0_f64.sqrt()).abs() < 1e-4);
    let mut used: Vec<u32> = mesh.corners.clone();
    used.sort_unstable();
    used.dedup();
    let points: Vec<[f32; 3]> = used.iter().map(|point| mesh.points[*point as usize]).collect();
    let size = points.as_flattened().iter().fold(0.0_f32, |size, x| size.max(x.abs()));
    let positions: Vec<[f64; 3]> = solid.points.iter().map(|p| p.map(f64::from)).collect();
    for (bound, at) in embed(&solid.points, &solid.tets, &points).unwrap().iter().zip(&points) {
        assert!(bound.weights.iter().all(|weight| *weight > -1e-4), "{at:?} is outside: {bound:?}");
        let back = bound.position(&positions);
        assert!((0..3).all(|k| (back[k] - f64::from(at[k])).abs() < 1e-6 * f64::from(size)));
    }
    cage
}

fn volume(cage: &Cage, tet: &[u32; 4]) -> f64 {
    let [a, b, c, d] = tet.map(|corner| to_f64(cage.tets.points[corner as usize]));
    (b - a).dot(&(c - a).cross(&(d - a))) / 6.0
}

/// The filled volume, apart from the least share of empty tets.
fn filled(cage: &Cage) -> f64 {
    let share = |fill: &f32| if *fill > 0.0625 { f64::from(*fill) } else { 0.0 };
    cage.tets.tets.iter().zip(&cage.fill).map(|(tet, fill)| volume(cage, tet) * share(fill)).sum()
}

fn turned(mesh: &Mesh) -> Mesh {
    let mut turned = mesh.clone();
    for run in mesh.starts().windows(2) {
        turned.corners[run[0] as usize..run[1] as usize].reverse();
    }
    turned
}

/// A block of n × n quads a side without its lower side.
fn open_box(n: usize) -> Mesh {
    let whole = Mesh::of(shapes::block([1.0; 3], [n; 3]));
    let mut open = Mesh { points: whole.points.clone(), ..Mesh::default() };
    for run in whole.starts().windows(2) {
        let corners = &whole.corners[run[0] as usize..run[1] as usize];
        if !corners.iter().all(|corner| whole.points[*corner as usize][1] < -0.49) {
            open.face(corners);
        }
    }
    open
}

/// A strip with half a twist of n quads, joined to a box along edges that then have three faces.
pub(crate) fn strip_on_a_box(n: u32) -> Mesh {
    let mut mesh = block([0.2; 3], [-0.1; 3]);
    let first = mesh.points.len() as u32;
    for k in 0..n {
        let turn = TAU * f64::from(k) / f64::from(n);
        let (out, up) = (libm::cos(0.5 * turn), libm::sin(0.5 * turn));
        for half in [-0.1, 0.1] {
            let along =
                DVec3::new(0.4 - libm::cos(turn) * (0.3 + half * out), half * up, libm::sin(turn) * (0.3 + half * out));
            mesh.points.push([along.x as f32, along.y as f32, along.z as f32]);
        }
    }
    for k in 0..n - 1 {
        let at = first + 2 * k;
        mesh.face(&[at, at + 1, at + 3, at + 2]);
    }
    // The last quad joins the strip's ends, turned.
    let last = first + 2 * (n - 1);
    mesh.face(&[last, last + 1, first, first + 1]);
    // A fin: a triangle on an edge of the box.
    mesh.points.push([0.0, 0.4, 0.0]);
    mesh.face(&[0, 1, mesh.points.len() as u32 - 1]);
    mesh
}

#[test]
fn a_ball_is_filled_to_its_volume() {
    for (spacing, error) in [(0.2, 0.05), (0.1, 0.015), (0.05, 0.004)] {
        let cage = cage(&ball(16, 0.5), spacing);
        assert_eq!(cage.bodies, 1);
        assert!(cage.tets.measured.volume_error < error, "{spacing}: {}", cage.tets.measured.volume_error);
        assert!((filled(&cage) / (PI / 6.0) - 1.0).abs() < error + 0.02, "{spacing}: {}", filled(&cage));
        assert!(cage.tets.tets.iter().zip(&cage.fill).any(|(_, fill)| *fill == 1.0));
        let surface = |side: ShellSide| cage.tets.sides.iter().filter(|own| **own == side).count();
        assert!(surface(ShellSide::Outer) > 0 && surface(ShellSide::Interior) > 0 && surface(ShellSide::Inner) == 0);
    }
}

#[test]
fn a_surface_that_faces_inwards_gives_the_same_cage() {
    let knot = Mesh::of_triangles(&knot(60, 8));
    let (one, other) = (cage(&knot, 0.02), cage(&turned(&knot), 0.02));
    assert_eq!(one.tets.tets, other.tets.tets);
    let differs = |(a, b): (&f32, &f32)| (a - b).abs() > 1e-4;
    assert!(!one.fill.iter().zip(&other.fill).any(differs), "corners in another order round otherwise");
    // The tube has twice the radius of an edge of the tets, then four times: the error is of second order.
    let [coarse, fine] = [&one, &cage(&knot, 0.01)].map(|cage| cage.tets.measured.volume_error);
    assert!(coarse < 0.04 && fine < 0.4 * coarse, "{coarse} {fine}");
}

#[test]
fn a_wall_that_faces_its_cavity_keeps_it_open() {
    let hollow = joined(&[ball(12, 1.0), turned(&ball(8, 0.6))]);
    let cage = cage(&hollow, 0.12);
    assert!(cage.tets.measured.volume_error < 0.01, "{}", cage.tets.measured.volume_error);
    let radius = |point: usize| to_f64(cage.tets.points[point]).norm();
    for (point, side) in cage.tets.sides.iter().enumerate() {
        match side {
            ShellSide::Inner => assert!(radius(point) < 0.6),
            ShellSide::Outer => assert!(radius(point) > 0.95),
            ShellSide::Interior => assert!(radius(point) < 1.05),
        }
    }
    assert!(cage.tets.sides.contains(&ShellSide::Inner));
}

#[test]
fn crossing_boxes_are_one_body_of_their_union() {
    let cross = joined(&[block([1.0; 3], [0.0; 3]), block([1.0; 3], [0.5; 3])]);
    let cage = cage(&cross, 0.06);
    assert_eq!((cage.bodies, cage.tets.measured.volume_error), (1, 0.0));
    assert!((filled(&cage) / 1.875 - 1.0).abs() < 0.01, "{}", filled(&cage));
}

#[test]
fn separate_pieces_are_separate_bodies() {
    let two = joined(&[ball(6, 0.5), ball(6, 0.5).moved([3.0, 0.0, 0.0])]);
    let cage = cage(&two, 0.15);
    assert_eq!(cage.bodies, 2);
    for (tet, body) in cage.tets.tets.iter().zip(&cage.tets.bodies) {
        assert_eq!(*body == 0, cage.tets.points[tet[0] as usize][0] < 1.5);
    }
}

/// Tets have edges of up to 1.083 `spacing`, and those of both parts are joined if they share a point: never where
/// the gap is wider than two, and here always where it is as wide as one.
#[test]
fn parts_are_joined_across_one_spacing_and_never_across_more_than_two_tets() {
    let spacing = 0.1;
    for k in 0..12 {
        let other = [0.2 + 0.031 * k as f32, 0.3, 0.25 + 0.017 * k as f32];
        let bodies = |gap: f64| {
            let gap = (gap * spacing) as f32;
            let two = joined(&[block([0.3, 0.4, 0.3], [-0.3, 0.0, 0.0]), block(other, [gap, 0.0, 0.0])]);
            cage(&two, spacing).bodies
        };
        assert_eq!([1.0, 2.17].map(bodies), [1, 2], "{k}");
    }
}

#[test]
fn a_box_without_a_bottom_counts_as_closed_near_its_rim() {
    let cage = cage(&open_box(10), 0.07);
    assert_eq!(cage.bodies, 1);
    // The hole is planar: beyond it more than half of the directions are open.
    assert!((filled(&cage) - 1.0).abs() < 0.05, "{}", filled(&cage));
    let lowest = cage.tets.points.iter().map(|p| p[1]).fold(f32::INFINITY, f32::min);
    assert!(lowest > -0.65, "{lowest}");
}

#[test]
fn sheets_and_edges_with_three_faces_have_a_cage_that_holds_them() {
    let mesh = strip_on_a_box(24);
    let cage = cage(&mesh, 0.05);
    assert_eq!(cage.bodies, 1);
    let sheet = shapes::grid([1.0; 2], 6);
    let cage = self::cage(&Mesh::of(sheet), 0.2);
    assert!(cage.fill.iter().all(|fill| *fill <= 0.5) && cage.bodies == 1);
}

#[test]
fn powers_of_two_and_threads_change_no_bit() {
    let knot = knot(60, 8);
    let with = |threads: usize, scale: f32| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let cage = pool.install(|| cage(&knot.scaled(scale), 0.02 * f64::from(scale)));
        (
            cage.tets.tets,
            cage.fill,
            cage.tets.bodies,
            cage.tets.points.iter().map(|p| p.map(|x| x / scale)).collect::<Vec<_>>(),
        )
    };
    let one = with(1, 1.0);
    assert!(one == with(2, 1.0) && one == with(7, 1.0));
    assert!(one == with(2, 1024.0) && one == with(2, 1.0 / 1024.0));
}

#[test]
fn extremes_are_caged_or_refused() {
    assert_eq!(try_cage(&Mesh::default(), 0.1).unwrap().tets.tets.len(), 0);
    let mut point = Mesh { points: vec![[1.0; 3]; 3], ..Mesh::default() };
    point.face(&[0, 1, 2]);
    assert_eq!(try_cage(&point, 0.0).unwrap().tets.tets.len(), 0, "a face without a size has no cage");
    let mut triangle = Mesh { points: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], ..Mesh::default() };
    triangle.face(&[0, 1, 2]);
    assert_eq!(cage(&triangle, 0.0).bodies, 1);
    for scale in [1e-30, 1e30] {
        assert_eq!(try_cage(&triangle.scaled(scale), 0.0).unwrap().bodies, 1);
    }
    let fine = try_cage(&triangle, 1e-9).unwrap_err();
    assert!(matches!(fine, SurfaceFault::TooManyPoints { .. }), "{fine}");
    triangle.points[1][0] = f32::NAN;
    assert_eq!(try_cage(&triangle, 0.0).unwrap_err(), SurfaceFault::NotFinite { point: 1 });
    // Half a metre at 10⁷ m, where positions are a metre apart.
    let _ = try_cage(&ball(4, 0.5).moved([1e7, 0.0, 0.0]), 0.0).unwrap();
}
