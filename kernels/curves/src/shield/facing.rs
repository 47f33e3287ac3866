//! From where the triangles of a block are all seen from the same side.
//!
//! A triangle adds to a cone's sums where the axis passes through it or where a neighbour faces the other way. So of a block
//! whose triangles and neighbours are all seen from the same side only the one on the axis matters, and beside the axis none.
//! The volumes that triangles span with the tip, whose signs say from which side they are seen, lie between bounds that follow
//! from intervals of their normals; where rounding could change a sign, a block does not count as seen from one side. So
//! leaving its triangles out changes no bit.

use super::edges::Thirds;
use numerics::lanes::{F32x16, LANES, Lanes, get, set};
use numerics::simd::kernel;
use numerics::tree::{Block, Boxes, NONE};
use numerics::vector::{Vec3, add, cross, dot, scale, sub};

/// Rounding of a volume, relative to the product of the largest coordinates along each axis; so much that a triangle with a
/// larger volume and [`BESIDE`] the axis does not seem to contain the axis by rounding alone.
const VOLUME: f32 = 1.0 / (1 << 15) as f32;

/// Relative rounding of bounds of volumes, and of areas.
const BOUND: f32 = 1.0 / (1 << 18) as f32;

/// Rounding of the cross product of two sides, relative to the square of the size of the block.
const NORMAL: f32 = 1.0 / (1 << 20) as f32;

/// Distance from the axis, relative to the largest one along the same of the frame's axes.
const BESIDE: f32 = 0.125;

/// Volumes below this are 0, so that no square of an area vanishes.
const VANISHING: f32 = 1e-15;

/// By how much areas grow at most when the axis is moved aside.
const SHEARED: f32 = 1.001;

/// Bounds of the triangles of a block; by default those of one that is never seen from one side.
#[derive(Clone, Copy, Default)]
pub(super) struct Facing {
    /// The box around them.
    pub(super) box_low: Vec3,
    pub(super) box_high: Vec3,
    /// The box around them and their neighbours.
    low: Vec3,
    high: Vec3,
    /// The normals of both, as long as twice their areas.
    normal_low: Vec3,
    normal_high: Vec3,
    /// Six times the volumes that they span with the centre of the larger box.
    volume_low: f32,
    volume_high: f32,
    /// Twice the largest area.
    area: f32,
}

kernel! { avx512
    /// The bounds of each block.
    pub(super) fn write_facings(blocks: &[Block], thirds: &[Thirds], facings: &mut [Facing]) = write_facings_body;
}

#[inline(always)]
fn write_facings_body(blocks: &[Block], thirds: &[Thirds], facings: &mut [Facing]) {
    for (facing, (block, thirds)) in facings.iter_mut().zip(blocks.iter().zip(thirds)) {
        *facing = Facing::of(block, thirds);
    }
}

impl Facing {
    #[inline(always)]
    fn of(block: &Block, thirds: &Thirds) -> Self {
        let [a, b, c] = &block.corners;
        let boxes = block.boxes();
        let mut facing = Self::default();
        for axis in 0..3 {
            facing.box_low[axis] = least(&boxes.low[axis]);
            facing.box_high[axis] = most(&boxes.high[axis]);
            let [x, y, z] = [&thirds[0][axis], &thirds[1][axis], &thirds[2][axis]];
            facing.low[axis] = least(&boxes.low[axis].least(x).least(y).least(z));
            facing.high[axis] = most(&boxes.high[axis].most(x).most(y).most(z));
        }
        let centre = centre(facing.low, facing.high);
        let mut spread = Spread::none();
        spread.add([a, b, c], &block.triangle, centre);
        spread.add([b, a, &thirds[0]], &block.triangle, centre);
        spread.add([c, b, &thirds[1]], &block.triangle, centre);
        spread.add([a, c, &thirds[2]], &block.triangle, centre);

        let size = size(facing.low, facing.high);
        let rounding = NORMAL * size * size;
        for axis in 0..3 {
            facing.normal_low[axis] = least(&spread.normal_low[axis]) - rounding;
            facing.normal_high[axis] = most(&spread.normal_high[axis]) + rounding;
        }
        facing.volume_low = least(&spread.volume_low) - rounding * size;
        facing.volume_high = most(&spread.volume_high) + rounding * size;
        facing.area = most(&spread.square).sqrt();
        facing
    }
}

#[cfg(test)]
impl Facing {
    /// The same, but never seen from one side.
    pub(super) fn forgotten(&self) -> Self {
        Self { box_low: self.box_low, box_high: self.box_high, ..Self::default() }
    }
}

/// Bounds over triangles, lane by lane.
struct Spread {
    normal_low: Lanes<3>,
    normal_high: Lanes<3>,
    volume_low: F32x16,
    volume_high: F32x16,
    /// Square of twice the largest area.
    square: F32x16,
}

impl Spread {
    #[inline(always)]
    fn none() -> Self {
        let (most, least) = (F32x16::splat(f32::INFINITY), F32x16::splat(f32::NEG_INFINITY));
        Self {
            normal_low: [most; 3],
            normal_high: [least; 3],
            volume_low: most,
            volume_high: least,
            square: F32x16::splat(0.0),
        }
    }

    /// Adds sixteen triangles: those in `triangle`, or one neighbour of each.
    #[inline(always)]
    fn add(&mut self, [a, b, c]: [&Lanes<3>; 3], triangle: &[u32; LANES], centre: Vec3) {
        for lane in 0..LANES {
            let [a, b, c] = [get(a, lane), get(b, lane), get(c, lane)];
            let normal = cross(sub(b, a), sub(c, a));
            let volume = dot(normal, sub(a, centre));
            let square = dot(normal, normal);
            let counts = triangle[lane] != NONE;
            for axis in 0..3 {
                let (low, high) = (self.normal_low[axis].0[lane], self.normal_high[axis].0[lane]);
                self.normal_low[axis].0[lane] = if counts & (normal[axis] < low) { normal[axis] } else { low };
                self.normal_high[axis].0[lane] = if counts & (normal[axis] > high) { normal[axis] } else { high };
            }
            let (low, high, largest) = (self.volume_low.0[lane], self.volume_high.0[lane], self.square.0[lane]);
            self.volume_low.0[lane] = if counts & (volume < low) { volume } else { low };
            self.volume_high.0[lane] = if counts & (volume > high) { volume } else { high };
            self.square.0[lane] = if counts & (square > largest) { square } else { largest };
        }
    }
}

/// Bounds of sixteen blocks, side by side.
pub(super) struct Facings {
    low: Lanes<3>,
    high: Lanes<3>,
    normal_low: Lanes<3>,
    normal_high: Lanes<3>,
    volume_low: F32x16,
    volume_high: F32x16,
    area: F32x16,
}

impl Facings {
    /// Of blocks that are never seen from one side.
    #[inline(always)]
    pub(super) fn unknown() -> Self {
        let zero = F32x16::splat(0.0);
        let zeros = [zero; 3];
        Self {
            low: zeros,
            high: zeros,
            normal_low: zeros,
            normal_high: zeros,
            volume_low: zero,
            volume_high: zero,
            area: zero,
        }
    }

    /// Replaces the bounds of a lane.
    #[inline(always)]
    pub(super) fn set(&mut self, lane: usize, facing: &Facing) {
        set(&mut self.low, lane, facing.low);
        set(&mut self.high, lane, facing.high);
        set(&mut self.normal_low, lane, facing.normal_low);
        set(&mut self.normal_high, lane, facing.normal_high);
        self.volume_low.0[lane] = facing.volume_low;
        self.volume_high.0[lane] = facing.volume_high;
        self.area.0[lane] = facing.area;
    }

    /// Bits for blocks all of whose triangles count and are, like their neighbours, seen from the same side, and for those that
    /// the axis does not meet. The axis runs along the third of the frame's from `tip`, but for `aside` of its length along the
    /// others at most; triangles nearer than `gap` do not count. `boxes` are those of the blocks.
    #[inline(always)]
    pub(super) fn seen_from(&self, boxes: &Boxes, tip: Vec3, gap: f32, aside: f32) -> [u16; 2] {
        let mut masks = [0; 2];
        for lane in 0..LANES {
            let (low, high) = (get(&self.low, lane), get(&self.high, lane));
            let away = sub(centre(low, high), tip);
            let (below, above) = (sub(low, tip), sub(high, tip));
            let mut far = [0.0; 3];
            let (mut least, mut most) = (self.volume_low.0[lane], self.volume_high.0[lane]);
            for axis in 0..3 {
                far[axis] = larger(below[axis].abs(), above[axis].abs());
                let a = self.normal_low[axis].0[lane] * away[axis];
                let b = self.normal_high[axis].0[lane] * away[axis];
                least += if a < b { a } else { b };
                most += if a < b { b } else { a };
            }
            let sum = far[0] + far[1] + far[2];
            let moved = aside * far[2];
            let across = [far[0] + moved, far[1] + moved];
            let area = self.area.0[lane];
            let near = gap * (SHEARED * area + BOUND * sum * size(low, high));
            let error = VOLUME * across[0] * across[1] * far[2] + BOUND * area * sum + near + VANISHING;
            masks[0] |= u16::from((least > error) | (most < -error)) << lane;

            let mut beside = false;
            for axis in 0..2 {
                let room = moved + BESIDE * across[axis];
                beside |= boxes.low[axis].0[lane] - tip[axis] > room;
                beside |= tip[axis] - boxes.high[axis].0[lane] > room;
            }
            masks[1] |= u16::from(beside) << lane;
        }
        masks
    }
}

/// The middle of a box.
#[inline(always)]
fn centre(low: Vec3, high: Vec3) -> Vec3 {
    add(scale(low, 0.5), scale(high, 0.5))
}

/// The sum of the sides of a box.
#[inline(always)]
fn size(low: Vec3, high: Vec3) -> f32 {
    (high[0] - low[0]) + (high[1] - low[1]) + (high[2] - low[2])
}

#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// The least of all lanes. Halves, quarters…: a lane after another would be a chain of sixteen.
#[inline(always)]
fn least(lanes: &F32x16) -> f32 {
    let mut lanes = *lanes;
    let mut width = LANES / 2;
    while width > 0 {
        for lane in 0..width {
            let (a, b) = (lanes.0[lane], lanes.0[lane + width]);
            lanes.0[lane] = if a < b { a } else { b };
        }
        width /= 2;
    }
    lanes.0[0]
}

/// The largest of all lanes.
#[inline(always)]
fn most(lanes: &F32x16) -> f32 {
    let mut lanes = *lanes;
    let mut width = LANES / 2;
    while width > 0 {
        for lane in 0..width {
            lanes.0[lane] = larger(lanes.0[lane], lanes.0[lane + width]);
        }
        width /= 2;
    }
    lanes.0[0]
}

#[cfg(test)]
mod tests {
    use super::super::edges::Edges;
    use super::super::frame::Frame;
    use super::super::views::View;
    use super::super::{Collider, Obstacle, cone};
    use super::*;
    use numerics::random::Key;
    use numerics::shapes;
    use numerics::simd::Path;
    use numerics::vector;

    type Mesh = (Vec<Vec3>, Vec<[u32; 3]>);

    fn sphere(size: [f64; 3]) -> Mesh {
        let mesh = shapes::sphere(size, 24);
        (mesh.points.iter().map(|point| point.map(|x| x as f32)).collect(), mesh.triangles())
    }

    /// In a cube from −1 to 1.
    fn anywhere(key: Key) -> Vec3 {
        [0, 1, 2].map(|axis| 2.0 * key.of(axis).f32() - 1.0)
    }

    fn moved(from: Vec3, by: f32, along: Vec3) -> Vec3 {
        [0, 1, 2].map(|axis| from[axis] + by * along[axis])
    }

    /// Triangles of all sizes and directions, some of them without area.
    fn soup() -> Mesh {
        let key = Key::new(11);
        let corner = |k: u32| {
            let size = [1.0, 0.1, 1e-3, 0.0][(k / 3 % 4) as usize];
            moved(anywhere(key.of(0).of(u64::from(k / 3))), size, anywhere(key.of(1).of(u64::from(k))))
        };
        ((0..1800).map(corner).collect(), (0..600).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect())
    }

    /// Number of blocks that are seen from one side, beside the axis.
    fn left_out(obstacle: &Obstacle, view: &View, slope: f32) -> u32 {
        let edges = obstacle.edges.as_ref().unwrap();
        let of_block = |block: usize| {
            let (mut facings, facing) = (Facings::unknown(), edges.facing(block));
            facings.set(0, facing);
            let boxes = Boxes { low: facing.box_low.map(F32x16::splat), high: facing.box_high.map(F32x16::splat) };
            let [one_sided, beside] = facings.seen_from(&boxes, view.at, view.gap.at(obstacle.size), 3e-5 * slope);
            u32::from(one_sided & beside & 1)
        };
        (0..obstacle.tree.blocks().len()).map(of_block).sum()
    }

    /// What is left out changes no bit, wherever tips lie.
    #[test]
    fn what_is_seen_from_one_side_beside_the_axis_adds_nothing() {
        let key = Key::new(12);
        let [round, flat, thin, small] = [[2.0; 3], [2.0, 0.2, 1.0], [2.0, 2.0, 1e-4], [2e-3, 3e-3, 1e-3]].map(sphere);
        // Blocks of a thin one have triangles of both its sides, and in the soup no triangle has a neighbour.
        let meshes = [(round, true), (flat, true), (small, true), (thin, false), (soup(), false)];
        for (mesh, ((points, triangles), has_sides)) in meshes.into_iter().enumerate() {
            let size = points.iter().map(|point| vector::largest(*point)).fold(0.0, f32::max);
            let frame = Frame::of([0.3, 0.2, -1.0], &points, &[]).unwrap();
            let collider = Collider::of(&points, &triangles);
            let obstacle = Obstacle::of(&frame, &collider, true);
            let mut plain = Obstacle::of(&frame, &collider, true);
            plain.edges = plain.edges.map(Edges::without_facings);
            // At corners, where volumes are 0, and around the mesh.
            let tip = |k: usize| match k % 2 {
                0 => points[k % points.len()],
                _ => moved([0.0; 3], 1.5 * size, anywhere(key.of(k as u64))),
            };
            let mut count = 0;
            for (cone, gap) in [(0.02, 0.0), (0.1, 1e-5), (0.5, 1e-2)] {
                for group in 0..32 {
                    // Tips of every other group are close to each other.
                    let view = |k: usize| {
                        let far = tip(16 * group + k);
                        let at = if group % 2 == 0 { far } else { moved(tip(group), 0.02 * size, far) };
                        let reach = [4.0, 0.2][k % 2];
                        View { at: frame.at(at), gap: frame.gap(&[at], gap * size), reach }
                    };
                    let views: Vec<View> = (0..LANES).map(view).collect();
                    let cover = |obstacle: &Obstacle| {
                        let mut covered = [0.0; LANES];
                        cone::cover(Path::chosen(), std::slice::from_ref(obstacle), &views, cone, &mut covered);
                        covered.map(f32::to_bits)
                    };
                    assert_eq!(cover(&obstacle), cover(&plain), "mesh {mesh}, cone {cone}, group {group}");
                    count += views.iter().map(|view| left_out(&obstacle, view, cone)).sum::<u32>();
                }
            }
            assert_eq!(count > 50_000, has_sides, "mesh {mesh}: {count}");
        }
    }
}
