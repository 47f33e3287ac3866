//! Free-form deformation: a box of control points, each moved by an offset, and space moves along (Sederberg & Parry,
//! *Free-Form Deformation of Solid Geometric Models*, 1986).
//!
//! A point at u, v, w of the box moves by Σ Bᵢ(u)·Bⱼ(v)·Bₖ(w)·offsetᵢⱼₖ. B are Bernstein polynomials of the degree of the
//! divisions, so that the whole box bends smoothly, or tents over neighbouring control points, so that each cell does by
//! itself and they meet without a gap. Both reproduce affine maps.
//!
//! Promise: a point where all offsets that reach it are 0 keeps its bits; offsets that are affine in their control points'
//! places give that affine map to the rounding of f32 (within the box, and outside with [`Outside::Extend`]); the
//! Jacobian is the map's own derivative, one-sided where the map has a crease; the same bits on every SIMD path and number
//! of threads. f64 inside, rounded once. Limits: between cells the trilinear map has creases, as has the border of the
//! box with [`Outside::Hold`]; nothing keeps a lattice from folding space over, but [`Moved::folded`] tells. Metres.

mod group;
mod turn;

use group::{Group, Scratch, move_group};
use numerics::lanes::LANES;
use numerics::simd::Path;
use rayon::prelude::*;

pub use turn::{Matrix, turn_normals, turn_orientations, turn_vectors};

/// How control points share in what is between them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Basis {
    /// Straight from one to the next: the eight around a point move it.
    Trilinear,
    /// All of them everywhere, the near ones most.
    Bernstein,
}

/// What becomes of points outside the box.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outside {
    /// They move as the nearest point of the box does.
    Hold,
    /// Along each axis the box's edge goes straight on.
    Extend,
}

/// A box of control points with offsets.
#[derive(Clone, Copy, Debug)]
pub struct Lattice<'a> {
    from: [f64; 3],
    extent: [f64; 3],
    divisions: [usize; 3],
    offsets: &'a [[f32; 3]],
    basis: Basis,
    outside: Outside,
}

/// Moved points, and what the lattice does to space there.
#[must_use]
#[derive(Clone, Debug, PartialEq)]
pub struct Moved {
    /// One point for every incoming one.
    pub points: Vec<[f32; 3]>,
    /// The map's derivative at each, row by row; empty where nobody wanted it.
    pub jacobians: Vec<Matrix>,
    /// Least determinant of a derivative: how much of its volume the most squeezed place keeps. 1 without points.
    pub least: f64,
    /// Points where it is 0 or less: flattened, or turned inside out.
    pub folded: usize,
}

/// Control points of a lattice of so many cells along each axis; none where no memory holds them.
pub fn control_points(divisions: [usize; 3]) -> Option<usize> {
    divisions.iter().try_fold(1_usize, |count, cells| count.checked_mul(cells.checked_add(1)?))
}

impl<'a> Lattice<'a> {
    /// The box between the corners `from` and `to`, cut into `divisions` cells along x, y and z; an offset a control
    /// point, x running fastest, then y. None where the box is not above 0 in all directions, a division is 0, or there
    /// are more offsets than control points or fewer.
    pub fn new(
        [from, to]: [[f64; 3]; 2],
        divisions: [usize; 3],
        offsets: &'a [[f32; 3]],
        basis: Basis,
        outside: Outside,
    ) -> Option<Self> {
        let extent = [0, 1, 2].map(|k| to[k] - from[k]);
        let sound = extent.iter().all(|x| *x > 0.0 && x.is_finite()) && divisions.iter().all(|cells| *cells > 0);
        let fits = control_points(divisions) == Some(offsets.len());
        (sound && fits).then_some(Self { from, extent, divisions, offsets, basis, outside })
    }

    /// Whether no control point is moved.
    pub fn is_identity(&self) -> bool {
        self.offsets.as_flattened().iter().all(|x| *x == 0.0)
    }

    /// Moves points; with the Jacobians where they are wanted.
    pub fn deform(&self, points: &[[f32; 3]], jacobians: bool) -> Moved {
        self.deform_on(Path::chosen(), points, jacobians)
    }

    /// [`Lattice::deform`] on a given SIMD path.
    pub fn deform_on(&self, path: Path, points: &[[f32; 3]], jacobians: bool) -> Moved {
        let mut moved = Moved {
            points: points.to_vec(),
            jacobians: if jacobians { vec![turn::IDENTITY; points.len()] } else { Vec::new() },
            least: 1.0,
            folded: 0,
        };
        let reached: Vec<Reached> = if jacobians {
            let tasks = moved.points.par_chunks_mut(TASK).zip(moved.jacobians.par_chunks_mut(TASK));
            tasks.map(|(points, jacobians)| self.task(path, points, jacobians)).collect()
        } else {
            moved.points.par_chunks_mut(TASK).map(|points| self.task(path, points, &mut [])).collect()
        };
        let reached = reached.into_iter().reduce(Reached::join);
        if let Some(Reached { least, folded }) = reached {
            (moved.least, moved.folded) = (least, folded);
        }
        moved
    }

    fn task(&self, path: Path, points: &mut [[f32; 3]], jacobians: &mut [Matrix]) -> Reached {
        let (mut scratch, mut group) = (Scratch::default(), Group::default());
        let mut reached = Reached { least: f64::INFINITY, folded: 0 };
        let mut jacobians = jacobians.chunks_mut(LANES);
        for points in points.chunks_mut(LANES) {
            group.load(points);
            move_group(path, self, &mut scratch, &mut group);
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
    least: f64,
    folded: usize,
}

impl Reached {
    fn of(determinant: f64) -> Self {
        let upright = determinant > 0.0;
        Self { least: determinant, folded: usize::from(!upright) }
    }

    fn join(self, other: Self) -> Self {
        Self { least: self.least.min(other.least), folded: self.folded + other.folded }
    }
}

#[cfg(test)]
mod tests;
