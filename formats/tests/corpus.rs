//! Replays the corpora of the fuzz targets, as a regression test.

#![allow(clippy::unwrap_used, reason = "a missing value fails the test")]

use std::path::Path;

use formats::Format;

#[path = "../../fuzz/targets/reader.rs"]
mod reader;

#[test]
fn every_file_of_the_corpora_loads_or_is_refused() {
    for (format, folder) in [(Format::Obj, "read_obj"), (Format::Ply, "read_ply"), (Format::Json, "read_json")] {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz/corpus").join(folder);
        let mut files: Vec<_> = std::fs::read_dir(&folder).unwrap().map(|file| file.unwrap().path()).collect();
        files.sort();
        assert!(!files.is_empty(), "{} has no file", folder.display());
        for file in files {
            reader::check(format, &std::fs::read(file).unwrap());
        }
    }
}
