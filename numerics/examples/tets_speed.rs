//! Prints how long tets take.
#![allow(clippy::disallowed_methods, reason = "measures time and is no node")]
use numerics::random::Key;
use numerics::tets::{delaunay, lattice::Place};
use cpu_time::ThreadTime as Instant;

fn main() {
    let random = |n: u64| -> Vec<Place> {
        (0..n).map(|k| [0, 1, 2].map(|axis| (Key::new(1).of(k).of(axis).u64() >> 40) as i32)).collect()
    };
    let grid =
        |n: i32| -> Vec<Place> { (0..n * n * n).map(|k| [k % n, k / n % n, k / n / n].map(|x| x * 1000)).collect() };
    let sphere = |n: u64| -> Vec<Place> {
        (0..n)
            .map(|k| {
                let p: [f64; 3] =
                    [0, 1, 2].map(|axis| (0..12).map(|j| Key::new(2).of(k).of(axis).of(j).f64()).sum::<f64>() - 6.0);
                let l = p.iter().map(|x| x * x).sum::<f64>().sqrt();
                p.map(|x| (8388608.0 + 8388000.0 * x / l) as i32)
            })
            .collect()
    };
    for (name, places) in [
        ("random 5k", random(5000)),
        ("random 20k", random(20000)),
        ("random 50k", random(50000)),
        ("random 400k", random(400000)),
        ("grid 27", grid(27)),
        ("sphere 20k", sphere(20000)),
    ] {
        let mut best = f64::INFINITY;
        let mut tets = 0;
        for _ in 0..7 {
            let start = Instant::now();
            tets = delaunay(&places).tets.len();
            best = best.min(start.elapsed().as_secs_f64());
        }
        println!("{name:12} {:8.2} ms {tets} tets", best * 1e3);
    }
}
