//! Promise: bits depend on inputs, params and frame only, not on earlier runs or the number of threads.

use crate::promises::errors;
use crate::samples::Form;
use crate::suite::{Findings, sound};
use crate::trial::{Outcome, Subject, Trial};

pub(crate) fn check(subject: &Subject, tried: &[(Trial, Outcome)], findings: &mut Findings) {
    check_again(subject, tried, findings);
    check_threads(subject, tried, findings);
}

fn check_again(subject: &Subject, tried: &[(Trial, Outcome)], findings: &mut Findings) {
    for (trial, outcome) in tried.iter().step_by(2) {
        if subject.run(trial, &subject.frames()).whole() != outcome.whole() {
            findings.add("it gives different bits on a second run: it keeps state, or reads what it was not given");
        }
    }
}

fn check_threads(subject: &Subject, tried: &[(Trial, Outcome)], findings: &mut Findings) {
    let frames = subject.frames();
    for (number, (trial, _)) in sound(tried, 5).enumerate() {
        let large = Trial { form: Form::Large, ..trial.clone() };
        let one = subject.run(&large, &frames);
        errors::check_outcome(&one, Form::Large, findings);
        let counts = if number == 0 { &[2, 7][..] } else { &[7] };
        for threads in counts.iter().copied() {
            if subject.run_on(threads, false, &large, &frames).whole() != one.whole() {
                findings.add(format!("it gives different bits on {threads} threads and on one"));
            }
        }
    }
}
