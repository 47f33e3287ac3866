//! Values to try params with, derived from their declarations.

use std::sync::Arc;

use numerics::ramp::{Interpolation, Ramp};
use numerics::random::Key;

use crate::samples::MASK;
use engine::geometry::Column;
use engine::param::{ParamSpec, Shape, Value, euler_to_turn};

/// An end of a param's hard range.
#[derive(Clone, Debug, PartialEq)]
pub struct RangeEnd {
    /// The last value that is accepted.
    pub inside: Value,
    /// A value just beyond it.
    pub outside: Value,
}

/// The finite ends of a param's hard range, the lower one first; none for params without numbers. If a value has
/// several numbers, all of them are at the end.
pub fn range_ends(spec: &ParamSpec) -> Vec<RangeEnd> {
    let hard = spec.facts.hard;
    let whole = matches!(spec.shape, Shape::Int | Shape::Int3);
    let value = |x: f64| match spec.shape {
        Shape::Float => Some(Value::Float(x)),
        Shape::Masked => Some(Value::Masked(x, None)),
        Shape::Int => Some(Value::Int(x as i64)),
        Shape::Vec2 => Some(Value::Vec2([x; 2])),
        Shape::Span => Some(Value::Span([x; 2])),
        Shape::Vec3 if !spec.facts.direction => Some(Value::Vec3([x; 3])),
        Shape::Int3 => Some(Value::Int3([x as i64; 3])),
        _ => None,
    };
    let end = |(end, outwards): (f64, f64)| {
        let step = if whole { 1.0 } else { 1e-6 * end.abs().max(1e-3) };
        let open = hard.open && outwards < 0.0;
        let [inside, outside] = if open { [end + step, end] } else { [end, end + outwards * step] };
        Some(RangeEnd { inside: value(inside)?, outside: value(outside)? })
    };
    [(hard.low, -1.0), (hard.high, 1.0)].into_iter().filter(|(end, _)| end.is_finite()).filter_map(end).collect()
}

/// Values to try: both ends of the range, its middle, each option. All are valid.
pub(crate) fn candidates(spec: &ParamSpec) -> Vec<Value> {
    let [low, high] = ends(spec);
    let middle = 0.5 * low + 0.5 * high;
    let ramp = |keys: &[[f32; 2]]| Ramp::new(keys.to_vec(), Interpolation::Linear).ok().map(Arc::new).map(Value::Ramp);
    let values = match spec.shape {
        Shape::Float => vec![Value::Float(low), Value::Float(high), Value::Float(middle)],
        Shape::Int => [low.ceil(), high.floor(), middle.round()].map(|x| Value::Int(x as i64)).to_vec(),
        Shape::Seed => vec![Value::Int(1), Value::Int(i64::from(u32::MAX))],
        Shape::Bool => vec![Value::Bool(true), Value::Bool(false)],
        Shape::Vec2 => [[low, low], [high, low], [low, high], [high, high]].map(Value::Vec2).to_vec(),
        Shape::Vec3 if spec.facts.direction => {
            [[0.0, 0.0, 1.0], [-1.0, 2.0, 0.5], [0.0, -1e-20, 0.0], [1e20, 1e20, 0.0]].map(Value::Vec3).to_vec()
        }
        Shape::Vec3 => [[low; 3], [high; 3], [middle, low, high]].map(Value::Vec3).to_vec(),
        Shape::Int3 => {
            [[low; 3], [high; 3], [middle, low, high]].map(|v| Value::Int3(v.map(|x| x.round() as i64))).to_vec()
        }
        Shape::Span => [[low, low], [low, high], [high, high], [middle, high]].map(Value::Span).to_vec(),
        Shape::Turn => [[30.0, -50.0, 70.0], [0.0, 180.0, 0.0], [720.0, 0.0, 1e6]].map(euler_to_turn).to_vec(),
        Shape::Choice(options) => (0..options.len()).map(Value::Choice).collect(),
        Shape::Ramp => {
            let [low, high] = [low.max(0.0) as f32, high.min(1.0) as f32];
            let keys: [&[[f32; 2]]; 4] =
                [&[[0.0, low]], &[[0.0, high]], &[[0.0, low], [1.0, high]], &[[0.0, high], [0.3, low], [1.0, high]]];
            keys.into_iter().filter_map(ramp).collect()
        }
        Shape::Text => ["", MASK, "1-3"].map(|text| Value::Text(text.into())).to_vec(),
        Shape::Texts => {
            [vec![], vec!["uvw".into()], vec![MASK.into(), "id".into()]].map(|t| Value::Texts(Arc::new(t))).to_vec()
        }
        Shape::File => Vec::new(),
        Shape::Code => ["", "made = 1", "P.x += 0.1*i"].map(|text| Value::Code(text.into())).to_vec(),
        Shape::Masked => {
            let mask = Some(MASK.into());
            vec![
                Value::Masked(low, None),
                Value::Masked(high, None),
                Value::Masked(middle, None),
                Value::Masked(middle, mask),
            ]
        }
        Shape::Vec3s => {
            let corners = vec![[0.0; 3], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1]];
            [corners.clone(), corners[..2].to_vec(), Vec::new()].map(|rows| Value::Vec3s(Arc::new(rows))).to_vec()
        }
        Shape::Ints => [vec![], vec![4], vec![0, 1, 2], vec![3, 1]].map(|rows| Value::Ints(Arc::new(rows))).to_vec(),
        Shape::Tets => [vec![], vec![[0, 1, 2, 3]]].map(|rows| Value::Tets(Arc::new(rows))).to_vec(),
        Shape::Columns => {
            let rows = |rows: usize| ("sample_inline".into(), Column::new(vec![0.5_f32; rows]));
            [vec![], vec![rows(4)], vec![rows(1)], vec![rows(3)]]
                .map(|columns| Value::Columns(Arc::new(columns)))
                .to_vec()
        }
    };
    values.into_iter().filter(|value| spec.refuses(value).is_none()).collect()
}

/// A random value: often the default, often one of the candidates, otherwise anywhere in the usual range.
pub(crate) fn random(spec: &ParamSpec, at: Key) -> Value {
    let candidates = candidates(spec);
    let pick = at.of(1).f32();
    if pick < 0.3 || candidates.is_empty() {
        return spec.default.clone();
    }
    let [low, high] = ends(spec);
    let number = |k: u64| low + (high - low) * at.of(10 + k).f64();
    let within = match spec.shape {
        Shape::Float => Some(Value::Float(number(0))),
        Shape::Int => Some(Value::Int(number(0).round() as i64)),
        Shape::Vec3 if !spec.facts.direction => Some(Value::Vec3([0, 1, 2].map(number))),
        Shape::Vec3 => Some(Value::Vec3([0, 1, 2].map(|k| at.of(20 + k).f64() - 0.5))),
        Shape::Span => Some(Value::Span([number(0).min(number(1)), number(0).max(number(1))])),
        Shape::Masked => Some(Value::Masked(number(0), None)),
        Shape::Seed => Some(Value::Int(i64::from(at.of(30).u32()))),
        _ => None,
    };
    match within.filter(|value| pick > 0.65 && spec.refuses(value).is_none()) {
        Some(value) => value,
        None => candidates[at.of(2).u32() as usize % candidates.len()].clone(),
    }
}

/// Integers above this are not tried without need: they may be counts of elements.
const MOST_COUNT: f64 = 64.0;

/// The range of values that are tried: the hard range where it is finite, otherwise the usual range, otherwise a wide
/// range around the default. Integers stay in the usual range if the hard one is too wide.
pub(crate) fn ends(spec: &ParamSpec) -> [f64; 2] {
    let (hard, soft) = (spec.facts.hard, spec.facts.soft);
    let default = largest(&spec.default);
    let around = if default > 0.0 { 100.0 * default } else { 1.0 };
    let whole = matches!(spec.shape, Shape::Int | Shape::Int3);
    let around = if whole { (4.0 * default + 7.0).min(MOST_COUNT.max(default)) } else { around };
    let high = match soft {
        Some([_, high]) if !hard.high.is_finite() || (whole && hard.high > MOST_COUNT) => high,
        None if !hard.high.is_finite() || (whole && hard.high > MOST_COUNT) => {
            around.max(hard.low + 1.0).min(hard.high)
        }
        _ => hard.high,
    };
    let low = match soft {
        _ if hard.low.is_finite() && hard.open => hard.low + 1e-3 * (high - hard.low),
        _ if hard.low.is_finite() => hard.low,
        Some([low, _]) => low,
        None => -around,
    };
    [low, high]
}

/// The largest magnitude among the numbers of a value.
fn largest(value: &Value) -> f64 {
    match value {
        Value::Vec2(v) | Value::Span(v) => v.iter().fold(0.0, |most, x| x.abs().max(most)),
        Value::Vec3(v) => v.iter().fold(0.0, |most, x| x.abs().max(most)),
        Value::Int3(v) => v.iter().fold(0.0, |most, x| (*x as f64).abs().max(most)),
        value => value.number().abs(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use engine::param::{Param, ParamDecl, Unit};

    #[test]
    fn both_ends_of_a_range_are_tried_and_an_open_end_a_little_inside() {
        let closed = Param::<f32>::float("x", 0.5, "").within(0.0, 1.0).spec();
        assert_eq!(candidates(&closed)[..2], [Value::Float(0.0), Value::Float(1.0)]);
        let open = Param::<f32>::float("x", 0.5, "").above(0.0).soft(0.1, 2.0).spec();
        assert_eq!(candidates(&open)[..2], [Value::Float(0.002), Value::Float(2.0)]);
        let free = Param::<f32>::float("x", 3.0, "").unit(Unit::Metres).spec();
        assert_eq!(candidates(&free)[..2], [Value::Float(-300.0), Value::Float(300.0)]);
    }

    #[test]
    fn integers_stay_in_a_sensible_range() {
        let count = Param::<i64>::int("n", 8, "").within(1.0, 1e6).soft(1.0, 20.0).spec();
        assert_eq!(candidates(&count)[..2], [Value::Int(1), Value::Int(20)]);
        let count = Param::<i64>::int("n", 8, "").at_least(0.0).spec();
        assert_eq!(candidates(&count)[..2], [Value::Int(0), Value::Int(39)]);
    }

    #[test]
    fn range_ends_are_the_last_accepted_and_the_first_refused_values() {
        let specs = [
            Param::<f32>::float("x", 0.5, "").within(0.0, 1.0).spec(),
            Param::<f32>::float("x", 0.5, "").above(0.0).spec(),
            Param::<i64>::int("n", 8, "").within(1.0, 1e6).spec(),
            Param::<[f32; 3]>::vec3("v", [1.0; 3], "").at_least(0.5).spec(),
        ];
        let counts = specs.each_ref().map(|spec| {
            let ends = range_ends(spec);
            for RangeEnd { inside, outside } in &ends {
                assert!(spec.refuses(inside).is_none() && spec.refuses(outside).is_some(), "{inside} {outside}");
            }
            ends.len()
        });
        assert_eq!(counts, [2, 1, 2, 1]);
        let outside = Value::Int(1_000_001);
        assert_eq!(range_ends(&specs[2])[1], RangeEnd { inside: Value::Int(1_000_000), outside });
    }

    #[test]
    fn every_value_is_accepted_by_its_param() {
        let specs = [
            Param::<[f64; 3]>::direction("d", [1.0, 0.0, 0.0], "").spec(),
            Param::<[f32; 3]>::vec3("v", [1.0; 3], "").above(0.0).soft(0.1, 10.0).spec(),
            Param::<i64>::int("n", 3, "").within(2.0, 5.0).spec(),
        ];
        for spec in &specs {
            for k in 0..100 {
                let value = random(spec, Key::new(k));
                assert!(spec.refuses(&value).is_none(), "{value}");
            }
        }
    }
}
