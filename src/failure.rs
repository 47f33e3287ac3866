//! Exit codes and failure messages.

use std::io;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use engine::error::CookError;
use engine::error::ErrorKind;
use engine::graph::{Fault, FaultClass};
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

/// Exit codes, as documented for scripts. If two apply, the lower one is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Exit {
    /// Success; for `diff`: no difference.
    Done = 0,
    /// A file could not be read or written; for `diff`: the files differ.
    File = 1,
    /// The command line is wrong; for `diff`: an error.
    CommandLine = 2,
    /// The graph has faults.
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

/// Why the program fails: an exit code, and lines for stderr.
#[derive(Debug)]
pub struct Failure {
    /// The exit code.
    pub exit: Exit,
    /// Lines for stderr; empty if the failure was already reported.
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
    /// An error of stdout. A reader that closes it early is not a failure.
    fn from(error: io::Error) -> Self {
        match error.kind() {
            io::ErrorKind::BrokenPipe => Self::reported(Exit::Done),
            _ => Self::file(format!("stdout could not be written: {error}")),
        }
    }
}

/// The exit code for a list of faults.
pub fn exit_of_faults(faults: &[Fault]) -> Exit {
    let code = |fault: &Fault| match fault.class {
        FaultClass::File => Exit::File,
        FaultClass::Graph => Exit::Graph,
        FaultClass::Note => Exit::Done,
    };
    faults.iter().map(code).min().unwrap_or(Exit::Done)
}

/// The exit code for a node's error.
pub fn exit_of_error(error: &CookError) -> Exit {
    match error.error.kind {
        ErrorKind::File => Exit::File,
        ErrorKind::Cancelled => Exit::Interrupted,
        ErrorKind::Refused | ErrorKind::NotFinite | ErrorKind::Panic | ErrorKind::Contract => Exit::Cook,
    }
}

/// A flag that is set by Ctrl-C and SIGTERM; a second signal ends the program at once. SIGHUP is not handled, because
/// of `nohup`.
pub fn cancelled_by_signal() -> Arc<AtomicBool> {
    let cancel = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        // In this order, so that the first signal only sets the flag. If a handler cannot be registered, the signal
        // ends the program without cleaning up.
        let _ = flag::register_conditional_shutdown(signal, Exit::Interrupted as i32, cancel.clone());
        let _ = flag::register(signal, cancel.clone());
    }
    cancel
}

/// Lets writing beyond the largest size of a file (`ulimit -f`) fail like any write, instead of ending the program with
/// its temporaries left.
pub fn too_large_files_are_errors() {
    #[cfg(unix)]
    // A flag that nobody reads: that the signal is handled is enough.
    let _ = flag::register(rustix::process::Signal::XFSZ.as_raw(), Arc::default());
}
