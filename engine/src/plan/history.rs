//! Integrals over time of functions of a node's params, accumulated from frame to frame.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, OnceLock, PoisonError};

use numerics::vector::DVec3;

use super::Resolver;
use crate::graph::Scene;
use crate::node::{History, Integrand, Node};
use crate::time::Frame;

/// Nodes and weights of 4-point Gauss quadrature on −1…1 (Abramowitz & Stegun, table 25.4): exact to degree 7.
const GAUSS: [(f64, f64); 4] = [
    (-0.861_136_311_594_052_6, 0.347_854_845_137_453_85),
    (-0.339_981_043_584_856_26, 0.652_145_154_862_546_1),
    (0.339_981_043_584_856_26, 0.652_145_154_862_546_1),
    (0.861_136_311_594_052_6, 0.347_854_845_137_453_85),
];

/// The four quadrature nodes between `a` and `b`, ascending.
pub(crate) fn gauss_points(a: f64, b: f64) -> [f64; 4] {
    GAUSS.map(|(x, _)| 0.5 * (a + b) + 0.5 * (b - a) * x)
}

/// The first frame at which integrals evaluate params: frame 0, or the scene's start if that is earlier. Before it
/// params are taken as constant, so that integrals have values there too and keys depend on a bounded past.
pub(crate) fn history_start(scene: &Scene) -> i64 {
    scene.first.min(0)
}

/// One node's integrals, in the order of its integrands.
pub(crate) struct Integrals<'a>(Vec<Integral<'a>>);

impl<'a> Integrals<'a> {
    /// `cancel` ends a sum over many frames early: what is made of it is dropped.
    pub(crate) fn new(resolver: &'a Resolver<'a>, node: &Node, scene: &Scene, cancel: &'a AtomicBool) -> Self {
        let of = |integrand: &Integrand| Integral::new(resolver, *integrand, scene, cancel);
        Self(node.integrands.iter().flatten().map(of).collect())
    }
}

impl History for Integrals<'_> {
    fn integral(&self, index: usize, upto: Frame) -> [f64; 3] {
        self.0[index].upto(upto).into()
    }

    fn integrand(&self, index: usize, frame: f64) -> [f64; 3] {
        self.0[index].value(frame).into()
    }

    fn is_animated(&self) -> bool {
        self.0.iter().any(|integral| integral.animated)
    }
}

struct Integral<'a> {
    resolver: &'a Resolver<'a>,
    integrand: Integrand,
    cancel: &'a AtomicBool,
    fps: f64,
    since: Frame,
    /// Whether the integrand changes with time, and its value if it does not.
    animated: bool,
    constant: OnceLock<DVec3>,
    /// Sums over whole frames from frame 0, forwards and backwards, grown on demand in frame order.
    sums: [Mutex<Vec<DVec3>>; 2],
}

impl<'a> Integral<'a> {
    fn new(resolver: &'a Resolver<'a>, integrand: Integrand, scene: &Scene, cancel: &'a AtomicBool) -> Self {
        Self {
            resolver,
            integrand,
            cancel,
            fps: scene.fps,
            since: Frame::whole(history_start(scene)),
            animated: resolver.history_is_animated(),
            constant: OnceLock::new(),
            sums: Default::default(),
        }
    }

    /// ∫ from frame `a` to frame `b`, in the integrand's unit × frames.
    fn over(&self, a: f64, b: f64) -> DVec3 {
        let terms = gauss_points(a, b).into_iter().zip(GAUSS);
        terms.map(|(x, (_, weight))| self.value(x) * (0.5 * (b - a) * weight)).sum()
    }

    /// The integrand at a frame number. Params there are legal, because the key of the current frame has evaluated them
    /// before.
    fn value(&self, frame: f64) -> DVec3 {
        self.resolver.past(frame).map_or([f64::NAN; 3], |params| (self.integrand)(&params)).into()
    }

    /// ∫ from time 0 to `upto`, in the integrand's unit × seconds.
    #[expect(clippy::disallowed_methods, reason = "a param is evaluated on the calling thread")]
    fn upto(&self, upto: Frame) -> DVec3 {
        if !self.animated {
            let value = self.constant.get_or_init(|| self.value(upto.number()));
            return value * upto.seconds(self.fps);
        }
        if upto < self.since {
            let (seen, held) = (self.upto(self.since), self.value(self.since.number()));
            let before = upto.seconds(self.fps) - self.since.seconds(self.fps);
            return seen + held * before;
        }
        let backwards = upto.ticks() < 0;
        let sign = if backwards { -1.0 } else { 1.0 };
        let whole = upto.ticks().unsigned_abs() / Frame::TICKS.unsigned_abs();
        let mut sums = self.sums[usize::from(backwards)].lock().unwrap_or_else(PoisonError::into_inner);
        if sums.is_empty() {
            sums.push(DVec3::zeros());
        }
        while sums.len() as u64 <= whole {
            if self.cancel.load(Ordering::Relaxed) {
                return DVec3::zeros();
            }
            let k = sums.len() as f64;
            let frame = self.over(sign * (k - 1.0), sign * k);
            let before = sums[sums.len() - 1];
            sums.push(before + frame);
        }
        let mut sum = sums[whole as usize];
        drop(sums);
        if !upto.is_whole() {
            let rest = self.over(sign * whole as f64, upto.number());
            sum += rest;
        }
        sum / self.fps
    }
}
