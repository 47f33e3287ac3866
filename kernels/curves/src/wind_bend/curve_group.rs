//! Sixteen curves, root to tip: one step for each pivot, in loops over lanes.
//!
//! A lane whose curve has ended, or that has none, repeats its last CV: its segments have no length, so nothing rotates
//! and no lane masks are needed.

use super::chain::Chain;
use super::share::Share;
use super::tally::Tally;
use super::wind_direction::WindDirection;
use super::{Bend, Reached};
use numerics::lanes::{F32x16, LANES, Lanes, get, set};
use numerics::simd::kernel;
use numerics::vector::{self, Vec3};

/// Up to sixteen curves of `points`.
pub(super) struct CurveGroup<'a> {
    /// Index of the first one.
    pub(super) first: usize,
    /// Start of each, and end of the last.
    pub(super) starts: &'a [u32],
    pub(super) points: &'a [Vec3],
}

/// Buffers that groups reuse, with an entry for each step.
#[derive(Default)]
pub(super) struct Scratch {
    /// Input CVs.
    points: Vec<Lanes<3>>,
    /// Arc length from the root to the CV, in the lane's unit.
    arc: Vec<F32x16>,
}

kernel! { avx512
    /// Writes the bent curves of `group` to `out`, which holds just their points; returns the largest values over them and
    /// those `before`.
    pub(super) fn bend_group(
        bend: &Bend<'_>,
        group: &CurveGroup<'_>,
        before: &Reached,
        scratch: &mut Scratch,
        out: &mut [Vec3],
    ) -> Reached = body;
}

#[inline(always)]
fn body(
    bend: &Bend<'_>,
    group: &CurveGroup<'_>,
    reached: &Reached,
    scratch: &mut Scratch,
    out: &mut [Vec3],
) -> Reached {
    let Some(curves) = Curves::of(group) else { return *reached };
    let unit = curves.load(group.points, scratch);
    let length = measure(curves.longest, &unit, scratch);
    let (points, arc) = (&scratch.points, &scratch.arc);

    let wind_direction = WindDirection::new(bend, group, &curves, &unit);
    let mut towards = [F32x16::splat(0.0); 3];
    let mut share = Share::new(bend, length);
    let mut chain = Chain::new();
    let mut tally = Tally::new();
    let mut before = points[0];
    curves.write(0, &before, out);
    for step in 0..curves.longest - 1 {
        let (pivot, next) = (&points[step], &points[step + 1]);
        let at = curves.at(step);
        if step == 0 || wind_direction.varies() {
            towards = wind_direction.at(&arc[step], &at);
        }
        let segment = unit.between(pivot, next);
        let chord = unit.between(pivot, &points[curves.longest - 1]);
        let share = share.at([&arc[step], &arc[step + 1]], &segment, &at);
        chain.turn(&chord, &towards, &share, |lane| curves.bulge(lane, group.points));
        let moved = chain.advance(bend, &segment, &at);
        let written = chain.displace(next, &unit);
        tally.add(&segment, &moved, &unit.between(&before, &written));
        curves.write(step + 1, &written, out);
        before = written;
    }
    tally.reached(&length, reached)
}

/// Position of each lane's curve in the points.
pub(super) struct Curves {
    /// Index of the group's first point.
    base: usize,
    first: [usize; LANES],
    last: [usize; LANES],
    /// Number of CVs of the lane's curve: 0 if it has none.
    count: [usize; LANES],
    /// Largest number of CVs of a curve, at least 1.
    longest: usize,
}

impl Curves {
    /// `None` if the group has no CVs.
    #[inline(always)]
    fn of(group: &CurveGroup<'_>) -> Option<Self> {
        let base = group.starts[0] as usize;
        let mut curves = Self { base, first: [base; LANES], last: [base; LANES], count: [0; LANES], longest: 0 };
        for (lane, ends) in group.starts.windows(2).enumerate() {
            let (start, end) = (ends[0] as usize, ends[1] as usize);
            if start < end {
                (curves.first[lane], curves.last[lane]) = (start, end - 1);
                curves.count[lane] = end - start;
                curves.longest = curves.longest.max(end - start);
            }
        }
        (curves.longest > 0).then_some(curves)
    }

    /// The index of each lane's CV at `step`: of the last one if the curve has ended.
    #[inline(always)]
    pub(super) fn at(&self, step: usize) -> [usize; LANES] {
        std::array::from_fn(|lane| self.last[lane].min(self.first[lane] + step))
    }

    /// Fills `scratch.points`; returns the units of the lanes.
    #[inline(always)]
    fn load(&self, points: &[Vec3], scratch: &mut Scratch) -> Unit {
        let blank = F32x16::splat(0.0);
        scratch.points.resize(scratch.points.len().max(self.longest), [blank; 3]);
        scratch.arc.resize(scratch.arc.len().max(self.longest), blank);
        let mut size = blank;
        for step in 0..self.longest {
            let at = self.at(step);
            let mut cvs = [blank; 3];
            for lane in 0..LANES {
                set(&mut cvs, lane, points[at[lane]]);
            }
            scratch.points[step] = cvs;
            for lane in 0..LANES {
                let away = vector::sub(get(&cvs, lane), get(&scratch.points[0], lane));
                let away = vector::largest(away);
                size.0[lane] = if away > size.0[lane] { away } else { size.0[lane] };
            }
        }
        Unit::of(&size)
    }

    #[inline(always)]
    fn write(&self, step: usize, points: &Lanes<3>, out: &mut [Vec3]) {
        for lane in 0..LANES {
            if step < self.count[lane] {
                out[self.first[lane] + step - self.base] = get(points, lane);
            }
        }
    }

    /// A vector along the axis about which a lane's input curve bends, whose length is the area between the curve and
    /// its chord ÷ its size²; 0 if it is straight.
    fn bulge(&self, lane: usize, points: &[Vec3]) -> Vec3 {
        let cvs = &points[self.first[lane]..=self.last[lane]];
        let size = cvs.iter().map(|cv| vector::largest(vector::sub(*cv, cvs[0]))).fold(0.0, f32::max);
        let unit = vector::power_of_two_to_one(size).0;
        let from_root = |cv: Vec3| vector::scale(vector::sub(cv, cvs[0]), unit);
        cvs.windows(2).map(|pair| vector::cross(from_root(pair[0]), from_root(pair[1]))).fold([0.0; 3], vector::add)
    }
}

/// Each lane's power of two that scales its curve to a size of 1…2, so that no square overflows or vanishes; scaling by
/// it is exact.
pub(super) struct Unit {
    to: F32x16,
    pub(super) from: F32x16,
}

impl Unit {
    #[inline(always)]
    fn of(size: &F32x16) -> Self {
        let mut unit = Self { to: F32x16::splat(1.0), from: F32x16::splat(1.0) };
        for lane in 0..LANES {
            (unit.to.0[lane], unit.from.0[lane]) = vector::power_of_two_to_one(size.0[lane]);
        }
        unit
    }

    /// b − a, in units.
    #[inline(always)]
    fn between(&self, a: &Lanes<3>, b: &Lanes<3>) -> Lanes<3> {
        let mut out = [F32x16::splat(0.0); 3];
        for axis in 0..3 {
            for lane in 0..LANES {
                out[axis].0[lane] = (b[axis].0[lane] - a[axis].0[lane]) * self.to.0[lane];
            }
        }
        out
    }
}

/// Fills `scratch.arc`; returns the curves' lengths, in units. A compensated sum: otherwise the rounding errors of ten
/// thousand equal segments would add up.
#[inline(always)]
fn measure(longest: usize, unit: &Unit, scratch: &mut Scratch) -> F32x16 {
    let mut sum = F32x16::splat(0.0);
    let mut carry = sum;
    scratch.arc[0] = sum;
    for step in 1..longest {
        let segment = unit.between(&scratch.points[step - 1], &scratch.points[step]);
        for lane in 0..LANES {
            let term = vector::length(get(&segment, lane)) - carry.0[lane];
            let next = sum.0[lane] + term;
            carry.0[lane] = (next - sum.0[lane]) - term;
            sum.0[lane] = next;
        }
        scratch.arc[step] = sum;
    }
    sum
}
