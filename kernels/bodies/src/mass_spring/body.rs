//! A soft body: particles with mass, springs between them, tetrahedra with a rest volume.
//!
//! There is a spring on every edge of the tetrahedra with k = E·ΣV/L² (van Gelder 1998), which makes stiffness
//! independent of mesh resolution, and a dashpot c = β·k parallel to it. The mass of a tetrahedron is distributed
//! equally to its corners.
//!
//! The same mesh always gives the same springs in the same order. Limits: the stiffness of a spring shorter than
//! [`SHORTEST`] is computed as if it had that length; particles without mass get [`LIGHTEST`]; a tetrahedron that is
//! inverted at rest is treated as its mirror image, and a flat one has no volume to preserve. Metres, seconds,
//! kilograms.

use super::coarse::Layout;
use super::regions::Regions;
use super::spacing::spacings;
use super::tet_springs::{EDGES, edges, neighbours_of_missing};
use crate::embedding::{EmbeddedPoint, with_riding};
use crate::tets::bounds;
use numerics::adjacency::Adjacency;
use numerics::cluster_order::ClusterOrder;
use numerics::masked::Masked;
use numerics::partition::Partition;
use numerics::vector::DVec3;
use std::ops::Range;

/// Shortest length used in k = E·ΣV/L², as a fraction of the mean length: bounds k at duplicate points to 1e6 times
/// that of other springs.
pub const SHORTEST: f64 = 1e-3;
/// Smallest mass of a particle, as a fraction of the mean: for points in no tetrahedron.
pub const LIGHTEST: f64 = 1e-3;
/// A tetrahedron whose volume is below this fraction of the cube of its longest edge is flat: rounding of f32
/// positions reaches 1e-7.
const FLAT: f64 = 1e-6;

/// The mean of a masked number over some particles, clamped to be non-negative.
fn mean_over<const N: usize>(number: &Masked<'_, f64>, particles: [u32; N]) -> f64 {
    let factors = particles.map(|particle| f64::from(number.factor(particle as usize)));
    (number.value * (factors.iter().sum::<f64>() / N as f64)).max(0.0)
}

/// A tetrahedral mesh at rest.
#[derive(Clone, Copy, Debug, Default)]
pub struct Mesh<'a> {
    /// Positions of the particles, metres.
    pub points: &'a [[f64; 3]],
    /// Corners of each tetrahedron.
    pub tets: &'a [[u32; 4]],
    /// Which tetrahedra are too flat for volume preservation; their edges and masses still count. May be empty: none.
    pub slivers: &'a [bool],
    /// The share of each tetrahedron that is filled with material, which scales its mass and stiffness. May be empty: all
    /// of it.
    pub fill: &'a [f32],
    /// Surface edges that no tetrahedron has. They become springs with the mean E·ΣV of the surface edges at their
    /// ends.
    pub missing: &'a [[u32; 2]],
    /// Points that ride along on particles, by which bodies may meet things: contact points count on from the particles.
    pub riding: &'a [EmbeddedPoint],
}

/// Material parameters.
#[derive(Clone, Copy, Debug)]
pub struct Material<'a> {
    /// Density, kg/m³.
    pub density: Masked<'a, f64>,
    /// Young's modulus E, Pa.
    pub stiffness: Masked<'a, f64>,
    /// β = c ÷ k, seconds.
    pub damping: Masked<'a, f64>,
}

/// A spring given explicitly, between particles of the same or of different bodies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodySpring {
    /// The two particles.
    pub ends: [u32; 2],
    /// Stiffness k, N/m.
    pub stiffness: f64,
    /// Damping c, N·s/m.
    pub damping: f64,
    /// Rest length, metres; with 0 the spring pulls its ends together.
    pub length: f64,
}

/// Why a body could not be built.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BodyError {
    /// A coordinate is NaN or infinite.
    #[error("point {0} is not finite")]
    Point(usize),
    /// A tetrahedron, spring or riding point, of an index, has a particle out of range, or one of the first two a particle
    /// twice.
    #[error("{0} {1} joins particles {2:?}; expected distinct indices below {3}")]
    Particles(&'static str, usize, Vec<u32>, usize),
    /// A parameter of the spring or particle of an index is negative or not finite.
    #[error("`{0}` of {1} is {2}; expected a finite number, 0 or more")]
    Number(&'static str, usize, f64),
    /// The total mass is zero.
    #[error("the body has no mass; expected at least one tet with a volume and a density above 0")]
    NoMass,
}

/// Particles, springs and tetrahedra in the solver's order.
#[derive(Clone, Debug)]
pub struct SoftBody {
    pub(super) order: ClusterOrder,
    /// Rest positions, in the solver's order.
    pub(super) rest: Vec<DVec3>,
    pub(super) mass: Vec<f64>,
    /// Ends of each spring: tetrahedron edges first, then missing edges, then explicit springs.
    pub(super) ends: Vec<[u32; 2]>,
    pub(super) stiffness: Vec<f64>,
    pub(super) damping: Vec<f64>,
    pub(super) lengths: Vec<f64>,
    /// Incident springs of each particle.
    pub(super) adjacency: Adjacency,
    /// Tetrahedra with a volume, oriented so that it is positive.
    pub(super) tets: Vec<[u32; 4]>,
    pub(super) volumes: Vec<f64>,
    /// Young's modulus of each of `tets`, times the share that is filled.
    pub(super) moduli: Vec<f64>,
    pub(super) regions: Regions,
    pub(super) layout: Layout,
    /// Springs in fixed parts, for parallel loops.
    pub(super) spring_partition: Partition,
    /// Tetrahedra in fixed parts.
    pub(super) tet_partition: Partition,
    /// All tetrahedra of the mesh by the caller's indices, with their six springs and unsigned volumes.
    pub(super) given: Vec<MeshTet>,
    /// Index in the mesh of each of `tets`.
    kept: Vec<u32>,
    /// Number of springs that come from the mesh; explicit ones follow.
    pub(super) mesh_spring_count: usize,
    /// For each missing edge, the surface edges whose mean stiffness it takes.
    means: Vec<Vec<u32>>,
    /// Points that ride along, by the caller's indices.
    pub(super) riding: Vec<EmbeddedPoint>,
    /// Longest side of the bounding box at rest, metres.
    pub(super) size: f64,
    /// For each particle the mean rest length of the springs of its piece, metres.
    pub(super) spacing: Vec<f64>,
}

#[derive(Clone, Debug)]
pub(super) struct MeshTet {
    pub(super) corners: [u32; 4],
    springs: [u32; 6],
    volume: f64,
    /// The share of the volume that is filled with material.
    fill: f64,
}

impl MeshTet {
    /// Volume of the material in it, m³.
    pub(super) fn filled(&self) -> f64 {
        self.volume * self.fill
    }
}

impl SoftBody {
    /// A body with the shape of `mesh`, made of `material`, and explicit springs `joints`.
    ///
    /// # Errors
    /// If a number is not finite, an index is out of range, or the total mass is zero.
    pub fn new(mesh: &Mesh<'_>, material: &Material<'_>, joints: &[BodySpring]) -> Result<Self, BodyError> {
        let mut body = Self::from_mesh(mesh, joints)?;
        body.set_material(material)?;
        Ok(body)
    }

    /// A pure mass-spring network: `masses` in kilograms, joined by `springs`.
    ///
    /// # Errors
    /// As [`SoftBody::new`].
    pub fn of_springs(points: &[[f64; 3]], masses: &[f64], springs: &[BodySpring]) -> Result<Self, BodyError> {
        let mut body = Self::from_mesh(&Mesh { points, ..Mesh::default() }, springs)?;
        let masses: Vec<f64> = masses.iter().copied().chain(std::iter::repeat(0.0)).take(points.len()).collect();
        body.set_masses(&masses)?;
        Ok(body)
    }

    /// Number of particles.
    pub fn len(&self) -> usize {
        self.rest.len()
    }

    /// Whether there are no particles.
    pub fn is_empty(&self) -> bool {
        self.rest.is_empty()
    }

    /// The two particles of each spring, by the caller's indices.
    pub fn springs(&self) -> Vec<[u32; 2]> {
        self.ends.iter().map(|ends| ends.map(|end| self.order.caller_of[end as usize])).collect()
    }

    /// Stiffness k of each spring, N/m.
    pub fn stiffnesses(&self) -> &[f64] {
        &self.stiffness
    }

    /// Rest length of each spring before any plastic flow or reset, metres.
    pub fn lengths(&self) -> &[f64] {
        &self.lengths
    }

    /// Mass of each particle, by the caller's index, kilograms.
    pub fn masses(&self) -> Vec<f64> {
        self.order.index_of.iter().map(|particle| self.mass[*particle as usize]).collect()
    }

    /// The regions whose volume is preserved: the boundary triangles of each, facing outwards, by the caller's
    /// indices.
    pub fn regions(&self) -> Vec<Vec<[u32; 3]>> {
        let caller = |particle: u32| self.order.caller_of[particle as usize];
        (0..self.regions.len())
            .map(|region| self.regions.around(region).map(|face| face.map(caller)).collect())
            .collect()
    }

    /// Longest side of the bounding box at rest, metres: the length that tolerances are relative to.
    pub fn size(&self) -> f64 {
        self.size
    }

    /// Σ E·V over the tetrahedra, joules.
    pub(super) fn modulus_times_volume(&self) -> f64 {
        self.volumes.iter().zip(&self.moduli).map(|(volume, modulus)| volume * modulus).sum()
    }

    /// E ÷ (ρgh) of the piece that carries its own weight worst, with h its height at rest along `gravity`, m/s²;
    /// infinite without weight.
    pub fn stiffness_to_weight(&self, gravity: [f64; 3]) -> f64 {
        self.stiffness_to_weights(gravity.into()).into_iter().fold(f64::INFINITY, f64::min)
    }

    /// The same of each piece.
    pub(super) fn stiffness_to_weights(&self, gravity: DVec3) -> Vec<f64> {
        let mut stiff = vec![0.0; self.len()];
        for ((tet, volume), modulus) in self.tets.iter().zip(&self.volumes).zip(&self.moduli) {
            stiff[tet[0] as usize] += volume * modulus;
        }
        let ratio = |particles: Range<usize>| {
            let along = self.rest[particles.clone()].iter().map(|x| gravity.dot(x));
            let (low, high) =
                along.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
            stiff[particles.clone()].iter().sum::<f64>() / (self.mass_of(particles) * (high - low))
        };
        self.pieces().map(ratio).collect()
    }

    /// The particles of each piece.
    pub(super) fn pieces(&self) -> impl Iterator<Item = Range<usize>> {
        let clusters = |cluster: usize| self.order.clusters.range(cluster);
        self.order.pieces.iter().map(move |piece| clusters(piece.start).start..clusters(piece.end - 1).end)
    }

    /// Mass of some particles, kilograms.
    pub(super) fn mass_of(&self, particles: Range<usize>) -> f64 {
        self.mass[particles].iter().sum()
    }

    /// The mean of `values` over some particles, weighted by mass.
    pub(super) fn mean_by_mass(&self, particles: Range<usize>, values: &[DVec3]) -> DVec3 {
        let each = particles.clone().map(|particle| values[particle] * self.mass[particle]);
        each.sum::<DVec3>() / self.mass_of(particles)
    }

    /// Number of contact points: particles and points that ride along.
    pub(super) fn contact_point_count(&self) -> usize {
        self.len() + self.riding.len()
    }

    /// The index of each of the caller's contact points: the solver's of particles, the same of those that ride along.
    pub(super) fn contact_indices(&self) -> impl Iterator<Item = usize> {
        self.order.index_of.iter().map(|particle| *particle as usize).chain(self.len()..self.contact_point_count())
    }

    /// The caller's contact points with particles at `x`.
    pub(super) fn contact_points(&self, x: &[DVec3]) -> Vec<[f64; 3]> {
        let particles = self.order.index_of.iter().map(|particle| x[*particle as usize].into()).collect();
        with_riding(particles, &self.riding)
    }

    /// Permutes vectors of particles from the caller's to the solver's order.
    pub(super) fn to_solver_order(&self, values: &[[f64; 3]]) -> Vec<DVec3> {
        self.order.caller_of.iter().map(|caller| values[*caller as usize].into()).collect()
    }

    /// Changes masses and stiffnesses; shape and state are kept.
    ///
    /// # Errors
    /// If the total mass is zero, or a number is not finite.
    pub fn set_material(&mut self, material: &Material<'_>) -> Result<(), BodyError> {
        let mut masses = vec![0.0; self.len()];
        let mesh_spring_count = self.mesh_spring_count;
        for tet in &self.given {
            let quarter = 0.25 * tet.filled() * mean_over(&material.density, tet.corners);
            tet.corners.iter().for_each(|corner| masses[*corner as usize] += quarter);
        }
        let stored = self.spread(|tet| tet.filled() * mean_over(&material.stiffness, tet.corners));
        let shortest = SHORTEST * mean(&self.lengths[..mesh_spring_count]);
        for spring in 0..mesh_spring_count {
            let length = self.lengths[spring].max(shortest);
            let k = if length > 0.0 { stored[spring] / (length * length) } else { 0.0 };
            let ends = self.ends[spring].map(|end| self.order.caller_of[end as usize]);
            self.stiffness[spring] = stiffness(spring, k)?;
            self.damping[spring] = number("damping", spring, mean_over(&material.damping, ends) * k)?;
        }
        let modulus = |tet: &MeshTet| tet.fill * mean_over(&material.stiffness, tet.corners);
        self.moduli = self.kept.iter().map(|tet| modulus(&self.given[*tet as usize])).collect();
        let corners = |tet: &u32| self.given[*tet as usize].corners;
        let damping: Vec<f64> = self.kept.iter().map(|tet| mean_over(&material.damping, corners(tet))).collect();
        self.regions.set_material(&self.volumes, &self.moduli, &damping);
        self.set_masses(&masses)
    }

    /// For each spring of the mesh the sum of `energy`, E·V, over its tetrahedra, joules; for missing edges the mean of the
    /// surface edges at their ends.
    pub(super) fn spread(&self, energy: impl Fn(&MeshTet) -> f64) -> Vec<f64> {
        let mut sums = vec![0.0; self.mesh_spring_count];
        for tet in &self.given {
            let energy = energy(tet);
            tet.springs.iter().for_each(|spring| sums[*spring as usize] += energy);
        }
        let first = self.mesh_spring_count - self.means.len();
        for (spring, near) in (first..).zip(&self.means) {
            sums[spring] = near.iter().map(|edge| sums[*edge as usize]).sum::<f64>() / near.len().max(1) as f64;
        }
        sums
    }

    fn set_masses(&mut self, masses: &[f64]) -> Result<(), BodyError> {
        let sum =
            masses.iter().enumerate().try_fold(0.0, |sum, (index, mass)| Ok(sum + number("mass", index, *mass)?))?;
        let weighs = sum > 0.0 && sum.is_finite();
        if !weighs && !masses.is_empty() {
            return Err(BodyError::NoMass);
        }
        let least = LIGHTEST * sum / masses.len() as f64;
        self.mass = self.order.caller_of.iter().map(|caller| masses[*caller as usize]).collect();
        self.mass.iter_mut().filter(|mass| **mass <= 0.0).for_each(|mass| *mass = least);
        Ok(())
    }

    /// Everything but masses and the stiffnesses of mesh springs.
    fn from_mesh(mesh: &Mesh<'_>, joints: &[BodySpring]) -> Result<Self, BodyError> {
        let count = mesh.points.len();
        let points: Vec<DVec3> = mesh.points.iter().map(|p| DVec3::from(*p)).collect();
        if let Some(index) = points.iter().position(|p| !p.iter().all(|x| x.is_finite())) {
            return Err(BodyError::Point(index));
        }
        mesh.tets.iter().enumerate().try_for_each(|(index, tet)| distinct("tetrahedron", index, tet, count))?;
        mesh.missing.iter().enumerate().try_for_each(|(index, ends)| distinct("spring", index, ends, count))?;
        for (index, carrier) in mesh.riding.iter().enumerate() {
            if carrier.particles.iter().any(|particle| *particle as usize >= count) {
                return Err(BodyError::Particles("riding point", index, carrier.particles.to_vec(), count));
            }
            carrier.weights.iter().try_for_each(|weight| number("weight", index, weight.abs()).map(|_| ()))?;
        }
        for (index, spring) in joints.iter().enumerate() {
            distinct("spring", index, &spring.ends, count)?;
            stiffness(index, spring.stiffness)?;
            number("damping", index, spring.damping)?;
            number("length", index, spring.length)?;
        }

        let (mut ends, tet_springs) = edges(mesh.tets);
        let means = neighbours_of_missing(mesh, &ends);
        ends.extend(mesh.missing);
        let mesh_spring_count = ends.len();
        ends.extend(joints.iter().map(|spring| spring.ends));
        let order = ClusterOrder::new(&points, ends.iter().copied());

        let length = |ends: &[u32; 2]| (points[ends[0] as usize] - points[ends[1] as usize]).norm();
        let lengths: Vec<f64> =
            ends[..mesh_spring_count].iter().map(length).chain(joints.iter().map(|spring| spring.length)).collect();
        let given: Vec<MeshTet> = mesh
            .tets
            .iter()
            .zip(tet_springs)
            .enumerate()
            .map(|(tet, (corners, springs))| MeshTet {
                corners: *corners,
                springs,
                volume: volume(corners.map(|corner| points[corner as usize])).abs(),
                fill: mesh.fill.get(tet).map_or(1.0, |fill| f64::from(fill.clamp(0.0, 1.0))),
            })
            .collect();
        let ends: Vec<[u32; 2]> = ends.iter().map(|ends| ends.map(|end| order.index_of[end as usize])).collect();
        let rest: Vec<DVec3> = order.caller_of.iter().map(|caller| points[*caller as usize]).collect();
        let (kept, tets) = with_volume(mesh, &points, &order);
        let volumes: Vec<f64> = kept.iter().map(|tet| given[*tet as usize].volume).collect();
        let [low, high] = bounds(mesh.points.iter().copied()).map(DVec3::from);
        let regions = Regions::new(&rest, &tets);
        let adjacency = Adjacency::new(&order.clusters, &ends);
        let layout = Layout::new(&order, &adjacency, &regions);
        let zeros = std::iter::repeat_n(0.0, mesh_spring_count);
        Ok(Self {
            stiffness: zeros.clone().chain(joints.iter().map(|spring| f64::from(spring.stiffness as f32))).collect(),
            damping: zeros.chain(joints.iter().map(|spring| spring.damping)).collect(),
            spring_partition: Partition::even(ends.len(), 2048, 1),
            tet_partition: Partition::even(tets.len(), 2048, 1),
            size: if count > 0 { (high - low).max() } else { 0.0 },
            mass: vec![1.0; count],
            moduli: vec![0.0; tets.len()],
            spacing: spacings(&layout, order.pieces.len(), &ends, &lengths),
            layout,
            adjacency,
            order,
            rest,
            ends,
            lengths,
            tets,
            volumes,
            regions,
            given,
            kept,
            means,
            riding: mesh.riding.to_vec(),
            mesh_spring_count,
        })
    }
}

/// Signed volume; positive if b, c, d run counter-clockwise seen from a.
pub(super) fn volume([a, b, c, d]: [DVec3; 4]) -> f64 {
    (b - a).dot(&(c - a).cross(&(d - a))) / 6.0
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

fn number(what: &'static str, index: usize, value: f64) -> Result<f64, BodyError> {
    if value.is_finite() && value >= 0.0 { Ok(value) } else { Err(BodyError::Number(what, index, value)) }
}

/// A stiffness rounded to f32, as forces store it, so that energies match forces exactly.
fn stiffness(index: usize, k: f64) -> Result<f64, BodyError> {
    number("stiffness", index, f64::from(k as f32))
}

fn distinct(what: &'static str, index: usize, particles: &[u32], count: usize) -> Result<(), BodyError> {
    let doubled = (1..particles.len()).any(|k| particles[..k].contains(&particles[k]));
    if doubled || particles.iter().any(|particle| *particle as usize >= count) {
        return Err(BodyError::Particles(what, index, particles.to_vec(), count));
    }
    Ok(())
}

/// Tetrahedra with a volume to preserve: their indices in the mesh, and their corners in the solver's order.
fn with_volume(mesh: &Mesh<'_>, points: &[DVec3], order: &ClusterOrder) -> (Vec<u32>, Vec<[u32; 4]>) {
    let keep = |(index, tet): (usize, &[u32; 4])| {
        let corners = tet.map(|corner| points[corner as usize]);
        let signed = volume(corners);
        let longest = EDGES.iter().map(|[a, b]| (corners[*a] - corners[*b]).norm()).fold(0.0, f64::max);
        let sliver = mesh.slivers.get(index).copied().unwrap_or(false);
        let [a, b, c, d] = tet.map(|corner| order.index_of[corner as usize]);
        let turned = if signed < 0.0 { [a, c, b, d] } else { [a, b, c, d] };
        (!sliver && signed.abs() > FLAT * longest * longest * longest).then_some((index as u32, turned))
    };
    mesh.tets.iter().enumerate().filter_map(keep).unzip()
}
