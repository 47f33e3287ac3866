//! Tests of loading: graphs that load and what becomes of them, the stored messages of those that do not, hostile texts,
//! and the schema.

mod catalogue;
mod faults;
mod hostile;
mod schema;
mod values;

use std::io;
use std::path::Path;

use super::{Fault, Graph};
use catalogue::CATALOGUE;

/// Files as the tests have them: what is called so is missing, locked or a folder; all else can be read.
fn probe(path: &Path) -> io::Result<()> {
    match path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default() {
        "missing" => Err(io::ErrorKind::NotFound.into()),
        "locked" => Err(io::ErrorKind::PermissionDenied.into()),
        "folder" => Err(io::ErrorKind::IsADirectory.into()),
        "broken" => Err(io::Error::other("input/output error")),
        _ => Ok(()),
    }
}

/// Loads a graph that lies in the folder `scene`.
fn load_with(text: &str, set: &[(&str, &str)]) -> Result<Graph, Vec<Fault>> {
    let set: Vec<(String, String)> = set.iter().map(|(key, value)| ((*key).into(), (*value).into())).collect();
    Graph::load(text, Path::new("scene"), CATALOGUE, &set, &probe)
}

fn load(text: &str) -> Result<Graph, Vec<Fault>> {
    load_with(text, &[])
}

/// Loads a graph that has no fault, and that the schema accepts.
fn good(text: &str) -> Graph {
    assert_eq!(schema::refused(text), Vec::<String>::new());
    load(text).unwrap_or_else(|faults| panic!("{faults:#?}"))
}
