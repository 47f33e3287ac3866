//! How the frames of roots have moved where no skin says it.

use crate::attach::{RootPose, nearest_rotation};
use crate::guides::{GuideWeights, OrientedPoint, guide_weights};
use nalgebra::{Quaternion, Unit};
use numerics::parallel;
use numerics::vector::{DMat3, DQuat, DVec3, to_f64};

/// Number of guides, itself among them, whose roots give the rotation of a guide's root.
const AROUND: usize = 8;

/// Number of roots in a task.
const TASK: usize = 64;

/// How each guide's root has moved from `rest[starts[i]]` to `now[starts[i]]`, and turned: by the rotation nearest to the
/// motion of the roots of the guides around it. Where these roots lie on a line, the guide's own CVs count too; where that
/// leaves the rotation open as well, it is the identity.
///
/// # Panics
/// If `starts` does not run from 0 to the number of points of both, or a guide has no point.
pub fn guide_poses(starts: &[u32], rest: &[[f32; 3]], now: &[[f32; 3]]) -> Vec<RootPose> {
    let guides = starts.len().saturating_sub(1);
    let roots: Vec<OrientedPoint> = starts[..guides]
        .iter()
        .map(|start| OrientedPoint { position: rest[*start as usize], normal: ALL_ALIKE })
        .collect();
    let around = guide_weights(&roots, &roots, AROUND);
    let pose = |guide: usize| {
        let root = starts[guide] as usize;
        let from = |cv: usize| (to_f64(now[cv]) - to_f64(now[root]), to_f64(rest[cv]) - to_f64(rest[root]));
        let roots = around.of(guide).iter().map(|near| starts[near.guide as usize] as usize);
        let moved: DMat3 = outer(roots.clone().map(from));
        let own = || moved + outer((root..starts[guide + 1] as usize).map(from));
        let translation = to_f64(now[root]) - to_f64(rest[root]);
        let still = roots.clone().all(|cv| from(cv).0 == from(cv).1);
        let rotation = if still { None } else { nearest_rotation(&moved).or_else(|| nearest_rotation(&own())) };
        RootPose { translation, lost: rotation.is_none(), rotation: rotation.unwrap_or_else(DQuat::identity) }
    };
    parallel::tabulate(guides, TASK, pose)
}

/// A normal for all points, so that distances are Euclidean.
const ALL_ALIKE: [f32; 3] = [0.0, 1.0, 0.0];

/// Σ now · restᵀ.
fn outer(pairs: impl Iterator<Item = (DVec3, DVec3)>) -> DMat3 {
    pairs.fold(DMat3::zeros(), |sum, (now, rest)| sum + now * rest.transpose())
}

/// How hairs rooted at `roots` (metres) move with their guides, each of which carries the space around its root, at
/// `guide_roots`, by its pose. A hair without guides does not move.
///
/// # Panics
/// If a slice is shorter than the hairs or guides.
pub fn carried_poses(
    weights: &GuideWeights,
    roots: &[[f32; 3]],
    guide_roots: &[[f32; 3]],
    poses: &[RootPose],
) -> Vec<RootPose> {
    let still = RootPose { translation: DVec3::zeros(), rotation: DQuat::identity(), lost: false };
    let carried = |hair: usize| {
        if weights.hairs() == 0 {
            return still;
        }
        let (mut translation, mut turn) = (DVec3::zeros(), Quaternion::new(0.0, 0.0, 0.0, 0.0));
        let mut rest = 1.0;
        let heaviest = poses[weights.of(hair)[0].guide as usize].rotation;
        for guide in weights.of(hair) {
            let (weight, pose) = (f64::from(guide.weight), &poses[guide.guide as usize]);
            let arm = to_f64(roots[hair]) - to_f64(guide_roots[guide.guide as usize]);
            translation += (pose.translation + (pose.rotation * arm - arm)) * weight;
            let sign = if pose.rotation.coords.dot(&heaviest.coords) < 0.0 { -1.0 } else { 1.0 };
            turn += pose.rotation.quaternion() * (sign * weight);
            rest -= weight;
        }
        // Weights that sum to less than 1 leave the rest of the hair where it is.
        let rest = if rest > 1e-6 { rest } else { 0.0 };
        turn.coords.w += if heaviest.coords.w < 0.0 { -rest } else { rest };
        let size = turn.norm();
        let rotation = if size > 1e-9 { Unit::new_unchecked(turn / size) } else { heaviest };
        RootPose { translation, rotation, lost: false }
    };
    parallel::tabulate(roots.len(), TASK, carried)
}
