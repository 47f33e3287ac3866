//! `convect nodes`: the catalogue, and the help of each node.

use std::io::Write as _;

use engine::expr::suggest::nearest;
use engine::node::{Arity, Carries, Needs, Node, Output};
use engine::param::{Bounds, Shape};
use serde_json::{Value, json};

use crate::CATALOGUE;
use crate::failure::{Exit, Failure};

/// The arguments of `nodes`.
#[derive(Debug, clap::Args)]
pub struct NodesArgs {
    /// Node type to describe: its inputs, params, outputs and metrics
    name: Option<String>,
    /// Print as JSON
    #[arg(long)]
    json: bool,
}

/// Prints the list of nodes, or one node's help.
///
/// # Errors
/// If there is no such node type.
pub fn run(args: &NodesArgs) -> Result<(), Failure> {
    let mut stdout = std::io::stdout();
    let chosen: Vec<&Node> = match &args.name {
        None => CATALOGUE.nodes().collect(),
        Some(name) => vec![CATALOGUE.get(name).ok_or_else(|| unknown(name))?],
    };
    if args.json {
        let nodes: Vec<Value> = chosen.into_iter().map(to_json).collect();
        writeln!(stdout, "{}", serde_json::to_string_pretty(&nodes).unwrap_or_default())?;
    } else if args.name.is_some() {
        write!(stdout, "{}", chosen[0].help_page())?;
    } else {
        for node in chosen {
            writeln!(stdout, "{:<22} {:<7} {}", node.name, node.cook.word(), node.summary())?;
        }
    }
    Ok(())
}

fn unknown(name: &str) -> Failure {
    let near = nearest(name, CATALOGUE.names());
    let hint = near.map_or("`convect nodes` lists the node types".to_owned(), |near| format!("did you mean `{near}`?"));
    Failure::new(Exit::CommandLine, format!("there is no node type `{name}`; {hint}"))
}

fn to_json(node: &Node) -> Value {
    let inputs: Vec<Value> = node
        .input_specs()
        .iter()
        .map(|input| {
            let (least, list) = match input.arity {
                Arity::One => (1, false),
                Arity::Optional => (0, false),
                Arity::Many { least } => (least, true),
            };
            let needs = match input.needs {
                Needs::Kind(kind) => json!(kind.name()),
                Needs::Any => Value::Null,
            };
            json!({"name": input.name, "needs": needs, "least": least, "list": list, "help": input.help})
        })
        .collect();
    let params: Vec<Value> = node
        .param_specs()
        .iter()
        .map(|param| {
            let facts = &param.facts;
            let end = |x: f64| if x.is_finite() { json!(x) } else { Value::Null };
            let hard = (facts.hard != Bounds::ALL)
                .then(|| json!({"low": end(facts.hard.low), "high": end(facts.hard.high), "open": facts.hard.open}));
            let options = match param.shape {
                Shape::Choice(options) => {
                    options.iter().map(|one| json!({"word": one.word, "help": one.help})).collect()
                }
                _ => Vec::new(),
            };
            json!({
                "name": param.name, "kind": param.shape.describe(), "default": param.default_text(),
                "unit": facts.unit.sign(), "hard": hard, "soft": facts.soft, "fixed": facts.fixed,
                "mask": matches!(param.shape, Shape::Masked), "options": options, "help": param.help,
            })
        })
        .collect();
    let outputs: Vec<Value> = node.outputs.iter().map(|output| output_to_json(output)).collect();
    let names = |list: &[&dyn engine::node::AttrDecl]| list.iter().map(|one| one.spec().0).collect::<Vec<_>>();
    let metrics: Vec<Value> = node
        .metrics
        .iter()
        .map(|metric| json!({"name": metric.name, "unit": metric.unit.sign(), "help": metric.help}))
        .collect();
    json!({
        "name": node.name, "version": node.version, "time": node.cook.word(), "help": node.help,
        "inputs": inputs, "params": params, "outputs": outputs,
        "reads": names(node.reads), "writes": names(node.writes), "metrics": metrics,
    })
}

/// An output with the components it carries, or with the input whose components it has.
fn output_to_json(output: &Output) -> Value {
    let (carries, like) = match output.carries {
        Carries::Kinds(kinds) => (json!(kinds.iter().map(|kind| kind.name()).collect::<Vec<_>>()), Value::Null),
        Carries::Like(input) | Carries::Union(input) => (Value::Null, json!(input)),
    };
    json!({"name": output.name, "carries": carries, "like": like, "help": output.help})
}
