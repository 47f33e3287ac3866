//! Neutral nodes: params and wires with which a node changes nothing. One declaration says when and why; the engine
//! then passes the inputs through and does not call the node.

use super::{Carries, Cook, Cx, FrameCx, LeftOut, Needs, Node, Outputs, Wires};
use crate::error::{Error, Result};
use crate::geometry::{Attr, Component, Item, Owner};
use crate::param::Params;

/// Why a node changes nothing with these params and wires; `None` where it may.
pub type WhyNeutral = fn(&Params, &Wires) -> Option<&'static str>;

/// The name of the stage that a neutral node leaves out.
pub(crate) const WHOLE: &str = "all";

/// An attribute that a node writes even where it is neutral: the same number in every row.
#[derive(Clone, Copy, Debug)]
pub struct Fill {
    number: Number,
    keep: bool,
}

#[derive(Clone, Copy, Debug)]
enum Number {
    Float(Attr<f32>, f32),
    Int(Attr<i32>, i32),
    /// Zero.
    Vector(Attr<[f32; 3]>),
}

impl Fill {
    /// `value` where the attribute is missing; what is there passes through.
    pub const fn missing(attribute: Attr<f32>, value: f32) -> Self {
        Self { number: Number::Float(attribute, value), keep: true }
    }

    /// `value` whether or not the attribute is there, as long as anyone takes it.
    pub const fn always(attribute: Attr<f32>, value: f32) -> Self {
        Self { number: Number::Float(attribute, value), keep: false }
    }

    /// As [`Fill::always`] for an integer.
    pub const fn always_int(attribute: Attr<i32>, value: i32) -> Self {
        Self { number: Number::Int(attribute, value), keep: false }
    }

    /// Zero vectors where the attribute is missing, as long as anyone needs it ([`Cx::needs`]); what is there passes through.
    pub const fn missing_vectors(attribute: Attr<[f32; 3]>) -> Self {
        Self { number: Number::Vector(attribute), keep: true }
    }

    fn apply(&self, cx: &Cx, part: &mut Component) -> Result<()> {
        match self.number {
            Number::Float(attribute, value) => self.fill(cx, part, attribute, value),
            Number::Int(attribute, value) => self.fill(cx, part, attribute, value),
            Number::Vector(attribute) if !cx.needs(attribute) => Ok(()),
            Number::Vector(attribute) => self.fill(cx, part, attribute, [0.0; 3]),
        }
    }

    fn fill<T: Item>(&self, cx: &Cx, part: &mut Component, attribute: Attr<T>, value: T) -> Result<()> {
        let needed = if self.keep { part.get(attribute).is_none() } else { cx.wants(attribute) };
        if needed {
            let rows = match attribute.owner {
                Owner::Point => part.point_count(),
                Owner::Element => part.element_count(),
                Owner::Once => 1,
            };
            part.set(attribute, vec![value; rows])?;
        }
        Ok(())
    }
}

impl Node {
    /// Declares when the node changes nothing, and why: the engine then passes the inputs of its outputs
    /// ([`super::Output::like`]) through without calling it, publishes [`super::Metric::neutral`] of each metric, and
    /// reports the reason.
    #[must_use]
    pub const fn neutral(mut self, why: WhyNeutral) -> Self {
        self.neutral = Some(why);
        self
    }

    /// Attributes that it writes even where it is neutral.
    #[must_use]
    pub const fn neutral_fills(mut self, fills: &'static [Fill]) -> Self {
        self.fills = fills;
        self
    }

    /// What is not run with these params and wires, and why.
    pub(crate) fn left_out(&self, params: &Params, wires: &Wires) -> Vec<LeftOut> {
        match self.neutral.and_then(|why| why(params, wires)) {
            Some(why) => vec![LeftOut::new(WHOLE, why)],
            None => self.leaves_out.map(|leaves_out| leaves_out(params, wires)).unwrap_or_default(),
        }
    }

    /// Cooks a pure or frame node.
    pub(crate) fn cook_frame(&self, cx: &FrameCx) -> Result<Outputs> {
        match self.cook {
            _ if cx.is_neutral() => self.pass_through(cx),
            Cook::Pure(cook) => cook(cx),
            Cook::Frame { cook, .. } => cook(cx),
            Cook::Window(..) | Cook::Solver(..) => Err(Error::contract("it is cooked without its state")),
        }
    }

    /// The outputs of a neutral node: the inputs that they are like.
    pub(crate) fn pass_through(&self, cx: &Cx) -> Result<Outputs> {
        if let Some(checks) = self.checks {
            checks(cx.params())?;
        }
        let mut outputs = Outputs::default();
        for output in self.outputs {
            let Carries::Like(input) = output.carries else {
                return Err(Error::contract(format!(
                    "it is neutral, but its output `{}` is like no input",
                    output.name
                )));
            };
            let wire = cx.data(input).now.first();
            let wire = wire.ok_or_else(|| Error::contract(format!("it is neutral and does not read `{input}` now")))?;
            let needs = self.inputs.iter().map(|input| input.spec()).find(|spec| spec.name == input);
            let mut geometry = wire.clone();
            if let (false, Some(Needs::Kind(kind))) = (self.fills.is_empty(), needs.map(|spec| spec.needs)) {
                let mut filled = (*geometry).clone();
                let part = filled.part_mut(kind).ok_or_else(|| Error::contract(format!("`{input}` has no {kind}")))?;
                self.fills.iter().try_for_each(|fill| fill.apply(cx, part))?;
                geometry = filled.into();
            }
            outputs = outputs.and(**output, geometry);
        }
        for metric in self.metrics.iter().filter(|metric| !metric.is_of_jumps) {
            cx.publish(**metric, metric.neutral);
        }
        Ok(outputs)
    }
}

impl Cx<'_> {
    /// Whether the node is neutral at this frame; see [`Node::neutral`].
    pub(crate) fn is_neutral(&self) -> bool {
        let wires = |name: &str| {
            let found = self.inputs.iter().find(|(input, _)| *input == name);
            let counts = found.map(|(_, data)| {
                let within = data.steps.first().map_or(0, |(_, wires)| wires.len());
                data.now.len().max(data.start.len()).max(within)
            });
            counts.unwrap_or(0)
        };
        self.node.neutral.is_some_and(|why| why(&self.params, &Wires(&wires)).is_some())
    }
}
