//! How good tets are.

/// A tet in metres.
pub(super) type Corners = [[f64; 3]; 4];

/// What is measured of a tet.
#[derive(Clone, Copy, Debug)]
pub(super) struct Measure {
    /// m³; negative where rounding to f32 turned it over.
    pub(super) volume: f64,
    /// 3 × radius of the inner sphere ÷ radius of the outer, 1 for a regular tet, 0 for a flat one.
    pub(super) quality: f64,
    /// Largest cosine of an angle between two faces.
    pub(super) sharpest: f64,
}

pub(super) fn measure(corners: &Corners) -> Measure {
    let [a, b, c, d] = corners;
    let (b, c, d) = (sub(b, a), sub(c, a), sub(d, a));
    // Outward normals of the faces across from a, b, c and d, twice the area long.
    let normals = [cross(sub(&d, &b), sub(&c, &b)), cross(c, d), cross(d, b), cross(b, c)];
    let six = dot(b, cross(c, d));
    let areas = normals.map(|n| dot(n, n).sqrt());
    // Outer radius: |b|² c×d + |c|² d×b + |d|² b×c, ÷ 12 V. Inner: 3 V ÷ area.
    let centre = [0, 1, 2].map(|k| dot(b, b) * normals[1][k] + dot(c, c) * normals[2][k] + dot(d, d) * normals[3][k]);
    let outer = dot(centre, centre).sqrt();
    let area: f64 = areas.iter().sum();
    let quality = if area > 0.0 && outer > 0.0 { 6.0 * six * six / (outer * area) } else { 0.0 };
    let mut sharpest = -1.0_f64;
    for i in 0..4 {
        for j in 0..i {
            let cosine = -dot(normals[i], normals[j]) / (areas[i] * areas[j]);
            // A face without area has no angle: 0 it is.
            sharpest = if cosine.is_finite() { sharpest.max(cosine) } else { 1.0 };
        }
    }
    Measure { volume: six / 6.0, quality, sharpest: sharpest.min(1.0) }
}

fn sub(a: &[f64; 3], b: &[f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
