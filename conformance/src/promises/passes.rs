//! What came out of the trials: panics, kinds, metrics, and that all a node does not own went through untouched.

use std::collections::{BTreeMap, BTreeSet};

use super::declaration;
use crate::samples::Form;
use crate::suite::Findings;
use crate::trial::{Motion, Outcome, Subject, Trial};
use engine::error::ErrorKind;
use engine::geometry::{Component, Geometry, Kind, Owner, P, Volume};
use engine::node::{Arity, AttrNames, Carries, Needs, Output};

pub(crate) fn check(subject: &Subject, tried: &[(Trial, Outcome)], findings: &mut Findings) {
    for (trial, outcome) in tried {
        check_errors(outcome, trial.form, findings);
        for ((place, _), geometry) in &outcome.found {
            let output = subject.node.outputs[*place];
            check_kinds(subject, outcome, output, geometry, findings);
            check_owned(subject, (trial, outcome), output, geometry, findings);
        }
        for (name, values) in &outcome.metrics {
            if values.values().any(|value| !value.is_finite()) {
                findings.add(format!("the metric `{name}` is NaN or infinite"));
            }
        }
    }
    for metric in subject.node.metrics {
        if !tried.iter().any(|(_, outcome)| outcome.metrics.contains_key(metric.name)) {
            findings.add(format!("it never publishes the metric `{}`", metric.name));
        }
    }
    check_left_out(subject, tried, findings);
}

/// Errors that are the node's own fault, whatever it was given.
pub(crate) fn check_errors(outcome: &Outcome, form: Form, findings: &mut Findings) {
    for (_, kind, error) in &outcome.errors {
        let with = if form == Form::Small || form == Form::Other {
            String::new()
        } else {
            format!(", given {form:?} geometry")
        };
        match kind {
            ErrorKind::Panic => findings.add(format!("it panics{with}: {error}")),
            ErrorKind::Contract => findings.add(format!("it breaks its declaration{with}: {error}")),
            ErrorKind::NotFinite if with.is_empty() => findings.add(format!("it lets NaN out{with}: {error}")),
            ErrorKind::Cancelled => findings.add("it says it was cancelled, and nobody did"),
            ErrorKind::File | ErrorKind::Refused | ErrorKind::NotFinite => {}
        }
    }
}

fn check_kinds(subject: &Subject, outcome: &Outcome, output: &Output, geometry: &Geometry, findings: &mut Findings) {
    let wires = |name: &str| {
        let place = subject.inputs.iter().position(|input| input.name == name);
        place.map_or(&[][..], |place| &outcome.given[place])
    };
    let expected: BTreeSet<Kind> = match output.carries {
        Carries::Kinds(kinds) => kinds.iter().copied().collect(),
        Carries::Like(input) | Carries::Union(input) => wires(input).iter().flat_map(Geometry::kinds).collect(),
    };
    let found: BTreeSet<Kind> = geometry.kinds().collect();
    if found != expected {
        let names = |kinds: &BTreeSet<Kind>| kinds.iter().map(|kind| kind.name()).collect::<Vec<_>>().join(", ");
        let (name, found, expected) = (output.name, names(&found), names(&expected));
        findings.add(format!("its output `{name}` carries {found}, expected {expected}"));
    }
}

/// What a component that goes through comes from: the input an output is like, else the first single input of its kind.
fn source<'o>(subject: &Subject, outcome: &'o Outcome, output: &Output, kind: Kind) -> Option<&'o Geometry> {
    let place = match output.carries {
        Carries::Like(name) => subject.inputs.iter().position(|input| input.name == name)?,
        Carries::Kinds(_) => subject.inputs.iter().position(|input| {
            input.arity == Arity::One && (input.needs == Needs::Kind(kind) || input.needs == Needs::Any)
        })?,
        Carries::Union(_) => return None,
    };
    outcome.given[place].first()
}

fn check_owned(
    subject: &Subject,
    (trial, outcome): (&Trial, &Outcome),
    output: &Output,
    geometry: &Geometry,
    findings: &mut Findings,
) {
    let node = subject.node;
    let moving = trial.motion == Motion::Moving;
    let more = match &outcome.names {
        Some([_, AttrNames::All]) => return,
        Some([_, AttrNames::These(names)]) => names.as_slice(),
        None => &[],
    };
    // Inputs that move have other positions at every frame; the others show whether they are left alone.
    let writes = |name: &str| {
        let declared = node.writes.iter().any(|attribute| attribute.spec().0 == name);
        declared || declaration::has(more, name) || moving && name == P.name
    };
    for part in geometry.parts() {
        let kind = part.kind();
        let given = source(subject, outcome, output, kind).and_then(|given| given.part(kind));
        if let Some(given) = given.filter(|_| !node.changes_topology) {
            check_part(part, given, &writes, findings);
        }
        let anywhere = |owner: Owner, name: &str| {
            let parts = outcome.given.iter().flatten().flat_map(Geometry::parts);
            parts.into_iter().any(|given| given.table(owner).column(name).is_some())
        };
        for (owner, name, _) in part.columns() {
            let new_points = **name == *P.name && given.is_none();
            if !new_points && !writes(name) && !anywhere(owner, name) {
                findings
                    .add(format!("it adds the attribute `{name}` to the {kind}, which it does not declare to write"));
            }
        }
    }
    if let (Some(volume), Some(given)) =
        (geometry.volume(), source(subject, outcome, output, Kind::Volume).and_then(Geometry::volume))
    {
        check_volume(volume, given, &writes, findings);
    }
}

fn check_part(part: &Component, given: &Component, writes: &dyn Fn(&str) -> bool, findings: &mut Findings) {
    let kind = part.kind();
    if part.topology() != given.topology() {
        findings.add(format!("it changes the topology of the {kind}; declare `changes_topology`"));
        return;
    }
    if !part.topology().same(given.topology()) {
        findings.add(format!("it copies the topology of the {kind}, which it could share"));
    }
    for (owner, name, column) in given.columns().filter(|(_, name, _)| !writes(name)) {
        match part.table(owner).column(name) {
            None => findings
                .add(format!("it drops the attribute `{name}` of the {kind}, which it does not declare to write")),
            Some(found) if found.same(column) => {}
            Some(found) if found == column => {
                findings.add(format!("it copies the attribute `{name}` of the {kind}, which it could share"));
            }
            Some(_) => {
                findings.add(format!(
                    "it changes the attribute `{name}` of the {kind}, which it does not declare to write"
                ));
            }
        }
    }
}

fn check_volume(volume: &Volume, given: &Volume, writes: &dyn Fn(&str) -> bool, findings: &mut Findings) {
    for (name, column) in given.once().iter().filter(|(name, _)| !writes(name)) {
        if volume.once().column(name).is_none_or(|found| !found.same(column)) {
            findings
                .add(format!("it changes the attribute `{name}` of the volume, which it does not declare to write"));
        }
    }
}

/// What is written whenever nothing is left out must be there when something is, with neutral values.
fn check_left_out(subject: &Subject, tried: &[(Trial, Outcome)], findings: &mut Findings) {
    let mut always: Option<BTreeMap<(usize, String), bool>> = None;
    let whole = |outcome: &&Outcome| outcome.is_whole() && !outcome.found.is_empty();
    let written = |outcome: &Outcome| {
        let declared = subject.node.writes.iter().map(|attribute| attribute.spec());
        let mut written = BTreeMap::new();
        for (name, owner, _) in declared {
            for ((place, _), geometry) in &outcome.found {
                let there = geometry.parts().any(|part| part.table(owner).column(name).is_some());
                *written.entry((*place, name.to_owned())).or_insert(true) &= there;
            }
        }
        written
    };
    for outcome in tried.iter().map(|(_, outcome)| outcome).filter(whole).filter(|outcome| outcome.left_out.is_empty())
    {
        let written = written(outcome);
        match &mut always {
            None => always = Some(written),
            Some(always) => always.iter_mut().for_each(|(place, there)| *there &= written.get(place) == Some(&true)),
        }
    }
    let Some(always) = always else { return };
    for outcome in tried.iter().map(|(_, outcome)| outcome).filter(whole).filter(|outcome| !outcome.left_out.is_empty())
    {
        let written = written(outcome);
        for ((place, name), _) in always.iter().filter(|(place, there)| **there && written.get(*place) != Some(&true)) {
            let (stage, output) = (outcome.left_out[0].stage, subject.node.outputs[*place].name);
            findings.add(format!("it leaves out `{stage}` and then lacks `{name}` on its output `{output}`"));
        }
    }
}
