//! Promise: every param accepts its whole hard range, ends included, and refuses what lies just outside, by name. That its
//! usual range lies within the hard one is part of the declaration.

use engine::error::ErrorKind;
use engine::param::Value;

use super::{errors, params};
use crate::suite::Findings;
use crate::trial::{Outcome, Subject, Trial};
use crate::values::{RangeEnd, range_ends};

/// Whole numbers above this are not cooked: they may be counts of things to make, or of steps to take.
const MOST_COOKED: i64 = 1_000;

pub(crate) fn check(subject: &Subject, tried: &[(Trial, Outcome)], findings: &mut Findings) {
    let frames = subject.frames();
    for (index, spec) in subject.specs.iter().enumerate() {
        let ends = range_ends(spec);
        if ends.is_empty() {
            continue;
        }
        // What a sample sets is not varied.
        if (0..subject.samples.len()).any(|sample| subject.prepared(sample).contains(&index)) {
            continue;
        }
        // A trial in which the param is read; where there is none, another promise says so.
        let Some((trial, _)) = params::trials(subject, tried, index).next() else { continue };
        for RangeEnd { inside, outside } in ends {
            if let Some((fact, hint)) = spec.refuses(&inside) {
                findings.add(format!("`{}` refuses {inside}, an end of its range: {fact}; {hint}", spec.name));
            }
            // What lies just above an end that is refused itself can be as dear as it is small; a value a little farther
            // inside is among the trials.
            let open = spec.facts.hard.open && outside.number() == spec.facts.hard.low;
            if !open && !is_dear(&inside) {
                errors::check_outcome(&subject.run(&trial.with(index, inside), &frames), trial.form, findings);
            }
            let refused = subject.run(&trial.with(index, outside.clone()), &frames);
            let by_name = |(_, kind, error): &(usize, ErrorKind, String)| {
                *kind == ErrorKind::Refused && error.contains(&format!("`{}`", spec.name))
            };
            if !refused.errors.iter().any(by_name) {
                findings.add(format!("`{}` does not refuse {outside}, which is outside its range", spec.name));
            }
        }
    }
}

fn is_dear(value: &Value) -> bool {
    match value {
        Value::Int(number) => *number > MOST_COOKED,
        Value::Int3(numbers) => numbers.iter().any(|number| *number > MOST_COOKED),
        _ => false,
    }
}
