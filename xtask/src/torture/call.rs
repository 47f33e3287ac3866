//! Runs the program under limits of memory, time and file size.

use std::fs::{self, File};
use std::os::unix::process::ExitStatusExt as _;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use super::case::Call;

/// How a call ended.
#[derive(Debug, Default)]
pub(crate) struct Outcome {
    pub(crate) code: Option<i32>,
    /// The signal that ended it.
    pub(crate) signal: Option<i32>,
    /// Whether the torture sent a signal of its own.
    pub(crate) signalled: bool,
    /// Whether it had to be asked to stop because it took long; that alone is no fault.
    pub(crate) slow: bool,
    /// Whether it did not end although it was asked to.
    pub(crate) hung: bool,
    pub(crate) stdout: Vec<u8>,
    pub(crate) stderr: String,
}

impl Outcome {
    /// Whether it ended by itself.
    pub(crate) fn is_whole(&self) -> bool {
        !(self.slow || self.hung || self.signalled)
    }
}

/// The patience of a torture.
#[derive(Clone, Copy)]
pub(crate) struct Patience {
    /// After this time a call is asked to stop.
    pub(crate) asks: Duration,
    /// After this time it hangs.
    pub(crate) hangs: Duration,
}

/// Address space in kB: a small machine's.
const MEMORY_KB: u64 = 4 << 20;
/// Largest file in blocks of 512 bytes, so that no case fills the disk.
const LARGEST_FILE: u64 = 300 << 11;
/// CPU time in seconds.
const CPU_SECONDS: u64 = 600;

/// The shell command that runs `call` of `program`.
pub(crate) fn shell_words(program: &Path, call: &Call) -> Vec<String> {
    let blocks = call.blocks.unwrap_or(LARGEST_FILE);
    let limits =
        format!("ulimit -c 0; ulimit -v {MEMORY_KB}; ulimit -t {CPU_SECONDS}; ulimit -f {blocks}; exec \"$0\" \"$@\"");
    let mut words = vec!["-c".to_owned(), limits, program.display().to_string()];
    words.extend(call.args.iter().cloned());
    words
}

/// Runs `call` in `folder`.
///
/// # Errors
/// If it cannot be started.
#[allow(clippy::disallowed_methods, reason = "measures how long a child process takes; no result depends on it")]
pub(crate) fn run(program: &Path, call: &Call, folder: &Path, patience: Patience) -> Result<Outcome, String> {
    let failed = |error: std::io::Error| format!("`{}` could not be run: {error}", program.display());
    // Beside the case's folder, a name for each call: several run at once.
    static CALLS: AtomicUsize = AtomicUsize::new(0);
    let name = CALLS.fetch_add(1, Ordering::Relaxed);
    let [stdout, stderr] = ["stdout", "stderr"].map(|end| folder.with_extension(format!("{name}.{end}")));
    let stdin = match call.stdin {
        Some(file) => File::open(folder.join(file)).map_err(failed)?.into(),
        None => Stdio::null(),
    };
    let printed = if call.full_stdout { Path::new("/dev/full") } else { &stdout };
    let printed = File::options().write(true).create(!call.full_stdout).truncate(true).open(printed).map_err(failed)?;
    let mut command = Command::new("sh");
    command.args(shell_words(program, call)).current_dir(folder).env_remove("RUST_BACKTRACE").stdin(stdin);
    let mut child = command.stdout(printed).stderr(File::create(&stderr).map_err(failed)?).spawn().map_err(failed)?;
    let start = Instant::now();
    let mut outcome = Outcome::default();
    let mut pause = Duration::from_millis(1);
    let status = loop {
        if let Some(status) = child.try_wait().map_err(failed)? {
            break status;
        }
        let elapsed = start.elapsed();
        if elapsed > patience.hangs {
            outcome.hung = true;
            child.kill().map_err(failed)?;
            break child.wait().map_err(failed)?;
        }
        // Only a cook may take long; what else takes a minute hangs.
        if elapsed > patience.asks && !outcome.slow && call.args.first().is_some_and(|verb| verb == "cook") {
            outcome.slow = true;
            send("TERM", &child);
        }
        if let Some((signal, after)) = call.signal
            && elapsed >= Duration::from_millis(after)
            && !outcome.signalled
        {
            outcome.signalled = true;
            send(signal, &child);
        }
        std::thread::sleep(pause);
        pause = (pause * 3 / 2).min(Duration::from_millis(10));
    };
    finish(&mut outcome, status);
    outcome.stderr = String::from_utf8_lossy(&taken(&stderr)).into_owned();
    outcome.stdout = taken(&stdout);
    Ok(outcome)
}

/// The bytes of a file, which is removed.
fn taken(path: &Path) -> Vec<u8> {
    let bytes = fs::read(path).unwrap_or_default();
    // Of /dev/full there is none.
    let _ = fs::remove_file(path);
    bytes
}

fn finish(outcome: &mut Outcome, status: ExitStatus) {
    outcome.code = status.code();
    outcome.signal = status.signal();
}

fn send(signal: &str, child: &Child) {
    // It fails if the process has just ended.
    let _ = Command::new("kill").args([&format!("-{signal}"), &child.id().to_string()]).stderr(Stdio::null()).status();
}
