//! Programs: assignments that compute attributes from attributes, for every point or element.
//!
//! A program is parsed once, checked as far as well-known attributes allow, and checked again against the columns on
//! which it runs.
//!
//! Promise: the same bits on any number of threads, and as if every line ran over all elements before the next. Limit:
//! an element cannot read its neighbours or sums over all elements.

use super::ast::{Ast, Node, Target};
use super::batch::{self, OutOfRange};
use super::check::{self, AttributeState};
use super::code::Input;
use super::error::ExprError;
use super::functions::FunctionKind;
use super::lexer::is_name;
use super::lower::{Lowered, lower};
use super::{Env, Scope, Uses, Width, parser};
use crate::error::{Error, ErrorKind};
use crate::geometry::{Column, ColumnType, fixed_type};

/// A parsed program.
#[derive(Clone, Debug)]
pub struct Program {
    ast: Ast,
    controls: Vec<(String, Width)>,
    uses: Uses,
    reads: Vec<String>,
    writes: Vec<String>,
}

/// Why a program could not run.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RunError {
    /// The program does not fit the columns.
    #[error("{0}")]
    Code(ExprError),
    /// A value is NaN or out of the range of its column.
    #[error("{0}")]
    Value(BadValue),
    /// A column does not have one row per element.
    #[error("the column `{name}` has {rows} rows, not {expected}")]
    Rows {
        /// Its name.
        name: String,
        /// Rows it has.
        rows: usize,
        /// Rows it should have.
        expected: usize,
    },
}

/// A value that its attribute cannot store.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("`{attribute}` would be {value}, not {}", self.expected())]
pub struct BadValue {
    /// The attribute, with the component of a vector: `P.y`.
    pub attribute: String,
    /// The index of the first such point or element, from 0.
    pub element: usize,
    /// The line that assigned it.
    pub line: usize,
    /// The value, rounded to the type of the attribute.
    pub value: f64,
    /// Whether the attribute is f32; else it is i32.
    pub float: bool,
}

impl BadValue {
    fn expected(&self) -> String {
        if self.float {
            "a finite number".to_owned()
        } else {
            format!("a whole number from {} to {}", i32::MIN, i32::MAX)
        }
    }
}

impl From<RunError> for Error {
    fn from(error: RunError) -> Self {
        match error {
            RunError::Code(fault) => {
                let fact = format!("line {}, column {}: {}", fault.line, fault.column, fault.fact);
                Error { hint: fault.hint, ..Error::refused(fact).of_types() }
            }
            RunError::Value(ref bad) => {
                let fact = format!("line {}, element {}: {error}", bad.line, bad.element);
                Error::new(ErrorKind::NotFinite, fact)
            }
            RunError::Rows { .. } => Error::contract(error.to_string()),
        }
    }
}

impl Program {
    /// Parses assignments, one per line. An empty text is a program that does nothing.
    ///
    /// # Errors
    /// The first fault of every line that has one.
    pub fn parse(text: &str, scope: &Scope<'_>) -> Result<Program, Vec<ExprError>> {
        let ast = parser::program(text, scope)?;
        let controls: Vec<(String, Width)> =
            scope.controls.iter().map(|(name, width)| ((*name).to_owned(), *width)).collect();
        let mut attributes: Vec<AttributeState> = ast
            .attributes
            .iter()
            .map(|name| fixed_type(name).map_or(AttributeState::Unknown, AttributeState::Typed))
            .collect();
        check::check(&ast, &widths(&controls), &[], &mut attributes)?;

        let mut uses = Uses::default();
        for node in &ast.nodes {
            match node {
                Node::Input(input) => uses.record(*input),
                Node::Control(control) => uses.record_control(*control),
                Node::Call(function, ..) if matches!(function.kind, FunctionKind::Noise | FunctionKind::Rand) => {
                    uses.record(Input::Seed);
                }
                _ => {}
            }
        }
        let (reads, writes) = reads_and_writes(&ast);
        Ok(Program { ast, controls, uses, reads, writes })
    }

    /// What it reads in addition to attributes.
    pub fn uses(&self) -> &Uses {
        &self.uses
    }

    /// Attributes that the input must have: those read, or assigned in part, before being assigned as a whole.
    pub fn reads(&self) -> &[String] {
        &self.reads
    }

    /// Attributes that it creates or changes.
    pub fn writes(&self) -> &[String] {
        &self.writes
    }

    /// Runs over `rows` elements, with one row per element in every column. Returns the written attributes in the order
    /// of [`writes`](Self::writes); attributes that existed keep their type.
    ///
    /// # Errors
    /// A name that is neither a column nor a control, a wrong width, or the first value that is NaN or out of the range
    /// of its type.
    pub fn run(
        &self,
        env: &Env<'_>,
        columns: &[(&str, &Column)],
        rows: usize,
    ) -> Result<Vec<(String, Column)>, RunError> {
        let names = &self.ast.attributes;
        let sources: Vec<Option<&Column>> = names
            .iter()
            .map(|name| columns.iter().find(|(column, _)| column == name).map(|(_, column)| *column))
            .collect();
        for (name, column) in names.iter().zip(&sources) {
            if let Some(column) = column
                && column.len() != rows
            {
                let (name, found) = (name.clone(), column.len());
                return Err(RunError::Rows { name, rows: found, expected: rows });
            }
        }

        let (lowered, kinds) = self.lowered(columns, &sources).map_err(RunError::Code)?;
        let mut written: Vec<(usize, Column)> = Vec::with_capacity(self.writes.len());
        for name in &self.writes {
            let attribute = names.iter().position(|attribute| attribute == name).unwrap_or(0);
            let stores = lowered.stores.iter().filter(|s| s.attribute as usize == attribute).count();
            let kind = kinds[attribute].unwrap_or(ColumnType::F1);
            let column = match sources[attribute] {
                Some(source) if stores < kind.width() => source.clone(),
                _ => Column::zeros(kind, rows),
            };
            written.push((attribute, column));
        }
        batch::run(&lowered, env, &sources, &mut written, rows)
            .map_err(|bad| RunError::Value(self.bad_value(&bad, kinds[bad.store.attribute as usize])))?;
        Ok(self.writes.iter().cloned().zip(written.into_iter().map(|(_, column)| column)).collect())
    }

    /// The code for these columns, and the final type of each attribute.
    fn lowered(
        &self,
        columns: &[(&str, &Column)],
        sources: &[Option<&Column>],
    ) -> Result<(Lowered, Vec<Option<ColumnType>>), ExprError> {
        let state = |(name, column): (&String, &Option<&Column>)| match column {
            Some(column) => AttributeState::Typed(column.kind()),
            None => AttributeState::Absent(fixed_type(name)),
        };
        let mut attributes: Vec<AttributeState> = self.ast.attributes.iter().zip(sources).map(state).collect();
        let controls = self.controls.iter().map(|(name, _)| name.as_str());
        let others = columns.iter().map(|(name, _)| *name).chain(controls);
        // Attributes of a file may have names that are not valid in a text.
        let others: Vec<&str> = others.filter(|name| is_name(name)).collect();
        let widths = widths(&self.controls);
        check::check(&self.ast, &widths, &others, &mut attributes).map_err(|mut faults| faults.swap_remove(0))?;
        let kind = |state: &AttributeState| match state {
            AttributeState::Typed(kind) => Some(*kind),
            AttributeState::Absent(_) | AttributeState::Unknown => None,
        };
        let kinds: Vec<Option<ColumnType>> = attributes.iter().map(kind).collect();
        Ok((lower(&self.ast, &widths, &kinds)?, kinds))
    }

    fn bad_value(&self, bad: &OutOfRange, kind: Option<ColumnType>) -> BadValue {
        let name = &self.ast.attributes[bad.store.attribute as usize];
        let attribute = match kind.map(ColumnType::width) {
            Some(3 | 4) => {
                format!("{name}.{}", super::ast::COMPONENTS[bad.store.component as usize])
            }
            _ => name.clone(),
        };
        let float = kind.is_none_or(ColumnType::is_float);
        let line = bad.store.position.line as usize;
        BadValue { attribute, element: bad.row, line, value: bad.value, float }
    }
}

fn widths(controls: &[(String, Width)]) -> Vec<Width> {
    controls.iter().map(|(_, width)| *width).collect()
}

/// Names of attributes in the order of their first read, and of their first assignment.
fn reads_and_writes(ast: &Ast) -> (Vec<String>, Vec<String>) {
    let mut whole = vec![false; ast.attributes.len()];
    let (mut reads, mut writes) = (vec![], vec![]);
    let mut next = 0;
    for statement in &ast.statements {
        let end = statement.value as usize + 1;
        for node in &ast.nodes[next..end] {
            if let Node::Attribute(attribute) = node
                && !whole[*attribute as usize]
            {
                push_new(&mut reads, *attribute);
            }
        }
        next = end;
        if let Target::Attribute { attribute, component } = statement.target {
            push_new(&mut writes, attribute);
            match component {
                None => whole[attribute as usize] = true,
                Some(_) if whole[attribute as usize] => {}
                Some(_) => push_new(&mut reads, attribute),
            }
        }
    }
    let names = |ids: Vec<u32>| ids.iter().map(|id| ast.attributes[*id as usize].clone()).collect();
    (names(reads), names(writes))
}

fn push_new(ids: &mut Vec<u32>, id: u32) {
    if !ids.contains(&id) {
        ids.push(id);
    }
}
