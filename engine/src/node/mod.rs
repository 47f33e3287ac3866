//! Node declarations: everything that the engine, the help, the schema and the conformance suite know of a node is
//! declared in a single static, made of typed handles. The only registration is a line in the family's list.

mod accuracy;
mod chain;
mod curves;
mod cx;
mod edit;
mod help;
pub(crate) mod masks;
mod metric;
mod neutral;
mod ports;

use crate::geometry::{Attr, ColumnType, Geometry, Item, Name, Owner};
use crate::param::{Clock, ParamDecl, ParamSpec, Params};

pub use accuracy::{Accuracy, Finer, Trials};
pub use chain::{Chain, Past, Resumable, Solver};
pub(crate) use chain::{ChainFns, SavedFns, StateBox};
pub use curves::{CurveLoop, CurveView, Cv, MovedCurves};
pub use cx::{Cx, FrameCx, Outputs, StepCx, point_float_hint, point_floats_hint};
pub(crate) use cx::{History, InputData};
pub use edit::Edited;
pub use metric::{Metric, MetricValues, Trouble, Warning};
pub use neutral::{Fill, WhyNeutral};
pub use ports::{Arity, Carries, Input, InputDecl, InputSpec, Many, Needs, One, Opt, Output, Times, Wired};

/// How a node depends on time, and the function that cooks it. The variant fixes what the function may read.
#[derive(Clone, Copy)]
pub enum Cook {
    /// Inputs and params only.
    Pure(fn(&Cx) -> crate::Result<Outputs>),
    /// The clock too.
    Frame {
        /// The function.
        cook: fn(&FrameCx) -> crate::Result<Outputs>,
        /// Whether the clock matters, given the params.
        reads_clock: fn(&Params) -> bool,
    },
    /// This frame and a number of frames before it.
    Window(ChainFns, fn(&Params, Clock) -> Past),
    /// Its own state at the previous frame.
    Solver(ChainFns, fn(&Params) -> Option<i64>),
}

impl Cook {
    /// The word used in help and reports.
    pub fn word(&self) -> &'static str {
        match self {
            Self::Pure(_) => "pure",
            Self::Frame { .. } => "frame",
            Self::Window(..) => "window",
            Self::Solver(..) => "solver",
        }
    }

    /// Whether it has a state that advances from frame to frame.
    pub(crate) fn is_chain(&self) -> bool {
        matches!(self, Self::Window(..) | Self::Solver(..))
    }
}

/// An attribute of any type.
pub trait AttrDecl: Sync {
    /// Name, owner of a row, type of a row.
    fn spec(&self) -> (&'static str, Owner, ColumnType);
}

impl<T: Item> AttrDecl for Attr<T> {
    fn spec(&self) -> (&'static str, Owner, ColumnType) {
        (self.name, self.owner, T::TYPE)
    }
}

/// Names of attributes a node reads or writes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum AttrNames {
    /// These.
    These(Vec<Name>),
    /// All that the geometry has.
    All,
}

/// A stage of a node that is not run because it cannot change the result.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LeftOut {
    /// The stage.
    pub stage: &'static str,
    /// Why it cannot matter.
    pub why: String,
}

impl LeftOut {
    /// A stage and why.
    pub fn new(stage: &'static str, why: impl Into<String>) -> Self {
        Self { stage, why: why.into() }
    }
}

/// The number of wires of each input of a node.
pub struct Wires<'a>(pub(crate) &'a dyn Fn(&str) -> usize);

impl Wires<'_> {
    /// Wires of that input.
    pub fn count<A>(&self, input: &Input<A>) -> usize {
        (self.0)(input.name())
    }
}

/// What a node integrates over time, given its params at one time.
pub type Integrand = fn(&Params) -> [f64; 3];

/// Most integrands of a node.
pub const MOST_INTEGRANDS: usize = 4;

/// A node type, declared as a `static`.
pub struct Node {
    /// Name in graph files.
    pub name: &'static str,
    /// Raised whenever the node's bits change.
    pub version: u32,
    /// What it does to the picture; the first sentence is the summary.
    pub help: &'static str,
    /// Its dependence on time, and its function.
    pub cook: Cook,
    /// Inputs, in the order help lists them.
    pub inputs: &'static [&'static dyn InputDecl],
    /// Params, in the order help lists them.
    pub params: &'static [&'static dyn ParamDecl],
    /// Outputs; the first is what a bare id means.
    pub outputs: &'static [&'static Output],
    /// Attributes read.
    pub reads: &'static [&'static dyn AttrDecl],
    /// Those of them that it takes for neutral where they are missing; see [`Node::reads_if_there`].
    pub if_there: &'static [&'static dyn AttrDecl],
    /// Attributes written. All others pass through from the inputs.
    pub writes: &'static [&'static dyn AttrDecl],
    /// Attributes read and written that depend on the params, in addition to the above.
    pub attributes: Option<fn(&Params) -> [AttrNames; 2]>,
    /// Whether elements and points come and go with time or params.
    pub changes_topology: bool,
    /// Metrics published.
    pub metrics: &'static [&'static Metric],
    /// When the node changes nothing, and why; see [`Node::neutral`].
    pub neutral: Option<WhyNeutral>,
    /// Attributes written even where it is neutral.
    pub fills: &'static [Fill],
    /// Stages that cannot change the result, given params and wires, where the node is not neutral.
    pub leaves_out: Option<fn(&Params, &Wires) -> Vec<LeftOut>>,
    /// What `explain` says of the node besides; see [`Node::explains`].
    pub explains: Option<fn(&Params, Clock) -> Vec<String>>,
    /// Refuses combinations of params, beyond their ranges; called before anything cooks.
    pub checks: Option<fn(&Params) -> crate::Result<()>>,
    /// What [`FrameCx::integrals`] integrates over time; reads only params declared [`crate::param::Param::history`].
    pub integrands: [Option<Integrand>; MOST_INTEGRANDS],
    /// What a window's output is made of between whole frames; see [`Node::follows`].
    pub follows: Option<Follows>,
    /// Params that trade accuracy for time.
    pub accuracy: &'static [Accuracy],
}

/// The input whose points a window moves; see [`Node::follows`].
#[derive(Clone, Copy, Debug)]
pub struct Follows {
    /// Its name.
    pub input: &'static str,
    /// Corrects the output between two whole frames.
    pub restore: RestoreBetween,
}

/// Corrects an output of a window between two whole frames, given the input that it follows.
pub type RestoreBetween = fn(input: &Geometry, between: &mut Geometry);

impl Node {
    /// A node of that name; `version` is raised when its bits change.
    pub const fn new(name: &'static str, version: u32, help: &'static str, cook: Cook) -> Self {
        Self {
            name,
            version,
            help,
            cook,
            inputs: &[],
            params: &[],
            outputs: &[],
            reads: &[],
            if_there: &[],
            writes: &[],
            attributes: None,
            changes_topology: false,
            metrics: &[],
            neutral: None,
            fills: &[],
            leaves_out: None,
            explains: None,
            checks: None,
            integrands: [None; MOST_INTEGRANDS],
            follows: None,
            accuracy: &[],
        }
    }

    /// Its inputs.
    #[must_use]
    pub const fn inputs(mut self, inputs: &'static [&'static dyn InputDecl]) -> Self {
        self.inputs = inputs;
        self
    }

    /// Its params.
    #[must_use]
    pub const fn params(mut self, params: &'static [&'static dyn ParamDecl]) -> Self {
        self.params = params;
        self
    }

    /// Its outputs.
    #[must_use]
    pub const fn outputs(mut self, outputs: &'static [&'static Output]) -> Self {
        self.outputs = outputs;
        self
    }

    /// Attributes it reads.
    #[must_use]
    pub const fn reads(mut self, attributes: &'static [&'static dyn AttrDecl]) -> Self {
        self.reads = attributes;
        self
    }

    /// Attributes it writes.
    #[must_use]
    pub const fn writes(mut self, attributes: &'static [&'static dyn AttrDecl]) -> Self {
        self.writes = attributes;
        self
    }

    /// Those of [`Node::reads`] whose absence means the same as their neutral value: a node before it need not write them
    /// only because this one reads them ([`Cx::needs`]).
    #[must_use]
    pub const fn reads_if_there(mut self, attributes: &'static [&'static dyn AttrDecl]) -> Self {
        self.if_there = attributes;
        self
    }

    /// Attributes it reads and writes depending on its params.
    #[must_use]
    pub const fn attributes(mut self, attributes: fn(&Params) -> [AttrNames; 2]) -> Self {
        self.attributes = Some(attributes);
        self
    }

    /// Elements and points come and go with its params.
    #[must_use]
    pub const fn changes_topology(mut self) -> Self {
        self.changes_topology = true;
        self
    }

    /// Metrics it publishes.
    #[must_use]
    pub const fn metrics(mut self, metrics: &'static [&'static Metric]) -> Self {
        self.metrics = metrics;
        self
    }

    /// Stages that cannot change the result.
    #[must_use]
    pub const fn leaves_out(mut self, leaves_out: fn(&Params, &Wires) -> Vec<LeftOut>) -> Self {
        self.leaves_out = Some(leaves_out);
        self
    }

    /// What `explain` says of the node besides: which of its methods the params choose, sizes that follow from them. Given the
    /// params at its start frame, or the scene's.
    #[must_use]
    pub const fn explains(mut self, explains: fn(&Params, Clock) -> Vec<String>) -> Self {
        self.explains = Some(explains);
        self
    }

    /// Refuses combinations of params before anything cooks.
    #[must_use]
    pub const fn checks(mut self, checks: fn(&Params) -> crate::Result<()>) -> Self {
        self.checks = Some(checks);
        self
    }

    /// Adds a function that is integrated over time.
    ///
    /// # Panics
    /// At compile time, where it is called more than [`MOST_INTEGRANDS`] times.
    #[must_use]
    pub const fn integrates(mut self, integrand: Integrand) -> Self {
        let mut place = 0;
        while self.integrands[place].is_some() {
            place += 1;
        }
        self.integrands[place] = Some(integrand);
        self
    }

    /// The output of this window is an input with its points moved. Between whole frames it is that input at that time, its
    /// points moved by what the window moved them by at the frames around, interpolated; `restore` then corrects what that does
    /// not preserve, such as lengths. Of other windows `P` and `v` themselves are interpolated.
    #[must_use]
    pub const fn follows(mut self, input: &Input<One>, restore: RestoreBetween) -> Self {
        self.follows = Some(Follows { input: input.name(), restore });
        self
    }

    /// Params that trade accuracy for time, the most effective first.
    #[must_use]
    pub const fn accuracy(mut self, accuracy: &'static [Accuracy]) -> Self {
        self.accuracy = accuracy;
        self
    }

    /// The specification of each param.
    pub fn param_specs(&self) -> Vec<ParamSpec> {
        self.params.iter().map(|param| param.spec()).collect()
    }

    /// The specification of each input.
    pub fn input_specs(&self) -> Vec<InputSpec> {
        self.inputs.iter().map(|input| input.spec()).collect()
    }

    /// Where a solver's state starts, given its params; `None` for the scene's first frame, and for nodes without one.
    pub fn start_frame(&self, params: &Params) -> Option<i64> {
        match &self.cook {
            Cook::Solver(_, start_frame) => start_frame(params),
            Cook::Pure(_) | Cook::Frame { .. } | Cook::Window(..) => None,
        }
    }

    /// The help's first sentence.
    pub fn summary(&self) -> &'static str {
        self.help.split_inclusive(". ").next().unwrap_or(self.help).trim_end()
    }
}

impl std::fmt::Debug for Node {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Node({})", self.name)
    }
}

/// Declares a node's params: each becomes a constant, and the list contains them all.
///
/// `params! { PARAMS: OFFSET: Param<f32> = Param::float("offset", 10.0, "…"); … }`
#[macro_export]
macro_rules! params {
    ($list:ident: $($(#[$meta:meta])* $name:ident : $t:ty = $value:expr;)*) => {
        $($(#[$meta])* const $name: $t = $value;)*
        const $list: &[&dyn $crate::param::ParamDecl] = &[$(&$name),*];
    };
}

/// Declares a node's inputs; see [`crate::params!`].
#[macro_export]
macro_rules! inputs {
    ($list:ident: $($(#[$meta:meta])* $name:ident : $t:ty = $value:expr;)*) => {
        $($(#[$meta])* const $name: $t = $value;)*
        const $list: &[&dyn $crate::node::InputDecl] = &[$(&$name),*];
    };
}
