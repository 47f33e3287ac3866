//! The help page of a node, derived from its declaration.

use std::fmt::Write as _;

use super::{Arity, Carries, Needs, Node};
use crate::param::{Bounds, Shape, Unset, Value};

impl Node {
    /// The help page: what it does, inputs, params with unit, range and default, outputs, attributes, metrics.
    pub fn help_page(&self) -> String {
        let mut page = format!("{} ({})\n\n{}\n", self.name, self.cook.word(), wrapped(self.help, 0));
        let mut section = |title: &str, lines: Vec<(String, String)>| {
            if lines.is_empty() {
                return;
            }
            let _ = write!(page, "\n{title}\n");
            for (head, help) in lines {
                let _ = write!(page, "  {head}\n{}\n", wrapped(&help, 6));
            }
        };
        section(
            "Inputs",
            self.input_specs()
                .iter()
                .map(|input| {
                    let needs = match input.needs {
                        Needs::Kind(kind) => kind.name(),
                        Needs::Any => "any geometry",
                    };
                    let arity = match input.arity {
                        Arity::One => "",
                        Arity::Optional => ", optional",
                        Arity::Many { least: 0 } => ", a list, optional",
                        Arity::Many { .. } => ", a list",
                    };
                    (format!("{} ({needs}{arity})", input.name), input.help.to_owned())
                })
                .collect(),
        );
        section(
            "Params",
            self.param_specs()
                .iter()
                .map(|param| {
                    // A default in words has no unit.
                    let worded = param.facts.unset != Unset::Default || matches!(param.default, Value::Nothing);
                    let unit = if worded { String::new() } else { param.unit_text() };
                    let mut head = format!("{} = {}{}", param.name, param.default_text(), unit);
                    let mut notes = Vec::new();
                    if let Shape::Choice(options) = param.shape {
                        notes.push(options.iter().map(|option| option.word).collect::<Vec<_>>().join(" | "));
                    }
                    if param.facts.hard != Bounds::ALL {
                        notes.push(param.facts.hard.to_string());
                    }
                    if let Some([low, high]) = param.facts.soft {
                        notes.push(format!("usually {low}…{high}"));
                    }
                    if param.facts.fixed {
                        notes.push("fixed".into());
                    }
                    if matches!(param.shape, Shape::Masked) {
                        notes.push("may be masked".into());
                    }
                    if !notes.is_empty() {
                        let _ = write!(head, "  ({})", notes.join("; "));
                    }
                    let mut help = param.help.to_owned();
                    if let Shape::Choice(options) = param.shape {
                        for option in options {
                            let _ = write!(help, " `{}`: {}.", option.word, option.help.trim_end_matches('.'));
                        }
                    }
                    (head, help)
                })
                .collect(),
        );
        section(
            "Outputs",
            self.outputs
                .iter()
                .map(|output| {
                    let carries = match output.carries {
                        Carries::Kinds(kinds) => kinds.iter().map(|kind| kind.name()).collect::<Vec<_>>().join(", "),
                        Carries::Like(input) => format!("like `{input}`"),
                        Carries::Union(input) => format!("all of `{input}`"),
                    };
                    (format!("{} ({carries})", output.name), output.help.to_owned())
                })
                .collect(),
        );
        let attributes = |list: &[&dyn super::AttrDecl]| {
            list.iter().map(|attribute| attribute.spec().0).collect::<Vec<_>>().join(" ")
        };
        if !self.reads.is_empty() || !self.writes.is_empty() {
            let _ = write!(
                page,
                "\nAttributes\n  reads {}\n  writes {}\n",
                or_none(attributes(self.reads)),
                or_none(attributes(self.writes))
            );
        }
        let mut section = |title: &str, lines: Vec<(String, String)>| {
            if !lines.is_empty() {
                let _ = write!(page, "\n{title}\n");
            }
            for (head, help) in lines {
                let _ = write!(page, "  {head}\n{}\n", wrapped(&help, 6));
            }
        };
        section(
            "Metrics",
            self.metrics
                .iter()
                .map(|metric| {
                    let unit = metric.unit.sign();
                    let unit = if unit.is_empty() { String::new() } else { format!(" [{unit}]") };
                    (format!("{}{unit}", metric.name), metric.help.to_owned())
                })
                .collect(),
        );
        page
    }
}

fn or_none(names: String) -> String {
    if names.is_empty() { "none".into() } else { names }
}

/// `text` in lines of at most 100 columns, each indented.
fn wrapped(text: &str, indent: usize) -> String {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        let line = lines.last_mut().expect("there is always a line");
        if !line.is_empty() && indent + line.chars().count() + 1 + word.chars().count() > 100 {
            lines.push(word.to_owned());
        } else {
            if !line.is_empty() {
                line.push(' ');
            }
            line.push_str(word);
        }
    }
    lines.iter().map(|line| format!("{:indent$}{line}", "")).collect::<Vec<_>>().join("\n")
}
