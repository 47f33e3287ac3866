//! Promise: the bits of a frame do not depend on which other frames are cooked, nor on the clock if the node says that
//! it does not read it, nor on the frame number if a window's inputs do not change.

use engine::node::Cook;
use engine::param::Source;
use engine::time::Frame;

use crate::suite::{Findings, sound};
use crate::trial::{Motion, Outcome, Subject, Trial};

pub(crate) fn check(subject: &Subject, tried: &[(Trial, Outcome)], findings: &mut Findings) {
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
        Cook::Solver(..) => check_alone(subject, tried, findings),
    }
}

/// Compares each frame cooked alone, last first, with all of them cooked together.
fn check_alone(subject: &Subject, tried: &[(Trial, Outcome)], findings: &mut Findings) {
    let frames = subject.frames();
    for (trial, outcome) in sound(tried, 6) {
        for frame in frames.iter().rev() {
            let alone = subject.run(trial, &[*frame]);
            if alone.at(*frame) != outcome.at(*frame) {
                findings.add(format!("frame {frame} has different bits when it is cooked alone"));
            }
        }
    }
}

/// Cooks a node that says it does not read the clock at two times.
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
            findings.add("it says that it does not read the clock, but gives different bits at another frame");
        }
    }
}

/// Cooks a window over constant inputs that the engine does not know to be constant.
fn check_still(subject: &Subject, tried: &[(Trial, Outcome)], findings: &mut Findings) {
    for (trial, _) in sound(tried, 6) {
        let still = Trial { motion: Motion::Unknown, ..trial.clone() };
        let frames = [1, 2, 9, 30].map(Frame::whole);
        let outcome = subject.run(&still, &frames);
        if frames.iter().any(|frame| outcome.at(*frame) != outcome.at(frames[0])) {
            findings.add("its result changes while its inputs do not; the engine relies on it staying the same");
        }
    }
}
