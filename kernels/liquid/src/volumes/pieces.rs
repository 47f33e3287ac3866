//! The pieces of a liquid and their volumes, from its mesh.

use std::f32::consts::FRAC_1_SQRT_2;

use numerics::parallel;
use numerics::vector::{Vec3, dot, length, scale, sub};
use serde::{Deserialize, Serialize};

use super::phases::{PhasesOfPieces, Ways};
use crate::carried::{PhaseReader, PhaseShares};
use crate::extract::QuadMesh;
use crate::level_set::Distance;
use crate::level_set::{PhiView, floor};
use crate::marked::MarkedSurface;
use crate::markers::{Marker, NO_PIECE};
use crate::rows::{Cell, CellRows, Finder, Periods};
use crate::sets::Sets;
use crate::step::Owed;

/// Distance, in cells, up to which φ moves with a shift; beyond, it is made anew from there.
const NEAR: f32 = 3.0;
/// Steps down the slope of φ to the piece that it belongs to.
const DESCENT: usize = 5;
/// A piece whose volume changed by more than this share is another.
const SAME: f64 = 0.1;
/// Bounds of how much a volume changes ÷ area · way.
const RESPONSES: [f64; 2] = [0.5, 4.0];
/// Distance from a solid, in cells, from which a piece is not beside it.
const CLEAR: f32 = 2.0;
/// φ of cells that hold some liquid is below, in cells.
pub(super) const HOLDS: f32 = 0.5;

/// A piece as it was measured, in surface cells.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Measured {
    /// What its surface encloses, without its bubbles.
    pub(super) volume: f64,
    /// The area of its surface, bubbles included, walls and solids not.
    pub(super) area: f64,
    /// The mean of its cells.
    pub(super) place: Vec3,
}

/// All pieces: cells inside that share a face are of one piece, and so are those along one closed surface.
pub(super) struct Pieces {
    pub(super) all: Vec<Measured>,
    inside: CellRows,
    /// At the first cell of each span of `inside`, its piece.
    of_span: Vec<u32>,
    /// φ outside solids, where there are any.
    clipped: Option<Vec<f32>>,
    pub(super) phases: PhasesOfPieces,
}

/// Which piece each cell inside is of.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct PieceCells {
    inside: CellRows,
    /// The first cell of a span from which on all are of a piece, and that piece.
    runs: Vec<(u32, u32)>,
}

impl PieceCells {
    /// The piece of a cell inside.
    pub(super) fn of_cell(&self, cell: Cell) -> Option<u32> {
        let span = self.inside.span_of(cell)?;
        let after = self.runs.partition_point(|(first, _)| *first <= span.base);
        self.runs.get(after.checked_sub(1)?).map(|(_, piece)| *piece)
    }
}

/// What a quad lies on.
#[derive(Clone, Copy)]
struct Side {
    /// The first cell, in `inside`, of the span behind it.
    span: u32,
    /// Whether it is neither on a wall nor on a solid.
    is_free: bool,
}

impl Pieces {
    /// The pieces of what is not in a solid.
    pub(super) fn new(surface: &MarkedSurface, solid: Option<&Distance<'_>>, phases: Option<&PhaseShares>) -> Self {
        let clipped = solid.map(|solid| surface.phi_outside(solid));
        let (view, whole) = (surface.view_of(clipped.as_deref()), surface.view_of(None));
        let inside = view.rows.filtered(|_, at| view.phi[at] < 0.0).clipped(view.low, view.high);
        let is_free = |cell: Cell| contains(view, cell) && whole.rows.find(cell).is_none_or(|at| whole.phi[at] >= 0.0);
        let (mesh, sides) = surface.meshed(view, solid, |inner, outer| Side {
            span: inside.span_of(inner).map_or(0, |span| span.base),
            is_free: is_free(outer),
        });
        let (of_span, count) = numbered(&inside, surface.periods(), &mesh, &sides);
        let all = measured(&inside, &of_span, count, &mesh, &sides);
        let mut found = Self { all, inside, of_span, clipped, phases: PhasesOfPieces::one() };
        if let Some(phases) = phases {
            let free: Vec<(Vec3, u32, f64)> = mesh
                .quads
                .iter()
                .zip(&sides)
                .filter(|(_, side)| side.is_free)
                .map(|(quad, side)| {
                    (mesh.middle(*quad), found.of_span[side.span as usize], 0.5 * mesh.twice_area(*quad))
                })
                .collect();
            let view = surface.view_of(found.clipped.as_deref());
            found.phases = PhasesOfPieces::new(phases, &found, view, &free, surface.resolution() as f32);
        }
        found
    }

    /// The piece of which a cell, stored at `at`, holds some: its own, or that of the deepest cell that shares a face with it.
    pub(super) fn holding(&self, view: PhiView<'_>, finder: &Finder<'_>, cell: Cell, at: usize) -> Option<u32> {
        if view.phi[at] >= HOLDS || !contains(view, cell) {
            return None;
        }
        if let Some(piece) = self.of_cell(cell) {
            return Some(piece);
        }
        let mut deepest: Option<(f32, Cell)> = None;
        for side in 0..6 {
            let mut beside = cell;
            beside[side / 2] += 2 * (side as i32 % 2) - 1;
            let phi = finder.find(beside).map_or(view.outside, |at| view.phi[at]);
            if phi < 0.0 && deepest.is_none_or(|(least, _)| phi < least) {
                deepest = Some((phi, beside));
            }
        }
        self.of_cell(deepest?.1)
    }

    /// The volume of all, in surface cells.
    pub(super) fn volume(&self) -> f64 {
        self.all.iter().fold(0.0, |sum, piece| sum + piece.volume)
    }

    /// The volume of a phase in a piece, in surface cells.
    pub(super) fn volume_of(&self, piece: usize, phase: usize) -> f64 {
        self.all[piece].volume * self.phases.share(piece, phase)
    }

    /// Area · way of the surface of each piece.
    pub(super) fn swept(&self, ways: &Ways) -> Vec<f64> {
        let of_piece = |(n, piece): (usize, &Measured)| {
            let of_phase = |phase| ways.all[n * ways.count + phase] * self.phases.area(n, phase, piece.area);
            (0..ways.count).map(of_phase).fold(0.0, |sum, swept| sum + swept)
        };
        self.all.iter().enumerate().map(of_piece).collect()
    }

    /// How much the volume of each piece changed ÷ area · way, where `swept` is that product for each surface moved since
    /// `before`, and `same` which of these it is, where its target says so. Films on solids open and close holes, and so respond more
    /// than their area says. What did not move responds as it did.
    pub(super) fn responses(&self, before: &Self, same: &[Option<usize>], swept: &[f64], known: &[f64]) -> Vec<f64> {
        let change = |piece: &Measured, same: usize| piece.volume - before.all[same].volume;
        let likely = |piece: &Measured| {
            let away = |n: &usize| length(sub(before.all[*n].place, piece.place));
            let same = (0..before.all.len()).min_by(|a, b| away(a).total_cmp(&away(b)))?;
            (change(piece, same).abs() <= SAME * piece.volume).then_some(same)
        };
        let of_piece = |(piece, same): (&Measured, &Option<usize>)| {
            let same = same.or_else(|| likely(piece))?;
            match swept[same] == 0.0 {
                true => Some(known[same]),
                false => Some((change(piece, same) / swept[same]).clamp(RESPONSES[0], RESPONSES[1])),
            }
        };
        self.all.iter().zip(same).map(|piece| of_piece(piece).unwrap_or(1.0)).collect()
    }

    /// The piece of a cell inside.
    pub(super) fn of_cell(&self, cell: Cell) -> Option<u32> {
        self.inside.span_of(cell).map(|span| self.of_span[span.base as usize])
    }

    /// The piece that a marker is on: that of the cell next to it which is farthest behind it.
    pub(super) fn of_marker(&self, marker: &Marker) -> u32 {
        let first = marker.point.map(|x| floor(x - 0.5));
        let (mut deepest, mut found) = (f32::INFINITY, NO_PIECE);
        for corner in 0..8 {
            let cell = [0, 1, 2].map(|axis| first[axis].saturating_add(corner >> axis & 1));
            let Some(piece) = self.of_cell(cell) else { continue };
            let ahead = dot(sub(cell.map(|x| x as f32 + 0.5), marker.point), marker.normal);
            if ahead < deepest {
                (deepest, found) = (ahead, piece);
            }
        }
        found
    }

    /// The piece closest to a place in surface cells, and how far from it its closest cell is.
    pub(super) fn closest(&self, place: Vec3) -> Option<(usize, f32)> {
        if let Some(piece) = self.of_cell(place.map(floor)) {
            return Some((piece as usize, 0.0));
        }
        let mut closest: Option<(usize, f32)> = None;
        for ([y, z], span) in self.inside.spans() {
            let beyond = |at: f32, low: i32, high: i32| (low as f32 - at).max(at - high as f32).max(0.0);
            let away = [beyond(place[0], span.start, span.end), beyond(place[1], y, y + 1), beyond(place[2], z, z + 1)];
            let distance = length(away);
            if closest.is_none_or(|(_, least)| distance < least) {
                closest = Some((self.of_span[span.base as usize] as usize, distance));
            }
        }
        closest
    }

    /// Where all of them are.
    pub(super) fn cells(&self) -> PieceCells {
        let mut runs: Vec<(u32, u32)> = Vec::new();
        for (_, span) in self.inside.spans() {
            let piece = self.of_span[span.base as usize];
            if runs.last().is_none_or(|(_, last)| *last != piece) {
                runs.push((span.base, piece));
            }
        }
        PieceCells { inside: self.inside.clone(), runs }
    }

    pub(super) fn cells_of(&self, piece: usize) -> Vec<Cell> {
        let own = self.inside.spans().filter(|(_, span)| self.of_span[span.base as usize] as usize == piece);
        own.flat_map(|([y, z], span)| (span.start..span.end).map(move |x| [x, y, z])).collect()
    }

    /// The cells of a piece and those at most `by` away.
    pub(super) fn cells_around(&self, piece: usize, by: i32) -> CellRows {
        CellRows::from_cells(&self.cells_of(piece)).dilated(by)
    }

    /// Moves the surface of each phase of each piece, which its markers know, outward by one of `ways`, in cells.
    pub(super) fn shift(&self, surface: &mut MarkedSurface, ways: &Ways, phases: Option<&PhaseShares>) {
        let view = surface.view_of(self.clipped.as_deref());
        let (phi, by) = (surface.level_set().phi(), 1.0 / surface.resolution() as f32);
        let (pieces, below) = (self.of_cells(view.rows), self.downhill(view, phi));
        let start = || phases.map(PhaseShares::reader);
        let [cells] = view.rows.tabulate_with(start, |reader, cell, at| {
            let piece = if phi[at].abs() < NEAR { descend(&pieces, &below, at) } else { NO_PIECE };
            let middle = || cell.map(|x| (x as f32 + 0.5) * by);
            [ways.at(piece, reader.as_mut(), middle)]
        });
        let (markers, pieces) = (&surface.markers().markers, surface.markers().pieces());
        let of_marker = |reader: &mut Option<PhaseReader<'_>>, n: usize| {
            ways.at(pieces[n], reader.as_mut(), || scale(markers[n].point, by))
        };
        let start = || phases.map(PhaseShares::reader);
        let markers = parallel::tabulate_with(markers.len(), parallel::CHUNK, start, of_marker);
        surface.shift(&cells, &markers);
    }

    /// Takes pieces out of a surface, but for those beside a solid: their liquid goes on in it, and would come back from there.
    /// Returns those taken, which then enclose nothing, and what the solver's cells no longer hold.
    pub(super) fn take_out(
        &mut self,
        surface: &mut MarkedSurface,
        solid: Option<&Distance<'_>>,
        which: &[bool],
    ) -> (Vec<usize>, Vec<Owed>) {
        let size = surface.resolution() as f32;
        let is_clear = |cell: &Cell| {
            let middle = cell.map(|x| (x as f32 + 0.5) / size);
            solid.is_none_or(|solid| size * solid(middle) > CLEAR)
        };
        let mut own = vec![Vec::new(); which.len()];
        for ([y, z], span) in self.inside.spans() {
            let piece = self.of_span[span.base as usize] as usize;
            if which[piece] {
                own[piece].extend((span.start..span.end).map(|x| [x, y, z]));
            }
        }
        own.iter_mut().filter(|cells| !cells.iter().all(is_clear)).for_each(Vec::clear);
        let taken: Vec<usize> = (0..own.len()).filter(|piece| !own[*piece].is_empty()).collect();
        if taken.is_empty() {
            return (taken, Vec::new());
        }
        let is_taken = |piece: u32| own.get(piece as usize).is_some_and(|cells| !cells.is_empty());
        let held = surface.take_out(&CellRows::from_cells(&own.concat()), solid, is_taken);
        for piece in &taken {
            self.all[*piece] = Measured { place: self.all[*piece].place, ..Measured::default() };
        }
        (taken, held)
    }

    /// The piece of each of these cells; [`NO_PIECE`] outside.
    fn of_cells(&self, rows: &CellRows) -> Vec<u32> {
        let mut pieces = vec![NO_PIECE; rows.len()];
        for ([y, z], span) in self.inside.spans() {
            let first = rows.find([span.start, y, z]).expect("cells inside are stored");
            pieces[first..first + span.len()].fill(self.of_span[span.base as usize]);
        }
        pieces
    }

    /// Of each cell outside a piece that a shift may move, the cell of those around to which φ falls steepest; of others, and
    /// where it falls nowhere, the cell itself.
    fn downhill(&self, view: PhiView<'_>, phi: &[f32]) -> Vec<u32> {
        // A way down passes cells whose φ outside solids is less, but whose own is not near the surface.
        let is_passed = |at: usize| view.phi[at] >= 0.0 && (self.clipped.is_some() || phi[at] < NEAR);
        let [below] = view.rows.tabulate_with(
            || Finder::new(view.rows),
            |finder, cell, at| {
                let (mut steepest, mut below) = (0.0, at);
                if !is_passed(at) {
                    return [at as u32];
                }
                for (by, inverse_length) in &AROUND {
                    let mut beside = cell;
                    (0..3).for_each(|axis| beside[axis] += by[axis]);
                    let Some(beside_at) = finder.find(beside) else { continue };
                    let slope = (view.phi[beside_at] - view.phi[at]) * inverse_length;
                    if slope < steepest && contains(view, beside) {
                        (steepest, below) = (slope, beside_at);
                    }
                }
                [below as u32]
            },
        );
        below
    }
}

/// The cells around one, x fastest, and 1 ÷ how far they are.
const AROUND: [([i32; 3], f32); 26] = {
    let (mut around, mut n, mut count) = ([([0; 3], 1.0); 26], 0, 0);
    while n < 27 {
        let by = [n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1];
        let axes = (by[0] != 0) as usize + (by[1] != 0) as usize + (by[2] != 0) as usize;
        if axes > 0 {
            around[count] = (by, [0.0, 1.0, FRAC_1_SQRT_2, 0.577_350_26][axes]);
            count += 1;
        }
        n += 1;
    }
    around
};

/// The piece to which the steepest way down φ leads from a cell.
fn descend(pieces: &[u32], below: &[u32], mut at: usize) -> u32 {
    for _ in 0..DESCENT {
        let next = below[at] as usize;
        if pieces[at] != NO_PIECE || next == at {
            break;
        }
        at = next;
    }
    pieces[at]
}

fn contains(view: PhiView<'_>, cell: Cell) -> bool {
    (0..3).all(|axis| view.low[axis] <= cell[axis] && cell[axis] < view.high[axis])
}

/// The piece of each span, at its first cell, and how many there are. They are numbered by their first cells.
fn numbered(inside: &CellRows, periods: Periods, mesh: &QuadMesh, sides: &[Side]) -> (Vec<u32>, usize) {
    let mut sets = Sets::of_cells(inside, periods);
    let mut surfaces = Sets::new(mesh.points.len());
    for [a, rest @ ..] in &mesh.quads {
        rest.iter().for_each(|b| surfaces.join(*a, *b));
    }
    let mut behind = vec![NO_PIECE; mesh.points.len()];
    for (quad, side) in mesh.quads.iter().zip(sides) {
        let first = &mut behind[surfaces.first(quad[0]) as usize];
        if *first == NO_PIECE {
            *first = side.span;
        }
        sets.join(*first, side.span);
    }
    let (mut of_span, mut count) = (vec![NO_PIECE; inside.len()], 0);
    for (_, span) in inside.spans() {
        let first = sets.first(span.base);
        if first == span.base {
            of_span[first as usize] = count;
            count += 1;
        }
        of_span[span.base as usize] = of_span[first as usize];
    }
    (of_span, count as usize)
}

fn measured(inside: &CellRows, of_span: &[u32], count: usize, mesh: &QuadMesh, sides: &[Side]) -> Vec<Measured> {
    let piece = |side: &Side| of_span[side.span as usize] as usize;
    let mut origins: Vec<Option<Vec3>> = vec![None; count];
    for (quad, side) in mesh.quads.iter().zip(sides) {
        origins[piece(side)].get_or_insert(mesh.points[quad[0] as usize]);
    }
    let term = |n: usize| {
        let (quad, side) = (&mesh.quads[n], &sides[n]);
        let volume = origins[piece(side)].map_or(0.0, |origin| mesh.six_volumes(origin, *quad));
        (volume, if side.is_free { mesh.twice_area(*quad) } else { 0.0 })
    };
    let terms: Vec<(f64, f64)> = parallel::tabulate(sides.len(), parallel::CHUNK, term);
    let mut all = vec![Measured::default(); count];
    for ((volume, area), side) in terms.iter().zip(sides) {
        let piece = &mut all[piece(side)];
        piece.volume += volume / 6.0;
        piece.area += area / 2.0;
    }
    // Sums over cells, then how many they are.
    let mut sums = vec![[0.0_f64; 4]; count];
    for ([y, z], span) in inside.spans() {
        let sum = &mut sums[of_span[span.base as usize] as usize];
        let cells = span.len() as f64;
        let middle = [0.5 * f64::from(span.start + span.end), f64::from(y) + 0.5, f64::from(z) + 0.5];
        (0..3).for_each(|axis| sum[axis] += cells * middle[axis]);
        sum[3] += cells;
    }
    for (piece, [x, y, z, cells]) in all.iter_mut().zip(sums) {
        piece.place = [x, y, z].map(|sum| (sum / cells) as f32);
    }
    all
}
