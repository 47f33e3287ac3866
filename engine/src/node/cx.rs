//! What a node knows while it cooks. A pure node gets [`Cx`]; who may read the clock gets [`FrameCx`], who steps through
//! time [`StepCx`]. Each derefs to the one before, so helpers take `&Cx`.

use std::ops::Deref;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use super::{Metric, Node, Output};
use crate::error::{Error, ErrorKind, Result};
use crate::geometry::{Attr, ColumnType, Component, Geometry, Item, Name, Owner};
use crate::param::{Clock, Maskable, Param, ParamType, Params};
use crate::time::Frame;
use numerics::masked::Masked;

/// What came in through one input.
#[derive(Clone, Debug, Default)]
pub(crate) struct InputData {
    pub(crate) now: Vec<Arc<Geometry>>,
    pub(crate) start: Vec<Arc<Geometry>>,
    /// Oldest first; the first is the frame before.
    pub(crate) steps: Vec<(Frame, Vec<Arc<Geometry>>)>,
}

/// What a node returns: a geometry for each of its outputs.
#[derive(Clone, Debug, Default)]
pub struct Outputs(pub(crate) Vec<(&'static str, Arc<Geometry>)>);

impl Outputs {
    /// These, and another output with its geometry.
    #[must_use]
    pub fn and(mut self, output: Output, geometry: impl Into<Arc<Geometry>>) -> Self {
        self.0.push((output.name, geometry.into()));
        self
    }
}

/// What any node knows: its params and inputs.
pub struct Cx<'a> {
    pub(crate) node: &'static Node,
    pub(crate) params: Params,
    pub(crate) inputs: Vec<(&'static str, InputData)>,
    pub(crate) live: Option<&'a [Name]>,
    pub(crate) cancel: &'a AtomicBool,
    pub(crate) published: Mutex<Vec<(&'static str, f64)>>,
}

impl Cx<'_> {
    /// The value of a param.
    pub fn get<T: ParamType>(&self, param: Param<T>) -> T {
        self.params.get(param)
    }

    /// All params.
    pub fn params(&self) -> &Params {
        &self.params
    }

    /// A masked param on `part`: its number, and the attribute that scales it a point, where one is named.
    ///
    /// # Errors
    /// Where the attribute is missing or not one number a point.
    pub fn mask<'c>(&self, param: Param<Maskable>, part: &'c Component) -> Result<Masked<'c, f32>> {
        let name = param.name();
        let Maskable { value, attribute } = self.get(param);
        let Some(attribute) = attribute else { return Ok(Masked::uniform(value)) };
        if let Some(mask) = part.table(Owner::Point).get(&attribute) {
            return Ok(Masked { value, mask: Some(mask) });
        }
        let kind = part.kind();
        let what = match part.describe(&attribute) {
            Some(found) => format!("which is {found}"),
            None => format!("which the {kind} do not have"),
        };
        let expected = kind.rows_text(Owner::Point, ColumnType::F1);
        Err(Error::refused(format!("`{name}` is masked by `{attribute}`, {what}")).hint(format!("expected {expected}")))
    }

    /// Whether anything downstream, or a file, takes that attribute of this node's result.
    pub fn wants<T: Item>(&self, attribute: Attr<T>) -> bool {
        self.wants_named(attribute.name)
    }

    /// As [`Cx::wants`], of an attribute that the node does not know.
    pub fn wants_named(&self, attribute: &str) -> bool {
        self.live.is_none_or(|live| live.iter().any(|name| **name == *attribute))
    }

    /// Publishes a metric of this frame.
    pub fn publish(&self, metric: Metric, value: f64) {
        assert!(
            self.node.metrics.iter().any(|declared| declared.name == metric.name),
            "it publishes `{}`, which it does not declare",
            metric.name
        );
        self.published.lock().unwrap_or_else(PoisonError::into_inner).push((metric.name, value));
    }

    /// Ends the cook early where someone cancelled it: to be asked in loops that last.
    ///
    /// # Errors
    /// Where the cook was cancelled.
    pub fn check_cancelled(&self) -> Result<()> {
        match self.cancel.load(Ordering::Relaxed) {
            true => Err(Error::new(ErrorKind::Cancelled, "the cook was cancelled")),
            false => Ok(()),
        }
    }

    pub(crate) fn data(&self, name: &'static str) -> &InputData {
        let found = self.inputs.iter().find(|(input, _)| *input == name);
        &found.unwrap_or_else(|| panic!("it reads the input `{name}`, which it does not declare")).1
    }
}

/// Integrals over time of a node's integrands, kept by the engine from frame to frame.
pub(crate) trait History: Sync {
    /// Of the integrand at `place`.
    fn integral(&self, place: usize, upto: Frame) -> [f64; 3];
}

/// What a node knows that may read the clock.
pub struct FrameCx<'a> {
    pub(crate) cx: Cx<'a>,
    pub(crate) frame: Frame,
    pub(crate) clock: Clock,
    pub(crate) origin: [f64; 3],
    pub(crate) history: Option<&'a dyn History>,
}

impl<'a> Deref for FrameCx<'a> {
    type Target = Cx<'a>;
    fn deref(&self) -> &Cx<'a> {
        &self.cx
    }
}

impl FrameCx<'_> {
    /// The frame that is cooked.
    pub fn frame(&self) -> Frame {
        self.frame
    }

    /// Its time, seconds since frame 0.
    pub fn seconds(&self) -> f64 {
        self.frame.seconds(self.clock.fps)
    }

    /// Frames a second.
    pub fn fps(&self) -> f64 {
        self.clock.fps
    }

    /// Where the scene's positions are relative to, metres.
    pub fn origin(&self) -> [f64; 3] {
        self.origin
    }

    /// ∫ of the node's first integrand from time 0 to `upto`, in its unit × seconds; `upto` lies in the past of the frame that
    /// is cooked, or is that frame. Exact where the params it reads are constant, else 4-point Gauss a whole frame plus
    /// the fraction, summed in frame order; so any frame cooks alone. Before the scene's start (or time 0, where that is
    /// earlier) the params are taken to have held.
    ///
    /// # Panics
    /// Where the node declares no integrand, or asks for the future, which its key does not know.
    pub fn integral(&self, upto: Frame) -> [f64; 3] {
        let [integral] = self.integrals(upto);
        integral
    }

    /// The same of the node's first `N` integrands.
    ///
    /// # Panics
    /// Where the node declares fewer, or asks for the future.
    pub fn integrals<const N: usize>(&self, upto: Frame) -> [[f64; 3]; N] {
        let now = self.frame.max(Frame::whole(0));
        assert!(upto <= now, "it asks for an integral up to frame {upto}, which is after frame {now}");
        let declared = self.node.integrands.iter().flatten().count();
        match self.history {
            Some(history) if N <= declared => std::array::from_fn(|place| history.integral(place, upto)),
            Some(_) => panic!("it asks for {N} integrals and declares {declared}"),
            None => panic!("it asks for an integral and declares no integrand"),
        }
    }
}

/// What a window or solver knows while it steps from one frame to the next.
pub struct StepCx<'a> {
    pub(crate) cx: FrameCx<'a>,
    pub(crate) previous: Frame,
}

impl<'a> Deref for StepCx<'a> {
    type Target = FrameCx<'a>;
    fn deref(&self) -> &FrameCx<'a> {
        &self.cx
    }
}

impl StepCx<'_> {
    /// The frame the state stands at before the step.
    pub fn previous(&self) -> Frame {
        self.previous
    }

    /// Length of the step, seconds.
    pub fn dt(&self) -> f64 {
        (self.frame.ticks() - self.previous.ticks()) as f64 / Frame::TICKS as f64 / self.clock.fps
    }

    /// The wires of an input at the times within the step at which it was declared to be read, oldest first; the first
    /// is the frame before, the last this frame. Where something upstream knows whole frames only, these two are all.
    pub fn samples<A>(&self, input: super::Input<A>) -> &[(Frame, Vec<Arc<Geometry>>)] {
        &self.data(input.name()).steps
    }
}
