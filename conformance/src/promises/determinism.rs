//! Promise: bits depend on what the node is given and on nothing else: neither on how often it ran before, nor on the
//! number of threads.

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
            findings.add("it gives other bits on a second run: it remembers something, or reads what it was not given");
        }
    }
}

fn check_threads(subject: &Subject, tried: &[(Trial, Outcome)], findings: &mut Findings) {
    let frames = subject.frames();
    for (trial, _) in sound(tried, 5) {
        let large = Trial { form: Form::Large, ..trial.clone() };
        let one = subject.run(&large, &frames);
        errors::check_outcome(&one, Form::Large, findings);
        for threads in [2, 7] {
            if subject.run_on(threads, false, &large, &frames).whole() != one.whole() {
                findings.add(format!("it gives other bits on {threads} threads than on one"));
            }
        }
    }
}
