//! Loading a graph file and reporting its faults.

use std::io::Read as _;
use std::path::{Path, PathBuf};

use engine::cook::{Engine, Settings};
use engine::files::{RELATIVE_PATHS, is_handed_over, unreadable};
use engine::graph::fault::code;
use engine::graph::{Catalogue, Fault, FaultClass, Graph, Part, probe};
use engine::memory::Ceiling;
use engine::note::Note;
use formats::Format;

use crate::CATALOGUE;
use crate::args::Setting;
use crate::failure::{Failure, exit_of_faults};
use crate::output::by_file;

/// Larger graph files are refused: they are something else, or contain geometry that should be in separate files.
const LARGEST_GRAPH: u64 = 256 << 20;

/// The graph at `path`, with some params and controls overridden.
///
/// # Errors
/// If the file cannot be read. Faults of the graph are in the inner result.
pub fn graph(path: &Path, set: &[Setting]) -> Result<Result<Graph, Vec<Fault>>, Failure> {
    Ok(loaded(&bytes(path)?, path, set))
}

/// The bytes of the graph file at `path`.
///
/// # Errors
/// If the file cannot be read, or is too large for a graph.
pub fn bytes(path: &Path) -> Result<Vec<u8>, Failure> {
    let mut bytes = Vec::new();
    if is_stdin(path) {
        let read = std::io::stdin().take(LARGEST_GRAPH + 1).read_to_end(&mut bytes);
        read.map_err(|error| Failure::file(format!("the graph could not be read from stdin: {error}")))?;
        return small_enough(bytes, path);
    }
    let file = engine::files::open(path).and_then(|file| {
        // Without it the buffer grows by doubling.
        let length = file.metadata().map_or(0, |about| about.len());
        bytes.reserve(length.min(LARGEST_GRAPH) as usize + 1);
        file.take(LARGEST_GRAPH + 1).read_to_end(&mut bytes)
    });
    file.map_err(|error| Failure::file(format!("the graph {}", unreadable(path, &error).fact)))?;
    small_enough(bytes, path)
}

fn small_enough(bytes: Vec<u8>, path: &Path) -> Result<Vec<u8>, Failure> {
    if bytes.len() as u64 > LARGEST_GRAPH {
        let fact = format!("the graph `{}` is larger than {} MiB", graph_name(path), LARGEST_GRAPH >> 20);
        return Err(Failure::file(format!("{fact}; store geometry in separate files")));
    }
    Ok(bytes)
}

/// Whether a graph is to be read from stdin.
pub fn is_stdin(path: &Path) -> bool {
    path == Path::new("-")
}

/// The name of a graph's file in messages and reports.
pub fn graph_name(path: &Path) -> String {
    if is_stdin(path) { "stdin".into() } else { path.display().to_string() }
}

/// The graph in the bytes of the file at `path`, with some params and controls overridden.
///
/// # Errors
/// All faults of the graph.
pub fn loaded(bytes: &[u8], path: &Path, set: &[Setting]) -> Result<Graph, Vec<Fault>> {
    loaded_with(CATALOGUE, bytes, path, set)
}

/// The same with other node types.
///
/// # Errors
/// All faults of the graph.
pub fn loaded_with(catalogue: Catalogue, bytes: &[u8], path: &Path, set: &[Setting]) -> Result<Graph, Vec<Fault>> {
    let folder =
        path.parent().filter(|_| !is_handed_over(path) && !is_stdin(path)).map_or_else(PathBuf::new, Path::to_owned);
    let set: Vec<(String, String)> = set.iter().map(|Setting(key, json)| (key.clone(), json.clone())).collect();
    let loaded = Graph::load_bytes(bytes, &folder, catalogue, &set, &probe);
    loaded.map_err(|faults| as_read_from(path, naming_features(faults)))
}

/// The faults with hints that name the feature of node types that this program was built without.
fn naming_features(mut faults: Vec<Fault>) -> Vec<Fault> {
    for fault in faults.iter_mut().filter(|fault| fault.code == code::UNKNOWN_TYPE) {
        let name = fault.fact.split('`').nth(1).unwrap_or_default();
        fault.hint = crate::left_out(name).or_else(|| fault.hint.take());
    }
    faults
}

/// The faults of the graph at `path` with hints that fit where it was read from: stdin has no folder.
pub fn as_read_from(path: &Path, mut faults: Vec<Fault>) -> Vec<Fault> {
    if is_stdin(path) {
        let relative = faults.iter_mut().filter(|fault| fault.hint.as_deref() == Some(RELATIVE_PATHS));
        relative.for_each(|fault| {
            fault.hint = Some("paths of a graph from stdin are relative to the current folder".into())
        });
    }
    faults
}

/// The graph at `path`, checked as far as possible before cooking: compatible params, valid geometry files, outputs
/// that `format` can hold.
///
/// # Errors
/// If the file cannot be read. All faults of the graph are in the inner result.
pub fn checked_graph(
    path: &Path,
    set: &[Setting],
    engine: &Engine,
    format: Option<Format>,
) -> Result<Result<Graph, Vec<Fault>>, Failure> {
    let graph = match graph(path, set)? {
        Ok(graph) => graph,
        Err(faults) => return Ok(Err(faults)),
    };
    let mut faults = as_read_from(path, engine.verify(&graph, None));
    if let Some(format) = format {
        let outputs: Vec<usize> = (0..graph.outputs.len()).collect();
        faults.extend(format_faults(&graph, &outputs, format));
    }
    Ok(if faults.is_empty() { Ok(graph) } else { Err(faults) })
}

/// Faults of outputs with components that `format` cannot hold.
pub fn format_faults(graph: &Graph, outputs: &[usize], format: Format) -> Vec<Fault> {
    let mut faults = Vec::new();
    for outputs in by_file(graph, outputs) {
        let output = &graph.outputs[outputs[0]];
        if output.prim().is_some() && !format.is_sequence() {
            let fact = format!("`{}` is a list of outputs, and {format} files hold one each", output.file());
            let fault = graph.fault_at(Part::Output(&output.name), "output-format", FaultClass::Graph, fact);
            faults.push(fault.hint("use --format usdc or usda, or name each output"));
        }
    }
    for output in outputs.iter().map(|index| &graph.outputs[*index]) {
        let kinds = graph.carries(output.from);
        if let Some(kind) = kinds.iter().find(|kind| !format.holds(**kind)) {
            let fact = format!("`{}` has the component {kind}, which {format} cannot hold", output.name);
            let able: Vec<&str> = Format::holding(kinds.iter().copied()).iter().map(|format| format.name()).collect();
            let fault = graph.fault_at(Part::Output(&output.name), "output-format", FaultClass::Graph, fact);
            faults.push(fault.hint(format!("use --format {}", able.join(" or "))));
        }
    }
    faults
}

/// More faults are counted, not shown.
const MOST_SHOWN: usize = 200;

/// Fails with the exit code of a node that could not cook if notes are to be taken as errors and there are any.
///
/// # Errors
/// As said.
pub fn strict(strict: bool, notes: &[Note]) -> Result<(), Failure> {
    if !strict || notes.is_empty() {
        return Ok(());
    }
    let count = if notes.len() == 1 { "1 note".into() } else { format!("{} notes", notes.len()) };
    Err(Failure::new(crate::failure::Exit::Cook, format!("{count}, with --strict")))
}

/// The failure for a list of faults, with one line each.
pub fn faulty(path: &Path, faults: &[Fault]) -> Failure {
    let file = graph_name(path);
    let mut lines: Vec<String> = faults.iter().take(MOST_SHOWN).map(|fault| fault.in_file(&file)).collect();
    match faults.len() {
        0 | 1 => {}
        count if count > MOST_SHOWN => {
            lines.push(format!("{count} faults, of which the first {MOST_SHOWN} are shown; `check --json` lists all"));
        }
        count => lines.push(format!("{count} faults")),
    }
    Failure { exit: exit_of_faults(faults), lines }
}

/// An engine with these settings.
///
/// # Errors
/// If threads cannot be started, or `CONVECT_SIMD` is not a valid name.
pub fn engine(threads: usize, ceiling: Ceiling) -> Result<Engine, Failure> {
    use crate::failure::Exit;
    numerics::simd::Path::from_environment().map_err(|error| Failure::new(Exit::CommandLine, error.to_string()))?;
    let engine = Engine::new(&Settings { threads, memory: ceiling.bytes, ceiling });
    let hint = "set fewer --threads, or raise the limits of the process (`ulimit -u`, `ulimit -v`)";
    engine.map_err(|error| Failure::new(Exit::Cook, format!("{error}; {hint}")))
}

/// The indices of the nodes with these ids.
///
/// # Errors
/// If the graph has no node with one of the ids.
pub fn nodes(graph: &Graph, ids: &[String]) -> Result<Vec<usize>, Failure> {
    use crate::failure::Exit;
    let index = |id: &String| {
        let found = graph.nodes.iter().position(|node| *node.id == **id);
        found.ok_or_else(|| Failure::new(Exit::CommandLine, format!("the graph has no node `{id}`")))
    };
    ids.iter().map(index).collect()
}

/// The indices of the outputs in files with these names; all if `names` is empty.
///
/// # Errors
/// If the graph has no output with one of the names.
pub fn outputs(graph: &Graph, names: &[String]) -> Result<Vec<usize>, Failure> {
    use crate::failure::Exit;
    if names.is_empty() {
        return Ok((0..graph.outputs.len()).collect());
    }
    let mut indices = Vec::new();
    for name in names {
        let before = indices.len();
        indices.extend((0..graph.outputs.len()).filter(|index| graph.outputs[*index].file() == name));
        if indices.len() == before {
            let all: Vec<usize> = (0..graph.outputs.len()).collect();
            let file = |outputs: &Vec<usize>| format!("`{}`", graph.outputs[outputs[0]].file());
            let names: Vec<String> = by_file(graph, &all).iter().map(file).collect();
            let line = format!("the graph has no output `{name}`; outputs: {}", names.join(", "));
            return Err(Failure::new(Exit::CommandLine, line));
        }
    }
    indices.sort_unstable();
    indices.dedup();
    Ok(indices)
}
