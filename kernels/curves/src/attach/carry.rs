//! Curves moved by the poses of their roots.

use super::vectors::{Quat, Vec3, add, compose, moved, sub, turned, wide};

/// How a root has moved and turned since rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Where it is now less where it was, metres.
    pub shift: [f64; 3],
    /// The turn about it, a unit quaternion x, y, z, w.
    pub turn: [f64; 4],
    /// Whether the skin there has lost its directions, so that no turn is known.
    pub lost: bool,
}

/// Moved curves, and what was reached.
#[must_use]
#[derive(Clone, Debug, PartialEq)]
pub struct Carried {
    /// One point for every incoming one.
    pub points: Vec<[f32; 3]>,
    /// Largest change of a segment's length ÷ its curve's length, as written.
    pub length_error: f64,
}

/// Points that a task has at least.
const TASK: usize = 2048;

/// Turns curves `points[starts[i]..starts[i + 1]]` about their roots (first points) and moves them, by a pose each.
///
/// # Panics
/// Where `starts` does not run from 0 to the number of points, or there are fewer poses than curves.
pub fn carry_curves(starts: &[u32], points: &[[f32; 3]], poses: &[Pose]) -> Carried {
    let mut out = vec![[0.0; 3]; points.len()];
    let length_error = by_curves(starts, poses, &mut out, points, &|pose, now, rest| {
        let Some(root) = rest.first().map(|root| wide(*root)) else { return 0.0 };
        for (now, rest) in now.iter_mut().zip(rest) {
            let rest = wide(*rest);
            // A skin that has not moved leaves the bits.
            let by = add(pose.shift, moved(pose.turn, sub(rest, root)));
            *now = add(rest, by).map(|x| x as f32);
        }
        stretch(now, rest)
    });
    Carried { points: out, length_error }
}

/// Largest change of a segment's length ÷ the length of the rest curve; 0 where that is 0.
fn stretch(now: &[[f32; 3]], rest: &[[f32; 3]]) -> f64 {
    let segment = |pair: &[[f32; 3]]| super::vectors::length(sub(wide(pair[1]), wide(pair[0])));
    let (mut whole, mut most) = (0.0, 0.0_f64);
    for (now, rest) in now.windows(2).zip(rest.windows(2)) {
        let length = segment(rest);
        whole += length;
        most = most.max((segment(now) - length).abs());
    }
    if whole > 0.0 { most / whole } else { 0.0 }
}

/// Turns vectors, a row a point (`starts` as for [`carry_curves`]).
///
/// # Panics
/// As [`carry_curves`].
pub fn turn_vectors(starts: &[u32], rows: &mut [[f32; 3]], poses: &[Pose]) {
    by_rows(starts, poses, rows, &|turn, row| turned(turn, wide(*row)).map(|x| x as f32));
}

/// Turns orientations (quaternions x, y, z, w), a row a point.
///
/// # Panics
/// As [`carry_curves`].
pub fn turn_orientations(starts: &[u32], rows: &mut [[f32; 4]], poses: &[Pose]) {
    by_rows(starts, poses, rows, &|turn, row| compose(turn, row.map(f64::from)).map(|x| x as f32));
}

fn by_rows<T: Copy + Send + Sync>(
    starts: &[u32],
    poses: &[Pose],
    rows: &mut [T],
    turn: &(impl Fn(Quat, &T) -> T + Sync),
) {
    let rest = rows.to_vec();
    by_curves(starts, poses, rows, &rest, &|pose, now, rest| {
        now.iter_mut().zip(rest).for_each(|(now, rest)| *now = turn(pose.turn, rest));
        0.0
    });
}

/// Calls `each` with the pose of every curve and its rows of `out` and `rest`; the largest answer. Halves the curves
/// until a task is small.
fn by_curves<T: Send + Sync>(
    starts: &[u32],
    poses: &[Pose],
    out: &mut [T],
    rest: &[T],
    each: &(impl Fn(&Pose, &mut [T], &[T]) -> f64 + Sync),
) -> f64 {
    let curves = starts.len().saturating_sub(1);
    let from = |curve: usize| (starts[curve] - starts[0]) as usize;
    if curves < 2 || rest.len() < TASK {
        let mut most = 0.0_f64;
        let mut left = out;
        for curve in 0..curves {
            let (mine, after) = left.split_at_mut(from(curve + 1) - from(curve));
            most = most.max(each(&poses[curve], mine, &rest[from(curve)..from(curve + 1)]));
            left = after;
        }
        return most;
    }
    let middle = curves / 2;
    let (out_left, out_right) = out.split_at_mut(from(middle));
    let (rest_left, rest_right) = rest.split_at(from(middle));
    let (poses_left, poses_right) = poses.split_at(middle);
    let (left, right) = rayon::join(
        || by_curves(&starts[..=middle], poses_left, out_left, rest_left, each),
        || by_curves(&starts[middle..], poses_right, out_right, rest_right, each),
    );
    left.max(right)
}

impl Pose {
    /// Where `v`, at rest relative to the root, is relative to the root now.
    pub(crate) fn turned(&self, v: Vec3) -> Vec3 {
        turned(self.turn, v)
    }
}
