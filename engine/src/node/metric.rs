//! Metrics: numbers that a node publishes once a frame, with the value beyond which an artist is told.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::Cx;
use crate::param::Unit;

/// A number that a node publishes once a frame.
#[derive(Clone, Copy, Debug)]
pub struct Metric {
    /// Name in reports.
    pub name: &'static str,
    /// Its unit.
    pub unit: Unit,
    /// What it measures.
    pub help: &'static str,
    /// Its value at frames where the node is neutral.
    pub neutral: f64,
    /// Whether the engine computes it, from the node's curves at consecutive samples; see [`Metric::jumps`].
    pub is_of_jumps: bool,
    /// When an artist is told about it.
    pub warning: Option<Warning>,
}

/// Values that are worth a note, and what to tell an artist.
#[derive(Clone, Copy, Debug)]
pub struct Warning {
    /// The values that are worth one.
    pub when: Trouble,
    /// What it means and what to do about it; whole sentences. A name in braces, `{pin}`, is replaced by the value of
    /// that metric of the node at the same frame; `{pins:pin}` by the wire of that number at `pins`, `{a+b:wire}` counts
    /// through several inputs.
    pub text: &'static str,
}

/// Values of a metric that are worth a note.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Trouble {
    /// Values above this.
    Above(f64),
    /// Values that are not between these two, both included.
    Outside(f64, f64),
    /// Values above this, if it is exceeded at all frames.
    AlwaysAbove(f64),
    /// Values above this at the last frame that has one.
    LastAbove(f64),
    /// A value that is not between these two, both included, at the last frame that has one.
    LastOutside(f64, f64),
}

impl Trouble {
    /// How far `value` lies outside the values that are good; at most 0 if it is one of them. The values of one metric
    /// are compared by it.
    pub fn excess(self, value: f64) -> f64 {
        match self {
            Self::Above(limit) | Self::AlwaysAbove(limit) | Self::LastAbove(limit) => value - limit,
            Self::Outside(low, high) | Self::LastOutside(low, high) => f64::max(low - value, value - high),
        }
    }
}

impl Metric {
    /// A metric, 0 where the node is neutral.
    pub const fn new(name: &'static str, unit: Unit, help: &'static str) -> Self {
        Self { name, unit, help, neutral: 0.0, is_of_jumps: false, warning: None }
    }

    /// The largest change of a segment's length, as a share of its curve's length: what every node that must not
    /// stretch curves publishes.
    pub const fn length_error() -> Self {
        Self::new(
            "length_error",
            Unit::None,
            "The largest change of a segment's length, as a share of the curve's length.",
        )
    }

    /// The share of curves whose tips jump. The engine computes it, and the node does not publish it.
    pub const fn jumps() -> Self {
        let help = "Share of curves whose tip moves by more than a quarter of the curve's length from one requested \
            sample to the next. Only in the report, from the second sample on. Fast motion counts too: cook at steps of \
            1/8 frame to count jumps only.";
        Self { is_of_jumps: true, ..Self::new("jumps", Unit::None, help) }
    }

    /// Its value where the node is neutral.
    #[must_use]
    pub const fn neutral(mut self, value: f64) -> Self {
        self.neutral = value;
        self
    }

    /// The cook's notes say `text` when the metric exceeds `above` at any frame.
    #[must_use]
    pub const fn warn_above(self, above: f64, text: &'static str) -> Self {
        self.warn(Trouble::Above(above), text)
    }

    /// The cook's notes say `text` when the metric is not in `low..=high` at any frame.
    #[must_use]
    pub const fn warn_outside(self, low: f64, high: f64, text: &'static str) -> Self {
        self.warn(Trouble::Outside(low, high), text)
    }

    /// The cook's notes say `text` when the metric exceeds `above` at every frame.
    #[must_use]
    pub const fn warn_always_above(self, above: f64, text: &'static str) -> Self {
        self.warn(Trouble::AlwaysAbove(above), text)
    }

    /// The cook's notes say `text` when the metric exceeds `above` at the last frame that has a value: for a metric
    /// that sums up all frames so far.
    #[must_use]
    pub const fn warn_last_above(self, above: f64, text: &'static str) -> Self {
        self.warn(Trouble::LastAbove(above), text)
    }

    /// The cook's notes say `text` when the metric is not in `low..=high` at the last frame.
    #[must_use]
    pub const fn warn_last_outside(self, low: f64, high: f64, text: &'static str) -> Self {
        self.warn(Trouble::LastOutside(low, high), text)
    }

    const fn warn(mut self, when: Trouble, text: &'static str) -> Self {
        self.warning = Some(Warning { when, text });
        self
    }
}

/// Values of metrics by name, as a solver keeps them in its state: what a step measured is published with the output,
/// also where a checkpoint was read back.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MetricValues(BTreeMap<String, f64>);

impl MetricValues {
    /// Sets a metric's value.
    pub fn set(&mut self, metric: Metric, value: impl Into<f64>) {
        self.0.insert(metric.name.to_owned(), value.into());
    }

    /// A metric's value, if it has been set.
    pub fn get(&self, metric: Metric) -> Option<f64> {
        self.0.get(metric.name).copied()
    }
}

impl Cx<'_> {
    /// Publishes all of them.
    ///
    /// # Panics
    /// As [`Cx::publish`], where the node does not declare one of them.
    pub fn publish_all(&self, values: &MetricValues) {
        for (name, value) in &values.0 {
            let declared = self.node.metrics.iter().find(|metric| metric.name == name);
            let declared = declared.unwrap_or_else(|| panic!("it publishes `{name}`, which it does not declare"));
            self.publish(**declared, *value);
        }
    }
}

/// Declares a node's metrics: each becomes a constant, and the list contains them all.
///
/// `metrics! { METRICS: FOLDED = Metric::new("folded", Unit::None, "…"); … }`
#[macro_export]
macro_rules! metrics {
    ($list:ident: $($(#[$meta:meta])* $name:ident = $value:expr;)*) => {
        $($(#[$meta])* const $name: $crate::node::Metric = $value;)*
        const $list: &[&$crate::node::Metric] = &[$(&$name),*];
    };
}
