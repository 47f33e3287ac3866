//! The suite: cooks trials of a node and checks every promise on their outcomes.

use std::sync::Arc;

use numerics::random::Key;

use crate::bench::Bench;
use crate::promises::{
    attributes, checkpoints, declaration, determinism, errors, frames, inputs, left_out, neutral, outputs, params,
    pass_through, ranges,
};
use crate::samples::Form;
use crate::trial::{Motion, Outcome, Prepare, Subject, Trial};
use crate::{threads, values};
use engine::error::ErrorKind;
use engine::node::{Arity, Needs, Node};
use engine::param::{Source, Unset};

/// Checks all promises of a node, and fails with everything that was found.
///
/// # Panics
/// If the node does not conform.
pub fn conforms(node: &'static Node) {
    conformance(node).run();
}

/// Everything that is wrong with a node, one finding per line; empty if it conforms.
pub fn faults(node: &'static Node) -> Vec<String> {
    conformance(node).faults()
}

/// The suite for a node that needs values that the suite cannot invent; see [`Conformance::with`].
pub fn conformance(node: &'static Node) -> Conformance {
    Conformance { node, samples: Vec::new() }
}

/// A node under test, and its prepared samples.
pub struct Conformance {
    node: &'static Node,
    samples: Vec<Prepare>,
}

impl Conformance {
    /// Adds a sample: `prepare` sets values on the bench, such as a file or code. Trials alternate between several
    /// samples. The params that a sample sets are not varied.
    #[must_use]
    pub fn with(mut self, prepare: impl Fn(Bench) -> Bench + Send + Sync + 'static) -> Self {
        self.samples.push(Arc::new(prepare));
        self
    }

    /// Checks all promises, and fails with everything that was found.
    ///
    /// # Panics
    /// If the node does not conform.
    pub fn run(self) {
        let name = self.node.name;
        let faults = self.faults();
        assert!(faults.is_empty(), "{name} does not conform:\n  {}", faults.join("\n  "));
    }

    /// Everything that is wrong with the node, one finding per line.
    pub fn faults(self) -> Vec<String> {
        let mut findings = Findings::default();
        if !declaration::check(self.node, &mut findings) {
            return findings.list;
        }
        let subject = Subject::new(self.node, self.samples);
        let tried = try_all(&subject);
        tried.iter().for_each(|(trial, outcome)| subject.remember(trial, outcome));
        findings.effects_are_hidden = tried.iter().any(|(_, outcome)| errors::is_at_fault(outcome));
        errors::check(&subject, &tried, &mut findings);
        outputs::check(&subject, &tried, &mut findings);
        pass_through::check(&subject, &tried, &mut findings);
        if !tried.iter().any(|(_, outcome)| outcome.is_whole()) {
            let first = tried.first().and_then(|(_, outcome)| outcome.errors.first());
            if let Some((_, ErrorKind::Refused | ErrorKind::File, error)) = first {
                let fact = "it refuses all samples of the suite; provide suitable ones with `with`";
                findings.add(format!("{fact}: {error}"));
            }
            return findings.list;
        }
        let of_checks = threads::map(CHECKS, |check| {
            let mut findings = Findings { list: Vec::new(), ..findings };
            check(&subject, &tried, &mut findings);
            findings.list
        });
        of_checks.into_iter().flatten().for_each(|finding| findings.add(finding));
        findings.list
    }
}

/// Checks a promise on trials and their outcomes.
type Check = fn(&Subject, &[(Trial, Outcome)], &mut Findings);

/// The checks that compare whole results, those that take longest first.
const CHECKS: [Check; 9] = [
    attributes::check,
    determinism::check,
    params::check,
    ranges::check,
    left_out::check,
    inputs::check,
    frames::check,
    checkpoints::check,
    neutral::check,
];

/// Findings, each once.
#[derive(Default)]
pub(crate) struct Findings {
    list: Vec<String>,
    /// Whether ordinary trials fail by the node's own fault, so that what they would return cannot be compared.
    effects_are_hidden: bool,
}

impl Findings {
    pub(crate) fn add(&mut self, finding: impl Into<String>) {
        let finding = finding.into();
        if !self.list.contains(&finding) {
            self.list.push(finding);
        }
    }

    /// Adds that something, such as a param, has no effect; it is told once the node's own failures are mended.
    pub(crate) fn add_without_effect(&mut self, what: &str) {
        if !self.effects_are_hidden {
            self.add(format!("{what} never affects the result"));
        }
    }
}

/// At most about `most` trials without errors, spread over all, defaults first.
pub(crate) fn sound(tried: &[(Trial, Outcome)], most: usize) -> impl Iterator<Item = &(Trial, Outcome)> {
    let whole: Vec<_> = tried.iter().filter(|(_, outcome)| outcome.is_whole()).collect();
    let step = whole.len().div_ceil(most).max(1);
    whole.into_iter().step_by(step)
}

/// Trials with random params.
const MIXTURES: u64 = 32;

/// All trials, cooked: defaults with several inputs, each param at each of its values, mixtures.
fn try_all(subject: &Subject) -> Vec<(Trial, Outcome)> {
    let frames = subject.frames();
    let trials = defaults(subject).into_iter().chain(singles(subject)).chain(mixtures(subject));
    threads::map(trials, |trial| {
        let outcome = subject.run(&trial, &frames);
        (trial, outcome)
    })
}

/// Default params: with attributes and without, with optional inputs and without, lists of 0, 1 and 2 wires, and two
/// forms.
fn defaults(subject: &Subject) -> Vec<Trial> {
    let full = subject.defaults(2);
    let mut bare = Trial { declared: None, others: None, ..subject.defaults(0) };
    for (wires, input) in bare.wires.iter_mut().zip(&subject.inputs) {
        if input.arity == Arity::Optional {
            wires.clear();
        }
    }
    let mut trials = vec![
        full.clone(),
        Trial { others: None, ..subject.defaults(1) },
        Trial { form: Form::Other, declared: None, ..full.clone() },
        bare,
    ];
    trials.extend((1..6).filter(|_| takes_any(subject)).map(|any| Trial { any, ..full.clone() }));
    trials.extend((1..subject.samples.len()).map(|sample| Trial { sample, ..full.clone() }));
    trials
}

fn takes_any(subject: &Subject) -> bool {
    subject.inputs.iter().any(|input| input.needs == Needs::Any)
}

/// Each param at each of its candidate values, all others at their defaults.
fn singles(subject: &Subject) -> Vec<Trial> {
    let full = subject.defaults(2);
    let mut trials = Vec::new();
    for (place, spec) in subject.specs.iter().enumerate() {
        for value in values::candidates(spec) {
            let mut trial = full.clone();
            trial.settings[place] = Source::Constant(value);
            trials.push(trial);
        }
    }
    trials
}

/// All params random.
fn mixtures(subject: &Subject) -> Vec<Trial> {
    (0..MIXTURES).map(|k| mixture(subject, k)).collect()
}

pub(crate) fn mixture(subject: &Subject, k: u64) -> Trial {
    let at = Key::new(0x00c0_4fec).of(k);
    let mut trial = subject.defaults(k as usize % 3);
    for (place, spec) in subject.specs.iter().enumerate() {
        if spec.facts.unset == Unset::Default {
            trial.settings[place] = Source::Constant(values::random(spec, at.of(place as u64)));
        }
    }
    for (place, (wires, input)) in trial.wires.iter_mut().zip(&subject.inputs).enumerate() {
        if input.arity == Arity::Optional && at.of(500 + place as u64).f32() < 0.3 {
            wires.clear();
        }
    }
    trial.sample = k as usize % subject.samples.len().max(1);
    trial.declared = (k % 4 != 3).then_some(k);
    trial.others = (k % 3 != 2).then_some(k);
    trial.form = if k % 5 == 4 { Form::Other } else { Form::Small };
    trial.any = if k.is_multiple_of(2) { 0 } else { k as usize / 2 };
    if subject.is_timed() && k % 3 == 1 {
        trial.motion = Motion::Still;
    }
    trial
}
