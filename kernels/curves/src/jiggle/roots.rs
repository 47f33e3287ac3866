//! Roots on a skin: which face each grew on, and that face's frame as the skin moves.
//!
//! The face is the triangle closest to the root on the rest skin, polygons taken as fans about their first corner. Limit:
//! a frame turns with its face's first edge and normal; how the face stretches is not seen. Metres.

use super::carry::Frame;
use super::closest::{Closest, Point, at, cross, dot, sub};
use rayon::prelude::*;

/// Roots, bound to a rest skin.
#[derive(Clone, Debug)]
pub struct Roots {
    roots: Vec<Root>,
}

#[derive(Clone, Debug)]
struct Root {
    corners: [u32; 3],
    weights: Point,
    /// For a face that has lost its area.
    rest: [Point; 3],
}

impl Roots {
    /// Binds each of `roots` to the polygons `corners[starts[i]..starts[i + 1]]` of `points`; none where no polygon has
    /// an area.
    pub fn bind(starts: &[u32], corners: &[u32], points: &[[f32; 3]], roots: &[[f32; 3]]) -> Option<Self> {
        let fans = starts.windows(2).flat_map(|ends| {
            let face = &corners[ends[0] as usize..ends[1] as usize];
            face.windows(2).skip(1).map(move |edge| [face[0], edge[0], edge[1]])
        });
        let tree = Closest::new(points, fans)?;
        let bound = roots.par_iter().with_min_len(64).map(|root| {
            let found = tree.find(root.map(f64::from));
            let rest = axes(found.corners.map(|k| at(points, k))).expect("the tree leaves out faces without area");
            Root { corners: found.corners, weights: found.weights, rest }
        });
        Some(Self { roots: bound.collect() })
    }

    /// The frame under each root, where the skin's points are now.
    ///
    /// # Panics
    /// Where there are fewer points than in the rest skin.
    pub fn frames(&self, points: &[[f32; 3]]) -> Vec<Frame> {
        let frame = |root: &Root| {
            let triangle = root.corners.map(|k| at(points, k));
            let origin = std::array::from_fn(|k| (0..3).map(|i| root.weights[i] * triangle[i][k]).sum());
            Frame { axes: axes(triangle).unwrap_or(root.rest), origin }
        };
        self.roots.par_iter().with_min_len(512).map(frame).collect()
    }
}

/// Along the first edge, across it, and along the normal; none without area.
fn axes([a, b, c]: [Point; 3]) -> Option<[Point; 3]> {
    let unit = |v: Point| {
        let length = dot(v, v).sqrt();
        (length > 0.0).then(|| v.map(|x| x / length))
    };
    let edge = sub(b, a);
    let normal = unit(cross(edge, sub(c, a)))?;
    let along = unit(edge)?;
    Some([along, cross(normal, along), normal])
}
