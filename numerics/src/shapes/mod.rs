//! Shapes of polygons: boxes, and what a lathe turns.
//!
//! Every shape is centred on the origin in its bounds, y up, and fills the bounds asked for to the last bit. `n` is the
//! number of quads along an edge of a box, and along a quarter turn of anything round, so that even 1 is a solid: round
//! shapes have vertices on both axes and are mirror symmetric to the bit. Promise: solids are closed, every edge
//! between two faces, outward counter-clockwise. Limit: corners of round shapes lie on the true surface, so volume and
//! area are less than its own, by a share of the order of 1 ÷ n²; a size of 0 makes faces without area.

mod boxes;
mod lathe;

pub use boxes::{block, grid};
pub use lathe::{bowl, capsule, cylinder, sphere, torus};

/// Polygons as a mesh takes them.
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
    /// The faces cut into triangles, each from its first corner.
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

/// The `k`th of `n` steps along an edge centred on 0: mirrored to the bit, its ends exactly half the size.
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
