//! A gate on what the nodes cost: `cargo bench --bench instructions`.
//!
//! Counts the instructions of each case's cook with valgrind's callgrind, on one thread with AVX2, and compares them with
//! `benches/instructions.txt`: a count that differs by more than 3 % fails. Unlike times, counts hardly vary between runs
//! and machines; they do between compilers, so they are compared only where the compiler is the one they were stored with.
//!
//! `-- --bless` stores the counts, `-- WORD` runs the cases whose name has the word in it.

mod cases;
mod counts;

use std::convert::Infallible;
use std::path::Path;
use std::process::{Command, ExitCode};
use std::sync::atomic::AtomicBool;

use cases::{CASES, Case};
use engine::cook::{Delivered, Engine, Settings};
use engine::graph::{Graph, GraphOutput, Link, probe};
use engine::plan::Request;
use engine::time::Frame;

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
        CASES.iter().filter(|case| case.name == name).for_each(run);
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
    match asked.iter().map(|name| count(name)).collect::<Result<Vec<u64>, String>>() {
        Ok(counts) => counts::judge(&asked, &counts, bless),
        Err(fault) => {
            eprintln!("{fault}");
            ExitCode::FAILURE
        }
    }
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
fn run(case: &Case) {
    let text = format!(
        r#"{{ "convect": 1, "scene": {{ "frames": [1, {}], "seed": 7 }}, "nodes": {{ {} }}, "outputs": {{ "out": "{}" }} }}"#,
        case.frames,
        case.nodes.concat(),
        case.output
    );
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut graph = Graph::load(&text, folder, convect::CATALOGUE, &[], &probe)
        .unwrap_or_else(|faults| panic!("{}: {}", case.name, faults[0]));
    graph.outputs.extend(case.before.iter().map(|id| output(&graph, id)).collect::<Vec<_>>());
    let engine = Engine::new(&Settings { threads: 1, ..Settings::default() }).expect("a thread");
    cook(&engine, &graph, (1..graph.outputs.len()).collect(), 1);
    measured(&engine, &graph, case.frames);
}

/// The start of the count: callgrind sets it to zero when this is called, so it must not be inlined.
#[inline(never)]
fn measured(engine: &Engine, graph: &Graph, frames: i64) {
    cook(engine, graph, vec![0], frames);
}

fn cook(engine: &Engine, graph: &Graph, outputs: Vec<usize>, frames: i64) {
    let request = Request { outputs, frames: (1..=frames).map(Frame::whole).collect() };
    let mut nothing = |_: &[Delivered]| -> Result<(), Infallible> { Ok(()) };
    let report = engine.cook(graph, &request, None, &AtomicBool::new(false), &mut nothing).expect("it cooks");
    assert!(report.errors.is_empty(), "{}", report.errors[0].1);
}

fn output(graph: &Graph, id: &str) -> GraphOutput {
    let node = graph.nodes.iter().position(|node| &*node.id == id).expect("a node of the case");
    GraphOutput { name: id.into(), from: Link { node, port: 0 }, attributes: None, v: false }
}
