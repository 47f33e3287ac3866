//! A parallel loop over curves, for nodes that move CVs one curve at a time.
//!
//! Each curve comes with its arc length, a frame at every CV that does not twist along the curve, and random numbers of
//! its own; the node writes the curve's new CVs. The same bits for any number of threads.

use std::ops::Range;

use numerics::parallel;
use numerics::random::Key;
use numerics::vector::{DVec3, Vec3, direction, to_f32, to_f64};

use crate::geometry::{CURVE_ID, Component};
use crate::param::Seed;

/// CVs that one thread takes at least.
const CVS_OF_A_THREAD: usize = 1024;

/// A loop over all curves of a component.
#[derive(Clone, Copy)]
pub struct CurveLoop<'a> {
    curves: &'a Component,
    /// What frames follow.
    shape: &'a [Vec3],
    seed: Seed,
    keeps_lengths: bool,
}

/// Curves after a loop.
#[must_use]
#[derive(Clone, Debug)]
pub struct MovedCurves<T> {
    /// A position for every CV, metres.
    pub points: Vec<Vec3>,
    /// The largest change of a segment's length, as a share of [`CurveView::length`]: for [`super::Metric::length_error`].
    pub length_error: f64,
    /// What the node returned for each curve, in order.
    pub results: Vec<T>,
}

/// One curve of a loop.
pub struct CurveView<'a> {
    /// Which curve it is, from 0.
    pub index: usize,
    /// Arc length, metres.
    pub length: f32,
    rows: Range<usize>,
    points: &'a [Vec3],
    scratch: &'a Scratch,
    key: Key,
}

/// One CV of a curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cv {
    /// Which CV of the curve it is, 0 at the root: where its new position goes.
    pub index: usize,
    /// Its row among all points of the component: for masks and other point attributes.
    pub row: usize,
    /// Its incoming position, metres.
    pub point: Vec3,
    /// Arc length from the root ÷ the curve's length; 0 on a curve without length.
    pub u: f32,
    /// The direction of the curve, of length 1.
    pub tangent: Vec3,
    /// Perpendicular to the tangent, of length 1; turns as little as possible from CV to CV.
    pub normal: Vec3,
    /// tangent × normal.
    pub binormal: Vec3,
}

/// What is computed of a curve before its node sees it.
#[derive(Default)]
struct Scratch {
    /// Arc length from the root to each CV, metres.
    along: Vec<f64>,
    tangents: Vec<DVec3>,
    normals: Vec<DVec3>,
}

impl<'a> CurveLoop<'a> {
    /// A loop over `curves`, with random numbers of seed 0.
    pub fn over(curves: &'a Component) -> Self {
        Self { curves, shape: curves.positions(), seed: Seed(0), keeps_lengths: false }
    }

    /// Frames, `u` and lengths are those of this shape of the curves, a position for each CV, instead of the incoming one: of the
    /// shape at rest, for example ([`super::Cx::at_rest`]).
    ///
    /// # Panics
    /// Where the numbers of CVs differ.
    #[must_use]
    pub fn framed_by(self, shape: &'a [Vec3]) -> Self {
        assert_eq!(shape.len(), self.curves.point_count(), "a shape has a position for each CV");
        Self { shape, ..self }
    }

    /// With random numbers of this seed. They belong to a curve's `curve_id` where there is one, otherwise to its
    /// index: a node that uses them reads [`CURVE_ID`].
    #[must_use]
    pub fn seeded(self, seed: Seed) -> Self {
        Self { seed, ..self }
    }

    /// Restores the incoming length of every segment, root to tip, after the node has moved its CVs: the node then decides on
    /// directions alone.
    #[must_use]
    pub fn keeping_lengths(self) -> Self {
        Self { keeps_lengths: true, ..self }
    }

    /// Calls `work` for every curve, in parallel; the slice holds the curve's CVs and takes their new positions.
    pub fn map<T: Send>(self, work: impl Fn(&CurveView<'_>, &mut [Vec3]) -> T + Sync) -> MovedCurves<T> {
        let mut points = self.curves.positions().to_vec();
        let done = parallel::map(self.shares(&mut points), |_, (curves, out)| {
            let mut scratch = Scratch::default();
            let (mut results, mut worst, mut left) = (Vec::with_capacity(curves.len()), 0.0_f64, out);
            for curve in curves {
                let (out, rest) = std::mem::take(&mut left).split_at_mut(self.curves.runs().range(curve).len());
                left = rest;
                let (result, error) = self.one(curve, &mut scratch, out, &work);
                results.push(result);
                worst = worst.max(error);
            }
            (results, worst)
        });
        let length_error = done.iter().map(|(_, error)| *error).fold(0.0, f64::max);
        MovedCurves { points, length_error, results: done.into_iter().flat_map(|(results, _)| results).collect() }
    }

    /// Consecutive curves with their points, for a thread each.
    fn shares<'p>(&self, points: &'p mut [Vec3]) -> Vec<(Range<usize>, &'p mut [Vec3])> {
        let (starts, count) = (self.curves.runs().starts(), self.curves.element_count());
        let (mut shares, mut left, mut first) = (Vec::new(), points, 0);
        while first < count {
            let mut end = first + 1;
            while end < count && ((starts[end] - starts[first]) as usize) < CVS_OF_A_THREAD {
                end += 1;
            }
            let (own, rest) = left.split_at_mut((starts[end] - starts[first]) as usize);
            shares.push((first..end, own));
            (left, first) = (rest, end);
        }
        shares
    }

    fn one<T>(
        &self,
        curve: usize,
        scratch: &mut Scratch,
        out: &mut [Vec3],
        work: &impl Fn(&CurveView<'_>, &mut [Vec3]) -> T,
    ) -> (T, f64) {
        let rows = self.curves.runs().range(curve);
        let points = &self.curves.positions()[rows.clone()];
        scratch.measure(&self.shape[rows.clone()]);
        let id = self.curves.get(CURVE_ID).map_or(curve as u64, |ids| u64::from(ids[curve].cast_unsigned()));
        let view = CurveView {
            index: curve,
            length: scratch.length() as f32,
            rows,
            points,
            scratch,
            key: Key::new(u64::from(self.seed.0)).of(id),
        };
        let result = work(&view, out);
        if self.keeps_lengths {
            restore_lengths(points, out);
        }
        (result, length_error(points, out, scratch.length()))
    }
}

impl CurveView<'_> {
    /// Its CVs, root first.
    pub fn cvs(&self) -> impl ExactSizeIterator<Item = Cv> + '_ {
        let length = self.scratch.length();
        (0..self.points.len()).map(move |index| {
            let (tangent, normal) = (self.scratch.tangents[index], self.scratch.normals[index]);
            Cv {
                index,
                row: self.rows.start + index,
                point: self.points[index],
                u: if length > 0.0 { (self.scratch.along[index] / length) as f32 } else { 0.0 },
                tangent: to_f32(tangent),
                normal: to_f32(normal),
                binormal: to_f32(tangent.cross(&normal)),
            }
        })
    }

    /// A random number of the curve in 0…1, 1 excluded; another for every `draw`, and the same at every frame.
    pub fn random(&self, draw: u64) -> f32 {
        self.key.of(draw).f32()
    }
}

impl Scratch {
    fn length(&self) -> f64 {
        self.along.last().copied().unwrap_or(0.0)
    }

    fn measure(&mut self, points: &[Vec3]) {
        self.along.clear();
        self.tangents.clear();
        self.normals.clear();
        let mut so_far = 0.0;
        for index in 0..points.len() {
            if index > 0 {
                so_far += (to_f64(points[index]) - to_f64(points[index - 1])).norm();
            }
            self.along.push(so_far);
        }
        self.add_tangents(points);
        self.add_normals(points);
    }

    /// At each CV the mean direction of the segments beside it. Segments without length have no say; a curve without
    /// length stands upright.
    fn add_tangents(&mut self, points: &[Vec3]) {
        let segment = |pair: &[Vec3]| direction(to_f64(pair[1]) - to_f64(pair[0]));
        let mut before = None;
        let mut after = points.windows(2).map(segment);
        for _ in points {
            let next = after.next().flatten();
            let tangent = match (before, next) {
                (Some(a), Some(b)) => direction(a + b).unwrap_or(b),
                (one, other) => other.or(one).unwrap_or_else(DVec3::zeros),
            };
            self.tangents.push(tangent);
            before = next.or(before);
        }
        // Doubled CVs at the root take the direction of the first segment with a length.
        let first = self.tangents.iter().copied().find(|tangent| *tangent != DVec3::zeros());
        let first = first.unwrap_or_else(DVec3::y);
        self.tangents.iter_mut().take_while(|tangent| **tangent == DVec3::zeros()).for_each(|tangent| *tangent = first);
    }

    /// Rotation-minimising normals by double reflection (Wang, Jüttler, Zheng & Liu 2008).
    fn add_normals(&mut self, points: &[Vec3]) {
        let Some(root) = self.tangents.first() else { return };
        let mut normal = any_perpendicular(*root);
        self.normals.push(normal);
        for index in 1..points.len() {
            let (tangent, next) = (self.tangents[index - 1], self.tangents[index]);
            let step = direction(to_f64(points[index]) - to_f64(points[index - 1]));
            let (mut carried, mut turned) = (normal, tangent);
            if let Some(step) = step {
                (carried, turned) = (reflected(carried, step), reflected(turned, step));
            }
            if let Some(across) = direction(next - turned) {
                carried = reflected(carried, across);
            }
            normal = direction(carried - next * carried.dot(&next)).unwrap_or_else(|| any_perpendicular(next));
            self.normals.push(normal);
        }
    }
}

/// `v` mirrored by the plane across the unit vector `axis`.
fn reflected(v: DVec3, axis: DVec3) -> DVec3 {
    v - axis * (2.0 * v.dot(&axis))
}

/// A unit vector perpendicular to a unit vector.
fn any_perpendicular(v: DVec3) -> DVec3 {
    let axis = if v.x.abs() < 0.75 { DVec3::x() } else { DVec3::z() };
    direction(axis - v * v.dot(&axis)).unwrap_or_else(DVec3::y)
}

/// Moves CVs along the directions of their segments until each is as long as it was; the root stays where it was put.
fn restore_lengths(points: &[Vec3], out: &mut [Vec3]) {
    let Some(mut before) = out.first().copied().map(to_f64) else { return };
    let mut moved = before;
    for index in 1..points.len() {
        let old = to_f64(points[index]) - to_f64(points[index - 1]);
        let at = to_f64(out[index]);
        let along = direction(at - before).or_else(|| direction(old)).unwrap_or_else(DVec3::zeros);
        moved += along * old.norm();
        before = at;
        out[index] = to_f32(moved);
    }
}

fn length_error(points: &[Vec3], out: &[Vec3], length: f64) -> f64 {
    let segment = |pair: &[Vec3]| (to_f64(pair[1]) - to_f64(pair[0])).norm();
    let changes = points.windows(2).zip(out.windows(2)).map(|(old, new)| (segment(new) - segment(old)).abs());
    let worst = changes.fold(0.0, f64::max);
    if length > 0.0 { worst / length } else { worst }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A helix of radius 1 about y, a straight curve, and curves with doubled CVs, one CV and no length.
    fn samples() -> Component {
        let helix = (0..40).map(|k| {
            let (sine, cosine) = numerics::trig::sin_cos(0.3 * k as f32);
            [cosine, 0.1 * k as f32, sine]
        });
        let straight = (0..5).map(|k| [5.0, 0.5 * k as f32, 0.0]);
        let doubled = [[0.0; 3], [0.0; 3], [1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0; 3]];
        let rest = [[7.0; 3], [8.0; 3], [8.0; 3]];
        let points = helix.chain(straight).chain(doubled).chain(rest).collect();
        Component::curves(vec![40, 5, 5, 1, 2], points).unwrap()
    }

    #[test]
    fn frames_are_orthonormal_and_do_not_twist() {
        let curves = samples();
        let all = CurveLoop::over(&curves).map(|curve, _| curve.cvs().collect::<Vec<Cv>>()).results;
        for cv in all.iter().flatten() {
            let axes = [cv.tangent, cv.normal, cv.binormal];
            for (i, a) in axes.iter().enumerate() {
                for (j, b) in axes.iter().enumerate() {
                    assert!((to_f64(*a).dot(&to_f64(*b)) - f64::from(u8::from(i == j))).abs() < 1e-6, "{cv:?}");
                }
            }
        }
        // On a helix a frame that does not twist falls behind the principal normal by the torsion: c ÷ √(1 + c²) radians for
        // each radian about the axis, with a rise of c = 1/3 for each.
        let behind = |cv: &Cv| {
            let angle = 0.3 * cv.index as f64;
            let principal = DVec3::new(-libm::cos(angle), 0.0, -libm::sin(angle));
            let across = to_f64(cv.tangent).cross(&principal);
            let normal = to_f64(cv.normal);
            libm::atan2(normal.dot(&across), normal.dot(&principal))
        };
        for pair in all[0][1..39].windows(2) {
            let turned = (behind(&pair[1]) - behind(&pair[0])).rem_euclid(std::f64::consts::TAU);
            let turned = turned.min(std::f64::consts::TAU - turned);
            assert!((turned - 0.3 / 10.0_f64.sqrt()).abs() < 2e-3, "{turned}, {pair:?}");
        }
        assert!(all[1].iter().all(|cv| cv.normal == all[1][0].normal), "a straight curve has one frame");
        assert_eq!(all[1].iter().map(|cv| cv.u).collect::<Vec<_>>(), [0.0, 0.25, 0.5, 0.75, 1.0]);
        assert_eq!(all[2].iter().map(|cv| cv.u).collect::<Vec<_>>(), [0.0, 0.0, 0.5, 0.5, 1.0]);
        assert_eq!(all[4][1].u, 0.0);
    }

    #[test]
    fn frames_can_follow_another_shape() {
        let curves = samples();
        // The straight curve lies along x at rest, twice as long.
        let mut rest = curves.positions().to_vec();
        for (k, point) in rest[40..45].iter_mut().enumerate() {
            *point = [k as f32, 0.0, 0.0];
        }
        let all =
            CurveLoop::over(&curves).framed_by(&rest).map(|curve, _| (curve.length, curve.cvs().collect::<Vec<_>>()));
        let (length, cvs) = &all.results[1];
        assert_eq!(*length, 4.0);
        for (k, cv) in cvs.iter().enumerate() {
            assert_eq!((cv.tangent, cv.point, cv.u), ([1.0, 0.0, 0.0], [5.0, 0.5 * k as f32, 0.0], 0.25 * k as f32));
        }
        assert_eq!(all.points, curves.positions(), "what the node does not write stays as it arrives");
        assert_eq!(all.length_error, 0.0);
    }

    #[test]
    fn lengths_are_restored_and_measured() {
        let curves = samples();
        let stretch = |curve: &CurveView<'_>, out: &mut [Vec3]| {
            for cv in curve.cvs() {
                out[cv.index] = std::array::from_fn(|k| 3.0 * cv.point[k] + 0.2 * cv.u * cv.normal[k]);
            }
        };
        assert!(CurveLoop::over(&curves).map(stretch).length_error > 0.1);
        let kept = CurveLoop::over(&curves).keeping_lengths().map(stretch);
        assert!(kept.length_error < 1e-6, "{}", kept.length_error);
        assert_eq!(kept.points[40], [15.0, 0.0, 0.0], "roots are where the node put them");
        assert!(kept.points.as_flattened().iter().all(|x| x.is_finite()));
    }

    #[test]
    fn random_numbers_belong_to_the_curve_and_its_seed() {
        let draw = |curves: &Component, seed| {
            CurveLoop::over(curves).seeded(Seed(seed)).map(|curve, _| [curve.random(0), curve.random(1)]).results
        };
        let curves = samples();
        let plain = draw(&curves, 1);
        assert_ne!(plain[0][0], plain[0][1]);
        assert_ne!(plain, draw(&curves, 2));
        let mut named = curves.clone();
        named.set(CURVE_ID, vec![4, 3, 2, 1, 0]).unwrap();
        assert_eq!(draw(&named, 1)[4], plain[0]);
    }
}
