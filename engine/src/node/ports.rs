//! Inputs and outputs of a node: typed handles, the components that they need and carry, and when inputs are read.

use std::sync::Arc;

use super::{Cx, Outputs};
use crate::error::{Error, Result};
use crate::geometry::{Component, Geometry, Kind, PREF};
use crate::param::Params;

/// The number of wires that an input takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arity {
    /// Exactly one.
    One,
    /// Zero or one.
    Optional,
    /// A list of at least this many.
    Many {
        /// Fewest wires.
        least: usize,
    },
}

/// The components that an input needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Needs {
    /// This one.
    Kind(Kind),
    /// Any.
    Any,
}

impl Needs {
    /// Whether a wire that carries `kinds` is sufficient.
    pub fn hold(self, kinds: &[Kind]) -> bool {
        match self {
            Self::Kind(kind) => kinds.contains(&kind),
            Self::Any => true,
        }
    }
}

/// The times at which a node reads an input. A window or solver reads `now` at every whole frame it advances over.
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

    /// Both these times and `other`.
    #[must_use]
    pub const fn and(self, other: Self) -> Self {
        let steps = if self.steps > other.steps { self.steps } else { other.steps };
        Self { now: self.now || other.now, start: self.start || other.start, steps }
    }
}

/// The specification of an input.
#[derive(Clone, Copy, Debug)]
pub struct InputSpec {
    /// Name in graph files.
    pub name: &'static str,
    /// What it is for.
    pub help: &'static str,
    /// The number of wires.
    pub arity: Arity,
    /// The components that it needs.
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

/// How a node gets the wires of an input.
pub trait Wired {
    /// `&Geometry`, `Option<&Geometry>` or `&[Arc<Geometry>]`.
    type View<'a>;
    /// `&Component`, `Option<&Component>` or `Vec<&Component>`.
    type Parts<'a>;
    #[doc(hidden)]
    fn view(wires: &[Arc<Geometry>]) -> Self::View<'_>;
    #[doc(hidden)]
    fn parts(wires: &[Arc<Geometry>], kind: Kind) -> Self::Parts<'_>;
}

/// The component of `kind`, which the engine has seen on every wire of an input that needs it.
fn part_of(wire: &Arc<Geometry>, kind: Kind) -> &Component {
    wire.part(kind).expect("the engine refuses a wire that lacks what its input needs")
}

impl Wired for One {
    type View<'a> = &'a Geometry;
    fn view(wires: &[Arc<Geometry>]) -> &Geometry {
        wires.first().expect("the graph was checked: a required input has a wire")
    }
    type Parts<'a> = &'a Component;
    fn parts(wires: &[Arc<Geometry>], kind: Kind) -> &Component {
        part_of(wires.first().expect("the graph was checked: a required input has a wire"), kind)
    }
}

impl Wired for Opt {
    type View<'a> = Option<&'a Geometry>;
    fn view(wires: &[Arc<Geometry>]) -> Option<&Geometry> {
        wires.first().map(Arc::as_ref)
    }
    type Parts<'a> = Option<&'a Component>;
    fn parts(wires: &[Arc<Geometry>], kind: Kind) -> Option<&Component> {
        wires.first().map(|wire| part_of(wire, kind))
    }
}

impl Wired for Many {
    type View<'a> = &'a [Arc<Geometry>];
    fn view(wires: &[Arc<Geometry>]) -> &[Arc<Geometry>] {
        wires
    }
    type Parts<'a> = Vec<&'a Component>;
    fn parts(wires: &[Arc<Geometry>], kind: Kind) -> Vec<&Component> {
        wires.iter().map(|wire| part_of(wire, kind)).collect()
    }
}

/// A typed handle of an input, declared through [`crate::inputs!`].
pub struct Input<A = One> {
    spec: InputSpec,
    arity: std::marker::PhantomData<fn() -> A>,
}

impl<A> Clone for Input<A> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<A> Copy for Input<A> {}

/// An input of any arity.
pub trait InputDecl: Sync {
    /// Its specification.
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

    /// The component that it needs.
    fn kind(&self) -> Kind {
        match self.spec.needs {
            Needs::Kind(kind) => kind,
            Needs::Any => panic!("it asks for the component of the input `{}`, which takes any", self.name()),
        }
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

/// The components that an output carries.
#[derive(Clone, Copy, Debug)]
pub enum Carries {
    /// These.
    Kinds(&'static [Kind]),
    /// Those of the input of that name.
    Like(&'static str),
    /// Those of all wires of the list input of that name.
    Union(&'static str),
}

/// A handle of an output.
#[derive(Clone, Copy, Debug)]
pub struct Output {
    /// Name after the dot in `"id.port"`.
    pub name: &'static str,
    /// What it carries, in words.
    pub help: &'static str,
    /// The components that it carries.
    pub carries: Carries,
    /// Whether it may lack them, as a file may.
    pub may_lack: bool,
}

impl Output {
    /// An output that carries `kinds`.
    pub const fn new(name: &'static str, kinds: &'static [Kind], help: &'static str) -> Self {
        Self { name, help, carries: Carries::Kinds(kinds), may_lack: false }
    }

    /// An output with the components of `input`.
    pub const fn like<A>(name: &'static str, input: &Input<A>, help: &'static str) -> Self {
        Self { name, help, carries: Carries::Like(input.name()), may_lack: false }
    }

    /// An output with the components of all wires of `input`.
    pub const fn union(name: &'static str, input: &Input<Many>, help: &'static str) -> Self {
        Self { name, help, carries: Carries::Union(input.name()), may_lack: false }
    }

    /// An output that may lack its components; an input that needs them then refuses the wire when it is cooked.
    pub const fn may_lack(mut self) -> Self {
        self.may_lack = true;
        self
    }

    /// This output with its geometry: what a node returns.
    pub fn with(self, geometry: impl Into<Arc<Geometry>>) -> Outputs {
        Outputs::default().and(self, geometry)
    }
}

impl Cx<'_> {
    /// The geometry of an input at the frame that is cooked.
    pub fn input<A: Wired>(&self, input: Input<A>) -> A::View<'_> {
        A::view(&self.data(input.name()).now)
    }

    /// The geometry of an input at the start; see [`Times::start`].
    pub fn at_start<A: Wired>(&self, input: Input<A>) -> A::View<'_> {
        A::view(self.start_of(input.name()))
    }

    /// The component that an input needs, at the frame that is cooked; of a list of wires, the component of each.
    ///
    /// # Panics
    /// Where the input takes any kind of component; so do [`Cx::part_at_start`] and [`Cx::edit`].
    pub fn part<A: Wired>(&self, input: Input<A>) -> A::Parts<'_> {
        A::parts(&self.data(input.name()).now, input.kind())
    }

    /// The component that an input needs, at the start; see [`Times::start`].
    ///
    /// # Panics
    /// As [`Cx::part`].
    pub fn part_at_start<A: Wired>(&self, input: Input<A>) -> A::Parts<'_> {
        A::parts(self.start_of(input.name()), input.kind())
    }

    /// The wires of an input at the start.
    ///
    /// # Panics
    /// Where the input does not declare that it is read then.
    fn start_of(&self, name: &'static str) -> &[Arc<Geometry>] {
        let data = self.data(name);
        assert!(
            !data.start.is_empty() || data.now.is_empty(),
            "the input `{name}` is read at the start, which its `read_at` does not name"
        );
        &data.start
    }

    /// Where the points of `part` are at rest, `part` being the component of that input: its `Pref`, a position for each point, or
    /// else the input's positions at the start. The input is read then ([`Times::START`]), and [`PREF`] is declared.
    ///
    /// # Errors
    /// Where neither has a position for each point.
    pub fn at_rest<'a>(&'a self, input: Input<One>, part: &'a Component) -> Result<&'a [[f32; 3]]> {
        if let Some(rest) = part.get(PREF) {
            return Ok(rest);
        }
        let start = self.part_at_start(input);
        if start.point_count() != part.point_count() || start.runs() != part.runs() {
            let fact = format!(
                "without `Pref`, the shape at rest of `{}` is that of the first frame, which has other points or elements",
                input.name()
            );
            return Err(Error::refused(fact).hint("give it a `Pref`"));
        }
        Ok(start.positions())
    }
}
