//! The time that passes within a step, and what acts on bodies at each of its times.
//!
//! `gravity`, `drag` and `time_scale` may change between two frames. The solver asks for the first two at fractions of
//! the simulated time of the step; with a changing `time_scale` these are not fractions of the frame.

use bodies::mass_spring::Ambient;
use engine::prelude::*;

/// Number of equal parts of a frame between which `time_scale` is taken to change linearly.
const PARTS: usize = 32;

/// The params that vary within a step.
struct Sample {
    ambient: Ambient,
    time_scale: f64,
}

impl Sample {
    fn at(cx: &FrameCx, frame: f64) -> Self {
        let [gravity, [drag, time_scale, _]] = cx.integrands(frame);
        Self { ambient: Ambient { gravity, drag }, time_scale }
    }
}

/// How simulated time passes between two frames, and gravity and drag meanwhile.
pub(super) struct Pace<'a> {
    cx: &'a FrameCx<'a>,
    /// Frame numbers.
    frames: [f64; 2],
    /// Whether gravity or drag changes.
    pub(super) varies: bool,
    /// `time_scale` at the ends of equal parts of the frame, and its integral up to there in parts; empty if it is constant.
    scales: Vec<[f64; 2]>,
}

impl<'a> Pace<'a> {
    pub(super) fn new(cx: &'a FrameCx<'a>, frames: [f64; 2]) -> Self {
        let mut pace = Self { cx, frames, varies: false, scales: Vec::new() };
        if !cx.integrands_vary() || frames[0] == frames[1] {
            // Throughout the scene, or at its start.
            return pace;
        }
        let frame = |part: usize| pace.at(part as f64 / PARTS as f64);
        let samples: Vec<Sample> = (0..=PARTS).map(|part| Sample::at(cx, frame(part))).collect();
        pace.varies = samples.iter().any(|sample| sample.ambient != samples[0].ambient);
        if samples.iter().any(|sample| sample.time_scale != samples[0].time_scale) {
            pace.scales.push([samples[0].time_scale, 0.0]);
            let mut passed = 0.0;
            for ends in samples.windows(2) {
                passed += 0.5 * (ends[0].time_scale + ends[1].time_scale);
                pace.scales.push([ends[1].time_scale, passed]);
            }
        }
        pace
    }

    /// Simulated seconds of the step.
    pub(super) fn seconds(&self, cx: &StepCx) -> f64 {
        if self.scales.is_empty() {
            return cx.dt() * f64::from(cx.get(super::TIME_SCALE));
        }
        let [before, now] = [cx.previous(), cx.frame()].map(|frame| cx.integrals::<2>(frame)[1][1]);
        (now - before).max(0.0)
    }

    /// The frame number at a share of the frame.
    fn at(&self, share: f64) -> f64 {
        let [first, last] = self.frames;
        if share >= 1.0 { last } else { first + (last - first) * share }
    }

    /// Gravity and drag at a fraction of the simulated time of the step.
    pub(super) fn ambient(&self, time: f64) -> Ambient {
        Sample::at(self.cx, self.at(self.share(time))).ambient
    }

    /// The share of the frame at a fraction of its simulated time: where the integral of `time_scale` is that fraction.
    fn share(&self, time: f64) -> f64 {
        let Some([_, all]) = self.scales.last() else { return time };
        let wanted = time * all;
        let part = self.scales.partition_point(|[_, passed]| *passed <= wanted).clamp(1, PARTS) - 1;
        let ([low, passed], [high, _]) = (self.scales[part], self.scales[part + 1]);
        // The smaller root of low·u + (high − low)·u²/2 = left, without cancellation.
        let left = (wanted - passed).max(0.0);
        let root = (low * low + 2.0 * (high - low) * left).max(0.0).sqrt();
        let within = if left > 0.0 { (2.0 * left / (low + root)).min(1.0) } else { 0.0 };
        ((part as f64 + within) / PARTS as f64).min(1.0)
    }
}
