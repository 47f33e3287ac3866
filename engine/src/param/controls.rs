//! The controls of a graph as expressions read them: numbers and vectors, of which each may depend on those before it.

use super::source::{Clock, Source};
use super::value::Value;
use crate::expr::{Env, Expr, Width};

/// The value of a control.
#[derive(Clone, Debug)]
pub(crate) enum ControlValue {
    /// A number, a boolean or a vector.
    Source(Source),
    /// An expression for each component; they read controls before this one.
    Exprs(Vec<Expr>),
}

/// The controls that expressions may read, in the order of the graph.
#[derive(Clone, Debug, Default)]
pub struct ControlTable(Vec<Control>);

#[derive(Clone, Debug)]
struct Control {
    value: ControlValue,
    width: Width,
    is_animated: bool,
}

impl ControlValue {
    /// The controls that it reads.
    fn reads(&self) -> impl Iterator<Item = usize> {
        let exprs = match self {
            Self::Source(_) => &[][..],
            Self::Exprs(exprs) => exprs,
        };
        exprs.iter().flat_map(|expr| expr.controls().iter().copied())
    }

    /// Its numbers, given those of the controls before it.
    fn at(&self, frame: f64, clock: Clock, before: &[f64]) -> Vec<f64> {
        match self {
            Self::Source(source) => match source.at(frame, clock) {
                Value::Vec3(v) => v.to_vec(),
                value => vec![value.number()],
            },
            Self::Exprs(exprs) => exprs.iter().map(|expr| expr.eval(&clock.env(frame, before))).collect(),
        }
    }
}

impl ControlTable {
    /// Adds a control after those that it reads.
    pub(crate) fn push(&mut self, value: ControlValue, width: Width) {
        let is_animated = self.varies(&value);
        self.0.push(Control { value, width, is_animated });
    }

    /// Whether a value that reads these controls may change with time.
    pub(crate) fn varies(&self, value: &ControlValue) -> bool {
        match value {
            ControlValue::Source(source) => source.is_animated(),
            ControlValue::Exprs(exprs) => {
                exprs.iter().any(Expr::reads_time) || value.reads().any(|control| self.is_animated(control))
            }
        }
    }

    /// Whether a control may change with time.
    pub(super) fn is_animated(&self, control: usize) -> bool {
        self.0.get(control).is_some_and(|control| control.is_animated)
    }

    /// The numbers of all controls, concatenated, as expressions read them; 0 for controls on which none of `read`
    /// depends.
    pub(crate) fn numbers(&self, frame: f64, clock: Clock, read: impl Iterator<Item = usize>) -> Vec<f64> {
        let mut needed = vec![false; self.0.len()];
        read.for_each(|control| needed[control] = true);
        for index in (0..needed.len()).rev() {
            if needed[index] {
                self.0[index].value.reads().for_each(|before| needed[before] = true);
            }
        }
        let mut numbers = Vec::new();
        for (control, needed) in self.0.iter().zip(needed) {
            match needed {
                true => numbers.extend(control.value.at(frame, clock, &numbers)),
                false => numbers.extend(std::iter::repeat_n(0.0, control.width.count())),
            }
        }
        numbers
    }

    /// The numbers of a value that reads these controls.
    pub(crate) fn evaluate(&self, value: &ControlValue, frame: f64, clock: Clock) -> Vec<f64> {
        value.at(frame, clock, &self.numbers(frame, clock, value.reads()))
    }
}

impl Clock {
    /// What expressions read at `frame`, a frame number with fraction.
    pub(super) fn env(self, frame: f64, controls: &[f64]) -> Env<'_> {
        Env { frame, time: frame / self.fps, fps: self.fps, seed: self.seed as f64, controls }
    }
}
