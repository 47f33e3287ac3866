//! Promise: what is saved of a state is all of it, with the inputs at its frame. Saving and loading the state after every step changes no bit.

use engine::node::Cook;

use crate::suite::{Findings, sound};
use crate::trial::{Outcome, Subject, Trial};

pub(crate) fn check(subject: &Subject, tried: &[(Trial, Outcome)], findings: &mut Findings) {
    if !matches!(subject.node.cook, Cook::Window(..) | Cook::Solver(..)) {
        return;
    }
    for (trial, outcome) in sound(tried, 6) {
        let reloaded = subject.run_on(1, true, trial, &subject.frames());
        if reloaded.whole() != outcome.whole() {
            let error = reloaded.errors.first().map(|(_, _, error)| format!(": {error}")).unwrap_or_default();
            findings.add(format!("its state loses something when it is written to a checkpoint and read back{error}"));
        }
    }
}
