//! Points on the triangles of a surface.

use numerics::vector::{DVec3, to_f64};

/// A point on a triangle, in barycentric coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Index of the triangle.
    pub triangle: u32,
    /// Weight of each corner: none negative, their sum 1.
    pub weights: [f64; 3],
}

impl SurfacePoint {
    /// The weighted sum of the corners' values.
    pub fn interpolate<const N: usize>(&self, corners: [[f64; N]; 3]) -> [f64; N] {
        let [a, b, c] = self.weights;
        std::array::from_fn(|k| a * corners[0][k] + b * corners[1][k] + c * corners[2][k])
    }

    /// The position of the point on `triangles` of `points`, in metres.
    ///
    /// # Panics
    /// If the triangle or one of its corners is out of range.
    pub fn position(&self, points: &[[f32; 3]], triangles: &[[u32; 3]]) -> DVec3 {
        let [a, b, c] = triangles[self.triangle as usize].map(|corner| to_f64(points[corner as usize]));
        a * self.weights[0] + b * self.weights[1] + c * self.weights[2]
    }
}
