//! Coupling springs between bodies that touch: the yolk in the white.
//!
//! R1 joins "the interior surface particles of the egg white" with "the exterior surface particles of the yolk". They
//! are recognised by the orientation of the surfaces: a particle is joined to the nearest particles of other bodies
//! within the radius such that each lies outside the other's surface, or, where surfaces overlap, each inside.

use bodies::mass_spring::BodySpring;

/// The most springs that start from one particle.
const MOST: usize = 4;

/// The particles that may be joined.
pub(super) struct Couple<'a> {
    pub(super) points: &'a [[f64; 3]],
    /// Surfaces, outwards.
    pub(super) triangles: &'a [[u32; 3]],
    /// The body of each particle.
    pub(super) parts: &'a [u32],
    /// Metres; 0 joins nothing.
    pub(super) radius: f64,
    /// N/m.
    pub(super) stiffness: f64,
    /// β, seconds.
    pub(super) damping: f64,
}

/// Springs with the particles' distance as rest length, ordered by their particles.
pub(super) fn couple(with: &Couple<'_>) -> Vec<BodySpring> {
    if with.radius <= 0.0 || with.points.as_flattened().iter().any(|x| !x.is_finite()) {
        return Vec::new();
    }
    let normals = normals(with);
    let at = |particle: u32| with.points[particle as usize];
    // Sorted by x, so that particles close in x are close in the list.
    let mut row: Vec<u32> = with.triangles.as_flattened().to_vec();
    row.sort_unstable();
    row.dedup();
    row.sort_by(|a, b| at(*a)[0].total_cmp(&at(*b)[0]).then(a.cmp(b)));
    let mut pairs: Vec<[u32; 2]> = Vec::new();
    for (place, particle) in row.iter().enumerate() {
        let mut nearest: Vec<(f64, u32)> = Vec::with_capacity(MOST + 1);
        let mut look = |other: u32| {
            let reach = nearest.get(MOST - 1).map_or(with.radius, |last| last.0);
            let (p, q) = (at(*particle), at(other));
            if (q[0] - p[0]).abs() > reach {
                return false;
            }
            let way: [f64; 3] = std::array::from_fn(|k| q[k] - p[k]);
            let dot = |a: &[f64; 3], b: &[f64; 3]| (0..3).map(|k| a[k] * b[k]).sum::<f64>();
            let far = dot(&way, &way).sqrt();
            let [n, m] = [*particle, other].map(|one| normals[one as usize]);
            let facing = if far > 0.0 { dot(&n, &way) * dot(&m, &way) < 0.0 } else { dot(&n, &m) < 0.0 };
            if far <= reach && facing && with.parts[*particle as usize] != with.parts[other as usize] {
                let rank = nearest.partition_point(|known| *known <= (far, other));
                nearest.insert(rank, (far, other));
                nearest.truncate(MOST);
            }
            true
        };
        row[..place].iter().rev().all(|other| look(*other));
        row[place + 1..].iter().all(|other| look(*other));
        pairs.extend(nearest.iter().map(|(_, other)| [(*particle).min(*other), (*particle).max(*other)]));
    }
    pairs.sort_unstable();
    pairs.dedup();
    let spring = |ends: &[u32; 2]| {
        let [p, q] = ends.map(at);
        BodySpring {
            ends: *ends,
            stiffness: with.stiffness,
            damping: with.damping * with.stiffness,
            length: (0..3).map(|k| (q[k] - p[k]) * (q[k] - p[k])).sum::<f64>().sqrt(),
        }
    };
    pairs.iter().map(spring).collect()
}

/// Normals of the particles, by the area of their triangles.
fn normals(with: &Couple<'_>) -> Vec<[f64; 3]> {
    let mut normals = vec![[0.0; 3]; with.points.len()];
    for corners in with.triangles {
        let [a, b, c] = corners.map(|corner| with.points[corner as usize]);
        let (p, q): ([f64; 3], [f64; 3]) = (std::array::from_fn(|k| b[k] - a[k]), std::array::from_fn(|k| c[k] - a[k]));
        for corner in corners {
            let sum = &mut normals[*corner as usize];
            (0..3).for_each(|k| sum[k] += p[(k + 1) % 3] * q[(k + 2) % 3] - p[(k + 2) % 3] * q[(k + 1) % 3]);
        }
    }
    normals
}
