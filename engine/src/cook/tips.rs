//! The tips of curves at a sample, and what is left of them when a cook ends, so that the parts of one can be compared.

use std::collections::BTreeMap;

use numerics::vector::{Vec3, length, sub};
use serde::{Deserialize, Serialize};

use crate::geometry::Component;
use crate::time::Frame;

/// The share of its length by which a tip that jumps moves at least.
const JUMP: f32 = 0.25;

/// The tips of curves, and the lengths of the curves, metres.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Tips(Vec<(Vec3, f32)>);

impl Tips {
    pub(super) fn of(curves: &Component) -> Self {
        let points = curves.positions();
        let tip = |cvs: std::ops::Range<usize>| {
            let cvs = &points[cvs];
            let long = cvs.windows(2).map(|ends| length(sub(ends[1], ends[0]))).sum();
            (cvs.last().copied().unwrap_or_default(), long)
        };
        Self(curves.runs().ranges().map(tip).collect())
    }

    /// The share of curves whose tips jumped since `before`; `None` if there are none, or they are not the same ones.
    pub(super) fn jumped_since(&self, before: &Self) -> Option<f64> {
        if self.0.is_empty() || self.0.len() != before.0.len() {
            return None;
        }
        let jumps = |((tip, long), (was, _)): &(&(Vec3, f32), &(Vec3, f32))| {
            *long > 0.0 && length(sub(*tip, *was)) > JUMP * long
        };
        let jumped = self.0.iter().zip(&before.0).filter(jumps).count();
        Some(jumped as f64 / self.0.len() as f64)
    }
}

/// The tips of a node's curves at the first and the last sample of a cook.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EndTips {
    /// The node's metric of jumps.
    metric: String,
    /// Ticks of these samples, and the tips then.
    first: (i64, Tips),
    last: (i64, Tips),
}

impl EndTips {
    pub(super) fn new(metric: &str, first: (Frame, Tips), last: (Frame, Tips)) -> Self {
        let ticks = |(frame, tips): (Frame, Tips)| (frame.ticks(), tips);
        Self { metric: metric.to_owned(), first: ticks(first), last: ticks(last) }
    }

    /// The name of the node's metric of jumps.
    pub fn metric(&self) -> &str {
        &self.metric
    }

    /// The first sample.
    pub fn first(&self) -> Frame {
        Frame::default().plus_ticks(self.first.0)
    }

    /// The last sample.
    pub fn last(&self) -> Frame {
        Frame::default().plus_ticks(self.last.0)
    }

    /// The value of the metric at the first sample, if the last one of `before` is the sample before it; `None` if the
    /// curves are not the same ones.
    pub fn jumps_since(&self, before: &Self) -> Option<f64> {
        self.first.1.jumped_since(&before.last.1)
    }
}

/// Of the nodes with a metric of jumps that vary: their tips at the ends of a cook, by the ids of the nodes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct NodeEndTips(pub BTreeMap<String, EndTips>);

impl NodeEndTips {
    /// As bytes.
    pub fn to_bytes(&self) -> Vec<u8> {
        postcard::to_stdvec(self).expect("vectors and names have bytes")
    }

    /// The inverse of [`NodeEndTips::to_bytes`]; `None` for invalid bytes.
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        postcard::from_bytes(bytes).ok()
    }
}
