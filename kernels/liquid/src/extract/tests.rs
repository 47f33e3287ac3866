use std::collections::BTreeMap;

use numerics::random::Key;
use numerics::vector::{cross, dot, length, sub, unit};
use rayon::ThreadPoolBuilder;

use super::*;
use crate::rows::{Cell, CellRows};

/// φ of every cell of a box.
struct Grid {
    rows: CellRows,
    phi: Vec<f32>,
    low: Cell,
    high: Cell,
}

impl Grid {
    fn new(low: Cell, high: Cell, phi: impl Fn(Vec3) -> f32) -> Self {
        let rows = CellRows::cuboid(low, high);
        let phi = rows.iter().map(|cell| phi(cell.map(|n| n as f32 + 0.5))).collect();
        Self { rows, phi, low: low.map(|n| n - 9), high: high.map(|n| n + 9) }
    }

    fn noise(size: i32, seed: u64) -> Self {
        let key = Key::new(seed);
        let of = |[x, y, z]: Vec3| key.of(x as u64).of(y as u64).of(z as u64).f32() - 0.5;
        Self::new([0; 3], [size; 3], of)
    }

    fn bounded(self, low: Cell, high: Cell) -> Self {
        Self { low, high, ..self }
    }

    fn view(&self) -> PhiView<'_> {
        PhiView { rows: &self.rows, phi: &self.phi, outside: 5.0, low: self.low, high: self.high }
    }

    fn mesh(&self) -> QuadMesh {
        extract(self.view(), Placement::Projected)
    }
}

fn sphere(centre: Vec3, radius: f32) -> impl Fn(Vec3) -> f32 {
    move |p| length(sub(p, centre)) - radius
}

fn torus(centre: Vec3, large: f32, small: f32) -> impl Fn(Vec3) -> f32 {
    move |p| {
        let [x, y, z] = sub(p, centre);
        let ring = (x * x + z * z).sqrt() - large;
        (ring * ring + y * y).sqrt() - small
    }
}

/// Each edge once in each direction, and the quads of each vertex in one circle.
#[track_caller]
fn assert_manifold(mesh: &QuadMesh) {
    let mut edges = BTreeMap::new();
    // At each vertex: from the vertex before it in a quad to the one after.
    let mut fans = vec![BTreeMap::new(); mesh.points.len()];
    for quad in &mesh.quads {
        for n in 0..4 {
            let (a, b, c) = (quad[n], quad[(n + 1) % 4], quad[(n + 2) % 4]);
            assert_eq!(edges.insert((a, b), ()), None, "an edge used twice in one direction");
            fans[b as usize].insert(c, a);
        }
    }
    assert!(edges.keys().all(|(a, b)| edges.contains_key(&(*b, *a))), "an open edge");
    for fan in fans {
        let first = *fan.keys().next().expect("a vertex without quads");
        let (mut at, mut count) = (fan[&first], 1);
        while at != first {
            (at, count) = (fan[&at], count + 1);
        }
        assert_eq!(count, fan.len(), "two fans at one vertex");
    }
}

#[test]
fn white_noise_is_closed_and_manifold() {
    for seed in 0..3 {
        let grid = Grid::noise(24, seed);
        let mesh = grid.mesh();
        assert!(mesh.quads.len() > 10_000);
        assert_manifold(&mesh);
        assert!(mesh.points.iter().chain(&mesh.normals).flatten().all(|x| x.is_finite()));
        // With walls inside the noise, and sparse.
        let grid = Grid { rows: grid.rows.clone(), ..grid }.bounded([3, 0, 5], [20, 11, 6]);
        assert_manifold(&grid.mesh());
        let rows = grid.rows.filtered(|[x, y, z], _| (x * 5 + y * 3 + z) % 7 > 1);
        let phi = rows.resampled(&grid.rows, &grid.phi, 0.0);
        assert_manifold(&Grid { rows, phi, low: [0; 3], high: [24; 3] }.mesh());
    }
}

fn triangles(mesh: &QuadMesh) -> Vec<[u32; 3]> {
    mesh.quads.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect()
}

/// Whether a segment passes through a triangle.
fn pierces(a: Vec3, b: Vec3, [p, q, r]: [Vec3; 3]) -> bool {
    let six = |d: Vec3, e: Vec3, f: Vec3, g: Vec3| volume::six_volumes([d, e, f, g]);
    let (below, above) = (six(p, q, r, a), six(p, q, r, b));
    if below * above >= 0.0 {
        return false;
    }
    let sides = [six(a, b, p, q), six(a, b, q, r), six(a, b, r, p)];
    sides.iter().all(|side| *side > 1e-9) || sides.iter().all(|side| *side < -1e-9)
}

#[test]
fn white_noise_does_not_cross_itself() {
    for seed in 0..6 {
        let mesh = Grid::noise(7, seed).mesh();
        let triangles = triangles(&mesh);
        let points = |corners: [u32; 3]| corners.map(|corner| mesh.points[corner as usize]);
        let boxes: Vec<[Vec3; 2]> = triangles
            .iter()
            .map(|corners| {
                let [a, b, c] = points(*corners);
                let each = |of: fn(f32, f32) -> f32| std::array::from_fn(|axis| of(of(a[axis], b[axis]), c[axis]));
                [each(f32::min), each(f32::max)]
            })
            .collect();
        let mut crossings = 0;
        for (first, [low, high]) in triangles.iter().zip(&boxes) {
            for (second, [from, to]) in triangles.iter().zip(&boxes) {
                let apart = (0..3).any(|axis| low[axis] > to[axis] || from[axis] > high[axis]);
                if apart || first.iter().any(|corner| second.contains(corner)) {
                    continue;
                }
                let [a, b, c] = points(*first);
                crossings += [[a, b], [b, c], [c, a]].iter().filter(|[a, b]| pierces(*a, *b, points(*second))).count();
            }
        }
        assert_eq!(crossings, 0, "seed {seed}");
    }
}

/// The largest and the root mean square angle between normals and `exact`, in degrees.
fn normal_errors(mesh: &QuadMesh, exact: impl Fn(Vec3) -> Vec3) -> (f32, f32) {
    let sine = |(point, normal): (&Vec3, &Vec3)| length(cross(*normal, exact(*point)));
    let sines: Vec<f32> = mesh.points.iter().zip(&mesh.normals).map(sine).collect();
    let squares: f32 = sines.iter().map(|sine| sine * sine).sum();
    let degrees = 180.0 / std::f32::consts::PI;
    (sines.iter().fold(0.0, |a: f32, b| a.max(*b)) * degrees, (squares / sines.len() as f32).sqrt() * degrees)
}

#[test]
fn spheres_and_tori_have_their_volume_and_normals() {
    let pi = std::f64::consts::PI;
    let centre = [32.3, 31.6, 32.1];
    let ball = Grid::new([0; 3], [64; 3], sphere(centre, 22.4)).mesh();
    assert_manifold(&ball);
    let exact = 4.0 / 3.0 * pi * 22.4 * 22.4 * 22.4;
    assert!((ball.volume() / exact - 1.0).abs() < 5e-5, "{}", ball.volume() / exact - 1.0);
    assert!((ball.area() / (4.0 * pi * 22.4 * 22.4) - 1.0).abs() < 0.002);
    let (max, rms) = normal_errors(&ball, |p| unit(sub(p, centre)).unwrap());
    assert!(max < 0.3 && rms < 0.05, "{max} {rms}");
    assert!(ball.points.iter().zip(&ball.normals).all(|(p, n)| dot(*n, sub(*p, centre)) > 0.0));

    let ring = Grid::new([0; 3], [64; 3], torus(centre, 16.0, 6.4)).mesh();
    assert_manifold(&ring);
    let exact = 2.0 * pi * pi * 16.0 * 6.4 * 6.4;
    assert!((ring.volume() / exact - 1.0).abs() < 5e-4, "{}", ring.volume() / exact - 1.0);
    assert_eq!(ring.points.len(), ring.quads.len(), "Euler characteristic of a torus");
}

/// Inscribed quads would enclose less, by 1/(2 R²) of the ball: .125, .056, .031 and .014 of these.
#[test]
fn drops_of_a_few_cells_have_their_volume() {
    for (radius, by) in [(2.0_f32, 0.025), (3.0, 0.006), (4.0, 0.003), (6.0, 1e-3)] {
        for n in 0..8 {
            let centre = [0.13, 0.31, 0.57].map(|step| 10.0 + (step * n as f32).fract());
            let mesh = Grid::new([0; 3], [21; 3], sphere(centre, radius)).mesh();
            let exact = 4.0 / 3.0 * std::f64::consts::PI * f64::from(radius * radius * radius);
            let off = mesh.volume() / exact - 1.0;
            assert!(off.abs() < by, "{radius} at {centre:?}: {off}");
        }
    }
}

#[test]
fn a_projected_sphere_beats_one_at_mean_crossings() {
    let grid = Grid::new([0; 3], [24; 3], sphere([12.2, 11.7, 12.1], 7.0));
    let exact = 4.0 / 3.0 * std::f64::consts::PI * 343.0;
    let error = |placement| (extract(grid.view(), placement).volume() / exact - 1.0).abs();
    assert!(error(Placement::Projected) < 0.4 * error(Placement::Mean));
}

#[test]
fn walls_close_the_mesh_in_their_planes() {
    // A pool 3.3 deep in a box of 10 × 6 × 8, tilted a little.
    let grid = Grid::new([-5; 3], [20; 3], |[x, y, _]| (y - 3.3 - 0.1 * (x - 5.0)) / 1.01_f32.sqrt());
    let mesh = grid.bounded([0; 3], [10, 6, 8]).mesh();
    assert_manifold(&mesh);
    let volume = 3.3 * 10.0 * 8.0;
    assert!((mesh.volume() / volume - 1.0).abs() < 1e-6, "{}", mesh.volume());
    for (axis, side) in [(0, 10.0), (1, f32::INFINITY), (2, 8.0)] {
        for point in &mesh.points {
            let at = point[axis];
            assert!(at >= 0.0 && at <= side);
            assert!(at == 0.0 || at == side || (at >= 0.5 && at <= side - 0.5), "{at} is near a wall, not on it");
        }
    }
    let on_wall = mesh.points.iter().zip(&mesh.normals).filter(|(p, _)| p[1] == 0.0 && p[0] > 0.0 && p[0] < 10.0);
    let on_wall: Vec<_> = on_wall.filter(|(p, _)| p[2] > 0.0 && p[2] < 8.0).collect();
    assert!(on_wall.len() == 9 * 7 && on_wall.iter().all(|(_, n)| **n == [0.0, -1.0, 0.0]));
    // What fills the domain is a box.
    let full = Grid::new([-5; 3], [20; 3], |_| -5.0).bounded([0, 1, 2], [4, 5, 3]).mesh();
    assert_manifold(&full);
    assert_eq!(full.volume(), 16.0);
    assert_eq!(full.area(), 48.0);
}

#[test]
fn one_cell_and_none_make_a_mesh() {
    let empty = extract(Grid::new([0; 3], [0; 3], |_| 0.0).view(), Placement::Projected);
    assert_eq!((empty.points.len(), empty.quads.len(), empty.volume(), empty.area()), (0, 0, 0.0, 0.0));
    let dry = Grid::new([0; 3], [4; 3], |_| 0.0).mesh();
    assert_eq!(dry.points.len(), 0);
    let one = Grid::new([5; 3], [6; 3], |_| -0.5).mesh();
    assert_manifold(&one);
    assert_eq!((one.points.len(), one.quads.len()), (8, 6));
    assert!(one.volume() > 0.0);
    let walled = Grid::new([5; 3], [6; 3], |_| -0.5).bounded([5; 3], [6; 3]).mesh();
    assert_eq!(walled.volume(), 1.0);
    let beyond = Grid::new([5; 3], [6; 3], |_| -0.5).bounded([0; 3], [5; 3]).mesh();
    assert_eq!(beyond.points.len(), 0);
    // The largest finite numbers.
    let huge = Grid::new([0; 3], [6; 3], |[x, ..]| if x < 3.0 { f32::MIN } else { f32::MAX }).mesh();
    assert_manifold(&huge);
    assert!(huge.points.iter().chain(&huge.normals).flatten().all(|x| x.is_finite()));
}

#[test]
fn bits_do_not_depend_on_threads_or_on_what_is_stored_far_away() {
    let grid = Grid::new([0; 3], [40; 3], torus([20.0, 20.0, 20.0], 10.0, 4.2));
    let meshes = [1, 2, 7].map(|threads| {
        let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| grid.mesh())
    });
    assert!(meshes[0].points.len() > 1000);
    assert!(meshes.iter().all(|mesh| *mesh == meshes[0]));
    let rows = grid.rows.filtered(|_, at| grid.phi[at] < 5.0);
    let phi = rows.resampled(&grid.rows, &grid.phi, 0.0);
    assert_eq!(Grid { rows, phi, ..grid }.mesh(), meshes[0]);
}
