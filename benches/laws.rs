//! The tables of laws that docs/ show, in full, and the last frames of the example graphs: `cargo bench --bench laws`.
//!
//! `cargo test` runs coarse forms of the laws that take long, and cooks scenes with a solver to their fifth frame only; here
//! nothing is shortened. Fails where a law does not hold, or where a table or the bits differ from the stored ones.
//! `-- --bless` stores them; words run some of the parts: `wind`, `softbody`, `liquid`, `graphs`, `stability`.

#![allow(clippy::unwrap_used, reason = "a value that is not there fails the check")]

use std::fs;
use std::path::Path;
use std::process::{Command, ExitCode};

use accuracy_table::{Effort, Figure};
use engine::cook::{Engine, Settings};

#[path = "../tests/accuracy_table/mod.rs"]
mod accuracy_table;
#[path = "../tests/stability/animated.rs"]
mod animated;
#[path = "../tests/graphs/bits.rs"]
mod bits;
#[path = "../tests/cooked/mod.rs"]
mod cooked;
#[path = "../tests/stability/every_node.rs"]
mod every_node;
#[path = "../tests/stability/liquid/mod.rs"]
mod liquid;
#[path = "../tests/liquid/accuracy/mod.rs"]
mod liquid_accuracy;
#[allow(dead_code, reason = "the laws use part of it")]
#[path = "../tests/softbody/measure.rs"]
mod measure;
#[path = "../tests/stability/page.rs"]
mod page;
#[allow(dead_code, reason = "the laws use part of it")]
#[path = "../tests/softbody/scene.rs"]
mod scene;
#[path = "../tests/softbody/shapes.rs"]
mod shapes;
#[path = "../tests/stability/softbody/mod.rs"]
mod softbody;
#[path = "../tests/softbody/accuracy/mod.rs"]
mod softbody_accuracy;
mod timing;
#[path = "../tests/stability/wind/mod.rs"]
mod wind;
#[path = "../tests/wind/accuracy/mod.rs"]
mod wind_accuracy;

/// The program's own.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).filter(|word| word != "--bench").collect();
    let bless = words.iter().any(|word| word == "--bless");
    let parts: Vec<&str> = words.iter().map(String::as_str).filter(|word| *word != "--bless").collect();
    let asked = |part: &str| parts.is_empty() || parts.contains(&part);
    let known = ["wind", "softbody", "liquid", "graphs", "stability"];
    if let Some(other) = parts.iter().find(|part| !known.contains(part)) {
        eprintln!("no part is `{other}`; expected one of {}", known.join(", "));
        return ExitCode::from(2);
    }
    print_date();
    timing::print_machine(&Engine::new(&Settings::default()).unwrap());
    let mut held = true;
    if asked("wind") {
        held &= laws("docs/wind.md", &wind_accuracy::figures(), bless);
    }
    if asked("softbody") {
        held &= laws("docs/softbody.md", &softbody_accuracy::figures(Effort::Full), bless);
    }
    if asked("liquid") {
        held &= laws("docs/liquid.md", &liquid_accuracy::figures(Effort::Full), bless);
    }
    if asked("graphs") {
        held &= stored("benches/graphs.txt", last_frames(), bless);
    }
    if asked("stability") {
        page::run_in_full();
        let tables = [every_node::GROUPS, animated::GROUPS, wind::GROUPS, softbody::GROUPS, liquid::GROUPS].concat();
        tables.iter().for_each(|table| table());
        held &= stored("docs/stability.md", page::text(), bless);
    }
    if held { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// Today's, from the system's `date`.
fn print_date() {
    let output = Command::new("date").args(["-u", "+%-d %B %Y"]).output();
    print!("{}", output.map(|output| String::from_utf8_lossy(&output.stdout).into_owned()).unwrap_or_default());
}

/// Prints a table; whether all laws hold and `page` shows it.
fn laws(page: &str, figures: &[Figure], bless: bool) -> bool {
    println!();
    let broken = accuracy_table::broken(figures);
    if !broken.is_empty() {
        eprintln!("these laws do not hold, or are marked as missed although they do:\n{}", broken.join("\n"));
        return false;
    }
    let mut text = fs::read_to_string(root().join(page)).unwrap();
    text.replace_range(accuracy_table::table_range(&text), &accuracy_table::table(figures));
    stored(page, text, bless)
}

/// Bits of the middle and last frame of every scene with a solver.
fn last_frames() -> String {
    let solved = |path: &std::path::PathBuf| {
        let graph = bits::load(path);
        let frames = bits::frames(&graph, graph.scene.last);
        bits::has_solver(&graph).then(|| bits::lines(path, &bits::cook(&graph, &frames[1..], 0, None)))
    };
    bits::graphs().iter().filter_map(solved).collect()
}

/// Whether a file is this text, or writes it.
fn stored(file: &str, text: String, bless: bool) -> bool {
    let path = root().join(file);
    if bless {
        fs::write(&path, &text).unwrap();
    }
    let same = fs::read_to_string(&path).unwrap_or_default() == text;
    if !same {
        eprintln!("{file} is not up to date; `cargo xtask bless laws` writes it and shows what changed");
    }
    same
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}
