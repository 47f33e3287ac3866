//! How evenly the springs of a body resist stretching in all directions.
//!
//! Springs with k = E·ΣV/L² have Young's modulus E if they point in all directions alike. In tetrahedra that are longer
//! one way than others most edges point that way, and there the body is too stiff. The modulus in a direction follows
//! from the energy of even strains: Σ ½EV(nᵀεn)² over springs with directions n. Particles that may leave the even strain
//! lower it, by up to a quarter where there are few.

use super::body::SoftBody;
use nalgebra::{Matrix6, Vector6};
use numerics::vector::DVec3;

/// Directions are those of whole numbers up to this one along each axis.
const GRID: i32 = 3;

/// Young's modulus of a piece under even stretching, relative to that of its material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DirectionalModulus {
    /// One of its particles, by the caller's index.
    pub particle: u32,
    /// In the softest and in the stiffest direction.
    pub range: [f64; 2],
}

impl SoftBody {
    /// The modulus of each piece that has tetrahedra with a volume.
    pub fn directional_moduli(&self) -> Vec<DirectionalModulus> {
        // Of each piece the stiffness against strains xx, yy, zz, yz, xz, xy at E = 1, and its volume.
        let mut sums = vec![(Matrix6::zeros(), 0.0); self.order.pieces.len()];
        for (spring, energy) in self.spread(|tet| tet.filled()).into_iter().enumerate() {
            let [a, b] = self.ends[spring].map(|end| end as usize);
            let along = self.rest[b] - self.rest[a];
            if energy > 0.0 && along != DVec3::zeros() {
                let strain = products(along.normalize());
                sums[self.layout.piece_of(a)].0 += strain * strain.transpose() * energy;
            }
        }
        for tet in &self.given {
            sums[self.layout.piece_of(self.order.index_of[tet.corners[0] as usize] as usize)].1 += tet.filled();
        }
        let of_piece = |(particles, (stiffness, volume)): (std::ops::Range<usize>, (Matrix6<f64>, f64))| {
            let compliance = (stiffness / volume).cholesky()?.inverse();
            // The stress that stretches along a unit vector d is d dᵀ.
            let moduli = directions().map(|d| 1.0 / products(d).dot(&(compliance * products(d))));
            let range = moduli.fold([f64::INFINITY, 0.0], |[low, high]: [f64; 2], e| [low.min(e), high.max(e)]);
            let particle = self.order.caller_of[particles.start];
            range.iter().all(|modulus| modulus.is_finite()).then_some(DirectionalModulus { particle, range })
        };
        self.pieces().zip(sums).filter_map(of_piece).collect()
    }
}

/// Products of the components of a vector: xx, yy, zz, yz, xz, xy.
fn products(d: DVec3) -> Vector6<f64> {
    Vector6::new(d.x * d.x, d.y * d.y, d.z * d.z, d.y * d.z, d.x * d.z, d.x * d.y)
}

/// Unit vectors all around.
fn directions() -> impl Iterator<Item = DVec3> {
    let all = (-GRID..=GRID).flat_map(|x| (-GRID..=GRID).flat_map(move |y| (0..=GRID).map(move |z| [x, y, z])));
    all.filter(|d| *d != [0; 3]).map(|d| DVec3::from(d.map(f64::from)).normalize())
}

#[cfg(test)]
mod tests {
    use super::super::{Material, Mesh};
    use super::*;
    use crate::tets::{ClosedSurface, FillSettings, PolygonSurface};

    fn moduli(mesh: &Mesh<'_>) -> Vec<DirectionalModulus> {
        let material = Material { density: 1e3.into(), stiffness: 2e4.into(), damping: 0.0.into() };
        SoftBody::new(mesh, &material, &[]).unwrap().directional_moduli()
    }

    /// The springs of a regular tet along the six diagonals of a cube's faces have the stiffness of a cubic crystal with
    /// C₁₁ = 1, C₁₂ = C₄₄ = ½: 2⁄3 along the axes and 6⁄5 along the diagonals of the cube. Twice as long along z, they have
    /// C₃₃ − 2C₁₃²/(C₁₁ + C₁₂) there.
    #[test]
    fn springs_of_a_tet_have_the_modulus_of_their_crystal() {
        let regular = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];
        let mut points = regular.to_vec();
        points.extend(regular.map(|[x, y, z]| [x + 5.0, y, 2.0 * z]));
        let tets = [[0, 1, 2, 3], [4, 5, 6, 7]];
        let long = 4.0 * 16.0 / 25.0 - 2.0 * 64.0 / 625.0 / (0.5 + 2.0 / 25.0 + 0.5);
        for fill in [vec![], vec![0.5, 0.25]] {
            let mut found = moduli(&Mesh { points: &points, tets: &tets, fill: &fill, ..Mesh::default() });
            found.sort_by_key(|modulus| modulus.particle);
            assert_eq!(found.iter().map(|modulus| modulus.particle / 4).collect::<Vec<_>>(), [0, 1]);
            let [even, stretched] = [found[0].range, found[1].range];
            assert!((even[0] - 2.0 / 3.0).abs() < 1e-12 && (even[1] - 1.2).abs() < 1e-12, "{even:?}");
            assert!((stretched[1] - long).abs() < 1e-12, "{stretched:?} instead of {long}");
        }
    }

    #[test]
    fn a_flat_body_has_no_modulus() {
        let points = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [5.0, 0.0, 0.0], [6.0, 0.0, 0.0]];
        let points = [&points[..], &[[5.0, 1.0, 0.0], [5.0, 0.0, 1.0]]].concat();
        let found = moduli(&Mesh { points: &points, tets: &[[0, 1, 2, 3], [4, 5, 6, 7]], ..Mesh::default() });
        assert!(found.len() == 1 && found[0].particle >= 4, "{found:?}");
    }

    /// A bar of 0.1 × 0.4 × 0.1 m whose sides are cut into squares or into rectangles, all cut in two.
    #[test]
    fn long_faces_of_a_surface_make_a_stiff_body() {
        let stiffest = |cells: [usize; 3]| {
            let (points, tets) = crate::tets::cubes(cells, [0.0; 3], [0.1, 0.4, 0.1]);
            let points: Vec<[f32; 3]> = points.iter().map(|p| p.map(|x| x as f32)).collect();
            let faces = crate::tets::boundary(&tets, &points);
            let corners: Vec<u32> = faces.iter().flat_map(|face| face.corners).collect();
            let starts: Vec<u32> = (0..=faces.len() as u32).map(|face| 3 * face).collect();
            let surface = PolygonSurface { starts: &starts, corners: &corners, points: &points };
            let closed = ClosedSurface::of(&surface, true).unwrap();
            let solid = closed.fill(&FillSettings { spacing: 0.0, interior: true }).unwrap();
            let points: Vec<[f64; 3]> = solid.points.iter().map(|p| p.map(f64::from)).collect();
            moduli(&Mesh { points: &points, tets: &solid.tets, ..Mesh::default() })[0].range[1]
        };
        let [even, long, longer] = [[4, 16, 4], [4, 8, 4], [4, 4, 4]].map(stiffest);
        assert!(even < 1.25 && long > 1.4 && longer > 1.9, "{even} {long} {longer}");
    }
}
