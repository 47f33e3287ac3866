//! Which samples of a pixel a triangle, a segment or a ball covers, and their depth.
//!
//! Guarantees: triangles that share an edge leave no sample on it uncovered, as both compute its line from the same two
//! ends in the same order. A thin strand or small ball covers its fraction of each pixel's samples to within one of 16,
//! with a different pattern in each pixel and independently of other strands, so that geometry behind it shows through
//! accordingly. Limit: a segment is straight on the screen, and its nearness is linear along it.

use super::bins::PixelBox;
use super::project::{ScreenDot, ScreenSegment, ScreenTriangle};
use super::{Lanes, SAMPLE_X, SAMPLE_Y, SAMPLES, Shader, Tile, UNCOVERED};
use crate::vector::mix;
use numerics::vector::{Vec3, add, scale};

/// Order in which samples are covered as the fraction grows (Bayer's matrix): the first ones are always far apart.
const RANK: [u32; SAMPLES] = [0, 8, 2, 10, 12, 4, 14, 6, 3, 11, 1, 9, 15, 7, 13, 5];
/// Steps of that order from pixel to pixel, as 32-bit fractions: the plastic number's powers, which fill the unit
/// interval evenly along every line (Roberts, "The unreasonable effectiveness of quasirandom sequences").
const NEXT_COLUMN: u32 = 0xC13F_A9A9;
const NEXT_ROW: u32 = 0x91E1_0DA5;

/// The samples of pixel x, y that are covered by a fraction (0…1) of it.
#[inline(always)]
fn thin_out(depth: &mut Lanes, share: f32, [x, y]: [usize; 2], seed: u32) {
    if share >= 1.0 {
        return;
    }
    let start = seed.wrapping_add(NEXT_COLUMN.wrapping_mul(x as u32)).wrapping_add(NEXT_ROW.wrapping_mul(y as u32));
    let covered = (share * 4_294_967_296.0) as u32;
    for k in 0..SAMPLES {
        if start.wrapping_add(RANK[k] << 28) >= covered {
            depth[k] = UNCOVERED;
        }
    }
}

/// a·x + b·y + c over the picture, in f64 as corners may lie far outside it.
#[derive(Clone, Copy)]
struct Plane {
    a: f64,
    b: f64,
    c: f64,
}

impl Plane {
    /// Twice the area of the triangle p, q, (x, y): positive if they are clockwise on the screen.
    fn edge(p: Vec3, q: Vec3) -> Self {
        let flipped = (q[0], q[1]) < (p[0], p[1]);
        let (p, q) = if flipped { (q, p) } else { (p, q) };
        let [px, py, qx, qy] = [p[0], p[1], q[0], q[1]].map(f64::from);
        let (a, b) = (py - qy, qx - px);
        let plane = Self { a, b, c: -(a * px + b * py) };
        if flipped { plane.scaled(-1.0) } else { plane }
    }

    fn scaled(self, s: f64) -> Self {
        Self { a: self.a * s, b: self.b * s, c: self.c * s }
    }

    fn at(&self, x: f64, y: f64) -> f64 {
        self.a * x + self.b * y + self.c
    }

    /// Values at the samples of a pixel, relative to that at its corner.
    fn offsets(&self) -> Lanes {
        let (a, b) = (self.a as f32, self.b as f32);
        std::array::from_fn(|k| a * SAMPLE_X[k] + b * SAMPLE_Y[k])
    }
}

pub(super) fn triangle<S: Shader>(tile: &mut Tile<S::Color>, triangle: &ScreenTriangle, pixels: PixelBox, shader: &S) {
    let [p, q, r] = triangle.at;
    let area = Plane::edge(p, q).at(f64::from(r[0]), f64::from(r[1]));
    if !(area.abs() > 0.0 && area.is_finite()) {
        return;
    }
    // Positive inside for either orientation of the triangle; a change of sign preserves the bits that neighbours
    // share.
    let edges = [Plane::edge(q, r), Plane::edge(r, p), Plane::edge(p, q)].map(|edge| edge.scaled(area.signum()));
    // Each is 1 at its corner and 0 on the opposite edge.
    let planes = edges.map(|edge| edge.scaled(1.0 / area.abs()));
    let nearness = [0, 1, 2].map(|k| f64::from(triangle.at[k][2]));
    let sum = |part: fn(&Plane) -> f64| (0..3).map(|k| nearness[k] * part(&planes[k])).sum::<f64>();
    let depth_plane = Plane { a: sum(|p| p.a), b: sum(|p| p.b), c: sum(|p| p.c) };

    let offsets = edges.map(|edge| edge.offsets());
    let most = offsets.map(|lanes| lanes.iter().fold(f32::NEG_INFINITY, |most, x| most.max(*x)));
    let depth_offsets = depth_plane.offsets();
    for y in pixels.low[1]..=pixels.high[1] {
        for x in pixels.low[0]..=pixels.high[0] {
            let base = edges.map(|edge| edge.at(x as f64, y as f64) as f32);
            if (0..3).any(|k| base[k] + most[k] < 0.0) {
                continue;
            }
            let near = depth_plane.at(x as f64, y as f64) as f32;
            let mut depth = [UNCOVERED; SAMPLES];
            for k in 0..SAMPLES {
                let inside = (base[0] + offsets[0][k] >= 0.0)
                    & (base[1] + offsets[1][k] >= 0.0)
                    & (base[2] + offsets[2][k] >= 0.0);
                depth[k] = if inside { near + depth_offsets[k] } else { UNCOVERED };
            }
            tile.put([x, y], &depth, |at| {
                // Barycentric weights on the screen times nearness are those in space.
                let weights: Vec3 = std::array::from_fn(|k| {
                    let share = planes[k].at(f64::from(at[0]), f64::from(at[1]));
                    (share.max(0.0) * nearness[k]) as f32
                });
                let total = weights[0] + weights[1] + weights[2];
                let blend = |value: [Vec3; 3]| {
                    let sum = (0..3).fold([0.0; 3], |sum, k| add(sum, scale(value[k], weights[k])));
                    scale(sum, 1.0 / total)
                };
                let corners = &triangle.corners;
                let normal = blend([0, 1, 2].map(|k| corners[k].normal));
                // The winding, not the normal, decides which side is visible: at a silhouette a smooth normal points
                // away.
                let seen = scale(normal, if area > 0.0 { -1.0 } else { 1.0 });
                shader.surface(at, seen, blend([0, 1, 2].map(|k| corners[k].color)))
            });
        }
    }
}

pub(super) fn segment<S: Shader>(tile: &mut Tile<S::Color>, segment: &ScreenSegment, pixels: PixelBox, shader: &S) {
    /// Half a pixel's diagonal: no sample is farther from its middle.
    const REACH: f32 = 0.708;
    let [p, q] = segment.at;
    let [px, py, qx, qy] = [p[0], p[1], q[0], q[1]].map(f64::from);
    let length = ((qx - px) * (qx - px) + (qy - py) * (qy - py)).sqrt();
    // A segment seen end-on is a disc, for which any axis is valid.
    let [ax, ay] = if length > 0.0 { [(qx - px) / length, (qy - py) / length] } else { [1.0, 0.0] };
    let along = Plane { a: ax, b: ay, c: -(ax * px + ay * py) };
    let aside = Plane { a: -ay, b: ax, c: ay * px - ax * py };
    let (along_offsets, aside_offsets) = (along.offsets(), aside.offsets());
    let length = length as f32;
    let per_pixel = if length > 0.0 { 1.0 / length } else { 0.0 };
    let [wide, other] = segment.radius;
    let widest = wide.max(other);
    let [start, end] = [segment.ends[0], segment.ends[1]].map(|flat| if flat { 0.0 } else { widest });
    let widen = (other - wide) * per_pixel;
    let nearer = (q[2] - p[2]) * per_pixel;

    for y in pixels.low[1]..=pixels.high[1] {
        for x in pixels.low[0]..=pixels.high[0] {
            let u = along.at(x as f64, y as f64) as f32;
            let v = aside.at(x as f64, y as f64) as f32;
            let (middle_u, middle_v) = (u + 0.5 * (ax + ay) as f32, v + 0.5 * (ax - ay) as f32);
            if middle_v.abs() > widest + REACH || middle_u < -start - REACH || middle_u > length + end + REACH {
                continue;
            }
            let mut depth = [UNCOVERED; SAMPLES];
            for k in 0..SAMPLES {
                let (u, v) = (u + along_offsets[k], v + aside_offsets[k]);
                let on_axis = if u < 0.0 {
                    0.0
                } else if u > length {
                    length
                } else {
                    u
                };
                let beyond = u - on_axis;
                let radius = wide + widen * on_axis;
                let inside = (beyond * beyond + v * v <= radius * radius) & (u >= -start) & (u <= length + end);
                depth[k] = if inside { p[2] + nearer * on_axis } else { UNCOVERED };
            }
            let share = (middle_u * per_pixel).clamp(0.0, 1.0);
            thin_out(
                &mut depth,
                segment.cover[0] + (segment.cover[1] - segment.cover[0]) * share,
                [x, y],
                segment.seed,
            );
            tile.put([x, y], &depth, |at| {
                let aside = aside.at(f64::from(at[0]), f64::from(at[1])) as f32;
                let radius = wide + widen * share * length;
                shader.strand(mix(segment.color[0], segment.color[1], share), (aside / radius).clamp(-1.0, 1.0), radius)
            });
        }
    }
}

pub(super) fn dot<S: Shader>(tile: &mut Tile<S::Color>, dot: &ScreenDot, pixels: PixelBox, shader: &S) {
    let [cx, cy, near] = dot.at;
    let share = 1.0 / (dot.radius * dot.radius);
    for y in pixels.low[1]..=pixels.high[1] {
        for x in pixels.low[0]..=pixels.high[0] {
            let (left, top) = (x as f32 - cx, y as f32 - cy);
            let mut depth = [UNCOVERED; SAMPLES];
            for k in 0..SAMPLES {
                let (dx, dy) = (left + SAMPLE_X[k], top + SAMPLE_Y[k]);
                let height = 1.0 - (dx * dx + dy * dy) * share;
                depth[k] = if height >= 0.0 { near + dot.bulge * height.max(0.0).sqrt() } else { UNCOVERED };
            }
            thin_out(&mut depth, dot.cover, [x, y], dot.seed);
            tile.put([x, y], &depth, |at| {
                shader.ball([(at[0] - cx) / dot.radius, (cy - at[1]) / dot.radius], dot.color, dot.lit)
            });
        }
    }
}
