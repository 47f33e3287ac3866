//! Points and fields carried by a velocity.

use numerics::lanes::{F32x16, LANES, Lanes, get, set};
use numerics::simd::{Path, kernel};
use numerics::vector::Vec3;

use crate::rows::{Cell, CellRows, Periods, PlacedSpan};
use crate::velocity::batch::{ValuesAround, velocity};
use crate::velocity::{Around, FaceFields, FaceMask, MacVelocity, Sampler, Site, within};

/// How points are followed through a velocity that does not change meanwhile.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// The midpoint method, of second order.
    Midpoint,
    /// Ralston's third-order method (1962).
    #[default]
    Ralston,
}

/// Follows points through a velocity that does not change meanwhile.
#[derive(Clone, Debug)]
pub struct Tracer<'a> {
    velocity: &'a MacVelocity,
    sampler: Sampler<'a>,
    bounds: [Vec3; 2],
    periods: Periods,
    step: f32,
    method: Method,
}

impl<'a> Tracer<'a> {
    /// Points stay in the box `bounds`, low corner and high. `step`: cells that a point moves at speed 1, negative to
    /// follow it back.
    pub fn new(velocity: &'a MacVelocity, bounds: [Vec3; 2], step: f32) -> Self {
        let (sampler, periods, method) = (Sampler::new(velocity.rows()), Periods::NONE, Method::default());
        Self { velocity, sampler, bounds, periods, step, method }
    }

    /// Points that go out at a side that repeats come in at the other.
    #[must_use]
    pub fn repeating(self, periods: Periods) -> Self {
        Self { periods, ..self }
    }

    /// By another method than Ralston's.
    #[must_use]
    pub fn by(self, method: Method) -> Self {
        Self { method, ..self }
    }

    /// Where points at `starts` go, given the velocity there.
    pub fn trace(&mut self, starts: &Lanes<3>, velocities: &Lanes<3>) -> Lanes<3> {
        trace(Path::chosen(), self, starts, velocities)
    }

    #[inline(always)]
    fn trace_lanes(&mut self, starts: &Lanes<3>, a: &Lanes<3>) -> Lanes<3> {
        let b = self.moved(starts, &scaled(a, 0.5));
        let b = velocity(&mut self.sampler, self.velocity.faces(), &b);
        if self.method == Method::Midpoint {
            return self.moved(starts, &b);
        }
        let c = self.moved(starts, &scaled(&b, 0.75));
        let c = velocity(&mut self.sampler, self.velocity.faces(), &c);
        let mut mean = *a;
        for axis in 0..3 {
            for lane in 0..LANES {
                let [a, b, c] = [a[axis].0[lane], b[axis].0[lane], c[axis].0[lane]];
                mean[axis].0[lane] = a * (2.0 / 9.0) + (b * (3.0 / 9.0) + c * (4.0 / 9.0));
            }
        }
        self.moved(starts, &mean)
    }

    #[inline(always)]
    fn moved(&self, starts: &Lanes<3>, velocities: &Lanes<3>) -> Lanes<3> {
        let mut points = *starts;
        for axis in 0..3 {
            for lane in 0..LANES {
                points[axis].0[lane] += velocities[axis].0[lane] * self.step;
            }
        }
        if self.periods.any() {
            for lane in 0..LANES {
                let home = self.periods.home_point(get(&points, lane));
                set(&mut points, lane, home);
            }
        }
        for axis in 0..3 {
            for lane in 0..LANES {
                points[axis].0[lane] = within(points[axis].0[lane], self.bounds[0][axis], self.bounds[1][axis]);
            }
        }
        points
    }
}

#[inline(always)]
fn scaled(velocities: &Lanes<3>, by: f32) -> Lanes<3> {
    let mut out = *velocities;
    for axis in 0..3 {
        for lane in 0..LANES {
            out[axis].0[lane] *= by;
        }
    }
    out
}

kernel! {
    fn trace(tracer: &mut Tracer<'_>, starts: &Lanes<3>, velocities: &Lanes<3>) -> Lanes<3> = trace_body;
}

#[inline(always)]
fn trace_body(tracer: &mut Tracer<'_>, starts: &Lanes<3>, velocities: &Lanes<3>) -> Lanes<3> {
    tracer.trace_lanes(starts, velocities)
}

/// How values are carried.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scheme {
    /// The value where the face came from.
    SemiLagrangian,
    /// The same, less half of what it changes going there and back (Selle et al. 2008), within the values around the
    /// place that the face came from. Where the way back ends among faces that are not carried, semi-Lagrangian: continuing
    /// the carried ones past them made a turning disk of 10 cells radius gain 3 % of its spin in a turn.
    MacCormack,
}

/// A velocity that carries fields on its own rows to other rows.
#[derive(Clone, Copy, Debug)]
pub struct Advection<'a> {
    /// The velocity, known wherever faces come from.
    pub velocity: &'a MacVelocity,
    /// The box that nothing leaves or comes from outside of, low corner and high.
    pub bounds: [Vec3; 2],
    /// After how many cells everything repeats.
    pub periods: Periods,
    /// Cells moved at speed 1.
    pub step: f32,
    /// How faces are followed.
    pub method: Method,
    /// How values are carried.
    pub scheme: Scheme,
}

/// A value carried, and the least and the largest around the place that it came from.
type Bounded = [f32; 3];

/// Faces across one axis that are followed side by side.
struct Batch {
    axis: usize,
    /// Where their values are stored.
    at: [usize; LANES],
    /// The same in the fields that are carried; [`NOWHERE`] where not all around are stored.
    before: [usize; LANES],
    starts: Lanes<3>,
    velocities: Lanes<3>,
    len: usize,
}

const NOWHERE: usize = usize::MAX;

impl Batch {
    /// The next `count` faces: where they are and where their values are stored, given that of the first.
    #[inline(always)]
    fn put(&mut self, count: usize, cell: Cell, [at, before]: [usize; 2]) {
        let start = Site::FACES[self.axis].of(cell);
        for n in 0..count {
            let lane = self.len + n;
            (self.at[lane], self.before[lane]) = (at + n, before.wrapping_add(n));
            set(&mut self.starts, lane, [start[0] + n as f32, start[1], start[2]]);
        }
    }
}

kernel! {
    fn carried(tracer: &mut Tracer<'_>, batch: &Batch, field: &[f32]) -> [F32x16; 3] = carried_body;
}

kernel! {
    fn returned(
        tracer: &mut Tracer<'_>, batch: &Batch, there: &mut Sampler<'_>, field: &[f32], wanted: &[FaceMask],
    ) -> (F32x16, [bool; LANES]) = returned_body;
}

/// The value of a field where each face comes from, and the least and the largest around.
#[inline(always)]
fn carried_body(tracer: &mut Tracer<'_>, batch: &Batch, field: &[f32]) -> [F32x16; 3] {
    let from = tracer.trace_lanes(&batch.starts, &batch.velocities);
    let around = ValuesAround::of(&mut tracer.sampler, field, Site::FACES[batch.axis], &from);
    let [low, high] = around.range();
    [around.value(), low, high]
}

/// The value of a carried field where each face goes, where it is known from wanted faces alone; whether it is.
#[inline(always)]
fn returned_body(
    tracer: &mut Tracer<'_>,
    batch: &Batch,
    there: &mut Sampler<'_>,
    field: &[f32],
    wanted: &[FaceMask],
) -> (F32x16, [bool; LANES]) {
    let to = tracer.trace_lanes(&batch.starts, &batch.velocities);
    let (values, is_known) =
        ValuesAround::where_stored(there, field, Site::FACES[batch.axis], &to, wanted, 1 << batch.axis);
    (values.value(), is_known)
}

impl Advection<'_> {
    /// The fields `carried`, stored on the rows of the velocity, on faces `wanted` of `rows`; 0 on other faces.
    ///
    /// # Panics
    /// Where a field does not have one value a cell.
    pub fn carry(&self, carried: &FaceFields<f32>, rows: &CellRows, wanted: &[FaceMask]) -> FaceFields<f32> {
        assert!(carried.iter().all(|field| field.len() == self.velocity.rows().len()));
        assert_eq!(wanted.len(), rows.len());
        let bounded = self.bounded(carried, rows, wanted);
        match self.scheme {
            Scheme::SemiLagrangian => bounded.map(|field| values(&field)),
            Scheme::MacCormack => self.corrected(&bounded, carried, rows, wanted),
        }
    }

    fn tracer(&self, step: f32) -> Tracer<'_> {
        Tracer::new(self.velocity, self.bounds, step).repeating(self.periods).by(self.method)
    }

    /// Of each wanted face the value where it came from, and the least and largest value around.
    fn bounded(&self, carried: &FaceFields<f32>, rows: &CellRows, wanted: &[FaceMask]) -> [Vec<Bounded>; 3] {
        let path = Path::chosen();
        rows.tabulate_parts(|spans, first, out| {
            let mut tracer = self.tracer(-self.step);
            for (axis, out) in out.into_iter().enumerate() {
                self.in_batches(spans, wanted, axis, &mut tracer, |tracer, batch| {
                    let [value, low, high] = self::carried(path, tracer, batch, &carried[axis]);
                    for lane in 0..batch.len {
                        out[batch.at[lane] - first] = [value.0[lane], low.0[lane], high.0[lane]];
                    }
                });
            }
        })
    }

    /// The values less half of what they change going there and back.
    fn corrected(
        &self,
        bounded: &[Vec<Bounded>; 3],
        carried: &FaceFields<f32>,
        rows: &CellRows,
        wanted: &[FaceMask],
    ) -> FaceFields<f32> {
        let path = Path::chosen();
        let there = bounded.each_ref().map(|field| values(field));
        rows.tabulate_parts(|spans, first, out| {
            let (mut tracer, mut new) = (self.tracer(self.step), Sampler::new(rows));
            for (axis, out) in out.into_iter().enumerate() {
                self.in_batches(spans, wanted, axis, &mut tracer, |tracer, batch| {
                    let (back, is_known) = returned(path, tracer, batch, &mut new, &there[axis], wanted);
                    for lane in 0..batch.len {
                        let at = batch.at[lane];
                        let [value, low, high] = bounded[axis][at];
                        let before = match batch.before[lane] {
                            NOWHERE => {
                                let corners = tracer.sampler.corners(Site::FACES[axis], get(&batch.starts, lane));
                                corners.map(|corners| corners.value(&carried[axis]))
                            }
                            own => Some(carried[axis][own]),
                        };
                        out[at - first] = match before.filter(|_| is_known[lane]) {
                            Some(before) => within(value + 0.5 * (before - back.0[lane]), low, high),
                            None => value,
                        };
                    }
                });
            }
        })
    }

    /// Calls `f` with the wanted faces across an axis of some spans.
    fn in_batches<'a>(
        &'a self,
        spans: &[PlacedSpan],
        wanted: &[FaceMask],
        axis: usize,
        tracer: &mut Tracer<'a>,
        mut f: impl FnMut(&mut Tracer<'a>, &Batch),
    ) {
        let (site, faces) = (Site::FACES[axis], self.velocity.faces());
        let mut around = Around::new(self.velocity.rows());
        let nothing = [F32x16::splat(0.0); 3];
        let (at, before) = ([0; LANES], [NOWHERE; LANES]);
        let mut batch = Batch { axis, at, before, starts: nothing, velocities: nothing, len: 0 };
        for ([y, z], span) in spans {
            let mut x = span.start;
            while x < span.end {
                let (cell, at) = ([x, *y, *z], span.at(x));
                let rest = &wanted[at..span.at(span.end)];
                let run = rest.iter().take_while(|wanted| **wanted >> axis & 1 == 1).take(LANES - batch.len).count();
                if run == 0 {
                    x += 1;
                    continue;
                }
                let run = match around.places_of_run(cell) {
                    Some((places, len)) => {
                        let run = run.min(len);
                        batch.put(run, cell, [at, places.own()]);
                        let velocities = batch.velocities.each_mut().map(|lanes| &mut lanes.0[batch.len..][..run]);
                        places.at_faces(faces, axis, velocities);
                        run
                    }
                    None => {
                        batch.put(1, cell, [at, NOWHERE]);
                        let velocity = tracer.sampler.velocity(faces, site.of(cell));
                        set(&mut batch.velocities, batch.len, velocity);
                        1
                    }
                };
                x += run as i32;
                batch.len += run;
                if batch.len == LANES {
                    f(tracer, &batch);
                    batch.len = 0;
                }
            }
        }
        if batch.len > 0 {
            // The other lanes go where the first goes; they do not count.
            for lane in batch.len..LANES {
                let [start, velocity] = [get(&batch.starts, 0), get(&batch.velocities, 0)];
                set(&mut batch.starts, lane, start);
                set(&mut batch.velocities, lane, velocity);
            }
            f(tracer, &batch);
        }
    }
}

/// Those of bounded values that were carried.
fn values(bounded: &[Bounded]) -> Vec<f32> {
    bounded.iter().map(|[value, ..]| *value).collect()
}
