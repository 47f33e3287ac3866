//! Sources of a param's value: a literal, keyframes, or expressions, which can be evaluated at any time.

use std::path::Path;
use std::sync::Arc;

use numerics::ramp::{Interpolation, Ramp};
use numerics::random::Key;

use super::code::Code;
use super::controls::ControlTable;
use super::spec::Shape;
use super::turn::{self, euler_to_turn};
use super::value::Value;
use crate::expr::{Expr, ExprError, Program};
use crate::geometry::Name;

/// What expressions can read of the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clock {
    /// Frames per second.
    pub fps: f64,
    /// The scene's seed.
    pub seed: i64,
}

/// One key: its frame and its value. Rotations are kept in degrees, so that whole turns are not lost.
pub type Keyframe = (f64, Value);

/// Values at frames, constant before the first and after the last.
#[derive(Clone, Debug, PartialEq)]
pub struct Keyframes {
    /// At least one, frames strictly increasing.
    pub keys: Vec<Keyframe>,
    /// The interpolation between keys. Choices, booleans and strings are constant until the next key.
    pub interpolation: Interpolation,
}

/// Where a value comes from, and how to evaluate it.
#[derive(Clone, Debug)]
pub enum Source {
    /// The same at all times.
    Constant(Value),
    /// Keyframes.
    Keys(Arc<Keyframes>, Shape),
    /// One expression for each number of the shape, and the controls (numbers and vectors) that they may use.
    Exprs(Arc<Vec<Expr>>, Shape, Arc<ControlTable>),
    /// Code, and the controls that it may use.
    Code(CodeSource),
    /// The current frame, rounded down.
    CurrentFrame,
    /// The current frame with its fraction.
    CurrentTime,
    /// A file, opened when the params are resolved. If `numbered`, runs of `#` in its path are replaced by the frame
    /// number.
    File {
        /// Its path.
        path: Arc<Path>,
        /// Whether the path contains runs of `#`.
        numbered: bool,
    },
    /// A number from a source, scaled by a point attribute.
    Masked(Box<Source>, Name),
}

impl Source {
    /// Whether the value may change with time.
    pub fn is_animated(&self) -> bool {
        match self {
            Self::Constant(_) => false,
            Self::Keys(keys, _) => keys.keys.windows(2).any(|pair| pair[0].1 != pair[1].1),
            Self::Exprs(exprs, _, controls) => exprs.iter().any(|expr| {
                let uses = expr.uses();
                uses.time || uses.controls.iter().any(|control| controls.is_animated(*control))
            }),
            Self::Code(code) => code.is_animated(),
            Self::CurrentFrame | Self::CurrentTime => true,
            // A numbered path depends on the node's param `frame`, which is checked on its own.
            Self::File { .. } => false,
            Self::Masked(value, _) => value.is_animated(),
        }
    }

    /// Whether it is a sequence of numbered files.
    pub(crate) fn is_sequence(&self) -> bool {
        matches!(self, Self::File { numbered: true, .. })
    }

    /// The attribute that masks it, if one does.
    pub fn mask(&self) -> Option<&Name> {
        match self {
            Self::Masked(_, attribute) | Self::Constant(Value::Masked(_, Some(attribute))) => Some(attribute),
            _ => None,
        }
    }

    /// The value at `frame`, a frame number with fraction.
    pub fn at(&self, frame: f64, clock: Clock) -> Value {
        match self {
            Self::Constant(value) => value.clone(),
            Self::Keys(keys, shape) => keys.at(frame, *shape),
            Self::Exprs(exprs, shape, controls) => {
                let read = exprs.iter().flat_map(|expr| expr.controls().iter().copied());
                let numbers = controls.numbers(frame, clock, read);
                let env = clock.env(frame, &numbers);
                let x = |k: usize| exprs[k].eval(&env);
                match shape {
                    Shape::Int => whole(x(0)).map_or(Value::Float(x(0)), Value::Int),
                    Shape::Seed => {
                        whole(x(0)).map_or(Value::Float(x(0)), |own| Value::Int(mixed_seed(clock.seed, own)))
                    }
                    Shape::Bool => Value::Bool(x(0) != 0.0),
                    Shape::Vec2 => Value::Vec2([x(0), x(1)]),
                    Shape::Span => Value::Span([x(0), x(1)]),
                    Shape::Vec3 => Value::Vec3([x(0), x(1), x(2)]),
                    Shape::Int3 => match [x(0), x(1), x(2)].map(whole) {
                        [Some(a), Some(b), Some(c)] => Value::Int3([a, b, c]),
                        _ => Value::Vec3([x(0), x(1), x(2)]),
                    },
                    Shape::Turn => euler_to_turn([x(0), x(1), x(2)]),
                    Shape::Masked => Value::Masked(x(0), None),
                    _ => Value::Float(x(0)),
                }
            }
            Self::Code(code) => Value::Code(code.at(frame, clock)),
            Self::CurrentFrame => Value::Int(frame.floor() as i64),
            Self::CurrentTime => Value::Float(frame),
            Self::File { .. } => Value::File(None),
            Self::Masked(value, attribute) => Value::Masked(value.at(frame, clock).number(), Some(attribute.clone())),
        }
    }
}

/// The seed that a node gets: a param's own and the scene's, mixed. Always within u32.
pub(crate) fn mixed_seed(scene: i64, own: i64) -> i64 {
    i64::from(Key::new(scene as u64).of(own as u64).u32())
}

/// The integer that an expression gives, up to rounding errors of its arithmetic. Other numbers are returned unchanged,
/// and refused later like any value of another shape.
fn whole(x: f64) -> Option<i64> {
    /// Relative: enough for 0.1*30 to be 3 and for frame/24*24 to be the frame.
    const ROUNDING: f64 = 1e-12;
    let nearest = x.round();
    let fits = nearest.abs() < 9.2e18 && (x - nearest).abs() <= ROUNDING * nearest.abs().max(1.0);
    fits.then_some(nearest as i64)
}

impl Value {
    /// The value of a scalar; 0 for anything else.
    pub fn number(&self) -> f64 {
        match self {
            Self::Float(x) | Self::Masked(x, _) => *x,
            Self::Int(i) => *i as f64,
            Self::Bool(b) => f64::from(u8::from(*b)),
            _ => 0.0,
        }
    }
}

impl Keyframes {
    fn at(&self, frame: f64, shape: Shape) -> Value {
        let next = self.keys.partition_point(|(at, _)| *at <= frame);
        let finished = |value: &Value| match (shape, value) {
            (Shape::Turn, Value::Vec3(degrees)) => euler_to_turn(*degrees),
            _ => value.clone(),
        };
        if next == 0 {
            return finished(&self.keys[0].1);
        }
        let (at, value) = &self.keys[next - 1];
        let Some((until, goal)) = self.keys.get(next).filter(|_| self.interpolation != Interpolation::Constant) else {
            return finished(value);
        };
        let share = (frame - at) / (until - at);
        let share = match self.interpolation {
            Interpolation::Smooth => share * share * (3.0 - 2.0 * share),
            _ => share,
        };
        match (shape, value, goal) {
            (Shape::Turn, Value::Vec3(from), Value::Vec3(to)) => turn::between(*from, *to, share),
            _ => blend(value, goal, share),
        }
    }
}

/// Interpolates from `a` to `b` at `share`, component by component; values that cannot be interpolated stay `a`.
fn blend(a: &Value, b: &Value, share: f64) -> Value {
    let mix = |a: f64, b: f64| a + (b - a) * share;
    fn each<const N: usize>(a: [f64; N], b: [f64; N], mix: impl Fn(f64, f64) -> f64) -> [f64; N] {
        std::array::from_fn(|k| mix(a[k], b[k]))
    }
    let ints = |a: i64, b: i64| mix(a as f64, b as f64).round() as i64;
    match (a, b) {
        (Value::Float(a), Value::Float(b)) => Value::Float(mix(*a, *b)),
        (Value::Masked(a, mask), Value::Masked(b, _)) => Value::Masked(mix(*a, *b), mask.clone()),
        (Value::Int(a), Value::Int(b)) => Value::Int(ints(*a, *b)),
        (Value::Int3(a), Value::Int3(b)) => Value::Int3(std::array::from_fn(|k| ints(a[k], b[k]))),
        (Value::Vec2(a), Value::Vec2(b)) => Value::Vec2(each(*a, *b, mix)),
        (Value::Span(a), Value::Span(b)) => Value::Span(each(*a, *b, mix)),
        (Value::Vec3(a), Value::Vec3(b)) => Value::Vec3(each(*a, *b, mix)),
        (Value::Vec3s(a), Value::Vec3s(b)) if a.len() == b.len() => Value::Vec3s(Arc::new(
            a.iter()
                .zip(b.iter())
                .map(|(a, b)| each(a.map(f64::from), b.map(f64::from), mix).map(|x| x as f32))
                .collect(),
        )),
        (Value::Ramp(a), Value::Ramp(b)) if a.keys().len() == b.keys().len() => {
            let keys = a
                .keys()
                .iter()
                .zip(b.keys())
                .map(|(a, b)| each(a.map(f64::from), b.map(f64::from), mix).map(|x| x as f32));
            // If rounding makes two keys coincide, keep the first ramp.
            Ramp::new(keys.collect(), a.interpolation())
                .map_or_else(|_| Value::Ramp(a.clone()), |ramp| Value::Ramp(Arc::new(ramp)))
        }
        _ => a.clone(),
    }
}

/// The source of code: its program, and the controls that it may read.
#[derive(Clone, Debug)]
pub struct CodeSource {
    text: Name,
    program: Arc<Result<Program, Vec<ExprError>>>,
    controls: Arc<ControlTable>,
}

impl CodeSource {
    /// A source for a text that was parsed with `controls` in scope.
    pub(crate) fn new(text: &str, program: Program, controls: Arc<ControlTable>) -> Self {
        Self { text: text.into(), program: Arc::new(Ok(program)), controls }
    }

    /// The controls that it reads.
    fn reads(&self) -> &[usize] {
        self.program.as_ref().as_ref().map_or(&[], |program| &program.uses().controls)
    }

    /// Whether a control that it reads is animated. Whether the code reads the clock is declared by the node.
    pub(super) fn is_animated(&self) -> bool {
        self.reads().iter().any(|control| self.controls.is_animated(*control))
    }

    pub(super) fn at(&self, frame: f64, clock: Clock) -> Code {
        let numbers = self.controls.numbers(frame, clock, self.reads().iter().copied());
        Code::with_controls(self.text.clone(), self.program.clone(), numbers)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CLOCK: Clock = Clock { fps: 24.0, seed: 0 };

    fn keyed(keys: &[(f64, f64)], interpolation: Interpolation) -> Source {
        let keys = keys.iter().map(|(frame, x)| (*frame, Value::Float(*x))).collect();
        Source::Keys(Arc::new(Keyframes { keys, interpolation }), Shape::Float)
    }

    #[test]
    fn keyframes_are_constant_beyond_their_ends_and_linear_between() {
        let source = keyed(&[(1.0, 0.0), (25.0, 1.0)], Interpolation::Linear);
        let at = |frame: f64| source.at(frame, CLOCK).number();
        assert_eq!((at(-5.0), at(1.0), at(13.0), at(25.0), at(99.0)), (0.0, 0.0, 0.5, 1.0, 1.0));
    }

    #[test]
    fn smooth_is_a_smoothstep_and_constant_keeps_the_previous_key() {
        let keys = [(0.0, 0.0), (4.0, 1.0)];
        let at = |interpolation| keyed(&keys, interpolation).at(1.0, CLOCK).number();
        assert_eq!(at(Interpolation::Smooth), 0.15625); // 3/16 − 2/64
        assert_eq!(at(Interpolation::Constant), 0.0);
    }

    #[test]
    fn keyframes_with_one_value_are_not_animated() {
        assert!(!keyed(&[(1.0, 2.0), (9.0, 2.0)], Interpolation::Linear).is_animated());
        assert!(keyed(&[(1.0, 2.0), (9.0, 3.0)], Interpolation::Linear).is_animated());
    }
}
