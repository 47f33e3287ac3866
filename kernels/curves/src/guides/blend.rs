//! Mixing the shapes and the numbers of guides.

use super::near::{Mix, Share};
use super::shape::Shapes;
use crate::attach::Pose;
use crate::attach::vectors::{Vec3, add, compose, inverse, length, scale, sub, turned, wide};
use rayon::prelude::*;

/// What hairs are made of, and where they stand now.
#[derive(Clone, Copy, Debug)]
pub struct Blend<'a> {
    /// Which guides, and how much of each.
    pub mix: &'a Mix,
    /// The hairs' roots now, metres.
    pub roots: &'a [[f64; 3]],
    /// How the hairs' roots and the guides' have moved and turned since rest; none where the skin is at rest.
    pub poses: Option<Poses<'a>>,
}

/// Poses of hairs, and of guides.
pub type Poses<'a> = (&'a [Pose], &'a [Pose]);

/// Mixed hairs, and what was reached.
#[must_use]
#[derive(Clone, Debug, PartialEq)]
pub struct Blended {
    /// The hairs' points, root first, hair by hair.
    pub points: Vec<[f32; 3]>,
    /// Largest difference of a hair's length, as written, from the mix of its guides' lengths, as a share of that.
    pub length_error: f64,
}

/// Hairs that a task makes at least: some 30 µs of work.
const TASK: usize = 64;

/// Below this share of the guides' own lengths the sum of their segments says nothing of a direction: it is rounding.
const CANCELLED: f64 = 1e-9;

/// Hairs of the shape that `guides` have now.
///
/// # Panics
/// Where a slice is shorter than the hairs or guides.
pub fn blend(guides: Shapes, blend: &Blend) -> Blended {
    // Each guide as it is relative to its own root's turn: what is left is mixed at rest.
    let guides = match blend.poses {
        None => guides,
        Some((_, poses)) => guides.turned(|guide, chord| turned(inverse(poses[guide].turn), chord)),
    };
    let cvs = guides.segments() + 1;
    let mut points = vec![[0.0; 3]; blend.roots.len() * cvs];
    let errors = points.par_chunks_mut(cvs).enumerate().with_min_len(TASK).map(|(hair, points)| {
        let mut at = blend.roots[hair];
        points[0] = at.map(|x| x as f32);
        let (mut asked, mut written) = (0.0, 0.0);
        for segment in 0..guides.segments() {
            let (direction, size) = mixed(&guides, blend.mix.of(hair), segment);
            let step = match blend.poses {
                None => direction,
                Some((poses, _)) => poses[hair].turned(direction),
            };
            at = add(at, scale(step, size));
            points[segment + 1] = at.map(|x| x as f32);
            asked += size;
            written += length(sub(wide(points[segment + 1]), wide(points[segment])));
        }
        if asked > 0.0 { ((written - asked) / asked).abs() } else { 0.0 }
    });
    let length_error = errors.reduce(|| 0.0, f64::max);
    Blended { points, length_error }
}

/// Direction and length of a hair's segment in its frame at rest.
#[inline(always)]
fn mixed(guides: &Shapes, shares: &[Share], segment: usize) -> (Vec3, f64) {
    let (mut sum, mut lengths, mut chords) = ([0.0; 3], 0.0, 0.0);
    let mut heaviest = [0.0; 3];
    for share in shares.iter().filter(|share| share.weight > 0.0) {
        let weight = f64::from(share.weight);
        let piece = &guides.pieces(share.guide as usize)[segment];
        let chord = turned(share.turn.map(f64::from), piece.chord);
        if heaviest == [0.0; 3] {
            heaviest = chord;
        }
        sum = add(sum, scale(chord, weight));
        lengths += weight * piece.length;
        chords += weight * length(piece.chord);
    }
    let size = length(sum);
    if size > CANCELLED * chords {
        return (scale(sum, 1.0 / size), lengths);
    }
    let size = length(heaviest);
    (if size > 0.0 { scale(heaviest, 1.0 / size) } else { heaviest }, lengths)
}

/// How rows of numbers on guides become rows on hairs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rows {
    /// A row a CV.
    Point,
    /// A row a guide.
    Element,
}

impl Blend<'_> {
    /// The mix of numbers: a row a CV of each hair, or a row a hair.
    ///
    /// # Panics
    /// As [`blend`].
    pub fn numbers<const N: usize>(&self, guides: &Shapes, rows: &[[f32; N]], of: Rows) -> Vec<[f32; N]> {
        self.each(guides, of, |hair, at| {
            let mut sum = [0.0_f64; N];
            for share in self.mix.of(hair).iter().filter(|share| share.weight > 0.0) {
                let row = row_at(guides, rows, of, share.guide, at);
                for k in 0..N {
                    sum[k] += f64::from(share.weight) * row[k];
                }
            }
            sum.map(|x| x as f32)
        })
    }

    /// The mix of vectors, turned from frame to frame as segments are.
    ///
    /// # Panics
    /// As [`blend`].
    pub fn vectors(&self, guides: &Shapes, rows: &[[f32; 3]], of: Rows) -> Vec<[f32; 3]> {
        self.each(guides, of, |hair, at| {
            let mut sum = [0.0; 3];
            for share in self.mix.of(hair).iter().filter(|share| share.weight > 0.0) {
                let row = turned(self.turn(hair, share), row_at(guides, rows, of, share.guide, at));
                sum = add(sum, scale(row, f64::from(share.weight)));
            }
            sum.map(|x| x as f32)
        })
    }

    /// Orientations (quaternions x, y, z, w): the heaviest guide's, turned from frame to frame.
    ///
    /// # Panics
    /// As [`blend`].
    pub fn orientations(&self, guides: &Shapes, rows: &[[f32; 4]], of: Rows) -> Vec<[f32; 4]> {
        let heaviest = self.heaviest(guides, of);
        let per_hair = if of == Rows::Point { guides.segments() + 1 } else { 1 };
        let turned = |(at, row): (usize, &u32)| {
            let hair = at / per_hair;
            let turn = self.turn(hair, &self.mix.of(hair)[0]);
            compose(turn, rows[*row as usize].map(f64::from)).map(|x| x as f32)
        };
        heaviest.par_iter().enumerate().with_min_len(TASK).map(turned).collect()
    }

    /// Of what cannot be mixed, the heaviest guide's: for each row of the hairs, a row of the guides.
    ///
    /// # Panics
    /// As [`blend`].
    pub fn heaviest(&self, guides: &Shapes, of: Rows) -> Vec<u32> {
        self.each(guides, of, |hair, at| {
            let guide = self.mix.of(hair)[0].guide;
            match of {
                Rows::Element => guide,
                Rows::Point => {
                    let place = guides.places(guide as usize)[at];
                    if place.share < 0.5 { place.before } else { place.after }
                }
            }
        })
    }

    /// From a guide's frame to a hair's, both now.
    fn turn(&self, hair: usize, share: &Share) -> [f64; 4] {
        let rest = share.turn.map(f64::from);
        match self.poses {
            None => rest,
            Some((hairs, guides)) => {
                compose(hairs[hair].turn, compose(rest, inverse(guides[share.guide as usize].turn)))
            }
        }
    }

    /// A row a CV of each hair, or a row a hair, from the hair's number and the CV's.
    fn each<T: Send>(&self, guides: &Shapes, of: Rows, row: impl Fn(usize, usize) -> T + Sync) -> Vec<T> {
        let per_hair = if of == Rows::Point { guides.segments() + 1 } else { 1 };
        let rows = (0..self.roots.len() * per_hair).into_par_iter().with_min_len(TASK);
        rows.map(|at| row(at / per_hair, at % per_hair)).collect()
    }
}

/// The row of a guide at a hair's CV.
fn row_at<const N: usize>(guides: &Shapes, rows: &[[f32; N]], of: Rows, guide: u32, at: usize) -> [f64; N] {
    match of {
        Rows::Element => rows[guide as usize].map(f64::from),
        Rows::Point => {
            let place = guides.places(guide as usize)[at];
            let (before, after) = (rows[place.before as usize], rows[place.after as usize]);
            std::array::from_fn(|k| {
                let before = f64::from(before[k]);
                before + (f64::from(after[k]) - before) * f64::from(place.share)
            })
        }
    }
}
