//! Masks that are 0 everywhere, or that take a param out of its range: a wrong picture might otherwise go unnoticed.

use std::collections::{BTreeMap, BTreeSet};

use super::Sweep;
use crate::geometry::{Component, Geometry, Owner, Table};
use crate::graph::Body;
use crate::note::{Note, kind};
use crate::param::Bounds;
use crate::time::Frame;

/// What the masks of a node were at the frames cooked so far, by the index of their params.
pub(super) type Masks = BTreeMap<usize, BTreeMap<Frame, MaskFigures>>;

/// Numbers that are out of a range by a smaller share than this are within it.
const ROUNDING: f64 = 1e-6;

/// A mask at a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct MaskFigures {
    /// Whether every factor is 0.
    is_zero: bool,
    /// How many factors there are.
    count: f64,
    /// How many take the param out of its range.
    outside: f64,
    /// The least and the greatest number that the mask makes of the param.
    ends: [f64; 2],
}

impl MaskFigures {
    /// As numbers, to be kept on disk.
    pub(super) fn numbers(&self) -> [f64; 5] {
        [f64::from(u8::from(self.is_zero)), self.count, self.outside, self.ends[0], self.ends[1]]
    }

    /// From [`MaskFigures::numbers`], which were kept one by one; what is missing is that of a mask within its range.
    pub(super) fn set_number(&mut self, index: usize, number: f64) {
        match index {
            0 => self.is_zero = number == 1.0,
            1 => self.count = number,
            2 => self.outside = number,
            3 => self.ends[0] = number,
            4 => self.ends[1] = number,
            _ => {}
        }
    }

    /// Nothing is known.
    pub(super) const NONE: Self = Self { is_zero: false, count: 0.0, outside: 0.0, ends: [0.0; 2] };

    /// Both together.
    fn and(self, other: Self) -> Self {
        Self {
            is_zero: self.is_zero && other.is_zero,
            count: self.count + other.count,
            outside: self.outside + other.outside,
            ends: [self.ends[0].min(other.ends[0]), self.ends[1].max(other.ends[1])],
        }
    }

    /// `None` without a factor.
    fn of(factors: impl Iterator<Item = f64>, value: f64, range: Bounds) -> Option<Self> {
        let of = |factor: f64| {
            let number = value * factor;
            // Rounding of the factor is not meant.
            let by = (number - number.clamp(range.low, range.high)).abs();
            let outside = f64::from(u8::from(by > ROUNDING * number.abs()));
            Self { is_zero: factor == 0.0, count: 1.0, outside, ends: [number; 2] }
        };
        factors.map(of).reduce(Self::and)
    }
}

/// A mask of geometry, whatever it may be stored as; `None` where there is none, or no row of it.
fn figures(geometry: &Geometry, mask: &str, value: f64, range: Bounds) -> Option<MaskFigures> {
    let owners = |part| [Owner::Point, Owner::Element].map(|owner| Component::table(part, owner));
    let of = |table: &Table| match table.get::<f32>(mask) {
        Some(rows) => MaskFigures::of(rows.iter().map(|factor| f64::from(*factor)), value, range),
        None => MaskFigures::of(table.get::<i32>(mask)?.iter().map(|factor| f64::from(*factor)), value, range),
    };
    geometry.parts().flat_map(owners).filter_map(of).reduce(MaskFigures::and)
}

impl Sweep<'_, '_, '_> {
    /// Records what the masks of a node's params are at some frames.
    pub(super) fn record_masks(&mut self, node: usize, frames: &BTreeSet<Frame>) {
        let plan = self.plan;
        let clock = plan.graph.scene.clock();
        let Body::Node { params, specs, inputs, .. } = &plan.graph.nodes[node].body else { return };
        let masks = params.iter().enumerate().filter_map(|(param, source)| Some((param, source, source.mask()?)));
        for (param, source, mask) in masks {
            for frame in frames {
                let value = source.at(frame.number(), clock).number();
                let range = specs[param].facts.hard;
                let reads = inputs.iter().flatten().map(|link| plan.read(*link, *frame));
                let cooked = reads.filter_map(|read| self.geometry(read).ok());
                let found = cooked.filter_map(|geometry| figures(&geometry, mask, value, range));
                if let Some(found) = found.reduce(MaskFigures::and) {
                    self.nodes[node].masks.entry(param).or_default().insert(*frame, found);
                }
            }
        }
    }

    /// Notes masks that were 0 everywhere at all frames.
    pub(super) fn note_zero_masks(&mut self) {
        for (node, run) in self.plan.graph.nodes.iter().zip(&self.nodes) {
            let (Body::Node { params, specs, .. }, id) = (&node.body, &node.id) else { continue };
            let always = |frames: &BTreeMap<Frame, MaskFigures>| frames.values().all(|mask| mask.is_zero);
            for (param, frames) in run.masks.iter().filter(|(_, frames)| always(frames)) {
                let (name, mask) = (specs[*param].name, params[*param].mask().map_or("", |mask| mask));
                let text = format!("`{id}` ({}): the mask `{mask}` of `{name}` is 0 everywhere", node.type_name());
                let hint = format!("`{name}` has no effect. Look at where the attribute `{mask}` is made.");
                let frames = frames.keys().copied().collect();
                self.report.notes.push(Note::new(kind::ZERO_MASK, text).of_node(id).at(frames).hint(hint));
            }
        }
    }

    /// Notes masks that took their param out of its range, once a param, with the frame where most values were outside.
    pub(super) fn note_masks_outside(&mut self) {
        for (node, run) in self.plan.graph.nodes.iter().zip(&self.nodes) {
            let (Body::Node { params, specs, .. }, id) = (&node.body, &node.id) else { continue };
            for (param, frames) in &run.masks {
                let outside = || frames.iter().filter(|(_, mask)| mask.outside > 0.0);
                let most = outside().fold(None, |most: Option<&MaskFigures>, (_, mask)| match most {
                    Some(most) if most.outside >= mask.outside => Some(most),
                    _ => Some(mask),
                });
                let Some(most) = most else { continue };
                let (name, mask) = (specs[*param].name, params[*param].mask().map_or("", |mask| mask));
                let (range, [low, high]) = (specs[*param].facts.hard, most.ends.map(|end| end as f32 + 0.0));
                let text = format!(
                    "`{id}` ({}): {} of {} values of `{name}`, masked by `{mask}`, are outside of its range ({range}): \
                     they go from {low} to {high}",
                    node.type_name(),
                    most.outside,
                    most.count,
                );
                let hint = match range.low.is_finite() && range.high.is_finite() {
                    true => "They are clamped to the range.".to_owned(),
                    false => format!("`{name}` itself would be refused there."),
                };
                let hint =
                    format!("{hint} The values are `value` times the attribute: look at where `{mask}` is made.");
                let frames = outside().map(|(frame, _)| *frame).collect();
                self.report.notes.push(Note::new(kind::MASK_OUTSIDE_RANGE, text).of_node(id).at(frames).hint(hint));
            }
        }
    }
}
