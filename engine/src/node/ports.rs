//! Inputs and outputs of a node: typed handles, which components they need and carry, at which times they are read.

use std::sync::Arc;

use super::{Cx, Outputs};
use crate::geometry::{Geometry, Kind};
use crate::param::Params;

/// How many wires an input takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arity {
    /// Exactly one.
    One,
    /// None or one.
    Optional,
    /// A list of at least this many.
    Many {
        /// Fewest wires.
        least: usize,
    },
}

/// Which components an input needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Needs {
    /// This one.
    Kind(Kind),
    /// Any at all.
    Any,
}

impl Needs {
    /// Whether a wire that carries `kinds` will do.
    pub fn hold(self, kinds: &[Kind]) -> bool {
        match self {
            Self::Kind(kind) => kinds.contains(&kind),
            Self::Any => true,
        }
    }
}

/// At which times a node reads an input. A window or solver reads `now` at every whole frame it advances over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Times {
    /// At the frame that is cooked.
    pub now: bool,
    /// At the scene's first frame; for a solver, at its start frame.
    pub start: bool,
    /// At this many equal steps within a solver's step, its end included.
    pub steps: u8,
}

impl Times {
    /// At the frame that is cooked.
    pub const NOW: Self = Self { now: true, start: false, steps: 0 };
    /// At the start alone.
    pub const START: Self = Self { now: false, start: true, steps: 0 };
    /// Not at all.
    pub const NEVER: Self = Self { now: false, start: false, steps: 0 };

    /// Within each step of a solver, at `steps` equal steps.
    pub const fn within_step(steps: u8) -> Self {
        Self { now: false, start: false, steps }
    }

    /// These times and `other`.
    #[must_use]
    pub const fn and(self, other: Self) -> Self {
        let steps = if self.steps > other.steps { self.steps } else { other.steps };
        Self { now: self.now || other.now, start: self.start || other.start, steps }
    }
}

/// All that is known of an input.
#[derive(Clone, Copy, Debug)]
pub struct InputSpec {
    /// Name in graph files.
    pub name: &'static str,
    /// What it is for.
    pub help: &'static str,
    /// How many wires.
    pub arity: Arity,
    /// Which components.
    pub needs: Needs,
    /// When it is read, given the params.
    pub times: fn(&Params) -> Times,
}

/// An input with one wire.
pub enum One {}
/// An input with no or one wire.
pub enum Opt {}
/// An input with a list of wires.
pub enum Many {}

/// How a kind of input is handed to a node.
pub trait Wired {
    /// `&Geometry`, `Option<&Geometry>` or `&[Arc<Geometry>]`.
    type View<'a>;
    #[doc(hidden)]
    fn view(wires: &[Arc<Geometry>]) -> Self::View<'_>;
}

impl Wired for One {
    type View<'a> = &'a Geometry;
    fn view(wires: &[Arc<Geometry>]) -> &Geometry {
        wires.first().expect("the graph was checked: a required input has a wire")
    }
}

impl Wired for Opt {
    type View<'a> = Option<&'a Geometry>;
    fn view(wires: &[Arc<Geometry>]) -> Option<&Geometry> {
        wires.first().map(Arc::as_ref)
    }
}

impl Wired for Many {
    type View<'a> = &'a [Arc<Geometry>];
    fn view(wires: &[Arc<Geometry>]) -> &[Arc<Geometry>] {
        wires
    }
}

/// A typed handle of an input, written once through [`crate::inputs!`].
pub struct Input<A = One> {
    spec: InputSpec,
    arity: std::marker::PhantomData<fn() -> A>,
}

/// An input whatever its arity.
pub trait InputDecl: Sync {
    /// All that is known of it.
    fn spec(&self) -> InputSpec;
}

impl<A> InputDecl for Input<A> {
    fn spec(&self) -> InputSpec {
        self.spec
    }
}

impl<A> Input<A> {
    const fn new(name: &'static str, arity: Arity, needs: Needs, help: &'static str) -> Self {
        fn now(_: &Params) -> Times {
            Times::NOW
        }
        Self { spec: InputSpec { name, help, arity, needs, times: now }, arity: std::marker::PhantomData }
    }

    /// The name in graph files.
    pub const fn name(&self) -> &'static str {
        self.spec.name
    }

    /// Read at these times instead of now.
    pub const fn read_at(mut self, times: fn(&Params) -> Times) -> Self {
        self.spec.times = times;
        self
    }
}

impl Input<One> {
    /// An input that needs a wire with a component of `kind`.
    pub const fn one(name: &'static str, kind: Kind, help: &'static str) -> Self {
        Self::new(name, Arity::One, Needs::Kind(kind), help)
    }

    /// An input that needs a wire with any components.
    pub const fn any(name: &'static str, help: &'static str) -> Self {
        Self::new(name, Arity::One, Needs::Any, help)
    }
}

impl Input<Opt> {
    /// An input that may have a wire with a component of `kind`.
    pub const fn optional(name: &'static str, kind: Kind, help: &'static str) -> Self {
        Self::new(name, Arity::Optional, Needs::Kind(kind), help)
    }
}

impl Input<Many> {
    /// An input with a list of wires, maybe none, each with a component of `kind`.
    pub const fn many(name: &'static str, kind: Kind, help: &'static str) -> Self {
        Self::new(name, Arity::Many { least: 0 }, Needs::Kind(kind), help)
    }

    /// An input with a list of at least one wire, each with any components.
    pub const fn any_many(name: &'static str, help: &'static str) -> Self {
        Self::new(name, Arity::Many { least: 1 }, Needs::Any, help)
    }
}

/// Which components an output carries.
#[derive(Clone, Copy, Debug)]
pub enum Carries {
    /// These.
    Kinds(&'static [Kind]),
    /// What the input of that name carries.
    Like(&'static str),
    /// What all wires of the list input of that name carry together.
    Union(&'static str),
}

/// A handle of an output.
#[derive(Clone, Copy, Debug)]
pub struct Output {
    /// Name after the dot in `"id.port"`.
    pub name: &'static str,
    /// What comes out.
    pub help: &'static str,
    /// Which components it carries.
    pub carries: Carries,
}

impl Output {
    /// An output that carries `kinds`.
    pub const fn new(name: &'static str, kinds: &'static [Kind], help: &'static str) -> Self {
        Self { name, help, carries: Carries::Kinds(kinds) }
    }

    /// An output that carries what `input` carries.
    pub const fn like<A>(name: &'static str, input: &Input<A>, help: &'static str) -> Self {
        Self { name, help, carries: Carries::Like(input.name()) }
    }

    /// An output that carries what all wires of `input` carry together.
    pub const fn union(name: &'static str, input: &Input<Many>, help: &'static str) -> Self {
        Self { name, help, carries: Carries::Union(input.name()) }
    }

    /// This output with its geometry: what a node returns.
    pub fn with(self, geometry: impl Into<Arc<Geometry>>) -> Outputs {
        Outputs::default().and(self, geometry)
    }
}

impl Cx<'_> {
    /// What comes in through an input, at the frame that is cooked.
    pub fn input<A: Wired>(&self, input: Input<A>) -> A::View<'_> {
        A::view(&self.data(input.name()).now)
    }

    /// What came in through an input at the start; see [`Times::start`].
    pub fn at_start<A: Wired>(&self, input: Input<A>) -> A::View<'_> {
        A::view(&self.data(input.name()).start)
    }

    /// The component an input needs, at the frame that is cooked: the check before the cook saw to it.
    pub fn part(&self, input: Input<One>) -> &crate::geometry::Component {
        let kind = match input.spec.needs {
            Needs::Kind(kind) => kind,
            Needs::Any => panic!("it asks for the component of the input `{}`, which takes any", input.name()),
        };
        self.input(input).part(kind).expect("the engine refuses a wire that lacks what its input needs")
    }
}
