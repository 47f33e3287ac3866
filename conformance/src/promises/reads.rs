//! What a node reads: every param, input and attribute that it declares matters, and nothing else does.

use numerics::random::Key;

use super::declaration;
use crate::samples::MASK;
use crate::suite::Findings;
use crate::trial::{Outcome, Subject, Trial, masks};
use crate::values;
use engine::geometry::Name;
use engine::node::AttrNames;
use engine::param::{Shape, Source, Unset, Value};

pub(crate) fn check(subject: &Subject, tried: &[(Trial, Outcome)], findings: &mut Findings) {
    for place in 0..subject.specs.len() {
        check_param(subject, tried, place, findings);
    }
    check_inputs(subject, tried, findings);
    check_declared_attributes(subject, tried, findings);
    check_other_attributes(subject, tried, findings);
}

/// Most pairs of trials that are compared for one param.
const PAIRS: usize = 60;

fn check_param(subject: &Subject, tried: &[(Trial, Outcome)], place: usize, findings: &mut Findings) {
    let spec = &subject.specs[place];
    // Which file of a sequence is read is the engine's business.
    if spec.facts.unset == Unset::CurrentFrame {
        return;
    }
    if !tried.iter().any(|(_, outcome)| outcome.read.get(place) == Some(&true)) {
        findings.add(format!("it never reads the param `{}`", spec.name));
        return;
    }
    let values = values(subject, place);
    if !matters(subject, tried, place, &values) {
        findings.add(format!("the param `{}` never changes anything", spec.name));
    }
    if spec.shape == Shape::Masked {
        let [low, high] = [0.35, 0.85].map(|share| between(subject, place, share));
        let pairs = [low, high].map(|x| [Value::Masked(x, None), Value::Masked(x, Some(MASK.into()))]);
        let masked = trials(subject, tried, place).take(PAIRS).any(|(trial, _)| {
            let masked = Trial { others: trial.others.or(Some(5)), ..trial };
            pairs.iter().any(|[plain, masked_by]| {
                let frames = subject.frames();
                let run = |value: &Value| subject.run(&with(&masked, place, value.clone()), &frames).whole();
                run(plain) != run(masked_by)
            })
        });
        if !masked {
            findings.add(format!("the mask of `{}` never changes anything", spec.name));
        }
    }
}

/// A number `share` of the way through what a masked param may be.
fn between(subject: &Subject, place: usize, share: f64) -> f64 {
    let numbers: Vec<f64> = values::candidates(&subject.specs[place]).iter().map(Value::number).collect();
    let (low, high) = numbers.iter().fold((f64::MAX, f64::MIN), |(low, high), x| (low.min(*x), high.max(*x)));
    low + (high - low) * share
}

fn values(subject: &Subject, place: usize) -> Vec<Value> {
    let spec = &subject.specs[place];
    let random = (0..3).map(|k| values::random(spec, Key::new(77).of(k)));
    let mut values: Vec<Value> = Vec::new();
    for value in values::candidates(spec).into_iter().chain(random).chain([spec.default.clone()]) {
        if !values.contains(&value) {
            values.push(value);
        }
    }
    values
}

fn with(trial: &Trial, place: usize, value: Value) -> Trial {
    let mut trial = trial.clone();
    trial.settings[place] = Source::Constant(value);
    trial
}

/// Trials in which the param is read, so far as the declaration says; where none of those at hand is, others are sought.
fn trials<'t>(
    subject: &'t Subject,
    tried: &'t [(Trial, Outcome)],
    place: usize,
) -> impl Iterator<Item = (Trial, Option<&'t Outcome>)> + 't {
    let when = subject.specs[place].facts.when;
    let is_read = move |trial: &Trial| match when {
        None => true,
        Some(when) => subject.params(trial).is_some_and(|params| when(&params)),
    };
    let at_hand = tried.iter().map(|(trial, outcome)| (trial.clone(), Some(outcome)));
    let sought = (0..SOUGHT).map(|k| (crate::suite::mixture(subject, 1_000 + k), None));
    at_hand.chain(sought).filter(move |(trial, _)| is_read(trial))
}

/// How many more mixtures are looked at for one in which a param is read.
const SOUGHT: u64 = 400;

fn matters(subject: &Subject, tried: &[(Trial, Outcome)], place: usize, values: &[Value]) -> bool {
    let frames = subject.frames();
    if (0..subject.samples.len()).any(|sample| subject.prepared(sample).contains(&place)) {
        return prepared_matters(subject, place);
    }
    let mut pairs = 0;
    for (trial, outcome) in trials(subject, tried, place) {
        let before = match outcome {
            Some(outcome) => outcome.whole(),
            None => subject.run(&trial, &frames).whole(),
        };
        for value in values {
            if subject.run(&with(&trial, place, value.clone()), &frames).whole() != before {
                return true;
            }
            pairs += 1;
        }
        if pairs >= PAIRS {
            return false;
        }
    }
    false
}

/// Whether a sample without that param comes out otherwise, or two samples do.
fn prepared_matters(subject: &Subject, place: usize) -> bool {
    let frames = subject.frames();
    let run = |sample: usize| {
        let trial = Trial { sample, ..subject.defaults(1) };
        subject.run(&trial, &frames).whole()
    };
    let without = run(usize::MAX);
    (0..subject.samples.len())
        .filter(|sample| subject.prepared(*sample).contains(&place))
        .any(|sample| run(sample) != without)
}

fn check_inputs(subject: &Subject, tried: &[(Trial, Outcome)], findings: &mut Findings) {
    let frames = subject.frames();
    for (place, input) in subject.inputs.iter().enumerate() {
        let wired = tried.iter().filter(|(trial, _)| !trial.wires[place].is_empty());
        let matters = wired.into_iter().any(|(trial, outcome)| {
            let mut other = trial.clone();
            other.wires[place].iter_mut().for_each(|seed| *seed += 1_000);
            let mut fewer = trial.clone();
            fewer.wires[place].pop();
            let before = outcome.whole();
            let many = matches!(input.arity, engine::node::Arity::Many { .. }) && trial.wires[place].len() > 1;
            subject.run(&other, &frames).whole() != before || many && subject.run(&fewer, &frames).whole() != before
        });
        if !matters {
            findings.add(format!("the input `{}` never changes anything", input.name));
        }
    }
}

fn check_declared_attributes(subject: &Subject, tried: &[(Trial, Outcome)], findings: &mut Findings) {
    let frames = subject.frames();
    for attribute in subject.node.reads.iter().filter(|attribute| attribute.spec().0 != "P") {
        let name = attribute.spec().0;
        let dressed = tried.iter().filter(|(trial, _)| trial.declared.is_some());
        let matters = dressed.into_iter().any(|(trial, outcome)| {
            // What only goes through is no reading: it is left out of the comparison, unless the node writes it.
            let written = subject.node.writes.iter().any(|write| write.spec().0 == name);
            let ignore = |other: &str| !written && subject.node.reads.iter().any(|read| read.spec().0 == other);
            let before = outcome.digest(&ignore);
            let reseeded = Trial { declared: trial.declared.map(|seed| seed + 1_000), ..trial.clone() };
            let removed = Trial { declared: None, ..trial.clone() };
            [reseeded, removed].iter().any(|trial| subject.run(trial, &frames).digest(&ignore) != before)
        });
        if !matters {
            findings.add(format!("it declares to read the attribute `{name}`, which never changes anything"));
        }
    }
}

/// Attributes that a node does not declare to read are changed, and taken away: nothing may change.
fn check_other_attributes(subject: &Subject, tried: &[(Trial, Outcome)], findings: &mut Findings) {
    let frames = subject.frames();
    let node = subject.node;
    for (trial, outcome) in tried.iter().filter(|(trial, _)| trial.others.is_some()).step_by(3) {
        let dynamic: &[Name] = match &outcome.names {
            Some([AttrNames::All, _]) => continue,
            Some([AttrNames::These(names), _]) => names,
            None => &[],
        };
        let writes = |name: &str| match &outcome.names {
            Some([_, AttrNames::These(names)]) => declaration::has(names, name),
            _ => false,
        };
        let writes = |name: &str| node.writes.iter().any(|write| write.spec().0 == name) || writes(name);
        let read: Vec<&Name> = masks(&trial.settings).chain(dynamic).collect();
        // What the params name cannot be told from the rest by a seed: such a trial says nothing.
        if !read.is_empty() {
            continue;
        }
        let ignore = |name: &str| !writes(name) && node.reads.iter().all(|read| read.spec().0 != name) && name != "P";
        let before = outcome.digest(&ignore);
        let reseeded = Trial { others: trial.others.map(|seed| seed + 1_000), ..trial.clone() };
        let removed = Trial { others: None, ..trial.clone() };
        for (other, what) in [(reseeded, "changed"), (removed, "taken away")] {
            let after = subject.run(&other, &frames);
            if after.digest(&ignore) != before {
                let culprit = culprit(subject, trial, &ignore).unwrap_or_else(|| "one of several".into());
                findings.add(format!(
                    "it reads an attribute that it does not declare ({culprit}): the result changes where it is {what}"
                ));
            }
        }
    }
}

/// Which attribute it is that matters: the first that alone changes the result.
fn culprit(subject: &Subject, trial: &Trial, ignore: &dyn Fn(&str) -> bool) -> Option<String> {
    let frames = subject.frames();
    let before = subject.run(trial, &frames).digest(ignore);
    let names = crate::samples::usual().into_iter().map(|(name, _, _)| name);
    names.into_iter().find_map(|name| {
        let without = Trial { without: Some(name.clone()), ..trial.clone() };
        (subject.run(&without, &frames).digest(ignore) != before).then(|| format!("`{name}`"))
    })
}
