//! Promise: every param accepts its whole hard range, ends included, and refuses values just outside, by name. The
//! check that its usual range lies within the hard one is part of `declaration`.

use engine::error::ErrorKind;
use engine::param::Value;

use super::{errors, params};
use crate::suite::Findings;
use crate::trial::{Outcome, Subject, Trial};
use crate::values::{RangeEnd, range_ends};

/// Integers above this are not cooked: they may be counts of elements or of steps.
const MOST_COOKED: i64 = 1_000;

pub(crate) fn check(subject: &Subject, tried: &[(Trial, Outcome)], findings: &mut Findings) {
    let frames = subject.frames();
    for (index, spec) in subject.specs.iter().enumerate() {
        let ends = range_ends(spec);
        if ends.is_empty() {
            continue;
        }
        // Params set by a sample are not varied.
        if (0..subject.samples.len()).any(|sample| subject.prepared(sample).contains(&index)) {
            continue;
        }
        // A trial in which the param is read; if there is none, another promise reports it.
        let Some(trial) = params::trials(subject, tried, index).next() else { continue };
        for RangeEnd { inside, outside } in ends {
            if let Some((fact, hint)) = spec.refuses(&inside) {
                findings.add(format!("`{}` refuses {inside}, an end of its range: {fact}; {hint}", spec.name));
            }
            // Just above an excluded end, a value can be very expensive to cook; the trials contain one a little
            // farther inside.
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
