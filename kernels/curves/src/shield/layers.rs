//! How far layers of surface that lie behind one another in a cone cover it together.
//!
//! Sums over layers count again what lies behind something. By how much that is too much is found on a fixed grid of the
//! cone's disc: sixteen rays from its centre, each of eight parts of equal area. Along a ray the number of layers changes
//! only where it crosses a silhouette edge, so its mean over each part is known. A part is covered by at most 1, with the
//! weight of its nearest layer: the 16th root of the sum of all 16th powers, which is the greatest one, or up to 4.4 % more
//! if two are equal. Where layers do not overlap, the grid adds nothing to the sums. Everything is continuous as edges
//! move, except that one which passes the centre along a ray turns it at once: 1/16 of the disc.

use numerics::lanes::{F32x16, LANES};

/// Parts of a ray.
const PARTS: usize = 8;

/// Cosines and sines of the rays' angles, (k + 0.3) ÷ 16 of a turn: none is level or upright, as edges often are.
const RAYS: [[f32; 2]; LANES] = [
    [0.993_068_46, 0.117_537_394],
    [0.872_496, 0.488_621_23],
    [0.619_093_95, 0.785_316_94],
    [0.271_440_45, 0.962_455_2],
    [-0.117_537_394, 0.993_068_46],
    [-0.488_621_23, 0.872_496],
    [-0.785_316_94, 0.619_093_95],
    [-0.962_455_2, 0.271_440_45],
    [-0.993_068_46, -0.117_537_394],
    [-0.872_496, -0.488_621_23],
    [-0.619_093_95, -0.785_316_94],
    [-0.271_440_45, -0.962_455_2],
    [0.117_537_394, -0.993_068_46],
    [0.488_621_23, -0.872_496],
    [0.785_316_94, -0.619_093_95],
    [0.962_455_2, -0.271_440_45],
];

/// The part of a silhouette edge inside the disc.
#[derive(Clone, Copy)]
pub(super) struct Edge {
    pub(super) from: [f32; 2],
    pub(super) to: [f32; 2],
    /// How the number of layers changes across it, away from the centre: 1 or −1.
    pub(super) change: f32,
    /// How much its layer counts, 0…1.
    pub(super) weight: f32,
}

/// Sums over layers: their number, their weights, and the 16th powers of these.
type Sums<T> = [T; 3];

/// The layers of front faces or of back faces in a cone.
#[derive(Default)]
struct Side {
    at_centre: Sums<f32>,
    edges: Vec<Edge>,
}

/// The layers in a cone, of front and of back faces.
#[derive(Default)]
pub(super) struct Layers([Side; 2]);

impl Layers {
    pub(super) fn clear(&mut self) {
        for side in &mut self.0 {
            side.at_centre = [0.0; 3];
            side.edges.clear();
        }
    }

    /// Adds a layer of this weight at the centre of the disc.
    pub(super) fn add_centre(&mut self, is_front: bool, weight: f32) {
        let side = &mut self.0[usize::from(!is_front)];
        for (sum, term) in side.at_centre.iter_mut().zip(terms(weight)) {
            *sum += term;
        }
    }

    pub(super) fn add_edge(&mut self, is_front: bool, edge: Edge) {
        self.0[usize::from(!is_front)].edges.push(edge);
    }

    /// The share of the disc that front and back faces cover together, given the mean sums of their weights.
    #[inline(always)]
    pub(super) fn covered(&self, means: [f32; 2]) -> f32 {
        let overlap = |side: &Side| side.at_centre[0] > 1.0 || !side.edges.is_empty();
        let larger = |[a, b]: [f32; 2]| if a > b { a } else { b };
        if !self.0.iter().any(overlap) {
            return larger(means);
        }
        // No closures within the loops: they are not compiled for the kernel's path.
        let sides = [self.0[0].parts(), self.0[1].parts()];
        let mut both = F32x16::splat(0.0);
        let (mut too_much, mut alone) = ([F32x16::splat(0.0); 2], [F32x16::splat(0.0); 2]);
        for part in 0..PARTS {
            let mut seen = [F32x16::splat(0.0); 2];
            for side in 0..2 {
                for lane in 0..LANES {
                    let covered = nearest(&sides[side], part, lane);
                    seen[side].0[lane] = covered;
                    alone[side].0[lane] += covered;
                    too_much[side].0[lane] += sides[side][1][part].0[lane] - covered;
                }
            }
            for lane in 0..LANES {
                let (front, back) = (seen[0].0[lane], seen[1].0[lane]);
                both.0[lane] += if front > back { front } else { back };
            }
        }
        let alone = larger([mean(&alone[0]), mean(&alone[1])]);
        larger([means[0] - mean(&too_much[0]), means[1] - mean(&too_much[1])]) + (mean(&both) - alone)
    }
}

/// The share of a part of the disc on a ray that is covered, times the weight of its nearest layer.
#[inline(always)]
fn nearest(sums: &Sums<[F32x16; PARTS]>, part: usize, lane: usize) -> f32 {
    let (count, powers) = (sums[0][part].0[lane], sums[2][part].0[lane]);
    let share = if count < 1.0 { count } else { 1.0 };
    let power = powers / share;
    // Not if either is 0, or rounded to less.
    let root = if power > 0.0 { power.sqrt().sqrt().sqrt().sqrt() } else { 0.0 };
    let root = if root < 1.0 { root } else { 1.0 };
    if share > 0.0 { share * root } else { 0.0 }
}

#[inline(always)]
fn mean(sums: &F32x16) -> f32 {
    sums.0.iter().sum::<f32>() / (LANES * PARTS) as f32
}

#[inline(always)]
fn terms(weight: f32) -> Sums<f32> {
    let square = weight * weight;
    let fourth = square * square;
    let eighth = fourth * fourth;
    [1.0, weight, eighth * eighth]
}

impl Side {
    /// Mean sums over the parts of each ray.
    #[inline(always)]
    fn parts(&self) -> Sums<[F32x16; PARTS]> {
        let [count, weight, powers] = self.at_centre;
        let mut sums = [[F32x16::splat(count); PARTS], [F32x16::splat(weight); PARTS], [F32x16::splat(powers); PARTS]];
        for Edge { from: [ax, ay], to: [bx, by], change, weight } in &self.edges {
            let terms = terms(*weight);
            let (mut square, mut changes) = (F32x16::splat(0.0), F32x16::splat(0.0));
            for lane in 0..LANES {
                let [cosine, sine] = RAYS[lane];
                // Heights over the ray, and places along it.
                let (from, to) = (cosine * ay - sine * ax, cosine * by - sine * bx);
                let (start, end) = (cosine * ax + sine * ay, cosine * bx + sine * by);
                let crosses = (from >= 0.0) != (to >= 0.0);
                let radius = start + (end - start) * (from / (from - to));
                square.0[lane] = PARTS as f32 * radius * radius;
                changes.0[lane] = if crosses & (radius > 0.0) { *change } else { 0.0 };
            }
            for part in 0..PARTS {
                for lane in 0..LANES {
                    let beyond = (part + 1) as f32 - square.0[lane];
                    let beyond = if beyond > 0.0 { beyond } else { 0.0 };
                    let beyond = if beyond < 1.0 { beyond } else { 1.0 };
                    // What does not cross may be anywhere, even nowhere.
                    let change = if changes.0[lane] == 0.0 { 0.0 } else { changes.0[lane] * beyond };
                    for (sum, term) in sums.iter_mut().zip(terms) {
                        sum[part].0[lane] += change * term;
                    }
                }
            }
        }
        sums
    }
}
