//! A body: particles with mass, springs between them, tetrahedra with a rest volume.
//!
//! Springs stand on all edges of the tetrahedra with k = E·ΣV/L² (van Gelder 1998), so that stiffness does not depend on
//! how finely a body is cut; dashpots c = β·k lie beside them; a tetrahedron's mass goes to its corners in equal parts.
//!
//! Promise: same springs in the same order for the same mesh. Limits: springs shorter than [`SHORTEST`] count as that long
//! for their stiffness; particles without mass get [`LIGHTEST`]; a tetrahedron whose corners turn the other way at rest
//! is taken as its mirror image, a flat one has no volume to keep. Metres, seconds, kilograms.

use super::adjacency::Adjacency;
use super::particle_order::Order;
use super::partition::Partition;
use super::regions::Regions;
use super::tet_springs::{EDGES, edges, neighbours_of_missing};
use numerics::masked::Masked;
use numerics::vector::DVec3;

/// Shortest spring that k = E·ΣV/L² is taken of, as a share of the mean: k of a doubled point stays within 1e6 of others'.
pub const SHORTEST: f64 = 1e-3;
/// Least mass of a particle, as a share of the mean: of points in no tetrahedron.
pub const LIGHTEST: f64 = 1e-3;
/// Share of L³ below which a tetrahedron is flat, L its longest edge: rounding of positions given in f32 reaches 1e-7.
const FLAT: f64 = 1e-6;

/// The mean of a masked number over some particles, 0 or more.
fn mean_over<const N: usize>(number: &Masked<'_, f64>, particles: [u32; N]) -> f64 {
    let scale = number.mask.map_or(1.0, |mask| {
        particles.iter().map(|particle| f64::from(mask[*particle as usize])).sum::<f64>() / N as f64
    });
    (number.value * scale).max(0.0)
}

/// The shape of a body at rest.
#[derive(Clone, Copy, Debug, Default)]
pub struct Mesh<'a> {
    /// Particles, metres.
    pub points: &'a [[f64; 3]],
    /// Tetrahedra.
    pub tets: &'a [[u32; 4]],
    /// Which tetrahedra have no volume worth keeping; none of them where empty. Their edges and masses count.
    pub slivers: &'a [bool],
    /// Edges of the surface that no tetrahedron has: springs with the mean E·ΣV of the surface edges at their ends.
    pub missing: &'a [[u32; 2]],
}

/// What a body is made of.
#[derive(Clone, Copy, Debug)]
pub struct Material<'a> {
    /// Density, kg/m³.
    pub density: Masked<'a, f64>,
    /// Young's modulus E, Pa.
    pub stiffness: Masked<'a, f64>,
    /// β = c ÷ k, seconds.
    pub damping: Masked<'a, f64>,
}

/// A spring given as such, between particles of one body or two.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodySpring {
    /// The particles it joins.
    pub ends: [u32; 2],
    /// k, N/m.
    pub stiffness: f64,
    /// c, N·s/m.
    pub damping: f64,
    /// Length at rest, metres; 0 is a spring that pulls its ends together.
    pub length: f64,
}

/// Why there is no body.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BodyError {
    /// A coordinate is NaN or infinite.
    #[error("point {0} is not finite")]
    Point(usize),
    /// A tetrahedron or spring names a particle that there is none of, or one twice.
    #[error("{what} {index} joins particles {particles:?}; expected different ones of {count}")]
    Particles {
        /// `tetrahedron` or `spring`.
        what: &'static str,
        /// Which.
        index: usize,
        /// Its particles.
        particles: Vec<u32>,
        /// Particles there are.
        count: usize,
    },
    /// A number of a spring or particle is negative or not finite.
    #[error("`{what}` of {index} is {value}; expected a finite number, 0 or more")]
    Number {
        /// Which number.
        what: &'static str,
        /// Of which spring or particle.
        index: usize,
        /// The number.
        value: f64,
    },
    /// Nothing has a mass.
    #[error("the body has no mass; expected a tetrahedron with a volume and a density above 0")]
    NoMass,
}

/// Particles, springs and tetrahedra, and the order in which the solver keeps them.
#[derive(Clone, Debug)]
pub struct SoftBody {
    pub(super) order: Order,
    /// Particles at rest, the solver's order.
    pub(super) rest: Vec<DVec3>,
    pub(super) mass: Vec<f64>,
    /// Ends by place; those of tetrahedra first, then missing edges, then springs given as such.
    pub(super) ends: Vec<[u32; 2]>,
    pub(super) stiffness: Vec<f64>,
    pub(super) damping: Vec<f64>,
    pub(super) lengths: Vec<f64>,
    /// The springs at each particle.
    pub(super) adjacency: Adjacency,
    /// Tetrahedra with a volume, corners by place, turning so that it is positive.
    pub(super) tets: Vec<[u32; 4]>,
    pub(super) volumes: Vec<f64>,
    /// E of each.
    pub(super) moduli: Vec<f64>,
    pub(super) regions: Regions,
    /// Springs in fixed parts.
    pub(super) spring_partition: Partition,
    /// Tetrahedra in fixed parts.
    pub(super) tet_partition: Partition,
    /// All tetrahedra of the mesh by the caller's index, their six springs and volumes without sign.
    given: Vec<MeshTet>,
    /// Which tetrahedron of the mesh each of `tets` is.
    kept: Vec<u32>,
    /// Springs that the mesh has; the rest were given as such.
    mesh_spring_count: usize,
    /// Springs whose k is a mean: missing edges, and the surface edges it is the mean of.
    means: Vec<Vec<u32>>,
    /// Longest side of the box of the points at rest, metres.
    pub(super) size: f64,
    /// Mean length of its springs at rest, metres.
    pub(super) spacing: f64,
}

#[derive(Clone, Debug)]
struct MeshTet {
    corners: [u32; 4],
    springs: [u32; 6],
    volume: f64,
}

impl SoftBody {
    /// A body of `material` with the shape of `mesh`, and `joints`: springs of their own, between its parts.
    ///
    /// # Errors
    /// Where a number is not finite, a particle does not exist, or nothing has a mass.
    pub fn new(mesh: &Mesh<'_>, material: &Material<'_>, joints: &[BodySpring]) -> Result<Self, BodyError> {
        let mut body = Self::shaped(mesh, joints)?;
        body.set_material(material)?;
        Ok(body)
    }

    /// Particles of `masses` kilograms, which `springs` join.
    ///
    /// # Errors
    /// As [`Body::new`].
    pub fn of_springs(points: &[[f64; 3]], masses: &[f64], springs: &[BodySpring]) -> Result<Self, BodyError> {
        let mut body = Self::shaped(&Mesh { points, ..Mesh::default() }, springs)?;
        let masses: Vec<f64> = masses.iter().copied().chain(std::iter::repeat(0.0)).take(points.len()).collect();
        body.set_masses(&masses)?;
        Ok(body)
    }

    /// Particles.
    pub fn len(&self) -> usize {
        self.rest.len()
    }

    /// Whether there is no particle.
    pub fn is_empty(&self) -> bool {
        self.rest.is_empty()
    }

    /// The particles that each spring joins, by the caller's index.
    pub fn springs(&self) -> Vec<[u32; 2]> {
        self.ends.iter().map(|ends| ends.map(|end| self.order.caller_of[end as usize])).collect()
    }

    /// Stiffness k of each spring, N/m.
    pub fn stiffnesses(&self) -> &[f64] {
        &self.stiffness
    }

    /// Length of each spring at rest, before anything changed it, metres.
    pub fn lengths(&self) -> &[f64] {
        &self.lengths
    }

    /// Where a particle is at rest, by the caller's index, metres.
    pub fn rest_point(&self, particle: usize) -> [f64; 3] {
        self.rest[self.order.index_of[particle] as usize].into()
    }

    /// How many springs the mesh has; those given as such come after them.
    pub fn mesh_spring_count(&self) -> usize {
        self.mesh_spring_count
    }

    /// Mass of each particle, by the caller's index, kilograms.
    pub fn masses(&self) -> Vec<f64> {
        self.order.index_of.iter().map(|particle| self.mass[*particle as usize]).collect()
    }

    /// The clusters of tetrahedra whose volume is kept as one: the triangles around each, facing outwards, by the caller's
    /// index.
    pub fn regions(&self) -> Vec<Vec<[u32; 3]>> {
        let caller = |particle: u32| self.order.caller_of[particle as usize];
        (0..self.regions.len())
            .map(|region| self.regions.around(region).map(|face| face.map(caller)).collect())
            .collect()
    }

    /// Longest side of the box around the points at rest, metres: what tolerances are relative to.
    pub fn size(&self) -> f64 {
        self.size
    }

    /// Where the particles of a piece are.
    pub(super) fn particles(&self, piece: &std::ops::Range<usize>) -> std::ops::Range<usize> {
        let clusters = &self.order.clusters;
        clusters.range(piece.start).start..clusters.range(piece.end - 1).end
    }

    /// Brings values a particle, by the caller's index, into the solver's order.
    pub(super) fn to_solver_order<T: Copy>(&self, values: &[T]) -> Vec<T> {
        self.order.caller_of.iter().map(|caller| values[*caller as usize]).collect()
    }

    /// Changes masses and stiffnesses; shape and state stay.
    ///
    /// # Errors
    /// Where nothing has a mass, or a number is not finite.
    pub fn set_material(&mut self, material: &Material<'_>) -> Result<(), BodyError> {
        let mut masses = vec![0.0; self.len()];
        let mesh_spring_count = self.mesh_spring_count;
        let mut stored = vec![0.0; mesh_spring_count];
        for tet in &self.given {
            let quarter = 0.25 * tet.volume * mean_over(&material.density, tet.corners);
            let energy = tet.volume * mean_over(&material.stiffness, tet.corners);
            tet.corners.iter().for_each(|corner| masses[*corner as usize] += quarter);
            tet.springs.iter().for_each(|spring| stored[*spring as usize] += energy);
        }
        let first = mesh_spring_count - self.means.len();
        for (spring, near) in (first..).zip(&self.means) {
            stored[spring] = near.iter().map(|edge| stored[*edge as usize]).sum::<f64>() / near.len().max(1) as f64;
        }
        let shortest = SHORTEST * mean(&self.lengths[..mesh_spring_count]);
        for spring in 0..mesh_spring_count {
            let length = self.lengths[spring].max(shortest);
            let k = if length > 0.0 { stored[spring] / (length * length) } else { 0.0 };
            let ends = self.ends[spring].map(|end| self.order.caller_of[end as usize]);
            self.stiffness[spring] = stiffness(spring, k)?;
            self.damping[spring] = number("damping", spring, mean_over(&material.damping, ends) * k)?;
        }
        self.moduli =
            self.kept.iter().map(|tet| mean_over(&material.stiffness, self.given[*tet as usize].corners)).collect();
        let corners = |tet: &u32| self.given[*tet as usize].corners;
        let damping: Vec<f64> = self.kept.iter().map(|tet| mean_over(&material.damping, corners(tet))).collect();
        self.regions.set_material(&self.volumes, &self.moduli, &damping);
        self.set_masses(&masses)
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

    /// All but masses and the stiffnesses of the mesh's springs.
    fn shaped(mesh: &Mesh<'_>, joints: &[BodySpring]) -> Result<Self, BodyError> {
        let count = mesh.points.len();
        let points: Vec<DVec3> = mesh.points.iter().map(|p| DVec3::from(*p)).collect();
        if let Some(index) = points.iter().position(|p| !p.iter().all(|x| x.is_finite())) {
            return Err(BodyError::Point(index));
        }
        mesh.tets.iter().enumerate().try_for_each(|(index, tet)| distinct("tetrahedron", index, tet, count))?;
        mesh.missing.iter().enumerate().try_for_each(|(index, ends)| distinct("spring", index, ends, count))?;
        for (index, spring) in joints.iter().enumerate() {
            distinct("spring", index, &spring.ends, count)?;
            stiffness(index, spring.stiffness)?;
            number("damping", index, spring.damping)?;
            number("length", index, spring.length)?;
        }

        let (mut ends, tet_springs) = edges(mesh.tets);
        let means = neighbours_of_missing(mesh, &ends, &tet_springs);
        ends.extend(mesh.missing);
        let mesh_spring_count = ends.len();
        ends.extend(joints.iter().map(|spring| spring.ends));
        let order = Order::new(&points, ends.iter().copied());

        let length = |ends: &[u32; 2]| (points[ends[0] as usize] - points[ends[1] as usize]).norm();
        let lengths: Vec<f64> =
            ends[..mesh_spring_count].iter().map(length).chain(joints.iter().map(|spring| spring.length)).collect();
        let spacing = mean(&lengths);
        let given: Vec<MeshTet> = mesh
            .tets
            .iter()
            .zip(tet_springs)
            .map(|(corners, springs)| MeshTet {
                corners: *corners,
                springs,
                volume: volume(corners.map(|corner| points[corner as usize])).abs(),
            })
            .collect();
        let ends: Vec<[u32; 2]> = ends.iter().map(|ends| ends.map(|end| order.index_of[end as usize])).collect();
        let rest: Vec<DVec3> = order.caller_of.iter().map(|caller| points[*caller as usize]).collect();
        let (kept, tets) = with_volume(mesh, &points, &order);
        let volumes: Vec<f64> = kept.iter().map(|tet| given[*tet as usize].volume).collect();
        let low = rest.iter().fold(DVec3::repeat(f64::INFINITY), |low, p| low.inf(p));
        let high = rest.iter().fold(DVec3::repeat(f64::NEG_INFINITY), |high, p| high.sup(p));
        let regions = Regions::new(&rest, &tets);
        let zeros = std::iter::repeat_n(0.0, mesh_spring_count);
        Ok(Self {
            stiffness: zeros.clone().chain(joints.iter().map(|spring| f64::from(spring.stiffness as f32))).collect(),
            damping: zeros.chain(joints.iter().map(|spring| spring.damping)).collect(),
            spring_partition: Partition::even(ends.len(), 2048, 1),
            tet_partition: Partition::even(tets.len(), 2048, 1),
            size: if count > 0 { (high - low).max() } else { 0.0 },
            mass: vec![1.0; count],
            moduli: vec![0.0; tets.len()],
            adjacency: Adjacency::new(&order.clusters, &ends),
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
            mesh_spring_count,
            spacing,
        })
    }
}

/// Six times the volume is a determinant; positive where the corners turn counter-clockwise seen from the first.
pub(super) fn volume([a, b, c, d]: [DVec3; 4]) -> f64 {
    (b - a).dot(&(c - a).cross(&(d - a))) / 6.0
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

fn number(what: &'static str, index: usize, value: f64) -> Result<f64, BodyError> {
    if value.is_finite() && value >= 0.0 { Ok(value) } else { Err(BodyError::Number { what, index, value }) }
}

/// A stiffness as forces have it, in f32, so that energies are of the same springs.
fn stiffness(index: usize, k: f64) -> Result<f64, BodyError> {
    number("stiffness", index, f64::from(k as f32))
}

fn distinct(what: &'static str, index: usize, particles: &[u32], count: usize) -> Result<(), BodyError> {
    let doubled = (1..particles.len()).any(|k| particles[..k].contains(&particles[k]));
    if doubled || particles.iter().any(|particle| *particle as usize >= count) {
        return Err(BodyError::Particles { what, index, particles: particles.to_vec(), count });
    }
    Ok(())
}

/// Tetrahedra with a volume to keep: their indices, and their corners by place.
fn with_volume(mesh: &Mesh<'_>, points: &[DVec3], order: &Order) -> (Vec<u32>, Vec<[u32; 4]>) {
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
