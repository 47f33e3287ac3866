//! Free-form deformation: a box of control points, each displaced by an offset, deforms the space in it (Sederberg &
//! Parry, *Free-Form Deformation of Solid Geometric Models*, 1986).
//!
//! A point at u, v, w of the box is displaced by Σ Bᵢ(u)·Bⱼ(v)·Bₖ(w)·offsetᵢⱼₖ. B are Bernstein polynomials whose
//! degree is the number of divisions, so that the whole box bends smoothly, or tent functions, so that each cell
//! depends on its own corners and cells meet without a gap. Both reproduce affine maps.
//!
//! Guarantees: a point keeps its bits if all offsets that affect it are 0; offsets that are an affine function of the
//! control points' positions give that affine map to the rounding of f32 (within the box, and outside with
//! [`Extrapolation::Extend`]); the Jacobian is the map's exact derivative, one-sided at creases of the map; the same
//! bits on every SIMD path and number of threads. Computed in f64, rounded once. Limits: the trilinear map has creases
//! between cells, and both maps at the boundary of the box with [`Extrapolation::Hold`]; a lattice may fold space,
//! which [`Deformed::folded`] counts. Metres.

mod jacobian;
mod point_group;

pub use jacobian::{map_normals, map_orientations, map_vectors};
use numerics::lanes::LANES;
use numerics::parallel;
use numerics::simd::Path;
use numerics::vector::{DMat3, DVec3};
use point_group::{PointGroup, Scratch, displace_group};

/// How offsets are interpolated between control points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LatticeBasis {
    /// Linear within a cell: the eight control points around a point displace it.
    Trilinear,
    /// All control points act everywhere, the nearest most strongly.
    Bernstein,
}

/// How points outside the box are displaced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extrapolation {
    /// Like the nearest point of the box.
    Hold,
    /// Linearly along each axis, with the slope at the edge of the box.
    Extend,
}

/// A box of control points with offsets.
#[derive(Clone, Copy, Debug)]
pub struct DeformationLattice<'a> {
    from: [f64; 3],
    extent: [f64; 3],
    divisions: [usize; 3],
    offsets: &'a [[f32; 3]],
    basis: LatticeBasis,
    extrapolation: Extrapolation,
}

/// Deformed points, and the Jacobians there.
#[must_use]
#[derive(Clone, Debug, PartialEq)]
pub struct Deformed {
    /// One point for each input point.
    pub points: Vec<[f32; 3]>,
    /// The Jacobian of the map at each point; empty if not requested.
    pub jacobians: Vec<DMat3>,
    /// Smallest determinant of a Jacobian: the fraction of volume that remains at the most compressed point. 1 without
    /// points.
    pub min_determinant: f64,
    /// Number of points with a determinant of 0 or less, where space is flattened or inside out.
    pub folded: usize,
}

/// Number of control points of a lattice with these numbers of cells; `None` if it overflows.
pub fn control_points(divisions: [usize; 3]) -> Option<usize> {
    divisions.iter().try_fold(1_usize, |count, cells| count.checked_mul(cells.checked_add(1)?))
}

impl<'a> DeformationLattice<'a> {
    /// The box between the corners `from` and `to`, cut into `divisions` cells along x, y and z; one offset for each
    /// control point, x varying fastest, then y. `None` if the box has no volume, a division is 0, or the number of
    /// offsets is not that of the control points.
    pub fn new(
        [from, to]: [[f64; 3]; 2],
        divisions: [usize; 3],
        offsets: &'a [[f32; 3]],
        basis: LatticeBasis,
        extrapolation: Extrapolation,
    ) -> Option<Self> {
        let extent: [f64; 3] = (DVec3::from(to) - DVec3::from(from)).into();
        let is_box = extent.iter().all(|x| *x > 0.0 && x.is_finite()) && divisions.iter().all(|cells| *cells > 0);
        let fits = control_points(divisions) == Some(offsets.len());
        (is_box && fits).then_some(Self { from, extent, divisions, offsets, basis, extrapolation })
    }

    /// Whether all offsets are 0.
    pub fn is_identity(&self) -> bool {
        self.offsets.as_flattened().iter().all(|x| *x == 0.0)
    }

    /// Deforms points, and computes the Jacobians if requested.
    pub fn deform(&self, points: &[[f32; 3]], jacobians: bool) -> Deformed {
        self.deform_on(Path::chosen(), points, jacobians)
    }

    /// [`DeformationLattice::deform`] on a given SIMD path.
    pub fn deform_on(&self, path: Path, points: &[[f32; 3]], jacobians: bool) -> Deformed {
        let mut deformed = Deformed {
            points: points.to_vec(),
            jacobians: if jacobians { vec![DMat3::identity(); points.len()] } else { Vec::new() },
            min_determinant: 1.0,
            folded: 0,
        };
        let mut jacobians = deformed.jacobians.chunks_mut(TASK);
        let tasks = deformed.points.chunks_mut(TASK).map(|points| (points, jacobians.next().unwrap_or_default()));
        let reached = parallel::map(tasks, |_, (points, jacobians)| self.task(path, points, jacobians));
        let reached = reached.into_iter().reduce(Reached::join);
        if let Some(Reached { min_determinant, folded }) = reached {
            (deformed.min_determinant, deformed.folded) = (min_determinant, folded);
        }
        deformed
    }

    fn task(&self, path: Path, points: &mut [[f32; 3]], jacobians: &mut [DMat3]) -> Reached {
        let (mut scratch, mut group) = (Scratch::default(), PointGroup::default());
        let mut reached = Reached { min_determinant: f64::INFINITY, folded: 0 };
        let mut jacobians = jacobians.chunks_mut(LANES);
        for points in points.chunks_mut(LANES) {
            group.load(points);
            displace_group(path, self, &mut scratch, &mut group);
            group.store(points);
            for lane in 0..points.len() {
                reached = reached.join(Reached::of(group.determinant.0[lane]));
            }
            if let Some(jacobians) = jacobians.next() {
                group.jacobians(jacobians);
            }
        }
        reached
    }
}

/// Number of points that a thread takes at a time, in whole groups.
const TASK: usize = 128 * LANES;

#[derive(Clone, Copy)]
struct Reached {
    min_determinant: f64,
    folded: usize,
}

impl Reached {
    fn of(determinant: f64) -> Self {
        let upright = determinant > 0.0;
        Self { min_determinant: determinant, folded: usize::from(!upright) }
    }

    fn join(self, other: Self) -> Self {
        Self { min_determinant: self.min_determinant.min(other.min_determinant), folded: self.folded + other.folded }
    }
}

#[cfg(test)]
mod tests;
