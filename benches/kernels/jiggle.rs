//! Prints how long a jiggle takes: the minimum of interleaved runs, a line a case and SIMD path.
//!
//! `cargo bench --bench jiggle`; threads by `RAYON_NUM_THREADS`.

#![allow(clippy::disallowed_methods, reason = "measures time and is no node")]

use curves::attach::SkinBinding;
use curves::jiggle::{Drag, Jiggle, RigidStep, Spring};
use numerics::masked::Masked;
use numerics::ramp::{Interpolation, Ramp};
use numerics::random::Key;
use numerics::simd::Path;
use std::time::Instant;

const ROUNDS: usize = 40;

/// Curves of `cvs` CVs over a 2 m square, 0.1 m long, swaying with `time`.
fn groom(curves: u32, cvs: u32, time: f32) -> (Vec<u32>, Vec<[f32; 3]>) {
    let point = |curve: u32, cv: u32| {
        let key = Key::new(1).of(u64::from(curve));
        let u = cv as f32 / (cvs - 1) as f32;
        let [x, z] = [key.of(0).f32() * 2.0, key.of(1).f32() * 2.0];
        [x + 0.02 * u * u * time, 0.1 * u, z + 0.01 * u]
    };
    let starts = (0..=curves).map(|curve| curve * cvs).collect();
    (starts, (0..curves).flat_map(|curve| (0..cvs).map(move |cv| point(curve, cv))).collect())
}

/// A square of `n` × `n` quads under the groom, as triangles.
fn ground(n: u32) -> (Vec<[u32; 3]>, Vec<[f32; 3]>) {
    let side = 2.0 / n as f32;
    let points = (0..=n).flat_map(|z| (0..=n).map(move |x| [x as f32 * side, 0.0, z as f32 * side]));
    let cells = (0..n).flat_map(|z| (0..n).map(move |x| x + z * (n + 1)));
    (cells.flat_map(|a| [[a, a + n + 1, a + n + 2], [a, a + n + 2, a + 1]]).collect(), points.collect())
}

/// The least of some runs, milliseconds.
fn least(rounds: usize, mut work: impl FnMut()) -> f64 {
    let once = |_| {
        let start = Instant::now();
        work();
        start.elapsed().as_secs_f64() * 1e3
    };
    (0..rounds).map(once).fold(f64::INFINITY, f64::min)
}

fn main() {
    let ramp = Ramp::new(vec![[0.0, 0.0], [1.0, 1.0]], Interpolation::Linear).expect("the keys are in order");
    for (curves, cvs) in [(10_275, 5), (10_275, 32), (100_000, 5)] {
        let frames = [0.0, 1.0].map(|time| groom(curves, cvs, time).1);
        let starts = groom(curves, cvs, 0.0).0;
        let (triangles, skin) = ground(100);
        let roots: Vec<[f32; 3]> = starts[..curves as usize].iter().map(|start| frames[0][*start as usize]).collect();
        for path in Path::all() {
            let spring = |frequency| Spring {
                frequency: Masked::uniform(frequency),
                damping: 0.3.into(),
                softness: &ramp,
                drag: Drag::Target,
            };
            let mut jiggle = Jiggle::at_rest(&starts, &frames[0], &frames[0]);
            jiggle.step_on(path, &frames[1], &spring(3.0), 1.0 / 24.0, None);
            let mut turn = 0;
            let mut next = || {
                turn += 1;
                turn
            };
            let step = least(ROUNDS, || jiggle.step_on(path, &frames[next() % 2], &spring(3.0), 1.0 / 24.0, None));
            let keyed = least(ROUNDS / 4, || {
                let turn = next();
                jiggle.step_on(path, &frames[turn % 2], &spring(3.0 + 0.01 * turn as f64), 1.0 / 24.0, None);
            });
            let shape = least(ROUNDS, || {
                let shaped = jiggle.shape_on(path, 1.0.into());
                assert!(shaped.max_offset.is_finite());
            });
            let bind = least(3, || assert!(SkinBinding::to_closest(&skin, &triangles, &roots).is_some()));
            let bound = SkinBinding::to_closest(&skin, &triangles, &roots).expect("a ground with faces");
            let before = bound.poses(&skin);
            let moved: Vec<[f32; 3]> = skin.iter().map(|p| [p[0] + 0.01, p[1], p[2] + 0.3 * p[0]]).collect();
            let skinned = least(ROUNDS, || {
                let steps = RigidStep::all_between(&bound, &before, &bound.poses(&moved), 1.0);
                jiggle.step_on(path, &frames[next() % 2], &spring(3.0), 1.0 / 24.0, Some(&steps));
            });
            println!(
                "{curves:7} × {cvs:2} {:>9}: step {step:.3} ms, with a skin {skinned:.3}, of a keyed spring {keyed:.3}, \
                 shape {shape:.3}, binding to 10,000 quads {bind:.1}",
                path.name()
            );
        }
    }
}
