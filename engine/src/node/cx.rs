//! The context of a node that is cooked: [`Cx`] for pure nodes, [`FrameCx`] for nodes that may read the clock,
//! [`StepCx`] for steps through time. Each derefs to the one before, so helpers take `&Cx`.

use std::ops::Deref;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use super::masks::{ConvertedMasks, converted};
use super::{Metric, Node, Output};
use crate::error::{Error, ErrorKind, Result};
use crate::expr::suggest::nearest;
use crate::geometry::{Attr, ColumnType, Component, Geometry, Item, Name, Owner};
use crate::memory::{Ceiling, size_text};
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

/// What a node returns: one geometry per output.
#[derive(Clone, Debug, Default)]
pub struct Outputs(pub(crate) Vec<(&'static str, Arc<Geometry>)>);

impl Outputs {
    /// Adds another output with its geometry.
    #[must_use]
    pub fn and(mut self, output: Output, geometry: impl Into<Arc<Geometry>>) -> Self {
        self.0.push((output.name, geometry.into()));
        self
    }
}

/// What every node can read: its params and inputs.
pub struct Cx<'a> {
    pub(crate) node: &'static Node,
    pub(crate) params: Params,
    pub(crate) inputs: Vec<(&'static str, InputData)>,
    pub(crate) live: Option<&'a [Name]>,
    /// Those of `live` that need not be there.
    pub(crate) if_there: &'a [Name],
    pub(crate) cancel: &'a AtomicBool,
    pub(crate) ceiling: Ceiling,
    /// Bytes of the results that a frame holds already.
    pub(crate) held: usize,
    pub(crate) published: Mutex<Vec<(&'static str, f64)>>,
    pub(crate) masks: ConvertedMasks,
}

impl Cx<'_> {
    /// The value of a param.
    pub fn get<T: ParamType>(&self, param: Param<T>) -> T::Value {
        self.params.get(param)
    }

    /// All params.
    pub fn params(&self) -> &Params {
        &self.params
    }

    /// A maskable param on `part`: its number, with the attribute that scales it if one is named: a number for each
    /// point, or for each curve.
    ///
    /// # Errors
    /// Where the attribute is missing or is not one number per point or curve.
    pub fn mask<'c>(&'c self, param: Param<Maskable>, part: &'c Component) -> Result<Masked<'c, f32>> {
        let name = param.name();
        let Maskable { value, attribute } = self.get(param);
        let Some(attribute) = attribute else { return Ok(Masked::uniform(value)) };
        if let Some(mask) = part.table(Owner::Point).get(&attribute) {
            return Ok(Masked { value, mask: Some(mask) });
        }
        if let Some(mask) = converted(part, &attribute) {
            return Ok(Masked { value, mask: Some(self.masks.keep(mask)) });
        }
        let kind = part.kind();
        let what = match part.describe(&attribute) {
            Some(found) => format!("which is {found}"),
            None => format!("which the {kind} do not have"),
        };
        let hint = match part.describe(&attribute) {
            Some(_) => point_float_hint(part, &attribute),
            None => missing_mask_hint(part, &attribute),
        };
        let fact = format!("`{name}` is masked by `{attribute}`, {what}");
        Err(Error::refused(fact).hint(hint).of(name).of_types())
    }

    /// Whether anything downstream, or an output, reads that attribute of this node's result.
    pub fn wants<T: Item>(&self, attribute: Attr<T>) -> bool {
        self.wants_named(attribute.name)
    }

    /// Whether a neutral value of that attribute must be written too: it is wanted, and not only by nodes that take a missing
    /// one for neutral ([`Node::reads_if_there`]).
    pub fn needs<T: Item>(&self, attribute: Attr<T>) -> bool {
        self.wants(attribute) && self.if_there.iter().all(|name| **name != *attribute.name)
    }

    /// As [`Cx::wants`], for an attribute given by name.
    pub fn wants_named(&self, attribute: &str) -> bool {
        self.live.is_none_or(|live| live.iter().any(|name| **name == *attribute))
    }

    /// Publishes a metric at this frame. A value that is not finite is left out of the report, with a note.
    ///
    /// # Panics
    /// Where the node does not declare it.
    pub fn publish(&self, metric: Metric, value: f64) {
        assert!(
            self.node.metrics.iter().any(|declared| declared.name == metric.name),
            "it publishes `{}`, which it does not declare",
            metric.name
        );
        self.published.lock().unwrap_or_else(PoisonError::into_inner).push((metric.name, value));
    }

    /// Asks for memory before it is taken: a node whose result can be larger than its input calls this with the bytes
    /// that the result takes while it is made, as soon as they are known. What the inputs take is added.
    ///
    /// # Errors
    /// If that is more than the cook may take; the hint says how to make less.
    pub fn reserve(&self, bytes: f64, hint: &str) -> Result<()> {
        // Saturates, and NaN is 0.
        self.refuse_larger(bytes as usize, "would take").map_err(|error| error.hint(hint))
    }

    /// Refuses a result that takes more than is allowed together with the inputs, or with all results that its frame
    /// holds.
    pub(crate) fn refuse_larger(&self, bytes: usize, takes: &str) -> Result<()> {
        let with = [(self.input_bytes(), "its inputs"), (self.held, "the other results of the frame")];
        for (others, with) in with {
            let bytes = bytes.saturating_add(others);
            if !self.ceiling.allows(bytes) {
                let (size, allowed) = (size_text(bytes), self.ceiling.describe());
                return Err(Error::refused(format!("the result {takes} {size} with {with}, but {allowed}")));
            }
        }
        Ok(())
    }

    /// Bytes of all arrays that the inputs hold.
    fn input_bytes(&self) -> usize {
        let mut arrays: Vec<(usize, usize)> = Vec::new();
        for (_, data) in &self.inputs {
            let wires = data.now.iter().chain(&data.start).chain(data.steps.iter().flat_map(|(_, wires)| wires));
            arrays.extend(wires.flat_map(|wire| wire.arrays()));
        }
        arrays.sort_unstable();
        arrays.dedup_by_key(|(address, _)| *address);
        arrays.iter().map(|(_, bytes)| bytes).sum()
    }

    /// Ends the cook early if it was cancelled; call it in long loops.
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

/// The hint for an error about `name`, which is no float attribute of the points of `part`: the name of one that is
/// similar, or what is expected.
pub fn point_float_hint(part: &Component, name: &str) -> String {
    let expected = || format!("expected {}", part.kind().rows_text(Owner::Point, ColumnType::F1));
    point_hint(part, name, |kind| kind == ColumnType::F1, expected)
}

/// What a mask that is missing may be: the name that is nearest, else those that there are.
fn missing_mask_hint(part: &Component, name: &str) -> String {
    let make = || {
        let numbers = part.table(Owner::Point).iter().filter(|(_, column)| column.kind() == ColumnType::F1);
        let names: Vec<String> = numbers.map(|(name, _)| format!("`{name}`")).collect();
        let rows = part.kind().rows_text(Owner::Point, ColumnType::F1);
        let make = format!("make `{name}` before this node, {rows}, with Attribute_Expr for example");
        if names.is_empty() { make } else { format!("they have {}; {make}", names.join(", ")) }
    };
    point_hint(part, name, |kind| kind == ColumnType::F1, make)
}

/// As [`point_float_hint`], where the attribute may have one, three or four floats a point.
pub fn point_floats_hint(part: &Component, name: &str) -> String {
    let expected = || "expected an attribute of the points, of one, three or four floats each".to_owned();
    point_hint(part, name, ColumnType::is_float, expected)
}

fn point_hint(part: &Component, name: &str, fits: fn(ColumnType) -> bool, expected: impl Fn() -> String) -> String {
    let fitting = part.table(Owner::Point).iter().filter(|(_, column)| fits(column.kind()));
    match nearest(name, fitting.map(|(name, _)| &**name)) {
        Some(near) => format!("did you mean `{near}`?"),
        None => expected(),
    }
}

/// Integrals over time of a node's integrands, cached by the engine from frame to frame.
pub(crate) trait History: Sync {
    /// The integral of integrand `index`.
    fn integral(&self, index: usize, upto: Frame) -> [f64; 3];

    /// The integrand `index` at a frame number.
    fn integrand(&self, index: usize, frame: f64) -> [f64; 3];

    /// Whether params that integrands may read change with time.
    fn is_animated(&self) -> bool;
}

/// The context of a node that may read the clock.
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

    /// The scene's origin, to which positions are relative, metres.
    pub fn origin(&self) -> [f64; 3] {
        self.origin
    }

    /// The integral of the node's first integrand from time 0 to `upto`, in its unit × seconds; `upto` is at most the
    /// frame that is cooked. Exact where the params it reads are constant, otherwise 4-point Gauss quadrature per whole
    /// frame and for the fraction, summed in frame order, so that any frame cooks alone. Before the scene's start, or
    /// time 0 if that is earlier, params are taken to be constant.
    ///
    /// # Panics
    /// Where the node declares no integrand, or `upto` is in the future, which its key does not cover.
    pub fn integral(&self, upto: Frame) -> [f64; 3] {
        let [integral] = self.integrals(upto);
        integral
    }

    /// The node's first `N` integrands at a frame number between whole frames, at most the frame that is cooked.
    ///
    /// # Panics
    /// Where the node declares fewer, or `frame` is in the future.
    pub fn integrands<const N: usize>(&self, frame: f64) -> [[f64; 3]; N] {
        assert!(frame <= self.frame.number(), "it asks for integrands at {frame}, which is after frame {}", self.frame);
        let declared = self.node.integrands.iter().flatten().count();
        match self.history {
            Some(history) if N <= declared => std::array::from_fn(|place| history.integrand(place, frame)),
            _ => panic!("it asks for {N} integrands and declares {declared}"),
        }
    }

    /// Whether a param that integrands may read changes with time, at any frame. If not, integrands have one value.
    pub fn integrands_vary(&self) -> bool {
        self.history.is_some_and(History::is_animated)
    }

    /// [`Self::integral`] of the node's first `N` integrands.
    ///
    /// # Panics
    /// Where the node declares fewer, or `upto` is in the future.
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

    /// The wires of an input at its declared times within a step, oldest first; the first is the previous frame, the
    /// last this frame. If something upstream exists at whole frames alone, there are no others. Where a chain starts
    /// there is this frame alone, and outside of chains none.
    pub fn samples<A>(&self, input: super::Input<A>) -> &[(Frame, Vec<Arc<Geometry>>)] {
        &self.data(input.name()).steps
    }
}

/// The context of a window or solver that steps from one frame to the next.
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
    /// The frame of the state before the step.
    pub fn previous(&self) -> Frame {
        self.previous
    }

    /// Length of the step, seconds.
    pub fn dt(&self) -> f64 {
        (self.frame.ticks() - self.previous.ticks()) as f64 / Frame::TICKS as f64 / self.clock.fps
    }
}
