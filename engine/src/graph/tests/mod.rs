//! Tests of loading: valid graphs and their sources, stored messages of invalid graphs, hostile texts, and the schema.

mod catalogue;
mod faults;
mod hostile;
mod schema;
mod validator;
mod values;

use std::io;
use std::path::Path;

use super::{Fault, Graph};
use catalogue::CATALOGUE;

/// The files of the tests: those named `missing`, `locked`, `folder` and `broken` fail in that way, all others can be
/// read.
fn probe(path: &Path) -> io::Result<()> {
    match path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default() {
        "missing" => Err(io::ErrorKind::NotFound.into()),
        "locked" => Err(io::ErrorKind::PermissionDenied.into()),
        "folder" => Err(io::ErrorKind::IsADirectory.into()),
        "broken" => Err(io::Error::other("input/output error")),
        _ => Ok(()),
    }
}

/// Loads a graph whose file is in the folder `scene`.
fn load_with(text: &str, set: &[(&str, &str)]) -> Result<Graph, Vec<Fault>> {
    let set: Vec<(String, String)> = set.iter().map(|(key, value)| ((*key).into(), (*value).into())).collect();
    Graph::load(text, Path::new("scene"), CATALOGUE, &set, &probe)
}

fn load(text: &str) -> Result<Graph, Vec<Fault>> {
    load_with(text, &[])
}

/// Loads a graph that must be free of faults and valid under the schema.
fn good(text: &str) -> Graph {
    assert_eq!(schema::refused(text), Vec::<String>::new());
    load(text).unwrap_or_else(|faults| panic!("{faults:#?}"))
}
