//! The table of a study, for people.

use std::fmt::Write as _;

use engine::memory::size_text;

use super::bench::NodeCost;
use super::outcome::{Goal, Outcome};
use super::search;
use crate::numbers::short;

/// Three significant digits: times and errors are not known to more.
pub(super) fn brief(number: f64) -> String {
    short(format!("{number:.2e}").parse().unwrap_or(number))
}

/// The table and what follows from it.
pub(super) fn text(outcome: &Outcome) -> String {
    let mut text = String::new();
    let unit = |unit: &str| if unit.is_empty() { String::new() } else { format!(" {unit}") };
    let unit = unit(outcome.unit);
    let (measure, statistic) = (outcome.norm.measure.name(), outcome.norm.statistic.name());
    let frames = outcome.frames.len();
    let _ = writeln!(
        text,
        "{}, output `{}`, {frames} frame{}; error: {measure}{}, times in ms a frame",
        outcome.graph,
        outcome.output,
        if frames == 1 { "" } else { "s" },
        if unit.is_empty() { String::new() } else { format!(" in{unit}") },
    );
    if outcome.knobs.len() > 1 {
        let settings = outcome.knobs.iter().fold(1_usize, |product, knob| product.saturating_mul(knob.values.len()));
        let _ = match search::grid_size(&outcome.knobs, outcome.goal) {
            Some(size) => writeln!(text, "a grid of {size} settings"),
            None => writeln!(text, "a search: {} of {settings} settings were cooked", outcome.runs.len()),
        };
    }
    let mut rows = vec![header(outcome)];
    rows.extend((0..outcome.runs.len()).map(|run| row(outcome, run)));
    align(&rows, &mut text);
    let _ = match outcome.floor {
        Some(floor) => writeln!(
            text,
            "floor: mean {}, p99 {}, max {}{unit}; errors below it cannot be told apart",
            brief(floor.mean),
            brief(floor.p99),
            brief(floor.max)
        ),
        None => writeln!(text, "floor: unknown; errors are differences from the best setting, not from the truth"),
    };
    let _ = writeln!(text, "reference: {}", outcome.why);
    for slope in outcome.slopes() {
        let _ = writeln!(text, "order of {}: {}", slope.knob, slope.describe());
    }
    sources(outcome, &mut text);
    if let Some(chaos) = outcome.chaos() {
        let _ = writeln!(text, "chaos: {chaos}");
    }
    match (outcome.pick, outcome.goal) {
        (Some(pick), goal) => {
            let error = shown_error(outcome, outcome.error(pick).unwrap_or_default());
            let of = match goal {
                Goal::Tolerance(tolerance) => {
                    format!("the cheapest with a {statistic} of at most {}{unit}", brief(tolerance))
                }
                Goal::Budget(ms) => format!("the most accurate within {} ms a frame", brief(ms)),
                Goal::None => String::new(),
            };
            let ms = outcome.ms(pick).map(brief).unwrap_or_default();
            let cpu = outcome.runs[pick].cost().map(|cost| brief(cost.cpu_ms)).unwrap_or_default();
            let _ =
                writeln!(text, "pick: run {pick}, {of}: {statistic} {error}{unit}, {ms} ms a frame, CPU time {cpu} ms");
        }
        (None, Goal::None) => {}
        (None, _) => {
            let _ = writeln!(text, "pick: none");
        }
    }
    text
}

/// An error, never below the floor.
pub(super) fn shown_error(outcome: &Outcome, error: f64) -> String {
    let floor = outcome.floor();
    at_least(error, outcome.floor.map(|_| floor))
}

fn at_least(error: f64, floor: Option<f64>) -> String {
    match floor {
        Some(floor) if error <= floor && floor > 0.0 => format!("<= {}", brief(floor)),
        _ => brief(error),
    }
}

fn header(outcome: &Outcome) -> Vec<String> {
    let knobs = outcome.knobs.iter().map(|knob| knob.key.clone());
    let rest = ["mean", "p99", "max", "ms", "cpu ms", "memory", ""].map(String::from);
    ["run".to_owned()].into_iter().chain(knobs).chain(rest).collect()
}

fn row(outcome: &Outcome, index: usize) -> Vec<String> {
    let run = &outcome.runs[index];
    let mut cells = vec![index.to_string()];
    cells.extend(outcome.knobs.iter().zip(&run.setting).map(|(knob, value)| knob.values[*value].clone()));
    match &run.result {
        Ok((cost, errors)) => {
            let floor = outcome.floor;
            cells.push(at_least(errors.mean, floor.map(|floor| floor.mean)));
            cells.push(at_least(errors.p99, floor.map(|floor| floor.p99)));
            cells.push(at_least(errors.max, floor.map(|floor| floor.max)));
            cells.extend([brief(cost.ms), brief(cost.cpu_ms), size_text(cost.peak_bytes)]);
            cells.push(match (outcome.pick == Some(index), outcome.front.contains(&index)) {
                (true, _) => "pick".into(),
                (false, true) => "front".into(),
                (false, false) => String::new(),
            });
        }
        Err(why) => {
            cells.extend(["-"; 6].map(String::from));
            cells.push(format!("failed: {why}"));
        }
    }
    cells
}

/// Writes rows with aligned columns: the last to the left, all others to the right.
fn align(rows: &[Vec<String>], text: &mut String) {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width = |column: usize| rows.iter().filter_map(|row| row.get(column)).map(|cell| cell.chars().count()).max();
    let widths: Vec<usize> = (0..columns).map(|column| width(column).unwrap_or(0)).collect();
    for row in rows {
        let mut line = String::new();
        for (column, cell) in row.iter().enumerate() {
            let _ = match column + 1 == columns {
                true => write!(line, "  {cell}"),
                false => write!(line, "{}{cell:>width$}", if column == 0 { "" } else { "  " }, width = widths[column]),
            };
        }
        let _ = writeln!(text, "{}", line.trim_end());
    }
}

/// Which nodes the time and which knobs the error come from.
fn sources(outcome: &Outcome, text: &mut String) {
    const SHARE: f64 = 0.03;
    let shown = outcome.pick.or_else(|| outcome.most_accurate());
    if let Some((run, cost)) = shown.and_then(|run| Some((run, outcome.runs[run].cost()?))) {
        let all: f64 = cost.nodes.iter().map(|node| node.ms).sum();
        let mut nodes: Vec<&NodeCost> =
            cost.nodes.iter().filter(|node| node.ms >= SHARE * all && node.ms > 0.0).collect();
        nodes.sort_by(|a, b| b.ms.total_cmp(&a.ms));
        let shares: Vec<String> =
            nodes.iter().map(|node| format!("{} {:.0} %", node.id, node.ms / all * 100.0)).collect();
        if !shares.is_empty() {
            let _ = writeln!(text, "time of run {run}: {}", shares.join(", "));
        }
    }
    for (place, knob) in outcome.knobs.iter().enumerate() {
        let along = outcome.along(place);
        let errors: Vec<f64> = along.iter().filter_map(|run| outcome.error(*run)).collect();
        let (Some(first), Some(last)) = (errors.first(), errors.last()) else { continue };
        if errors.len() < 2 {
            continue;
        }
        let floor = outcome.floor();
        let others = if outcome.knobs.len() > 1 { ", the others at their best" } else { "" };
        let _ = match errors.iter().all(|error| *error <= floor) {
            true => writeln!(text, "error by {}: at the floor with every value{others}: not worth studying", knob.key),
            false => writeln!(
                text,
                "error by {}: {} to {}{others}",
                knob.key,
                shown_error(outcome, *first),
                shown_error(outcome, *last)
            ),
        };
    }
}
