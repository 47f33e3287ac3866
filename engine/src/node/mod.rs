//! Node declarations: everything the engine, the help, the schema and the conformance suite know of a node stands in
//! one constant, made of typed handles. There is no other registration than a line in the family's list.

mod chain;
mod cx;
mod help;
mod ports;

use crate::geometry::{Attr, ColumnType, Geometry, Item, Name, Owner};
use crate::param::{Clock, ParamDecl, ParamSpec, Params, Unit};

pub use chain::{Chain, Past, Solver};
pub(crate) use chain::{ChainFns, SolverFns, StateBox};
pub use cx::{Cx, FrameCx, Outputs, StepCx};
pub(crate) use cx::{History, InputData};
pub use ports::{Arity, Carries, Input, InputDecl, InputSpec, Many, Needs, One, Opt, Output, Times, Wired};

/// What kind of time a node needs, and the function that cooks it. The variant fixes what the function may know.
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
    /// This frame and some before it.
    Window(ChainFns, fn(&Params, Clock) -> Past),
    /// Its own state of the frame before.
    Solver(ChainFns, SolverFns),
}

impl Cook {
    /// The word help and reports use.
    pub fn word(&self) -> &'static str {
        match self {
            Self::Pure(_) => "pure",
            Self::Frame { .. } => "frame",
            Self::Window(..) => "window",
            Self::Solver(..) => "solver",
        }
    }

    /// Whether it has a state that moves from frame to frame.
    pub(crate) fn is_chain(&self) -> bool {
        matches!(self, Self::Window(..) | Self::Solver(..))
    }
}

/// An attribute whatever its type.
pub trait AttrDecl: Sync {
    /// Name, what owns a row, what a row is.
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
    /// Whatever is there.
    All,
}

/// A number a node publishes once a frame.
#[derive(Clone, Copy, Debug)]
pub struct Metric {
    /// Name in reports.
    pub name: &'static str,
    /// Its unit.
    pub unit: Unit,
    /// What it says.
    pub help: &'static str,
}

impl Metric {
    /// A metric.
    pub const fn new(name: &'static str, unit: Unit, help: &'static str) -> Self {
        Self { name, unit, help }
    }
}

/// A stage of a node that cannot change its result and is therefore not run.
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

/// How many wires each input of a node has.
pub struct Wires<'a>(pub(crate) &'a dyn Fn(&str) -> usize);

impl Wires<'_> {
    /// Wires of that input.
    pub fn count<A>(&self, input: &Input<A>) -> usize {
        (self.0)(input.name())
    }
}

/// What a node integrates over time, given its params at one moment.
pub type Integrand = fn(&Params) -> [f64; 3];

/// Most integrands of a node.
pub const MOST_INTEGRANDS: usize = 4;

/// A node type: made as a `static`, read by everything.
pub struct Node {
    /// Name in graph files.
    pub name: &'static str,
    /// Raised whenever the node's bits change.
    pub version: u32,
    /// What it does to the picture: first sentence is the summary.
    pub help: &'static str,
    /// Time need and function.
    pub cook: Cook,
    /// Inputs, in the order help lists them.
    pub inputs: &'static [&'static dyn InputDecl],
    /// Params, in the order help lists them.
    pub params: &'static [&'static dyn ParamDecl],
    /// Outputs; the first is what a bare id means.
    pub outputs: &'static [&'static Output],
    /// Attributes read.
    pub reads: &'static [&'static dyn AttrDecl],
    /// Attributes written. All others of the inputs go through untouched.
    pub writes: &'static [&'static dyn AttrDecl],
    /// Attributes read and written where the params say which; added to the above.
    pub attributes: Option<fn(&Params) -> [AttrNames; 2]>,
    /// Whether elements and points come and go with time or params.
    pub changes_topology: bool,
    /// Metrics published.
    pub metrics: &'static [&'static Metric],
    /// Stages that cannot matter, given params and wires.
    pub leaves_out: Option<fn(&Params, &Wires) -> Vec<LeftOut>>,
    /// What is wrong with the params together, beyond their ranges; asked before anything cooks.
    pub checks: Option<fn(&Params) -> crate::Result<()>>,
    /// What [`FrameCx::integrals`] integrates over time; reads only params declared [`crate::param::Param::history`].
    pub integrands: [Option<Integrand>; MOST_INTEGRANDS],
    /// What a window keeps that a cubic between its frames does not; see [`Node::mends_between`].
    pub mend_between: Option<MendBetween>,
}

/// Puts right an output of a window `share` of the way between two whole frames, whose outputs are `near`; `P` and `v` of
/// `between` lie on the cubic through them, all else is that of the first.
pub type MendBetween = fn(near: [&Geometry; 2], share: f32, between: &mut Geometry);

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
            writes: &[],
            attributes: None,
            changes_topology: false,
            metrics: &[],
            leaves_out: None,
            checks: None,
            integrands: [None; MOST_INTEGRANDS],
            mend_between: None,
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

    /// Attributes it reads and writes, as its params say.
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

    /// Stages that cannot matter.
    #[must_use]
    pub const fn leaves_out(mut self, leaves_out: fn(&Params, &Wires) -> Vec<LeftOut>) -> Self {
        self.leaves_out = Some(leaves_out);
        self
    }

    /// What is wrong with the params together.
    #[must_use]
    pub const fn checks(mut self, checks: fn(&Params) -> crate::Result<()>) -> Self {
        self.checks = Some(checks);
        self
    }

    /// What is integrated over time; said again, another one, in that order.
    ///
    /// # Panics
    /// While it is compiled, where it is said more than [`MOST_INTEGRANDS`] times.
    #[must_use]
    pub const fn integrates(mut self, integrand: Integrand) -> Self {
        let mut place = 0;
        while self.integrands[place].is_some() {
            place += 1;
        }
        self.integrands[place] = Some(integrand);
        self
    }

    /// Called on each output of a window between two whole frames, where positions are interpolated: to keep what the
    /// node keeps at whole frames, such as lengths.
    #[must_use]
    pub const fn mends_between(mut self, mend: MendBetween) -> Self {
        self.mend_between = Some(mend);
        self
    }

    /// What is known of each param.
    pub fn param_specs(&self) -> Vec<ParamSpec> {
        self.params.iter().map(|param| param.spec()).collect()
    }

    /// What is known of each input.
    pub fn input_specs(&self) -> Vec<InputSpec> {
        self.inputs.iter().map(|input| input.spec()).collect()
    }

    /// Where a solver's state starts, given its params; `None` for the scene's first frame, and for nodes without one.
    pub fn start_frame(&self, params: &Params) -> Option<i64> {
        match &self.cook {
            Cook::Solver(_, solver) => (solver.start_frame)(params),
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

/// Writes a list of handles once: each becomes a constant, and the list names them all, so none can be read undeclared.
///
/// `params! { PARAMS: OFFSET: Param<f32> = Param::float("offset", 10.0, "…"); … }`
#[macro_export]
macro_rules! params {
    ($list:ident: $($(#[$meta:meta])* $name:ident : $t:ty = $value:expr;)*) => {
        $($(#[$meta])* const $name: $t = $value;)*
        const $list: &[&dyn $crate::param::ParamDecl] = &[$(&$name),*];
    };
}

/// Writes a node's inputs once; see [`crate::params!`].
#[macro_export]
macro_rules! inputs {
    ($list:ident: $($(#[$meta:meta])* $name:ident : $t:ty = $value:expr;)*) => {
        $($(#[$meta])* const $name: $t = $value;)*
        const $list: &[&dyn $crate::node::InputDecl] = &[$(&$name),*];
    };
}
