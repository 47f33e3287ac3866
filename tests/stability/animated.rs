//! Every param of every node that may be animated: keyframes that are unordered, doubled, single or missing, and expressions
//! that become NaN or infinite.

use engine::node::Node;
use engine::param::{ParamSpec, Shape};

use crate::every_node::{Change, Cooked, cook, files, graph, json, judged};
use crate::page::{self, Outcome};

const PART: &str = "Every node";

/// Params whose value is numbers and may change, each with a valid value as a graph writes it.
fn animated(node: &Node) -> Vec<(ParamSpec, String)> {
    let specs = node.param_specs().into_iter().filter(|spec| !spec.facts.fixed && spec.shape != Shape::Seed);
    specs.filter_map(|spec| Some((json(&spec.default)?, spec))).map(|(value, spec)| (spec, value)).collect()
}

fn counted(params: usize) -> String {
    if params == 1 { "1 param".into() } else { format!("{params} params") }
}

/// A message without line and column, which depend on where files lie.
fn without_place(message: &str) -> &str {
    message.find("nodes.n.").map_or(message, |at| &message[at..])
}

/// An expression for each number of a value.
fn expressions(spec: &ParamSpec, expression: &str) -> String {
    let numbers = match spec.shape {
        Shape::Vec2 | Shape::Span => 2,
        Shape::Vec3 | Shape::Int3 => 3,
        _ => 1,
    };
    match numbers {
        1 => format!(r#"{{ "expr": "{expression}" }}"#),
        _ => format!(r#"{{ "expr": [{}] }}"#, vec![format!(r#""{expression}""#); numbers].join(", ")),
    }
}

/// A node with ordinary inputs.
struct Trial {
    node: &'static Node,
    file: String,
    /// Keeps the file.
    _folder: Option<tempfile::TempDir>,
}

impl Trial {
    fn of(node: &'static Node) -> Self {
        let (folder, file) = files(node, Change::Nothing);
        Self { node, file, _folder: folder }
    }

    /// What came of a value of a param; an error is the message of the load.
    fn cook(&self, spec: &ParamSpec, value: &str) -> Result<Cooked, String> {
        let comma = if self.file.is_empty() { "" } else { ", " };
        let graph = graph(self.node, &format!(r#"{}{comma}"{}": {value}"#, self.file, spec.name))?;
        Ok(cook(graph, self.node, Change::Nothing, 2))
    }
}

fn keyframes() {
    let mut wrong = Vec::new();
    for node in convect::CATALOGUE.nodes() {
        let trial = Trial::of(node);
        let (mut params, mut message) = (0, String::new());
        for (spec, value) in animated(node) {
            let what = |keys: &str| format!("{}: `{}` with keyframes {keys}", node.name, spec.name);
            let keyed = |keys: &str| trial.cook(&spec, &format!(r#"{{ "keyframes": {keys} }}"#));
            // A numeric param may take no keyframes; then it refuses all alike, and says so.
            for keys in
                ["[]".to_owned(), format!("[[3, {value}], [1, {value}]]"), format!("[[2, {value}], [2, {value}]]")]
            {
                match keyed(&keys) {
                    Err(said) if said.contains(spec.name) => message = said,
                    Err(said) => wrong.push(format!("{}: refused without its name: {said}", what(&keys))),
                    Ok(_) => wrong.push(format!("{}: accepted", what(&keys))),
                }
            }
            let single = format!("[[2, {value}]]");
            match keyed(&single).map(|cooked| judged(&cooked)) {
                Ok(Ok((Outcome::Finite | Outcome::Capped, _))) => params += 1,
                Ok(Ok((Outcome::Refused, said)) | Err(said)) | Err(said) => {
                    wrong.push(format!("{}: {said}", what(&single)));
                }
            }
        }
        if params > 0 {
            let case = format!("{}: params with a single keyframe", node.name);
            page::record(PART, "8", &case, Outcome::Finite, &counted(params));
            let case = format!("{}: keyframes out of order, doubled, and none", node.name);
            page::record(
                PART,
                "8",
                &case,
                Outcome::Refused,
                &format!("{}; {}", counted(params), without_place(&message)),
            );
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

fn expressions_that_are_not_finite() {
    let mut wrong = Vec::new();
    for (row, what, expression) in [("1", "NaN", "0/0"), ("2", "infinite", "1/(frame-frame)")] {
        for node in convect::CATALOGUE.nodes() {
            let trial = Trial::of(node);
            let plain = graph(node, &trial.file).map(|graph| cook(graph, node, Change::Nothing, 2));
            let (mut refused, mut unread, mut message) = (0, 0, String::new());
            for (spec, _) in animated(node) {
                let case = format!("{}: `{}` that becomes {what}", node.name, spec.name);
                let outcome = trial.cook(&spec, &expressions(&spec, expression));
                match outcome.as_ref().map(judged) {
                    Ok(Ok((Outcome::Refused, said))) if said.contains(spec.name) => {
                        (refused, message) = (refused + 1, said)
                    }
                    Err(said) if said.contains(spec.name) => (refused, message) = (refused + 1, said.clone()),
                    // Whatever else is set leaves it out: then it changes nothing.
                    Ok(Ok((Outcome::Finite | Outcome::Capped, _))) if outcome.as_ref().ok() == plain.as_ref().ok() => {
                        unread += 1;
                    }
                    Ok(Ok((_, said)) | Err(said)) => wrong.push(format!("{case}: {said}")),
                    Err(said) => wrong.push(format!("{case}: {said}")),
                }
            }
            if refused > 0 {
                let others = if unread > 0 { format!(", {unread} are not read here") } else { String::new() };
                let figure = format!("{}{others}; {}", counted(refused), without_place(&message));
                let case = format!("{}: params that become {what}", node.name);
                page::record(PART, row, &case, Outcome::Refused, &figure);
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// All tables of this module.
#[allow(dead_code, reason = "of `cargo bench --bench laws`")]
pub(crate) const GROUPS: &[fn()] = &[keyframes, expressions_that_are_not_finite];

#[cfg(test)]
mod tables {
    #[test]
    fn keyframes() {
        super::keyframes();
    }

    #[test]
    fn expressions_that_are_not_finite() {
        super::expressions_that_are_not_finite();
    }
}
