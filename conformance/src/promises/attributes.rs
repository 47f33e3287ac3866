//! Promise: a node reads the attributes that it declares to read, and no others.
//!
//! `P` counts as read if the result depends on the positions of points, so a node that moves points reads it too.

use engine::geometry::{Kind, Name, P};
use engine::node::AttrNames;

use super::declaration;
use crate::samples;
use crate::suite::{Findings, sound};
use crate::trial::{Outcome, Subject, Trial, masks};

pub(crate) fn check(subject: &Subject, tried: &[(Trial, Outcome)], findings: &mut Findings) {
    check_declared(subject, tried, findings);
    check_positions(subject, tried, findings);
    check_others(subject, tried, findings);
}

/// Removing any one declared attribute changes the result of some trial.
fn check_declared(subject: &Subject, tried: &[(Trial, Outcome)], findings: &mut Findings) {
    let frames = subject.frames();
    for attribute in subject.node.reads.iter().filter(|attribute| attribute.spec().0 != P.name) {
        let name = attribute.spec().0;
        let written = subject.node.writes.iter().any(|write| write.spec().0 == name);
        // An attribute that only passes through is not read: it is compared only if the node writes it.
        let ignore = |other: &str| !written && other == name;
        // Mixtures first: more of them depend on an attribute than trials with a single changed param.
        let mut dressed = tried.iter().rev().filter(|(trial, _)| trial.declared.is_some());
        let matters = dressed.any(|(trial, outcome)| {
            let without = Trial { without: Some(name.to_owned()), ..trial.clone() };
            subject.run(&without, &frames).digest(&ignore) != outcome.digest(&ignore)
        });
        if !matters {
            findings.add_without_effect(&format!("it declares to read the attribute `{name}`, but it"));
        }
    }
}

/// A node that does not declare to read `P` gives the same result for any positions of its inputs' points.
fn check_positions(subject: &Subject, tried: &[(Trial, Outcome)], findings: &mut Findings) {
    let node = subject.node;
    if node.reads.iter().any(|read| read.spec().0 == P.name) {
        return;
    }
    for (trial, outcome) in sound(tried, 12) {
        let [reads, writes] = dynamic(outcome);
        // A volume's seed changes more than points.
        let volume = subject.inputs.iter().any(|input| samples::kinds(input.needs, trial.any).contains(&Kind::Volume));
        if volume || has(&reads, P.name) || masks(&trial.settings).any(|name| **name == *P.name) {
            continue;
        }
        let writes = has(&writes, P.name) || node.writes.iter().any(|write| write.spec().0 == P.name);
        let ignore = |name: &str| !writes && name == P.name;
        for (index, input) in subject.inputs.iter().enumerate() {
            let moved = subject.run(&trial.reseeded(index), &subject.frames());
            if moved.digest(&ignore) != outcome.digest(&ignore) {
                findings.add(format!(
                    "it reads `P`, which it does not declare: the result changes with the points of `{}`",
                    input.name
                ));
            }
        }
    }
}

/// The attributes that the params of a trial make a node read and write.
fn dynamic(outcome: &Outcome) -> [AttrNames; 2] {
    outcome.names.clone().unwrap_or_else(|| [(); 2].map(|()| AttrNames::These(Vec::new())))
}

fn has(names: &AttrNames, name: &str) -> bool {
    match names {
        AttrNames::All => true,
        AttrNames::These(names) => declaration::has(names, name),
    }
}

/// Attributes that a node does not declare to read are changed, and removed: the result stays as it is.
fn check_others(subject: &Subject, tried: &[(Trial, Outcome)], findings: &mut Findings) {
    let frames = subject.frames();
    let node = subject.node;
    for (trial, outcome) in tried.iter().filter(|(trial, _)| trial.others.is_some()).step_by(3) {
        let dynamic: &[Name] = match &outcome.names {
            Some([AttrNames::All, _]) => continue,
            Some([AttrNames::These(names), _]) => names,
            None => &[],
        };
        // Attributes that are named by params have the same seed as the rest, so such a trial is inconclusive.
        if masks(&trial.settings).chain(dynamic).next().is_some() {
            continue;
        }
        let writes = |name: &str| {
            let dynamic = matches!(&outcome.names, Some([_, AttrNames::These(names)]) if declaration::has(names, name));
            dynamic || node.writes.iter().any(|write| write.spec().0 == name)
        };
        let ignore = |name: &str| !writes(name) && node.reads.iter().all(|read| read.spec().0 != name) && name != "P";
        let before = outcome.digest(&ignore);
        let reseeded = Trial { others: trial.others.map(|seed| seed + 1_000), ..trial.clone() };
        let removed = Trial { others: None, ..trial.clone() };
        for (other, what) in [(reseeded, "changed"), (removed, "removed")] {
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

/// The first undeclared attribute whose removal alone changes the result.
fn culprit(subject: &Subject, trial: &Trial, ignore: &dyn Fn(&str) -> bool) -> Option<String> {
    let frames = subject.frames();
    let before = subject.run(trial, &frames).digest(ignore);
    let declared = |name: &str| subject.node.reads.iter().any(|read| read.spec().0 == name);
    let mut names = samples::usual().into_iter().map(|(name, _, _)| name).filter(|name| !declared(name));
    names.find_map(|name| {
        let without = Trial { without: Some(name.clone()), ..trial.clone() };
        (subject.run(&without, &frames).digest(ignore) != before).then(|| format!("`{name}`"))
    })
}
