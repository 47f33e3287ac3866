//! `convect job`: cuts a cook into tasks and writes them for an engine that runs commands. It submits nothing.
//!
//! A solver is one task of all frames, because it cooks its frames in order; so are outputs that do not vary. The others
//! are cut into parts of frames, whose length is a multiple of the spacing at which windows start, so that no part warms up
//! a window for a few frames. Parts behind a solver find its frames in the cache. The last step merges the parts.

mod cut;
pub(crate) mod expect;
mod list;
mod openjd;
mod slurm;

use std::path::PathBuf;

use engine::graph::Graph;
use engine::plan::Request;

use crate::args::{PartRange, Setting};
use crate::failure::{Exit, Failure, exit_of_error};
use crate::output::{create_folder, write_whole};
use crate::{load, memory};
use cut::Cut;

/// The arguments of `job`.
#[derive(Debug, clap::Args)]
pub struct JobArgs {
    /// The graph file
    graph: PathBuf,
    /// The engine: `list` is a file of shell commands, one per line; `openjd` an Open Job Description template; `slurm`
    /// a script that submits the job
    #[arg(long, value_name = "ENGINE", value_parser = ["list", "openjd", "slurm"])]
    engine: String,
    /// Folder for the job's file, and with `list` and `slurm` for its results
    #[arg(long, value_name = "DIR", default_value = "out")]
    out: PathBuf,
    /// The frames to cook [default: the scene's]
    #[arg(long, value_name = "A-B", allow_hyphen_values = true)]
    frames: Option<PartRange>,
    /// Frames of a part [default: at least 16, a multiple of the spacing at which windows start]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    chunk: Option<u32>,
    /// Cook everything once for each of these values: node.param=V1,V2 or control=V1,V2; values with commas inside as one JSON list
    #[arg(long, value_name = "KEY=VALUES")]
    wedge: Option<Setting>,
    /// Override a param (node.param=VALUE) or a control (name=VALUE): JSON or a bare word, such as wind.noise=billow; repeatable
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<Setting>,
    /// Print only errors
    #[arg(short, long)]
    quiet: bool,
}

/// What is cooked several times: a key of `--set` and its values.
#[derive(Clone, Debug, PartialEq)]
struct Wedges {
    key: String,
    values: Vec<String>,
}

/// A job, as all engines write it.
#[derive(Debug)]
struct Job {
    /// The graph's name without extension.
    name: String,
    graph: PathBuf,
    out: PathBuf,
    settings: Vec<String>,
    wedges: Option<Wedges>,
    cut: Cut,
}

/// Of one task: the program's arguments, where `graph`, `out` and `cache` stand for those paths.
struct Placeholders<'a> {
    graph: &'a str,
    /// The folder of the wedge, where there are wedges.
    out: &'a str,
    cache: &'a str,
    wedge: Option<&'a str>,
}

impl Job {
    /// The arguments of a task that cooks a part of a step.
    fn cook(&self, step: &cut::Step, part: &str, places: &Placeholders<'_>) -> Vec<String> {
        let folder = format!("{}/parts/{part}", places.out);
        let mut args = vec!["cook".to_owned(), places.graph.to_owned(), "--part".into(), part.to_owned()];
        for output in &step.outputs {
            args.extend(["--output".into(), output.clone()]);
        }
        for node in &step.nodes {
            args.extend(["--node".into(), node.clone()]);
        }
        args.extend(["--out".into(), folder.clone(), "--cache".into(), places.cache.to_owned()]);
        if !step.nodes.is_empty() {
            args.push("--no-write".into());
        }
        args.extend(["--report".into(), format!("{folder}/report.{}.json", step.name), "--quiet".into()]);
        for setting in &self.settings {
            args.extend(["--set".into(), setting.clone()]);
        }
        if let (Some(wedges), Some(value)) = (&self.wedges, places.wedge) {
            args.extend(["--set".into(), format!("{}={value}", wedges.key)]);
        }
        args
    }

    /// The arguments of the task that merges.
    fn merge(&self, places: &Placeholders<'_>) -> Vec<String> {
        let (first, last) = self.cut.frames;
        ["merge", places.out, "--frames", &format!("{first}-{last}"), "--quiet"].map(str::to_owned).to_vec()
    }

    /// The folder of a wedge in `out`.
    fn wedge_folder(&self, out: &str, value: &str) -> String {
        self.wedges.as_ref().map_or_else(|| out.to_owned(), |wedges| format!("{out}/wedges/{}={value}", wedges.key))
    }
}

/// Writes the file of a job.
///
/// # Errors
/// If the graph has faults, or the file cannot be written.
pub fn run(args: &JobArgs) -> Result<(), Failure> {
    if load::is_stdin(&args.graph) {
        return Err(Failure::new(Exit::CommandLine, "a job needs a graph that its tasks can read: write it to a file"));
    }
    let wedges = args.wedge.as_ref().map(wedges).transpose()?;
    let engine = load::engine(0, memory::ceiling(None))?;
    let with = |last: Option<Setting>| {
        let set: Vec<Setting> = args.set.iter().cloned().chain(last).collect();
        load::graph(&args.graph, &set)?.map_err(|faults| load::faulty(&args.graph, &faults))
    };
    // A value that does not fit would be found by each of its tasks.
    let settings = wedges.iter().flat_map(|wedges| wedges.values.iter().map(|value| (&wedges.key, value)));
    let graphs = settings.map(|(key, value)| with(Some(Setting(key.clone(), value.clone()))));
    let graphs = graphs.collect::<Result<Vec<Graph>, Failure>>()?;
    let graph = graphs.into_iter().next().map_or_else(|| with(None), Ok)?;
    let frames = engine::frames::FrameSet::whole(graph.scene.first, graph.scene.last);
    let request = Request { outputs: load::outputs(&graph, &[])?, frames: frames.iter().take(cut::PLANNED).collect() };
    let report = engine.rehearse(&graph, &request);
    let report = report.map_err(|error| Failure::new(exit_of_error(&error), error.to_string()))?;
    let frames = args.frames.map_or((graph.scene.first, graph.scene.last), PartRange::ends);
    let cut = Cut::of(&graph, &report, frames, args.chunk.map(i64::from));
    let job = Job {
        name: args.graph.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
        graph: args.graph.clone(),
        out: args.out.clone(),
        settings: args.set.iter().map(|Setting(key, value)| format!("{key}={value}")).collect(),
        wedges,
        cut,
    };
    let (ending, text) = match &*args.engine {
        "openjd" => ("openjd.yaml", openjd::text(&job)),
        "slurm" => ("slurm.sh", slurm::text(&job)),
        _ => ("list.txt", list::text(&job)),
    };
    create_folder(&args.out)?;
    let path = args.out.join(format!("{}.{ending}", job.name));
    write_whole(&path, text.as_bytes())?;
    if !args.quiet {
        job.cut.notes.iter().for_each(|note| crate::say!("note: {note}"));
        for step in &job.cut.steps {
            let s = if step.parts.len() == 1 { "" } else { "s" };
            let what = if step.nodes.is_empty() { &step.outputs } else { &step.nodes };
            crate::say!("step {}: {} in {} task{s}", step.name, what.join(", "), step.parts.len());
        }
        crate::say!("wrote {}", path.display());
    }
    Ok(())
}

/// `KEY=V1,V2`, or `KEY=[JSON, JSON]`.
fn wedges(Setting(key, values): &Setting) -> Result<Wedges, Failure> {
    let listed = match serde_json::from_str::<serde_json::Value>(values) {
        Ok(serde_json::Value::Array(values)) => values.iter().map(ToString::to_string).collect(),
        _ => values.split(',').map(|value| value.trim().to_owned()).collect::<Vec<String>>(),
    };
    // They become names of folders, and parts of commands.
    let is_name = |value: &&String| !value.is_empty() && !value.contains(['/', '\\', '\'', '"', '\n', '{', '}']);
    match listed.iter().find(|value| !is_name(value)) {
        Some(wrong) => {
            let line = format!("`{wrong}` of --wedge cannot be the name of a folder; write numbers or words");
            Err(Failure::new(Exit::CommandLine, line))
        }
        None => match listed.iter().enumerate().find(|(n, value)| listed[..*n].contains(value)) {
            Some((_, twice)) => {
                let line = format!("--wedge has `{twice}` twice, whose tasks would write the same files; remove one");
                Err(Failure::new(Exit::CommandLine, line))
            }
            None => Ok(Wedges { key: key.clone(), values: listed }),
        },
    }
}

/// A text as one word of a shell.
fn quoted(text: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,+%@".contains(c);
    if !text.is_empty() && text.chars().all(is_plain) {
        text.to_owned()
    } else {
        format!("'{}'", text.replace('\'', "'\\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wedges_are_words_or_json() {
        let of = |values: &str| wedges(&Setting("wind.amplitude".into(), values.into())).map(|wedges| wedges.values);
        assert_eq!(of("0.2, 0.4").unwrap(), ["0.2", "0.4"]);
        assert_eq!(of("[[1,0,0],[0,0,1]]").unwrap(), ["[1,0,0]", "[0,0,1]"]);
        assert_eq!(of("perlin,billow").unwrap(), ["perlin", "billow"]);
        assert!(of("a/b").is_err() && of("").is_err() && of("1,2,1").is_err());
    }

    #[test]
    fn words_of_a_shell_are_quoted_where_they_must_be() {
        assert_eq!(quoted("out/parts/1-16"), "out/parts/1-16");
        assert_eq!(quoted("a b"), "'a b'");
        assert_eq!(quoted("it's"), "'it'\\''s'");
        assert_eq!(quoted(""), "''");
    }
}
