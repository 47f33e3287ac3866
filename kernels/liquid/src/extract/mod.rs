//! The surface φ = 0 as a mesh of quads: dual marching cubes (Nielson 2004) over the centres of cells.
//!
//! A cube between eight centres has one vertex for each loop in which the surface crosses its edges. A face whose two
//! inside corners no edge connects is flipped where both of its cubes would pass it twice (Wenger 2013). A vertex lies at
//! the mean of its crossings, moved onto tricubic φ by one step of Newton's method where its cube has no other, and then
//! off it by as much as quads are chords of it.
//!
//! Promise: for any φ the mesh is closed and manifold (each edge has two quads, each vertex one fan), quads wind
//! counter-clockwise seen from outside, and the bits are the same on any number of threads. Along the ends of the domain
//! the mesh is closed exactly in their planes. Limits: edges sharper than a cell are rounded; φ must be finite.

mod bulge;
mod cubes;
mod place;
mod quads;
mod smooth;
mod table;
#[cfg(test)]
mod tests;
mod thickness;

use numerics::parallel;
use numerics::vector::{Vec3, add, scale, to_f64};
use numerics::volume;

use crate::level_set::PhiView;
use crate::rows::Cell;
use cubes::Cubes;

/// A closed mesh of quads, in cells.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct QuadMesh {
    /// The vertices.
    pub points: Vec<Vec3>,
    /// A unit normal for each vertex, outward.
    pub normals: Vec<Vec3>,
    /// Four vertices each, counter-clockwise seen from outside.
    pub quads: Vec<[u32; 4]>,
}

/// How vertices are placed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Placement {
    /// At the mean of their crossings.
    Mean,
    /// Moved from there onto tricubic φ, and off it by what the quads between them miss.
    Projected,
}

/// The mesh of φ = 0.
///
/// # Panics
/// Where the vertices are more than a `u32` counts.
pub fn extract(view: PhiView<'_>, placement: Placement) -> QuadMesh {
    let (mut mesh, _) = extract_with(view, placement, |_, _| ());
    if placement == Placement::Projected {
        mesh.bulge(&view);
    }
    mesh
}

/// The mesh with vertices on φ = 0, before they [`QuadMesh::bulge`], and what `of` makes of the cells inside and outside that each quad separates.
pub(crate) fn extract_with<T: Send>(
    view: PhiView<'_>,
    placement: Placement,
    of: impl Fn(Cell, Cell) -> T + Sync,
) -> (QuadMesh, Vec<T>) {
    let cubes = Cubes::find(view);
    let project = placement == Placement::Projected;
    let slabs = parallel::map(0..cubes.slabs.len(), |_, slab| {
        (place::vertices(view, &cubes, slab, project), quads::quads(&cubes, slab, &of))
    });
    let (mut mesh, mut all_made) = (QuadMesh::default(), Vec::new());
    let count = slabs.iter().fold([0, 0], |[a, b], (vertices, (quads, _))| [a + vertices.len(), b + quads.len()]);
    mesh.points.reserve_exact(count[0]);
    mesh.normals.reserve_exact(count[0]);
    mesh.quads.reserve_exact(count[1]);
    all_made.reserve_exact(count[1]);
    for (vertices, (quads, made)) in slabs {
        mesh.points.extend(vertices.iter().map(|(point, _)| *point));
        mesh.normals.extend(vertices.iter().map(|(_, normal)| *normal));
        mesh.quads.extend(quads);
        all_made.extend(made);
    }
    (mesh, all_made)
}

/// Terms of a sum that one thread adds up.
const CHUNK: usize = 4096;

impl QuadMesh {
    /// The volume inside, in cells.
    pub fn volume(&self) -> f64 {
        let Some(origin) = self.points.first() else { return 0.0 };
        self.sum(|quad| self.six_volumes(*origin, quad)) / 6.0
    }

    /// Six times the volume of the two tets from a point to the halves of a quad.
    pub(crate) fn six_volumes(&self, from: Vec3, quad: [u32; 4]) -> f64 {
        let [a, b, c, d] = quad.map(|at| self.points[at as usize]);
        volume::six_volumes([from, a, b, c]) + volume::six_volumes([from, a, c, d])
    }

    /// The area, in squares of a cell's side.
    pub fn area(&self) -> f64 {
        self.sum(|quad| self.twice_area(quad)) / 2.0
    }

    /// Twice the area of a quad.
    pub(crate) fn twice_area(&self, quad: [u32; 4]) -> f64 {
        let [a, b, c, d] = quad.map(|at| to_f64(self.points[at as usize]));
        (b - a).cross(&(c - a)).norm() + (c - a).cross(&(d - a)).norm()
    }

    /// The mean of a quad's corners.
    pub(crate) fn middle(&self, quad: [u32; 4]) -> Vec3 {
        scale(quad.iter().fold([0.0; 3], |sum, at| add(sum, self.points[*at as usize])), 0.25)
    }

    fn sum(&self, of: impl Fn([u32; 4]) -> f64 + Sync) -> f64 {
        let of_chunk = |quads: &[[u32; 4]]| quads.iter().fold(0.0, |sum, quad| sum + of(*quad));
        let sums = parallel::map(self.quads.chunks(CHUNK), |_, quads| of_chunk(quads));
        sums.iter().fold(0.0, |sum, part| sum + part)
    }

    /// The points in metres, of a lattice whose cell [0, 0, 0] starts at `origin`.
    pub fn points_at(&self, origin: [f64; 3], cell: f64) -> Vec<Vec3> {
        let place = |point: &Vec3| std::array::from_fn(|axis| (origin[axis] + cell * f64::from(point[axis])) as f32);
        parallel::tabulate(self.points.len(), CHUNK, |n| place(&self.points[n]))
    }
}
