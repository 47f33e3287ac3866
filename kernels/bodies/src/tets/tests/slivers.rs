//! Removal of slivers.

use super::super::improve::{Improver, Unchanged};
use super::super::{ClosedSurface, FillSettings, PolygonSurface, TetMesh};
use super::solids::asset;
use super::{Mesh, ball, turned_block};
use numerics::random::Key;
use numerics::shapes;
use numerics::vector::{DVec3, Vec3, to_f64};
use std::f64::consts::TAU;

fn closed(mesh: &Mesh) -> ClosedSurface {
    let starts = mesh.starts();
    ClosedSurface::of(&PolygonSurface { starts: &starts, corners: &mesh.corners, points: &mesh.points }, true).unwrap()
}

/// The tets before and after.
fn both(closed: &ClosedSurface, interior: bool) -> [TetMesh; 2] {
    let fill = FillSettings { spacing: 0.0, interior };
    [closed.filled(&fill, |tets| tets.finish()).unwrap(), closed.fill(&fill).unwrap()]
}

/// A tube of n quads around a trefoil knot.
pub(super) fn knot(along: usize, n: usize) -> Mesh {
    let place = |t: f64| {
        let (s, c) = (libm::sin, libm::cos);
        DVec3::new(s(t) + 2.0 * s(2.0 * t), c(t) - 2.0 * c(2.0 * t), -s(3.0 * t)) * 0.1
    };
    let mut mesh = Mesh::default();
    for i in 0..along {
        let t = TAU * i as f64 / along as f64;
        let tangent = (place(t + 1e-4) - place(t - 1e-4)).normalize();
        let side = tangent.cross(&DVec3::new(0.2, 0.1, 1.0)).normalize();
        let up = side.cross(&tangent);
        for j in 0..n {
            let turn = TAU * j as f64 / n as f64;
            let p = place(t) + (side * libm::cos(turn) + up * libm::sin(turn)) * 0.04;
            mesh.points.push([p.x as f32, p.y as f32, p.z as f32]);
        }
    }
    for (i, j) in (0..along).flat_map(|i| (0..n).map(move |j| (i, j))) {
        let at = |i: usize, j: usize| (i % along * n + j % n) as u32;
        mesh.face(&[at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)]);
    }
    mesh
}

/// A thin plate whose edges are rounded.
fn plate() -> Mesh {
    let mut mesh = Mesh::of(shapes::block([0.4, 0.06, 0.3], [24, 6, 18]));
    for p in &mut mesh.points {
        let own = to_f64(*p);
        let core = DVec3::new(own.x.clamp(-0.175, 0.175), own.y.clamp(-0.005, 0.005), own.z.clamp(-0.125, 0.125));
        let rounded = core + (own - core).normalize() * 0.025;
        *p = [rounded.x as f32, rounded.y as f32, rounded.z as f32];
    }
    Mesh::of_triangles(&mesh)
}

/// A lump of uneven triangles.
fn lump() -> Mesh {
    let mut mesh = Mesh::of(shapes::icosphere(0.5, 3));
    let key = Key::new(8);
    for (n, p) in mesh.points.iter_mut().enumerate() {
        let wave = |k: u64| 0.06 * (key.of(n as u64).of(k).f64() - 0.5);
        let stretched = DVec3::new(1.0 + wave(0), 0.6 + wave(1), 0.8 + wave(2)).component_mul(&to_f64(*p));
        *p = [stretched.x as f32, stretched.y as f32, stretched.z as f32];
    }
    mesh
}

fn shapes_to_fill() -> Vec<(&'static str, Mesh)> {
    vec![
        ("ball", ball(8, 0.1)),
        ("torus", Mesh::of(shapes::torus([1.0, 0.3, 1.0], 8))),
        ("knot", knot(120, 12)),
        ("plate", plate()),
        ("lump", lump()),
        ("block", turned_block(6)),
        ("dough", asset(include_str!("../../../../../graphs/assets/blobby_4k_watertight.obj"))),
        ("hand", asset(include_str!("../../../../../graphs/assets/hand.obj"))),
    ]
}

/// Ratio of the volume of a tet to that of a regular one with its longest edge.
fn flatness(solid: &TetMesh, tet: &[u32; 4]) -> f64 {
    let at = tet.map(|corner| to_f64(solid.points[corner as usize]));
    let longest =
        (0..4).flat_map(|i| (0..i).map(move |j| (i, j))).map(|(i, j)| (at[i] - at[j]).norm()).fold(0.0, f64::max);
    (at[1] - at[0]).dot(&(at[2] - at[0]).cross(&(at[3] - at[0]))) * 2.0_f64.sqrt() / (longest * longest * longest)
}

#[test]
fn few_slivers_remain_and_the_surface_and_volume_stay() {
    for (name, mesh) in shapes_to_fill() {
        let closed = closed(&mesh);
        let [before, after] = both(&closed, true);
        let flat = |solid: &TetMesh| {
            solid
                .tets
                .iter()
                .zip(&solid.slivers)
                .filter(|(tet, sliver)| !**sliver && flatness(solid, tet) < 0.02)
                .count()
        };
        println!(
            "{name}: {} → {} tets, {} → {} slivers, {} → {} other flat ones, angle {:.2}° → {:.2}°, quality {:.3} → {:.3}, \
             missing {} {} → {} {}",
            before.tets.len(),
            after.tets.len(),
            before.measured.slivers,
            after.measured.slivers,
            flat(&before),
            flat(&after),
            before.measured.min_dihedral.to_degrees(),
            after.measured.min_dihedral.to_degrees(),
            before.measured.quality_median,
            after.measured.quality_median,
            before.measured.missing_faces,
            before.measured.missing_edges,
            after.measured.missing_faces,
            after.measured.missing_edges,
        );
        assert_eq!(before.points.len(), after.points.len());
        assert_eq!(before.points[..closed.points.len()], after.points[..closed.points.len()], "{name}");
        let [was, is] = [&before, &after].map(|solid| solid.measured);
        assert!(is.missing_faces <= was.missing_faces && is.missing_edges <= was.missing_edges, "{name}");
        assert!((is.volume_error - was.volume_error).abs() < 1e-4, "{name}: {} {}", was.volume_error, is.volume_error);
        assert_eq!(is.bare_points, was.bare_points);
        assert!(is.slivers * 10 <= was.slivers || is.slivers * 1000 <= after.tets.len(), "{name}");
        assert!(is.min_dihedral >= was.min_dihedral, "{name}");
        assert!(5 * flat(&after) <= flat(&before), "{name}: flat tets that are not marked");
    }
}

/// Two unit tets on both sides of a flat one between four inner points: the edges of a square, its diagonals almost
/// crossing.
#[test]
fn a_sliver_between_inner_points_is_flipped_away() {
    let e = 1e-3;
    let mut points: Vec<Vec3> =
        vec![[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [1.0, 0.0, e], [0.0, 1.0, -e], [-1.0, 0.0, e], [0.0, -1.0, -e]];
    // The sliver [2, 3, 4, 5]; tets above on its faces with edge 2–4, below on those with edge 3–5.
    let mut tets = vec![[2, 4, 3, 0], [4, 2, 5, 0], [3, 5, 2, 1], [5, 3, 4, 1], [2, 3, 4, 5]];
    let volume = |points: &[Vec3], tet: &[u32; 4]| {
        let [a, b, c, d] = tet.map(|corner| to_f64(points[corner as usize]));
        (b - a).dot(&(c - a).cross(&(d - a))) / 6.0
    };
    for tet in &mut tets {
        if volume(&points, tet) < 0.0 {
            tet.swap(2, 3);
        }
    }
    let whole: f64 = tets.iter().map(|tet| volume(&points, tet)).sum();
    let surface = Unchanged { points: 6, edges: &[], triangles: &[] };
    let bodies = vec![7; tets.len()];
    let (improved, bodies) = Improver::new(surface, 1.0, &mut points, tets, bodies).run();
    // Four around an edge between opposite points.
    assert_eq!((improved.len(), bodies), (4, vec![7; 4]));
    for tet in &improved {
        assert!((volume(&points, tet) / whole - 0.25).abs() < 1e-3);
    }
}

#[test]
fn nothing_changes_without_poor_tets() {
    let mut points: Vec<Vec3> = vec![[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];
    let (before, tets) = (points.clone(), vec![[0, 2, 1, 3]]);
    let surface = Unchanged { points: 0, edges: &[], triangles: &[] };
    let after = Improver::new(surface, 1.0, &mut points, tets.clone(), vec![0]).run();
    assert_eq!((after, points), ((tets, vec![0]), before));
}

#[test]
fn a_body_without_inner_points_keeps_its_surface() {
    for (name, mesh) in [("torus", Mesh::of(shapes::torus([1.0, 0.3, 1.0], 8))), ("lump", lump())] {
        let closed = closed(&mesh);
        let [before, after] = both(&closed, false);
        let [was, is] = [&before, &after].map(|solid| solid.measured);
        assert!(is.missing_faces <= was.missing_faces && is.missing_edges <= was.missing_edges, "{name}");
        assert!(is.slivers <= was.slivers && (is.volume_error - was.volume_error).abs() < 1e-4, "{name}");
        assert_eq!(is.bare_points, was.bare_points, "{name}");
    }
}
