//! A mesh made smoother, with the volume of each of its closed surfaces kept.

use numerics::parallel;
use numerics::vector::{Vec3, add, cross, dot, scale, sub, unit};

use super::QuadMesh;
use crate::rows::Cell;
use crate::sets::Sets;

/// Share of the way to the mean of its neighbours that a vertex moves, and then back: ripples longer than about eight
/// edges stay as they are (Taubin 1995, pass band 0.1).
const SHARES: [f32; 2] = [0.5, -0.53];
/// Passes up to which that is so. What is in the band grows by up to 8.5e-4 a pass: in 1000 passes the surface of a ball
/// crossed itself. With more, the band gets narrower, so that it grows by at most a tenth in all.
const MOST_OF_BAND: u32 = 112;
/// Times that a surface is moved along its normals to enclose what it did.
const MOVES: usize = 5;
/// The same after more than [`MOST_OF_BAND`] passes, which change it more.
const MANY_MOVES: usize = 20;
/// The farthest, in cells, that it is moved each time.
const FARTHEST: f64 = 0.5;
/// Vertices that one thread moves at a time.
const CHUNK: usize = 2048;

impl QuadMesh {
    /// Smooths ripples of a few cells away, more with each pass, and keeps what is longer. Each closed surface goes on to
    /// enclose what it did, and vertices on the ends of the domain, `low` ≤ place ≤ `high`, stay on them. Unlike a level
    /// set made smoother, thin sheets and small drops do not vanish.
    pub fn smooth(&mut self, passes: u32, low: Cell, high: Cell) {
        if passes == 0 || self.points.is_empty() {
            return;
        }
        let walls = Walls::new(low, high);
        let surfaces = Surfaces::of(self);
        let before = surfaces.volumes(self);
        let (first, neighbours) = self.neighbours(walls);
        let shares = shares(passes);
        for _ in 0..passes {
            for share in shares {
                let old = std::mem::take(&mut self.points);
                let moved = |n: usize| {
                    let near = &neighbours[first[n] as usize..first[n + 1] as usize];
                    if near.is_empty() {
                        return old[n];
                    }
                    let sum = near.iter().fold([0.0; 3], |sum, n| add(sum, old[*n as usize]));
                    let way = sub(scale(sum, 1.0 / near.len() as f32), old[n]);
                    add(old[n], scale(walls.along(old[n], way), share))
                };
                self.points = parallel::tabulate(old.len(), CHUNK, moved);
            }
        }
        let moves = if passes <= MOST_OF_BAND { MOVES } else { MANY_MOVES };
        for _ in 0..moves {
            self.move_outward(&surfaces, &before, walls);
        }
        self.normals = self.area_vectors(walls).iter().map(Areas::normal).collect();
    }

    /// Moves each surface along its normals until it encloses its volume, to first order.
    fn move_outward(&mut self, surfaces: &Surfaces, volumes: &[f64], walls: Walls) {
        let areas = self.area_vectors(walls);
        let ways: Vec<Vec3> =
            areas.iter().zip(&self.points).map(|(areas, point)| walls.along(*point, areas.normal())).collect();
        let mut gains = vec![0.0_f64; volumes.len()];
        for ((areas, way), surface) in areas.iter().zip(&ways).zip(&surfaces.of_vertex) {
            gains[*surface as usize] += f64::from(dot(add(areas.free, areas.wall), *way)) / 3.0;
        }
        let by: Vec<f32> = surfaces
            .volumes(self)
            .iter()
            .zip(volumes)
            .zip(gains)
            .map(|((now, wanted), gain)| {
                let by = (wanted - now) / gain;
                if by.is_finite() { by.clamp(-FARTHEST, FARTHEST) as f32 } else { 0.0 }
            })
            .collect();
        for ((point, way), surface) in self.points.iter_mut().zip(ways).zip(&surfaces.of_vertex) {
            *point = add(*point, scale(way, by[*surface as usize]));
        }
    }

    /// The neighbours of each vertex along the edges of quads that are not on walls: where those of a vertex start, and all
    /// of them, twice where both quads of an edge count. Vertices inside walls have none.
    fn neighbours(&self, walls: Walls) -> (Vec<u32>, Vec<u32>) {
        let edges = || {
            let free = self.quads.iter().filter(|quad| !walls.hold(quad.map(|at| self.points[at as usize])));
            let edges = free.flat_map(|[a, b, c, d]| [(*a, *b), (*b, *c), (*c, *d), (*d, *a)]);
            edges.flat_map(|(a, b)| [(a, b), (b, a)])
        };
        let mut first = vec![0_u32; self.points.len() + 1];
        edges().for_each(|(from, _)| first[from as usize + 1] += 1);
        for n in 1..first.len() {
            first[n] += first[n - 1];
        }
        let (mut next, mut all) = (first.clone(), vec![0; first[self.points.len()] as usize]);
        for (from, to) in edges() {
            all[next[from as usize] as usize] = to;
            next[from as usize] += 1;
        }
        (first, all)
    }

    /// The areas of the quads at each vertex.
    fn area_vectors(&self, walls: Walls) -> Vec<Areas> {
        let mut areas = vec![Areas::default(); self.points.len()];
        for quad in &self.quads {
            let [a, b, c, d] = quad.map(|at| self.points[at as usize]);
            let area = scale(cross(sub(c, a), sub(d, b)), 0.5);
            let is_wall = walls.hold([a, b, c, d]);
            for at in quad {
                let sum = &mut areas[*at as usize];
                let sum = if is_wall { &mut sum.wall } else { &mut sum.free };
                *sum = add(*sum, area);
            }
        }
        areas
    }
}

/// [`SHARES`] for so many passes.
fn shares(passes: u32) -> [f32; 2] {
    let [there, back] = SHARES;
    if passes <= MOST_OF_BAND {
        return SHARES;
    }
    // Growth in all: passes · share² · band² ÷ 4.
    let band = (1.0 / there + 1.0 / back) * (MOST_OF_BAND as f32 / passes as f32).sqrt();
    [there, -1.0 / (1.0 / there - band)]
}

/// Sums of the areas of a vertex's quads, each along its normal: those on the ends of the domain, and the others.
#[derive(Clone, Copy, Default)]
struct Areas {
    free: Vec3,
    wall: Vec3,
}

impl Areas {
    fn normal(&self) -> Vec3 {
        unit(self.free).or_else(|| unit(self.wall)).unwrap_or([0.0, 1.0, 0.0])
    }
}

/// The ends of the domain.
#[derive(Clone, Copy)]
pub(super) struct Walls {
    low: Vec3,
    high: Vec3,
}

impl Walls {
    pub(super) fn new(low: Cell, high: Cell) -> Self {
        Self { low: low.map(|x| x as f32), high: high.map(|x| x as f32) }
    }

    /// Whether a point lies on an end along an axis.
    fn has(&self, axis: usize, point: Vec3) -> bool {
        point[axis] <= self.low[axis] || point[axis] >= self.high[axis]
    }

    /// The part of a way that keeps a point on the ends it lies on.
    pub(super) fn along(&self, point: Vec3, mut way: Vec3) -> Vec3 {
        (0..3).filter(|axis| self.has(*axis, point)).for_each(|axis| way[axis] = 0.0);
        way
    }

    /// Whether a quad lies on an end.
    pub(super) fn hold(&self, quad: [Vec3; 4]) -> bool {
        (0..3).any(|axis| quad.iter().all(|point| self.has(axis, *point)))
    }
}

/// The closed surfaces of a mesh.
struct Surfaces {
    /// The surface of each vertex, counted from 0.
    of_vertex: Vec<u32>,
    /// A vertex of each.
    vertices: Vec<u32>,
}

impl Surfaces {
    fn of(mesh: &QuadMesh) -> Self {
        let mut sets = Sets::new(mesh.points.len());
        for [a, rest @ ..] in &mesh.quads {
            rest.iter().for_each(|b| sets.join(*a, *b));
        }
        let (mut of_vertex, mut vertices) = (vec![0; mesh.points.len()], Vec::new());
        for n in 0..mesh.points.len() as u32 {
            let first = sets.first(n);
            if first == n {
                of_vertex[n as usize] = vertices.len() as u32;
                vertices.push(n);
            }
            of_vertex[n as usize] = of_vertex[first as usize];
        }
        Self { of_vertex, vertices }
    }

    /// What each encloses, in cells; negative where it is a bubble.
    fn volumes(&self, mesh: &QuadMesh) -> Vec<f64> {
        let mut volumes = vec![0.0; self.vertices.len()];
        for quad in &mesh.quads {
            let surface = self.of_vertex[quad[0] as usize] as usize;
            let origin = mesh.points[self.vertices[surface] as usize];
            volumes[surface] += mesh.six_volumes(origin, *quad) / 6.0;
        }
        volumes
    }
}

#[cfg(test)]
mod tests {
    use numerics::random::Key;
    use numerics::vector::length;

    use super::*;
    use crate::extract::{Placement, extract};
    use crate::level_set::LevelSet;
    use crate::rows::CellRows;

    /// The mesh of what `phi` makes of places in a box of 24 cells.
    fn mesh(phi: impl Fn(Vec3) -> f32 + Sync) -> QuadMesh {
        let rows = CellRows::cuboid([0; 3], [24; 3]);
        let values = rows.tabulate(|cell| phi(cell.map(|x| x as f32 + 0.5)));
        let set = LevelSet::new(&rows, &values, [0; 3], [24; 3]);
        extract(set.view(), Placement::Projected)
    }

    fn ripple(point: Vec3) -> f32 {
        let key = point.iter().fold(Key::new(7), |key, x| key.of(x.to_bits().into()));
        key.f32() - 0.5
    }

    #[test]
    fn ripples_fade_and_each_volume_stays() {
        let balls = [([8.0, 8.0, 8.0], 5.0), ([17.0, 17.0, 17.0], 3.0)];
        let ball = |p: Vec3, n: usize| length(sub(p, balls[n].0)) - balls[n].1;
        let rough = mesh(|p| ball(p, 0).min(ball(p, 1)) + 0.6 * ripple(p));
        let mut smooth = rough.clone();
        smooth.smooth(8, [0; 3], [24; 3]);
        // Mean square of how far vertices stick out from their neighbours.
        let roughness = |mesh: &QuadMesh, n: usize| {
            let (first, near) = mesh.neighbours(Walls { low: [0.0; 3], high: [24.0; 3] });
            let out: Vec<f32> = mesh.points.iter().map(|p| ball(*p, n)).collect();
            let at = |v: usize| {
                let near = &near[first[v] as usize..first[v + 1] as usize];
                let mean = near.iter().fold(0.0, |sum, n| sum + out[*n as usize]) / near.len() as f32;
                f64::from((out[v] - mean) * (out[v] - mean))
            };
            let near: Vec<f64> = (0..out.len()).filter(|v| out[*v].abs() < 1.5).map(at).collect();
            near.iter().fold(0.0, |sum, square| sum + square) / near.len() as f64
        };
        for n in 0..2 {
            let (before, after) = (roughness(&rough, n), roughness(&smooth, n));
            assert!(3.0 * after < before, "ball {n}: {before} {after}");
        }
        let volumes = |mesh: &QuadMesh| Surfaces::of(mesh).volumes(mesh);
        let (before, after) = (volumes(&rough), volumes(&smooth));
        assert!(before.len() >= 2);
        for (before, after) in before.iter().zip(&after).filter(|(before, _)| before.abs() > 1.0) {
            assert!((after - before).abs() < 1e-4 * before.abs(), "{before} {after}");
        }
        for (point, normal) in smooth.points.iter().zip(&smooth.normals) {
            let way = if ball(*point, 0) < 1.5 { sub(*point, balls[0].0) } else { sub(*point, balls[1].0) };
            assert!((length(*normal) - 1.0).abs() < 1e-5);
            assert!(length(way) < 2.0 || dot(way, *normal) > 0.7 * length(way));
        }
    }

    #[test]
    fn many_passes_keep_volume_and_shape() {
        let whole = mesh(|p| length(sub(p, [12.0; 3])) - 7.3);
        for passes in [112, 500, 1000] {
            let mut smooth = whole.clone();
            smooth.smooth(passes, [0; 3], [24; 3]);
            let change = smooth.volume() / whole.volume() - 1.0;
            assert!(change.abs() < 1e-4, "{passes}: {change}");
            for (point, normal) in smooth.points.iter().zip(&smooth.normals) {
                let way = sub(*point, [12.0; 3]);
                assert!(
                    (length(way) - 7.3).abs() < 0.2 && dot(way, *normal) > 0.98 * length(way),
                    "{passes}: {point:?}"
                );
            }
        }
    }

    #[test]
    fn a_pool_stays_on_its_walls_and_level() {
        let pool = mesh(|[_, y, _]| y - 9.3);
        let mut smooth = pool.clone();
        smooth.smooth(12, [0; 3], [24; 3]);
        assert!((smooth.volume() - 24.0 * 24.0 * 9.3).abs() < 0.5, "{}", smooth.volume());
        let walls = |p: &Vec3| [0, 1, 2].map(|k| i32::from(p[k] >= 24.0) - i32::from(p[k] <= 0.0));
        for (before, after) in pool.points.iter().zip(&smooth.points) {
            assert_eq!(walls(before), walls(after));
            assert!(before[1] < 9.0 || (after[1] - 9.3).abs() < 0.02, "{after:?}");
        }
    }

    #[test]
    fn none_and_nothing_change_nothing() {
        let ball = mesh(|p| length(sub(p, [12.0; 3])) - 6.0);
        let mut same = ball.clone();
        same.smooth(0, [0; 3], [24; 3]);
        assert_eq!(same, ball);
        let mut empty = QuadMesh::default();
        empty.smooth(3, [0; 3], [24; 3]);
        assert_eq!(empty, QuadMesh::default());
    }
}
