//! Continuity in the cells next to the liquid, which are partly liquid (Harlow and Welch 1965, surface cells).

use numerics::vector::Vec3;

use crate::level_set::PhiView;
use crate::pressure::LEAST_DEPTH;
use crate::rows::{Cell, CellRows, Finder};
use crate::step::Moving;
use crate::step::domain::{Domain, Obstacle, share_outside};
use crate::step::fullness::{Neighbours, fullness};
use crate::step::motion::{Motion, hold_walls};
use crate::step::shares::inner;
use crate::transfer::add_row;
use crate::velocity::{FaceFields, FaceMask, Sampler, Site};

/// What a cell gains or loses in a substep, ÷ its volume, that is not worth a look.
const LEAST: f32 = 1e-4;

/// Distance of the middle of a cell from a solid, in cells, from which on that covers no part of its faces.
const BESIDE: f32 = 1.0;

/// The open area, ÷ cell², of the faces through which what is missing in a cell may come, at least.
const LEAST_ROOM: f32 = 0.25;

/// The least area of the surface beside a cell, ÷ cell²: liquid of less is too small to swell.
const LEAST_AREA: f32 = 1.0;

/// How far a surface swells in a substep, cells, at most.
const MOST: f32 = 0.25;

impl Motion {
    /// A velocity continued to `rows`, in which as much flows into the cells next to the liquid as out of them: what is missing
    /// comes through their faces where the velocity is not known, at most `most`, m/s, through each. A surface that moved
    /// with what is only continued lost volume wherever liquid spreads or folds.
    pub(super) fn balanced(
        &self,
        velocity: &FaceFields<f32>,
        rows: &CellRows,
        domain: &Domain,
        solid: Option<Obstacle<'_>>,
        most: f32,
    ) -> FaceFields<f32> {
        let images = domain.periods().images(rows);
        let mut known: Vec<FaceMask> = rows.resampled(self.rows(), &self.known, 0);
        images.fill(&mut known);
        // What is to come in through each such face of a cell, m/s.
        let [missing] = rows.tabulate_with(
            || Finder::new(rows),
            |finder, cell, at| {
                let Some(cell_faces) = CellFaces::of(finder, cell, at, domain) else { return [0.0] };
                let is_known = |axis: usize, at: usize| known[at] >> axis & 1 == 1;
                let count = cell_faces.iter().filter(|(axis, at, _)| is_known(*axis, *at)).count();
                if !(1..6).contains(&count) || solid.is_some_and(|solid| solid.distance(Site::Centre.of(cell)) < 0.0) {
                    return [0.0];
                }
                let cell_faces = cell_faces.beside(solid, cell);
                let unknown = cell_faces.iter().filter(|(axis, at, _)| !is_known(*axis, *at));
                let room = unknown.fold(0.0, |sum, (_, _, open)| sum + open);
                let share = if room > LEAST_ROOM { cell_faces.outflow(velocity) / room } else { 0.0 };
                [share.clamp(-most, most)]
            },
        );
        let mut faces = rows.tabulate_with(
            || Finder::new(rows),
            |finder, cell, at| {
                [0, 1, 2].map(|axis| {
                    let own = velocity[axis][at];
                    if known[at] >> axis & 1 == 1 {
                        return own;
                    }
                    let mut below = cell;
                    below[axis] -= 1;
                    own + missing[at] - finder.find(below).map_or(0.0, |below| missing[below])
                })
            },
        );
        hold_walls(domain, rows, &mut faces);
        images.fill_each(&mut faces);
        faces
    }
}

/// How far a surface moves outward, in addition to its flow. Where the flow presses liquid together in the cells next to the
/// liquid, the surface moves outward by that volume; where it pulls liquid apart, inward. [`Motion::balanced`] leaves such
/// cells where all six faces are known, as in a crease that closes, and where more is missing than it may change.
pub struct Swelling<'a> {
    rows: &'a CellRows,
    /// Cells, at the middle of each of `rows`.
    by: Vec<f32>,
    /// Between which places it is read, in cells.
    inner: [Vec3; 2],
}

impl<'a> Swelling<'a> {
    /// The swelling that keeps the volume of the liquid of `view` in `flow`; `None` where nothing is pressed together or pulled apart.
    pub(super) fn of(flow: &Moving<'a>, view: &PhiView<'_>, domain: &Domain) -> Option<Self> {
        let (rows, faces) = (flow.velocity.rows(), flow.velocity.faces());
        // What of each cell's liquid has to go elsewhere, ÷ the area of the surface around it.
        let [mut outward] = rows.tabulate_with(
            || (Finder::new(rows), Finder::new(view.rows)),
            |(finder, phis), cell, at| {
                let phi = phis.find(inner(domain, cell)).map_or(view.outside, |at| view.phi[at]);
                if !(-LEAST_DEPTH..1.0).contains(&phi) {
                    return [0.0];
                }
                let Some(cell_faces) = CellFaces::of(finder, cell, at, domain) else { return [0.0] };
                let height = flow.solid.map_or(f32::MAX, |solid| solid.distance(Site::Centre.of(cell)));
                let open = (0.5 + height).clamp(0.0, 1.0);
                // Through whole faces: the surface follows a velocity that is interpolated as if there were no solid.
                let inflow = -cell_faces.outflow(faces) * flow.step;
                if inflow.abs() * open < LEAST {
                    return [0.0];
                }
                let around = phi_around(view, domain, cell);
                // Liquid goes on in a solid.
                let liquid = (fullness(&around) - (1.0 - open)).max(0.0);
                [inflow * liquid / area(&around).max(LEAST_AREA)]
            },
        );
        if outward.iter().all(|outward| *outward == 0.0) {
            return None;
        }
        domain.periods().images(rows).fill(&mut outward);
        Some(Self::new(rows, sums_around(rows, &outward, MOST), domain))
    }

    /// By so many cells at the middle of each of `rows`.
    pub(super) fn new(rows: &'a CellRows, mut by: Vec<f32>, domain: &Domain) -> Self {
        let periods = domain.periods();
        periods.images(rows).fill(&mut by);
        let middle = |axis: usize, at: i32, side: f32| {
            if periods.0[axis] > 0 { side * f32::INFINITY } else { at as f32 - 0.5 * side }
        };
        let inner = [(domain.low, -1.0), (domain.high, 1.0)]
            .map(|(corner, side)| [0, 1, 2].map(|axis| middle(axis, corner[axis], side)));
        Self { rows, by, inner }
    }

    /// Cells outward at a place in cells. Fast where successive places are near each other.
    pub fn reader(&self) -> impl FnMut(Vec3) -> f32 {
        let mut sampler = Sampler::new(self.rows);
        let [low, high] = self.inner;
        move |point| {
            let inner = [0, 1, 2].map(|axis| point[axis].max(low[axis]).min(high[axis]));
            sampler.value(&self.by, Site::Centre, inner)
        }
    }
}

/// The sum of the values of the 27 cells around each, ± `most` at most.
fn sums_around(rows: &CellRows, values: &[f32], most: f32) -> Vec<f32> {
    let [sums] = rows.tabulate_parts(|spans, first, [sums]| {
        let mut line = Vec::new();
        for ([y, z], span) in spans {
            line.clear();
            line.resize(span.len() + 2, 0.0);
            for [_, j, k] in (0..27).step_by(3).map(|n| offset(n, 3)) {
                add_row(&mut rows.row(y + j, z + k), values, span.start - 1, 1.0, &mut line);
            }
            for (sum, around) in sums[span.at(span.start) - first..].iter_mut().zip(line.windows(3)) {
                *sum = (around[0] + around[1] + around[2]).clamp(-most, most);
            }
        }
    });
    sums
}

/// The faces of a cell.
struct CellFaces {
    /// Where each is in a field, low and high along each axis.
    at: [[usize; 2]; 3],
    /// The open share of each.
    open: [[f32; 2]; 3],
    /// What a solid moves through the rest, m/s.
    covered: [[f32; 2]; 3],
}

impl CellFaces {
    /// Those of a cell in the domain; none where one is not stored.
    fn of(finder: &Finder<'_>, cell: Cell, at: usize, domain: &Domain) -> Option<Self> {
        let above = |axis: usize| {
            let mut above = cell;
            above[axis] += 1;
            finder.find(above)
        };
        let [x, y, z] = [above(0)?, above(1)?, above(2)?];
        let at = [[at, x], [at, y], [at, z]];
        domain.contains(cell).then_some(Self { at, open: [[1.0; 2]; 3], covered: [[0.0; 2]; 3] })
    }

    /// The same beside a solid.
    fn beside(mut self, solid: Option<Obstacle<'_>>, cell: Cell) -> Self {
        let Some(solid) = solid.filter(|solid| solid.distance(Site::Centre.of(cell)) < BESIDE) else { return self };
        for axis in 0..3 {
            for side in 0..2 {
                let mut face = cell;
                face[axis] += side as i32;
                let open = share_outside(axis, face, solid);
                self.open[axis][side] = open;
                if open < 1.0 {
                    self.covered[axis][side] = (1.0 - open) * solid.velocity(Site::FACES[axis].of(face))[axis];
                }
            }
        }
        self
    }

    /// The axis of each, where it is in a field, and its open share.
    fn iter(&self) -> impl Iterator<Item = (usize, usize, f32)> + use<> {
        let (at, open) = (self.at, self.open);
        (0..3).flat_map(move |axis| (0..2).map(move |side| (axis, at[axis][side], open[axis][side])))
    }

    /// What flows out through them, m/s.
    fn outflow(&self, velocity: &FaceFields<f32>) -> f32 {
        let through = |axis: usize, side: usize| {
            self.open[axis][side] * velocity[axis][self.at[axis][side]] + self.covered[axis][side]
        };
        (0..3).fold(0.0, |sum, axis| sum + through(axis, 1) - through(axis, 0))
    }
}

/// To the n-th of `size`³ cells from the one in their middle, x fastest.
fn offset(n: usize, size: usize) -> Cell {
    [n % size, n / size % size, n / size / size].map(|at| at as i32 - size as i32 / 2)
}

/// φ around a cell; beyond the domain that of [`inner`].
fn phi_around(view: &PhiView<'_>, domain: &Domain, cell: Cell) -> Neighbours {
    let along: [Cell; 5] = std::array::from_fn(|n| inner(domain, cell.map(|x| x + n as i32 - 2)));
    let (first, last) = (along[0][0], along[4][0]);
    let mut phi = [view.outside; 125];
    for (n, row) in phi.chunks_exact_mut(5).enumerate() {
        let [y, z] = [along[n % 5][1], along[n / 5][2]];
        let spans = view.rows.row(y, z);
        let span = |x: i32| spans.get(spans.partition_point(|span| span.end <= x)).filter(|span| span.start <= x);
        match span(first) {
            Some(span) if last == first + 4 && last < span.end => row.copy_from_slice(&view.phi[span.at(first)..][..5]),
            _ => {
                for (phi, [x, ..]) in row.iter_mut().zip(along) {
                    *phi = span(x).map_or(view.outside, |span| view.phi[span.at(x)]);
                }
            }
        }
    }
    phi
}

/// The area, ÷ cell², of the surface that moves as the 3³ cells in the middle do: the change of fullness over each face of
/// these, half of it where the other cell is none of them, times the cosine between the face and the surface. That sums to 1
/// over a unit of a plane however it leans, and to nearly 2 over a gap narrower than a cell.
fn area(phi: &Neighbours) -> f32 {
    let mut sum = 0.0;
    for [x, y, z] in (0..27).map(|n| offset(n, 3)) {
        let at = 62 + x + 5 * y + 25 * z;
        for step in [-25, -5, -1, 1, 5, 25] {
            let [near, far] = [at, at + step].map(|at| phi[at as usize]);
            let change = (0.5 - near).clamp(0.0, 1.0) - (0.5 - far).clamp(0.0, 1.0);
            sum += 0.5 * change.abs() * (near - far).abs().min(1.0);
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use numerics::trig;
    use numerics::vector::{Vec3, add, cross, dot, length, scale, unit};

    use super::*;
    use crate::marked::MarkedSurface;
    use crate::step::{Liquid, LiquidSettings, Surface, Surroundings};
    use crate::velocity::{MacVelocity, Slopes};

    /// A ball in a flow that bends: what cells next to it, whose faces are not all known, lose in a second, m/s a cell.
    #[test]
    fn cells_next_to_the_liquid_lose_nothing() {
        let domain = Domain::closed([0; 3], [24; 3]);
        let ball = |p: Vec3| length([p[0] - 12.2, p[1] - 11.9, p[2] - 12.1]) - 6.3;
        let around = Surroundings::new(&|_| [0.0; 3], &|_| 0.0);
        let mut liquid = Liquid::new(LiquidSettings::new(domain, 1.0), MarkedSurface::new(domain, 1, ball, 0, 1));
        liquid.set_velocity(
            |[x, y, _]| {
                let ((sx, cx), (sy, cy)) = (trig::sin_cos(0.5 * x), trig::sin_cos(0.5 * y));
                [sx * cy, -cx * sy, 0.0]
            },
            &around,
        );
        let motion = liquid.motion();
        let rows = motion.rows_past_liquid(&domain, 4);
        let nearest = Slopes::nearest(1.0);
        let [continued] = motion.continued([motion.velocity().faces()], &rows, ([nearest], 3), &domain, None);
        let balanced = motion.balanced(&continued, &rows, &domain, None, 1.0);
        let lost = |faces: &FaceFields<f32>| {
            let mut sum = 0.0;
            for (at, cell) in rows.iter().enumerate() {
                let above = [0, 1, 2].map(|axis| {
                    let mut above = cell;
                    above[axis] += 1;
                    rows.find(above)
                });
                let [Some(x), Some(y), Some(z)] = above else { continue };
                let middle = Site::Centre.of(cell);
                if (0.0..0.5).contains(&ball(middle)) {
                    let out = [x, y, z].into_iter().enumerate();
                    sum += out.fold(0.0, |sum, (axis, above)| sum + faces[axis][above] - faces[axis][at]).abs();
                }
            }
            sum
        };
        let (before, after) = (lost(&continued), lost(&balanced));
        assert!(before > 1.0 && after < 0.5 * before, "{before} {after}");
    }

    /// Two blocks that come together, 0.6 cells apart: the velocity between is interpolated, so that their surfaces move 0.6 of
    /// their way.
    #[test]
    fn fronts_that_meet_move_with_their_liquid() {
        let domain = Domain::closed([0; 3], [25, 16, 16]);
        let blocks = |p: Vec3| {
            let block = (p[0] - 12.5).abs().max((p[1] - 8.0).abs()).max((p[2] - 8.0).abs()) - 6.0;
            block.max(0.3 - (p[0] - 12.5).abs())
        };
        let around = Surroundings::new(&|_| [0.0; 3], &|_| 0.0);
        let mut liquid = Liquid::new(LiquidSettings::new(domain, 1.0), MarkedSurface::new(domain, 1, blocks, 0, 1));
        liquid.set_velocity(|p| [if p[0] < 12.5 { 1.0 } else { -1.0 }, 0.0, 0.0], &around);
        let motion = liquid.motion();
        let rows = motion.rows_past_liquid(&domain, 4);
        let slopes = ([Slopes::nearest(1.0)], 3);
        let [continued] = motion.continued([motion.velocity().faces()], &rows, slopes, &domain, None);
        let velocity = MacVelocity::new(rows, continued);
        let flow = Moving { velocity: &velocity, step: 0.1, periods: domain.periods(), solid: None };
        let front = [12.2, 8.0, 8.0];
        let way = flow.reader()(front)[0];
        let outward = Swelling::of(&flow, &liquid.surface().view(), &domain).map(|swelling| swelling.reader()(front));
        let moved = way + outward.unwrap_or(0.0);
        assert!((way - 0.06).abs() < 1e-6 && (0.07..0.1).contains(&moved), "{way} {moved}");
    }

    #[test]
    fn planes_have_the_area_that_moves() {
        // What a shift of 3³ cells, interpolated between their middles, is at a place.
        let shift = |p: Vec3| p.map(|x| (2.0 - x.abs()).clamp(0.0, 1.0)).iter().product::<f32>();
        for normal in [[0.0, 1.0, 0.0], [0.6, 0.0, 0.8], [0.48, 0.64, 0.6]] {
            let first = unit(cross(normal, [1.0, 0.0, 0.0])).unwrap_or_default();
            let (second, mut ratio) = (cross(normal, first), 0.0);
            for height in [-0.4, -0.2, 0.0, 0.2, 0.4] {
                let phi = std::array::from_fn(|n| dot(normal, offset(n, 5).map(|x| x as f32)) - height);
                let on_plane = |n: i32| {
                    let [u, v] = [n % 160, n / 160].map(|n| 0.05 * n as f32 - 4.0);
                    add(scale(normal, height), add(scale(first, u), scale(second, v)))
                };
                let moves: f32 = (0..25600).map(|n| shift(on_plane(n)) * 0.0025).sum();
                ratio += 0.2 * area(&phi) / moves;
            }
            assert!((ratio - 1.0).abs() < 0.05, "{normal:?}: {ratio}");
        }
    }
}
