//! Promise: whatever a node is given, it returns finite numbers or refuses with a message. It never panics, and never
//! makes NaN of sound numbers: not of curves of one CV, doubled CVs, coincident points or flat faces either. Only
//! coordinates whose squares overflow excuse NaN, which the engine then reports.

use engine::error::ErrorKind;

use crate::samples::Form;
use crate::suite::{Findings, sound};
use crate::trial::{Outcome, Subject, Trial};

pub(crate) fn check(subject: &Subject, tried: &[(Trial, Outcome)], findings: &mut Findings) {
    for (trial, outcome) in tried {
        check_outcome(outcome, trial.form, findings);
    }
    let frames = subject.frames();
    for (trial, _) in sound(tried, 8) {
        for form in Form::EXTREMES {
            let trial = Trial { form, ..trial.clone() };
            check_outcome(&subject.run(&trial, &frames), form, findings);
        }
        // One empty input beside others that have rows is as common as all of them empty.
        for index in 0..subject.inputs.len() {
            let trial = Trial { empty: Some(index), ..trial.clone() };
            check_outcome(&subject.run(&trial, &frames), Form::Empty, findings);
        }
    }
}

/// Adds the errors of one trial that are the node's own fault, whatever it was given.
pub(crate) fn check_outcome(outcome: &Outcome, form: Form, findings: &mut Findings) {
    let given = match form {
        Form::Small | Form::Other => String::new(),
        form => format!(", given {form:?} geometry"),
    };
    for (_, kind, error) in &outcome.errors {
        match kind {
            ErrorKind::Panic => findings.add(format!("it panics{given}: {error}")),
            ErrorKind::Contract => findings.add(format!("it breaks its declaration{given}: {error}")),
            ErrorKind::NotFinite if !form.may_overflow() => findings.add(format!("it lets NaN out{given}: {error}")),
            ErrorKind::Cancelled => findings.add("it reports that it was cancelled, and nobody cancelled it"),
            ErrorKind::File | ErrorKind::Refused | ErrorKind::NotFinite => {}
        }
    }
}
