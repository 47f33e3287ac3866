//! Linear finite elements on the tets of a body: one equation for each free point.
//!
//! The hat function of corner k of a tet of volume V has the gradient −nₖ ÷ 6V, where nₖ is the outward normal of the
//! opposite face, twice its area long. Corners k and l are therefore coupled with the weight −nₖ·nₗ ÷ 36 V. As the
//! weights of a tet are products of one vector for each corner, their matrix is positive semi-definite whatever
//! volume is used.

use super::FLAT;
use numerics::parallel;
use numerics::vector::{DVec3, Vec3, to_f64};

/// Rows of a parallel task.
pub(super) const CHUNK: usize = 1024;

/// A positive semi-definite sparse system.
pub(super) struct Equations {
    /// Row of each free point.
    pub(super) free: Vec<Option<u32>>,
    /// Start of each row's entries, and their number at the end.
    starts: Vec<u32>,
    /// Column and weight of each entry.
    entries: Vec<(u32, f64)>,
    pub(super) diagonal: Vec<f64>,
    /// Contribution of fixed points to each row.
    pub(super) forces: Vec<DVec3>,
}

impl Equations {
    /// For points that have prescribed displacements `held_by` or are free; `ties` are edges besides those of tets, lower
    /// end first, which may lead to held points beyond `points`.
    pub(super) fn of(points: &[Vec3], tets: &[[u32; 4]], ties: &[([u32; 2], f64)], held_by: &[Option<DVec3>]) -> Self {
        let mut rows = 0_u32;
        let number = |held: &Option<DVec3>| {
            held.is_none().then(|| {
                rows += 1;
                rows - 1
            })
        };
        let free: Vec<Option<u32>> = held_by.iter().map(number).collect();
        let edges = edges(points, tets, ties, &free);
        let rows = rows as usize;
        let mut starts = vec![0_u32; rows + 1];
        let ends = |[a, b]: [u32; 2]| [(a, b), (b, a)].map(|(from, to)| (free[from as usize], to));
        for (edge, _) in &edges {
            if let [(Some(a), _), (Some(b), _)] = ends(*edge) {
                starts[a as usize + 1] += 1;
                starts[b as usize + 1] += 1;
            }
        }
        (0..rows).for_each(|row| starts[row + 1] += starts[row]);
        let mut next = starts.clone();
        let mut entries = vec![(0, 0.0); starts[rows] as usize];
        let (mut diagonal, mut forces) = (vec![0.0; rows], vec![DVec3::zeros(); rows]);
        for (edge, weight) in edges {
            for (row, other) in ends(edge) {
                let Some(row) = row.map(|row| row as usize) else { continue };
                diagonal[row] += weight;
                match (free[other as usize], held_by[other as usize]) {
                    (Some(other), _) => {
                        entries[next[row] as usize] = (other, weight);
                        next[row] += 1;
                    }
                    (None, by) => forces[row] += by.unwrap_or_default() * weight,
                }
            }
        }
        Self { free, starts, entries, diagonal, forces }
    }

    /// The matrix times `x`.
    pub(super) fn times(&self, x: &[DVec3], out: &mut [DVec3]) {
        parallel::for_each(out.chunks_mut(CHUNK), |chunk, out| {
            for (position, out) in out.iter_mut().enumerate() {
                let row = chunk * CHUNK + position;
                let mut sum = x[row] * self.diagonal[row];
                for (other, weight) in &self.entries[self.starts[row] as usize..self.starts[row + 1] as usize] {
                    sum -= x[*other as usize] * *weight;
                }
                *out = sum;
            }
        });
    }
}

/// Weights of the edges of a tet, lower ends first.
fn edges_of(points: &[Vec3], tet: &[u32; 4]) -> [([u32; 2], f64); 6] {
    const EDGES: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];
    let weights = weights(&tet.map(|corner| points[corner as usize]));
    EDGES.map(|[k, l]| ([tet[k].min(tet[l]), tet[k].max(tet[l])], weights[k][l]))
}

/// The sum of the weights of each point's edges in tets: how stiff the tets hold it.
pub(super) fn stiffness(points: &[Vec3], tets: &[[u32; 4]]) -> Vec<f64> {
    let mut stiffness = vec![0.0; points.len()];
    for tet in tets {
        for ([a, b], weight) in edges_of(points, tet) {
            stiffness[a as usize] += weight;
            stiffness[b as usize] += weight;
        }
    }
    stiffness
}

/// Weights of the edges with a free end, sorted; those of an edge's tets are summed in order, then those of `ties`.
fn edges(points: &[Vec3], tets: &[[u32; 4]], ties: &[([u32; 2], f64)], free: &[Option<u32>]) -> Vec<([u32; 2], f64)> {
    let has_free = |(edge, _): &([u32; 2], f64)| edge[0] != edge[1] && edge.iter().any(|p| free[*p as usize].is_some());
    let parts = parallel::map(tets.chunks(CHUNK), |_, tets| {
        tets.iter().flat_map(|tet| edges_of(points, tet)).filter(has_free).collect::<Vec<([u32; 2], f64)>>()
    });
    let ties: Vec<([u32; 2], f64)> = ties.iter().copied().filter(has_free).collect();
    let parts: Vec<&[([u32; 2], f64)]> = parts.iter().map(Vec::as_slice).chain([&ties[..]]).collect();
    // By counting for the lower ends, in linear time; then by the other end.
    let mut starts = vec![0; free.len() + 1];
    parts.iter().copied().flatten().for_each(|([low, _], _)| starts[*low as usize + 1] += 1);
    (0..free.len()).for_each(|point| starts[point + 1] += starts[point]);
    let mut next = starts.clone();
    let mut ordered = vec![(0, 0.0); starts[free.len()]];
    for ([low, high], weight) in parts.into_iter().flatten() {
        ordered[next[*low as usize]] = (*high, *weight);
        next[*low as usize] += 1;
    }
    let mut edges: Vec<([u32; 2], f64)> = Vec::with_capacity(ordered.len() / 4);
    for (low, ends) in starts.windows(2).enumerate() {
        let mine = &mut ordered[ends[0]..ends[1]];
        mine.sort_by_key(|(high, _)| *high);
        for (high, weight) in mine {
            let edge = [low as u32, *high];
            match edges.last_mut() {
                Some((last, sum)) if *last == edge => *sum += *weight,
                _ => edges.push((edge, *weight)),
            }
        }
    }
    edges
}

/// Weights between the corners of a tet; 0 if they all coincide.
fn weights(corners: &[Vec3; 4]) -> [[f64; 4]; 4] {
    let edge = longest_edge(corners);
    if edge == 0.0 {
        return [[0.0; 4]; 4];
    }
    // In units of the longest edge, so that no power of a length over- or underflows.
    let [a, b, c, d] = corners.map(|p| (to_f64(p) - to_f64(corners[0])) / edge);
    let normals = [(d - b).cross(&(c - b)), (c - a).cross(&(d - a)), (d - a).cross(&(b - a)), (b - a).cross(&(c - a))];
    let six_volumes = (b - a).dot(&normals[1]).abs().max(FLAT);
    let weight = |k: usize, l: usize| -normals[k].dot(&normals[l]) / (6.0 * six_volumes) * edge;
    std::array::from_fn(|k| std::array::from_fn(|l| weight(k, l)))
}

/// Length of the longest edge of a tet.
pub(super) fn longest_edge(corners: &[Vec3; 4]) -> f64 {
    let wide = corners.map(to_f64);
    let mut longest = 0.0_f64;
    for k in 1..4 {
        for l in 0..k {
            longest = longest.max((wide[k] - wide[l]).norm_squared());
        }
    }
    longest.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_of_a_corner_tet_are_a_sixth_to_its_neighbours_and_zero_between_them() {
        // Gradients of the hat functions: (−1, −1, −1), x, y, z; volume 1/6. Size 2 doubles it.
        let corners = [[0.0; 3], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 2.0]];
        let weights = weights(&corners);
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-15, "{a} {b}");
        (1..4).for_each(|k| close(weights[0][k], 2.0 / 6.0));
        close(weights[1][2], 0.0);
        close(weights[2][3], 0.0);
        close(weights[0][0], -1.0);
    }

    #[test]
    fn weights_of_a_flat_tet_are_finite_and_sum_to_zero() {
        for z in [0.0, 1e-9, 1e-3] {
            let corners = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.7, 0.7, z]];
            for row in weights(&corners) {
                assert!(row.iter().all(|x| x.is_finite()));
                assert!(row.iter().sum::<f64>().abs() <= 1e-14 / FLAT);
            }
        }
        assert_eq!(weights(&[[3.0; 3]; 4]), [[0.0; 4]; 4]);
    }
}
