//! Arbitrary bytes as a .ply file: reading never panics; what loads can be written and read again.

#![no_main]

use formats::Format;
use libfuzzer_sys::fuzz_target;

#[path = "reader.rs"]
mod reader;

fuzz_target!(|bytes: &[u8]| reader::check(Format::Ply, bytes));
