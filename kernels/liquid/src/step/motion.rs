//! What moves with a liquid: its velocity, and what the next substep needs to know of the last.

use numerics::vector::{Vec3, add, scale};
use serde::{Deserialize, Serialize};

use crate::carried::{CellMaterials, MaterialPoints, Stir, TracerPoints};
use crate::level_set::PhiView;
use crate::pressure::LEAST_DEPTH;
use crate::rows::{Cell, CellRows, Finder, Images};
use crate::step::domain::{Domain, Obstacle};
use crate::step::flight::flying;
use crate::step::outflow::Outflow;
use crate::step::sources::FlowAccount;
use crate::step::substep::{layers, most_layers};
use crate::step::{LiquidSettings, Moving, Surface, Surroundings, Wall};
use crate::velocity::{ALL_FACES, FaceFields, FaceMask, MacVelocity, Sampler, Site, Slopes, extrapolate, resampled};

/// What gravity and pressure together added to the velocity in a substep.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Gain {
    /// On the rows of the velocity, m/s.
    pub faces: FaceFields<f32>,
    /// The length of that substep, s.
    pub seconds: f64,
}

/// A pressure · Δt ÷ (density · cell), m/s, the first guess of a later solve.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Guess {
    pub rows: CellRows,
    pub q: Vec<f64>,
}

/// All that a liquid's next substep depends on besides its surface; kept exactly by any format that keeps numbers.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Motion {
    pub(super) velocity: MacVelocity,
    /// The faces where it is known: those that touch liquid.
    pub(super) known: Vec<FaceMask>,
    /// The faces of pieces that touch nothing; empty where there are none.
    pub(super) flying: Vec<FaceMask>,
    pub(super) gain: Option<Gain>,
    /// Whether the velocity was set, and there was no substep since.
    pub(super) is_new: bool,
    pub(super) guess: Guess,
    /// That of the pressure that the mean velocity of a substep is solved for with.
    pub(super) mean_guess: Guess,
    pub(super) liquid_cells: usize,
    /// What each source has given, and what it owes.
    pub(super) sources: Vec<FlowAccount>,
    /// The same of sinks.
    pub(super) sinks: Vec<FlowAccount>,
    /// What flowed out through open walls in the last frame.
    pub(super) outflow: Vec<Outflow>,
    pub(super) tracers: TracerPoints,
    /// Where not all of the liquid is made of the same.
    pub(super) materials: Option<MaterialPoints>,
    /// What comes out of it in the next substep, where that matters.
    pub(super) stirred: Vec<Stir>,
}

impl Motion {
    pub(super) fn starting(
        settings: &LiquidSettings,
        surface: &dyn Surface,
        around: &Surroundings<'_>,
        velocity: &(dyn Fn(Vec3) -> Vec3 + Sync),
    ) -> Self {
        let cells = LiquidCells::of(&settings.domain, surface, around.solid.map(|solid| solid.at(0.0)));
        let value = |axis: usize, cell: Cell| velocity(Site::FACES[axis].of(cell))[axis];
        let faces = cells.rows.tabulate_with(
            || (),
            |(), cell, at| {
                let open = |axis: usize| cells.moving[at] >> axis & 1 == 1;
                [0, 1, 2].map(|axis| if open(axis) { value(axis, cell) } else { 0.0 })
            },
        );
        let (liquid_cells, flying) = (cells.liquid.len(), flying(&cells, &settings.domain));
        let known = cells.known;
        let velocity = MacVelocity::new(cells.rows, faces);
        Self { velocity, known, flying, is_new: true, liquid_cells, ..Self::default() }
    }

    /// The cells that the velocity is stored for.
    pub fn rows(&self) -> &CellRows {
        self.velocity.rows()
    }

    /// The velocity of the faces that touch liquid, m/s; 0 on others.
    pub fn velocity(&self) -> &MacVelocity {
        &self.velocity
    }

    /// Number of liquid cells.
    pub fn liquid_cells(&self) -> usize {
        self.liquid_cells
    }

    /// The tracers.
    pub fn tracers(&self) -> &TracerPoints {
        &self.tracers
    }

    /// What the liquid is made of, where that is not the same everywhere.
    pub fn materials(&self) -> Option<&MaterialPoints> {
        self.materials.as_ref()
    }

    /// The same, for what corrects volumes.
    pub fn materials_mut(&mut self) -> Option<&mut MaterialPoints> {
        self.materials.as_mut()
    }

    /// Moves all that the liquid carries besides its velocity; `view` is where it is before.
    pub(super) fn carry(&mut self, flow: &Moving<'_>, view: PhiView<'_>, settings: &LiquidSettings) {
        self.tracers.advance(flow, view, &settings.domain);
        let stirred = std::mem::take(&mut self.stirred);
        if let Some(materials) = &mut self.materials {
            let seconds = f64::from(flow.step) * settings.cell;
            stirred.iter().for_each(|stir| materials.stir(stir, seconds, settings.cell));
            materials.advance(flow, &settings.domain);
        }
    }

    /// What the cells are made of, where that is not the same everywhere. `own`: viscosity and density of what is not said
    /// otherwise.
    pub(super) fn materials_of(
        &mut self,
        cells: &LiquidCells,
        view: PhiView<'_>,
        domain: &Domain,
        own: [f32; 2],
    ) -> Option<CellMaterials> {
        Some(cells.settle(self.materials.as_mut()?, view, domain, own))
    }

    /// The largest component of the velocity, m/s.
    pub(super) fn largest_speed(&self) -> f64 {
        largest_of(self.velocity.faces())
    }

    /// What no more than one in `rare` components of the velocity exceeds, but at least the largest ÷ `most`, m/s.
    pub(super) fn usual_speed(&self, rare: usize, most: f64) -> f64 {
        let (faces, largest) = (self.velocity.faces(), self.largest_speed());
        let least = (largest / most) as f32;
        let mut fast: Vec<f32> = faces.iter().flatten().map(|u| u.abs()).filter(|u| *u > least).collect();
        let exceeding = faces.iter().map(Vec::len).sum::<usize>() / rare;
        match fast.len().checked_sub(exceeding + 1) {
            Some(at) => f64::from(*fast.select_nth_unstable_by(at, f32::total_cmp).1),
            None => largest / most,
        }
    }

    /// The velocity, m/s, continued `layers` cells past the liquid, but no farther than a substep follows it.
    pub fn velocity_past_liquid(&self, domain: &Domain, layers: i32) -> MacVelocity {
        let rows = self.rows_past_liquid(domain, layers.min(most_layers()));
        let slopes = [Slopes::nearest(f32::INFINITY)];
        let [faces] = self.continued([self.velocity.faces()], &rows, (slopes, u32::MAX), domain, None);
        MacVelocity::new(rows, faces)
    }

    /// The rows of the velocity and `layers` cells past the liquid.
    pub(super) fn rows_past_liquid(&self, domain: &Domain, layers: i32) -> CellRows {
        let [low, high] = domain.reach(layers + 1);
        domain.clip_with_images(&self.rows().rounded_within(layers - 1, low, high), layers + 1)
    }

    /// The rows of the velocity, and the cells around that liquid may come to in a substep: fewer where it is slow. It moves with this
    /// velocity, `step` cells at 1 m/s, and `reach` cells at most.
    pub(super) fn rows_in_reach(&self, domain: &Domain, velocity: &FaceFields<f32>, step: f32, reach: f32) -> CellRows {
        let [low, high] = domain.reach(layers(reach) + 1);
        let past = |rows: &CellRows, reach: f32| rows.rounded_within(layers(reach) - 1, low, high);
        let is_fast = |_, at: usize| velocity.iter().any(|field| field[at].abs() * step > SLOW);
        let rows = if reach <= SLOW {
            past(self.rows(), reach)
        } else {
            past(self.rows(), SLOW).union(&past(&self.rows().filtered(is_fast), reach))
        };
        domain.clip_with_images(&rows, layers(reach) + 1)
    }

    /// A velocity on other cells with what the last substep gained, where that is known: liquid at rest and in free fall
    /// goes on as it did.
    pub(super) fn with_last_gain(&self, cells: &LiquidCells, faces: &FaceFields<f32>, seconds: f64) -> FaceFields<f32> {
        let Some(gain) = &self.gain else { return faces.clone() };
        let ratio = (seconds / gain.seconds) as f32;
        let gained = resampled(&cells.rows, self.rows(), &gain.faces);
        std::array::from_fn(|axis| faces[axis].iter().zip(&gained[axis]).map(|(u, gain)| u + ratio * gain).collect())
    }

    /// Fields that are known where the velocity is, continued to all of `rows` by slopes for so many layers past the
    /// liquid, see [`extrapolate`].
    pub(super) fn continued<const F: usize>(
        &self,
        fields: [&FaceFields<f32>; F],
        rows: &CellRows,
        (slopes, layers): ([Slopes; F], u32),
        domain: &Domain,
        solid: Option<Obstacle<'_>>,
    ) -> [FaceFields<f32>; F] {
        let images = domain.periods().images(rows);
        let mut known = rows.resampled(self.rows(), &self.known, 0);
        let mut fields = fields.map(|faces| resampled(rows, self.rows(), faces));
        images.fill(&mut known);
        fields.iter_mut().for_each(|faces| images.fill_each(faces));
        extrapolate(rows, &mut known, fields.each_mut(), slopes, layers);
        fields.map(|mut faces| {
            images.fill_each(&mut faces);
            hold_walls(domain, rows, &mut faces);
            let mut faces = match solid {
                Some(solid) => slide(rows, &faces, solid),
                None => faces,
            };
            images.fill_each(&mut faces);
            faces
        })
    }
}

/// Cells that slow liquid moves in a substep, at most.
const SLOW: f32 = 1.0;

/// The largest component of a velocity.
pub(super) fn largest_of(faces: &FaceFields<f32>) -> f64 {
    faces.iter().map(|field| largest(field)).fold(0.0, |most, u| f64::from(u).max(most))
}

/// The largest number of a field, without its sign.
fn largest(field: &[f32]) -> f32 {
    field.iter().fold(0.0_f32, |most, u| if u.abs() > most { u.abs() } else { most })
}

/// Nothing flows through closed walls, where the faces of the liquid have not said so.
pub(super) fn hold_walls(domain: &Domain, rows: &CellRows, faces: &mut FaceFields<f32>) {
    for ([y, z], span) in rows.spans() {
        for axis in [1, 2] {
            if domain.wall_at(axis, [span.start, y, z]).is_some_and(Wall::is_solid) {
                faces[axis][span.at(span.start)..][..span.len()].fill(0.0);
            }
        }
        for x in [domain.low[0], domain.high[0]] {
            let is_closed = domain.wall_at(0, [x, y, z]).is_some_and(Wall::is_solid);
            if is_closed && span.start <= x && x < span.end {
                faces[0][span.at(x)] = 0.0;
            }
        }
    }
}

/// Distance from a solid, in cells, up to which a face is on its surface.
const FLUSH: f32 = 1e-3;

/// On faces inside a solid, takes away the part that flows into or out of it, and on the first ones turns it round: a velocity
/// interpolated between these and the ones outside is then the solid's on its surface.
fn slide(rows: &CellRows, faces: &FaceFields<f32>, solid: Obstacle<'_>) -> FaceFields<f32> {
    rows.tabulate_with(
        || Sampler::new(rows),
        |sampler, cell, at| {
            [0, 1, 2].map(|axis| {
                let own = faces[axis][at];
                let point = Site::FACES[axis].of(cell);
                let depth = -solid.distance(point);
                if depth < -FLUSH {
                    return own;
                }
                let Some(normal) = solid.normal(point) else { return own };
                let own_velocity = solid.velocity(point);
                let mut outflow = |point: Vec3| -> f32 {
                    let mut past =
                        |other: usize| sampler.value(&faces[other], Site::FACES[other], point) - own_velocity[other];
                    (0..3).map(|other| normal[other] * past(other)).sum()
                };
                let mut taken = outflow(point);
                if FLUSH < depth && depth < 1.0 {
                    taken += depth * outflow(add(point, scale(normal, depth + 1.0)));
                }
                own - taken * normal[axis]
            })
        },
    )
}

/// The liquid cells of a surface, and the cells next to them.
pub(super) struct LiquidCells {
    /// The stored cells: liquid and all next to it, with one more beyond the walls.
    pub rows: CellRows,
    /// φ of each, positive where it lies beyond a wall.
    pub level_set: Vec<f32>,
    /// φ of cells that are not stored.
    pub outside: f32,
    /// Open share of each low face.
    pub open: [Vec<f32>; 3],
    /// The velocity of a solid at each low face that it covers in part, m/s; 0 at others.
    pub solid_velocity: Option<FaceFields<f32>>,
    /// Low faces that touch liquid and are open.
    pub moving: Vec<FaceMask>,
    /// Low faces that touch liquid and whose velocity is known: open, or a wall of the domain.
    pub known: Vec<FaceMask>,
    /// The liquid cells.
    pub liquid: CellRows,
    /// Cells that repeat others.
    pub images: Images,
}

impl LiquidCells {
    pub(super) fn of(domain: &Domain, surface: &dyn Surface, solid: Option<Obstacle<'_>>) -> Self {
        let view = surface.view();
        let liquid = view.rows.filtered(|cell, at| view.phi[at] < -LEAST_DEPTH && domain.contains(cell));
        let rows = domain.clip(&liquid.dilated(1));
        let images = domain.periods().images(&rows);
        let mut level_set = rows.resampled(view.rows, view.phi, view.outside);
        Self::leave_domain(domain, &rows, &images, &mut level_set);
        let outside = view.outside;
        let mut open = domain.open_shares(&rows, solid);
        images.fill_each(&mut open);
        let solid_velocity = solid.map(|solid| domain.solid_velocity(&rows, &open, solid));
        let is_liquid: Vec<u8> = level_set.iter().map(|phi| u8::from(*phi < -LEAST_DEPTH)).collect();
        let [mut moving, mut known] = rows.tabulate_with(
            || Finder::new(&rows),
            |finder, cell, at| {
                let mut masks = [0, 0];
                for axis in 0..3 {
                    let mut below = cell;
                    below[axis] -= 1;
                    if is_liquid[at] == 1 || finder.find(below).is_some_and(|at| is_liquid[at] == 1) {
                        let is_open = open[axis][at] > 0.0;
                        masks[0] |= u8::from(is_open) << axis;
                        masks[1] |= u8::from(is_open || domain.wall_at(axis, cell).is_some()) << axis;
                    }
                }
                masks
            },
        );
        debug_assert!(moving.iter().zip(&known).all(|(moving, known)| moving & !known == 0 && *known <= ALL_FACES));
        images.fill(&mut moving);
        images.fill(&mut known);
        Self { liquid, rows, level_set, outside, open, solid_velocity, moving, known, images }
    }

    /// The largest component of the velocity of a solid at the faces that it covers in part, m/s.
    pub(super) fn largest_solid_speed(&self) -> f64 {
        self.solid_velocity.iter().flatten().map(|u| f64::from(largest(u))).fold(0.0, f64::max)
    }

    /// φ on wider rows.
    pub(super) fn level_set_on(&self, domain: &Domain, rows: &CellRows) -> Vec<f32> {
        let mut level_set = rows.resampled(&self.rows, &self.level_set, self.outside);
        Self::leave_domain(domain, rows, &domain.periods().images(rows), &mut level_set);
        level_set
    }

    /// What they are made of.
    pub(super) fn settle(
        &self,
        materials: &mut MaterialPoints,
        view: PhiView<'_>,
        domain: &Domain,
        own: [f32; 2],
    ) -> CellMaterials {
        let mut of_cells = materials.settle(&self.rows, &self.level_set, view, domain, own);
        self.images.fill(&mut of_cells.viscosity);
        self.images.fill(&mut of_cells.density);
        of_cells
    }

    /// Gives images what the faces have that they repeat.
    pub(super) fn fill_images(&mut self) {
        self.images.fill(&mut self.moving);
        self.images.fill_each(&mut self.open);
        if let Some(velocity) = &mut self.solid_velocity {
            self.images.fill_each(velocity);
        }
    }

    /// Cells beyond the walls are air, and the surface is on the wall.
    fn leave_domain(domain: &Domain, rows: &CellRows, images: &Images, level_set: &mut [f32]) {
        let beyond: Vec<_> = rows.iter().enumerate().filter(|(_, cell)| !domain.contains(*cell)).collect();
        for (at, cell) in beyond {
            let inner = [0, 1, 2].map(|axis| cell[axis].clamp(domain.low[axis], domain.high[axis] - 1));
            let phi = rows.find(inner).map_or(1.0, |inner| level_set[inner].abs());
            level_set[at] = phi.max(f32::MIN_POSITIVE);
        }
        images.fill(level_set);
    }
}
