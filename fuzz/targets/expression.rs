//! Arbitrary text as an expression and as a program: it never panics, and gives a value or faults with positions.

#![no_main]

use libfuzzer_sys::fuzz_target;

#[path = "language.rs"]
mod language;

fuzz_target!(|bytes: &[u8]| {
    if let Ok(text) = std::str::from_utf8(bytes) {
        language::check(text);
    }
});
