//! The surface alone: its mesh, and its markers carried along.

use engine::clock::Stopwatch;
use liquid::extract::{Placement, extract};
use liquid::level_set::{LevelSet, PhiView};
use liquid::markers::Markers;
use liquid::rows::CellRows;
use numerics::vector::{Vec3, length, sub};
use rayon::ThreadPoolBuilder;

use crate::Extent;
use crate::flows::Deformation;
use crate::table::Table;

const ROUNDS: usize = 5;

fn with_threads<T: Send>(threads: usize, run: impl FnOnce() -> T + Send) -> T {
    ThreadPoolBuilder::new().num_threads(threads).build().expect("threads").install(run)
}

/// Meshes of a ball and of a ring, on one thread and on two.
pub(crate) fn extraction(extent: Extent, table: &mut Table) {
    let size = extent.choose(64, 128);
    let n = size as f32;
    let from_centre = |p: Vec3| sub(p, [0.505 * n, 0.494 * n, 0.502 * n]);
    let ball = |p: Vec3| length(from_centre(p)) - 0.35 * n;
    let ring = |p: Vec3| {
        let [x, y, z] = from_centre(p);
        length([length([x, 0.0, z]) - 0.25 * n, y, 0.0]) - 0.1 * n
    };
    let shapes: [(&str, &dyn Fn(Vec3) -> f32); 2] = [("ball", &ball), ("ring", &ring)];
    for (name, shape) in shapes {
        let rows = CellRows::cuboid([0; 3], [size; 3]);
        let phi: Vec<f32> = rows.iter().map(|cell| shape(cell.map(|n| n as f32 + 0.5)).clamp(-5.0, 5.0)).collect();
        let view = PhiView { rows: &rows, phi: &phi, outside: 5.0, low: [0; 3], high: [size; 3] };
        for threads in [1, 2] {
            let (mut least, mut vertices) = (f64::INFINITY, 0);
            for _ in 0..ROUNDS {
                let watch = Stopwatch::start();
                vertices = with_threads(threads, || extract(view, Placement::Projected).points.len());
                least = least.min(watch.wall().as_secs_f64() * 1e3);
            }
            let beside = format!("{vertices} points, {:.0} a ms", vertices as f64 / least);
            let on = if threads == 1 { "one thread" } else { "two threads" };
            table.add(format!("mesh of a {name} in {size}³ cells on {on}"), least, None, " ms", beside);
        }
    }
}

/// LeVeque's deformation: a step of surface and markers, mean over there and back.
pub(crate) fn tracking(extent: Extent, table: &mut Table) {
    let size = extent.choose(64, 100);
    let flow = Deformation::new(size, 3.0);
    let steps = extent.choose(48, flow.steps);
    let high = [size as i32; 3];
    let rows = CellRows::cuboid([0; 3], high);
    let (ms, markers, cells) = with_threads(2, || {
        let phi = rows.tabulate(|cell| flow.start(cell.map(|n| n as f32 + 0.5)));
        let mut set = LevelSet::new(&rows, &phi, [0; 3], high);
        let mut markers = Markers::new(&set, 0, 1);
        let watch = Stopwatch::start();
        for step in 0..steps {
            markers.step(&mut set, &flow.step(step), 1.0);
        }
        (watch.wall().as_secs_f64() * 1e3 / f64::from(steps), markers.markers.len(), set.band().len())
    });
    let most = (size == 100).then_some(50.0);
    let beside = format!("{steps} steps, {markers} markers and {cells} cells at the end");
    table.add(format!("LeVeque's deformation in {size}³ cells, a step"), ms, most, " ms", beside);
}
