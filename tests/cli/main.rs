//! The program as its users meet it: the built binary, run in folders of its own.
//!
//! Whatever a test is about, each run through [`bench`] also holds that nobody sees a panic or a backtrace.

#![allow(clippy::unwrap_used, reason = "a value that is not there fails the test")]

mod bench;
mod catalogue;
mod check;
mod convert;
mod cook;
mod diff;
mod exits;
mod messages;
mod notes;
mod same_bits;
mod stats;
#[cfg(unix)]
mod stopped;
