//! Curves moved by the poses of their roots.

use nalgebra::Quaternion;
use numerics::parallel;
use numerics::vector::{DQuat, DVec3, to_f32, to_f64};
use std::ops::Range;

/// How a root has moved and rotated with its skin since rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RootPose {
    /// Its current position minus that at rest, metres.
    pub translation: DVec3,
    /// The rotation about it.
    pub rotation: DQuat,
    /// Whether the skin there has collapsed to a line or a point, so that `rotation` is the identity.
    pub lost: bool,
}

/// Curves moved by the poses of their roots, and how well their lengths are kept.
#[must_use]
#[derive(Clone, Debug, PartialEq)]
pub struct AttachedCurves {
    /// One point for each input point, metres.
    pub points: Vec<[f32; 3]>,
    /// Largest change of a segment's length ÷ its curve's length, measured on the results.
    pub length_error: f64,
}

/// Minimum number of points in a task.
const TASK: usize = 2048;

/// Rotates curves `points[starts[i]..starts[i + 1]]` about their roots (first points) and translates them, by one pose
/// for each curve.
///
/// # Panics
/// If `starts` does not run from 0 to the number of points, or there are fewer poses than curves.
pub fn attach_curves(starts: &[u32], points: &[[f32; 3]], poses: &[RootPose]) -> AttachedCurves {
    let mut out = vec![[0.0; 3]; points.len()];
    let length_error = each_curve(starts, poses, &mut out, points, &|pose, now, rest| {
        attach_curve(pose, rest, now);
        relative_stretch(now, rest)
    });
    AttachedCurves { points: out, length_error }
}

/// Writes a curve moved by the pose of its root.
pub(crate) fn attach_curve(pose: &RootPose, rest: &[[f32; 3]], now: &mut [[f32; 3]]) {
    let Some(root) = rest.first().map(|root| to_f64(*root)) else { return };
    for (now, rest) in now.iter_mut().zip(rest) {
        let rest = to_f64(*rest);
        let arm = rest - root;
        // Added as a displacement, so that a still skin changes no bit.
        *now = to_f32(rest + (pose.translation + (pose.rotation * arm - arm)));
    }
}

/// Largest change of a segment's length ÷ the length of the rest curve; 0 if that is 0.
pub(crate) fn relative_stretch(now: &[[f32; 3]], rest: &[[f32; 3]]) -> f64 {
    let segment = |pair: &[[f32; 3]]| (to_f64(pair[1]) - to_f64(pair[0])).norm();
    let (mut whole, mut largest) = (0.0, 0.0_f64);
    for (now, rest) in now.windows(2).zip(rest.windows(2)) {
        let length = segment(rest);
        whole += length;
        largest = largest.max((segment(now) - length).abs());
    }
    if whole > 0.0 { largest / whole } else { 0.0 }
}

/// Rotates vectors, a row for each point (`starts` as for [`attach_curves`]).
///
/// # Panics
/// As [`attach_curves`].
pub fn rotate_vectors(starts: &[u32], rows: &mut [[f32; 3]], poses: &[RootPose]) {
    each_row(starts, poses, rows, &|rotation, row| to_f32(rotation * to_f64(*row)));
}

/// Rotates orientations (quaternions x, y, z, w), a row for each point.
///
/// # Panics
/// As [`attach_curves`].
pub fn rotate_orientations(starts: &[u32], rows: &mut [[f32; 4]], poses: &[RootPose]) {
    each_row(starts, poses, rows, &|rotation, row| rotate_orientation(rotation, *row));
}

/// `orientation` (x, y, z, w) followed by `rotation`.
pub(crate) fn rotate_orientation(rotation: &DQuat, orientation: [f32; 4]) -> [f32; 4] {
    let [x, y, z, w] = orientation.map(f64::from);
    (rotation.quaternion() * Quaternion::new(w, x, y, z)).coords.map(|x| x as f32).into()
}

fn each_row<T: Copy + Send + Sync>(
    starts: &[u32],
    poses: &[RootPose],
    rows: &mut [T],
    rotate: &(impl Fn(&DQuat, &T) -> T + Sync),
) {
    let rest = rows.to_vec();
    each_curve(starts, poses, rows, &rest, &|pose, now, rest| {
        now.iter_mut().zip(rest).for_each(|(now, rest)| *now = rotate(&pose.rotation, rest));
        0.0
    });
}

/// Calls `each` with the pose of every curve and its rows of `out` and `rest`; returns the largest result.
fn each_curve<T: Send + Sync>(
    starts: &[u32],
    poses: &[RootPose],
    out: &mut [T],
    rest: &[T],
    each: &(impl Fn(&RootPose, &mut [T], &[T]) -> f64 + Sync),
) -> f64 {
    let largest = parallel::map(tasks(starts, out), |_, (curves, mut out)| {
        let mut largest = 0.0_f64;
        for curve in curves {
            let rows = starts[curve] as usize..starts[curve + 1] as usize;
            let (mine, after) = out.split_at_mut(rows.len());
            largest = largest.max(each(&poses[curve], mine, &rest[rows]));
            out = after;
        }
        largest
    });
    largest.into_iter().fold(0.0, f64::max)
}

/// Splits the curves, and `out` with them, into tasks.
pub(crate) fn tasks<'a, T>(starts: &[u32], mut out: &'a mut [T]) -> Vec<(Range<usize>, &'a mut [T])> {
    let curves = starts.len().saturating_sub(1);
    let (mut tasks, mut first) = (Vec::new(), 0);
    while first < curves {
        let mut end = first + 1;
        while end < curves && ((starts[end] - starts[first]) as usize) < TASK {
            end += 1;
        }
        let (mine, after) = out.split_at_mut((starts[end] - starts[first]) as usize);
        tasks.push((first..end, mine));
        (out, first) = (after, end);
    }
    tasks
}
