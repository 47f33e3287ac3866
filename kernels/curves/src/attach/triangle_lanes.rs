//! How triangles of a skin have deformed since rest, sixteen side by side.

use numerics::lanes::{F32x16, F64x16, LANES, Lanes, get_f64, set, set_f64};
use numerics::simd::{Path, kernel};
use numerics::vector::DVec3;

/// A gradient times an area: three columns, one after another.
pub(super) type Columns = [f64; 9];

/// Up to sixteen triangles around vertices at rest, one a lane; the last one is repeated on lanes without one. The area
/// of each times the gradient of its deformation is linear in the positions of its corners.
#[derive(Clone, Debug)]
pub(super) struct TriangleLanes {
    points: [[u32; LANES]; 3],
    /// Area times the gradients of the weights of the second and third corner.
    gradients: [[F64x16; 3]; 2],
    /// The unit normal times √(area ÷ 2).
    normal: [F64x16; 3],
}

/// The normal of a triangle with the area as its length, and that length.
pub(super) type Area = (DVec3, f64);

impl TriangleLanes {
    /// `corners`: at least one triangle; those after the sixteenth are not read.
    pub(super) fn new(path: Path, points: &[[f32; 3]], corners: &[[u32; 3]]) -> (Self, [Area; LANES]) {
        let mut lanes = [[0; LANES]; 3];
        for lane in 0..LANES {
            let triangle = corners[lane.min(corners.len() - 1)];
            for corner in 0..3 {
                lanes[corner][lane] = triangle[corner];
            }
        }
        at_rest(path, points, &lanes)
    }
}

kernel! {
    /// The triangles whose corners are `corners`, rows of `points`.
    fn at_rest(points: &[[f32; 3]], corners: &[[u32; LANES]; 3]) -> (TriangleLanes, [Area; LANES]) = rest;
}

#[inline(always)]
fn rest(points: &[[f32; 3]], corners: &[[u32; LANES]; 3]) -> (TriangleLanes, [Area; LANES]) {
    let [first, second, third] = corners;
    let (a, b, c) = (gather(first, points), gather(second, points), gather(third, points));
    let (ab, ac, ca) = (between(&a, &b), between(&a, &c), between(&c, &a));
    let zero = [F64x16::ZERO; 3];
    let mut triangles = TriangleLanes { points: *corners, gradients: [zero; 2], normal: zero };
    let mut area_vectors = zero;
    for lane in 0..LANES {
        let (ab, ca) = (get_f64(&ab, lane), get_f64(&ca, lane));
        let twice_area = ab.cross(&get_f64(&ac, lane));
        let unit = direction_or_zero(twice_area);
        set_f64(&mut triangles.gradients[0], lane, unit.cross(&ca) * 0.5);
        set_f64(&mut triangles.gradients[1], lane, unit.cross(&ab) * 0.5);
        let normal = unit * (0.5 * twice_area.norm().sqrt());
        set_f64(&mut triangles.normal, lane, normal);
        set_f64(&mut area_vectors, lane, normal * (2.0 * normal.norm()));
    }
    let area = |lane: usize| {
        let vector = get_f64(&area_vectors, lane);
        (vector, vector.norm())
    };
    (triangles, std::array::from_fn(area))
}

/// [`direction`](numerics::vector::direction) without branches; zero where there is none.
#[inline(always)]
pub(super) fn direction_or_zero(v: DVec3) -> DVec3 {
    let larger = |a: f64, b: f64| if a > b { a } else { b };
    let near_one = v / larger(larger(v.x.abs(), v.y.abs()), v.z.abs());
    // NaN where a component is not finite, or all are 0.
    let length = near_one.norm();
    let unit = near_one / length;
    let defined = length > 0.0;
    let or_zero = |x: f64| if defined { x } else { 0.0 };
    DVec3::new(or_zero(unit.x), or_zero(unit.y), or_zero(unit.z))
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

/// The point of each lane, in f32: converted side by side afterwards.
#[inline(always)]
fn gather(indices: &[u32; LANES], points: &[[f32; 3]]) -> Lanes<3> {
    let mut lanes = [F32x16::splat(0.0); 3];
    for lane in 0..LANES {
        set(&mut lanes, lane, points[indices[lane] as usize]);
    }
    lanes
}

/// b − a, exact if they are close to each other.
#[inline(always)]
fn between(a: &Lanes<3>, b: &Lanes<3>) -> [F64x16; 3] {
    let along = |axis: usize| F64x16::from_fn(|lane| f64::from(b[axis].0[lane]) - f64::from(a[axis].0[lane]));
    [along(0), along(1), along(2)]
}

#[inline(always)]
fn deform(triangles: &TriangleLanes, now: &[[f32; 3]]) -> [Columns; LANES] {
    let [first, second, third] = &triangles.points;
    let (a, b, c) = (gather(first, now), gather(second, now), gather(third, now));
    let (ab, ac) = (between(&a, &b), between(&a, &c));
    let mut off_plane = [F64x16::ZERO; 3];
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
