//! README's table of nodes matches the catalogue: each node with the first sentence of its help.

use std::fs;

use super::root;

/// The first line of the table.
const HEAD: &str = "| node | what it does |\n";

/// The table of all nodes.
fn table() -> String {
    let row = |node: &engine::node::Node| format!("| {} | {} |\n", node.name, node.summary().trim_end_matches('.'));
    let rows: String = convect::CATALOGUE.nodes().map(row).collect();
    format!("{HEAD}|---|---|\n{rows}")
}

/// With `BLESS` set, writes the table instead.
#[test]
fn readme_lists_the_catalogue() {
    let path = root().join("README.md");
    let readme = fs::read_to_string(&path).unwrap();
    let start = readme.find(HEAD).expect("README.md has a table of nodes");
    let found: String = readme[start..].split_inclusive('\n').take_while(|line| line.starts_with('|')).collect();
    if std::env::var_os("BLESS").is_some() {
        fs::write(&path, readme.replace(&found, &table())).unwrap();
    } else {
        assert_eq!(
            found,
            table(),
            "README's table of nodes differs from the catalogue; `cargo xtask bless readme` writes it"
        );
    }
}
