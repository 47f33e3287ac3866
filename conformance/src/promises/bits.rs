//! That bits hang on what a node was given and nothing else: not on threads, other frames, the clock, or how often it ran.

use super::passes::check_errors;
use crate::samples::Form;
use crate::suite::Findings;
use crate::trial::{Motion, Outcome, Subject, Trial};
use engine::node::Cook;
use engine::param::Source;
use engine::time::Frame;

pub(crate) fn check(subject: &Subject, tried: &[(Trial, Outcome)], findings: &mut Findings) {
    check_again(subject, tried, findings);
    check_threads(subject, tried, findings);
    check_extremes(subject, tried, findings);
    match subject.node.cook {
        Cook::Pure(_) => {}
        Cook::Frame { .. } => {
            check_alone(subject, tried, findings);
            check_clock(subject, tried, findings);
        }
        Cook::Window(..) => {
            check_alone(subject, tried, findings);
            check_still(subject, tried, findings);
        }
        Cook::Solver(..) => {
            check_alone(subject, tried, findings);
            check_reload(subject, tried, findings);
        }
    }
}

/// A few trials that came out whole: defaults first.
fn sound(tried: &[(Trial, Outcome)], most: usize) -> impl Iterator<Item = &(Trial, Outcome)> {
    let whole: Vec<_> = tried.iter().filter(|(_, outcome)| outcome.is_whole()).collect();
    let step = whole.len().div_ceil(most).max(1);
    whole.into_iter().step_by(step)
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
        check_errors(&one, Form::Large, findings);
        for threads in [2, 7] {
            if subject.run_on(threads, false, &large, &frames).whole() != one.whole() {
                findings.add(format!("it gives other bits on {threads} threads than on one"));
            }
        }
    }
}

fn check_extremes(subject: &Subject, tried: &[(Trial, Outcome)], findings: &mut Findings) {
    let frames = subject.frames();
    for (trial, _) in sound(tried, 8) {
        for form in Form::EXTREMES {
            let trial = Trial { form, ..trial.clone() };
            check_errors(&subject.run(&trial, &frames), form, findings);
        }
        // One input without a row while the others have theirs is no rarer than all of them.
        for place in 0..subject.inputs.len() {
            let trial = Trial { empty: Some(place), ..trial.clone() };
            check_errors(&subject.run(&trial, &frames), Form::Empty, findings);
        }
    }
}

/// Each frame alone, last first, against all of them together.
fn check_alone(subject: &Subject, tried: &[(Trial, Outcome)], findings: &mut Findings) {
    let frames = subject.frames();
    for (trial, outcome) in sound(tried, 6) {
        for frame in frames.iter().rev() {
            let alone = subject.run(trial, &[*frame]);
            if alone.at(*frame) != outcome.at(*frame) {
                findings.add(format!("frame {frame} alone has other bits than among others"));
            }
        }
    }
}

/// A node that says it does not look at the clock, at two times.
fn check_clock(subject: &Subject, tried: &[(Trial, Outcome)], findings: &mut Findings) {
    let Cook::Frame { reads_clock, .. } = subject.node.cook else { return };
    for (trial, _) in tried {
        let constant = trial.settings.iter().all(|source| matches!(source, Source::Constant(_)));
        let params = subject.params(trial).filter(|params| constant && !reads_clock(params));
        if params.is_none() {
            continue;
        }
        let at = |first: i64| {
            let trial = Trial { motion: Motion::Still, first, ..trial.clone() };
            subject.run(&trial, &[Frame::whole(first)]).at(Frame::whole(first))
        };
        if at(1) != at(10) {
            findings.add("it says that it does not read the clock, and gives other bits at another frame");
        }
    }
}

/// A window over inputs that stand still, though the engine does not know.
fn check_still(subject: &Subject, tried: &[(Trial, Outcome)], findings: &mut Findings) {
    for (trial, _) in sound(tried, 6) {
        let still = Trial { motion: Motion::Unknown, ..trial.clone() };
        let frames = [1, 2, 9, 30].map(Frame::whole);
        let outcome = subject.run(&still, &frames);
        if frames.iter().any(|frame| outcome.at(*frame) != outcome.at(frames[0])) {
            findings.add("over inputs that stand still it does not stand still, as the engine takes it to");
        }
    }
}

fn check_reload(subject: &Subject, tried: &[(Trial, Outcome)], findings: &mut Findings) {
    for (trial, outcome) in sound(tried, 6) {
        let reloaded = subject.run_on(1, true, trial, &subject.frames());
        if reloaded.whole() != outcome.whole() {
            let said = reloaded.errors.first().map(|(_, _, error)| format!(": {error}")).unwrap_or_default();
            findings.add(format!("its state loses something when it is written to a checkpoint and read back{said}"));
        }
    }
}
