//! A child process that cooks one value, so that nothing it does, not even running out of memory, ends the others.

use std::io::{Read, Write as _};
use std::process::{Child, ChildStderr, ChildStdout, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use engine::clock::Stopwatch;

use super::probe::Probed;
use crate::failure::{Exit, Failure};

/// What is done while a child runs is looked at this often.
const POLL: Duration = Duration::from_millis(5);

/// A child that was asked to stop, and has not after this time, is killed.
const GRACE: Duration = Duration::from_secs(5);

/// How a child ended.
pub(super) enum Ended {
    Probed(Probed),
    /// It was asked to stop and returned nothing: it did not listen in time, or not yet.
    Silenced,
    /// It crashed: what its last line says, or how it ended.
    Crashed(String),
    /// Ctrl-C.
    Interrupted,
}

/// Runs a command for at most `limit`, then asks it to stop.
///
/// # Errors
/// If it cannot be started, or the graph can no longer be read.
pub(super) fn run(
    command: &mut Command,
    input: Option<&[u8]>,
    limit: Duration,
    cancel: &AtomicBool,
) -> Result<Ended, Failure> {
    let failed = |error: std::io::Error| Failure::new(Exit::Cook, format!("convect could not start itself: {error}"));
    let stdin = if input.is_some() { Stdio::piped() } else { Stdio::null() };
    let mut child = command.stdin(stdin).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().map_err(failed)?;
    let (stdin, stdout, stderr) = (child.stdin.take(), child.stdout.take(), child.stderr.take());
    thread::scope(|scope| {
        if let (Some(mut pipe), Some(bytes)) = (stdin, input) {
            // A child that ends early does not read to the end.
            scope.spawn(move || _ = pipe.write_all(bytes));
        }
        let stdout = scope.spawn(|| text(stdout.map(Pipe::Out)));
        let stderr = scope.spawn(|| text(stderr.map(Pipe::Err)));
        let waited = wait(&mut child, limit, cancel).map_err(failed);
        let [stdout, stderr] = [stdout, stderr].map(|reader| reader.join().unwrap_or_default());
        let (status, silenced) = waited?;
        if cancel.load(Ordering::Relaxed) {
            return Ok(Ended::Interrupted);
        }
        if silenced {
            return Ok(Ended::Silenced);
        }
        Ok(Probed::of_json(&stdout).map_or_else(|| Ended::Crashed(last_words(&stderr, status)), Ended::Probed))
    })
}

enum Pipe {
    Out(ChildStdout),
    Err(ChildStderr),
}

/// All that comes through a pipe.
fn text(pipe: Option<Pipe>) -> Vec<u8> {
    let mut bytes = Vec::new();
    // What came before an error is kept.
    let _ = match pipe {
        Some(Pipe::Out(mut pipe)) => pipe.read_to_end(&mut bytes),
        Some(Pipe::Err(mut pipe)) => pipe.read_to_end(&mut bytes),
        None => Ok(0),
    };
    bytes
}

/// Waits for its end, and whether a signal ended it that it was sent because of `limit` or `cancel`.
fn wait(child: &mut Child, limit: Duration, cancel: &AtomicBool) -> std::io::Result<(ExitStatus, bool)> {
    let watch = Stopwatch::start();
    let mut asked_at = None;
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok((status, asked_at.is_some() && is_ended_by_asking(status)));
        }
        let now = watch.wall();
        match asked_at {
            None if now > limit || cancel.load(Ordering::Relaxed) => {
                ask_to_stop(child)?;
                asked_at = Some(now);
            }
            Some(asked) if now > asked + GRACE => {
                child.kill()?;
                return Ok((child.wait()?, true));
            }
            _ => thread::sleep(POLL),
        }
    }
}

#[cfg(unix)]
fn ask_to_stop(child: &mut Child) -> std::io::Result<()> {
    let pid = rustix::process::Pid::from_child(child);
    Ok(rustix::process::kill_process(pid, rustix::process::Signal::TERM)?)
}

/// Whether the signal of [`ask_to_stop`] ended it: it came before the child listened for it.
#[cfg(unix)]
fn is_ended_by_asking(status: ExitStatus) -> bool {
    use std::os::unix::process::ExitStatusExt as _;
    status.signal() == Some(rustix::process::Signal::TERM.as_raw())
}

#[cfg(not(unix))]
fn ask_to_stop(child: &mut Child) -> std::io::Result<()> {
    child.kill()
}

#[cfg(not(unix))]
fn is_ended_by_asking(_: ExitStatus) -> bool {
    true
}

fn last_words(stderr: &[u8], status: ExitStatus) -> String {
    let stderr = String::from_utf8_lossy(stderr);
    let line = stderr.lines().rev().map(str::trim).find(|line| !line.is_empty());
    line.map_or_else(|| format!("the process ended with {status}"), str::to_owned)
}
