//! What flows out through open walls.

use numerics::vector::{Vec3, dot, scale, sub};
use serde::{Deserialize, Serialize};

use crate::level_set::{PhiSampler, PhiView};
use crate::open_share::share_above;
use crate::rows::Cell;
use crate::step::domain::{Domain, Obstacle};
use crate::step::{Moving, Wall};
use crate::velocity::Site;

/// What flowed out past a cell at an open wall.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Outflow {
    /// The cell inside.
    pub cell: Cell,
    /// m³; air that comes in is none of it.
    pub volume: f64,
}

impl Outflow {
    /// A place in the liquid that flowed, in cells.
    pub fn place(&self) -> Vec3 {
        Site::Centre.of(self.cell)
    }

    /// Makes one of those that have the same cell.
    pub(super) fn merge(all: &mut Vec<Self>) {
        all.sort_by_key(|outflow| outflow.cell);
        all.dedup_by(|next, first| {
            let is_same = next.cell == first.cell;
            first.volume += if is_same { next.volume } else { 0.0 };
            is_same
        });
    }
}

/// Times per cell of way at which a wall is looked at.
const LOOKS: f32 = 2.0;
/// The same in a substep, at most.
const MOST_LOOKS: f32 = 64.0;

/// |φ| up to which it takes tricubic φ to say how much of a face is covered.
const NEAR: f32 = 1.5;

/// What a flow moves out through the open walls of a domain: each wall face is covered, at each time of the substep, by the
/// liquid that has come to it by then. `view` is the liquid before; `cell_volume` is in m³.
pub(super) fn outflow(
    domain: &Domain,
    view: PhiView<'_>,
    flow: &Moving<'_>,
    solid: Option<Obstacle<'_>>,
    cell_volume: f64,
) -> Vec<Outflow> {
    let mut all = Vec::new();
    for axis in 0..3 {
        for side in [0, 1].into_iter().filter(|side| domain.walls[axis][*side] == Wall::Open) {
            let (mut low, mut high) = (domain.low, domain.high);
            match side {
                0 => high[axis] = low[axis] + 1,
                _ => low[axis] = high[axis] - 1,
            }
            let wall = OpenWall { axis, side, domain, view, flow, solid };
            let cells = view.rows.clipped(low, high);
            let [through] = cells.tabulate_with(|| wall.reader(), |through, cell, _| [through(cell)]);
            let outflows = cells.iter().zip(through).filter(|(_, through)| *through != 0.0);
            all.extend(outflows.map(|(cell, through)| Outflow { cell, volume: through * cell_volume }));
        }
    }
    all
}

struct OpenWall<'a> {
    axis: usize,
    side: usize,
    domain: &'a Domain,
    view: PhiView<'a>,
    flow: &'a Moving<'a>,
    solid: Option<Obstacle<'a>>,
}

impl OpenWall<'_> {
    /// What a flow moves out past a cell beside the wall, in cells.
    fn reader(&self) -> impl FnMut(Cell) -> f64 {
        let (mut way, mut sampler) = (self.flow.reader(), PhiSampler::new(self.view));
        let outward = if self.side == 0 { -1.0 } else { 1.0 };
        move |cell| {
            let mut face = cell;
            face[self.axis] += self.side as i32;
            let way = way(Site::FACES[self.axis].of(face));
            let out = outward * way[self.axis];
            let phi = self.view.rows.find(cell).map_or(self.view.outside, |at| self.view.phi[at]);
            if out <= 0.0 || phi > 1.0 + out {
                return 0.0;
            }
            let corners = self.corners(face);
            let room = corners.map(|corner| self.solid.map_or(f32::MAX, |solid| solid.distance(corner)));
            let looks = (LOOKS * out).ceil().clamp(1.0, MOST_LOOKS);
            let covered = |look: i32| {
                let back = scale(way, (look as f32 + 0.5) / looks);
                let mut inside = room;
                for (inside, corner) in inside.iter_mut().zip(corners) {
                    *inside = inside.min(-self.phi(&mut sampler, sub(corner, back)));
                }
                share_above(inside)
            };
            let share = (0..looks as i32).map(covered).sum::<f32>() / looks;
            f64::from(out) * f64::from(share)
        }
    }

    /// The corners of a low face, in their order around it.
    fn corners(&self, face: Cell) -> [Vec3; 4] {
        [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(a, b)| {
            let mut corner = face;
            corner[(self.axis + 1) % 3] += a;
            corner[(self.axis + 2) % 3] += b;
            corner.map(|x| x as f32)
        })
    }

    /// φ, which goes on linearly beyond the outermost centres.
    fn phi(&self, sampler: &mut PhiSampler<'_>, point: Vec3) -> f32 {
        let (low, high) = (self.domain.low, self.domain.high);
        let within: Vec3 =
            std::array::from_fn(|axis| point[axis].clamp(low[axis] as f32 + 0.5, high[axis] as f32 - 0.5));
        let (mut phi, mut gradient) = sampler.gradient(within);
        if phi.abs() < NEAR {
            (phi, gradient) = self.view.cubic_at(within);
        }
        phi + dot(gradient, sub(point, within))
    }
}
