//! Promise: a stage that the node reports as left out has no effect on the result.
//!
//! While a stage is left out, these are checked:
//! * Attributes that are always written when nothing is left out are still written.
//! * Where the whole node is left out (stage `all`), every array of the input is passed through at the same address (a
//!   node that does the work anyway makes new ones), and added attributes are the same in every row. The same holds for
//!   the attribute that a stage is named after.
//! * Params and inputs that are named in the stage's name or reasons have no effect as long as the stage stays left
//!   out: neither values near the one that switched it off, nor the stage's other switches.
//!
//! Not checked: a param that affects only that stage, unless it has a `when` (the engine then hides its value from the
//! node) or is named in a reason; and whether a stage without effect is computed nevertheless.

use std::collections::{BTreeMap, BTreeSet};

use engine::geometry::{Column, P};
use engine::node::LeftOut;
use engine::param::{ParamSpec, Shape, Source, Value};

use super::params;
use crate::suite::Findings;
use crate::trial::{Motion, Outcome, Subject, Trial};
use crate::values;

/// The stage that stands for the whole node.
const WHOLE_NODE: &str = "all";

/// Number of trials that are varied for each reason of each stage.
const TRIALS: usize = 2;

pub(crate) fn check(subject: &Subject, tried: &[(Trial, Outcome)], findings: &mut Findings) {
    check_written(subject, tried, findings);
    let names = names(tried);
    let mut seen: BTreeMap<(&str, &str), usize> = BTreeMap::new();
    for (trial, outcome) in tried.iter().filter(|(_, outcome)| outcome.is_whole()) {
        for left in &outcome.left_out {
            let times = seen.entry((left.stage, &left.why)).or_default();
            *times += 1;
            if *times <= TRIALS {
                check_untouched(subject, trial, left, findings);
                check_without_effect(subject, (trial, outcome), left, &names[left.stage], findings);
            }
        }
    }
}

/// For each stage, everything named in its name and reasons.
fn names(tried: &[(Trial, Outcome)]) -> BTreeMap<&'static str, BTreeSet<String>> {
    let mut names: BTreeMap<_, BTreeSet<String>> = BTreeMap::new();
    for left in tried.iter().flat_map(|(_, outcome)| &outcome.left_out) {
        let named = names.entry(left.stage).or_default();
        named.insert(left.stage.to_owned());
        named.extend(left.why.split('`').skip(1).step_by(2).map(str::to_owned));
    }
    names
}

/// Anything the stage would write is the input's own array, or the same in every row.
fn check_untouched(subject: &Subject, trial: &Trial, left: &LeftOut, findings: &mut Findings) {
    let whole = left.stage == WHOLE_NODE;
    let writes = subject.node.writes.iter().any(|attribute| attribute.spec().0 == left.stage);
    if !whole && !writes {
        return;
    }
    // Moving inputs are new for each frame and share no arrays.
    let still = subject.run(&Trial { motion: Motion::Still, ..trial.clone() }, &subject.frames());
    for ((output, _), geometry) in &still.found {
        let output = subject.node.outputs[*output];
        for part in geometry.parts() {
            let Some(given) = subject.source(&still, output, part.kind()).and_then(|given| given.part(part.kind()))
            else {
                continue;
            };
            for (owner, name, column) in part.columns().filter(|(_, name, _)| whole || ***name == *left.stage) {
                let shared = given.table(owner).column(name).is_some_and(|given| given.same(column));
                if !shared && (**name == *P.name || !is_uniform(column)) {
                    findings.add(format!(
                        "it leaves out `{}` ({}), but still makes a new `{name}` for the {}",
                        left.stage,
                        left.why,
                        part.kind()
                    ));
                }
            }
        }
    }
}

/// Whether all rows are the same.
fn is_uniform(column: &Column) -> bool {
    column.is_empty() || column.gather(&vec![0; column.len()]) == *column
}

/// Params and inputs that the stage names have no effect as long as the same stages stay left out.
fn check_without_effect(
    subject: &Subject,
    (trial, outcome): (&Trial, &Outcome),
    left: &LeftOut,
    names: &BTreeSet<String>,
    findings: &mut Findings,
) {
    let stages = |left_out: &[LeftOut]| left_out.iter().map(|left| left.stage).collect::<Vec<_>>();
    let before = outcome.whole();
    let mut compare = |other: &Trial, same_reason: bool, what: &str| {
        let left_out = subject.left_out(other);
        let stays = stages(&left_out) == stages(&outcome.left_out) && (!same_reason || left_out == outcome.left_out);
        if !stays {
            return;
        }
        let after = subject.run(other, &subject.frames());
        // Invalid params, such as the name of a missing mask, are refused in any case.
        if after.is_whole() && after.whole() != before {
            findings.add(format!("it leaves out `{}` ({}), but {what} still affects the result", left.stage, left.why));
        }
    };
    for (index, spec) in subject.specs.iter().enumerate().filter(|(_, spec)| names.contains(spec.name)) {
        let other = |value: &Value| !matches!(&trial.settings[index], Source::Constant(now) if now == value);
        let near = nearby(spec, &trial.settings[index]);
        for value in params::values(subject, index).into_iter().filter(other).chain(near) {
            // Two options that both leave out a stage may differ in everything else.
            let same_reason = matches!(spec.shape, Shape::Choice(_));
            compare(&trial.with(index, value), same_reason, &format!("`{}`", spec.name));
        }
    }
    for (index, input) in subject.inputs.iter().enumerate() {
        if names.contains(input.name) && !trial.wires[index].is_empty() {
            compare(&trial.reseeded(index), false, &format!("the input `{}`", input.name));
        }
    }
}

/// Numbers slightly above and below the value of a param.
fn nearby(spec: &ParamSpec, source: &Source) -> Vec<Value> {
    let [low, high] = values::ends(spec);
    let step = 1e-3 * (high - low);
    let near = |value: &Value, by: f64| match value {
        Value::Float(x) => Some(Value::Float(x + by)),
        Value::Masked(x, mask) => Some(Value::Masked(x + by, mask.clone())),
        Value::Int(x) => Some(Value::Int(x + by.signum() as i64)),
        Value::Span([a, b]) => Some(Value::Span([a + by, b + by])),
        _ => None,
    };
    let Source::Constant(value) = source else { return Vec::new() };
    [-step, step].into_iter().filter_map(|by| near(value, by)).filter(|value| spec.refuses(value).is_none()).collect()
}

/// Attributes that are always written when nothing is left out are also written when something is.
fn check_written(subject: &Subject, tried: &[(Trial, Outcome)], findings: &mut Findings) {
    let mut always: Option<BTreeMap<(usize, String), bool>> = None;
    let whole = |outcome: &&Outcome| outcome.is_whole() && !outcome.found.is_empty();
    let written = |outcome: &Outcome| {
        let declared = subject.node.writes.iter().map(|attribute| attribute.spec());
        let mut written = BTreeMap::new();
        for (name, owner, _) in declared {
            for ((index, _), geometry) in &outcome.found {
                let there = geometry.parts().any(|part| part.table(owner).column(name).is_some());
                *written.entry((*index, name.to_owned())).or_insert(true) &= there;
            }
        }
        written
    };
    for outcome in tried.iter().map(|(_, outcome)| outcome).filter(whole).filter(|outcome| outcome.left_out.is_empty())
    {
        let written = written(outcome);
        match &mut always {
            None => always = Some(written),
            Some(always) => always.iter_mut().for_each(|(index, there)| *there &= written.get(index) == Some(&true)),
        }
    }
    let Some(always) = always else { return };
    for outcome in tried.iter().map(|(_, outcome)| outcome).filter(whole).filter(|outcome| !outcome.left_out.is_empty())
    {
        let written = written(outcome);
        for ((index, name), _) in always.iter().filter(|(index, there)| **there && written.get(*index) != Some(&true)) {
            let (stage, output) = (outcome.left_out[0].stage, subject.node.outputs[*index].name);
            findings.add(format!("while it leaves out `{stage}`, its output `{output}` lacks `{name}`"));
        }
    }
}
