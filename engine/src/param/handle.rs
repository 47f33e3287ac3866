//! Typed handles of params. A handle declares a param's name, default, ranges, unit and help in one place; help,
//! schema, validation and conformance tests are derived from it.

use super::code::Code;
use super::spec::{Bounds, Companions, Facts, ParamSpec, Shape, Unset};
use super::unit::Unit;
use super::value::{Maskable, Seed, Span, Turn, Value};
use super::{Params, choice::Choice};
use crate::files::File;
use crate::geometry::{Column, Name};
use numerics::ramp::{Interpolation, Ramp};
use std::sync::Arc;

/// A type that a param can have.
pub trait ParamType: 'static {
    /// The type that a node gets: for most types the type itself.
    type Value: Clone;
    /// The type of a default in a constant.
    type Default: Copy + Send + Sync + 'static;
    /// How it is written in JSON.
    fn shape() -> Shape;
    /// The default as an erased value.
    fn erase_default(default: Self::Default) -> Value;
    /// The typed value; `None` if the erased value is of another type.
    fn typed(value: &Value) -> Option<Self::Value>;
    /// The erased value.
    fn erase(value: Self::Value) -> Value;
}

/// A typed handle, declared as a constant through [`crate::params!`].
pub struct Param<T: ParamType> {
    name: &'static str,
    help: &'static str,
    default: T::Default,
    facts: Facts,
}

impl<T: ParamType> Clone for Param<T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T: ParamType> Copy for Param<T> {}

/// A param of any type.
pub trait ParamDecl: Sync {
    /// Its name, shape, default, ranges, unit and help.
    fn spec(&self) -> ParamSpec;
}

impl<T: ParamType> ParamDecl for Param<T> {
    fn spec(&self) -> ParamSpec {
        ParamSpec {
            name: self.name,
            help: self.help,
            shape: T::shape(),
            default: T::erase_default(self.default),
            facts: self.facts,
        }
    }
}

impl<T: ParamType> Param<T> {
    const fn new(name: &'static str, default: T::Default, help: &'static str) -> Self {
        Self { name, help, default, facts: Facts::NONE }
    }

    /// The name in graph files.
    pub const fn name(&self) -> &'static str {
        self.name
    }

    /// Refuses values below `low`.
    pub const fn at_least(mut self, low: f64) -> Self {
        self.facts.hard = Bounds { low, open: false, high: self.facts.hard.high };
        self
    }

    /// Refuses `low` and below.
    pub const fn above(mut self, low: f64) -> Self {
        self.facts.hard = Bounds { low, open: true, high: self.facts.hard.high };
        self
    }

    /// Refuses values outside `low…high`.
    pub const fn within(mut self, low: f64, high: f64) -> Self {
        self.facts.hard = Bounds { low, open: false, high };
        self
    }

    /// The usual range, shown in help and viewers; values outside are allowed.
    pub const fn soft(mut self, low: f64, high: f64) -> Self {
        self.facts.soft = Some([low, high]);
        self
    }

    /// The unit of the number.
    pub const fn unit(mut self, unit: Unit) -> Self {
        self.facts.unit = unit;
        self
    }

    /// May not be animated.
    pub const fn fixed(mut self) -> Self {
        self.facts.fixed = true;
        self
    }

    /// Read over all times since frame 0, through [`crate::node::FrameCx::integral`].
    pub const fn history(mut self) -> Self {
        self.facts.history = true;
        self
    }

    /// Read only if `when` holds for the other params; otherwise the node sees the default, and neither keys nor plans
    /// depend on its value.
    pub const fn when(mut self, when: fn(&Params) -> bool) -> Self {
        self.facts.when = Some(when);
        self
    }

    /// If the graph does not set it, the value is the current frame, rounded down.
    pub const fn default_current_frame(mut self) -> Self {
        self.facts.unset = Unset::CurrentFrame;
        self
    }

    /// If the graph does not set it, the value is the current frame, with its fraction.
    pub const fn default_current_time(mut self) -> Self {
        self.facts.unset = Unset::CurrentTime;
        self
    }

    /// Selects a time of a file: read only where `timed` says that the file has several, or the file is one of a numbered
    /// sequence. `timed` gets all params with their files.
    pub const fn of_timed_file(mut self, timed: fn(&Params) -> bool) -> Self {
        self.facts.timed = Some(timed);
        self
    }

    /// The param is a file that is read with others, which depend on the value of the node's param `frame`.
    pub const fn read_with(mut self, companions: Companions) -> Self {
        self.facts.companions = Some(companions);
        self
    }

    /// If the graph does not set it, the value is the scene's first frame.
    pub const fn default_scene_start(mut self) -> Self {
        self.facts.unset = Unset::SceneStart;
        self
    }
}

macro_rules! types {
    ($($t:ty, $default:ty, $shape:expr, $erase:expr, $value:pat => $typed:expr, $back:expr;)*) => {$(
        impl ParamType for $t {
            type Value = Self;
            type Default = $default;
            fn shape() -> Shape { $shape }
            fn erase_default(default: $default) -> Value { ($erase)(default) }
            fn typed(value: &Value) -> Option<Self> {
                match value { $value => Some($typed), _ => None }
            }
            fn erase(value: Self) -> Value { ($back)(value) }
        }
    )*};
}

types! {
    f64, f64, Shape::Float, Value::Float, Value::Float(x) => *x, Value::Float;
    f32, f32, Shape::Float, |x: f32| Value::Float(shortest(x)), Value::Float(x) => *x as f32,
        |x: f32| Value::Float(shortest(x));
    i64, i64, Shape::Int, Value::Int, Value::Int(i) => *i, Value::Int;
    bool, bool, Shape::Bool, Value::Bool, Value::Bool(b) => *b, Value::Bool;
    [f32; 2], [f32; 2], Shape::Vec2, |v: [f32; 2]| Value::Vec2(v.map(shortest)), Value::Vec2(v) => v.map(|x| x as f32),
        |v: [f32; 2]| Value::Vec2(v.map(shortest));
    [f32; 3], [f32; 3], Shape::Vec3, |v: [f32; 3]| Value::Vec3(v.map(shortest)), Value::Vec3(v) => v.map(|x| x as f32),
        |v: [f32; 3]| Value::Vec3(v.map(shortest));
    [f64; 3], [f64; 3], Shape::Vec3, Value::Vec3, Value::Vec3(v) => *v, Value::Vec3;
    [i64; 3], [i64; 3], Shape::Int3, Value::Int3, Value::Int3(v) => *v, Value::Int3;
    Span, [f32; 2], Shape::Span, |v: [f32; 2]| Value::Span(v.map(shortest)),
        Value::Span(v) => Span { low: v[0] as f32, high: v[1] as f32 },
        |span: Self| Value::Span([span.low, span.high].map(shortest));
    Turn, (), Shape::Turn, |()| Value::Turn([0.0, 0.0, 0.0, 1.0]), Value::Turn(q) => Turn(*q),
        |turn: Self| Value::Turn(turn.0);
    Seed, i64, Shape::Seed, Value::Int, Value::Int(seed) => Seed(*seed as u32),
        |seed: Self| Value::Int(i64::from(seed.0));
    Name, &'static str, Shape::Text, |text: &str| Value::Text(text.into()), Value::Text(text) => text.clone(),
        Value::Text;
    Code, &'static str, Shape::Code, |text: &str| Value::Code(Code::new(text)), Value::Code(code) => code.clone(),
        Value::Code;
    Arc<Vec<Name>>, &'static [&'static str], Shape::Texts,
        |texts: &[&str]| Value::Texts(Arc::new(texts.iter().map(|text| (*text).into()).collect())),
        Value::Texts(texts) => texts.clone(), Value::Texts;
    Option<File>, (), Shape::File, |()| Value::File(None), Value::File(file) => file.clone(), Value::File;
    Maskable, f32, Shape::Masked, |x: f32| Value::Masked(shortest(x), None),
        Value::Masked(x, attribute) => Maskable { value: *x as f32, attribute: attribute.clone() },
        |masked: Self| Value::Masked(shortest(masked.value), masked.attribute);
    Arc<Ramp>, RampDefault, Shape::Ramp, |ramp: RampDefault| Value::Ramp(Arc::new(ramp.build())),
        Value::Ramp(ramp) => ramp.clone(), Value::Ramp;
    Arc<Vec<[f32; 3]>>, (), Shape::Vec3s, |()| Value::Vec3s(Arc::default()), Value::Vec3s(rows) => rows.clone(),
        Value::Vec3s;
    Arc<Vec<i32>>, (), Shape::Ints, |()| Value::Ints(Arc::default()), Value::Ints(rows) => rows.clone(), Value::Ints;
    Arc<Vec<[u32; 4]>>, (), Shape::Tets, |()| Value::Tets(Arc::default()), Value::Tets(rows) => rows.clone(),
        Value::Tets;
    Arc<Vec<(Name, Column)>>, (), Shape::Columns, |()| Value::Columns(Arc::default()), Value::Columns(c) => c.clone(),
        Value::Columns;
}

/// Vectors that may be absent, which differs from an empty list.
impl ParamType for Option<Arc<Vec<[f32; 3]>>> {
    type Value = Self;
    type Default = ();
    fn shape() -> Shape {
        Shape::Vec3s
    }
    fn erase_default((): ()) -> Value {
        Value::Nothing
    }
    fn typed(value: &Value) -> Option<Self> {
        match value {
            Value::Nothing => Some(None),
            Value::Vec3s(rows) => Some(Some(rows.clone())),
            _ => None,
        }
    }
    fn erase(value: Self) -> Value {
        value.map_or(Value::Nothing, Value::Vec3s)
    }
}

/// Numbers that may be absent, so that something else decides.
macro_rules! optional {
    ($($t:ty, $shape:expr, $value:pat => $typed:expr, $back:expr;)*) => {$(
        impl ParamType for Option<$t> {
            type Value = Self;
            type Default = ();
            fn shape() -> Shape { $shape }
            fn erase_default((): ()) -> Value { Value::Nothing }
            fn typed(value: &Value) -> Option<Self> {
                match value {
                    Value::Nothing => Some(None),
                    $value => Some(Some($typed)),
                    _ => None,
                }
            }
            fn erase(value: Self) -> Value { value.map_or(Value::Nothing, $back) }
        }
    )*};
}

optional! {
    f32, Shape::Float, Value::Float(x) => *x as f32, |x: f32| Value::Float(shortest(x));
    [f32; 3], Shape::Vec3, Value::Vec3(v) => v.map(|x| x as f32), |v: [f32; 3]| Value::Vec3(v.map(shortest));
}

impl<T: Choice> ParamType for T {
    type Value = T::Value;
    type Default = T::Value;
    fn shape() -> Shape {
        Shape::Choice(T::OPTIONS)
    }
    fn erase_default(default: T::Value) -> Value {
        Self::erase(default)
    }
    fn typed(value: &Value) -> Option<T::Value> {
        match value {
            Value::Choice(index) => T::VALUES.get(*index).copied(),
            _ => None,
        }
    }
    fn erase(value: T::Value) -> Value {
        let index = T::VALUES.iter().position(|listed| *listed == value);
        Value::Choice(index.expect("a choice lists every value that its node uses"))
    }
}

/// The f64 that prints like the f32: a default of 0.3 is shown as 0.3 and converts back to the same f32.
fn shortest(x: f32) -> f64 {
    x.to_string().parse().unwrap_or(f64::from(x))
}

/// A ramp's default, writable in a constant.
#[derive(Clone, Copy)]
pub struct RampDefault {
    keys: &'static [[f32; 2]],
    interpolation: Interpolation,
}

impl RampDefault {
    fn build(self) -> Ramp {
        Ramp::new(self.keys.to_vec(), self.interpolation).expect("a ramp's default is checked by the conformance suite")
    }
}

impl Param<f32> {
    /// A number.
    pub const fn float(name: &'static str, default: f32, help: &'static str) -> Self {
        Self::new(name, default, help)
    }
}

impl Param<f64> {
    /// A number in double precision.
    pub const fn double(name: &'static str, default: f64, help: &'static str) -> Self {
        Self::new(name, default, help)
    }
}

impl Param<i64> {
    /// A whole number.
    pub const fn int(name: &'static str, default: i64, help: &'static str) -> Self {
        Self::new(name, default, help)
    }
}

impl Param<bool> {
    /// `true` or `false`.
    pub const fn bool(name: &'static str, default: bool, help: &'static str) -> Self {
        Self::new(name, default, help)
    }
}

impl Param<Option<f32>> {
    /// A number that is absent unless the graph sets it.
    pub const fn optional_float(name: &'static str, help: &'static str) -> Self {
        Self::new(name, (), help)
    }
}

impl Param<Option<[f32; 3]>> {
    /// A vector that is absent unless the graph sets it.
    pub const fn optional_vec3(name: &'static str, help: &'static str) -> Self {
        Self::new(name, (), help)
    }
}

impl Param<[f32; 2]> {
    /// Two numbers.
    pub const fn vec2(name: &'static str, default: [f32; 2], help: &'static str) -> Self {
        Self::new(name, default, help)
    }
}

impl Param<[f32; 3]> {
    /// A vector.
    pub const fn vec3(name: &'static str, default: [f32; 3], help: &'static str) -> Self {
        Self::new(name, default, help)
    }
}

impl Param<[f64; 3]> {
    /// A direction: a vector that is not zero. Its length does not matter.
    pub const fn direction(name: &'static str, default: [f64; 3], help: &'static str) -> Self {
        let mut param = Self::new(name, default, help);
        param.facts.direction = true;
        param
    }

    /// A vector in double precision.
    pub const fn dvec3(name: &'static str, default: [f64; 3], help: &'static str) -> Self {
        Self::new(name, default, help)
    }
}

impl Param<[i64; 3]> {
    /// Three whole numbers.
    pub const fn int3(name: &'static str, default: [i64; 3], help: &'static str) -> Self {
        Self::new(name, default, help)
    }
}

impl Param<Span> {
    /// A range a…b to draw from; a must not exceed b.
    pub const fn span(name: &'static str, default: [f32; 2], help: &'static str) -> Self {
        Self::new(name, default, help)
    }
}

impl Param<Turn> {
    /// A rotation: degrees about x, then y, then z. Keys interpolate as rotations.
    pub const fn rotation(name: &'static str, help: &'static str) -> Self {
        Self::new(name, (), help).unit(Unit::Degrees)
    }
}

impl Param<Seed> {
    /// A seed, mixed with the scene's.
    pub const fn seed(help: &'static str) -> Self {
        Self::new("seed", 0, help)
    }
}

impl Param<Name> {
    /// A string.
    pub const fn text(name: &'static str, default: &'static str, help: &'static str) -> Self {
        Self::new(name, default, help)
    }
}

impl Param<Code> {
    /// Assignments that run on points or elements and may use the graph's controls; empty by default.
    pub const fn code(name: &'static str, help: &'static str) -> Self {
        Self::new(name, "", help)
    }
}

impl Param<Arc<Vec<Name>>> {
    /// A list of strings.
    pub const fn texts(name: &'static str, default: &'static [&'static str], help: &'static str) -> Self {
        Self::new(name, default, help)
    }
}

impl Param<Option<File>> {
    /// A file, relative to the graph file; runs of `#` are replaced by the frame number. None by default.
    pub const fn file(name: &'static str, help: &'static str) -> Self {
        Self::new(name, (), help).fixed()
    }
}

impl Param<Maskable> {
    /// A number that a point attribute may scale (⊗).
    pub const fn maskable(name: &'static str, default: f32, help: &'static str) -> Self {
        Self::new(name, default, help)
    }
}

impl Param<Arc<Ramp>> {
    /// A curve over 0…1, linear between its keys.
    pub const fn ramp(name: &'static str, keys: &'static [[f32; 2]], help: &'static str) -> Self {
        Self::new(name, RampDefault { keys, interpolation: Interpolation::Linear }, help)
    }

    /// A curve over 0…1, a smoothstep between its keys.
    pub const fn smooth_ramp(name: &'static str, keys: &'static [[f32; 2]], help: &'static str) -> Self {
        Self::new(name, RampDefault { keys, interpolation: Interpolation::Smooth }, help)
    }
}

impl Param<Arc<Vec<[f32; 3]>>> {
    /// A list of vectors, empty by default. Keys are interpolated; their lists are of equal length.
    pub const fn vec3s(name: &'static str, help: &'static str) -> Self {
        Self::new(name, (), help)
    }
}

impl<T: Choice> Param<T> {
    /// One of a few words.
    pub const fn choice(name: &'static str, default: T::Value, help: &'static str) -> Self {
        Self::new(name, default, help)
    }
}

impl<T: ParamType<Default = ()>> Param<T> {
    /// Inline data of the graph file, empty by default.
    pub const fn inline(name: &'static str, help: &'static str) -> Self {
        Self::new(name, (), help).fixed()
    }
}
