//! Every node is in its own file and in its family's list, and nowhere else; nodes do not use each other.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use super::paths::paths;
use super::tokens::{Token, tokens};
use super::{root, sources};

/// Node modules of a family: files and folders beside `lib.rs`, except for `shared`, which holds what several nodes
/// use.
fn modules(family: &Path) -> BTreeSet<String> {
    let entries = fs::read_dir(family).unwrap().map(|entry| entry.unwrap().path());
    entries
        .filter(|path| path.is_dir() || path.extension().is_some_and(|e| e == "rs"))
        .map(|path| path.file_stem().unwrap().to_string_lossy().into_owned())
        .filter(|name| !["lib", "shared", "tests"].contains(&name.as_str()))
        .collect()
}

fn families() -> Vec<PathBuf> {
    let entries = fs::read_dir(root().join("nodes")).unwrap();
    let mut families: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    families.sort();
    families
}

/// The name that a node's source declares: the text after the first `Node::new(`.
fn declared_name(source: &str) -> Option<String> {
    let new = |tokens: &[Token]| {
        tokens[0].is("Node") && tokens[1] == Token::Colons && tokens[2].is("new") && tokens[3] == Token::Mark('(')
    };
    tokens(source).windows(5).find(|five| new(five)).and_then(|five| match &five[4] {
        Token::Text(name) => Some(name.clone()),
        _ => None,
    })
}

#[test]
fn every_node_file_is_in_its_familys_list() {
    for family in families() {
        let list = tokens(&fs::read_to_string(family.join("lib.rs")).unwrap());
        for module in modules(&family) {
            let entry = |four: &[Token]| {
                four[0] == Token::Mark('&') && four[1].is(&module) && four[2] == Token::Colons && four[3].is("NODE")
            };
            let listed = list.windows(4).any(entry);
            assert!(listed, "{}: `{module}` is not in the list: add `&{module}::NODE`", family.display());
        }
    }
}

#[test]
fn every_family_is_in_the_catalogue() {
    for family in families() {
        for module in modules(&family) {
            let files = [family.join(&module).with_extension("rs"), family.join(&module).join("mod.rs")];
            let file = files.iter().find(|file| file.exists()).unwrap();
            let name = declared_name(&fs::read_to_string(file).unwrap());
            let name = name.unwrap_or_else(|| panic!("{} declares no node", file.display()));
            assert_eq!(name.to_ascii_lowercase(), module, "{}: the names of file and node differ", file.display());
            let known = convect::CATALOGUE.names().any(|known| known == name);
            assert!(known, "`{name}` is not in the catalogue: add its family to `FAMILIES` in src/lib.rs");
        }
    }
}

#[test]
fn names_are_unique_and_match_their_files() {
    let mut seen = BTreeSet::new();
    for node in convect::CATALOGUE.nodes() {
        assert!(seen.insert(node.name), "{} is listed twice", node.name);
        let module = node.name.to_ascii_lowercase();
        let found = families().iter().any(|family| modules(family).contains(&module));
        assert!(found, "{}: no file or folder `{module}` in any family", node.name);
    }
}

/// The item of another node in `others` that a source of node module `module[0]` uses, or a path that opens the whole
/// crate.
fn uses(source: &str, module: &[String], others: &BTreeSet<String>) -> Vec<String> {
    let of_another = |name: &String| *name != module[0] && others.contains(name);
    let found = paths(source, module).into_iter().filter_map(|path| match path.names.first() {
        Some(first) => of_another(first).then(|| path.names.join("::")),
        None => path.opens.then(|| "the whole crate, by a glob or another name".to_owned()),
    });
    found.collect()
}

/// The path of a file's module in its crate.
fn module_of(file: &Path, family: &Path) -> Vec<String> {
    let inside = file.strip_prefix(family).unwrap().with_extension("");
    let names = inside.components().map(|name| name.as_os_str().to_string_lossy().into_owned());
    names.filter(|name| name != "mod").collect()
}

/// A node's tests may cook other nodes to make their input.
#[test]
fn nodes_do_not_call_each_other() {
    let is_node = |file: &Path| !file.ends_with("lib.rs") && !file.ends_with("tests.rs");
    for family in families() {
        let modules = modules(&family);
        for (file, source) in sources(&family).into_iter().filter(|(file, _)| is_node(file)) {
            let used = uses(&source, &module_of(&file, &family), &modules);
            assert!(
                used.is_empty(),
                "{} uses {}: what nodes share belongs in shared/ or a kernel",
                file.display(),
                used.join(", ")
            );
        }
    }
}

#[test]
fn calls_of_other_nodes_are_found_in_any_notation() {
    let others = ["bend", "gust"].map(str::to_owned).into();
    let module = ["gust".to_owned()];
    let bad = [
        "use crate::bend::cook;",
        "use crate::{bend::cook, shared::x};",
        "use crate::{shared::x, bend};",
        "use crate::{shared::{x, y}, bend::{cook as bend_cook}};",
        "use {crate::{bend::cook}};",
        "use super::bend::cook;",
        "use super::{bend};",
        "use self::super::bend;",
        "fn f() { crate::bend::cook() }",
        "fn f() { crate :: bend /* here */ :: cook() }",
        "mod tests { use super::super::bend; }",
        "use super::*; fn f() { bend::cook() }",
        "use crate as all; fn f() { all::bend::cook() }",
        "use crate::{self as all};",
        "extern crate self as all; fn f() { all::bend::cook() }",
    ];
    for source in bad {
        assert_eq!(uses(source, &module, &others).len(), 1, "{source}");
    }
    let good = [
        "// use crate::bend::cook;",
        "use crate::shared::bend::cook;",
        "use crate::gust::cook; use self::bend::x; mod tests { use super::*; use super::bend; }",
        r#"fn f() { say("crate::bend::cook") }"#,
        "use curves::bend; pub(crate) fn f() { bend::cook() }",
    ];
    for source in good {
        assert_eq!(uses(source, &module, &others), [""; 0], "{source}");
    }
}

#[test]
fn families_do_not_depend_on_each_other() {
    let name = |family: &Path| family.file_name().unwrap().to_string_lossy().into_owned();
    for family in families() {
        let manifest = fs::read_to_string(family.join("Cargo.toml")).unwrap();
        for other in families().iter().filter(|other| **other != family).map(|other| name(other)) {
            let depends = manifest.lines().any(|line| {
                let rest = line.trim_start().strip_prefix(&*other);
                rest.is_some_and(|rest| rest.trim_start().starts_with(['.', '=']))
            });
            assert!(!depends, "the family {} depends on {other}", name(&family));
        }
    }
}
