//! Promise: where a node says that it changes nothing, its `cook` would have moved no point by more than rounding.
//!
//! The engine does not call a neutral node, so its `cook` is called here without the declaration. Not checked for nodes
//! with a state: what they return also depends on what they were before.

use std::collections::BTreeMap;

use engine::geometry::{Geometry, P};
use engine::node::{Cook, Node};
use engine::param::{Source, Value};

use crate::suite::Findings;
use crate::trial::{Motion, Outcome, Subject, Trial};

/// The largest difference that counts as rounding, metres; samples are some 0.1 m wide.
const ROUNDING: f32 = 1e-5;

/// Trials that are cooked for each reason.
const TRIALS: usize = 3;

/// Of a number, to find a threshold below which a node is neutral.
const SHARES: [f64; 4] = [0.5, 0.1, 0.01, 1e-3];

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
        if *times <= TRIALS {
            compare([subject, &eager], trial, &left.why, findings);
        }
    }
    // Thresholds: most trials have a default value, or one at an end of its range.
    let is_neutral = |outcome: &Outcome| outcome.left_out.iter().any(|left| left.stage == "all");
    let base = tried.iter().find(|(_, outcome)| outcome.is_whole() && !is_neutral(outcome));
    for trial in base.into_iter().flat_map(|(trial, _)| smaller(subject, trial)) {
        if let Some(left) = subject.left_out(&trial).iter().find(|left| left.stage == "all") {
            compare([subject, &eager], &trial, &left.why, findings);
        }
    }
}

/// The same trial with one number made smaller.
fn smaller<'a>(subject: &'a Subject, trial: &'a Trial) -> impl Iterator<Item = Trial> + 'a {
    let numbers = trial.settings.iter().enumerate().filter_map(|(param, source)| match source {
        Source::Constant(Value::Float(x) | Value::Masked(x, None)) => Some((param, source, *x)),
        _ => None,
    });
    numbers.flat_map(move |(param, source, x)| {
        SHARES.into_iter().filter_map(move |share| {
            let masked = matches!(source, Source::Constant(Value::Masked(..)));
            let value = if masked { Value::Masked(x * share, None) } else { Value::Float(x * share) };
            subject.specs[param].refuses(&value).is_none().then(|| trial.with(param, value))
        })
    })
}

/// Of a node and the same one without `neutral`.
fn compare(nodes: [&Subject; 2], trial: &Trial, why: &str, findings: &mut Findings) {
    let still = Trial { motion: Motion::Still, ..trial.clone() };
    let [passed, cooked] = nodes.map(|subject| subject.run(&still, &subject.frames()));
    let mut frames = passed.found.iter().filter_map(|(at, passed)| Some((passed, cooked.found.get(at)?)));
    if frames.any(|(passed, cooked)| differ(passed, cooked)) {
        findings.add(format!("it is declared neutral ({why}), but its `cook` moves points"));
    }
}

fn differ(a: &Geometry, b: &Geometry) -> bool {
    a.parts().any(|part| {
        let (Some(a), Some(b)) = (part.get(P), b.part(part.kind()).and_then(|part| part.get(P))) else { return false };
        a.as_flattened().iter().zip(b.as_flattened()).any(|(a, b)| (a - b).abs() > ROUNDING)
    })
}
