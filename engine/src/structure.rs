//! How the sources of the engine depend on each other.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use petgraph::algo::kosaraju_scc;
use petgraph::graphmap::DiGraphMap;

/// A source file: the path of its module, and its code without comments and tests.
struct Source {
    file: String,
    module: Vec<String>,
    code: String,
}

fn sources() -> Vec<Source> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut sources = Vec::new();
    let mut folders = vec![root.clone()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).expect("a folder of sources") {
            let path = entry.expect("an entry").path();
            let name = path.file_stem().expect("a name").to_string_lossy().into_owned();
            if path.is_dir() {
                if name != "tests" {
                    folders.push(path);
                }
                continue;
            }
            if ["tests", "structure", "lib"].contains(&&*name) {
                continue;
            }
            let file =
                path.strip_prefix(&root).expect("inside").with_extension("").to_string_lossy().replace('\\', "/");
            let module = file.split('/').filter(|part| *part != "mod").map(str::to_owned).collect();
            let text = fs::read_to_string(&path).expect("a source");
            let text = text.split("#[cfg(test)]").next().unwrap_or_default();
            let code =
                text.lines().map(|line| line.split("//").next().unwrap_or_default()).collect::<Vec<_>>().join("\n");
            sources.push(Source { file, module, code });
        }
    }
    sources.sort_by(|a, b| a.file.cmp(&b.file));
    sources
}

/// Module paths that code names from `crate` or `super`, groups expanded.
fn named_paths(source: &Source) -> Vec<Vec<String>> {
    let mut found = Vec::new();
    for (start, _) in source.code.match_indices("crate::").chain(source.code.match_indices("super::")) {
        let before = source.code[..start].chars().next_back();
        if before.is_some_and(|c| c.is_alphanumeric() || c == '_' || c == '$' || c == ':') {
            continue;
        }
        expand(&source.code[start..], &source.module, &mut found);
    }
    found
}

/// The paths that start with `text`; `from` is the module that it stands in.
fn expand(text: &str, from: &[String], found: &mut Vec<Vec<String>>) {
    let (mut base, mut rest) = match text.strip_prefix("crate::") {
        Some(rest) => (Vec::new(), rest),
        None => (from.to_vec(), text),
    };
    while let Some(after) = rest.strip_prefix("super::") {
        base.pop();
        rest = after;
    }
    let Some(group) = rest.strip_prefix('{') else {
        let path = rest.split(|c: char| !c.is_alphanumeric() && c != '_' && c != ':').next().unwrap_or_default();
        base.extend(path.split("::").filter(|part| !part.is_empty()).map(str::to_owned));
        found.push(base);
        return;
    };
    let mut depth = 1;
    let mut item = String::new();
    for c in group.chars() {
        depth += i32::from(c == '{') - i32::from(c == '}');
        if depth == 0 || (depth == 1 && c == ',') {
            let mut path = base.clone();
            path.extend(item.split("::").map(|part| part.trim().to_owned()).take_while(|part| !part.starts_with('{')));
            found.push(path);
            item.clear();
        } else {
            item.push(c);
        }
        if depth == 0 {
            return;
        }
    }
}

/// Modules of one folder and the sisters that each names, by folder.
fn imports_by_folder(sources: &[Source]) -> BTreeMap<String, BTreeSet<(String, String)>> {
    let modules: BTreeSet<&[String]> =
        sources.iter().flat_map(|source| (1..=source.module.len()).map(|depth| &source.module[..depth])).collect();
    let mut imports: BTreeMap<String, BTreeSet<(String, String)>> = BTreeMap::new();
    for source in sources {
        for path in named_paths(source) {
            let shared = source.module.iter().zip(&path).take_while(|(a, b)| a == b).count();
            let (Some(own), Some(named)) = (source.module.get(shared), path.get(shared)) else { continue };
            if modules.contains(&path[..=shared]) {
                let folder = source.module[..shared].join("/");
                imports.entry(folder).or_default().insert((own.clone(), named.clone()));
            }
        }
    }
    imports
}

/// The knots of three or more.
fn circles(imports: &BTreeSet<(String, String)>) -> Vec<Vec<&str>> {
    let graph: DiGraphMap<&str, ()> = imports.iter().map(|(from, to)| (from.as_str(), to.as_str(), ())).collect();
    kosaraju_scc(&graph).into_iter().filter(|component| component.len() >= 3).collect()
}

/// A folder's `mod.rs` is the namespace of its files, so only sister modules count: those of the crate, and those of each
/// folder, at every depth.
#[test]
fn no_three_modules_import_each_other_in_a_circle() {
    let imports = imports_by_folder(&sources());
    assert!(imports[""].contains(&("cook".into(), "plan".into())), "the test sees imports");
    assert!(imports["cook"].contains(&("sweep".into(), "call".into())), "in folders too");
    let found: Vec<String> = imports
        .iter()
        .flat_map(|(folder, imports)| circles(imports).into_iter().map(move |circle| format!("{folder}: {circle:?}")))
        .collect();
    assert_eq!(found, [""; 0]);
}

#[test]
fn a_circle_of_three_is_found() {
    let imports = |pairs: &[(&str, &str)]| pairs.iter().map(|(a, b)| (a.to_string(), b.to_string())).collect();
    assert_eq!(circles(&imports(&[("a", "b"), ("b", "c"), ("c", "a"), ("c", "d")]))[0].len(), 3);
    assert!(circles(&imports(&[("a", "b"), ("b", "a"), ("b", "c")])).is_empty());
}

/// What decides at which frames an input is read, and frame arithmetic by which others might decide it too.
#[test]
fn the_read_plan_alone_names_frames_of_inputs() {
    let named_by = |words: &[&str], within: &dyn Fn(&str) -> bool| -> Vec<String> {
        let sources = sources();
        let found =
            sources.iter().filter(|source| within(&source.file) && words.iter().any(|word| source.code.contains(word)));
        found.map(|source| source.file.clone()).collect()
    };
    // Nodes declare times; nobody else asks for them.
    let beyond_nodes = |file: &str| !file.starts_with("node/");
    assert_eq!(named_by(&[".times)", ".times;", ".times.", "Times::", "Times {"], &beyond_nodes), ["plan/reads"]);
    // Keys and demand ask for the reads of a moment; calls are made from what demand has found.
    assert_eq!(named_by(&["Moment::"], &|_| true), ["cook/sweep/demand", "plan/keys", "plan/reads"]);
    // Neither counts frames on its own.
    let arithmetic = [".plus(", ".plus_ticks(", "scene.start()", "scene.end()", ".start().", ".floor()", ".ceil()"];
    assert_eq!(named_by(&arithmetic, &|file| file.starts_with("cook/sweep/")), [""; 0]);
    assert_eq!(named_by(&arithmetic[..4], &|file| file == "plan/keys"), [""; 0]);
}
