//! What liquids cost, each beside the figure asked for: `cargo bench --bench liquid`, or `-- frames box growth threads memory
//! volume pressure surface tracking` for some of the parts; `--quick` for coarse grids and few frames.
//!
//! Frames are those of FluidSolve with its surface, 1/24 s each, cooked by a child process of two threads whose peak memory
//! is read. A frame is the mean of the frames after the first. Where a run is short it is the least of several, interleaved.
//! Times are of the machine as it is: figures to keep are taken on an idle one.

#[path = "../../tests/liquid/accuracy/flows.rs"]
mod flows;
mod frames;
mod pressure;
mod pressure_scene;
mod surface;
mod table;
#[path = "../timing/mod.rs"]
mod timing;
mod volume;

use std::process::ExitCode;

use engine::cook::{Engine, Settings};
use table::Table;

/// The program's allocator.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// How much is measured.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Extent {
    Quick,
    Full,
}

impl Extent {
    fn choose<T>(self, quick: T, full: T) -> T {
        match self {
            Self::Quick => quick,
            Self::Full => full,
        }
    }
}

/// Measures a part.
type Measure = fn(Extent, &mut Table);

const PARTS: [(&str, Measure); 9] = [
    ("frames", frames::blocks),
    ("box", frames::share_of_box),
    ("growth", frames::growth),
    ("threads", frames::threads),
    ("memory", frames::memory),
    ("volume", volume::raw),
    ("pressure", pressure::solves),
    ("surface", surface::extraction),
    ("tracking", surface::tracking),
];

fn main() -> ExitCode {
    convect::allocator::keep_freed_pages();
    let words: Vec<String> = std::env::args().skip(1).filter(|word| word != "--bench").collect();
    if let [child, case] = &words[..]
        && child == frames::CHILD
    {
        frames::cook_as_child(case);
        return ExitCode::SUCCESS;
    }
    let extent = if words.iter().any(|word| word == "--quick") { Extent::Quick } else { Extent::Full };
    let asked: Vec<&str> = words.iter().map(String::as_str).filter(|word| *word != "--quick").collect();
    if let Some(other) = asked.iter().find(|word| PARTS.iter().all(|(name, _)| name != *word)) {
        eprintln!("no part is `{other}`; expected {}", PARTS.map(|(name, _)| name).join(", "));
        return ExitCode::from(2);
    }
    timing::print_machine(&Engine::new(&Settings { threads: 2, ..Settings::default() }).expect("threads"));
    let mut table = Table::default();
    for (_, measure) in PARTS.iter().filter(|(name, _)| asked.is_empty() || asked.contains(name)) {
        measure(extent, &mut table);
    }
    println!("\n{table}");
    if table.is_met() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
