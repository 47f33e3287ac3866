//! How the program ends: exit codes, and the messages that go with them.

use std::io;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use engine::error::CookError;
use engine::error::ErrorKind;
use engine::graph::{Fault, FaultClass};
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

/// Exit codes, as documented for scripts. Where two apply, the lower one is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Exit {
    /// Done; for `diff`: the same.
    Done = 0,
    /// A file could not be read or written; for `diff`: they differ.
    File = 1,
    /// The command line is wrong; for `diff`: trouble.
    CommandLine = 2,
    /// The graph is wrong.
    Graph = 3,
    /// A node could not cook.
    Cook = 4,
    /// Ctrl-C, or SIGTERM.
    Interrupted = 130,
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        Self::from(exit as u8)
    }
}

/// Why the program ends early: a code, and lines for stderr.
#[derive(Debug)]
pub struct Failure {
    /// The exit code.
    pub exit: Exit,
    /// Lines for stderr; none where the failure was already reported.
    pub lines: Vec<String>,
}

impl Failure {
    /// A failure with one line.
    pub fn new(exit: Exit, line: impl Into<String>) -> Self {
        Self { exit, lines: vec![line.into()] }
    }

    /// A failure that was already reported.
    pub fn reported(exit: Exit) -> Self {
        Self { exit, lines: Vec::new() }
    }

    /// A file that could not be read or written.
    pub fn file(line: impl Into<String>) -> Self {
        Self::new(Exit::File, line)
    }
}

impl From<io::Error> for Failure {
    /// For stdout: a reader that closed it early is not an error.
    fn from(error: io::Error) -> Self {
        match error.kind() {
            io::ErrorKind::BrokenPipe => Self::reported(Exit::Done),
            _ => Self::file(format!("stdout could not be written: {error}")),
        }
    }
}

/// The exit code of some faults.
pub fn exit_of_faults(faults: &[Fault]) -> Exit {
    let code = |fault: &Fault| match fault.class {
        FaultClass::File => Exit::File,
        FaultClass::Graph => Exit::Graph,
    };
    faults.iter().map(code).min().unwrap_or(Exit::Done)
}

/// The exit code of a node's error.
pub fn exit_of_error(error: &CookError) -> Exit {
    match error.error.kind {
        ErrorKind::File => Exit::File,
        ErrorKind::Cancelled => Exit::Interrupted,
        ErrorKind::Refused | ErrorKind::NotFinite | ErrorKind::Panic | ErrorKind::Contract => Exit::Cook,
    }
}

/// A flag that Ctrl-C and SIGTERM set; a second one ends the program at once. SIGHUP is left alone, for `nohup`.
pub fn cancelled_by_signal() -> Arc<AtomicBool> {
    let cancel = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        // In this order, so that it is the signal before which decides. Without a handler a signal still ends the program,
        // only less politely.
        let _ = flag::register_conditional_shutdown(signal, Exit::Interrupted as i32, cancel.clone());
        let _ = flag::register(signal, cancel.clone());
    }
    cancel
}
