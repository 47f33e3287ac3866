//! The velocity that the surface moves with in a substep.
//!
//! A substep first moves the surface and carries the velocity along; then gravity, pressure and viscosity act. That these act a
//! substep late does no harm to liquid that something holds: waves on a pool neither grow nor fade. But a surface that moves with
//! the velocity of the start of the substep meets, on its way, the velocity that was ahead of it, not the one that is carried
//! along with it. Waves on a stream then grow, by w·sin(φ/4) a substep where a substep is w of their phase on a pool at rest and the
//! stream carries them by φ of it: a wave of 8 cells on a stream of 2 cells a substep, fivefold in 16 substeps.
//!
//! So the surface moves with u + ½Δt·∂u/∂t, where ∂u/∂t is the part of −(u·∇)u that is free of divergence: what the velocity at a
//! place changes by as the flow carries itself along. Liquid that touches nothing falls by half of what gravity adds, too; it
//! follows its path to second order.

use crate::step::motion::{Gain, Guess, LiquidCells, Motion, largest_of};
use crate::step::project::{Materials, PressureEquations, Projection};
use crate::step::sources::Span;
use crate::step::substep::{FARTHEST, SLOPING_LAYERS, STEEPEST};
use crate::step::{LiquidReport, LiquidSettings, Splitting, Surface, Surroundings};
use crate::velocity::{Advection, FaceFields, MacVelocity, Method, Slopes, resampled};

/// How much the way in a substep has to change for the mean velocity to be another, in cells.
const LEAST_BEND: f32 = 1e-3;

/// How much larger than in the solve of a substep errors may be, of that change.
const COARSER: f64 = 100.0;

/// Cells that liquid moves in a substep, at most, for what it carries to be looked for: half of a longer way says nothing of
/// the mean.
const FOLLOWED: f32 = 8.0;

/// Viscosity · Δt ÷ (density · cell²) above which the velocity counts as steady. Waves fade there, and viscosity holds what
/// would fly outward.
const THICK: f32 = 1.0;

/// A liquid at the start of a substep.
pub(super) struct Start<'a> {
    pub settings: &'a LiquidSettings,
    pub surface: &'a dyn Surface,
    pub around: &'a Surroundings<'a>,
    pub span: Span,
    /// What is kept of the substep before, where nothing has changed since.
    pub kept: Option<&'a Kept>,
}

/// What the end of a substep has in common with the start of the next one, between which nothing moves.
pub(super) struct Kept {
    /// The cells of the liquid, beside still solids.
    cells: LiquidCells,
    /// The equations of pressure on them, where these are known and depend on nothing else.
    equations: Option<PressureEquations>,
}

impl Kept {
    /// `equations`: those that were solved on these cells.
    pub(super) fn new(cells: LiquidCells, equations: Option<PressureEquations>) -> Self {
        let equations = equations.filter(PressureEquations::are_uniform);
        Self { cells: LiquidCells { solid_velocity: None, ..cells }, equations }
    }
}

impl Start<'_> {
    fn seconds(&self) -> f64 {
        self.span.times[1] - self.span.times[0]
    }

    /// Cells moved at 1 m/s.
    fn step(&self) -> f32 {
        (self.seconds() / self.settings.cell) as f32
    }

    /// The mean velocity of the substep, on the rows of the velocity, in which gravity adds `gained`, m/s; none where it is that
    /// of the start. `carried`: what is carried in its place, where that is another. `report` counts what it is solved for with.
    pub(super) fn mean_velocity(
        &self,
        motion: &mut Motion,
        carried: Option<&FaceFields<f32>>,
        gained: [f64; 3],
        report: &mut LiquidReport,
    ) -> Option<FaceFields<f32>> {
        let falls = !motion.flying.is_empty() && gained != [0.0; 3];
        let mut guess = std::mem::take(&mut motion.mean_guess);
        let change = self.change(motion, carried, &mut guess, report);
        motion.mean_guess = guess;
        if change.is_none() && !falls {
            return None;
        }
        Some(std::array::from_fn(|axis| {
            let own = motion.velocity().faces()[axis].iter().enumerate();
            let fall = (0.5 * gained[axis]) as f32;
            own.map(|(at, u)| {
                let flies = falls && motion.flying[at] >> axis & 1 == 1;
                let bend = change.as_ref().map_or(0.0, |change| 0.5 * change[axis][at]);
                u + bend + if flies { fall } else { 0.0 }
            })
            .collect()
        }))
    }

    /// What the velocity changes by in the substep as the flow carries itself along and pressure holds it together, m/s, on its
    /// rows; none where that is too little.
    fn change(
        &self,
        motion: &Motion,
        carried: Option<&FaceFields<f32>>,
        guess: &mut Guess,
        report: &mut LiquidReport,
    ) -> Option<FaceFields<f32>> {
        if !self.may_change(motion, FOLLOWED) {
            return None;
        }
        let made;
        let (cells, equations) = match self.kept {
            Some(Kept { cells, equations }) => (cells, equations.as_ref()),
            None => {
                made = self.cells();
                (&made, None)
            }
        };
        let materials = self.materials(motion, cells);
        if materials.are_thicker(cells, THICK) {
            return None;
        }
        let mut faces = self.along(motion, carried, cells);
        materials.clear_thicker(cells, THICK, &mut faces);
        let fastest = largest_of(&faces);
        if 0.5 * self.step() * fastest as f32 <= LEAST_BEND {
            return None;
        }
        let settings = LiquidSettings { tolerance: COARSER * self.settings.tolerance, ..self.settings.clone() };
        let coarse = Start { settings: &settings, ..*self };
        let projection = coarse.projection(cells, materials, [0.0; 3], fastest);
        let made;
        let equations = match equations {
            Some(equations) => equations,
            None => {
                made = projection.pressure_equations();
                &made
            }
        };
        report.count_solves(&projection.by_pressure(equations, fastest, &mut [], &mut faces, guess));
        Some(resampled(motion.rows(), &cells.rows, &faces))
    }

    /// Finds what a substep before would have added to the velocity of liquid that moves, where there was none. Δt·(g −
    /// (u·∇)u) is what the velocity at a place changes by without pressure; what pressure and viscosity leave of it is
    /// what it changes by. Solids count as still: their own motion is in the velocity, or an impulse that does not go on.
    pub(super) fn begin(&self, motion: &mut Motion) -> LiquidReport {
        let is_first = std::mem::take(&mut motion.is_new);
        if !is_first || self.settings.splitting != Splitting::KeepsSpin || !self.may_change(motion, FARTHEST) {
            return LiquidReport::default();
        }
        let cells = self.cells();
        let along = self.along(motion, None, &cells);
        let seconds = self.seconds();
        let pulled = (self.around.gravity)(self.span.times[0]).map(|g| g * seconds);
        let mut faces = along.clone();
        for axis in 0..3 {
            let moving = faces[axis].iter_mut().zip(&cells.moving).filter(|(_, mask)| **mask >> axis & 1 == 1);
            moving.for_each(|(u, _)| *u += pulled[axis] as f32);
        }
        let still = faces.each_ref().map(|field| vec![0.0; field.len()]);
        let materials = self.materials(motion, &cells);
        let projection = self.projection(&cells, materials, pulled, motion.largest_speed());
        let (report, _) = projection.apply(&still, &mut [], &mut faces, motion);
        let gained = |axis: usize| faces[axis].iter().zip(&along[axis]).map(|(after, along)| after - along).collect();
        let gained = [gained(0), gained(1), gained(2)];
        motion.gain = Some(Gain { faces: resampled(motion.rows(), &cells.rows, &gained), seconds });
        report
    }

    /// Whether what the flow carries along may change it: the velocity differs by the steepest slope at most over half of
    /// the way. What moves farther than `farthest` cells is not followed.
    fn may_change(&self, motion: &Motion, farthest: f32) -> bool {
        let way = motion.largest_speed() as f32 * self.step();
        0.5 * STEEPEST * way > LEAST_BEND && way <= farthest
    }

    fn cells(&self) -> LiquidCells {
        let solid = self.around.solid.map(|solid| solid.at(self.span.times[0]).stopped());
        let mut cells = LiquidCells::of(&self.settings.domain, self.surface, solid);
        cells.fill_images();
        cells
    }

    /// What the velocity changes by in the substep as the flow carries itself along, m/s, on the rows of the cells: twice what it
    /// does in half of the substep. Differences from cell to cell lag behind waves not much longer than the way.
    fn along(&self, motion: &Motion, carried: Option<&FaceFields<f32>>, cells: &LiquidCells) -> FaceFields<f32> {
        let (settings, step, domain) = (self.settings, self.step(), &self.settings.domain);
        let way = motion.largest_speed() as f32 * step;
        let solid = self.around.solid.map(|solid| solid.at(self.span.times[0]));
        // What is carried comes from these, and from one more between faces.
        let rows = motion.rows_past_liquid(domain, (0.5 * way).ceil() as i32 + 1);
        let slopes = ([Slopes::nearest(STEEPEST / step)], SLOPING_LAYERS + way.ceil() as u32);
        let own = motion.velocity().faces();
        let half = carried.map(|carried| for_half(own, carried));
        let [velocity] = motion.continued([half.as_ref().unwrap_or(own)], &rows, slopes, domain, solid);
        let velocity = MacVelocity::new(rows, velocity);
        let (bounds, periods, scheme) = (domain.bounds(), domain.periods(), settings.scheme);
        // Half of a way is short enough for the second order.
        let method = Method::Midpoint;
        let half = Advection { velocity: &velocity, bounds, periods, step: 0.5 * step, method, scheme };
        let mut faces = half.carry(velocity.faces(), &cells.rows, &cells.moving);
        let own = resampled(&cells.rows, motion.rows(), own);
        for axis in 0..3 {
            for ((u, own), moving) in faces[axis].iter_mut().zip(&own[axis]).zip(&cells.moving) {
                *u = if moving >> axis & 1 == 1 { 2.0 * (*u - own) } else { 0.0 };
            }
        }
        cells.images.fill_each(&mut faces);
        faces
    }

    fn materials(&self, motion: &Motion, cells: &LiquidCells) -> Materials {
        let Self { settings, surface, around, span, .. } = *self;
        let own = [(around.viscosity)(span.times[0]), settings.density];
        // Taking stock of the points of materials may change them: the substep itself will do so.
        let mut points = motion.materials.clone();
        let of_cells = points
            .as_mut()
            .map(|points| cells.settle(points, surface.view(), &settings.domain, own.map(|own| own as f32)));
        Materials::new(own, of_cells, settings, self.seconds())
    }

    /// Around still solids. `gravity`: what it adds, m/s; `speed`: what errors are measured against, m/s.
    fn projection<'c>(
        &'c self,
        cells: &'c LiquidCells,
        materials: Materials,
        gravity: [f64; 3],
        speed: f64,
    ) -> Projection<'c> {
        let solid = self.around.solid.map(|solid| solid.at(self.span.times[0]).stopped());
        let (settings, seconds) = (self.settings, self.seconds());
        Projection { settings, cells, materials, solid, cut: &[], imposed: &[], speed, gravity, seconds }
    }
}

/// The velocity to carry over half of a substep, where `carried` is the one for all of it. What is added to keep spin grows with the
/// square of the time.
fn for_half(own: &FaceFields<f32>, carried: &FaceFields<f32>) -> FaceFields<f32> {
    std::array::from_fn(|axis| {
        own[axis].iter().zip(&carried[axis]).map(|(own, carried)| own + 0.25 * (carried - own)).collect()
    })
}
