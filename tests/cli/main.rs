//! The built program as users run it, each time in a folder of its own.
//!
//! Every run through [`bench`] also checks that no panic or backtrace is shown.

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
