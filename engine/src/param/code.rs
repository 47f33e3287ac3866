//! Code: assignments that a node runs on points or elements, with the graph's controls in scope.

use std::sync::Arc;

use crate::expr::{ExprError, Program, Scope};
use crate::geometry::Name;
use crate::key::Hasher;

/// A program of assignments (see [`crate::expr`]) and the numbers of the controls that it reads.
#[derive(Clone, Debug)]
pub struct Code {
    text: Name,
    program: Arc<Result<Program, Vec<ExprError>>>,
    /// As [`crate::expr::Env::controls`] has them; 0 for controls that the program does not read.
    numbers: Arc<[f64]>,
}

impl Code {
    /// Code without controls in scope.
    pub fn new(text: &str) -> Self {
        let program = Program::parse(text, &Scope::default());
        Self { text: text.into(), program: Arc::new(program), numbers: Arc::from([]) }
    }

    /// A program of `text` that was parsed with controls in scope, and their numbers.
    pub(super) fn with_controls(text: Name, program: Arc<Result<Program, Vec<ExprError>>>, numbers: Vec<f64>) -> Self {
        Self { text, program, numbers: numbers.into() }
    }

    /// The text.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The program.
    ///
    /// # Errors
    /// The faults of the text. A graph that was loaded has none.
    pub fn program(&self) -> Result<&Program, &[ExprError]> {
        self.program.as_ref().as_ref().map_err(Vec::as_slice)
    }

    /// The numbers of the controls, as [`crate::expr::Env::controls`] has them.
    pub fn controls(&self) -> &[f64] {
        &self.numbers
    }

    /// Indices of the controls that it reads.
    fn reads(&self) -> &[usize] {
        self.program().map_or(&[], |program| &program.uses().controls)
    }

    pub(super) fn add_to<'h>(&self, key: &'h mut Hasher) -> &'h mut Hasher {
        let key = key.text(&self.text).i64(self.reads().len() as i64);
        // A name that is not a control is an attribute, so the set of controls changes the meaning of the text.
        let key = self.reads().iter().fold(key, |key, control| key.i64(*control as i64));
        self.numbers.iter().fold(key.i64(self.numbers.len() as i64), |key, x| key.f64(*x))
    }
}

impl PartialEq for Code {
    fn eq(&self, other: &Self) -> bool {
        self.text == other.text && self.reads() == other.reads() && self.numbers == other.numbers
    }
}

impl From<&str> for Code {
    fn from(text: &str) -> Self {
        Self::new(text)
    }
}

impl std::fmt::Display for Code {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:?}", self.text)
    }
}
