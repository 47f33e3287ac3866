//! Minimum times of interleaved runs, and their ratios to a fixed loop, which can be compared between machines and days.

#![allow(dead_code, reason = "each bench uses part of it")]

use std::time::Duration;

use engine::clock::Stopwatch;
use engine::cook::Engine;

/// Prints the number of threads and the SIMD path.
pub(crate) fn print_machine(engine: &Engine) {
    println!("{} threads, SIMD path {}", engine.threads(), numerics::simd::Path::chosen().name());
}

/// Least times by name, and the calibration loop's.
#[derive(Default)]
pub(crate) struct Figures {
    calibration: Option<Duration>,
    times: Vec<(String, u32, Duration)>,
}

impl Figures {
    /// Another run of `per` units of a kind.
    pub(crate) fn add(&mut self, name: impl Into<String>, per: u32, time: Duration) {
        let name = name.into();
        match self.times.iter_mut().find(|(known, _, _)| *known == name) {
            Some((_, _, least)) => *least = time.min(*least),
            None => self.times.push((name, per, time)),
        }
    }

    /// A loop of dependent multiplications and additions: 10 million on one core.
    pub(crate) fn calibrate(&mut self) {
        let watch = Stopwatch::start();
        let mut x = 1.0_f64;
        for k in 0..10_000_000 {
            x = x * 0.999_999 + f64::from(k & 1);
        }
        std::hint::black_box(x);
        let time = watch.wall();
        self.calibration = Some(self.calibration.map_or(time, |least| least.min(time)));
    }

    /// Seconds of one unit.
    pub(crate) fn least(&self, name: &str) -> f64 {
        let (_, per, time) = self.times.iter().find(|(known, _, _)| *known == name).expect("it was measured");
        time.as_secs_f64() / f64::from(*per)
    }

    /// The table of all.
    pub(crate) fn print(&self) {
        let loop_seconds = self.calibration.unwrap_or_default().as_secs_f64();
        println!("calibration loop: {:.2} ms", loop_seconds * 1e3);
        println!("{:<58} {:>12} {:>12}", "", "µs", "÷ loop");
        for (name, _, _) in &self.times {
            let seconds = self.least(name);
            println!("{name:<58} {:>12.2} {:>12.5}", seconds * 1e6, seconds / loop_seconds);
        }
    }
}
