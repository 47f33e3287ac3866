//! Knobs: params with the values to compare, coarsest first, and what lies beyond the best.

use std::str::FromStr;

use engine::graph::{Body, Graph};
use engine::node::{Accuracy, Finer};
use engine::param::{Bounds, ParamSpec, Shape, Source, Value as ParamValue};
use serde_json::Value;

use crate::args::Setting;

/// `NODE.PARAM=v1,v2,…` of `--knob`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct KnobArg {
    key: String,
    values: Vec<String>,
}

impl FromStr for KnobArg {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("`{text}` is not a knob; write node.param=VALUE,VALUE,…, from coarse to fine");
        let (key, values) = text.split_once('=').ok_or_else(wrong)?;
        let key = key.trim();
        if key.split_once('.').is_none_or(|(node, param)| node.is_empty() || param.is_empty()) {
            return Err(wrong());
        }
        let values = split_values(values);
        if values.iter().any(|value| value.is_empty()) {
            return Err(wrong());
        }
        match (1..values.len()).find(|index| values[..*index].contains(&values[*index])) {
            Some(twice) => Err(format!("the knob `{key}` has the value {} twice", values[twice])),
            None => Ok(Self { key: key.into(), values }),
        }
    }
}

/// The values between commas that are in no list, object or string.
fn split_values(text: &str) -> Vec<String> {
    let (mut values, mut depth, mut quoted, mut escaped) = (vec![String::new()], 0_usize, false, false);
    for c in text.chars() {
        match c {
            '"' if !escaped => quoted = !quoted,
            '[' | '{' if !quoted => depth += 1,
            ']' | '}' if !quoted => depth = depth.saturating_sub(1),
            _ => {}
        }
        escaped = c == '\\' && !escaped;
        match values.last_mut() {
            Some(last) if c != ',' || quoted || depth > 0 => last.push(c),
            _ => values.push(String::new()),
        }
    }
    values.into_iter().map(|value| value.trim().to_owned()).collect()
}

/// A param with the values to compare.
#[derive(Clone, Debug)]
pub(super) struct Knob {
    /// `node.param`.
    pub(super) key: String,
    pub(super) node: String,
    /// The values as `--set` takes them; the last is the best.
    pub(super) values: Vec<String>,
    spec: Option<ParamSpec>,
    /// What the node declares of it.
    pub(super) accuracy: Option<&'static Accuracy>,
}

impl Knob {
    /// The knob of an argument. Where the node declares in which direction the param becomes more accurate, the values are
    /// sorted by that.
    pub(super) fn new(arg: &KnobArg, graph: &Graph) -> Self {
        let (node, param) = arg.key.split_once('.').unwrap_or((&arg.key, ""));
        let found = graph.nodes.iter().find(|found| *found.id == *node);
        let body = found.map(|found| &found.body);
        let spec = body.and_then(|body| match body {
            Body::Node { specs, .. } => specs.iter().find(|spec| spec.name == param).cloned(),
            Body::Given { .. } => None,
        });
        let declared = found.and_then(|found| found.node()).map_or(&[][..], |declared| declared.accuracy);
        let accuracy = declared.iter().find(|accuracy| accuracy.param == param);
        let mut knob = Self { key: arg.key.clone(), node: node.into(), values: arg.values.clone(), spec, accuracy };
        if let (Some(finer), Some(numbers)) = (accuracy.and_then(|accuracy| accuracy.finer), knob.numbers()) {
            let mut order: Vec<usize> = (0..numbers.len()).collect();
            order.sort_by(|a, b| match finer {
                Finer::Larger => numbers[*a].total_cmp(&numbers[*b]),
                Finer::Smaller => numbers[*b].total_cmp(&numbers[*a]),
            });
            knob.values = order.into_iter().map(|index| knob.values[index].clone()).collect();
        }
        knob
    }

    /// The values as numbers; `None` for words, truth values and vectors.
    pub(super) fn numbers(&self) -> Option<Vec<f64>> {
        self.values.iter().map(|value| value.parse::<f64>().ok().filter(|x| x.is_finite())).collect()
    }

    /// The index of the best value.
    pub(super) fn best(&self) -> usize {
        self.values.len() - 1
    }

    /// The value one beyond the best: the sequence goes on by its step where all steps are equal, else by its last ratio,
    /// within the param's range. `None` for words, for a single value whose direction is unknown, and at the end of the
    /// range.
    pub(super) fn beyond(&self) -> Option<String> {
        let numbers = self.numbers()?;
        let spec = self.spec.as_ref()?;
        let is_whole = matches!(spec.shape, Shape::Int | Shape::Seed);
        if !is_whole && !matches!(spec.shape, Shape::Float | Shape::Masked) {
            return None;
        }
        let next = beyond(&numbers, self.accuracy.and_then(|accuracy| accuracy.finer))?;
        let best = *numbers.last()?;
        let goes_up = next > best;
        let mut next = within(next, &spec.facts.hard);
        if is_whole {
            // Rounding must not lead back to the best.
            next = if next > best { next.ceil() } else { next.floor() };
        }
        (next != best && (next > best) == goes_up && spec.facts.hard.hold(next)).then(|| number_text(next))
    }

    /// The number by which the knob's error falls, the smaller the finer: the number itself, or 1 ÷ the number where the
    /// values ascend.
    pub(super) fn step_of(&self, value: &str) -> Option<f64> {
        let number = value.parse::<f64>().ok().filter(|x| x.is_finite() && *x > 0.0)?;
        let numbers = self.numbers()?;
        Some(if numbers.first() <= numbers.last() { 1.0 / number } else { number })
    }

    /// The other param without whose setting this one is not read, if the graph sets it otherwise: its key and the setting.
    pub(super) fn unmet_need(&self, graph: &Graph) -> Option<(String, String)> {
        let (param, word) = self.accuracy?.needs?;
        let node = graph.nodes.iter().find(|node| *node.id == *self.node)?;
        let Body::Node { specs, params, .. } = &node.body else { return None };
        let place = specs.iter().position(|spec| spec.name == param)?;
        let (Source::Constant(ParamValue::Choice(chosen)), Shape::Choice(options)) =
            (&params[place], specs[place].shape)
        else {
            return None;
        };
        (options[*chosen].word != word).then(|| (format!("{}.{param}", self.node), word.to_owned()))
    }

    /// The setting of another param with which the result is this knob's exact limit.
    pub(super) fn exact(&self) -> Option<(String, String)> {
        let (param, word) = self.accuracy?.exact?;
        Some((format!("{}.{param}", self.node), word.to_owned()))
    }
}

/// The number after the last.
fn beyond(numbers: &[f64], finer: Option<Finer>) -> Option<f64> {
    let [.., before, best] = numbers else {
        let [only] = numbers else { return None };
        return match finer? {
            Finer::Larger => Some(only * 2.0),
            Finer::Smaller => Some(only / 2.0),
        };
    };
    let step = best - before;
    let has_one_sign = numbers.iter().all(|x| *x > 0.0) || numbers.iter().all(|x| *x < 0.0);
    let is_even = |pair: &[f64]| (pair[1] - pair[0] - step).abs() <= 1e-9 * step.abs();
    match has_one_sign && !(numbers.len() > 2 && numbers.windows(2).all(is_even)) {
        true => Some(best * (best / before)),
        false => Some(best + step),
    }
}

/// The number within a range; not moved to an end that is itself refused.
fn within(number: f64, range: &Bounds) -> f64 {
    let low = if range.open { number } else { number.max(range.low) };
    low.min(range.high)
}

/// A number as a graph has it.
pub(super) fn number_text(number: f64) -> String {
    // Ratios such as 1e-3 ÷ 1e-2 have a tail of rounding.
    let rounded: f64 = format!("{number:.12e}").parse().unwrap_or(number);
    if rounded.fract() == 0.0 && rounded.abs() < 1e15 { format!("{rounded:.0}") } else { format!("{rounded:?}") }
}

/// A value as JSON: a word becomes a string.
pub(super) fn to_json(value: &str) -> Value {
    serde_json::from_str(value).unwrap_or_else(|_| Value::from(value))
}

/// The settings as an argument of `--set` each.
pub(super) fn settings(pairs: &[(String, String)]) -> Vec<Setting> {
    pairs.iter().map(|(key, value)| Setting(key.clone(), value.clone())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_split_at_commas_outside_of_lists_and_strings() {
        let knob: KnobArg = r#"a.b=1, 2,[1,2,3],"x,y",word"#.parse().unwrap();
        assert_eq!(
            (&*knob.key, &*knob.values),
            ("a.b", &["1", "2", "[1,2,3]", "\"x,y\"", "word"].map(String::from)[..])
        );
        for wrong in ["a", "a.b=", "a=1,2", "a.b=1,,2", "a.b=1,1"] {
            assert!(wrong.parse::<KnobArg>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn the_sequence_goes_on_by_its_step_or_its_ratio() {
        let cases: [(&[f64], Option<f64>); 6] = [
            (&[8.0, 16.0, 32.0], Some(64.0)),
            (&[2.0, 3.0, 4.0], Some(5.0)),
            (&[4.0, 2.0], Some(1.0)),
            (&[-1.0, 0.0], Some(1.0)),
            (&[0.4, 0.2, 0.15], Some(0.15 * (0.15 / 0.2))),
            (&[3.0], None),
        ];
        for (numbers, next) in cases {
            assert_eq!(beyond(numbers, None), next, "{numbers:?}");
        }
        assert_eq!(beyond(&[3.0], Some(Finer::Smaller)), Some(1.5));
        assert_eq!([1e-2 * 1e-2 / 1e-1, 64.0, 1e-5].map(number_text), ["0.001", "64", "1e-5"]);
    }
}
