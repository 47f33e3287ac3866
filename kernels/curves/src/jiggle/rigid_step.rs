//! The rigid motion applied to a curve's oscillators before each step: a fraction of the motion of its root.

use crate::attach::{RootPose, SkinBinding};
use numerics::parallel;
use numerics::vector::{DMat3, DQuat, DVec3, rotation};

/// Number of curves in a task.
const TASK: usize = 512;

/// A rigid motion x → x + `change`·(x − `about`) + `shift`; changes nothing for no motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigidStep {
    /// The rotation matrix minus the identity.
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
    ///
    /// # Panics
    /// If there are fewer poses than roots.
    pub fn all_between(binding: &SkinBinding, from: &[RootPose], to: &[RootPose], share: f64) -> Vec<Self> {
        Self::tabulated(binding, from, to, |_| share)
    }

    /// The same with a share for each root.
    ///
    /// # Panics
    /// If there are fewer poses or shares than roots.
    pub fn each_between(binding: &SkinBinding, from: &[RootPose], to: &[RootPose], shares: &[f64]) -> Vec<Self> {
        Self::tabulated(binding, from, to, |root| shares[root])
    }

    fn tabulated(
        binding: &SkinBinding,
        from: &[RootPose],
        to: &[RootPose],
        share: impl Fn(usize) -> f64 + Sync,
    ) -> Vec<Self> {
        let roots: Vec<DVec3> = binding.roots().collect();
        let mut steps = vec![Self::NONE; roots.len()];
        parallel::fill(&mut steps, TASK, |root| Self::between(roots[root], &from[root], &to[root], share(root)));
        steps
    }

    /// A fraction of the motion from one pose of a root to another: about the root, that fraction of the rotation's
    /// angle (at most half a turn) and of the translation. 0 is no motion, 1 all of it. `root` is its position at rest,
    /// in metres. If the skin has collapsed in either pose, there is no rotation, since none is defined between them.
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

/// The rotation about the same axis by a fraction of the angle.
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

/// The matrix of a rotation minus the identity: exactly zero for no rotation, and without cancellation for a small one.
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
