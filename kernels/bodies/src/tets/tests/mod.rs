//! Tests of tetrahedralisation, and the exact checks they share.

mod cages;
mod complex;
mod predicates;
mod slivers;
mod solids;
mod surfaces;

use super::grid::GridPoint;
use super::predicates::{in_sphere, orient};
use super::{Delaunay, NONE};
use nalgebra::Vector3;
use numerics::random::Key;
use numerics::shapes;
use numerics::vector::{self, DVec3};

fn at(grid_point: GridPoint) -> DVec3 {
    DVec3::from(grid_point.map(f64::from))
}

/// Random points with coordinates below `side`.
fn random(count: u64, side: i32, seed: u64) -> Vec<GridPoint> {
    let key = Key::new(seed);
    (0..count).map(|k| [0, 1, 2].map(|axis| (key.of(k).of(axis).u64() % side as u64) as i32)).collect()
}

/// Six times the volume of all tets.
fn volume(grid_points: &[GridPoint], tets: &[[u32; 4]]) -> i128 {
    let whole = |corner: u32| Vector3::from(grid_points[corner as usize].map(i128::from));
    let six = |tet: &[u32; 4]| {
        let [a, b, c, d] = tet.map(whole);
        (b - a).dot(&(c - a).cross(&(d - a)))
    };
    tets.iter().map(six).sum()
}

/// Panics unless every tet is positive, neighbours match, and no neighbour's opposite corner is inside a tet's
/// circumsphere: by Delaunay's lemma that makes a Delaunay tetrahedralisation.
fn check(grid_points: &[GridPoint], Delaunay { tets, across, doubled }: &Delaunay) {
    let of = |tet: &[u32; 4]| tet.map(|corner| at(grid_points[corner as usize]));
    for (index, (tet, others)) in tets.iter().zip(across).enumerate() {
        let [a, b, c, d] = of(tet);
        assert!(orient(&a, &b, &c, &d) > 0.0, "tet {index} is flat or inverted");
        for (corner, other) in others.iter().enumerate() {
            if *other == NONE {
                // A hull face: all points are on one side.
                continue;
            }
            let back = across[*other as usize].iter().position(|tet| *tet == index as u32).unwrap();
            let far = tets[*other as usize][back];
            assert!(!tet.contains(&far));
            let shared = |tet: &[u32; 4], but: usize| {
                let mut face: Vec<u32> = (0..4).filter(|k| *k != but).map(|k| tet[k]).collect();
                face.sort_unstable();
                face
            };
            assert_eq!(shared(tet, corner), shared(&tets[*other as usize], back));
            assert!(in_sphere(&a, &b, &c, &d, &at(grid_points[far as usize])) <= 0.0, "face {corner} of tet {index}");
        }
    }
    let mut used = vec![false; grid_points.len()];
    tets.as_flattened().iter().for_each(|corner| used[*corner as usize] = true);
    for [double, of] in doubled {
        assert_eq!(grid_points[*double as usize], grid_points[*of as usize]);
        assert!(!used[*double as usize], "a double has no tet");
        used[*double as usize] = true;
    }
    assert!(tets.is_empty() || used.iter().all(|used| *used), "every place is in a tet or on another");
}

/// Polygons to fill.
#[derive(Clone, Debug, Default)]
struct Mesh {
    counts: Vec<u32>,
    corners: Vec<u32>,
    points: Vec<[f32; 3]>,
}

impl Mesh {
    fn of(shape: shapes::Polygons) -> Self {
        let points = shape.points.iter().map(|point| point.map(|x| x as f32)).collect();
        Self { counts: shape.counts, corners: shape.corners, points }
    }

    /// Fan triangulation of each face.
    fn of_triangles(mesh: &Self) -> Self {
        let mut cut = Self { points: mesh.points.clone(), ..Self::default() };
        for run in mesh.starts().windows(2) {
            let corners = &mesh.corners[run[0] as usize..run[1] as usize];
            corners[1..].windows(2).for_each(|pair| cut.face(&[corners[0], pair[0], pair[1]]));
        }
        cut
    }

    fn starts(&self) -> Vec<u32> {
        let ends = self.counts.iter().scan(0, |end, count| {
            *end += count;
            Some(*end)
        });
        std::iter::once(0).chain(ends).collect()
    }

    fn face(&mut self, corners: &[u32]) {
        self.counts.push(corners.len() as u32);
        self.corners.extend_from_slice(corners);
    }

    /// Ends of each side, lower first, and its face.
    fn sides(&self) -> Vec<([u32; 2], usize)> {
        let starts = self.starts();
        let of_face = |face: usize| {
            let corners = &self.corners[starts[face] as usize..starts[face + 1] as usize];
            let side = move |k: usize| {
                let (a, b) = (corners[k], corners[(k + 1) % corners.len()]);
                ([a.min(b), a.max(b)], face)
            };
            (0..corners.len()).map(side)
        };
        (0..self.counts.len()).flat_map(of_face).collect()
    }

    fn moved(&self, by: [f32; 3]) -> Self {
        let points = self.points.iter().map(|p| vector::add(*p, by)).collect();
        Self { points, ..self.clone() }
    }

    fn scaled(&self, by: f32) -> Self {
        let points = self.points.iter().map(|p| p.map(|x| x * by)).collect();
        Self { points, ..self.clone() }
    }
}

/// A box of six quads.
fn block(size: [f32; 3], low: [f32; 3]) -> Mesh {
    let middle = [0, 1, 2].map(|k| low[k] + 0.5 * size[k]);
    Mesh::of(shapes::block(size.map(f64::from), [1; 3])).moved(middle)
}

/// A box of n × n quads a side, not aligned with the grid.
fn turned_block(n: usize) -> Mesh {
    let mut mesh = Mesh::of(shapes::block([1.0, 0.7, 0.4], [n; 3]));
    for p in &mut mesh.points {
        let [x, y, z] = p.map(f64::from);
        let (x, y) = (0.8 * x - 0.6 * y, 0.6 * x + 0.8 * y);
        let (y, z) = (0.28 * y - 0.96 * z, 0.96 * y + 0.28 * z);
        *p = [x, y, z].map(|x| x as f32);
    }
    mesh
}

/// A ball of quads around the origin, n to a quadrant.
fn ball(n: usize, radius: f64) -> Mesh {
    Mesh::of(shapes::sphere([2.0 * radius; 3], n))
}

fn joined(meshes: &[Mesh]) -> Mesh {
    let mut all = Mesh::default();
    for mesh in meshes {
        let offset = all.points.len() as u32;
        all.counts.extend(&mesh.counts);
        all.corners.extend(mesh.corners.iter().map(|corner| corner + offset));
        all.points.extend(&mesh.points);
    }
    all
}
