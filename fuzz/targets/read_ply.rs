//! Any bytes as a .ply file: they load, or an error says why; what loads can be written again and comes back.

#![no_main]

use formats::Format;
use libfuzzer_sys::fuzz_target;

#[path = "reader.rs"]
mod reader;

fuzz_target!(|bytes: &[u8]| reader::check(Format::Ply, bytes));
