//! How triangles of a skin have deformed since rest, sixteen side by side.

use super::binding::RestTriangle;
use numerics::lanes::{F64x16, LANES, get_f64, set_f64};
use numerics::simd::kernel;
use numerics::vector::{DVec3, to_f64};

/// A gradient times an area: three columns, one after another.
pub(super) type Columns = [f64; 9];

/// Up to sixteen triangles at rest, one a lane; the last one is repeated on lanes without one.
#[derive(Clone, Debug)]
pub(super) struct TriangleLanes {
    points: [[u32; LANES]; 3],
    gradients: [[F64x16; 3]; 2],
    normal: [F64x16; 3],
}

impl TriangleLanes {
    /// `triangles`: at least one; those after the sixteenth are not read.
    pub(super) fn new(triangles: &[RestTriangle]) -> Self {
        let of = |lane: usize| &triangles[lane.min(triangles.len() - 1)];
        let vectors = |of: &dyn Fn(usize) -> DVec3| [0, 1, 2].map(|axis| F64x16::from_fn(|lane| of(lane)[axis]));
        Self {
            points: [0, 1, 2].map(|corner| std::array::from_fn(|lane| of(lane).points[corner])),
            gradients: [0, 1].map(|side| vectors(&|lane| of(lane).gradients[side])),
            normal: vectors(&|lane| of(lane).normal),
        }
    }
}

kernel! {
    /// The rest area of each triangle times the gradient of its deformation, given the skin's current points `now`. In
    /// the plane it is that of the corners; along the normal it takes normal to normal, scaled by the root of the ratio
    /// of areas, so that uniform scale changes no rotation.
    ///
    /// # Panics
    /// If a corner is out of range.
    pub(super) fn deformations(triangles: &TriangleLanes, now: &[[f32; 3]]) -> [Columns; LANES] = deform;
}

#[inline(always)]
fn deform(triangles: &TriangleLanes, now: &[[f32; 3]]) -> [Columns; LANES] {
    let [first, second, third] = &triangles.points;
    let [mut ab, mut ac, mut off_plane] = [[F64x16::ZERO; 3]; 3];
    for lane in 0..LANES {
        let a = to_f64(now[first[lane] as usize]);
        set_f64(&mut ab, lane, to_f64(now[second[lane] as usize]) - a);
        set_f64(&mut ac, lane, to_f64(now[third[lane] as usize]) - a);
    }
    for lane in 0..LANES {
        let twice_area = get_f64(&ab, lane).cross(&get_f64(&ac, lane));
        let root = twice_area.dot(&twice_area).sqrt().sqrt();
        set_f64(&mut off_plane, lane, twice_area * if root > 0.0 { 1.0 / root } else { 0.0 });
    }
    let [second, third] = &triangles.gradients;
    let mut columns = [F64x16::ZERO; 9];
    for column in 0..3 {
        for row in 0..3 {
            columns[3 * column + row] = F64x16::from_fn(|lane| {
                let in_plane = ab[row].0[lane] * second[column].0[lane] + ac[row].0[lane] * third[column].0[lane];
                off_plane[row].0[lane] * triangles.normal[column].0[lane] + in_plane
            });
        }
    }
    let mut out = [[0.0; 9]; LANES];
    for lane in 0..LANES {
        for entry in 0..9 {
            out[lane][entry] = columns[entry].0[lane];
        }
    }
    out
}
