//! Quality measures of tets.

use numerics::vector::DVec3;

/// Corners of a tet, metres.
pub(super) type Corners = [DVec3; 4];

/// Measures of a tet.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Measure {
    /// Volume, m³; negative if rounding to f32 inverted the tet.
    pub(super) volume: f64,
    /// 3 × inradius ÷ circumradius: 1 for a regular tet, 0 for a flat one.
    pub(super) quality: f64,
    /// Largest cosine of a dihedral angle.
    pub(super) sharpest: f64,
}

pub(super) fn measure(corners: &Corners) -> Measure {
    let [a, b, c, d] = corners;
    let (b, c, d) = (b - a, c - a, d - a);
    // Outward normals of the faces opposite to a, b, c and d, twice the area long.
    let normals = [(d - b).cross(&(c - b)), c.cross(&d), d.cross(&b), b.cross(&c)];
    let six = b.dot(&normals[1]);
    let areas = normals.map(|n| n.norm());
    // Circumradius: | |b|² c×d + |c|² d×b + |d|² b×c | ÷ 12 V. Inradius: 3 V ÷ area.
    let centre = normals[1] * b.norm_squared() + normals[2] * c.norm_squared() + normals[3] * d.norm_squared();
    let outer = centre.norm();
    let area: f64 = areas.iter().sum();
    let quality = if area > 0.0 && outer > 0.0 { 6.0 * six * six / (outer * area) } else { 0.0 };
    let mut sharpest = -1.0_f64;
    for i in 0..4 {
        for j in 0..i {
            let cosine = -normals[i].dot(&normals[j]) / (areas[i] * areas[j]);
            // A face without area has no angle; it counts as 0.
            sharpest = if cosine.is_finite() { sharpest.max(cosine) } else { 1.0 };
        }
    }
    Measure { volume: six / 6.0, quality, sharpest: sharpest.min(1.0) }
}
