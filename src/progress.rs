//! How far a cook is: a bar on a terminal, elsewhere a line every ten seconds.

use std::io::IsTerminal as _;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::thread::JoinHandle;
use std::time::Duration;

use engine::clock::Stopwatch;
use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressStyle};

/// The time between two lines.
const INTERVAL: Duration = Duration::from_secs(10);

/// Shows on stderr how many frames of how many are cooked. Ends when it is dropped.
pub enum Progress {
    /// Nothing is shown.
    Quiet,
    /// A bar.
    Bar(ProgressBar),
    /// Lines.
    Lines(Lines),
}

impl Progress {
    /// The progress of `frames` frames.
    pub fn new(frames: u64, quiet: bool) -> Self {
        if quiet {
            return Self::Quiet;
        }
        if !std::io::stderr().is_terminal() {
            return Self::Lines(Lines::start(frames, INTERVAL, |line| crate::say!("{line}")));
        }
        let bar = ProgressBar::with_draw_target(Some(frames), ProgressDrawTarget::stderr());
        if let Ok(style) = ProgressStyle::with_template("{bar:40} {pos}/{len} frames, {eta} left") {
            bar.set_style(style);
        }
        Self::Bar(bar)
    }

    /// Counts cooked frames.
    pub fn add(&self, frames: u64) {
        match self {
            Self::Quiet => {}
            Self::Bar(bar) => {
                bar.inc(frames);
                if bar.length().is_some_and(|length| length < bar.position()) {
                    bar.set_length(bar.position());
                }
            }
            Self::Lines(lines) => _ = lines.cooked.fetch_add(frames, Ordering::Relaxed),
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Self::Bar(bar) = self {
            bar.finish_and_clear();
        }
    }
}

/// A thread that prints lines until it is dropped.
pub struct Lines {
    cooked: Arc<AtomicU64>,
    /// Closed to end the thread.
    open: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Lines {
    fn start(frames: u64, interval: Duration, print: impl Fn(&str) + Send + 'static) -> Self {
        let cooked = Arc::new(AtomicU64::new(0));
        let (open, closed) = mpsc::channel();
        let counter = cooked.clone();
        let lines = move || {
            let watch = Stopwatch::start();
            while closed.recv_timeout(interval) == Err(RecvTimeoutError::Timeout) {
                print(&line(counter.load(Ordering::Relaxed), frames, watch.wall()));
            }
        };
        // Without a thread there are no lines, which is no reason not to cook.
        let thread = std::thread::Builder::new().name("progress".into()).spawn(lines).ok();
        Self { cooked, open: Some(open), thread }
    }
}

impl Drop for Lines {
    fn drop(&mut self) {
        drop(self.open.take());
        // It ends at once, and what it printed comes before the summary.
        self.thread.take().into_iter().for_each(|thread| _ = thread.join());
    }
}

/// `12 of 48 frames in 10 seconds, about 30 seconds left`. More frames than were expected count as all of them.
fn line(cooked: u64, frames: u64, elapsed: Duration) -> String {
    let frames = frames.max(cooked);
    let left = match cooked {
        0 => String::new(),
        _ => {
            let left = elapsed.mul_f64(frames.saturating_sub(cooked) as f64 / cooked as f64);
            format!(", about {} left", HumanDuration(left))
        }
    };
    format!("{cooked} of {frames} frames in {}{left}", HumanDuration(elapsed))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_says_how_much_is_done_and_how_long_the_rest_takes() {
        let seconds = Duration::from_secs;
        assert_eq!(line(0, 48, seconds(10)), "0 of 48 frames in 10 seconds");
        assert_eq!(line(12, 48, seconds(10)), "12 of 48 frames in 10 seconds, about 30 seconds left");
        assert_eq!(line(48, 48, seconds(300)), "48 of 48 frames in 5 minutes, about 0 seconds left");
        assert_eq!(line(50, 48, seconds(300)), "50 of 50 frames in 5 minutes, about 0 seconds left");
    }

    #[test]
    fn lines_are_printed_until_the_end_even_while_no_frame_is_finished() {
        let (printed, lines) = mpsc::channel();
        let progress = Lines::start(8, Duration::from_millis(1), move |line| _ = printed.send(line.to_owned()));
        assert_eq!(lines.recv().unwrap(), "0 of 8 frames in 0 seconds");
        let progress = Progress::Lines(progress);
        progress.add(8);
        let is_last = |line: &String| line.starts_with("8 of 8 frames");
        assert!(lines.iter().any(|line| is_last(&line)));
        drop(progress);
        assert!(lines.iter().all(|line| is_last(&line)), "the thread has ended, so its lines do");
    }
}
