//! The reports of parts: which frames each has, and all of them as one report.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use engine::cook::NodeEndTips;
use engine::time::Frame;
use formats::atomic::FileError;
use serde_json::{Map, Value, json};

use super::{Piece, notes};
use crate::failure::Failure;

/// The report of a part.
#[derive(Debug)]
pub(super) struct PartReport {
    path: PathBuf,
    report: Value,
    tips: NodeEndTips,
}

/// The reports of all parts, by the first frame of each.
///
/// # Errors
/// If there is none, or one cannot be read.
pub(super) fn of(folder: &Path) -> Result<Vec<PartReport>, Failure> {
    let unread = |path: &Path, error| Failure::file(FileError::new(path, "read", error).to_string());
    let mut paths = Vec::new();
    let parts = match fs::read_dir(folder) {
        Err(error) if error.kind() == ErrorKind::NotFound => None,
        parts => Some(parts.map_err(|error| unread(folder, error))?),
    };
    for part in parts.into_iter().flatten() {
        let part = part.map_err(|error| unread(folder, error))?.path();
        if !part.is_dir() {
            continue;
        }
        for file in fs::read_dir(&part).map_err(|error| unread(&part, error))? {
            let file = file.map_err(|error| unread(&part, error))?.path();
            let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
            if name.starts_with("report") && name.ends_with(".json") {
                paths.push(file);
            }
        }
    }
    paths.sort();
    if paths.is_empty() {
        let line = format!(
            "`{}` has no part with a report; run the tasks that `convect job` wrote first, or `convect cook --part A-B --report FILE`",
            folder.display()
        );
        return Err(Failure::file(line));
    }
    let read = |path: PathBuf| {
        let text = fs::read_to_string(&path).map_err(|error| unread(&path, error))?;
        let report: Value = serde_json::from_str(&text)
            .map_err(|error| Failure::file(format!("`{}` is no report: {error}", path.display())))?;
        match report["report"] == json!(1) {
            true => Ok(PartReport { tips: tips_of(&path, &report)?, path, report }),
            false => Err(Failure::file(format!("`{}` is not a report; cook its part again", path.display()))),
        }
    };
    let mut reports = paths.into_iter().map(read).collect::<Result<Vec<PartReport>, Failure>>()?;
    let first = |report: &PartReport| report.report["frames"][0].as_f64().unwrap_or_default();
    reports.sort_by(|a, b| first(a).total_cmp(&first(b)));
    Ok(reports)
}

/// The tips of the first and the last frame of a part, which lie beside its report.
fn tips_of(path: &Path, report: &Value) -> Result<NodeEndTips, Failure> {
    let Some(name) = report["tips"].as_str() else { return Ok(NodeEndTips::default()) };
    let path = path.with_file_name(name.rsplit(['/', '\\']).next().unwrap_or_default());
    let bytes = fs::read(&path).map_err(|error| Failure::file(FileError::new(&path, "read", error).to_string()))?;
    let invalid = || Failure::file(format!("`{}` is damaged; cook its part again", path.display()));
    NodeEndTips::from_bytes(&bytes).ok_or_else(invalid)
}

/// Refuses parts that were cooked by different graphs, settings or versions of the program. A part that does not say by
/// what is not compared.
///
/// # Errors
/// If two parts differ.
pub(super) fn are_of_one_recipe(reports: &[PartReport]) -> Result<(), Failure> {
    let mut known = reports.iter().filter(|report| report.report["recipe"].is_object());
    let Some(first) = known.next() else { return Ok(()) };
    for report in known {
        let [a, b] = [first, report].map(|report| &report.report["recipe"]);
        let what = if a["graph"] != b["graph"] {
            "different graphs, or one that was changed in between".to_owned()
        } else if a["version"] != b["version"] {
            let version = |recipe: &Value| recipe["version"].as_str().unwrap_or("unknown").to_owned();
            format!("different versions of convect, {} and {}", version(a), version(b))
        } else if let Some(key) = differing_key(&a["set"], &b["set"]) {
            let value = |recipe: &Value| match &recipe["set"][&key] {
                Value::String(value) => format!("`--set {key}={value}`"),
                _ => format!("no `--set {key}`"),
            };
            format!("different settings, {} and {}", value(a), value(b))
        } else {
            continue;
        };
        let line = format!(
            "`{}` and `{}` were cooked with {what}; cook the parts again, all with the same",
            first.path.display(),
            report.path.display()
        );
        return Err(Failure::file(line));
    }
    Ok(())
}

/// The first key with different values in two objects.
fn differing_key(a: &Value, b: &Value) -> Option<String> {
    let [a, b] = [a.as_object()?, b.as_object()?];
    a.keys().chain(b.keys()).find(|key| a.get(*key) != b.get(*key)).cloned()
}

impl PartReport {
    /// The outputs of the part.
    ///
    /// # Errors
    /// If it was interrupted, or an output lacks frames.
    pub(super) fn pieces(&self) -> Result<Vec<(String, Piece)>, Failure> {
        let failed = |fact: String| Failure::file(format!("`{}`: {fact}; cook it again", self.path.display()));
        let report = &self.report;
        if report["total"]["interrupted"] == json!(true) {
            return Err(failed("the part was interrupted".into()));
        }
        let all = report["frames"].as_array().map(Vec::as_slice).unwrap_or_default();
        let frame = |value: &Value| value.as_f64().and_then(|number| Frame::exactly(number).ok());
        let frames: Option<Vec<Frame>> = all.iter().map(frame).collect();
        let frames = frames.ok_or_else(|| failed("its frames are no numbers".into()))?;
        let mut pieces = Vec::new();
        for (name, output) in report["outputs"].as_object().into_iter().flatten() {
            let there = output["frames"].as_u64().unwrap_or_default();
            if there != frames.len() as u64 {
                return Err(failed(format!("output `{name}` has {there} of {} frames", frames.len())));
            }
            // By name in the folder of the report, which may have been moved or written on another machine.
            let folder = self.path.parent().unwrap_or(Path::new(""));
            let names = output["files"].as_array().into_iter().flatten().filter_map(Value::as_str);
            let files: Vec<PathBuf> =
                names.map(|name| folder.join(name.rsplit(['/', '\\']).next().unwrap_or_default())).collect();
            if let Some(missing) = files.iter().find(|file| !file.is_file()) {
                return Err(failed(format!("its file `{}` is missing", missing.display())));
            }
            if !files.is_empty() {
                pieces.push((name.clone(), Piece { frames: frames.clone(), files }));
            }
        }
        Ok(pieces)
    }
}

/// Sums of these are the whole's.
const SUMMED: [&str; 5] = ["cooks", "from_cache", "from_disk", "wall_ms", "cpu_ms"];

/// One report of all parts: frames and metrics of all, sums of times and counts, the largest peak.
pub(super) fn merged(reports: &[PartReport]) -> Value {
    let Some((first, rest)) = reports.split_first() else { return Value::Null };
    let mut all = first.report.clone();
    for report in rest {
        add(&mut all, &report.report, "");
    }
    if let Some(frames) = all["frames"].as_array_mut() {
        frames.sort_by(|a, b| a.as_f64().unwrap_or_default().total_cmp(&b.as_f64().unwrap_or_default()));
        frames.dedup();
    }
    all["parts"] = json!(reports.len());
    if let Some(all) = all.as_object_mut() {
        all.remove("tips");
    }
    add_jumps(&mut all, reports);
    all["notes"] = notes::joined(reports.iter().map(|part| &part.report), &all);
    notes::sort_metrics(&mut all);
    let total = &all["total"];
    let rate = all["frames"].as_array().map_or(0, Vec::len) as f64 * 1e3
        / total["cooking_ms"].as_f64().unwrap_or(f64::INFINITY);
    all["total"]["frames_per_second"] = json!(rate);
    all
}

/// Adds the jumps at the first frame of each part, from the last one of the part before.
fn add_jumps(all: &mut Value, reports: &[PartReport]) {
    for (node, here) in reports.iter().flat_map(|report| &report.tips.0) {
        let mut of_node = reports.iter().filter_map(|report| report.tips.0.get(node));
        let before = of_node.rfind(|ends| ends.last().number() + 1.0 == here.first().number());
        if let Some(share) = before.and_then(|before| here.jumps_since(before)) {
            all["nodes"][node]["metrics"][here.metric()][here.first().to_string()] = json!(share);
        }
    }
}

/// Adds what another part says; `key` is the name under which both stand.
fn add(all: &mut Value, part: &Value, key: &str) {
    let is_time = SUMMED.contains(&key) || matches!(key, "cooking_ms" | "writing_ms" | "bytes");
    match (all, part) {
        (Value::Object(all), Value::Object(part)) => add_entries(all, part, key),
        (Value::Array(all), Value::Array(part)) => {
            let new: Vec<Value> = part.iter().filter(|one| !all.contains(one)).cloned().collect();
            all.extend(new);
        }
        (Value::Number(all), Value::Number(part)) => {
            let (a, b) = (all.as_f64().unwrap_or_default(), part.as_f64().unwrap_or_default());
            let is_whole = all.is_u64() && part.is_u64();
            let joined = match key {
                _ if is_time || key == "frames" => a + b,
                "peak_bytes" => a.max(b),
                _ => return,
            };
            let number =
                if is_whole { serde_json::Number::from(joined as u64) } else { return *all = float(joined, all) };
            *all = number;
        }
        _ => {}
    }
}

fn float(number: f64, before: &serde_json::Number) -> serde_json::Number {
    serde_json::Number::from_f64(number).unwrap_or_else(|| before.clone())
}

fn add_entries(all: &mut Map<String, Value>, part: &Map<String, Value>, _: &str) {
    for (key, value) in part {
        match all.get_mut(key) {
            Some(known) => add(known, value, key),
            None => {
                all.insert(key.clone(), value.clone());
            }
        }
    }
}
