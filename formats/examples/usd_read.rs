//! Reads a USD file at times and prints each as a line of json, for `tools/usd_read_check.py`.
//!
//! `usd_read FILE PRIM TIME…`; PRIM is `/` for the whole stage. What is left out is printed to stderr.

#![allow(clippy::unwrap_used, reason = "a command for developers")]

use std::path::PathBuf;
use std::sync::Arc;

use formats::usd::{UsdAssets, UsdStage};
use formats::{FilePosition, Format, FormatError, FrameStamp};

struct Folder(PathBuf);

impl UsdAssets for Folder {
    fn open(&self, name: &str) -> Result<Arc<[u8]>, FormatError> {
        let bytes = std::fs::read(self.0.join(name)).map_err(|error| FormatError::Content {
            position: FilePosition::File,
            fact: format!("{name}: {error}"),
            hint: None,
        })?;
        Ok(bytes.into())
    }
}

fn main() {
    let mut args = std::env::args().skip(1);
    let file = PathBuf::from(args.next().unwrap());
    let prim = args.next().unwrap_or_default();
    let folder = Folder(file.parent().unwrap().to_owned());
    let stage = UsdStage::open(std::fs::read(&file).unwrap().into(), folder);
    let stage = stage.unwrap_or_else(|error| {
        println!("error: {error}; {}", error.hint().unwrap_or_default());
        std::process::exit(1)
    });
    for time in args {
        let time: f64 = time.parse().unwrap();
        match stage.read(&prim, time, &|_| true) {
            Ok(reading) => {
                reading.notes.iter().for_each(|note| eprintln!("{note}"));
                let stamp = FrameStamp { frame: time, seconds: 0.0 };
                let mut line = Vec::new();
                formats::write(Format::Json, &reading.geometry, &stamp, &mut line).unwrap();
                println!("{}", String::from_utf8(line).unwrap().replace('\n', ""));
            }
            Err(error) => println!("error: {error}; {}", error.hint().unwrap_or_default()),
        }
    }
}
