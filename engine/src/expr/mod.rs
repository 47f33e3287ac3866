//! The expression language: animated params, and attributes computed from attributes.
//!
//! One language, two uses. An [`Expr`] is one number of a param: `0.6 + 0.1*sin(2*pi*time)`. A [`Program`] is a list of
//! assignments that runs over every point or element: `envelope = clamp(envelope*P.y, 0, 1)`. [`HELP`] is its reference
//! for users; in addition:
//!
//! * All arithmetic is f64. The value of a line is rounded to the type of its attribute (f32; or the nearest integer,
//!   halves away from zero), and later lines read the rounded value: two lines give the same result as two nodes.
//! * Names are looked up in this order: those of the language, `let`, controls, attributes. So attributes of the input
//!   data cannot change the meaning of a control's name.
//! * NaN: arithmetic, `min`, `max` and `clamp` keep it, comparisons with it are 0 (`!=` is 1), and as
//!   a condition it counts as true. NaN in a param is refused by the code that reads the param, not here.
//! * `noise(x)` is `noise(x, 0, 0)`; `rand(i)` is `rand(i, 0)`. Both depend on the scene's seed.
//!
//! Promise: the same text gives the same bits on every CPU and any number of threads; any string gives a value or
//! faults with line and column. Limit: texts are refused beyond a maximal size and depth (`parser::MAX_TEXT`,
//! `MAX_NODES`, `MAX_DEPTH`, `lower::MAX_CODE`).
//!
//! A text is split into tokens (`lexer`), parsed into nodes (`parser`, `ast`), checked for widths (`check`), compiled
//! to scalar instructions (`lower`, `builder`, `code`), and run on one number or on batches of rows (`batch`).

mod ast;
mod batch;
mod builder;
mod check;
mod code;
mod error;
mod functions;
mod help;
mod lexer;
mod lower;
mod parser;
mod pi;
mod program;
mod random;
pub mod suggest;
#[cfg(test)]
mod tests;

use std::fmt;

pub use error::ExprError;
pub use help::HELP;
pub use parser::RESERVED;
pub use program::{BadValue, Program, RunError};

use crate::geometry::ColumnType;
use ast::Target;
use builder::Builder;
use code::{Code, Id, Input};

/// The number of components of a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Width {
    /// One.
    Scalar,
    /// Three: x, y, z.
    Vec3,
    /// Four: x, y, z, w.
    Vec4,
}

impl Width {
    /// The number of components.
    pub fn count(self) -> usize {
        match self {
            Width::Scalar => 1,
            Width::Vec3 => 3,
            Width::Vec4 => 4,
        }
    }

    /// The width of a row of a column of that type.
    pub fn of(kind: ColumnType) -> Width {
        match kind {
            ColumnType::F1 | ColumnType::I1 => Width::Scalar,
            ColumnType::F3 | ColumnType::I3 => Width::Vec3,
            ColumnType::F4 | ColumnType::I4 => Width::Vec4,
        }
    }

    /// The f32 column type of that width, which new attributes get.
    fn single(self) -> ColumnType {
        match self {
            Width::Scalar => ColumnType::F1,
            Width::Vec3 => ColumnType::F3,
            Width::Vec4 => ColumnType::F4,
        }
    }
}

impl fmt::Display for Width {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Width::Scalar => "a scalar",
            Width::Vec3 => "a 3-vector",
            Width::Vec4 => "a 4-vector",
        })
    }
}

/// The names that a text may use in addition to those of the language and to attributes.
#[derive(Clone, Copy, Debug, Default)]
pub struct Scope<'a> {
    /// Controls, in the order of their numbers in [`Env::controls`]. A control cannot be used if its name is not
    /// `[A-Za-z_][A-Za-z0-9_]*` or is a name of the language.
    pub controls: &'a [(&'a str, Width)],
}

impl Scope<'_> {
    fn control(&self, name: &str) -> Option<usize> {
        self.controls.iter().position(|(control, _)| *control == name)
    }
}

/// The values of the names in an expression.
#[derive(Clone, Copy, Debug)]
pub struct Env<'a> {
    /// Frame number, with fraction.
    pub frame: f64,
    /// Time in seconds.
    pub time: f64,
    /// Frames per second.
    pub fps: f64,
    /// The scene's seed, a whole number.
    pub seed: f64,
    /// The numbers of all controls of the [`Scope`], concatenated; missing ones read as NaN.
    pub controls: &'a [f64],
}

impl Env<'_> {
    /// The value of an input that is the same for all elements; NaN for others.
    fn input(&self, input: Input, count: f64) -> f64 {
        match input {
            Input::Frame => self.frame,
            Input::Time => self.time,
            Input::Fps => self.fps,
            Input::Seed => self.seed,
            Input::Count => count,
            Input::Control { at, .. } => self.controls.get(at as usize).copied().unwrap_or(f64::NAN),
            Input::Index | Input::Attribute { .. } => f64::NAN,
        }
    }
}

/// What a text reads in addition to attributes. For an [`Expr`]: what its value depends on after constant
/// folding (`0 ? time : 1` reads nothing). For a [`Program`]: all names that occur in it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Uses {
    /// `frame` or `time`.
    pub time: bool,
    /// `fps`.
    pub fps: bool,
    /// `seed`, `noise` or `rand`.
    pub seed: bool,
    /// Indices in [`Scope::controls`], ascending.
    pub controls: Vec<usize>,
}

impl Uses {
    fn record(&mut self, input: Input) {
        match input {
            Input::Frame | Input::Time => self.time = true,
            Input::Fps => self.fps = true,
            Input::Seed => self.seed = true,
            Input::Control { control, .. } => self.record_control(control),
            Input::Count | Input::Index | Input::Attribute { .. } => {}
        }
    }

    fn record_control(&mut self, control: u32) {
        if let Err(index) = self.controls.binary_search(&(control as usize)) {
            self.controls.insert(index, control as usize);
        }
    }
}

/// An expression with one number as its value.
#[derive(Clone, Debug)]
pub struct Expr {
    code: Code,
    result: Id,
    uses: Uses,
    pi_is_term: bool,
}

impl Expr {
    /// Parses and compiles an expression.
    ///
    /// # Errors
    /// The first fault of the text, with its position.
    ///
    /// ```
    /// use engine::expr::{Env, Expr, Scope};
    ///
    /// let sway = Expr::parse("0.6 + 0.1*sin(2*pi*time)", &Scope::default())?;
    /// let quarter = Env { frame: 6.0, time: 0.25, fps: 24.0, seed: 0.0, controls: &[] };
    /// assert_eq!(sway.eval(&quarter), 0.7);
    ///
    /// let fault = Expr::parse("0.6 + sin(tme)", &Scope::default()).unwrap_err();
    /// assert_eq!(fault.column, 11);
    /// assert_eq!(fault.hint.as_deref(), Some("did you mean `time`?"));
    /// # Ok::<(), engine::expr::ExprError>(())
    /// ```
    pub fn parse(text: &str, scope: &Scope<'_>) -> Result<Expr, ExprError> {
        Self::components(text, scope, Target::Result).map(|mut one| one.swap_remove(0))
    }

    /// [`Expr::parse`] of an expression whose value may be a vector: an expression for each of its components.
    ///
    /// # Errors
    /// As for [`Expr::parse`].
    pub fn parse_components(text: &str, scope: &Scope<'_>) -> Result<Vec<Expr>, ExprError> {
        Self::components(text, scope, Target::Components)
    }

    fn components(text: &str, scope: &Scope<'_>, target: Target) -> Result<Vec<Expr>, ExprError> {
        let ast = parser::expression(text, scope, target)?;
        let widths: Vec<Width> = scope.controls.iter().map(|(_, width)| *width).collect();
        check::check(&ast, &widths, &[], &mut []).map_err(|mut faults| faults.swap_remove(0))?;
        let lowered = lower::lower(&ast, &widths, &[])?;
        let mut uses = Uses::default();
        lowered.code.inputs().for_each(|input| uses.record(input));
        let (code, pi_is_term) = (lowered.code, pi::is_term(&ast));
        let component = |result: &Id| Expr { code: code.clone(), result: *result, uses: uses.clone(), pi_is_term };
        Ok(lowered.results.iter().map(component).collect())
    }

    /// An expression that is a number.
    pub fn number(value: f64) -> Expr {
        let mut builder = Builder::default();
        let result = builder.constant(value);
        let (code, results) = builder.finish(&[result]);
        Expr { code, result: results[0], uses: Uses::default(), pi_is_term: false }
    }

    /// The value, which may be NaN or infinite.
    pub fn eval(&self, env: &Env<'_>) -> f64 {
        /// Up to this number of values needs no allocation; typical expressions have about ten.
        const FEW: usize = 32;
        let run = |values: &mut [[f64; 1]]| {
            self.code.run(values, 0, env.seed, |input, out| *out = [env.input(input, 1.0)]);
            values[self.result as usize][0]
        };
        let length = self.code.len();
        if length <= FEW { run(&mut [[0.0]; FEW][..length]) } else { run(&mut vec![[0.0]; length]) }
    }

    /// The value if it is a constant.
    pub fn constant(&self) -> Option<f64> {
        self.code.constant(self.result)
    }

    /// What the value depends on.
    pub fn uses(&self) -> &Uses {
        &self.uses
    }

    /// Whether the value depends on `frame` or `time` directly; controls that it reads may also be animated.
    pub fn reads_time(&self) -> bool {
        self.uses.time
    }

    /// Whether `pi` is a term or factor of the value, which then is an angle in radians.
    pub fn has_pi_as_term(&self) -> bool {
        self.pi_is_term
    }

    /// The controls that the value depends on, as indices in [`Scope::controls`], ascending.
    pub fn controls(&self) -> &[usize] {
        &self.uses.controls
    }
}
