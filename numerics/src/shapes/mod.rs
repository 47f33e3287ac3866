//! Polygonal shapes: boxes and solids of revolution.
//!
//! Every shape is centred on the origin, y up, and all but the icosphere have exactly the bounds asked for. `n` is the
//! number of quads along an edge of a box, and along a quarter turn of anything round, so that even 1 gives a solid; round
//! shapes have vertices on the axes and are exactly mirror symmetric. Promise: solids are closed, every edge belongs to two
//! faces, faces are counter-clockwise seen from outside. Limit: corners of round shapes lie on the true surface, so volume
//! and area are less than the true ones, by a share of order 1 ÷ n²; a size of 0 makes faces without area.

mod boxes;
mod icosphere;
mod lathe;

pub use boxes::{block, grid};
pub use icosphere::icosphere;
pub use lathe::{bowl, capsule, cylinder, sphere, torus};

/// A polygon mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Polygons {
    /// Corners of each face, 3 or 4.
    pub counts: Vec<u32>,
    /// Point of each corner, counter-clockwise from outside.
    pub corners: Vec<u32>,
    /// Positions, metres.
    pub points: Vec<[f64; 3]>,
}

impl Polygons {
    /// The faces as triangles, each face a fan from its first corner.
    pub fn triangles(&self) -> Vec<[u32; 3]> {
        let mut triangles = Vec::new();
        let mut rest = &self.corners[..];
        for count in &self.counts {
            let (face, after) = rest.split_at(*count as usize);
            triangles.extend(face[1..].windows(2).map(|pair| [face[0], pair[0], pair[1]]));
            rest = after;
        }
        triangles
    }

    fn face<const N: usize>(&mut self, corners: [usize; N]) {
        self.counts.push(N as u32);
        self.corners.extend(corners.map(|corner| corner as u32));
    }
}

/// The `k`th of `n` steps along an edge centred on 0: exactly symmetric, with ends at exactly half the size.
fn coordinate(size: f64, k: usize, n: usize) -> f64 {
    let twice = 2 * k;
    if twice < n {
        0.0 - size * ((n - twice) as f64 / (2 * n) as f64)
    } else {
        size * ((twice - n) as f64 / (2 * n) as f64)
    }
}

#[cfg(test)]
mod tests;
