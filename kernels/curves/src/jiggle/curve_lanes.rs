//! Sixteen curves side by side: one lane for each curve, one state for each CV of a lane.
//!
//! A lane whose curve has ended repeats its last CV, which is not written again.

use super::response::Response;
use super::rigid_step::RigidStep;
use numerics::lanes::{F32x16, F64x16, LANES, Lanes, get, set};
use numerics::masked::Masked;
use numerics::simd::kernel;
use numerics::vector::Vec3;

/// Evaluates `of` for each axis. Not a loop: with mixed f32 and f64 the compiler would unroll the lanes inside it and
/// vectorise over the three axes.
#[inline(always)]
fn axes<T>(of: impl Fn(usize) -> T) -> [T; 3] {
    [of(0), of(1), of(2)]
}

/// b − a, exact if they are close to each other.
#[inline(always)]
fn between(a: &Lanes<3>, b: &Lanes<3>) -> [F64x16; 3] {
    axes(|axis| F64x16::from_fn(|lane| f64::from(b[axis].0[lane]) - f64::from(a[axis].0[lane])))
}

/// The state of one CV of each lane.
#[derive(Clone, Copy, Debug)]
pub(super) struct CvState {
    /// Offset of the CV from its target, metres.
    pub(super) offset: [F64x16; 3],
    /// Metres per step.
    pub(super) velocity: [F64x16; 3],
    /// The target.
    pub(super) target: Lanes<3>,
}

/// The steps of one CV of each lane.
#[derive(Clone, Copy, Debug)]
pub(super) struct Responses {
    numbers: [F64x16; 6],
}

impl Responses {
    pub(super) const NONE: Self = Self { numbers: [F64x16::ZERO; 6] };

    pub(super) fn set(&mut self, lane: usize, response: Response) {
        let Response { a, b, c, e, k, l } = response;
        for (numbers, number) in self.numbers.iter_mut().zip([a, b, c, e, k, l]) {
            numbers.0[lane] = number;
        }
    }
}

/// Up to sixteen curves.
#[derive(Clone, Debug)]
pub(super) struct CurveLanes {
    /// The curve of each lane; the last curve for a lane without one.
    pub(super) curve: [u32; LANES],
    first: [u32; LANES],
    last: [u32; LANES],
    /// Number of CVs of each lane: 0 if it has no curve.
    count: [u32; LANES],
    /// Largest number of CVs of a curve.
    pub(super) longest: usize,
}

impl CurveLanes {
    /// At most sixteen curves, from `first` on.
    pub(super) fn new(starts: &[u32], first: usize) -> Self {
        let end = (first + LANES).min(starts.len() - 1);
        let base = starts[first];
        let last = (end - 1) as u32;
        let mut curves =
            Self { curve: [last; LANES], first: [base; LANES], last: [base; LANES], count: [0; LANES], longest: 0 };
        for lane in 0..end - first {
            let [start, until] = [starts[first + lane], starts[first + lane + 1]];
            curves.curve[lane] = (first + lane) as u32;
            if start < until {
                (curves.first[lane], curves.last[lane]) = (start, until - 1);
                curves.count[lane] = until - start;
                curves.longest = curves.longest.max((until - start) as usize);
            }
        }
        curves
    }

    /// The point of each lane at CV `step`.
    #[inline(always)]
    pub(super) fn at(&self, step: usize) -> [usize; LANES] {
        std::array::from_fn(|lane| self.last[lane].min(self.first[lane] + step as u32) as usize)
    }

    /// The lanes that have a CV at `step`, with its index.
    pub(super) fn cvs(&self, step: usize) -> impl Iterator<Item = (usize, usize)> {
        let lanes = (0..LANES).filter(move |lane| (step as u32) < self.count[*lane]);
        lanes.map(move |lane| (lane, self.first[lane] as usize + step))
    }

    /// Writes the CVs of the lanes to `out`, whose first point has index `base`.
    #[inline(always)]
    fn write(&self, step: usize, points: &Lanes<3>, base: usize, out: &mut [Vec3]) {
        for lane in 0..LANES {
            if (step as u32) < self.count[lane] {
                out[self.first[lane] as usize + step - base] = get(points, lane);
            }
        }
    }

    #[inline(always)]
    pub(super) fn load(&self, step: usize, points: &[Vec3]) -> Lanes<3> {
        let at = self.at(step);
        let mut lanes = [F32x16::splat(0.0); 3];
        for lane in 0..LANES {
            set(&mut lanes, lane, points[at[lane]]);
        }
        lanes
    }
}

kernel! {
    /// Steps to `targets`, with the motion that each curve inherits, if any.
    pub(super) fn step_lanes(
        curves: &CurveLanes,
        states: &mut [CvState],
        responses: &[Responses],
        targets: &[Vec3],
        carries: Option<&[RigidStep]>,
    ) -> () = step;
}

#[inline(always)]
fn step(
    curves: &CurveLanes,
    states: &mut [CvState],
    responses: &[Responses],
    targets: &[Vec3],
    carries: Option<&[RigidStep]>,
) {
    let inherited = carries.map(|carries| InheritedMotion::of(curves, carries));
    for (step, (state, responses)) in states.iter_mut().zip(responses).enumerate() {
        let now = curves.load(step, targets);
        let mut displacement = [F64x16::ZERO; 3];
        for axis in 0..3 {
            for lane in 0..LANES {
                displacement[axis].0[lane] = f64::from(now[axis].0[lane]) - f64::from(state.target[axis].0[lane]);
            }
        }
        if let Some(inherited) = &inherited {
            inherited.carry(state, &mut displacement);
        }
        let [a, b, c, e, k, l] = &responses.numbers;
        for axis in 0..3 {
            for lane in 0..LANES {
                let (offset, velocity) = (state.offset[axis].0[lane], state.velocity[axis].0[lane]);
                let displacement = displacement[axis].0[lane];
                state.offset[axis].0[lane] = (a.0[lane] * offset + b.0[lane] * velocity) + k.0[lane] * displacement;
                state.velocity[axis].0[lane] = (c.0[lane] * offset + e.0[lane] * velocity) + l.0[lane] * displacement;
            }
        }
        state.target = now;
    }
}

/// The motion that sixteen curves inherit.
struct InheritedMotion {
    change: [[F64x16; 3]; 3],
    about: [F64x16; 3],
    shift: [F64x16; 3],
}

impl InheritedMotion {
    #[inline(always)]
    fn of(curves: &CurveLanes, carries: &[RigidStep]) -> Self {
        let zero = [F64x16::ZERO; 3];
        let mut inherited = Self { change: [zero; 3], about: zero, shift: zero };
        for lane in 0..LANES {
            let carry = &carries[curves.curve[lane] as usize];
            for row in 0..3 {
                for column in 0..3 {
                    inherited.change[row][column].0[lane] = carry.change[(row, column)];
                }
                inherited.about[row].0[lane] = carry.about[row];
                inherited.shift[row].0[lane] = carry.shift[row];
            }
        }
        inherited
    }

    /// Moves the state of a CV along, and subtracts the inherited motion from the displacement of its target.
    #[inline(always)]
    fn carry(&self, state: &mut CvState, displacement: &mut [F64x16; 3]) {
        let mut from = [F64x16::ZERO; 3];
        for axis in 0..3 {
            for lane in 0..LANES {
                from[axis].0[lane] = f64::from(state.target[axis].0[lane]) - self.about[axis].0[lane];
            }
        }
        let (from, offset, velocity) =
            (self.rotated(&from), self.rotated(&state.offset), self.rotated(&state.velocity));
        for axis in 0..3 {
            for lane in 0..LANES {
                displacement[axis].0[lane] -= from[axis].0[lane] + self.shift[axis].0[lane];
                state.offset[axis].0[lane] += offset[axis].0[lane];
                state.velocity[axis].0[lane] += velocity[axis].0[lane];
            }
        }
    }

    /// Change of a vector by the rotation.
    #[inline(always)]
    fn rotated(&self, v: &[F64x16; 3]) -> [F64x16; 3] {
        let mut out = [F64x16::ZERO; 3];
        for axis in 0..3 {
            let [x, y, z] = &self.change[axis];
            for lane in 0..LANES {
                out[axis].0[lane] = (x.0[lane] * v[0].0[lane] + y.0[lane] * v[1].0[lane]) + z.0[lane] * v[2].0[lane];
            }
        }
        out
    }
}

/// Fraction of the offset that is applied at a CV of each curve, 0..1.
#[inline(always)]
fn shown_at(blend: &Masked<'_, f32>, curves: &CurveLanes, step: usize) -> F64x16 {
    let Some(mask) = blend.mask else { return F64x16([f64::from(blend.value); LANES]) };
    let at = curves.at(step);
    F64x16::from_fn(|lane| {
        let share = blend.value * mask[at[lane]];
        let share = if share > 0.0 { share } else { 0.0 };
        f64::from(if share < 1.0 { share } else { 1.0 })
    })
}

kernel! {
    /// Writes the curves, with segments as long as their targets', to `out`, whose first point has index `base`.
    /// Returns the largest squared distance from the target.
    pub(super) fn shape_lanes(
        curves: &CurveLanes,
        states: &[CvState],
        blend: Masked<'_, f32>,
        base: usize,
        out: &mut [Vec3],
    ) -> f64 = shape;
}

#[inline(always)]
fn shape(curves: &CurveLanes, states: &[CvState], blend: Masked<'_, f32>, base: usize, out: &mut [Vec3]) -> f64 {
    let mut farthest = F64x16::ZERO;
    let mut moved = [F64x16::ZERO; 3];
    let Some(root) = states.first() else { return 0.0 };
    // The root's offset is 0.
    let (mut target, mut shown) = (&root.target, [F64x16::ZERO; 3]);
    curves.write(0, target, base, out);
    for (step, state) in states.iter().enumerate().skip(1) {
        let shares = shown_at(&blend, curves, step);
        let next = axes(|axis| F64x16::from_fn(|lane| state.offset[axis].0[lane] * shares.0[lane]));
        let rest = between(target, &state.target);
        let swung =
            axes(|axis| F64x16::from_fn(|lane| rest[axis].0[lane] + (next[axis].0[lane] - shown[axis].0[lane])));
        let (long, now) = (squares(&rest), squares(&swung));
        // Equal segments give exactly 1; a segment without a direction keeps its target's.
        let ratio = F64x16::from_fn(|lane| (long.0[lane] / now.0[lane]).sqrt());
        let scale = F64x16::from_fn(|lane| if now.0[lane] > 0.0 { ratio.0[lane] } else { 0.0 });
        let straight = F64x16::from_fn(|lane| if now.0[lane] > 0.0 { 0.0 } else { 1.0 });
        // Not `axes`: closures as long as this are not inlined, and are compiled without the path's instructions.
        let ends = Ends { rest: &rest, swung: &swung, scale: &scale, straight: &straight };
        moved = [ends.moved(&moved, 0), ends.moved(&moved, 1), ends.moved(&moved, 2)];
        let distance = squares(&moved);
        farthest = F64x16::from_fn(|lane| {
            let distance = if (step as u32) < curves.count[lane] { distance.0[lane] } else { 0.0 };
            if distance > farthest.0[lane] { distance } else { farthest.0[lane] }
        });
        let written = [written(state, &moved, 0), written(state, &moved, 1), written(state, &moved, 2)];
        curves.write(step, &written, base, out);
        (target, shown) = (&state.target, next);
    }
    farthest.0.into_iter().fold(0.0, f64::max)
}

/// Segments as they are at their targets, and as they swing: those are scaled to their lengths, or, without a direction,
/// kept as at their targets.
struct Ends<'a> {
    rest: &'a [F64x16; 3],
    swung: &'a [F64x16; 3],
    scale: &'a F64x16,
    straight: &'a F64x16,
}

impl Ends<'_> {
    /// The displacement of the segments' ends along an axis, given that of their starts.
    #[inline(always)]
    fn moved(&self, before: &[F64x16; 3], axis: usize) -> F64x16 {
        F64x16::from_fn(|lane| {
            let rest = self.rest[axis].0[lane];
            let end = self.scale.0[lane] * self.swung[axis].0[lane] + self.straight.0[lane] * rest;
            before[axis].0[lane] + (end - rest)
        })
    }
}

/// The coordinates of CVs along an axis, displaced from their targets.
#[inline(always)]
fn written(state: &CvState, moved: &[F64x16; 3], axis: usize) -> F32x16 {
    F32x16::from_fn(|lane| {
        let (target, moved) = (state.target[axis].0[lane], moved[axis].0[lane]);
        let to = (f64::from(target) + moved) as f32;
        // Unmoved coordinates are not summed: −0 + 0 would lose its sign.
        if moved == 0.0 { target } else { to }
    })
}

/// Squared lengths.
#[inline(always)]
fn squares(v: &[F64x16; 3]) -> F64x16 {
    F64x16::from_fn(|lane| {
        let [x, y, z] = [v[0].0[lane], v[1].0[lane], v[2].0[lane]];
        (x * x + y * y) + z * z
    })
}
