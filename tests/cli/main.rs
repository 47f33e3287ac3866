//! Tests of the built program, run in temporary folders.
//!
//! Every run through [`bench`] also checks that no panic message or backtrace is printed.

#![allow(clippy::unwrap_used, reason = "a missing value fails the test")]

mod bench;
mod cache;
mod catalogue;
mod check;
mod convert;
mod cook;
mod diff;
mod exits;
mod job;
mod messages;
mod notes;
mod pictures;
mod same_bits;
mod stats;
#[cfg(unix)]
mod stopped;
mod stored_studies;
mod study;
mod study_check;
mod study_extremes;
mod targets;
mod usd;
