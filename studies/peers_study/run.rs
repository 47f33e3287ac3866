//! Runs one method on one scene and measures it.

use crate::model::Model;
use crate::scene::{FRAME, GRAVITY, Scene, SceneContacts};
use crate::vbd::Vbd;
use crate::xpbd::Xpbd;
use bodies::mass_spring::{BodySolver, Integrator, SolverFrame, State};
use cpu_time::ProcessTime;
use numerics::vector::DVec3;

/// A method with its settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Method {
    Ours {
        integrator: Integrator,
        steps: u32,
    },
    Xpbd {
        steps: u32,
        iterations: u32,
    },
    /// `radius` is Chebyshev's ρ; 0: no acceleration.
    Vbd {
        steps: u32,
        iterations: u32,
        radius: f64,
    },
}

/// Results of a run.
pub(crate) struct Run {
    /// Processor time a frame, milliseconds.
    pub(crate) ms: f64,
    /// Evaluations of all springs a frame.
    pub(crate) passes: f64,
    /// Positions of all particles at the end of each frame.
    pub(crate) trace: Vec<Vec<DVec3>>,
    /// Over all frames: largest depth below the gap, relative to the gap.
    pub(crate) overlap: f64,
    /// Over all frames: largest relative loss of volume; smallest relative volume of a tetrahedron.
    pub(crate) lost: f64,
    pub(crate) least: f64,
}

impl Run {
    pub(crate) fn new(scene: &Scene, method: Method) -> Self {
        let model = || Model::new(scene);
        match method {
            Method::Ours { integrator, steps } => Self::ours(scene, integrator, steps),
            Method::Xpbd { steps, iterations } => {
                let mut xpbd = Xpbd::new(model(), &scene.points, steps, iterations);
                Self::frames(scene, |frame, x| {
                    let passes = xpbd.frame(frame);
                    x.copy_from_slice(xpbd.positions());
                    passes
                })
            }
            Method::Vbd { steps, iterations, radius } => {
                let mut vbd = Vbd::new(model(), &scene.points, steps, iterations, radius);
                Self::frames(scene, |frame, x| {
                    let passes = vbd.frame(frame);
                    x.copy_from_slice(vbd.positions());
                    passes
                })
            }
        }
    }

    fn ours(scene: &Scene, integrator: Integrator, substeps: u32) -> Self {
        /// Evaluations of all springs in a Newton iteration: linearisation and residual, and as many for the line
        /// search.
        const NEWTON: u32 = 4;
        /// Evaluations in a step: initial force and energies.
        const STEP: u32 = 2;
        let mut state = State::at_rest(&scene.body);
        let mut solver = BodySolver::new(&scene.body);
        Self::frames(scene, |frame, x| {
            let touched = SceneContacts { scene, frame };
            let touches = scene.tools.ground || scene.tools.roller.is_some();
            let asked = SolverFrame {
                seconds: FRAME,
                gravity: GRAVITY.into(),
                pins: &scene.pins,
                contacts: touches.then_some(&touched),
                integrator,
                substeps,
                ..SolverFrame::default()
            };
            let report = solver.step(&scene.body, &mut state, &asked);
            x.iter_mut().zip(&state.positions).for_each(|(x, p)| *x = DVec3::from(*p));
            f64::from(report.cg + NEWTON * report.newton + STEP * report.substeps)
        })
    }

    fn frames(scene: &Scene, mut go: impl FnMut(u32, &mut [DVec3]) -> f64) -> Self {
        let mut x = scene.points.clone();
        let mut run = Self { ms: 0.0, passes: 0.0, trace: Vec::new(), overlap: 0.0, lost: 0.0, least: f64::INFINITY };
        let each = 1.0 / f64::from(scene.frames);
        for frame in 0..scene.frames {
            let clock = ProcessTime::now();
            run.passes += go(frame, &mut x) * each;
            run.ms += clock.elapsed().as_secs_f64() * 1e3 * each;
            let (ratio, least) = scene.volume(&x);
            run.overlap = run.overlap.max(scene.overlap(&x, FRAME * f64::from(frame + 1)));
            run.lost = run.lost.max(1.0 - ratio);
            run.least = run.least.min(least);
            run.trace.push(x.clone());
        }
        run
    }

    /// Root mean square distance from another run of the same scene ÷ the body's size: over particles and frames, and
    /// over particles at the end.
    pub(crate) fn error(&self, other: &Self, size: f64) -> (f64, f64) {
        let square = |(a, b): (&Vec<DVec3>, &Vec<DVec3>)| {
            a.iter().zip(b).map(|(a, b)| (a - b).norm_squared()).sum::<f64>() / a.len().max(1) as f64
        };
        let squares: Vec<f64> = self.trace.iter().zip(&other.trace).map(square).collect();
        let mean = squares.iter().sum::<f64>() / squares.len().max(1) as f64;
        (mean.sqrt() / size, squares.last().copied().unwrap_or(0.0).sqrt() / size)
    }
}
