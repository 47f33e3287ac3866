//! What the distance of a mesh costs: `cargo run --release -p liquid --features studies --example shape_study`. `-- 2`
//! runs on two threads.

use std::time::Instant;

use liquid::shape::{MeshShape, MovingShape, ShapeSettings, ShapeTopology};
use numerics::shapes::torus;
use numerics::vector::{Vec3, add};

#[allow(clippy::disallowed_methods, reason = "a measurement")]
fn timed<R>(what: &str, f: impl Fn() -> R) -> R {
    let mut best = f64::INFINITY;
    let mut out = None;
    for _ in 0..5 {
        let start = Instant::now();
        out = Some(f());
        best = best.min(start.elapsed().as_secs_f64());
    }
    println!("  {what}: {:.1} ms", 1e3 * best);
    out.expect("run at least once")
}

fn main() {
    let threads = std::env::args().nth(1).and_then(|n| n.parse().ok()).unwrap_or(1);
    rayon::ThreadPoolBuilder::new().num_threads(threads).build_global().expect("the first pool");
    for (name, size) in [("large ring", [110.0, 36.0, 110.0]), ("small ring", [50.0, 10.0, 50.0])] {
        let mesh = torus(size, 80);
        let points: Vec<Vec3> = mesh.points.iter().map(|p| add(p.map(|x| x as f32), [64.3, 63.8, 64.1])).collect();
        let triangles = mesh.triangles();
        println!("{name} of {} triangles in 128³ cells, {threads} threads", triangles.len());
        let topology = timed("topology", || ShapeTopology::new(&points, &triangles));
        let settings = ShapeSettings::new([0; 3], [128; 3]);
        let shape = timed("distance", || MeshShape::new(&topology, &points, &settings));
        let collider = ShapeSettings { thicken: true, ..settings };
        timed("distance of a collider", || MeshShape::new(&topology, &points, &collider));
        println!("  {} cells, {} of them in the band", shape.rows().len(), shape.band().len());
        let end: Vec<Vec3> = points.iter().map(|p| add(*p, [1.5, 0.5, 0.0])).collect();
        let moving = timed("a frame of motion", || MovingShape::new(&topology, &points, &end, &collider));
        let count = 200_000;
        let place = |n: u32| [n % 128, n / 128 % 128, n * 7 % 128].map(|x| x as f32);
        timed("200,000 distances", || (0..count).map(|n| moving.distance(0.4, place(n))).sum::<f32>());
        timed("200,000 velocities", || (0..count).map(|n| moving.velocity(0.4, place(n))[0]).sum::<f32>());
    }
}
