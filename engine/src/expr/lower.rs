//! Compiles nodes to instructions: vectors become components, functions become arithmetic.
//!
//! Promise: what passed `check` with all attributes known is compiled in one pass. Limit: at most [`MAX_CODE`]
//! instructions.

use super::Width;
use super::ast::{Ast, Node, Target};
use super::builder::Builder;
use super::code::{Binary, Code, Id, Input, Unary};
use super::error::{ExprError, Position};
use super::functions::{Each, FunctionKind, MOST_ARGUMENTS};
use crate::geometry::ColumnType;

/// The largest number of instructions of a text: their batches fit in 8 MB.
pub(super) const MAX_CODE: usize = 16384;

/// The value of a node. A scalar has its value in all four components, so that it can be combined with any component of
/// a vector.
#[derive(Clone, Copy)]
struct Value {
    width: Width,
    ids: [Id; 4],
}

impl Value {
    fn scalar(id: Id) -> Value {
        Value { width: Width::Scalar, ids: [id; 4] }
    }

    fn components(&self) -> &[Id] {
        &self.ids[..self.width.count()]
    }
}

/// A component of an attribute and the value it gets.
#[derive(Clone, Copy, Debug)]
pub(super) struct Store {
    pub(super) attribute: u32,
    pub(super) component: u32,
    pub(super) value: Id,
    /// The position of the last assignment to the attribute.
    pub(super) position: Position,
}

/// The code of a text: `results` are the components of the value of an expression, `stores` are the assignments of a program, one for each
/// component, in the order of attributes and components.
pub(super) struct Lowered {
    pub(super) code: Code,
    pub(super) results: Vec<Id>,
    pub(super) stores: Vec<Store>,
}

/// Compiles `ast`, whose widths have been checked; `kinds` by attribute, `controls` by control.
///
/// # Errors
/// If it needs more than [`MAX_CODE`] instructions.
pub(super) fn lower(ast: &Ast, controls: &[Width], kinds: &[Option<ColumnType>]) -> Result<Lowered, ExprError> {
    let mut lowering = Lowering {
        ast,
        controls: offsets(controls),
        kinds,
        code: Builder::default(),
        values: Vec::with_capacity(ast.nodes.len()),
        written: vec![[None; 4]; ast.attributes.len()],
    };
    let mut results = Vec::new();
    for statement in &ast.statements {
        let value = lowering.value(statement.value as usize)?;
        match statement.target {
            Target::Result | Target::Components => results.extend(value.components()),
            Target::Local => {}
            Target::Attribute { attribute, component } => {
                lowering.assign(attribute, component, value, statement.position);
            }
        }
    }

    let mut stores = Vec::new();
    for (attribute, written) in lowering.written.iter().enumerate() {
        for (component, written) in written.iter().enumerate() {
            if let Some((value, position)) = *written {
                let (attribute, component) = (attribute as u32, component as u32);
                stores.push(Store { attribute, component, value, position });
            }
        }
    }
    let outputs: Vec<Id> = stores.iter().map(|store| store.value).chain(results).collect();
    let (code, outputs) = lowering.code.finish(&outputs);
    for (store, id) in stores.iter_mut().zip(&outputs) {
        store.value = *id;
    }
    let results = outputs[stores.len()..].to_vec();
    Ok(Lowered { code, results, stores })
}

/// For each control the index of its first number among the numbers of all controls, and its width.
fn offsets(controls: &[Width]) -> Vec<(u32, Width)> {
    let mut next = 0;
    let mut offset = |width: &Width| {
        let at = next;
        next += width.count() as u32;
        (at, *width)
    };
    controls.iter().map(&mut offset).collect()
}

struct Lowering<'a> {
    ast: &'a Ast,
    controls: Vec<(u32, Width)>,
    kinds: &'a [Option<ColumnType>],
    code: Builder,
    values: Vec<Value>,
    /// The last value assigned to each component of each attribute, and the position of the assignment.
    written: Vec<[Option<(Id, Position)>; 4]>,
}

impl Lowering<'_> {
    /// The value of node `last`; compiles the nodes up to it.
    fn value(&mut self, last: usize) -> Result<Value, ExprError> {
        for k in self.values.len()..=last {
            let value = self.node(&self.ast.nodes[k]);
            if self.code.len() > MAX_CODE {
                let fact = format!("the text compiles to more than {MAX_CODE} instructions");
                return Err(self.ast.positions[k].fault(fact));
            }
            self.values.push(value);
        }
        Ok(self.values[last])
    }

    /// Rounds the value as if it were stored and read again, so that later lines see the stored value.
    fn assign(&mut self, attribute: u32, component: Option<u32>, value: Value, position: Position) {
        let kind = self.kind(attribute);
        let op = if kind.is_float() { Unary::Single } else { Unary::Round };
        let stored = value.ids.map(|id| Some((self.code.unary(op, id), position)));
        let written = &mut self.written[attribute as usize];
        match component {
            Some(component) => written[component as usize] = stored[0],
            None => {
                let count = kind.width();
                written[..count].copy_from_slice(&stored[..count]);
            }
        }
    }

    fn kind(&self, attribute: u32) -> ColumnType {
        // Checked: every attribute that is read or assigned has a kind.
        self.kinds[attribute as usize].unwrap_or(ColumnType::F1)
    }

    fn node(&mut self, node: &Node) -> Value {
        match *node {
            Node::Number(value) => Value::scalar(self.code.constant(value)),
            Node::Input(input) => Value::scalar(self.code.input(input)),
            Node::Control(control) => {
                let (first, width) = self.controls[control as usize];
                self.gather(width, |code, k| code.input(Input::Control { control, at: first + k }))
            }
            Node::Attribute(attribute) => {
                let written = self.written[attribute as usize];
                let width = Width::of(self.kind(attribute));
                self.gather(width, |code, component| match written[component as usize] {
                    Some((id, _)) => id,
                    None => code.input(Input::Attribute { attribute, component }),
                })
            }
            Node::Local(node) => self.values[node as usize],
            Node::Unary(op, a) => {
                let a = self.values[a as usize];
                self.each(&[a], |code, [a, ..]| code.unary(op, a))
            }
            Node::Binary(operator, a, b) => {
                let (a, b) = (self.values[a as usize], self.values[b as usize]);
                let operands = if operator.swapped { [b, a] } else { [a, b] };
                self.each(&operands, |code, [a, b, ..]| code.binary(operator.op, a, b))
            }
            Node::Select(condition, yes, no) => {
                let [condition, yes, no] = [condition, yes, no].map(|id| self.values[id as usize]);
                self.each(&[condition, yes, no], |code, [c, y, n, ..]| code.select(c, y, n))
            }
            Node::Component(of, component) => Value::scalar(self.values[of as usize].ids[component as usize]),
            Node::Call(function, first, count) => {
                let ids = &self.ast.arguments[first as usize..][..count as usize];
                let arguments: Vec<Value> = ids.iter().map(|id| self.values[*id as usize]).collect();
                self.call(function.kind, &arguments)
            }
        }
    }

    fn gather(&mut self, width: Width, mut id: impl FnMut(&mut Builder, u32) -> Id) -> Value {
        let mut ids = [id(&mut self.code, 0); 4];
        for (k, slot) in ids.iter_mut().enumerate().take(width.count()).skip(1) {
            *slot = id(&mut self.code, k as u32);
        }
        Value { width, ids }
    }

    /// Works component by component; the result has the greatest width of `values`.
    fn each(&mut self, values: &[Value], id: impl Fn(&mut Builder, [Id; MOST_ARGUMENTS]) -> Id) -> Value {
        let width = values.iter().map(|value| value.width).max().unwrap_or(Width::Scalar);
        self.gather(width, |code, k| {
            let mut ids = [0; MOST_ARGUMENTS];
            for (id, value) in ids.iter_mut().zip(values) {
                *id = value.ids[k as usize];
            }
            id(code, ids)
        })
    }

    fn call(&mut self, kind: FunctionKind, arguments: &[Value]) -> Value {
        let first = arguments[0];
        match kind {
            FunctionKind::Each(each) => {
                let count = arguments.len();
                self.each(arguments, |code, ids| component(code, each, &ids[..count]))
            }
            FunctionKind::Noise => {
                let mut at = [self.code.constant(0.0); 3];
                if first.width == Width::Vec3 {
                    at.copy_from_slice(first.components());
                } else {
                    for (at, argument) in at.iter_mut().zip(arguments) {
                        *at = argument.ids[0];
                    }
                }
                Value::scalar(self.code.noise(at))
            }
            FunctionKind::Rand => {
                let second = match arguments.get(1) {
                    Some(second) => second.ids[0],
                    None => self.code.constant(0.0),
                };
                Value::scalar(self.code.random(first.ids[0], second))
            }
            FunctionKind::Vector => {
                let mut ids = first.ids;
                for (id, argument) in ids.iter_mut().zip(arguments) {
                    *id = argument.ids[0];
                }
                Value { width: if arguments.len() == 4 { Width::Vec4 } else { Width::Vec3 }, ids }
            }
            FunctionKind::Length => Value::scalar(self.length(first)),
            FunctionKind::Distance => {
                let between = self.each(arguments, |code, [a, b, ..]| code.binary(Binary::Subtract, a, b));
                Value::scalar(self.length(between))
            }
            FunctionKind::Dot => Value::scalar(self.dot(first, arguments[1])),
            FunctionKind::Cross => {
                let (a, b) = (first.ids, arguments[1].ids);
                self.gather(Width::Vec3, |code, k| {
                    let (j, l) = ((k as usize + 1) % 3, (k as usize + 2) % 3);
                    let plus = code.binary(Binary::Multiply, a[j], b[l]);
                    let minus = code.binary(Binary::Multiply, a[l], b[j]);
                    code.binary(Binary::Subtract, plus, minus)
                })
            }
            FunctionKind::Normalize => {
                let length = Value::scalar(self.length(first));
                self.each(&[first, length], |code, [x, length, ..]| {
                    let zero = code.constant(0.0);
                    let is_zero = code.binary(Binary::Equal, length, zero);
                    let share = code.binary(Binary::Divide, x, length);
                    code.select(is_zero, zero, share)
                })
            }
        }
    }

    /// The sum of products, starting with x.
    fn dot(&mut self, a: Value, b: Value) -> Id {
        let products = self.each(&[a, b], |code, [a, b, ..]| code.binary(Binary::Multiply, a, b));
        let [first, rest @ ..] = products.components() else { return products.ids[0] };
        rest.iter().fold(*first, |sum, product| self.code.binary(Binary::Add, sum, *product))
    }

    fn length(&mut self, a: Value) -> Id {
        if a.width == Width::Scalar {
            return self.code.unary(Unary::Abs, a.ids[0]);
        }
        let square = self.dot(a, a);
        self.code.unary(Unary::Sqrt, square)
    }
}

/// One component of a function of components.
fn component(code: &mut Builder, each: Each, x: &[Id]) -> Id {
    match each {
        Each::Unary(op) => code.unary(op, x[0]),
        Each::Binary(op) => x[1..].iter().fold(x[0], |left, right| code.binary(op, left, *right)),
        Each::Scale(factor) => {
            let factor = code.constant(factor);
            code.binary(Binary::Multiply, x[0], factor)
        }
        Each::Fract => {
            let floor = code.unary(Unary::Floor, x[0]);
            code.binary(Binary::Subtract, x[0], floor)
        }
        Each::Clamp => clamp(code, x[0], x[1], x[2]),
        Each::Mix => mix(code, x[0], x[1], x[2]),
        Each::Step => code.binary(Binary::LessEqual, x[0], x[1]),
        Each::Smoothstep => {
            let t = share(code, x[2], x[0], x[1]);
            let square = code.binary(Binary::Multiply, t, t);
            let (two, three) = (code.constant(2.0), code.constant(3.0));
            let double = code.binary(Binary::Multiply, two, t);
            let rest = code.binary(Binary::Subtract, three, double);
            code.binary(Binary::Multiply, square, rest)
        }
        Each::Fit => {
            let t = share(code, x[0], x[1], x[2]);
            mix(code, x[3], x[4], t)
        }
    }
}

fn clamp(code: &mut Builder, x: Id, low: Id, high: Id) -> Id {
    let raised = code.binary(Binary::Max, x, low);
    code.binary(Binary::Min, raised, high)
}

/// `a·(1 − t) + b·t`: exactly a at 0 and exactly b at 1.
fn mix(code: &mut Builder, a: Id, b: Id, t: Id) -> Id {
    let one = code.constant(1.0);
    let rest = code.binary(Binary::Subtract, one, t);
    let from = code.binary(Binary::Multiply, a, rest);
    let to = code.binary(Binary::Multiply, b, t);
    code.binary(Binary::Add, from, to)
}

/// (x − low)/(high − low), clamped to 0…1; if `low` equals `high`, a step at that value.
fn share(code: &mut Builder, x: Id, low: Id, high: Id) -> Id {
    let (zero, one) = (code.constant(0.0), code.constant(1.0));
    let above = code.binary(Binary::Subtract, x, low);
    let width = code.binary(Binary::Subtract, high, low);
    let ratio = code.binary(Binary::Divide, above, width);
    let clamped = clamp(code, ratio, zero, one);
    let no_width = code.binary(Binary::Equal, low, high);
    let step = code.binary(Binary::LessEqual, low, x);
    code.select(no_width, step, clamped)
}
