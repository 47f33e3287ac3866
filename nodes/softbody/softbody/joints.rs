//! Coupling springs between bodies that touch: the yolk in the white.
//!
//! R1 joins "the interior surface particles of the egg white" with "the exterior surface particles of the yolk". They
//! are recognised by the orientation of the surfaces: a particle is joined to the nearest particles of other bodies
//! within the radius such that each lies outside the other's surface, or, where surfaces overlap, each inside.

use bodies::mass_spring::BodySpring;
use numerics::vector::DVec3;

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
    let at = |particle: u32| DVec3::from(with.points[particle as usize]);
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
            let towards = q - p;
            let distance = towards.norm();
            let [n, m] = [*particle, other].map(|one| normals[one as usize]);
            let facing = if distance > 0.0 { n.dot(&towards) * m.dot(&towards) < 0.0 } else { n.dot(&m) < 0.0 };
            if distance <= reach && facing && with.parts[*particle as usize] != with.parts[other as usize] {
                let rank = nearest.partition_point(|known| *known <= (distance, other));
                nearest.insert(rank, (distance, other));
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
            length: (q - p).norm(),
        }
    };
    pairs.iter().map(spring).collect()
}

/// Normals of the particles, by the area of their triangles.
fn normals(with: &Couple<'_>) -> Vec<DVec3> {
    let mut normals = vec![DVec3::zeros(); with.points.len()];
    for corners in with.triangles {
        let [a, b, c] = corners.map(|corner| DVec3::from(with.points[corner as usize]));
        let twice_area = (b - a).cross(&(c - a));
        corners.iter().for_each(|corner| normals[*corner as usize] += twice_area);
    }
    normals
}
