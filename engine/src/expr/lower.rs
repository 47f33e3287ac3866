//! Nodes to instructions: vectors become their components, functions become arithmetic.
//!
//! Promise: what `check` let through with every attribute known becomes code, in one pass. Limit:
//! no more than [`MAX_CODE`] instructions.

use super::Width;
use super::ast::{Ast, Node, Target};
use super::builder::Builder;
use super::code::{Binary, Code, Id, Input, Unary};
use super::error::{ExprError, Place};
use super::functions::{Does, Each, MOST_ARGUMENTS};
use crate::geometry::ColumnType;

/// Most instructions of a text: a batch of each fits in 8 MB.
pub(super) const MAX_CODE: usize = 16384;

/// The value of a node: a scalar has its one value in all four places, so that it stands for any
/// component it is joined with.
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
    /// Where the attribute is last assigned.
    pub(super) place: Place,
}

/// The code of a text: what an expression gives is its `result`, what a program leaves its `stores`,
/// one a component, in the order of attributes and components.
pub(super) struct Lowered {
    pub(super) code: Code,
    pub(super) result: Option<Id>,
    pub(super) stores: Vec<Store>,
}

/// Makes the code of `ast`, whose widths are right; `kinds` by attribute, `controls` by control.
///
/// # Errors
/// When it is longer than [`MAX_CODE`].
pub(super) fn lower(ast: &Ast, controls: &[Width], kinds: &[Option<ColumnType>]) -> Result<Lowered, ExprError> {
    let mut lowering = Lowering {
        ast,
        controls: offsets(controls),
        kinds,
        code: Builder::default(),
        values: Vec::with_capacity(ast.nodes.len()),
        written: vec![[None; 4]; ast.attributes.len()],
    };
    let mut result = None;
    for statement in &ast.statements {
        let value = lowering.value(statement.value as usize)?;
        match statement.target {
            Target::Result => result = Some(value.ids[0]),
            Target::Local => {}
            Target::Attribute { attribute, component } => {
                lowering.assign(attribute, component, value, statement.place);
            }
        }
    }

    let mut stores = Vec::new();
    for (attribute, written) in lowering.written.iter().enumerate() {
        for (component, written) in written.iter().enumerate() {
            if let Some((value, place)) = *written {
                let (attribute, component) = (attribute as u32, component as u32);
                stores.push(Store { attribute, component, value, place });
            }
        }
    }
    let outputs: Vec<Id> = stores.iter().map(|store| store.value).chain(result).collect();
    let (code, outputs) = lowering.code.finish(&outputs);
    for (store, id) in stores.iter_mut().zip(&outputs) {
        store.value = *id;
    }
    let result = result.and(outputs.last().copied());
    Ok(Lowered { code, result, stores })
}

/// Where each control's numbers begin among all controls' numbers, and how many they are.
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
    /// What each component of each attribute was last assigned, and where.
    written: Vec<[Option<(Id, Place)>; 4]>,
}

impl Lowering<'_> {
    /// The value of node `last`, after all nodes before it.
    fn value(&mut self, last: usize) -> Result<Value, ExprError> {
        for k in self.values.len()..=last {
            let value = self.node(&self.ast.nodes[k]);
            if self.code.len() > MAX_CODE {
                let fact = format!("the text takes more than {MAX_CODE} instructions");
                return Err(self.ast.places[k].fault(fact));
            }
            self.values.push(value);
        }
        Ok(self.values[last])
    }

    /// As if the value were stored and read again: later lines see what the file will hold.
    fn assign(&mut self, attribute: u32, component: Option<u32>, value: Value, place: Place) {
        let kind = self.kind(attribute);
        let op = if kind.is_float() { Unary::Single } else { Unary::Round };
        let stored = value.ids.map(|id| Some((self.code.unary(op, id), place)));
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
                self.call(function.does, &arguments)
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

    /// Component by component; as wide as the widest of `values`.
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

    fn call(&mut self, does: Does, arguments: &[Value]) -> Value {
        let first = arguments[0];
        match does {
            Does::Each(each) => {
                let count = arguments.len();
                self.each(arguments, |code, ids| component(code, each, &ids[..count]))
            }
            Does::Noise => {
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
            Does::Rand => {
                let second = match arguments.get(1) {
                    Some(second) => second.ids[0],
                    None => self.code.constant(0.0),
                };
                Value::scalar(self.code.random(first.ids[0], second))
            }
            Does::Vector => {
                let mut ids = first.ids;
                for (id, argument) in ids.iter_mut().zip(arguments) {
                    *id = argument.ids[0];
                }
                Value { width: if arguments.len() == 4 { Width::Vec4 } else { Width::Vec3 }, ids }
            }
            Does::Length => Value::scalar(self.length(first)),
            Does::Distance => {
                let between = self.each(arguments, |code, [a, b, ..]| code.binary(Binary::Subtract, a, b));
                Value::scalar(self.length(between))
            }
            Does::Dot => Value::scalar(self.dot(first, arguments[1])),
            Does::Cross => {
                let (a, b) = (first.ids, arguments[1].ids);
                self.gather(Width::Vec3, |code, k| {
                    let (j, l) = ((k as usize + 1) % 3, (k as usize + 2) % 3);
                    let plus = code.binary(Binary::Multiply, a[j], b[l]);
                    let minus = code.binary(Binary::Multiply, a[l], b[j]);
                    code.binary(Binary::Subtract, plus, minus)
                })
            }
            Does::Normalize => {
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

    /// Products added from x on.
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

/// Where x is between `low` (0) and `high` (1), clamped; where they are equal, a step there.
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
