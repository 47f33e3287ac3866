//! `convect study`: error against run time of a graph, over the values of its params.
//!
//! Every run is cooked by a new engine without a cache on disk, so none is free because of another. All runs are compared
//! with one reference, beyond the best of them; how far the best is from it is the floor, below which nothing is claimed.

mod bench;
#[cfg(test)]
mod declared;
mod differences;
mod direction;
mod extremes;
mod knobs;
mod measure;
mod model;
mod nearest;
mod norms;
mod outcome;
mod plot;
mod propose;
#[cfg(test)]
mod replay;
mod rounding;
mod search;
mod store;
mod table;
mod tune;

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::OnceLock;

use engine::graph::Graph;
use engine::plan::Request;
use engine::time::Frame;
use formats::atomic::AtomicFile;

use crate::args::{Frames, Setting, Size};
use crate::failure::{Exit, Failure, cancelled_by_signal};
use crate::output::{create_folder, failed, fill, write_whole};
use crate::progress::Progress;
use crate::targets::Targets;
use crate::{load, memory};
use bench::Subject;
use knobs::{Knob, KnobArg};
use measure::Study;
use norms::{Measure, Norm};
use outcome::{Goal, Outcome};

/// The arguments of `study`.
#[derive(Debug, clap::Args)]
pub struct StudyArgs {
    /// The graph file; - reads it from stdin
    graph: PathBuf,
    /// A param and the values to compare, from coarse to fine: wind.rotation_steps=4,8,16; repeatable. The last value
    /// counts as the best, unless the node declares or its results show the opposite direction. Runs are compared with
    /// a reference one step beyond the best, or with an exact method where the node has one. Without --knob, the
    /// graph's knobs are listed
    #[arg(long = "knob", value_name = "NODE.PARAM=V,V,…")]
    knobs: Vec<KnobArg>,
    /// Instead of a comparison: cook the graph with each param of each node at both ends of its range, and print each
    /// outcome: finite, refused (with the message) or capped (with what a node could not meet). Cooks all outputs
    /// unless --output names one, and the scene's first 24 frames unless --frames is given. Exit code 4 for any other
    /// outcome
    #[arg(long, conflicts_with_all = ["knobs", "norm", "tolerance", "budget", "out", "repeats", "fresh"])]
    extremes: bool,
    /// With --extremes: the longest that each cook may take; what takes longer is stopped, and its frames so far are reported
    #[arg(long, value_name = "TIME", default_value = "10s", requires = "extremes")]
    limit: Budget,
    /// One of these cooks, in a process of its own.
    #[arg(long, hide = true, value_name = "KEY=VALUE", requires = "extremes")]
    extreme: Option<String>,
    /// The output to compare [default: the graph's output, if it has one only]
    #[arg(long, value_name = "NAME")]
    output: Option<String>,
    /// Frames to cook: 1-48, 1-48x2 (every second), 10, 10.5, 1- (to the scene's end), or a list: 1-4,10 [default: the scene's frames]
    #[arg(long, value_name = "FRAMES", allow_hyphen_values = true)]
    frames: Option<Frames>,
    /// What is compared: points (distances of points, by id where there is one), surface (distances between surfaces, both
    /// ways), volume, an attribute or NODE.METRIC; and which statistic counts: mean, p99 or max. Repeatable, or separated by
    /// commas: --norm surface,p99
    #[arg(long, value_name = "NORM", value_delimiter = ',', default_value = "points,mean")]
    norm: Vec<String>,
    /// Write the graph with the cheapest values (in CPU time) whose error is at most this, in the norm's unit
    #[arg(long, value_name = "E", value_parser = positive, conflicts_with = "budget")]
    tolerance: Option<f64>,
    /// Write the graph with the most accurate values that take at most this per frame: 20ms, 1.5s
    #[arg(long, value_name = "TIME")]
    budget: Option<Budget>,
    /// Write all runs, or all lines of --extremes, to this file as JSON; - writes them to stdout, and the table to stderr
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Folder for the plot NAME.svg, the graph NAME.tuned.jsonc and the runs NAME.study; created if missing
    #[arg(long, value_name = "DIR", default_value = "out")]
    out: PathBuf,
    /// Override a param (node.param=VALUE) or a control (name=VALUE) in all runs; repeatable
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<Setting>,
    /// Cook each setting this many times, in rounds, and take the least time (both ends of a knob three times where only
    /// times tell which is the fine one); a search (see --tolerance) repeats only
    /// settings that it may pick [default: 3, fewer where a run takes seconds]
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u32).range(1..=1000))]
    repeats: Option<u32>,
    /// Ignore the runs stored in NAME.study
    #[arg(long)]
    fresh: bool,
    /// Number of threads [default: as many as the machine has]
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true, value_parser = clap::value_parser!(u16).range(0..=1024))]
    threads: u16,
    /// Memory for the results that a frame needs, such as 8G [default: half of the machine's]
    #[arg(long, value_name = "SIZE")]
    memory: Option<Size>,
    /// Print only errors and the table
    #[arg(short, long)]
    quiet: bool,
}

fn positive(text: &str) -> Result<f64, String> {
    let number = text.parse::<f64>().ok().filter(|number| number.is_finite() && *number > 0.0);
    number.ok_or_else(|| {
        format!("`{text}` is not a tolerance, expected a number greater than 0 in the unit of the norm, as in 0.001 for 1 mm")
    })
}

/// `20ms`, `1.5s` of `--budget`, in milliseconds.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Budget(f64);

impl FromStr for Budget {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let plain = text.trim();
        let (number, unit) = match (plain.strip_suffix("ms"), plain.strip_suffix('s')) {
            (Some(number), _) => (number, 1.0),
            (None, Some(number)) => (number, 1e3),
            (None, None) => (plain, 1.0),
        };
        let number = number.trim().parse::<f64>().ok().filter(|number| number.is_finite() && *number > 0.0);
        number.map(|number| Self(number * unit)).ok_or_else(|| format!("`{text}` is not a time; write 20ms or 1.5s"))
    }
}

/// Measures, and writes what was found.
///
/// # Errors
/// If the graph has faults, a file cannot be written, the norm does not fit, nothing satisfies the tolerance or budget, or
/// the study is interrupted.
pub fn run(args: &StudyArgs) -> Result<(), Failure> {
    if args.extremes {
        return extremes::run(args);
    }
    let wrong = |line: String| Failure::new(Exit::CommandLine, line);
    let bytes = load::bytes(&args.graph)?;
    let loaded = load::loaded(&bytes, &args.graph, &args.set);
    let graph = loaded.map_err(|faults| load::faulty(&args.graph, &faults))?;
    let output = output(&graph, args.output.as_deref())?;
    let name = graph.outputs[output].name.to_string();
    if args.knobs.is_empty() {
        if args.tolerance.is_some() || args.budget.is_some() || args.json.is_some() {
            crate::say!("note: nothing is measured without --knob; the graph's are:");
        }
        let text = propose::text(&graph, output, &load::graph_name(&args.graph));
        std::io::stdout().write_all(text.as_bytes())?;
        return Ok(());
    }
    let norm = Norm::of(&args.norm).map_err(wrong)?;
    let unit = norm.measure.unit(&graph).map_err(wrong)?;
    let request = Request { outputs: vec![output], frames: Frames::of_scene(args.frames.as_ref(), &graph.scene)? };
    let knobs: Vec<Knob> = args.knobs.iter().map(|knob| Knob::new(knob, &graph)).collect();
    if let Some(twice) = (1..knobs.len()).find(|index| knobs[..*index].iter().any(|knob| knob.key == knobs[*index].key))
    {
        return Err(wrong(format!(
            "the knob `{}` is given twice; write all its values in one --knob",
            knobs[twice].key
        )));
    }
    // What is compared: the output, or what a node publishes.
    let (compared, what) = match &norm.measure {
        Measure::Metric { node, .. } => {
            let place = graph.nodes.iter().position(|found| *found.id == **node);
            (place.unwrap_or(graph.outputs[output].from.node), format!("`{}`", norm.measure.name()))
        }
        _ => (graph.outputs[output].from.node, format!("the output `{name}`")),
    };
    let needed = propose::upstream(&graph, compared);
    let is_idle = |knob: &&Knob| {
        graph.nodes.iter().position(|node| *node.id == *knob.node).is_some_and(|node| !needed.contains(&node))
    };
    if let Some(idle) = knobs.iter().find(is_idle) {
        return Err(wrong(format!("{what} does not depend on `{}`, so `{}` cannot change it", idle.node, idle.key)));
    }
    let paths = Paths::new(args, &name);
    paths.check(args, &graph)?;
    let mut fixed: Vec<(String, String)> =
        args.set.iter().map(|Setting(key, value)| (key.clone(), value.clone())).collect();
    let needs = measure::needs(&knobs, &graph);
    if !args.quiet {
        needs.iter().for_each(|(key, value, knob)| {
            crate::say!("note: `{knob}` is read only with {key}={value}, which all runs use");
        });
    }
    fixed.extend(needs.into_iter().map(|(key, value, _)| (key, value)));
    let cancel = cancelled_by_signal();
    let goal = match (args.tolerance, args.budget) {
        (Some(tolerance), _) => Goal::Tolerance(tolerance),
        (None, Some(Budget(ms))) => Goal::Budget(ms),
        (None, None) => Goal::None,
    };
    let planned = measure::planned_runs(&knobs, goal, args.repeats.unwrap_or(measure::REPEATS));
    let progress = Progress::new((planned * request.frames.len()) as u64, args.quiet);
    let frames = request.frames.iter().map(Frame::to_json).collect();
    let subject = Subject {
        catalogue: crate::CATALOGUE,
        bytes: &bytes,
        path: &args.graph,
        fixed,
        request,
        norm: norm.clone(),
        threads: usize::from(args.threads),
        ceiling: memory::ceiling(args.memory),
        cancel,
        progress,
        unmatched: OnceLock::new(),
    };
    subject.check(&knobs)?;
    create_folder(&args.out)?;
    // Before the runs, so that an invalid path is reported at once.
    let json_path = args.json.as_ref().filter(|path| !is_stdout(path));
    let json_file = json_path.map(AtomicFile::create).transpose().map_err(|error| failed(&error))?;
    let mut study = Study::new(&subject, knobs, goal, &graph, &paths.store, args.repeats);
    if !args.fresh && study.resume() && !args.quiet {
        let runs = match study.runs() {
            1 => "1 run is".to_owned(),
            runs => format!("{runs} runs are"),
        };
        crate::say!("{runs} taken from `{}`; --fresh measures anew", paths.store.display());
    }
    let interrupted = study.measure()?;
    let found = study.finish()?;
    // Ends the bar, before anything else is printed.
    let Subject { progress, fixed, unmatched, .. } = subject;
    drop(progress);
    if let Some(text) = unmatched.get().filter(|_| !args.quiet) {
        crate::say!("note: {text}");
    }
    let reversed = found.knobs.iter().zip(&found.stored.reversed).filter(|(_, reversed)| **reversed && !args.quiet);
    for (knob, _) in reversed {
        let key = &knob.key;
        crate::say!(
            "note: the first value of `{key}` counts as the best, as its result is larger than the last's or takes longer; if it is not, give them in the other order"
        );
    }
    let graph_name = load::graph_name(&args.graph);
    let mut outcome = Outcome { graph: graph_name, output: name, unit, frames, goal, ..found.outcome(norm) };
    outcome.judge();
    write(args, &paths, &outcome, json_file, Source { bytes: &bytes, graph: &graph, fixed: &fixed })?;
    if outcome.pick.is_none() {
        earlier_tuned(args, &paths.tuned, outcome.goal, interrupted)?;
    }
    if interrupted {
        return Err(Failure::new(
            Exit::Interrupted,
            format!("interrupted; {} runs are kept, the same command goes on", outcome.runs.len()),
        ));
    }
    verdict(&outcome)
}

/// The index of the output with that name, or of the only one.
fn output(graph: &Graph, name: Option<&str>) -> Result<usize, Failure> {
    match name {
        // Of several in one file each can be named.
        Some(name) if let Some(place) = graph.outputs.iter().position(|output| *output.name == *name) => Ok(place),
        Some(name) if let [one] = load::outputs(graph, &[name.to_owned()])?[..] => Ok(one),
        None if graph.outputs.len() == 1 => Ok(0),
        name => {
            let all = graph.outputs.iter().filter(|output| name.is_none_or(|name| output.file() == name));
            let names: Vec<String> = all.map(|output| format!("`{}`", output.name)).collect();
            let what = name.map_or_else(|| "the graph".to_owned(), |name| format!("`{name}`"));
            let line = format!("{what} has several outputs; write --output with one of {}", names.join(", "));
            Err(Failure::new(Exit::CommandLine, line))
        }
    }
}

/// The files of a study.
struct Paths {
    plot: PathBuf,
    tuned: PathBuf,
    store: PathBuf,
}

impl Paths {
    fn new(args: &StudyArgs, name: &str) -> Self {
        // Of several outputs in one file each has its own study.
        let name = name.replace('/', ".");
        let file = |ending: &str| args.out.join(format!("{name}.{ending}"));
        Self { plot: file("svg"), tuned: file("tuned.jsonc"), store: store::path(&args.out, &name) }
    }

    /// Refuses to overwrite what is read.
    fn check(&self, args: &StudyArgs, graph: &Graph) -> Result<(), Failure> {
        let mut targets = Targets::default();
        if !load::is_stdin(&args.graph) {
            targets.reads(&args.graph, "it is the graph");
        }
        graph.files().into_iter().for_each(|path| targets.reads(path, "the graph reads it"));
        [&self.plot, &self.tuned, &self.store].into_iter().for_each(|path| targets.writes("--out", Exit::File, path));
        if let Some(path) = args.json.as_ref().filter(|path| !is_stdout(path)) {
            targets.writes("--json", Exit::CommandLine, path);
        }
        targets.check()?;
        targets.sweep();
        Ok(())
    }
}

fn is_stdout(path: &Path) -> bool {
    path == Path::new("-")
}

/// What a tuned graph is made from: the graph's text, the graph, and what all runs set.
struct Source<'a> {
    bytes: &'a [u8],
    graph: &'a Graph,
    fixed: &'a [(String, String)],
}

/// Writes plot, tuned graph, JSON and table. `json_file` is that of `--json`, unless it is stdout.
fn write(
    args: &StudyArgs,
    paths: &Paths,
    outcome: &Outcome,
    json_file: Option<AtomicFile>,
    source: Source<'_>,
) -> Result<(), Failure> {
    write_whole(&paths.plot, plot::svg(outcome).as_bytes())?;
    let mut wrote = vec![&paths.plot];
    if let Some(pick) = outcome.pick {
        let Source { bytes, graph, fixed } = source;
        let tuned = tune::tuned(outcome, pick, bytes, graph, fixed, &args.out);
        let tuned = tuned.map_err(|why| Failure::new(Exit::Graph, why))?;
        write_whole(&paths.tuned, tuned.as_bytes())?;
        wrote.push(&paths.tuned);
    }
    let table = table::text(outcome);
    if let Some(path) = &args.json {
        let text = format!("{:#}\n", outcome.to_json());
        match json_file {
            None => std::io::stdout().write_all(text.as_bytes())?,
            Some(file) => {
                fill(file, text.as_bytes())?;
                wrote.push(path);
            }
        }
    }
    match args.json.as_ref().is_some_and(|path| is_stdout(path)) {
        true => crate::say!("{}", table.trim_end()),
        false => std::io::stdout().write_all(table.as_bytes())?,
    }
    if !args.quiet {
        wrote.into_iter().for_each(|path| crate::say!("wrote {}", path.display()));
    }
    Ok(())
}

/// A tuned graph that an earlier study wrote under the same name: removed where this one found no setting good enough, as it
/// would be taken for this study's; else it is said whose it is.
fn earlier_tuned(args: &StudyArgs, path: &Path, goal: Goal, interrupted: bool) -> Result<(), Failure> {
    let Ok(text) = std::fs::read(path) else { return Ok(()) };
    let shown = path.display();
    let is_own = String::from_utf8_lossy(&text).contains(tune::MARK);
    if goal == Goal::None || interrupted || !is_own {
        if !args.quiet {
            crate::say!("note: `{shown}` is not of this study; it was there before");
        }
        return Ok(());
    }
    let failed =
        |error| Failure::new(Exit::File, format!("`{shown}`, of an earlier study, cannot be removed: {error}"));
    std::fs::remove_file(path).map_err(failed)?;
    if !args.quiet {
        crate::say!("removed `{shown}`, which was of an earlier study");
    }
    Ok(())
}

/// Whether what was asked for was found.
fn verdict(outcome: &Outcome) -> Result<(), Failure> {
    let failed = |line: String| Err(Failure::new(Exit::Cook, line));
    let Some(best) = outcome.most_accurate() else {
        let why = outcome.runs.iter().find_map(|run| run.result.as_ref().err());
        return failed(format!("no setting could be cooked: {}", why.map_or("nothing was run", |why| why)));
    };
    if outcome.pick.is_some() {
        return Ok(());
    }
    let statistic = outcome.norm.statistic.name();
    let unit = if outcome.unit.is_empty() { String::new() } else { format!(" {}", outcome.unit) };
    let brief = table::brief;
    match outcome.goal {
        Goal::None => Ok(()),
        Goal::Tolerance(tolerance) if outcome.floor.is_some() && tolerance < outcome.floor() => failed(format!(
            "the tolerance {}{unit} is below the floor of the {statistic}, {}{unit}: such an error cannot be claimed; {}",
            brief(tolerance),
            brief(outcome.floor()),
            match outcome.is_beyond {
                true => "give the knobs finer values".to_owned(),
                false => format!(
                    "the reference is exact, and the floor is {}, which no value lowers: ask for more than it, or move the scene \
                     closer to its origin",
                    outcome.norm.measure.rounding_name()
                ),
            }
        )),
        Goal::Tolerance(tolerance) => failed(format!(
            "no setting has a {statistic} of at most {}{unit}; the best is run {best} with {}{unit}",
            brief(tolerance),
            table::shown_error(outcome, outcome.error(best).unwrap_or_default())
        )),
        Goal::Budget(ms) => {
            let fastest = outcome.front.first().copied().unwrap_or(best);
            failed(format!(
                "no setting takes at most {} ms a frame; the fastest is run {fastest} with {} ms",
                brief(ms),
                brief(outcome.ms(fastest).unwrap_or_default())
            ))
        }
    }
}
