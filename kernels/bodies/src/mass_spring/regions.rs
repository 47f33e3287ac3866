//! Regions: groups of tetrahedra whose total volume is preserved.
//!
//! One pressure for each tetrahedron would leave particles no freedom (there are five to six times as many tetrahedra
//! as particles), and the body would lock. One pressure for a group of tetrahedra, with particles in the interior of
//! every face between two groups, is a stable mixed discretisation: piecewise linear displacements on a finer mesh
//! than the piecewise constant pressures. Only particles on a region's boundary change its volume, which makes it
//! much cheaper than single tetrahedra. Limit: volume can move within a region; there only the springs and the
//! barrier against inversion resist.

use crate::tets::oriented_boundary;
use numerics::cluster_order::CompactSets;
use numerics::partition::Partition;
use numerics::pieces::pieces;
use numerics::quad::Quad;
use numerics::simd::{Path, kernel};
use numerics::vector::DVec3;

/// Tetrahedra in a region, about eight cells of six. With 160 a frame costs a tenth less and a pressed block bulges
/// less evenly; with 20 it costs a tenth more.
const TETS: usize = 48;

/// Regions and their closed boundary surfaces.
#[derive(Clone, Debug, Default)]
pub(super) struct Regions {
    /// Tetrahedra of each region.
    tets: Vec<Vec<u32>>,
    /// Start of each region's entries in `particles`.
    pub(super) starts: Vec<u32>,
    /// Particles on the boundary of each region.
    pub(super) particles: Vec<u32>,
    /// Boundary faces of each region, outwards, as indices into its own particles.
    faces: Vec<Vec<[u16; 3]>>,
    /// For each region the sum of E·V at rest over its tetrahedra, joules, and its β, seconds.
    pub(super) energy: Vec<f64>,
    pub(super) damping: Vec<f64>,
}

impl Regions {
    /// Groups `tets` over the particles at `rest`.
    pub(super) fn new(rest: &[DVec3], tets: &[[u32; 4]]) -> Self {
        let centres: Vec<DVec3> =
            tets.iter().map(|tet| tet.iter().map(|c| rest[*c as usize]).sum::<DVec3>() * 0.25).collect();
        let joined = tets.iter().flat_map(|[a, b, c, d]| [[*a, *b], [*a, *c], [*a, *d]]);
        let piece = pieces(rest.len(), joined);
        let roots: Vec<u32> = tets.iter().map(|tet| piece[tet[0] as usize]).collect();
        let sets = CompactSets::new(&centres, &roots, usize::MAX, |count| count.div_ceil(TETS));
        let members = sets.starts.windows(2).map(|ends| sets.items[ends[0]..ends[1]].to_vec());
        let mut regions = Self { tets: members.collect(), starts: vec![0], ..Self::default() };
        for region in 0..regions.tets.len() {
            let faces = oriented_boundary(regions.tets[region].iter().map(|tet| tets[*tet as usize]));
            let mut corners: Vec<u32> = faces.iter().flatten().copied().collect();
            corners.sort_unstable();
            corners.dedup();
            let local = |corner: u32| corners.partition_point(|known| *known < corner) as u16;
            regions.faces.push(faces.iter().map(|face| face.map(local)).collect());
            regions.particles.extend(&corners);
            regions.starts.push(regions.particles.len() as u32);
        }
        regions
    }

    /// Number of regions.
    pub(super) fn len(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// The regions in fixed parts, for parallel loops.
    pub(super) fn partition(&self) -> Partition {
        Partition::even(self.len(), 32, TETS)
    }

    /// Sums of `values`, one for each tetrahedron, over each region.
    pub(super) fn sums(&self, values: impl Fn(usize) -> f64) -> Vec<f64> {
        self.tets.iter().map(|tets| tets.iter().map(|tet| values(*tet as usize)).sum()).collect()
    }

    /// Sets volume, E and β of the tetrahedra.
    pub(super) fn set_material(&mut self, volumes: &[f64], moduli: &[f64], damping: &[f64]) {
        self.energy = self.sums(|tet| volumes[tet] * moduli[tet]);
        let (weighed, all) = (self.sums(|tet| volumes[tet] * damping[tet]), self.sums(|tet| volumes[tet]));
        self.damping = weighed.iter().zip(&all).map(|(sum, all)| if *all > 0.0 { sum / all } else { 0.0 }).collect();
    }

    /// The boundary triangles of a region, outwards.
    pub(super) fn around(&self, region: usize) -> impl Iterator<Item = [u32; 3]> {
        let corners = self.of(region);
        self.faces[region].iter().map(|face| face.map(|corner| corners[usize::from(corner)]))
    }

    /// The particles on the boundary of a region.
    pub(super) fn of(&self, region: usize) -> &[u32] {
        &self.particles[self.starts[region] as usize..self.starts[region + 1] as usize]
    }

    /// Volume of a region with particles at `x`, and its gradient with respect to each boundary particle, m². `corners` is a
    /// buffer.
    pub(super) fn measure(
        &self,
        region: usize,
        x: &[DVec3],
        corners: &mut Vec<[Quad; 2]>,
        gradient: &mut [DVec3],
    ) -> f64 {
        corners.clear();
        corners.extend(self.of(region).iter().map(|corner| [Quad::new(x[*corner as usize]), Quad::default()]));
        measure(Path::chosen(), &self.faces[region], corners, gradient)
    }
}

kernel! {
    /// Volume within `faces` between `corners`, which are positions and zeros, and its gradient with respect to these.
    fn measure(faces: &[[u16; 3]], corners: &mut [[Quad; 2]], gradient: &mut [DVec3]) -> f64 = measure_body;
}

#[inline(always)]
fn measure_body(faces: &[[u16; 3]], corners: &mut [[Quad; 2]], gradient: &mut [DVec3]) -> f64 {
    for face in faces {
        let [a, b, c] = face.map(usize::from);
        let at = corners[a][0];
        let twice_area = (corners[b][0] - at).cross(corners[c][0] - at);
        corners[a][1] += twice_area;
        corners[b][1] += twice_area;
        corners[c][1] += twice_area;
    }
    // The area vectors around a corner of a closed surface sum to six times the gradient. As the volume is
    // homogeneous of degree 3, it is a third of Σ x·gradient, taken relative to a nearby origin to avoid
    // cancellation.
    let origin = corners.first().map_or(Quad::default(), |first| first[0]);
    let mut volume = 0.0;
    for (part, [at, areas]) in gradient.iter_mut().zip(corners) {
        *part = areas.xyz() / 6.0;
        volume += part.dot(&(*at - origin).xyz());
    }
    volume / 3.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A unit cube of six tetrahedra around its diagonal.
    fn cube() -> (Vec<DVec3>, Vec<[u32; 4]>) {
        let points = (0..8).map(|i| DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2))).collect();
        let tets = vec![[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]];
        (points, tets)
    }

    #[test]
    fn the_volume_gradient_at_a_corner_is_a_third_of_its_area() {
        let (points, tets) = cube();
        let mut regions = Regions::new(&points, &tets);
        assert_eq!(regions.len(), 1);
        let far: Vec<DVec3> = points.iter().map(|p| p * 2.0 + DVec3::new(1e4, -1e4, 1e4)).collect();
        let mut gradient = vec![DVec3::zeros(); 8];
        assert!((regions.measure(0, &far, &mut Vec::new(), &mut gradient) - 8.0).abs() < 1e-9);
        // Six of the twelve triangles, each of area 2, lie on the three faces at the corner where all diagonals
        // start.
        assert!((gradient[0] - DVec3::repeat(-4.0 / 3.0)).norm() < 1e-9, "{}", gradient[0]);
        assert!(gradient.iter().sum::<DVec3>().norm() < 1e-9);
        regions.set_material(&[1.0 / 6.0; 6], &[30.0; 6], &[0.5; 6]);
        assert!((regions.energy[0] - 30.0).abs() < 1e-12 && (regions.damping[0] - 0.5).abs() < 1e-12);
    }

    #[test]
    fn the_boundary_of_a_region_encloses_its_volume() {
        let (points, tets) = cube();
        let regions = Regions::new(&points, &tets);
        let enclosed = |[a, b, c]: [u32; 3]| {
            let [a, b, c] = [a, b, c].map(|corner| points[corner as usize]);
            a.dot(&b.cross(&c)) / 6.0
        };
        assert!((regions.around(0).map(enclosed).sum::<f64>() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_regions_volume_is_the_sum_of_its_tetrahedra_even_where_they_overlap() {
        // Both are on the same side of the face 0 1 2: 1 × ½ ÷ 3 and 2 × ½ ÷ 3.
        let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.2, 0.2, 2.0]];
        let mut points = corners.map(DVec3::from);
        let regions = Regions::new(&points, &[[0, 1, 2, 3], [0, 1, 2, 4]]);
        let mut gradient = [DVec3::zeros(); 5];
        assert!((regions.measure(0, &points, &mut Vec::new(), &mut gradient) - 0.5).abs() < 1e-15);
        let mut moved = |point: usize, axis: usize, by: f64| {
            points[point][axis] += by;
            let volume = regions.measure(0, &points, &mut Vec::new(), &mut [DVec3::zeros(); 5]);
            points[point][axis] -= by;
            volume
        };
        // The volume is linear in each single coordinate.
        for (point, axis) in (0..15).map(|k| (k / 3, k % 3)) {
            let slope = 0.5 * (moved(point, axis, 1.0) - moved(point, axis, -1.0));
            assert!((slope - gradient[point][axis]).abs() < 1e-14, "{point} {axis}: {slope} {}", gradient[point]);
        }
    }
}
