//! Promise: where a node says that it changes nothing, its `cook` would have moved no point by more than rounding.
//!
//! The engine does not call a neutral node, so its `cook` is called here without the declaration. Not checked for nodes
//! with a state: what they return also depends on what they were before.

use std::collections::BTreeMap;

use engine::geometry::{Geometry, P};
use engine::node::{Cook, Node};

use crate::suite::Findings;
use crate::trial::{Motion, Outcome, Subject, Trial};

/// The largest difference that counts as rounding, metres; samples are some 0.1 m wide.
const ROUNDING: f32 = 1e-5;

/// Trials that are cooked for each reason.
const TRIALS: usize = 3;

pub(crate) fn check(subject: &Subject, tried: &[(Trial, Outcome)], findings: &mut Findings) {
    let node = subject.node;
    if node.neutral.is_none() || !matches!(node.cook, Cook::Pure(_) | Cook::Frame { .. }) {
        return;
    }
    // A subject lives as long as the program; there is one for each node under test.
    let without: &'static Node = Box::leak(Box::new(Node { neutral: None, ..*node }));
    let eager = Subject::new(without, subject.samples.clone());
    let mut seen: BTreeMap<&str, usize> = BTreeMap::new();
    for (trial, outcome) in tried.iter().filter(|(_, outcome)| outcome.is_whole()) {
        let Some(left) = outcome.left_out.iter().find(|left| left.stage == "all") else { continue };
        let times = seen.entry(&left.why).or_default();
        *times += 1;
        if *times > TRIALS {
            continue;
        }
        let still = Trial { motion: Motion::Still, ..trial.clone() };
        let [passed, cooked] = [subject, &eager].map(|subject| subject.run(&still, &subject.frames()));
        let mut frames = passed.found.iter().filter_map(|(at, passed)| Some((passed, cooked.found.get(at)?)));
        if frames.any(|(passed, cooked)| differ(passed, cooked)) {
            findings.add(format!("it is declared neutral ({}), but its `cook` moves points", left.why));
        }
    }
}

fn differ(a: &Geometry, b: &Geometry) -> bool {
    a.parts().any(|part| {
        let (Some(a), Some(b)) = (part.get(P), b.part(part.kind()).and_then(|part| part.get(P))) else { return false };
        a.as_flattened().iter().zip(b.as_flattened()).any(|(a, b)| (a - b).abs() > ROUNDING)
    })
}
