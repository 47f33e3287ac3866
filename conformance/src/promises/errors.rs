//! Promise: for any input a node returns finite numbers or refuses with a message. It never panics, and never returns
//! NaN for finite input, not even for curves of one CV, doubled CVs, coincident points or flat faces. Only coordinates
//! whose squares overflow may give NaN, which the engine then reports.

use engine::error::ErrorKind;

use crate::samples::Form;
use crate::suite::{Findings, sound};
use crate::threads;
use crate::trial::{Outcome, Subject, Trial};

pub(crate) fn check(subject: &Subject, tried: &[(Trial, Outcome)], findings: &mut Findings) {
    for (trial, outcome) in tried {
        check_outcome(outcome, trial.form, findings);
    }
    let frames = subject.frames();
    let extreme = sound(tried, 8).flat_map(|(trial, _)| {
        let of_form = |form| (form, Trial { form, ..trial.clone() });
        // One empty input beside non-empty ones is as common as all of them empty.
        let without = |index| (Form::Empty, Trial { empty: Some(index), ..trial.clone() });
        Form::EXTREMES.into_iter().map(of_form).chain((0..subject.inputs.len()).map(without)).collect::<Vec<_>>()
    });
    let outcomes = threads::map(extreme, |(form, trial)| (form, subject.run(&trial, &frames)));
    for (form, outcome) in outcomes {
        check_outcome(&outcome, form, findings);
    }
}

/// Whether a trial with ordinary geometry failed by the node's fault.
pub(crate) fn is_at_fault(outcome: &Outcome) -> bool {
    let at_fault = |kind: &ErrorKind| matches!(kind, ErrorKind::Panic | ErrorKind::Contract | ErrorKind::NotFinite);
    outcome.errors.iter().any(|(_, kind, _)| at_fault(kind))
}

/// Adds those errors of a trial that are the node's fault for any input.
pub(crate) fn check_outcome(outcome: &Outcome, form: Form, findings: &mut Findings) {
    let given = match form {
        Form::Small | Form::Other => String::new(),
        form => format!(", given {form:?} geometry"),
    };
    for (_, kind, error) in &outcome.errors {
        match kind {
            ErrorKind::Panic => findings.add(format!("it panics{given}: {error}")),
            ErrorKind::Contract => findings.add(format!("it breaks its declaration{given}: {error}")),
            ErrorKind::NotFinite if !form.may_overflow() => {
                findings.add(format!("its result contains NaN{given}: {error}"))
            }
            ErrorKind::Cancelled => findings.add("it reports that it was cancelled, but it was not"),
            ErrorKind::File | ErrorKind::Refused | ErrorKind::NotFinite => {}
        }
    }
}
