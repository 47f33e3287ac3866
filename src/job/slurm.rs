//! A job as a shell script that submits itself to Slurm: once to submit, then as each task.

use std::fmt::Write as _;

use super::{Job, Placeholders, quoted};

const HEAD: &str = r#"#!/bin/bash
# Submits the job to Slurm: bash THIS_FILE. Variables that may be set before: CONVECT (the program), GRAPH, OUT, CACHE, and
# SBATCH_OPTIONS (such as "--partition=short --mem=8G"). All machines must see GRAPH, OUT and CACHE under the same paths.
#
# Exit codes 0, 2, 3 and 4 of convect are final. 1, 130 and signals are worth a retry: such a task is queued again, three
# times at most, and goes on from CACHE.
set -uo pipefail
"#;

const TASK: &str = r#"
run() {
    "$CONVECT" "$@" &
    child=$!
    # The signal before the time limit lets convect finish its files.
    trap 'kill -TERM "$child" 2>/dev/null' TERM
    code=0
    wait "$child" || code=$?
    while kill -0 "$child" 2>/dev/null; do
        code=0
        wait "$child" || code=$?
    done
    case "$code" in
    0 | 2 | 3 | 4) exit "$code" ;;
    esac
    if [ "${SLURM_RESTART_COUNT:-0}" -lt 3 ]; then
        scontrol requeue "${SLURM_ARRAY_JOB_ID:-$SLURM_JOB_ID}${SLURM_ARRAY_TASK_ID:+_$SLURM_ARRAY_TASK_ID}"
    fi
    exit "$code"
}
"#;

const SUBMIT: &str = r#"
submit() {
    # shellcheck disable=SC2086
    sbatch --parsable --requeue --signal=B:TERM@60 --kill-on-invalid-dep=yes ${SBATCH_OPTIONS:-} "$@"
}
mkdir -p "$OUT" "$CACHE" || exit 1
after=
"#;

pub(super) fn text(job: &Job) -> String {
    let mut text = HEAD.to_owned();
    let out = job.out.display().to_string();
    for (name, value) in [
        ("CONVECT", "convect".to_owned()),
        ("GRAPH", job.graph.display().to_string()),
        ("OUT", out.clone()),
        ("CACHE", format!("{out}/cache")),
    ] {
        let _ = writeln!(text, "[ -n \"${{{name}:-}}\" ] || {name}={}", quoted(&value));
    }
    text += "export CONVECT GRAPH OUT CACHE\n";
    text += TASK;
    let wedges: &[String] = job.wedges.as_ref().map_or(&[], |wedges| &wedges.values);
    let words = |list: &[String]| list.iter().map(|word| quoted(word)).collect::<Vec<String>>().join(" ");
    let _ = writeln!(text, "\nwedges=({})", words(wedges));
    let _ =
        writeln!(text, "if [ \"${{1:-}}\" = task ]; then\n    index=${{SLURM_ARRAY_TASK_ID:-0}}\n    case \"$2\" in");
    // Of an array of parts and wedges, parts count first.
    let folder =
        job.wedges.as_ref().map_or_else(|| "$OUT".to_owned(), |wedges| format!("$OUT/wedges/{}=$wedge", wedges.key));
    let places =
        Placeholders { graph: "$GRAPH", out: &folder, cache: "$CACHE", wedge: job.wedges.as_ref().map(|_| "$wedge") };
    for step in &job.cut.steps {
        let parts = step.labels();
        let _ = writeln!(text, "    {})\n        parts=({})", step.name, words(&parts));
        let _ = writeln!(text, "        part=${{parts[index % {}]}}", parts.len());
        if !wedges.is_empty() {
            let _ = writeln!(text, "        wedge=${{wedges[index / {}]}}", parts.len());
        }
        let _ = writeln!(
            text,
            "        run {}\n        ;;",
            double_quoted(&job.cook(step, "$part", &places), &job.settings)
        );
    }
    text += "    merge)\n";
    if !wedges.is_empty() {
        text += "        wedge=${wedges[index]}\n";
    }
    let _ =
        writeln!(text, "        run {}\n        ;;\n    esac\n    exit 2\nfi", double_quoted(&job.merge(&places), &[]));
    text += SUBMIT;
    let runs = wedges.len().max(1);
    for (at, step) in job.cut.steps.iter().enumerate() {
        let tasks = step.parts.len() * runs;
        let behind = step.after.map(|before| format!(" --dependency=\"afterok:$step{before}\"")).unwrap_or_default();
        let _ = writeln!(
            text,
            "id=$(submit --job-name={} --array=0-{}%50{behind} \"$0\" task {}) || exit 1\n\
             step{at}=${{id%%;*}} after=\"$after:${{id%%;*}}\"",
            quoted(&format!("{}.{}", job.name, step.name)),
            tasks - 1,
            step.name
        );
    }
    let _ = writeln!(
        text,
        "submit --job-name={} --array=0-{} --dependency=\"afterok$after\" \"$0\" task merge",
        quoted(&format!("{}.merge", job.name)),
        runs - 1
    );
    text
}

/// Words in which variables are replaced, but in those of `settings`.
fn double_quoted(words: &[String], settings: &[String]) -> String {
    let quoted = |word: &String| match word.contains('$') && !settings.contains(word) {
        true => format!("\"{word}\""),
        false => quoted(word),
    };
    words.iter().map(quoted).collect::<Vec<String>>().join(" ")
}
