//! Judges a run case: what must never happen, whatever the input.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::os::unix::fs::FileTypeExt as _;
use std::path::{Path, PathBuf};

use super::call::Outcome;
use super::case::{Call, Case};

/// The documented exit codes.
const CODES: [i32; 6] = [0, 1, 2, 3, 4, 130];

/// Texts of panics, aborts and broken declarations.
const BUGS: [&str; 8] = [
    "panicked",
    "RUST_BACKTRACE",
    "failed unexpectedly",
    "bug in convect",
    "has overflowed its stack",
    "memory allocation of",
    "stack backtrace",
    "core dumped",
];

/// Names of signals, for messages.
const SIGNALS: [(i32, &str); 9] = [
    (2, "SIGINT"),
    (4, "SIGILL"),
    (6, "SIGABRT"),
    (7, "SIGBUS"),
    (8, "SIGFPE"),
    (9, "SIGKILL"),
    (11, "SIGSEGV"),
    (15, "SIGTERM"),
    (24, "SIGXCPU"),
];

/// What is wrong with how a call ended.
pub(crate) fn ending(call: &Call, outcome: &Outcome) -> Option<String> {
    if outcome.hung {
        return Some("it hangs, SIGTERM included".into());
    }
    if let Some(text) = BUGS.iter().find(|text| outcome.stderr.contains(**text)) {
        return Some(format!("stderr says `{text}`"));
    }
    if let Some(found) = printed(call, outcome) {
        return Some(found);
    }
    match (outcome.code, outcome.signal) {
        (Some(code), _) if !CODES.contains(&code) => Some(format!("exit code {code}")),
        (Some(130), _) if !outcome.signalled && !outcome.slow => Some("exit code 130 without a signal".into()),
        (Some(code), _) if code != 0 && call.succeeds && !outcome.slow => {
            Some(format!("exit code {code} of a command in order"))
        }
        // Before its handlers are there, a signal ends the program.
        (None, Some(2 | 9 | 15)) if outcome.signalled || outcome.slow => None,
        (None, Some(signal)) => {
            let name = SIGNALS.iter().find(|(number, _)| *number == signal).map_or("a signal", |(_, name)| name);
            Some(format!("ended by {name} ({signal})"))
        }
        _ => None,
    }
}

/// What is wrong with stdout, which is for data only.
fn printed(call: &Call, outcome: &Outcome) -> Option<String> {
    let has = |word: &str| call.args.iter().any(|arg| arg == word);
    let reports = call.args.windows(2).any(|pair| pair == ["--report", "-"]);
    let is_cook = call.args.first().is_some_and(|verb| verb == "cook") && !has("--help");
    let is_data = is_cook || has("--json") && !has("--help");
    if call.full_stdout || outcome.stdout.is_empty() || !is_data {
        return None;
    }
    if is_cook && !reports {
        return Some("a cook prints to stdout".into());
    }
    let is_complete = serde_json::from_slice::<serde::de::IgnoredAny>(&outcome.stdout).is_ok();
    (!is_complete && outcome.is_whole()).then(|| "stdout is not JSON".into())
}

/// Files, links and pipes of the case that are lost or changed.
pub(crate) fn lost(case: &Case, folder: &Path) -> Option<String> {
    let changed = |(path, bytes): &&(String, Vec<u8>)| fs::read(folder.join(path)).ok().as_ref() != Some(bytes);
    if let Some((path, _)) = case.files.iter().find(changed) {
        return Some(format!("`{path}` is lost or changed"));
    }
    // A link that leads nowhere may be replaced by a file.
    let is_there = |(link, to): &&(&str, String)| match fs::read_link(folder.join(link)) {
        Ok(leads) => leads == Path::new(to),
        Err(_) => *link == "dangling",
    };
    let link = case.links.iter().find(|link| !is_there(link)).map(|(link, _)| *link);
    let is_pipe = |path: &&&str| fs::metadata(folder.join(path)).is_ok_and(|about| about.file_type().is_fifo());
    let gone = link.or_else(|| case.pipes.iter().find(|path| !is_pipe(path)).copied());
    gone.map(|path| format!("`{path}` is lost or replaced"))
}

/// The temporaries of files below `folder`.
pub(crate) fn temporaries(folder: &Path) -> BTreeSet<PathBuf> {
    files(folder).into_keys().filter(|path| path.to_string_lossy().contains(".tmp-")).collect()
}

/// Files under a final name that are not complete or have numbers that are none, and geometry that `reads` refuses.
pub(crate) fn incomplete(case: &Case, folder: &Path, mut reads: impl FnMut(&Path) -> bool) -> Option<String> {
    for (path, bytes) in files(folder) {
        let text = path.to_string_lossy();
        let is_own = case.files.iter().any(|(own, _)| *own == text) || case.links.iter().any(|(link, _)| *link == text);
        if is_own || text.starts_with("cache") || text.contains(".tmp-") {
            continue;
        }
        let complete = match path.extension().and_then(|ending| ending.to_str()) {
            Some("json") => serde_json::from_slice::<serde::de::IgnoredAny>(&bytes).is_ok(),
            Some("usda") => bytes.starts_with(b"#usda 1.0") && bytes.ends_with(b"}\n"),
            Some("usdc") => bytes.starts_with(b"PXR-USDC") && bytes.len() > 88,
            Some("png" | "apng") => {
                bytes.starts_with(b"\x89PNG") && bytes.windows(4).rev().take(16).any(|end| end == b"IEND")
            }
            Some("obj" | "ply") => reads(&folder.join(&path)),
            _ => true,
        };
        if !complete {
            return Some(format!("`{text}` is not complete"));
        }
        if let Some(word) = not_a_number(&path, &bytes) {
            return Some(format!("`{text}` has the number {word}"));
        }
    }
    None
}

/// A number of a text file that is none.
fn not_a_number(path: &Path, bytes: &[u8]) -> Option<&'static str> {
    let is_text = path.extension().is_some_and(|ending| ending == "usda" || ending == "obj");
    let text = if is_text { String::from_utf8_lossy(bytes) } else { "".into() };
    let words = text.split([' ', '\n', '(', ')', '[', ']', ',', '/']).map(|word| word.trim_start_matches('-'));
    words.filter_map(|word| ["nan", "inf", "NaN"].into_iter().find(|none| *none == word)).next()
}

/// How two folders differ.
pub(crate) fn difference(a: &Path, b: &Path) -> Option<String> {
    let (left, right) = (files(a), files(b));
    let paths = left.keys().chain(right.keys()).find(|path| left.get(*path) != right.get(*path))?;
    Some(format!("`{}` has other bits in `{}` than in `{}`", paths.display(), b.display(), a.display()))
}

/// The files below `folder` by their path in it; links are not followed.
pub(crate) fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut rest = vec![folder.to_owned()];
    while let Some(next) = rest.pop() {
        for entry in fs::read_dir(&next).into_iter().flatten().flatten() {
            let path = entry.path();
            match entry.file_type() {
                Ok(kind) if kind.is_dir() => rest.push(path),
                Ok(kind) if kind.is_file() => {
                    let bytes = fs::read(&path).unwrap_or_default();
                    found.insert(path.strip_prefix(folder).unwrap_or(&path).to_owned(), bytes);
                }
                _ => {}
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ended(code: Option<i32>, signal: Option<i32>, stderr: &str) -> Option<String> {
        ending(&Call::default(), &Outcome { code, signal, stderr: stderr.into(), ..Outcome::default() })
    }

    #[test]
    fn documented_codes_pass_and_others_do_not() {
        for code in [0, 1, 2, 3, 4] {
            assert_eq!(ended(Some(code), None, "g.json:1:1: a fault"), None);
        }
        assert_eq!(ended(Some(101), None, ""), Some("exit code 101".into()));
        assert_eq!(ended(Some(130), None, ""), Some("exit code 130 without a signal".into()));
        let in_order = Call { succeeds: true, ..Call::default() };
        let outcome = Outcome { code: Some(4), ..Outcome::default() };
        assert_eq!(ending(&in_order, &outcome), Some("exit code 4 of a command in order".into()));
    }

    #[test]
    fn a_cook_prints_a_report_or_nothing() {
        let found = |args: &[&str], stdout: &str| {
            let outcome = Outcome { code: Some(0), stdout: stdout.into(), ..Outcome::default() };
            ending(&Call::new(args), &outcome)
        };
        assert_eq!(found(&["cook", "g.json", "--report", "-"], "{}"), None);
        assert_eq!(found(&["cook", "g.json", "--report", "-"], "{"), Some("stdout is not JSON".into()));
        assert_eq!(found(&["check", "g.json", "--json"], "NaN"), Some("stdout is not JSON".into()));
        assert_eq!(found(&["cook", "g.json"], "done"), Some("a cook prints to stdout".into()));
    }

    #[test]
    fn numbers_that_are_none_are_found_and_names_are_not() {
        let found = |bytes: &[u8]| not_a_number(Path::new("a.usda"), bytes);
        assert_eq!(found(b"(0, -inf, 1)"), Some("inf"));
        assert_eq!(found(b"[nan]"), Some("nan"));
        assert_eq!(found(b"def \"nano\" # info"), None);
    }

    #[test]
    fn panics_and_aborts_are_found() {
        assert_eq!(
            ended(Some(4), None, "it failed unexpectedly: index"),
            Some("stderr says `failed unexpectedly`".into())
        );
        assert_eq!(ended(None, Some(11), ""), Some("ended by SIGSEGV (11)".into()));
        assert_eq!(ended(None, Some(9), ""), Some("ended by SIGKILL (9)".into()), "by the system, for its memory");
        let killed = Outcome { signal: Some(9), signalled: true, ..Outcome::default() };
        assert_eq!(ending(&Call::default(), &killed), None);
        let hung = Outcome { hung: true, signal: Some(9), ..Outcome::default() };
        assert!(ending(&Call::default(), &hung).is_some());
    }
}
