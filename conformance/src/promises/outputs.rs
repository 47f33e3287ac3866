//! Promise: outputs carry the components they declare; every metric is published and finite.

use std::collections::BTreeSet;

use engine::geometry::{Geometry, Kind};
use engine::node::{Carries, Output};

use crate::suite::Findings;
use crate::trial::{Outcome, Subject, Trial};

pub(crate) fn check(subject: &Subject, tried: &[(Trial, Outcome)], findings: &mut Findings) {
    for (_, outcome) in tried {
        for ((index, _), geometry) in &outcome.found {
            check_kinds(subject, outcome, subject.node.outputs[*index], geometry, findings);
        }
        for name in &outcome.undefined_metrics {
            findings.add(format!("the metric `{name}` is NaN or infinite"));
        }
    }
    for metric in subject.node.metrics {
        if !metric.is_of_jumps && !tried.iter().any(|(_, outcome)| outcome.metrics.contains_key(metric.name)) {
            findings.add(format!("it never publishes the metric `{}`", metric.name));
        }
    }
}

fn check_kinds(subject: &Subject, outcome: &Outcome, output: &Output, geometry: &Geometry, findings: &mut Findings) {
    let wires = |name: &str| {
        let index = subject.inputs.iter().position(|input| input.name == name);
        index.map_or(&[][..], |index| &outcome.given[index])
    };
    let expected: BTreeSet<Kind> = match output.carries {
        Carries::Kinds(kinds) => kinds.iter().copied().collect(),
        Carries::Like(input) | Carries::Union(input) => wires(input).iter().flat_map(Geometry::kinds).collect(),
    };
    let found: BTreeSet<Kind> = geometry.kinds().collect();
    if found != expected && !(output.may_lack && found.is_subset(&expected)) {
        let names = |kinds: &BTreeSet<Kind>| kinds.iter().map(|kind| kind.name()).collect::<Vec<_>>().join(", ");
        let (name, found, expected) = (output.name, names(&found), names(&expected));
        findings.add(format!("its output `{name}` carries {found}, expected {expected}"));
    }
}
