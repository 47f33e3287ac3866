//! The paper's steps against the exact contact.

use super::*;
use numerics::shapes::icosphere;

/// Slope of log error against log steps, over 2 to 256 steps, of hairs on a sphere blown along x.
pub(super) fn slope() -> f64 {
    let mesh = icosphere(1.0, 4);
    let points: Vec<Point> = mesh.points.iter().map(|point| to_f32((*point).into())).collect();
    let tree = TriangleTree::build(&points, &mesh.triangles());
    let obstacles = [&tree];
    let hair = |k: u64| {
        let up = random_unit(Key::new(5).of(k));
        let foot = up * 1.001;
        let ends = |along: DVec3| [to_f32(foot), to_f32(foot + along.normalize() * 0.3)];
        (ends(up + random_unit(Key::new(6).of(k)) * 0.3), ends(up + DVec3::x() * 3.0))
    };
    let (rest, goal): (Vec<_>, Vec<_>) = (0..4000).map(hair).unzip();
    let starts: Vec<u32> = (0..=4000).map(|k| 2 * k).collect();
    let end = |method: ContactMethod| {
        collide(&starts, rest.as_flattened(), goal.as_flattened(), &plain(&obstacles, method, 1e-9)).points
    };
    let exact = end(ContactMethod::Exact);
    let error = |steps: u32| {
        let apart = |(a, b): (&Point, &Point)| (to_f64(*a) - to_f64(*b)).norm();
        end(ContactMethod::Steps(steps)).iter().zip(&exact).map(apart).sum::<f64>()
    };
    // Least-squares line through (log steps, log error).
    let rows: Vec<[f64; 2]> = (1..=8).map(|k| [f64::from(k), libm::log2(error(1 << k))]).collect();
    let mean = [0, 1].map(|axis| rows.iter().map(|row| row[axis]).sum::<f64>() / rows.len() as f64);
    let product = |a: usize, b: usize| rows.iter().map(|row| (row[a] - mean[a]) * (row[b] - mean[b])).sum::<f64>();
    -product(0, 1) / product(0, 0)
}
