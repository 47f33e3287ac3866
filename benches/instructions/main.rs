//! A gate on what the nodes cost: `cargo bench --bench instructions`.
//!
//! Counts the instructions of each case's cook with valgrind's callgrind, on one thread with AVX2, and compares them with
//! `benches/instructions.txt`: a count that differs by more than 3 % fails. Unlike times, counts hardly vary between runs
//! and machines; they do between compilers, so they are compared only where the compiler is the one they were stored with.
//!
//! Then it compares pairs of graphs without and with a feature that changes nothing: the feature may cost 1 %, and no bit.
//!
//! `-- --bless` stores the counts, `-- WORD` runs the cases whose name has the word in it; `-- neutral` the pairs alone.

mod cases;
mod counts;
mod neutral;

use std::convert::Infallible;
use std::path::Path;
use std::process::{Command, ExitCode};
use std::sync::atomic::AtomicBool;

use cases::{CASES, Case};
use engine::cook::{Delivered, Engine, Settings};
use engine::geometry::Geometry;
use engine::graph::{Graph, GraphOutput, Link, probe};
use engine::plan::Request;
use engine::time::Frame;
use neutral::{NEUTRAL, Neutral};
use numerics::parallel;

/// The program's own.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// The first argument of the process that valgrind runs; the name of its case follows.
const CHILD: &str = "child";

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).filter(|word| word != "--bench").collect();
    if let [first, name] = &words[..]
        && first == CHILD
    {
        let pairs = NEUTRAL.iter().flat_map(|pair| [&pair.without, &pair.with]);
        CASES.iter().filter(|case| case.name == name).for_each(|case| run(case, &format!("{:?}", case.output)));
        pairs.filter(|case| case.name == name).for_each(|case| run(case, &positions_of(case)));
        return ExitCode::SUCCESS;
    }
    let bless = words.iter().any(|word| word == "--bless");
    let filter: Vec<&String> = words.iter().filter(|word| *word != "--bless").collect();
    let asked: Vec<&str> = CASES
        .iter()
        .map(|case| case.name)
        .filter(|name| filter.is_empty() || filter.iter().any(|word| name.contains(*word)))
        .collect();
    if Command::new("valgrind").arg("--version").output().is_err() {
        println!("skipped: valgrind is not installed");
        return ExitCode::SUCCESS;
    }
    let judged = match count_all(&asked) {
        Ok(counts) => counts::judge(&asked, &counts, bless),
        Err(fault) => failed(&fault),
    };
    let with_pairs = filter.is_empty() || filter.iter().any(|word| *word == "neutral");
    match judge_pairs(if with_pairs { NEUTRAL } else { &[] }) {
        Ok(()) => judged,
        Err(fault) => failed(&fault),
    }
}

fn failed(fault: &str) -> ExitCode {
    eprintln!("{fault}");
    ExitCode::FAILURE
}

/// The most that a feature may cost that changes nothing, as a share of the instructions.
const NEUTRAL_COST: f64 = 0.01;

/// Prints what each feature costs that changes nothing; an error where that is too much, or a position differs.
fn judge_pairs(pairs: &[Neutral]) -> Result<(), String> {
    let mut wrong = Vec::new();
    if !pairs.is_empty() {
        println!("\n{:<40} {:>15} {:>15} {:>9}", "features that change nothing", "without", "with", "cost");
    }
    let names: Vec<&str> = pairs.iter().flat_map(|pair| [pair.without.name, pair.with.name]).collect();
    let counts = count_all(&names)?;
    for (Neutral { without, with, missed }, count) in pairs.iter().zip(counts.chunks(2)) {
        let (before, after) = (count[0], count[1]);
        let cost = after as f64 / before as f64 - 1.0;
        let known = if *missed { "  missed" } else { "" };
        println!("{:<40} {before:>15} {after:>15} {:>+7.2} %{known}", with.name, 100.0 * cost);
        if *missed && cost <= NEUTRAL_COST {
            wrong.push(format!("{} is marked as missed, but costs {:.2} %", with.name, 100.0 * cost));
        }
        if cost > NEUTRAL_COST && !missed {
            wrong.push(format!("{} costs {:.2} %, more than {:.0} %", with.name, 100.0 * cost, 100.0 * NEUTRAL_COST));
        }
        if positions(without) != positions(with) {
            wrong.push(format!("{} changes bits of positions", with.name));
        }
    }
    if wrong.is_empty() { Ok(()) } else { Err(wrong.join("\n")) }
}

/// An output of a case's positions alone: what no output has need not be computed.
fn positions_of(case: &Case) -> String {
    format!(r#"{{ "from": "{}", "attributes": ["P"] }}"#, case.output)
}

/// The bits of all positions of a case's output, frame by frame.
fn positions(case: &Case) -> Vec<u32> {
    let (engine, graph) = prepared(case, &positions_of(case));
    let mut bits = Vec::new();
    cook(&engine, &graph, vec![0], case.frames, &mut |geometry: &Geometry| {
        let numbers = geometry.parts().flat_map(|part| part.positions().as_flattened().iter().map(|x| x.to_bits()));
        bits.extend(numbers);
    });
    bits
}

/// Instructions of each case, several counted at a time.
fn count_all(names: &[&str]) -> Result<Vec<u64>, String> {
    parallel::map(names, |_, name| count(name)).into_iter().collect()
}

/// Instructions of a case: from the call of [`measured`] to the end of a process that runs nothing else.
fn count(name: &str) -> Result<u64, String> {
    let program = std::env::current_exe().map_err(|error| error.to_string())?;
    let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
    let profile = folder.path().join("profile");
    let output = Command::new("valgrind")
        .args(["--tool=callgrind", "--zero-before=instructions::measured*"])
        .arg(format!("--callgrind-out-file={}", profile.display()))
        .arg(program)
        .args([CHILD, name])
        .env("CONVECT_SIMD", "avx2")
        .output()
        .map_err(|error| format!("valgrind could not be run: {error}"))?;
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr);
        return Err(format!("{name}: valgrind ended with {}\n{said}", output.status));
    }
    let text = std::fs::read_to_string(&profile).map_err(|error| format!("{}: {error}", profile.display()))?;
    let total = text.lines().find_map(|line| line.strip_prefix("totals: ")?.trim().parse().ok());
    total.ok_or_else(|| format!("{name}: callgrind wrote no total"))
}

/// Cooks a case: first what the node reads, uncounted, then the node.
fn run(case: &Case, output: &str) {
    let (engine, graph) = prepared(case, output);
    measured(&engine, &graph, case.frames);
}

/// The graph of a case with this output, and an engine that holds what the node reads.
fn prepared(case: &Case, wanted: &str) -> (Engine, Graph) {
    let text = format!(
        r#"{{ "convect": 1, "scene": {{ "frames": [1, {}], "seed": 7 }}, "nodes": {{ {} }}, "outputs": {{ "out": {wanted} }} }}"#,
        case.frames,
        case.nodes.concat(),
    );
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut graph = Graph::load(&text, folder, convect::CATALOGUE, &[], &probe)
        .unwrap_or_else(|faults| panic!("{}: {}", case.name, faults[0]));
    // What is held has the attributes that the output needs: otherwise it would be cooked again.
    let attributes = graph.outputs[0].attributes.clone();
    let held = case.before.iter().map(|id| GraphOutput { attributes: attributes.clone(), ..output(&graph, id) });
    graph.outputs.extend(held.collect::<Vec<_>>());
    let engine = Engine::new(&Settings { threads: 1, ..Settings::default() }).expect("a thread");
    cook(&engine, &graph, (1..graph.outputs.len()).collect(), 1, &mut ignore);
    (engine, graph)
}

/// Takes a result. Not a closure of [`measured`], whose name callgrind would take for its own.
fn ignore(_: &Geometry) {}

/// The start of the count: callgrind sets it to zero when this is called, so it must not be inlined.
#[inline(never)]
fn measured(engine: &Engine, graph: &Graph, frames: i64) {
    cook(engine, graph, vec![0], frames, &mut ignore);
}

fn cook(engine: &Engine, graph: &Graph, outputs: Vec<usize>, frames: i64, take: &mut (dyn FnMut(&Geometry) + Send)) {
    let request = Request { outputs, frames: (1..=frames).map(Frame::whole).collect() };
    let mut sink = |finished: &[Delivered]| -> Result<(), Infallible> {
        finished.iter().for_each(|one| take(&one.geometry));
        Ok(())
    };
    let report = engine.cook(graph, &request, None, &AtomicBool::new(false), &mut sink).expect("it cooks");
    assert!(report.errors.is_empty(), "{}", report.errors[0].1);
}

fn output(graph: &Graph, id: &str) -> GraphOutput {
    let node = graph.nodes.iter().position(|node| &*node.id == id).expect("a node of the case");
    GraphOutput { name: id.into(), from: Link { node, port: 0 }, attributes: None, v: false }
}
