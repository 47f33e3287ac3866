//! Promise: every param is read and changes the result, and so does every mask.

use engine::param::{Shape, Unset, Value};
use numerics::random::Key;

use crate::samples::MASK;
use crate::suite::{self, Findings};
use crate::trial::{Outcome, Subject, Trial};
use crate::values;

pub(crate) fn check(subject: &Subject, tried: &[(Trial, Outcome)], findings: &mut Findings) {
    for index in 0..subject.specs.len() {
        check_param(subject, tried, index, findings);
    }
}

/// Largest number of pairs of trials that are compared for one param.
const PAIRS: usize = 60;

fn check_param(subject: &Subject, tried: &[(Trial, Outcome)], index: usize, findings: &mut Findings) {
    let spec = &subject.specs[index];
    // The engine uses it to choose the file of a sequence.
    if matches!(spec.facts.unset, Unset::CurrentFrame | Unset::CurrentTime) {
        return;
    }
    if !tried.iter().any(|(_, outcome)| outcome.read.get(index) == Some(&true)) {
        findings.add(format!("it never reads the param `{}`", spec.name));
        return;
    }
    let values = values(subject, index);
    if !matters(subject, tried, index, &values) {
        findings.add_without_effect(&format!("the param `{}`", spec.name));
    }
    if spec.shape == Shape::Masked {
        let [low, high] = [0.35, 0.85].map(|share| between(subject, index, share));
        let pairs = [low, high].map(|x| [Value::Masked(x, None), Value::Masked(x, Some(MASK.into()))]);
        let masked = trials(subject, tried, index).take(PAIRS).any(|trial| {
            let masked = Trial { others: trial.others.or(Some(5)), ..trial };
            pairs.iter().any(|[plain, masked_by]| {
                let hash = |value: &Value| subject.hash(&masked.with(index, value.clone()));
                hash(plain) != hash(masked_by)
            })
        });
        if !masked {
            findings.add_without_effect(&format!("the mask of `{}`", spec.name));
        }
    }
}

/// The number at `share` (0…1) of the range of a masked param.
fn between(subject: &Subject, index: usize, share: f64) -> f64 {
    let numbers: Vec<f64> = values::candidates(&subject.specs[index]).iter().map(Value::number).collect();
    let (low, high) = numbers.iter().fold((f64::MAX, f64::MIN), |(low, high), x| (low.min(*x), high.max(*x)));
    low + (high - low) * share
}

pub(crate) fn values(subject: &Subject, index: usize) -> Vec<Value> {
    let spec = &subject.specs[index];
    let random = (0..3).map(|k| values::random(spec, Key::new(77).of(k)));
    let mut values: Vec<Value> = Vec::new();
    for value in values::candidates(spec).into_iter().chain(random).chain([spec.default.clone()]) {
        if !values.contains(&value) {
            values.push(value);
        }
    }
    values
}

/// Number of additional mixtures that are searched for one in which a param is read.
const SOUGHT: u64 = 400;

/// Trials in which the param is read according to the declaration: those already cooked, then more mixtures.
pub(crate) fn trials<'t>(
    subject: &'t Subject,
    tried: &'t [(Trial, Outcome)],
    index: usize,
) -> impl Iterator<Item = Trial> + 't {
    let when = subject.specs[index].facts.when;
    let is_read = move |trial: &Trial| match when {
        None => true,
        Some(when) => subject.params(trial).is_some_and(|params| when(&params)),
    };
    let at_hand = tried.iter().map(|(trial, _)| trial.clone());
    let sought = (0..SOUGHT).map(|k| suite::mixture(subject, 1_000 + k));
    at_hand.chain(sought).filter(is_read)
}

fn matters(subject: &Subject, tried: &[(Trial, Outcome)], index: usize, values: &[Value]) -> bool {
    if (0..subject.samples.len()).any(|sample| subject.prepared(sample).contains(&index)) {
        return prepared_matters(subject, index);
    }
    let mut pairs = 0;
    for trial in trials(subject, tried, index) {
        let before = subject.hash(&trial);
        for value in values {
            if subject.hash(&trial.with(index, value.clone())) != before {
                return true;
            }
            pairs += 1;
        }
        if pairs >= PAIRS {
            return false;
        }
    }
    false
}

/// Whether a sample without that param gives another result, or two samples give different results.
fn prepared_matters(subject: &Subject, index: usize) -> bool {
    let hash = |sample: usize| subject.hash(&Trial { sample, ..subject.defaults(1) });
    let without = hash(usize::MAX);
    (0..subject.samples.len())
        .filter(|sample| subject.prepared(*sample).contains(&index))
        .any(|sample| hash(sample) != without)
}
