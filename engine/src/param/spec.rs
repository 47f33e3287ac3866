//! The specification of a param of any type, used by help, schema and validation.

use super::Params;
use super::choice::ChoiceOption;
use super::unit::Unit;
use super::value::Value;
use crate::files::File;

/// The JSON form of a param.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// A number.
    Float,
    /// A whole number.
    Int,
    /// `true` or `false`.
    Bool,
    /// `[x, y]`
    Vec2,
    /// `[x, y, z]`
    Vec3,
    /// Three whole numbers.
    Int3,
    /// `[a, b]` with a ≤ b.
    Span,
    /// Degrees about x, y, z.
    Turn,
    /// A whole number that the scene's seed is mixed into.
    Seed,
    /// One of a few words.
    Choice(&'static [ChoiceOption]),
    /// `{"ramp": [[x, y], …]}`
    Ramp,
    /// A string.
    Text,
    /// Strings.
    Texts,
    /// A path.
    File,
    /// A number, or `{"value": …, "attribute": "…"}`.
    Masked,
    /// `[[x, y, z], …]`
    Vec3s,
    /// Whole numbers.
    Ints,
    /// `[[a, b, c, d], …]`
    Tets,
    /// `{"name": [numbers], …}`
    Columns,
    /// A string of assignments.
    Code,
}

impl Shape {
    /// How a value of this shape is written, for help and faults.
    pub fn describe(self) -> String {
        match self {
            Self::Float => "a number".into(),
            Self::Int | Self::Seed => "a whole number".into(),
            Self::Bool => "`true` or `false`".into(),
            Self::Vec2 => "two numbers [x, y]".into(),
            Self::Vec3 => "a vector [x, y, z]".into(),
            Self::Int3 => "three whole numbers [x, y, z]".into(),
            Self::Span => "a range [a, b]".into(),
            Self::Turn => "angles [x, y, z] in degrees".into(),
            Self::Choice(options) => {
                let words: Vec<String> = options.iter().map(|option| format!("\"{}\"", option.word)).collect();
                format!("one of {}", words.join(", "))
            }
            Self::Ramp => "a ramp {\"ramp\": [[x, y], …]}".into(),
            Self::Text => "a string".into(),
            Self::Texts => "a list of strings".into(),
            Self::File => "a path".into(),
            Self::Masked => "a number, or {\"value\": …, \"attribute\": \"…\"}".into(),
            Self::Vec3s => "a list of vectors [[x, y, z], …]".into(),
            Self::Ints => "a list of whole numbers".into(),
            Self::Tets => "a list of tets [[a, b, c, d], …]".into(),
            Self::Columns => "attributes {\"name\": [numbers], …}".into(),
            Self::Code => "a string of assignments".into(),
        }
    }

    /// The number of expressions that `{"expr": …}` takes for this shape; `None` if it cannot be an expression.
    pub fn expressions(self) -> Option<usize> {
        match self {
            Self::Float | Self::Int | Self::Bool | Self::Masked | Self::Seed => Some(1),
            Self::Vec2 | Self::Span => Some(2),
            Self::Vec3 | Self::Int3 | Self::Turn => Some(3),
            _ => None,
        }
    }
}

/// A hard range: values outside are refused.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// The least value.
    pub low: f64,
    /// Whether `low` itself is refused.
    pub open: bool,
    /// The greatest value.
    pub high: f64,
}

impl Bounds {
    /// Everything finite.
    pub const ALL: Self = Self { low: f64::NEG_INFINITY, open: false, high: f64::INFINITY };

    /// Whether `x` is finite and inside.
    pub fn hold(self, x: f64) -> bool {
        x.is_finite() && x <= self.high && if self.open { x > self.low } else { x >= self.low }
    }
}

impl std::fmt::Display for Bounds {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match (self.low.is_finite(), self.open, self.high.is_finite()) {
            (false, _, false) => write!(f, "any finite number"),
            (false, _, true) => write!(f, "at most {}", self.high),
            (true, true, false) => write!(f, "more than {}", self.low),
            (true, false, false) => write!(f, "at least {}", self.low),
            (true, true, true) => write!(f, "more than {}, at most {}", self.low, self.high),
            (true, false, true) => write!(f, "{}…{}", self.low, self.high),
        }
    }
}

/// Finds the files that a file is read with at a frame.
pub type Companions = fn(&File, f64) -> crate::Result<Vec<File>>;

/// What a handle declares in addition to name, default and help.
#[derive(Clone, Copy, Debug)]
pub struct Facts {
    /// Unit of the number.
    pub unit: Unit,
    /// Values outside are refused.
    pub hard: Bounds,
    /// The usual range.
    pub soft: Option<[f64; 2]>,
    /// May not be animated.
    pub fixed: bool,
    /// Read over all times since frame 0.
    pub history: bool,
    /// May not be the zero vector.
    pub direction: bool,
    /// Whether it is read, given the other params.
    pub when: Option<fn(&Params) -> bool>,
    /// Its value if the graph does not set it.
    pub unset: Unset,
    /// Of a param that selects a time of a file: whether the file has several, given all params with their files.
    pub timed: Option<fn(&Params) -> bool>,
    /// Of a file: the other files that it is read with at a frame.
    pub companions: Option<Companions>,
}

/// The value of a param that the graph does not set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unset {
    /// The declared default.
    Default,
    /// The current frame, rounded down.
    CurrentFrame,
    /// The current frame with its fraction.
    CurrentTime,
    /// The scene's first frame.
    SceneStart,
}

impl Facts {
    pub(super) const NONE: Self = Self {
        unit: Unit::None,
        hard: Bounds::ALL,
        soft: None,
        fixed: false,
        history: false,
        direction: false,
        when: None,
        unset: Unset::Default,
        timed: None,
        companions: None,
    };
}

/// The specification of a param.
#[derive(Clone, Debug)]
pub struct ParamSpec {
    /// Name in graph files.
    pub name: &'static str,
    /// What it does.
    pub help: &'static str,
    /// How it is written in JSON.
    pub shape: Shape,
    /// Value if the graph does not set it.
    pub default: Value,
    /// Unit, ranges and use.
    pub facts: Facts,
}

impl ParamSpec {
    /// The fact and hint of a fault if `value` is refused; `None` if it is allowed. Expects a value of this shape.
    pub fn refuses(&self, value: &Value) -> Option<(String, String)> {
        let (name, hard) = (self.name, self.facts.hard);
        let range = || format!("expected {hard}{}", self.unit_text());
        let outside = |shown: String| Some((format!("`{name}` is {shown}"), range()));
        let is_whole = matches!(self.shape, Shape::Int | Shape::Int3 | Shape::Seed);
        if is_whole && matches!(value, Value::Float(_) | Value::Vec3(_)) {
            let hint = format!("expected {}; floor(…), ceil(…) and round(…) give whole numbers", self.shape.describe());
            return Some((format!("`{name}` is {value}"), hint));
        }
        let numbers: &[f64] = match value {
            Value::Float(x) | Value::Masked(x, _) => std::slice::from_ref(x),
            Value::Vec2(v) => v,
            Value::Vec3(v) => v,
            Value::Span(v) => v,
            Value::Turn(v) => v,
            Value::Int(i) => return (!hard.hold(*i as f64)).then(|| outside(i.to_string()))?,
            Value::Int3(v) => return (!v.iter().all(|i| hard.hold(*i as f64))).then(|| outside(value.to_string()))?,
            Value::Ramp(ramp) => {
                let outside_key = ramp.keys().iter().find(|[_, y]| !hard.hold(f64::from(*y)));
                return outside_key.and_then(|[x, y]| outside(format!("{y} at {x}")));
            }
            _ => return None,
        };
        // A rotation is a quaternion here, whose components need only be finite.
        let hard = if matches!(value, Value::Turn(_)) { Bounds::ALL } else { hard };
        if !numbers.iter().all(|x| hard.hold(*x)) {
            return outside(value.to_string());
        }
        match value {
            Value::Span([a, b]) if a > b => {
                let fact = format!("`{name}` is [{a}, {b}], whose lower end is greater than its upper end");
                Some((fact, "write the smaller number first".into()))
            }
            Value::Vec3(v) if self.facts.direction && v.iter().all(|x| x.abs() < f64::MIN_POSITIVE) => Some((
                format!("`{name}` is {value}, which has no direction"),
                "use a vector that is not zero, such as [1, 0, 0]".into(),
            )),
            _ => None,
        }
    }

    /// Whether its numbers are degrees.
    pub fn is_in_degrees(&self) -> bool {
        self.shape == Shape::Turn || self.facts.unit == Unit::Degrees
    }

    /// The unit with a space before it, ` m/s`; empty for a plain number.
    pub fn unit_text(&self) -> String {
        match self.facts.unit {
            Unit::None => String::new(),
            unit if unit.sign().starts_with('1') => format!(" ({})", unit.sign()),
            unit => format!(" {}", unit.sign()),
        }
    }

    /// The default as help shows it.
    pub fn default_text(&self) -> String {
        match self.facts.unset {
            Unset::CurrentFrame | Unset::CurrentTime => return "the current frame".into(),
            Unset::SceneStart => return "the scene's first frame".into(),
            Unset::Default => {}
        }
        match (&self.default, self.shape) {
            (Value::Choice(index), Shape::Choice(options)) => options[*index].word.into(),
            (Value::Turn(_), _) => "[0, 0, 0]".into(),
            (Value::Nothing | Value::Vec3s(_) | Value::Ints(_) | Value::Tets(_) | Value::Columns(_), _) => {
                "none".into()
            }
            (default, _) => default.to_string(),
        }
    }
}
