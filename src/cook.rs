//! `convect cook`: cooks a graph and writes its outputs.

use std::collections::BTreeSet;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::Duration;

use engine::clock::Stopwatch;
use engine::cook::{Delivered, DiskCache, Engine, Report, Stopped};
use engine::geometry::WIDTH;
use engine::graph::{Graph, GraphOutput, Part};
use engine::memory::{Ceiling, size_text};
use engine::note::{Note, kind};
use engine::plan::Request;
use engine::time::Frame;
use formats::Format;
use formats::atomic::AtomicFile;
use formats::usd::DEFAULT_WIDTH;
use serde_json::Value;

use crate::args::{Frames, PartRange, Setting, Size};
use crate::failure::{Exit, Failure, cancelled_by_signal, exit_of_error};
use crate::output::{Writers, Written, add_targets, create_folder, failed, fill, write_whole};
use crate::pictures::{self, Pictures, Staged};
use crate::progress::Progress;
use crate::targets::Targets;
use crate::{load, memory, report, unread};

/// The arguments of `cook`.
#[derive(Debug, clap::Args)]
pub struct CookArgs {
    /// The graph file; - reads it from stdin
    graph: PathBuf,
    /// Frames to cook: 1-48, 1-48x2 (every second), 10, 10.5, 1- (to the scene's end), or a list: 1-4,10 [default: the scene's frames]
    #[arg(long, value_name = "FRAMES", allow_hyphen_values = true)]
    frames: Option<Frames>,
    /// Cook frames A to B as a part of the scene: a USD file samples whatever varies over the scene, even if it is constant in these frames, so that parts can be joined
    #[arg(long, value_name = "A-B", allow_hyphen_values = true, conflicts_with = "frames")]
    part: Option<PartRange>,
    /// Cook only this output; repeatable
    #[arg(long = "output", value_name = "NAME")]
    outputs: Vec<String>,
    /// Cook only this node, as far as the outputs need it, and keep its results in the cache, where a later cook of the
    /// outputs finds them; repeatable
    #[arg(long = "node", value_name = "ID", requires = "cache", requires = "no_write")]
    nodes: Vec<String>,
    /// Folder to write to; created if missing
    #[arg(long, value_name = "DIR", default_value = "out")]
    out: PathBuf,
    /// File format: usdc and usda have all frames in one file; obj, ply and json have one file per frame
    #[arg(long, value_name = "FORMAT", default_value = "usdc", value_parser = ["usdc", "usda", "obj", "ply", "json"])]
    format: String,
    /// Override a param (node.param=VALUE) or a control (name=VALUE): JSON or a bare word, such as wind.noise=billow; repeatable
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<Setting>,
    /// Number of threads [default: as many as the machine has]
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true, value_parser = clap::value_parser!(u16).range(0..=1024))]
    threads: u16,
    /// Limit on the memory for the results that a frame needs, such as 8G; a node that would exceed it is refused, but
    /// 16 MiB are always allowed [default: half of the machine's memory]
    #[arg(long, value_name = "SIZE")]
    memory: Option<Size>,
    /// Keep finished frames, states of solvers and windows, and slow results in this folder; an interrupted cook resumes from them
    #[arg(long, value_name = "DIR")]
    cache: Option<PathBuf>,
    /// Maximum size of the cache; the oldest files are deleted first
    #[arg(long, value_name = "SIZE", requires = "cache")]
    cache_limit: Option<Size>,
    /// Cook without writing outputs, for the report, the pictures or the cache
    #[arg(long)]
    no_write: bool,
    /// Write a report to this file as JSON: time, memory and metrics of each node; - writes it to stdout
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Print the time of each node, and which of its stages were left out and why
    #[arg(short, long, conflicts_with = "quiet")]
    verbose: bool,
    /// Print only errors
    #[arg(short, long)]
    quiet: bool,
    /// Exit with code 4 if there are notes; files are written all the same
    #[arg(long)]
    strict: bool,
    // Last, because its heading would apply to the options that follow.
    #[command(flatten)]
    pictures: pictures::PictureArgs,
}

/// Memory for each frame of an output, besides its geometry: its files, metrics and place in a USD file.
const BYTES_PER_FRAME: usize = 128;

/// Cooks a graph.
///
/// # Errors
/// If the graph has faults, a file cannot be written, a node cannot cook, or the cook is interrupted.
pub fn run(args: &CookArgs) -> Result<(), Failure> {
    let format: Format = args.format.parse().map_err(|error| Failure::new(Exit::CommandLine, format!("{error}")))?;
    let ceiling = memory::ceiling(args.memory);
    let engine = load::engine(usize::from(args.threads), ceiling)?.comparing_samples(args.report.is_some());
    let bytes = load::bytes(&args.graph)?;
    let graph = load::loaded(&bytes, &args.graph, &args.set).map_err(|faults| load::faulty(&args.graph, &faults))?;
    let recipe = report::recipe(&bytes, &args.set);
    drop(bytes);
    let request = Request {
        outputs: load::outputs(&graph, &args.outputs)?,
        frames: match args.part {
            Some(part) => part.frames(),
            None => Frames::of_scene(args.frames.as_ref(), &graph.scene)?,
        },
    };
    fits(&request, &ceiling)?;
    let mut faults = load::as_read_from(&args.graph, engine.verify(&graph, Some(&request)));
    if !args.no_write {
        faults.extend(load::format_faults(&graph, &request.outputs, format));
    }
    if !faults.is_empty() {
        return Err(load::faulty(&args.graph, &faults));
    }
    let staged = Staged::of(&args.pictures, &graph, &request);
    if staged.is_some() && !args.nodes.is_empty() {
        let line = "--node cooks no output that could be drawn; leave out the pictures, or --node";
        return Err(Failure::new(Exit::CommandLine, line));
    }
    let pictures = staged.as_ref().map(|staged| Pictures::new(&args.pictures, staged, &args.graph, &args.out, ceiling));
    let pictures = pictures.transpose()?;
    // The pictures' guides are cooked along.
    let cooked = staged.as_ref().map_or((&graph, &request), |staged| (&staged.graph, &staged.request));
    cook(args, &engine, [(&graph, &request), cooked], format, pictures, recipe)
}

/// Refuses more frames than memory can keep account of.
fn fits(request: &Request, ceiling: &Ceiling) -> Result<(), Failure> {
    let count = request.frames.len();
    let bytes = count.saturating_mul(request.outputs.len()).saturating_mul(BYTES_PER_FRAME);
    if ceiling.allows(bytes) {
        return Ok(());
    }
    let line = format!(
        "the results of {count} frames would take {} besides their geometry, but {}; cook fewer at a time with --frames \
         or --part, or raise --memory",
        size_text(bytes),
        ceiling.describe()
    );
    Err(Failure::new(Exit::CommandLine, line))
}

fn cook(
    args: &CookArgs,
    engine: &Engine,
    [(graph, request), cooked]: [(&Graph, &Request); 2],
    format: Format,
    mut pictures: Option<Pictures<'_>>,
    recipe: Value,
) -> Result<(), Failure> {
    // From here on a signal lets the cook end in order, without temporaries.
    let cancel = cancelled_by_signal();
    let targets = targets(args, graph, request, format, pictures.as_ref());
    targets.check()?;
    targets.sweep();
    let limit = args.cache_limit.map_or(u64::MAX, |size| size.0);
    let mut disk = args.cache.as_ref().map(|folder| DiskCache::open(folder, limit));
    let nodes = load::nodes(graph, &args.nodes)?;
    let mut writers = match args.no_write {
        true if !nodes.is_empty() => Writers::none(graph, &[], format),
        true => Writers::none(graph, &request.outputs, format),
        false => Writers::new(graph, &request.outputs, &args.out, format)?,
    };
    if args.no_write && (pictures.is_some() || !args.nodes.is_empty()) {
        create_folder(&args.out)?;
    }
    // Before the cook, so that an invalid path is reported at once.
    let report_path = args.report.as_ref().filter(|path| !is_stdout(path));
    let report_file = report_path.map(AtomicFile::create).transpose().map_err(|error| failed(&error))?;
    let progress = Progress::new((request.frames.len() * request.outputs.len()) as u64, args.quiet);
    let mut writing = Duration::ZERO;
    let mut sink = |finished: &[Delivered]| -> Result<(), Failure> {
        let watch = Stopwatch::start();
        writers.take(finished)?;
        if let Some(pictures) = &mut pictures {
            pictures.take(finished)?;
        }
        progress.add(finished.iter().filter(|one| one.output < graph.outputs.len()).count() as u64);
        writing += watch.wall();
        Ok(())
    };
    let cooked = match &mut disk {
        Some(disk) if !nodes.is_empty() => {
            engine.cook_nodes(graph, (request, &nodes), disk, &cancel).map_err(Stopped::Asked)
        }
        _ => engine.cook(cooked.0, cooked.1, disk.as_mut(), &cancel, &mut sink),
    };
    drop(progress);
    let mut report = cooked.map_err(|stopped| match stopped {
        Stopped::Asked(error) => Failure::new(exit_of_error(&error), error.to_string()),
        Stopped::Sink(mut failure) => {
            failure.lines.extend(writers.after_failure());
            failure
        }
    })?;
    report.errors.retain(|(output, _, _)| *output < graph.outputs.len());
    let watch = Stopwatch::start();
    let incomplete: Vec<usize> = report.errors.iter().map(|(output, _, _)| *output).collect();
    let (written, unwritten) = writers.finish(&incomplete, &varying(args, graph, &report));
    report.notes.extend(left_out(graph, &written, format));
    report.notes.extend(without_width(graph, &written, format));
    report.notes.extend(unread::notes(graph, &report));
    let drawn = pictures.map_or(Ok(Vec::new()), |pictures| pictures.write(report.cancelled, &cancel));
    // What could not be drawn is said after all else is written.
    let (drawn, undrawn) = drawn.map_or_else(|failure| (Vec::new(), Err(failure)), |drawn| (drawn, Ok(())));
    report.cancelled |= cancel.load(Ordering::Relaxed);
    writing += watch.wall();
    let mut reported = Ok(());
    if args.report.is_some() {
        let tips = match tips_path(args).map(|path| write_tips(&path, &report)).transpose() {
            Ok(tips) => tips.flatten(),
            Err(failure) => {
                reported = Err(failure);
                None
            }
        };
        let cooked = report::Cooked {
            graph_path: load::graph_name(&args.graph),
            recipe,
            graph,
            frames: &request.frames,
            written: &written,
            threads: engine.threads(),
            writing,
            tips: tips.as_deref(),
        };
        let text = serde_json::to_string_pretty(&report::to_json(&report, &cooked)).unwrap_or_default();
        let text = format!("{text}\n");
        match report_file {
            // What was written is said all the same.
            Some(file) => reported = reported.and(fill(file, text.as_bytes())),
            None => reported = std::io::stdout().write_all(text.as_bytes()).map_err(Failure::from),
        }
    }
    if !args.quiet {
        report.notes.iter().for_each(|note| crate::say!("note: {note}"));
        if !nodes.is_empty() {
            crate::say!("{}", times(request.frames.len(), report.cooking, None));
        }
        print_summary(&report, &written, &drawn, writing, args.verbose);
    }
    let mut ends = vec![outcome(args, graph, &report, &written), reported];
    if let Some(mut failure) = unwritten {
        let lacks_files = |written: &&Written| written.files.is_empty();
        let of = |written: &Written| format!("output `{}` was not written", written.name(graph));
        failure.lines.extend(written.iter().filter(lacks_files).map(of));
        ends.insert(0, Err(failure));
    }
    failed_together(ends)?;
    undrawn?;
    load::strict(args.strict, &report.notes)
}

/// All failures as one, with the lines of each once.
fn failed_together(ends: Vec<Result<(), Failure>>) -> Result<(), Failure> {
    let mut all: Option<Failure> = None;
    for failure in ends.into_iter().filter_map(Result::err) {
        match &mut all {
            Some(all) => {
                all.exit = all.exit.min(failure.exit);
                let new: Vec<String> = failure.lines.into_iter().filter(|line| !all.lines.contains(line)).collect();
                all.lines.extend(new);
            }
            None => all = Some(failure),
        }
    }
    all.map_or(Ok(()), Err)
}

/// Where a part keeps the tips of its first and last frame, which merge compares with those of its neighbours: beside its
/// report.
fn tips_path(args: &CookArgs) -> Option<PathBuf> {
    let path = args.part.and(args.report.as_ref()).filter(|path| !is_stdout(path))?;
    let mut name = path.clone().into_os_string();
    name.push(".tips");
    Some(name.into())
}

/// Writes the tips of a part, if a node has any; the name of the file.
fn write_tips(path: &Path, report: &Report) -> Result<Option<String>, Failure> {
    let tips = report.end_tips();
    if tips.0.is_empty() {
        return Ok(None);
    }
    write_whole(path, &tips.to_bytes())?;
    Ok(path.file_name().map(|name| name.to_string_lossy().into_owned()))
}

/// Whether a report is to be written to stdout.
fn is_stdout(path: &Path) -> bool {
    path == Path::new("-")
}

/// The outputs of a part that vary over the scene.
fn varying(args: &CookArgs, graph: &Graph, report: &Report) -> Vec<usize> {
    let varies = |output: &usize| report.nodes.get(graph.outputs[*output].from.node).is_some_and(|node| node.varies);
    (0..graph.outputs.len()).filter(|output| args.part.is_some() && varies(output)).collect()
}

/// Everything that the cook reads and writes.
fn targets(args: &CookArgs, graph: &Graph, request: &Request, format: Format, pictures: Option<&Pictures>) -> Targets {
    let mut targets = Targets::default();
    if !load::is_stdin(&args.graph) {
        targets.reads(&args.graph, "it is the graph");
    }
    graph.files().into_iter().for_each(|path| targets.reads(path, "the graph reads it"));
    if !args.no_write {
        add_targets(&mut targets, graph, &request.outputs, &args.out, format, &request.frames);
    }
    pictures.iter().for_each(|pictures| pictures.add_targets(&mut targets));
    if let Some(path) = args.report.as_ref().filter(|path| !is_stdout(path)) {
        targets.writes("--report", Exit::CommandLine, path);
    }
    if let Some(path) = tips_path(args) {
        targets.writes("--report", Exit::CommandLine, &path);
    }
    targets
}

/// A note for each output that the format could not store completely.
fn left_out(graph: &Graph, written: &[Written], format: Format) -> Vec<Note> {
    let lossy = written.iter().filter(|written| !written.lost.is_empty());
    let note = |written: &Written| {
        let (name, lost) = (written.name(graph), written.lost.join(", "));
        let text = format!("output `{name}` was written without {lost}, which {format} cannot hold; usdc and json can");
        Note::new(kind::NOT_WRITTEN, text)
    };
    lossy.map(note).collect()
}

/// A note for each output whose curves got a width in the file because they have none.
fn without_width(graph: &Graph, written: &[Written], format: Format) -> Vec<Note> {
    let note = |(output, frames): (&usize, &Vec<Frame>)| {
        let GraphOutput { name, attributes, .. } = &graph.outputs[*output];
        let text = format!("output `{name}`: its curves have no `width`, so {format} got {DEFAULT_WIDTH} m for them");
        let hint = match attributes {
            Some(names) if !names.iter().any(|name| **name == *WIDTH.name) => {
                "Add `width` to the output's `attributes`."
            }
            _ => "Set `width` in Curve_Scatter or Curve_In, or make it with Attribute_Expr: `width = 0.002`.",
        };
        Note::new(kind::NO_WIDTH, text).at(frames.clone()).hint(hint)
    };
    written.iter().flat_map(|written| &written.without_width).map(note).collect()
}

/// Prints what was written, and the speed, to stderr.
fn print_summary(report: &Report, written: &[Written], drawn: &[PathBuf], writing: Duration, verbose: bool) {
    for written in written {
        if let (Some(first), Some(last)) = (written.files.first(), written.files.last()) {
            let files = match written.files.len() {
                1 => first.display().to_string(),
                n => format!("{} … {} ({n} files)", first.display(), last.display()),
            };
            let frames = written.frames.len();
            let s = if frames == 1 { "" } else { "s" };
            crate::say!("wrote {files}: {frames} frame{s}, {}", indicatif::HumanBytes(written.bytes));
        }
    }
    drawn.iter().for_each(|path| crate::say!("wrote {}", path.display()));
    let frames: BTreeSet<Frame> = written.iter().flat_map(|written| written.frames.iter().copied()).collect();
    if !frames.is_empty() {
        let wrote_any = !drawn.is_empty() || written.iter().any(|written| !written.files.is_empty());
        crate::say!("{}", times(frames.len(), report.cooking, wrote_any.then_some(writing)));
    }
    if verbose {
        for node in report.nodes.iter().filter(|node| node.needed) {
            let id = node.id.as_deref().unwrap_or_default();
            crate::say!("  {id} ({}): {} cooked, {:.1} ms", node.type_name, node.cooks, node.wall.as_secs_f64() * 1e3);
            node.left_out.iter().for_each(|stage| crate::say!("    left out {}: {}", stage.stage, stage.why));
        }
    }
}

/// `cooked 72 frames in 1.77 s (41 per second), wrote them in 13.2 s`.
fn times(frames: usize, cooking: Duration, writing: Option<Duration>) -> String {
    let (s, them) = if frames == 1 { ("", "it") } else { ("s", "them") };
    let seconds = cooking.as_secs_f64();
    let rate = match frames as f64 / seconds {
        rate if !rate.is_finite() => String::new(),
        rate if rate < 1.0 => format!(" ({:.1} s per frame)", 1.0 / rate),
        rate => format!(" ({rate:.0} per second)"),
    };
    let wrote = writing.map(|writing| format!(", wrote {them} in {:.2} s", writing.as_secs_f64())).unwrap_or_default();
    format!("cooked {frames} frame{s} in {seconds:.2} s{rate}{wrote}")
}

/// The errors of nodes and the exit code.
fn outcome(args: &CookArgs, graph: &Graph, report: &Report, written: &[Written]) -> Result<(), Failure> {
    let mut lines = Vec::new();
    let mut exit = None;
    let mut reported: Vec<String> = Vec::new();
    for (output, error, frames) in &report.errors {
        let text = error.to_string();
        if !reported.contains(&text) {
            let more = match frames - 1 {
                0 => String::new(),
                1 => " (and at 1 more frame)".into(),
                more => format!(" (and at {more} more frames)"),
            };
            let part = match error.error.param {
                Some(param) => Part::Param(&error.node, param),
                None => Part::Node(&error.node),
            };
            let place = graph.place(&load::graph_name(&args.graph), part);
            lines.push(format!("{place}: {text}{more}"));
            reported.push(text);
        }
        let code = exit_of_error(error);
        exit = Some(exit.map_or(code, |exit: Exit| exit.min(code)));
        if args.no_write {
            continue;
        }
        let kept = written.iter().any(|written| written.outputs.contains(output) && !written.files.is_empty());
        let name = graph.outputs[*output].file();
        let line = match kept {
            true => format!("output `{name}` lacks the frames that failed"),
            false => format!("output `{name}` was not written"),
        };
        if !lines.contains(&line) {
            lines.push(line);
        }
    }
    if report.cancelled {
        let frames = written.iter().map(|written| written.frames.len()).max().unwrap_or(0);
        let frames = if frames == 1 { "1 complete frame was".into() } else { format!("{frames} complete frames were") };
        lines.push(match args.no_write {
            true => "interrupted".into(),
            false => format!("interrupted; {frames} written"),
        });
        exit = Some(exit.map_or(Exit::Interrupted, |exit| exit.min(Exit::Interrupted)));
    }
    match exit {
        Some(exit) => Err(Failure { exit, lines }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cooking_and_writing_are_told_apart() {
        let ms = Duration::from_millis;
        let quick = times(72, ms(1770), Some(ms(13_204)));
        assert_eq!(quick, "cooked 72 frames in 1.77 s (41 per second), wrote them in 13.20 s");
        assert_eq!(times(1, ms(4000), Some(ms(10))), "cooked 1 frame in 4.00 s (4.0 s per frame), wrote it in 0.01 s");
        assert_eq!(times(2, ms(0), None), "cooked 2 frames in 0.00 s");
    }
}
