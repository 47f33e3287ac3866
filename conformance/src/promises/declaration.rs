//! Promise: the declaration is complete and consistent. Checked before anything is cooked.

use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::panics::quietly;
use crate::suite::Findings;
use engine::geometry::{Name, fixed_type};
use engine::node::{Arity, AttrDecl, Carries, Cook, InputSpec, Node};
use engine::param::{Bounds, ParamSpec, Params, Shape, Unit, Value};

/// Adds what is wrong; returns whether the node can be tried at all.
pub(crate) fn check(node: &'static Node, findings: &mut Findings) -> bool {
    if !is_node_name(node.name) {
        findings.add(format!("its name `{}` does not consist of capitalised words joined by `_`", node.name));
    }
    if node.version == 0 {
        findings.add("its version is 0; the first is 1");
    }
    if node.outputs.is_empty() {
        findings.add("it has no output");
    }
    check_help("it", node.help, findings);
    let specs = match quietly(|| catch_unwind(AssertUnwindSafe(|| node.param_specs()))) {
        Ok(specs) => specs,
        Err(_) => {
            findings.add("the default of one of its ramps is not a valid ramp");
            return false;
        }
    };
    let inputs = node.input_specs();
    for spec in &specs {
        check_param(spec, findings);
    }
    for input in &inputs {
        check_help(&format!("the input `{}`", input.name), input.help, findings);
    }
    for output in node.outputs {
        check_help(&format!("the output `{}`", output.name), output.help, findings);
        check_carries(output.name, output.carries, &inputs, findings);
    }
    for metric in node.metrics {
        check_help(&format!("the metric `{}`", metric.name), metric.help, findings);
    }
    check_names("param", specs.iter().map(|spec| spec.name), findings);
    check_names("input", inputs.iter().map(|input| input.name), findings);
    check_names("output", node.outputs.iter().map(|output| output.name), findings);
    check_names("metric", node.metrics.iter().map(|metric| metric.name), findings);
    check_attributes("reads", node.reads, findings);
    check_attributes("writes", node.writes, findings);
    check_what_plans_read(node, &specs, findings);
    true
}

/// Capitalised words, joined by `_`: `Curve_Wind`.
fn is_node_name(name: &str) -> bool {
    let word = |word: &str| {
        word.starts_with(|c: char| c.is_ascii_uppercase()) && word.bytes().all(|byte| byte.is_ascii_alphanumeric())
    };
    name.split('_').all(word)
}

fn is_snake_case(name: &str) -> bool {
    let letters = name.bytes().all(|byte| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'_');
    letters && name.starts_with(|c: char| c.is_ascii_lowercase()) && !name.ends_with('_') && !name.contains("__")
}

/// At least a sentence: two words, starting with a capital, ending with a full stop.
fn check_help(whose: &str, help: &str, findings: &mut Findings) {
    let first = help.chars().next();
    let starts = first.is_some_and(|c| !c.is_lowercase());
    if help.split_whitespace().count() < 2 || !starts || !help.ends_with('.') {
        findings.add(format!("{whose} needs help of at least a sentence, from a capital to a full stop: {help:?}"));
    }
}

fn check_names(what: &str, names: impl Iterator<Item = &'static str>, findings: &mut Findings) {
    let mut known = Vec::new();
    for name in names {
        if !is_snake_case(name) {
            findings.add(format!("the {what} `{name}` is not in snake_case"));
        }
        if known.contains(&name) {
            findings.add(format!("the {what} `{name}` is declared twice"));
        }
        known.push(name);
    }
}

fn check_param(spec: &ParamSpec, findings: &mut Findings) {
    let name = spec.name;
    check_help(&format!("the param `{name}`"), spec.help, findings);
    if let Shape::Choice(options) = spec.shape {
        for option in options.iter().filter(|option| option.help.trim().is_empty()) {
            findings.add(format!("the option `{}` of `{name}` has no help", option.word));
        }
        check_names("option", options.iter().map(|option| option.word), findings);
    }
    let hard = spec.facts.hard;
    if hard.low > hard.high {
        findings.add(format!("the hard range of `{name}` runs backwards: {hard}"));
        return;
    }
    if let Some([low, high]) = spec.facts.soft
        && (low >= high || low < hard.low || high > hard.high)
    {
        findings.add(format!("the usual range {low}…{high} of `{name}` is empty, or not within {hard}"));
    }
    if let Some((fact, hint)) = spec.refuses(&spec.default) {
        findings.add(format!("the default of `{name}` is refused: {fact}; {hint}"));
    }
    let numbers = match spec.shape {
        Shape::Float | Shape::Int | Shape::Vec2 | Shape::Int3 | Shape::Span | Shape::Masked => true,
        Shape::Vec3 => !spec.facts.direction,
        _ => false,
    };
    let ranged = hard != Bounds::ALL || spec.facts.soft.is_some();
    if numbers && spec.facts.unit == Unit::None && !ranged {
        findings.add(format!("`{name}` is a number with neither unit nor range"));
    }
}

fn check_carries(output: &str, carries: Carries, inputs: &[InputSpec], findings: &mut Findings) {
    let arity = |name: &str| inputs.iter().find(|input| input.name == name).map(|input| input.arity);
    let fits = match carries {
        Carries::Kinds(kinds) => !kinds.is_empty(),
        Carries::Like(input) => arity(input).is_some_and(|arity| !matches!(arity, Arity::Many { .. })),
        Carries::Union(input) => arity(input).is_some_and(|arity| matches!(arity, Arity::Many { .. })),
    };
    if !fits {
        findings.add(format!("the output `{output}` does not say which components it carries: {carries:?}"));
    }
}

fn check_attributes(what: &str, attributes: &[&dyn AttrDecl], findings: &mut Findings) {
    let mut known = Vec::new();
    for attribute in attributes {
        let (name, owner, kind) = attribute.spec();
        if let Some(fixed) = fixed_type(name).filter(|fixed| *fixed != kind) {
            findings.add(format!("it {what} `{name}` as {kind}, which is always {fixed}"));
        }
        if known.contains(&(name, owner)) {
            findings.add(format!("it lists `{name}` twice in what it {what}"));
        }
        known.push((name, owner));
    }
}

/// Declarations that the planner evaluates before cooking may depend only on params that are `fixed` or have `history`.
fn check_what_plans_read(node: &'static Node, specs: &[ParamSpec], findings: &mut Findings) {
    let fixed = |spec: &ParamSpec| spec.facts.fixed;
    if let Some(attributes) = node.attributes {
        let read = read_by(specs, |params| {
            attributes(params);
        });
        // Controls in code may be animated; the attributes that it names stay the same.
        for spec in read.iter().filter(|spec| !fixed(spec) && spec.shape != Shape::Code) {
            findings
                .add(format!("its attributes depend on `{}`, which can be animated; declare it `fixed`", spec.name));
        }
    }
    if let Cook::Solver(..) = node.cook {
        let read = read_by(specs, |params| {
            node.start_frame(params);
        });
        for spec in read.iter().filter(|spec| !fixed(spec)) {
            findings.add(format!("its start depends on `{}`, which can be animated; declare it `fixed`", spec.name));
        }
    }
    let integrated = read_by(specs, |params| {
        for integrand in node.integrands.iter().flatten() {
            integrand(params);
        }
    });
    for spec in integrated.iter().filter(|spec| !spec.facts.history && !fixed(spec)) {
        findings.add(format!("it integrates over `{}`, which is not declared with `history`", spec.name));
    }
    for spec in specs.iter().filter(|spec| spec.facts.history) {
        if !integrated.iter().any(|read| read.name == spec.name) {
            findings.add(format!("`{}` is declared with `history`, but nothing is integrated over it", spec.name));
        }
    }
}

/// The params that a function of the params reads: with defaults, and with each option of every choice.
fn read_by(specs: &[ParamSpec], ask: impl Fn(&Params)) -> Vec<ParamSpec> {
    let options = specs.iter().map(|spec| match spec.shape {
        Shape::Choice(options) => options.len(),
        Shape::Bool => 2,
        _ => 1,
    });
    let mut read = vec![false; specs.len()];
    for option in 0..options.max().unwrap_or(1) {
        let value = |spec: &ParamSpec| match spec.shape {
            Shape::Choice(options) => Value::Choice(option % options.len()),
            Shape::Bool => Value::Bool(option % 2 == 1),
            _ => spec.default.clone(),
        };
        let params = Params::new(specs.into(), specs.iter().map(value).collect());
        // A panic here also occurs in trials and is reported there.
        let _ = quietly(|| catch_unwind(AssertUnwindSafe(|| ask(&params))));
        read.iter_mut().enumerate().for_each(|(index, read)| *read |= params.was_read(index));
    }
    specs.iter().zip(read).filter(|(_, read)| *read).map(|(spec, _)| spec.clone()).collect()
}

/// Whether a list of names has this one.
pub(crate) fn has(names: &[Name], name: &str) -> bool {
    names.iter().any(|known| **known == *name)
}
