//! The rigid motion that carries a curve's oscillators along before each step: a share of how its root has moved.

use crate::attach::{RootPose, SkinBinding};
use numerics::vector::{DMat3, DQuat, DVec3, rotation};
use rayon::prelude::*;

/// Curves that a task has at least.
const TASK: usize = 512;

/// A rigid motion x → x + `change`·(x − `about`) + `shift`; exactly nothing for no motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigidStep {
    /// The rotation matrix less the identity.
    pub(super) change: DMat3,
    /// Metres.
    pub(super) about: DVec3,
    /// Metres.
    pub(super) shift: DVec3,
}

impl RigidStep {
    /// No motion.
    pub const NONE: Self = Self {
        change: DMat3::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        about: DVec3::new(0.0, 0.0, 0.0),
        shift: DVec3::new(0.0, 0.0, 0.0),
    };

    /// [`RigidStep::between`] for each root of a binding.
    pub fn all_between(binding: &SkinBinding, from: &[RootPose], to: &[RootPose], share: f64) -> Vec<Self> {
        let roots: Vec<DVec3> = binding.roots().collect();
        let steps = roots.par_iter().zip(from).zip(to).with_min_len(TASK);
        steps.map(|((root, from), to)| Self::between(*root, from, to, share)).collect()
    }

    /// A share of the motion from one pose of a root to another: about the root, that share of the rotation's angle (the
    /// shorter way round) and of the translation. 0 is no motion, 1 all of it. `root` is its position at rest, in metres.
    /// Where the skin has lost its directions in either pose nothing rotates: no rotation is known between them.
    pub fn between(root: DVec3, from: &RootPose, to: &RootPose, share: f64) -> Self {
        if share == 0.0 || from == to {
            return Self::NONE;
        }
        let shift = (to.translation - from.translation) * share;
        let change = if from.lost || to.lost {
            DMat3::zeros()
        } else {
            less_identity(&part_of(&(to.rotation * from.rotation.inverse()), share))
        };
        Self { change, about: root + from.translation, shift }
    }
}

/// The rotation about the same axis by a share of the angle.
fn part_of(whole: &DQuat, share: f64) -> DQuat {
    if share == 1.0 {
        return *whole;
    }
    let sign = if whole.w < 0.0 { -1.0 } else { 1.0 };
    let axis = whole.vector() * sign;
    let sine = axis.norm();
    if sine == 0.0 {
        return DQuat::identity();
    }
    rotation(axis / sine, 2.0 * share * libm::atan2(sine, whole.w.abs()))
}

/// The matrix of a rotation less the identity: exactly zero for none, and without cancellation for a small one.
fn less_identity(rotation: &DQuat) -> DMat3 {
    let (x, y, z, w) = (rotation.i, rotation.j, rotation.k, rotation.w);
    DMat3::new(
        -2.0 * (y * y + z * z),
        2.0 * (x * y - z * w),
        2.0 * (x * z + y * w),
        2.0 * (x * y + z * w),
        -2.0 * (x * x + z * z),
        2.0 * (y * z - x * w),
        2.0 * (x * z - y * w),
        2.0 * (y * z + x * w),
        -2.0 * (x * x + y * y),
    )
}
