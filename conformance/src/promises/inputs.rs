//! Promise: every input changes the result.

use engine::node::Arity;

use crate::suite::Findings;
use crate::trial::{Outcome, Subject, Trial};

pub(crate) fn check(subject: &Subject, tried: &[(Trial, Outcome)], findings: &mut Findings) {
    for (index, input) in subject.inputs.iter().enumerate() {
        let mut wired = tried.iter().filter(|(trial, _)| !trial.wires[index].is_empty());
        let matters = wired.any(|(trial, _)| {
            let before = subject.hash(trial);
            let mut fewer = trial.clone();
            fewer.wires[index].pop();
            let many = matches!(input.arity, Arity::Many { .. }) && trial.wires[index].len() > 1;
            subject.hash(&trial.reseeded(index)) != before || many && subject.hash(&fewer) != before
        });
        if !matters {
            findings.add_without_effect(&format!("the input `{}`", input.name));
        }
    }
}
