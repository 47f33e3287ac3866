//! Promise: what a node does not declare to write passes through, shared with the input and not copied.

use engine::geometry::{Component, Geometry, Kind, Owner, P, Volume};
use engine::node::{AttrNames, Output};

use super::declaration;
use crate::suite::Findings;
use crate::trial::{Motion, Outcome, Subject, Trial};

pub(crate) fn check(subject: &Subject, tried: &[(Trial, Outcome)], findings: &mut Findings) {
    for (trial, outcome) in tried {
        for ((index, _), geometry) in &outcome.found {
            check_output(subject, (trial, outcome), subject.node.outputs[*index], geometry, findings);
        }
    }
}

fn check_output(
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
    // Moving inputs have other positions at every frame; trials with constant inputs cover those.
    let writes = |name: &str| {
        let declared = node.writes.iter().any(|attribute| attribute.spec().0 == name);
        declared || declaration::has(more, name) || moving && name == P.name
    };
    for part in geometry.parts() {
        let kind = part.kind();
        let given = subject.source(outcome, output, kind).and_then(|given| given.part(kind));
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
        (geometry.volume(), subject.source(outcome, output, Kind::Volume).and_then(Geometry::volume))
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
