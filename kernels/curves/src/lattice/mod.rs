//! Free-form deformation: a box of control points, each displaced by an offset, deforms the space in it (Sederberg &
//! Parry, *Free-Form Deformation of Solid Geometric Models*, 1986).
//!
//! A point at u, v, w of the box is displaced by Σ Bᵢ(u)·Bⱼ(v)·Bₖ(w)·offsetᵢⱼₖ. B are Bernstein polynomials whose degree
//! is the number of divisions, so that the whole box bends smoothly, or tent functions, so that each cell depends on its
//! own corners and cells meet without a gap. Both reproduce affine maps.
//!
//! Promise: a point where all offsets that reach it are 0 keeps its bits; offsets that are an affine function of the
//! control points' positions give that affine map to the rounding of f32 (within the box, and outside with
//! [`Extrapolation::Extend`]); the Jacobian is the map's exact derivative, one-sided where the map has a crease; the same
//! bits on every SIMD path and number of threads. Computed in f64, rounded once. Limits: the trilinear map has creases
//! between cells, and so has the boundary of the box with [`Extrapolation::Hold`]; a lattice may fold space over, which
//! [`Deformed::folded`] counts. Metres.

mod jacobian;
mod point_group;

pub use jacobian::{map_normals, map_orientations, map_vectors};
use numerics::lanes::LANES;
use numerics::simd::Path;
use numerics::vector::DMat3;
use point_group::{PointGroup, Scratch, displace_group};
use rayon::prelude::*;

/// How offsets are interpolated between control points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LatticeBasis {
    /// Linear within a cell: the eight control points around a point displace it.
    Trilinear,
    /// All control points act everywhere, near ones most.
    Bernstein,
}

/// How points outside the box are displaced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extrapolation {
    /// As the nearest point of the box.
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
    /// One point for every incoming one.
    pub points: Vec<[f32; 3]>,
    /// The Jacobian of the map at each; empty where not asked for.
    pub jacobians: Vec<DMat3>,
    /// Least determinant of a Jacobian: the share of its volume that the most compressed spot keeps. 1 without points.
    pub min_determinant: f64,
    /// Points with a determinant of 0 or less: space is flattened or inside out there.
    pub folded: usize,
}

/// Control points of a lattice with so many cells along each axis; `None` where the number overflows.
pub fn control_points(divisions: [usize; 3]) -> Option<usize> {
    divisions.iter().try_fold(1_usize, |count, cells| count.checked_mul(cells.checked_add(1)?))
}

impl<'a> DeformationLattice<'a> {
    /// The box between the corners `from` and `to`, cut into `divisions` cells along x, y and z; an offset a control
    /// point, x running fastest, then y. `None` where the box has no volume, a division is 0, or the number of offsets is
    /// not that of the control points.
    pub fn new(
        [from, to]: [[f64; 3]; 2],
        divisions: [usize; 3],
        offsets: &'a [[f32; 3]],
        basis: LatticeBasis,
        extrapolation: Extrapolation,
    ) -> Option<Self> {
        let extent = [0, 1, 2].map(|k| to[k] - from[k]);
        let is_box = extent.iter().all(|x| *x > 0.0 && x.is_finite()) && divisions.iter().all(|cells| *cells > 0);
        let fits = control_points(divisions) == Some(offsets.len());
        (is_box && fits).then_some(Self { from, extent, divisions, offsets, basis, extrapolation })
    }

    /// Whether all offsets are 0.
    pub fn is_identity(&self) -> bool {
        self.offsets.as_flattened().iter().all(|x| *x == 0.0)
    }

    /// Deforms points; with the Jacobians where asked for.
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
        let reached: Vec<Reached> = if jacobians {
            let tasks = deformed.points.par_chunks_mut(TASK).zip(deformed.jacobians.par_chunks_mut(TASK));
            tasks.map(|(points, jacobians)| self.task(path, points, jacobians)).collect()
        } else {
            deformed.points.par_chunks_mut(TASK).map(|points| self.task(path, points, &mut [])).collect()
        };
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

/// Points that a thread takes at a time, whole groups.
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
