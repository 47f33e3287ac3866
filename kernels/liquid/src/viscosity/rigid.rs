//! Rigid motions of each component of liquid, and of each part of one that is far more viscous than the rest.
//!
//! They have no strain: the matrix has their mass alone, or what softer liquid around resists, which viscosity exceeds by
//! up to 1e9, so that a multigrid cycle leaves them as they are. In each iteration their share of the error is solved for
//! exactly.

use nalgebra::{Matrix6, Vector6};
use numerics::parallel;

use crate::fields::in_parts;
use crate::rows::{Cell, Finder};
use crate::sets::Sets;

use super::level::{FaceKind, Level, Stresses};
use super::unresisted::{obstruction, unresisted};
use crate::velocity::FaceFields;

/// Free faces of a component next to each other along x.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    pub axis: usize,
    pub at: usize,
    pub len: usize,
    pub cell: Cell,
}

impl Piece {
    /// The six motions at a face: three translations, then three turns about the centre.
    pub(super) fn motions(&self, n: usize, about: Centre) -> [f64; 6] {
        let Centre { centre, size, turns } = about;
        if !turns {
            return std::array::from_fn(|motion| if motion == self.axis { 1.0 } else { 0.0 });
        }
        let position = |axis: usize| {
            let along = f64::from(self.cell[axis]) + if axis == 0 { n as f64 } else { 0.0 };
            (along + if axis == self.axis { 0.0 } else { 0.5 } - centre[axis]) / size
        };
        let [x, y, z] = [position(0), position(1), position(2)];
        match self.axis {
            0 => [1.0, 0.0, 0.0, 0.0, z, -y],
            1 => [0.0, 1.0, 0.0, -z, 0.0, x],
            _ => [0.0, 0.0, 1.0, y, -x, 0.0],
        }
    }
}

/// What turns are about.
#[derive(Clone, Copy, Debug)]
pub(super) struct Centre {
    centre: [f64; 3],
    size: f64,
    /// Whether the component can turn: one that meets its own image cannot.
    turns: bool,
}

/// A component that no solid holds firmly.
#[derive(Clone, Debug)]
pub(super) struct Component {
    pub pieces: Vec<Piece>,
    pub about: Centre,
    /// Of the matrix, on the six motions.
    inverse: Matrix6<f64>,
    /// What the matrix has besides their mass: faces beside solids that resist.
    resistance: Vec<(usize, usize, [f64; 6])>,
    /// That of mass alone.
    mass: Matrix6<f64>,
    /// From momentum to the motions that carry it, among those that nothing resists; none where there are no such.
    unresisted: Option<Matrix6<f64>>,
}

/// All components whose rigid motions a multigrid cycle would leave.
#[derive(Clone, Debug, Default)]
pub(super) struct RigidMotions(Vec<Component>);

/// Viscous resistance to a motion, relative to its mass, up to which the motion is solved for here.
const FIRM: f64 = 4.0;

/// A part of a component counts as stiff where its viscosity is this many times less than the largest, or its powers.
const STIFFER: f32 = 1e3;

/// Stiff parts that are treated, the largest first: each costs six products with the matrix.
const MOST_STIFF: usize = 16;

/// Faces that one thread looks at.
const FACES: usize = 4096;

/// Pieces that one thread goes through.
const PIECES: usize = 32;

/// Share of the viscosity below which a resistance is rounding.
const ROUNDING: f64 = 1e-12;

impl RigidMotions {
    /// `open`: the open share of each low face.
    pub(super) fn find(level: &Level, open: &FaceFields<f32>) -> Self {
        let whole = components(level, 0.0);
        let sizes: Vec<usize> = whole.iter().map(|part| faces(&part.pieces)).collect();
        let largest = level.normal.iter().copied().fold(0.0, f32::max);
        let least = level.normal.iter().copied().filter(|viscosity| *viscosity > 0.0).fold(largest, f32::min);
        let mut stiff: Vec<Part> = Vec::new();
        let mut threshold = largest / STIFFER;
        while threshold > least && threshold > 1.0 {
            let parts = components(level, threshold).into_iter().filter(|part| !sizes.contains(&faces(&part.pieces)));
            let known: Vec<usize> = stiff.iter().map(|part| faces(&part.pieces)).collect();
            stiff.extend(parts.filter(|part| !known.contains(&faces(&part.pieces))));
            threshold /= STIFFER;
        }
        stiff.sort_by_key(|part| std::cmp::Reverse(faces(&part.pieces)));
        stiff.truncate(MOST_STIFF);
        let mut stresses = Stresses::zero(level.rows().len());
        let whole: Vec<Component> = whole.into_iter().map(|part| Component::of(level, part)).collect();
        let obstructions = obstruction(level, open, &whole);
        let whole = whole.into_iter().zip(&obstructions);
        let mut found: Vec<Component> = whole
            .filter_map(|(component, obstruction)| component.set_up(level, Some(obstruction), &mut stresses))
            .collect();
        let stiff = stiff.into_iter().map(|part| Component::of(level, part));
        found.extend(stiff.filter_map(|component| component.set_up(level, None, &mut stresses)));
        Self(found)
    }

    /// Those alone of components that something does not resist at all, for [`Self::keep_momentum`].
    pub(super) fn find_unresisted(level: &Level, open: &FaceFields<f32>) -> Self {
        let whole: Vec<Component> = components(level, 0.0).into_iter().map(|part| Component::of(level, part)).collect();
        let obstructions = obstruction(level, open, &whole);
        let passing = whole
            .into_iter()
            .zip(&obstructions)
            .filter(|(component, obstruction)| unresisted(&component.mass, &Matrix6::zeros(), obstruction).is_some());
        let mut stresses = Stresses::zero(level.rows().len());
        let set_up =
            passing.filter_map(|(component, obstruction)| component.set_up(level, Some(obstruction), &mut stresses));
        Self(set_up.filter(|component| component.unresisted.is_some()).collect())
    }

    /// Gives `u` the momentum that `before` has in every rigid motion that neither solids nor viscosity resist, of
    /// components that touch a solid. Pressure has no part in it: its work on such a motion is that at the surface, which is 0. Its differences,
    /// weighed by the liquid beside each face so that weight at rest is balanced exactly, do not add up to that where
    /// the surface lies between faces. As these motions have neither stress nor divergence, what is added is what
    /// a pressure whose differences do add up would give.
    pub(super) fn keep_momentum(&self, level: &Level, before: &FaceFields<f64>, u: &mut FaceFields<f64>) {
        for component in &self.0 {
            let Some(unresisted) = &component.unresisted else { continue };
            let of_piece = |piece: &Piece| {
                let mut sum = Vector6::zeros();
                for n in 0..piece.len {
                    let (axis, at) = (piece.axis, piece.at + n);
                    let lost = f64::from(level.mass[axis][at]) * (before[axis][at] - u[axis][at]);
                    sum += Vector6::from(piece.motions(n, component.about)) * lost;
                }
                sum
            };
            let sums = parallel::tabulate(component.pieces.len(), PIECES, |n| of_piece(&component.pieces[n]));
            let lost: Vector6<f64> = sums.iter().sum();
            component.for_each_motion(&(unresisted * lost), u, |_, _, u, motion| *u += motion);
        }
    }

    /// Takes from `b` what moves components as rigid bodies: a multigrid cycle would answer it by a motion that is nearly
    /// rigid, which a high viscosity does not forgive.
    pub(super) fn remove(&self, level: &Level, b: &mut FaceFields<f64>) {
        for component in &self.0 {
            let shares = component.inverse * component.lacking(level, b, None);
            component.for_each_motion(&shares, b, |axis, at, b, motion| {
                *b -= f64::from(level.mass[axis][at]) * motion;
            });
            for (axis, at, row) in &component.resistance {
                b[*axis][*at] -= shares.dot(&Vector6::from(*row));
            }
        }
    }

    /// Adds to `z`, an approximation of A⁻¹·`b`, the rigid motions that it lacks.
    pub(super) fn complete(&self, level: &Level, b: &FaceFields<f64>, z: &mut FaceFields<f64>) {
        for component in &self.0 {
            let shares = component.inverse * component.lacking(level, b, Some(z));
            component.for_each_motion(&shares, z, |_, _, z, motion| *z += motion);
        }
    }
}

impl Component {
    /// Its mass; [`Self::set_up`] does the rest.
    fn of(level: &Level, part: Part) -> Self {
        let Part { pieces, turns } = part;
        let (mut total, mut first) = (0.0, [0.0; 3]);
        let (mut low, mut high) = ([i32::MAX; 3], [i32::MIN; 3]);
        for piece in &pieces {
            for axis in 0..3 {
                let last = piece.cell[axis] + if axis == 0 { piece.len as i32 } else { 1 };
                (low[axis], high[axis]) = (low[axis].min(piece.cell[axis]), high[axis].max(last));
            }
            let masses = &level.mass[piece.axis][piece.at..piece.at + piece.len];
            for (n, mass) in masses.iter().map(|mass| f64::from(*mass)).enumerate() {
                total += mass;
                first[0] += mass * (f64::from(piece.cell[0]) + n as f64);
                first[1] += mass * f64::from(piece.cell[1]);
                first[2] += mass * f64::from(piece.cell[2]);
            }
        }
        let centre = first.map(|sum| sum / total);
        let size = f64::from((0..3).map(|axis| high[axis] - low[axis]).max().unwrap_or(1));
        let about = Centre { centre, size, turns };
        let mut mass = Matrix6::zeros();
        for piece in &pieces {
            for n in 0..piece.len {
                let motions = Vector6::from(piece.motions(n, about));
                mass += motions * motions.transpose() * f64::from(level.mass[piece.axis][piece.at + n]);
            }
        }
        Self { pieces, about, mass, inverse: Matrix6::zeros(), resistance: Vec::new(), unresisted: None }
    }

    /// `obstruction`: by solids; none of a part that is stiffer than its component. `None` where a multigrid cycle is good
    /// enough, because solids hold the component.
    fn set_up(
        mut self,
        level: &Level,
        obstruction: Option<&Matrix6<f64>>,
        stresses: &mut Stresses<f64>,
    ) -> Option<Self> {
        let (mass, resistance) = (self.mass, self.resist(level, obstruction.is_none(), stresses));
        // A single face, or a thread of them, has fewer than six motions.
        let scale = (mass + resistance).trace() * 1e-12;
        let firm = resistance - mass * FIRM;
        if obstruction.is_some() && (firm + Matrix6::identity() * scale).cholesky().is_some() {
            return None;
        }
        self.inverse = (mass + resistance + Matrix6::identity() * scale).try_inverse()?;
        self.unresisted = obstruction.and_then(|obstruction| unresisted(&mass, &resistance, obstruction));
        Some(self)
    }

    /// Fills `resistance`; returns that of the six motions against each other.
    fn resist(&mut self, level: &Level, is_stiff: bool, stresses: &mut Stresses<f64>) -> Matrix6<f64> {
        let cells = Finder::new(level.rows());
        let touches_solid = |piece: &Piece| touches_solid(level, &cells, piece);
        if !is_stiff && !self.pieces.iter().any(touches_solid) {
            return Matrix6::zeros();
        }
        let len = level.rows().len();
        let zero = || -> FaceFields<f64> { std::array::from_fn(|_| vec![0.0; len]) };
        let mut motions: Vec<FaceFields<f64>> = (0..6).map(|_| zero()).collect();
        for piece in &self.pieces {
            for n in 0..piece.len {
                let at_face = piece.motions(n, self.about);
                (0..6).for_each(|motion| motions[motion][piece.axis][piece.at + n] = at_face[motion]);
            }
        }
        let forces: Vec<FaceFields<f64>> = motions
            .iter_mut()
            .map(|u| {
                let mut force = zero();
                level.apply(u, stresses, &mut force);
                for axis in 0..3 {
                    in_parts(&mut force[axis], |first, part| {
                        for (at, force) in (first..).zip(part) {
                            *force -= f64::from(level.mass[axis][at]) * u[axis][at];
                        }
                    });
                }
                force
            })
            .collect();
        let mut sum = Matrix6::zeros();
        for axis in 0..3 {
            let row_of = |at: usize| {
                let inverse = f64::from(level.inverse_diagonal[axis][at]);
                let row: [f64; 6] = std::array::from_fn(|motion| forces[motion][axis][at]);
                let is_resisted = row.iter().any(|force| force.abs() * inverse > ROUNDING);
                is_resisted.then_some((at, row))
            };
            let starts = (0..len).step_by(FACES);
            let rows = parallel::map(starts, |_, first| {
                (first..len.min(first + FACES)).filter_map(row_of).collect::<Vec<_>>()
            });
            for (at, row) in rows.into_iter().flatten() {
                self.resistance.push((axis, at, row));
                let here = Vector6::from_fn(|motion, _| motions[motion][axis][at]);
                sum += here * Vector6::from(row).transpose();
            }
        }
        (sum + sum.transpose()) * 0.5
    }

    /// The six motions' products with `b` − A·`z`; without `z`, with `b`.
    fn lacking(&self, level: &Level, b: &FaceFields<f64>, z: Option<&FaceFields<f64>>) -> Vector6<f64> {
        let of_piece = |piece: &Piece| {
            let mut sum = [0.0; 6];
            for n in 0..piece.len {
                let (axis, at) = (piece.axis, piece.at + n);
                let momentum = z.map_or(0.0, |z| f64::from(level.mass[axis][at]) * z[axis][at]);
                let motions = piece.motions(n, self.about);
                (0..6).for_each(|motion| sum[motion] += (b[axis][at] - momentum) * motions[motion]);
            }
            Vector6::from(sum)
        };
        let sums = parallel::tabulate(self.pieces.len(), PIECES, |n| of_piece(&self.pieces[n]));
        let mut lack: Vector6<f64> = sums.iter().sum();
        if let Some(z) = z {
            for (axis, at, row) in &self.resistance {
                lack -= Vector6::from(*row) * z[*axis][*at];
            }
        }
        lack
    }

    /// Calls `f` with each face, its value in a field, and its velocity in a mix of the six motions. In parallel.
    fn for_each_motion(
        &self,
        shares: &Vector6<f64>,
        field: &mut FaceFields<f64>,
        f: impl Fn(usize, usize, &mut f64, f64) + Sync,
    ) {
        let mut rest = field.each_mut().map(|field| (0, &mut field[..]));
        // Pieces of an axis ascend.
        let mut part = |piece: &Piece| {
            let (first, rest) = &mut rest[piece.axis];
            let skipped = piece.at - *first;
            *first = piece.at + piece.len;
            rest.split_off_mut(..skipped + piece.len).map(|part| &mut part[skipped..]).unwrap_or_default()
        };
        let parts: Vec<_> = self.pieces.iter().map(|piece| (piece, part(piece))).collect();
        let mut parts = parts.into_iter();
        let groups =
            std::iter::from_fn(|| Some(parts.by_ref().take(PIECES).collect::<Vec<_>>()).filter(|g| !g.is_empty()));
        parallel::for_each(groups, |_, group| {
            for (piece, values) in group {
                for (n, value) in values.iter_mut().enumerate() {
                    let motions = Vector6::from(piece.motions(n, self.about));
                    f(piece.axis, piece.at + n, value, shares.dot(&motions));
                }
            }
        });
    }
}

fn touches_solid(level: &Level, cells: &Finder<'_>, piece: &Piece) -> bool {
    (-1..=piece.len as i32).any(|n| {
        [[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]].into_iter().any(|[dy, dz]| {
            let cell = [piece.cell[0] + n, piece.cell[1] + dy, piece.cell[2] + dz];
            cells.find(cell).is_none_or(|at| (0..3).any(|axis| level.kinds[axis][at] == FaceKind::Solid))
        })
    })
}

/// Free faces that are connected.
#[derive(Debug)]
struct Part {
    pieces: Vec<Piece>,
    /// Whether no stress between them crosses a side that repeats.
    turns: bool,
}

fn faces(pieces: &[Piece]) -> usize {
    pieces.iter().map(|piece| piece.len).sum()
}

/// The free faces of each component: faces are connected through the stresses that they share, of viscosities above
/// `threshold`. Above 0, faces without such a stress are left out.
fn components(level: &Level, threshold: f32) -> Vec<Part> {
    let len = level.rows().len();
    let mut sets = Sets::new(3 * len);
    let is_free = |axis: usize, at: usize| level.kinds[axis][at] == FaceKind::Free;
    let mut is_joined = vec![threshold == 0.0; 3 * len];
    let mut crossing = Vec::new();
    for run in level.stencil.runs() {
        for n in 0..run.len as usize {
            let (at, below, above) = run.neighbours(n);
            let mut join = |faces: &[(usize, usize)]| {
                let mut free = faces.iter().filter(|(axis, at)| is_free(*axis, *at));
                if let Some((axis, first)) = free.next() {
                    let home = |axis: usize, at: usize| axis * len + level.images.home(at);
                    let first_at = home(*axis, *first);
                    is_joined[first_at] = true;
                    free.for_each(|(other, at)| {
                        is_joined[home(*other, *at)] = true;
                        sets.join(first_at as u32, home(*other, *at) as u32);
                    });
                    if faces.iter().any(|(axis, at)| is_free(*axis, *at) && !level.images.is_home(*at)) {
                        crossing.push(first_at as u32);
                    }
                }
            };
            if level.normal[at] > threshold {
                join(&[(0, at), (0, above[0]), (1, at), (1, above[1]), (2, at), (2, above[2])]);
            }
            for axis in 0..3 {
                if level.shear[axis][at] > threshold {
                    let (side, other) = ((axis + 1) % 3, (axis + 2) % 3);
                    join(&[(side, at), (side, below[other]), (other, at), (other, below[side])]);
                }
            }
        }
    }
    let mut number = vec![usize::MAX; 3 * len];
    let mut components: Vec<Part> = Vec::new();
    for axis in 0..3 {
        for run in level.stencil.runs() {
            for n in 0..run.len as usize {
                let at = run.at as usize + n;
                if !is_free(axis, at) || !is_joined[axis * len + at] {
                    continue;
                }
                let first = sets.first((axis * len + at) as u32) as usize;
                if number[first] == usize::MAX {
                    number[first] = components.len();
                    components.push(Part { pieces: Vec::new(), turns: true });
                }
                let pieces = &mut components[number[first]].pieces;
                match pieces.last_mut() {
                    Some(last) if last.axis == axis && last.at + last.len == at && n > 0 => last.len += 1,
                    _ => {
                        let cell = [run.cell[0] + n as i32, run.cell[1], run.cell[2]];
                        pieces.push(Piece { axis, at, len: 1, cell });
                    }
                }
            }
        }
    }
    for at in crossing {
        components[number[sets.first(at) as usize]].turns = false;
    }
    components
}
