//! Roots lifted to a distance from all faces of the skin, in creases too.
//!
//! A lift off one face of a crease pushes a root into the other. There the shortest move is sought that keeps `offset`
//! from every face: each face found too near adds a half-space, and the shortest move into all of them is a closed form,
//! exact if the faces about a root are flat. Where that move would be too long, the largest offset that a move of
//! the longest length reaches is bisected.

use super::crossing::first_crossing_in;
use super::skin::SkinSurface;
use numerics::vector::{self, DVec3, Vec3, to_f32, to_f64};

/// Number of times that a root is lifted off its nearest face, as the surface may curve below it.
const LIFTS: usize = 4;

/// Longest move out of a crease, in offsets.
const LONGEST: f64 = 4.0;

/// Share of the offset that is enough.
const ENOUGH: f64 = 0.999;

/// Largest number of half-spaces of a crease.
const MOST_FACES: usize = 8;

/// Squared sine, or volume, up to which normals count as parallel.
const PARALLEL: f64 = 1e-10;

/// Rounds of the compass search: a round halves its step or climbs.
const CLIMBS: usize = 12;

/// Least climb, as a share of the height wanted: less may be rounding.
const CLIMB: f64 = 0.01;

/// Halvings of the offset where it cannot be kept.
const HALVINGS: usize = 10;

/// A lifted root.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Lifted {
    /// Its displacement.
    pub(super) shift: DVec3,
    /// Whether a face is nearer than the offset.
    pub(super) low: bool,
}

/// Displacements whose part along the unit vector `normal` is at least the offset less `height`.
#[derive(Clone, Copy)]
struct Face {
    normal: DVec3,
    /// Height of the undisplaced root over the face, metres.
    height: f64,
}

impl SkinSurface<'_> {
    /// Lifts a root to `offset` metres above the skin: not at all if it is that high already.
    #[inline(always)]
    pub(super) fn lift(&self, root: Vec3, offset: f64) -> Lifted {
        let mut shift = DVec3::zeros();
        if offset <= 0.0 {
            return Lifted::default();
        }
        for _ in 0..LIFTS {
            let Some((height, normal)) = self.height(&(to_f64(root) + shift), f32::INFINITY) else { break };
            if height >= offset * ENOUGH {
                return Lifted { shift, low: false };
            }
            shift += normal * (offset - height);
        }
        self.lift_out_of_crease(&to_f64(root), shift, offset)
    }

    /// The lift of a root that lifts off its nearest faces moved by `shift`; this one if it is high enough.
    fn lift_out_of_crease(&self, root: &DVec3, shift: DVec3, offset: f64) -> Lifted {
        let rounding = 5e-7 * (f64::from(vector::largest(to_f32(*root))) + offset);
        let enough = offset * ENOUGH - rounding;
        let height = |at: &DVec3| self.height(at, f32::INFINITY).map(|(height, _)| height);
        let lifted = height(&(root + shift));
        let (Some(lifted), Some(nearest)) = (lifted, self.tree.closest(to_f32(*root), f32::INFINITY)) else {
            return Lifted { shift, low: false };
        };
        if lifted >= enough {
            return Lifted { shift, low: false };
        }
        // A root deep in the skin is moved to its surface first.
        let base = if f64::from(nearest.distance) > offset { to_f64(nearest.point) } else { *root };
        let longest = LONGEST * offset;
        let mut best = (f64::NEG_INFINITY, shift);
        if (root + shift - base).norm() <= longest {
            best = (lifted, shift);
        }
        let (mut faces, mut kept, mut step) = (Vec::with_capacity(MOST_FACES), offset, DVec3::zeros());
        for _ in 0..MOST_FACES {
            let at = base + step;
            let Some((height, face)) = self.face_below(&at, &base, rounding) else { break };
            if height > best.0 {
                best = (height, at - root);
            }
            if height >= kept * ENOUGH - rounding {
                break;
            }
            faces.push(face);
            match shortest(&faces, kept, longest) {
                Some(found) => step = found,
                None => (kept, step) = farthest(&faces, kept, longest),
            }
        }
        if best.0 < enough && best.0 > f64::NEG_INFINITY {
            best = self.climbed(root, &(base - root), best, enough, longest);
        }
        Lifted { shift: best.1, low: best.0 < enough }
    }

    /// A greater height than `best`, a height and the displacement from `root` that has it, by compass search within
    /// `longest` about `centre`: for ends of creases, where faces are no half-spaces. It does not pass through the skin.
    fn climbed(&self, root: &DVec3, centre: &DVec3, mut best: (f64, DVec3), enough: f64, longest: f64) -> (f64, DVec3) {
        let mut step = longest;
        for _ in 0..CLIMBS {
            let from = best.1;
            for side in 0..27 {
                let side = [side % 3, side / 3 % 3, side / 9].map(|x| f64::from(x) - 1.0);
                let to = from + DVec3::from(side).try_normalize(0.0).unwrap_or_default() * step - centre;
                let to = centre + to * (longest / to.norm().max(longest));
                let Some((height, _)) = self.height(&(root + to), f32::INFINITY) else { continue };
                let ends = [from, to].map(|shift| to_f32(root + shift));
                if height > best.0 + CLIMB * enough && first_crossing_in(&[self.tree], ends[0], ends[1]).is_none() {
                    best = (height, to);
                }
            }
            if best.0 >= enough {
                break;
            }
            if best.1 == from {
                step *= 0.5;
            }
        }
        best
    }

    /// Height of a point above the skin, and the half-space of its nearest face seen from `base`.
    fn face_below(&self, p: &DVec3, base: &DVec3, rounding: f64) -> Option<(f64, Face)> {
        let nearest = self.tree.closest(to_f32(*p), f32::INFINITY)?;
        let smooth = self.normal(&nearest)?;
        let at = to_f64(nearest.point);
        let away = p - at;
        let height = away.norm().copysign(away.dot(&smooth));
        // On a face and inside it its own normal is the more accurate one; off edges and corners only the direction to the
        // point is defined.
        let on_face = height.abs() <= 2.0 * rounding || nearest.weights.iter().all(|weight| *weight > 1e-4);
        let flat = on_face.then(|| self.corners(&nearest)).flatten();
        let flat = flat.and_then(|[a, b, c]| (b - a).cross(&(c - a)).try_normalize(0.0));
        let normal = flat.or_else(|| (away * height.signum()).try_normalize(rounding)).unwrap_or(smooth);
        Some((height, Face { normal, height: normal.dot(&(base - at)) }))
    }
}

/// The shortest displacement that keeps `offset` from all faces, if it is no longer than `longest`.
///
/// It is a sum of at most three normals with factors that are not negative (Karush, Kuhn and Tucker), and no other sum of
/// that form keeps the offset.
fn shortest(faces: &[Face], offset: f64, longest: f64) -> Option<DVec3> {
    let margin = 1e-9 * (offset.abs() + longest);
    let keeps = |step: &DVec3| faces.iter().all(|face| face.height + face.normal.dot(step) >= offset - margin);
    let accepted = |step: DVec3, factors: &[f64]| {
        (factors.iter().all(|factor| *factor >= 0.0) && keeps(&step) && step.norm() <= longest).then_some(step)
    };
    if keeps(&DVec3::zeros()) {
        return Some(DVec3::zeros());
    }
    let lacking = |face: &Face| offset - face.height;
    for (i, a) in faces.iter().enumerate() {
        if let Some(step) = accepted(a.normal * lacking(a), &[lacking(a)]) {
            return Some(step);
        }
        for (j, b) in faces.iter().enumerate().take(i) {
            let cosine = a.normal.dot(&b.normal);
            let square = 1.0 - cosine * cosine;
            if square > PARALLEL {
                let [p, q] = [lacking(a) - cosine * lacking(b), lacking(b) - cosine * lacking(a)].map(|x| x / square);
                if let Some(step) = accepted(a.normal * p + b.normal * q, &[p, q]) {
                    return Some(step);
                }
            }
            for c in faces.iter().take(j) {
                let across = [b.normal.cross(&c.normal), c.normal.cross(&a.normal), a.normal.cross(&b.normal)];
                let volume = a.normal.dot(&across[0]);
                if volume * volume > PARALLEL {
                    let sum = across[0] * lacking(a) + across[1] * lacking(b) + across[2] * lacking(c);
                    let step = sum / volume;
                    if let Some(step) = accepted(step, &across.map(|across| step.dot(&across) / volume)) {
                        return Some(step);
                    }
                }
            }
        }
    }
    None
}

/// The largest offset below `offset` that a displacement of at most `longest` keeps, and that displacement.
fn farthest(faces: &[Face], offset: f64, longest: f64) -> (f64, DVec3) {
    let lowest = faces.iter().fold(offset, |lowest, face| lowest.min(face.height));
    let (mut reached, mut missed, mut step) = (lowest, offset, DVec3::zeros());
    for _ in 0..HALVINGS {
        let middle = 0.5 * (reached + missed);
        match shortest(faces, middle, longest) {
            Some(found) => (reached, step) = (middle, found),
            None => missed = middle,
        }
    }
    (reached, step)
}

#[cfg(test)]
mod tests;
