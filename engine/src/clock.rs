//! The one place that reads clocks: how long things took, for reports, and how old files are. No result depends on it.

use std::time::{Duration, Instant, SystemTime};

/// The time of day, to compare with that of a file.
#[allow(clippy::disallowed_methods, reason = "the one place that measures")]
pub fn now() -> SystemTime {
    SystemTime::now()
}

/// Measures wall time, and the CPU time of all threads of the process together.
pub struct Stopwatch {
    wall: Instant,
    cpu: Duration,
}

impl Stopwatch {
    /// Starts now.
    #[allow(clippy::disallowed_methods, reason = "the one place that measures")]
    pub fn start() -> Self {
        Self { wall: Instant::now(), cpu: cpu_time() }
    }

    /// Wall time since the start.
    pub fn wall(&self) -> Duration {
        self.wall.elapsed()
    }

    /// CPU time of the process since the start.
    pub fn cpu(&self) -> Duration {
        cpu_time().saturating_sub(self.cpu)
    }
}

#[cfg(unix)]
fn cpu_time() -> Duration {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    Duration::new(now.tv_sec.unsigned_abs(), now.tv_nsec as u32)
}

#[cfg(not(unix))]
fn cpu_time() -> Duration {
    Duration::ZERO
}
