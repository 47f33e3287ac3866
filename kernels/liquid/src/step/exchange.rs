//! What sources and sinks do in a substep.
//!
//! After the surface moved, sources fill what is missing of their shapes as far as their rates allow, and sinks without a
//! rate empty theirs. What a rate asks for beyond that becomes divergence of the liquid cells in the shape, which moves the
//! surface in the next substep. The volumes are those that the level set shows before and after; what a sink cuts out at once is
//! that which the mesh shows, where it is as little as a film on a solid.

use numerics::vector::{Vec3, largest, length, scale};

use crate::carried::{Filled, MaterialPoints};
use crate::level_set::Distance;
use crate::rows::{Cell, CellRows};
use crate::step::domain::Obstacle;
use crate::step::motion::{LiquidCells, Motion};
use crate::step::part::{Ellipsoid, LEAST, Part};
use crate::step::pour::{Holder, Pour};
use crate::step::shape_cells::ShapeCells;
use crate::step::sources::{Flow, FlowAccount, LiquidSink, LiquidSource, SourceShape, Span};
use crate::step::{LiquidSettings, Surface, Surroundings};
use crate::velocity::{FaceFields, MacVelocity, Sampler, Site};

/// What a sink takes in a substep, at most, ÷ the volume of its liquid cells.
const TAKEN: f64 = 2.0;

/// Share of what a rate gives in a substep that may fill a shape too early.
const EARLY: f64 = 0.25;

/// Cells around the way of what comes in that its interpolation reaches.
const AROUND: f32 = 1.5;

/// φ before a source filled its shape, in cells, from which on a place on the surface is new.
const NEW: f32 = 0.1;

/// What flows through the least section of a source, ÷ its rate, at most: with less, the section grows until both are the
/// same, and what little is missing of it is filled in each substep.
const LEAST_STREAM: f64 = 0.8;

/// Share by which the velocity of a nozzle is raised where its shape is too narrow for its rate, at most.
const FASTER: f64 = 0.1;

/// What a source or a sink asks for between two times.
type Rate<'a> = Option<&'a (dyn Fn(f64, f64) -> f64 + Sync)>;

/// A substep to sources and sinks.
pub(super) struct Exchange<'a> {
    pub settings: &'a LiquidSettings,
    pub around: &'a Surroundings<'a>,
    pub solid: Option<Obstacle<'a>>,
    pub span: Span,
}

/// What sources and sinks want of the rest of a substep.
pub(super) struct Exchanged<'a> {
    /// Liquid to come out of cells and to vanish in them.
    pub pours: Vec<Pour>,
    entering: Vec<Entering<'a>>,
}

/// A source whose shape was filled, or whose velocity is imposed.
struct Entering<'a> {
    cells: ShapeCells<'a>,
    is_filled: bool,
    /// m/s.
    velocity: Option<Vec3>,
}

impl<'a> Exchange<'a> {
    /// Whether, of what acts within the liquid, something begins with a frame, or its rate is another than was expected at the
    /// end of the last: what pours is chosen at the end of a substep. The substep is all of the frame here.
    pub(super) fn changes(&self, surface: &dyn Surface, motion: &Motion) -> bool {
        let view = surface.view();
        let is_full = |source: &LiquidSource<'a>, account: &FlowAccount, asked: f64| {
            let Some(cells) = self.cells(source.shape) else { return false };
            let phi = cells.level_set(&view);
            let is_wet = !cells.liquid_cells(&phi).is_empty();
            is_wet && self.part(&cells, &phi, account.owed, EARLY * asked) == Some(Part::Whole)
        };
        let is_wet = |sink: &LiquidSink<'a>| {
            self.cells(sink.shape).is_some_and(|cells| !cells.liquid_cells(&cells.level_set(&view)).is_empty())
        };
        let changes = |rate: Rate<'a>, account: &FlowAccount, would_pour: &dyn Fn(f64) -> bool| {
            let asked = rate.map_or(0.0, |rate| Flow::of(rate, &self.span).gave);
            match account.pouring > 0.0 {
                true => account.is_surprised(asked / self.seconds()),
                false => asked > 0.0 && would_pour(asked),
            }
        };
        let mut sources = self.around.sources.iter().zip(&motion.sources);
        let mut sinks = self.around.sinks.iter().zip(&motion.sinks);
        sources.any(|(source, own)| changes(source.rate, own, &|asked| is_full(source, own, asked)))
            || sinks.any(|(sink, own)| changes(sink.rate, own, &|_| is_wet(sink)))
    }

    /// Changes the surface, and counts what that and what poured have moved.
    pub(super) fn apply(&self, surface: &mut dyn Surface, motion: &mut Motion) -> Exchanged<'a> {
        let mut exchanged = Exchanged { pours: Vec::new(), entering: Vec::new() };
        for (n, source) in self.around.sources.iter().enumerate() {
            let (account, materials) = (&mut motion.sources[n], motion.materials.as_mut());
            self.give(n, source, surface, account, materials, &mut exchanged);
        }
        for (n, sink) in self.around.sinks.iter().enumerate() {
            exchanged.pours.extend(self.take(n, sink, surface, &mut motion.sinks[n]));
        }
        exchanged
    }

    fn give(
        &self,
        n: usize,
        source: &LiquidSource<'a>,
        surface: &mut dyn Surface,
        account: &mut FlowAccount,
        materials: Option<&mut MaterialPoints>,
        out: &mut Exchanged<'a>,
    ) {
        let before = account.settle(self.seconds());
        let flow = self.asked(source.rate, account);
        let is_active = self.is_active(source.active);
        let is_given = flow.gave > 0.0 || flow.next > 0.0 || account.owed > 0.0;
        if !is_active && !is_given {
            return;
        }
        let Some(cells) = self.cells(source.shape) else { return account.withhold_beyond(0.0) };
        let mut phi = cells.level_set(&surface.view());
        let material = (source.material)(self.span.times[1]);
        let late = if before > 0.0 { 0.0 } else { account.owed - flow.gave };
        let velocity = self.imposed(source, &cells, &phi, &flow, late);
        let part = match source.rate {
            None => Some(Part::Whole),
            Some(_) if is_given => self.part(&cells, &phi, account.owed, EARLY * flow.next * flow.next_seconds),
            Some(_) => None,
        };
        let mut filled = 0.0;
        if let Some(part) = part.filter(|part| cells.adds(&phi, *part)) {
            let [low, high] = cells.bounds();
            let held = cells.volume(&phi);
            surface.change(low, high, &cells.filled(part));
            let after = cells.level_set(&surface.view());
            if let Some(attributes) = source.attributes {
                surface.edit_attributes(&|point, row| {
                    let is_in = (0..3).all(|axis| low[axis] as f32 <= point[axis] && point[axis] <= high[axis] as f32);
                    if is_in && Sampler::new(cells.rows()).value(&phi, Site::Centre, point) > NEW {
                        attributes(point, row);
                    }
                });
            }
            if let Some(materials) = materials {
                let filled = Filled { rows: cells.rows(), before: &phi, after: &after };
                materials.fill(&filled, &self.settings.domain, material);
            }
            phi = after;
            filled = (cells.volume(&phi) - held) * self.cell_volume();
            account.moved += filled;
            account.owed -= if source.rate.is_some() { filled } else { 0.0 };
        }
        let liquid = cells.liquid_cells(&phi);
        account.place = liquid.first().map_or(account.place, |deepest| Site::Centre.of(*deepest));
        if source.rate.is_some() && part == Some(Part::Whole) {
            let rate = account.rate_to_pour(&flow, filled, before);
            match liquid.is_empty() {
                true => account.withhold_beyond(0.0),
                false if rate > 0.0 => {
                    let deep = cells.deep_cells(liquid, &phi);
                    out.pours.push(Pour::new(Holder::Source(n), deep, rate).of(material));
                }
                false => {}
            }
        }
        let velocity = velocity.filter(|_| is_active);
        out.entering.push(Entering { cells, is_filled: filled > 0.0, velocity });
    }

    /// The part of a shape to fill, where this is owed, m³. What is missing of all of it may be more by `early`: less pours
    /// then.
    fn part(&self, cells: &ShapeCells<'_>, phi: &[f32], owed: f64, early: f64) -> Option<Part> {
        let part_of = |volume: f64| cells.part_that_adds(phi, volume / self.cell_volume());
        match part_of(owed + early) {
            Some(Part::Whole) => Some(Part::Whole),
            _ if owed > 0.0 => part_of(owed),
            _ => None,
        }
    }

    /// The velocity that a source imposes: where what its rate gives would leave less than the least piece of its shape that stays
    /// liquid, a lower one; where its shape is a little too narrow on the grid to let through what the rate gives, so that it is
    /// `late` by this volume, m³, one a little higher.
    fn imposed(
        &self,
        source: &LiquidSource<'_>,
        cells: &ShapeCells<'_>,
        phi: &[f32],
        flow: &Flow,
        late: f64,
    ) -> Option<Vec3> {
        let (gave, next) = (flow.gave, flow.next * flow.next_seconds);
        let velocity = (source.velocity?)(self.span.times[1]);
        let faster = if late > 0.0 && next > 0.0 { (late / next).min(FASTER) } else { 0.0 };
        let velocity = scale(velocity, 1.0 + faster as f32);
        let speed = f64::from(length(velocity));
        if gave <= 0.0 || speed <= 0.0 || !cells.adds(phi, Part::Whole) {
            return Some(velocity);
        }
        let Some(middle) = cells.middle() else { return Some(velocity) };
        let least = Ellipsoid { axes: middle.axes.map(|axis| axis.min(LEAST)), ..middle };
        let area = least.section(velocity) * self.settings.cell * self.settings.cell;
        let most = LEAST_STREAM * gave / (self.seconds() * area);
        Some(if speed > most { scale(velocity, (most / speed) as f32) } else { velocity })
    }

    fn take(
        &self,
        n: usize,
        sink: &LiquidSink<'a>,
        surface: &mut dyn Surface,
        account: &mut FlowAccount,
    ) -> Option<Pour> {
        let owed = account.owed;
        let before = account.settle(self.seconds());
        let flow = self.asked(sink.rate, account);
        let empties = sink.rate.is_none() && self.is_active(sink.active);
        if !empties && flow.gave <= 0.0 && flow.next <= 0.0 && account.owed <= 0.0 {
            return None;
        }
        let Some(cells) = self.cells(sink.shape) else {
            account.withhold_beyond(0.0);
            return None;
        };
        let phi = cells.level_set(&surface.view());
        let liquid = cells.liquid_cells(&phi);
        account.place = liquid.first().map_or(account.place, |deepest| Site::Centre.of(*deepest));
        if empties {
            if cells.takes(&phi) {
                let [low, high] = cells.bounds();
                let held = self.volume(surface, &cells);
                surface.change(low, high, &cells.emptied());
                account.cut(held - self.volume(surface, &cells));
            }
            return None;
        }
        let most = TAKEN * liquid.len() as f64 * self.cell_volume();
        account.withhold_beyond(if liquid.is_empty() { 0.0 } else { most.max(flow.gave).max(owed) });
        let (wanted, fastest) = (account.rate_to_pour(&flow, 0.0, before), most / self.span.next_seconds);
        if wanted > fastest {
            // It would be counted as taken at the end of the frame.
            account.withhold_beyond(most);
        }
        let rate = wanted.min(fastest);
        (rate > 0.0).then(|| Pour::new(Holder::Sink(n), cells.deep_cells(liquid, &phi), -rate))
    }

    /// Adds what a rate asks for to its account; returns that.
    fn asked(&self, rate: Option<&(dyn Fn(f64, f64) -> f64 + Sync)>, account: &mut FlowAccount) -> Flow {
        let Some(rate) = rate else {
            account.owed = 0.0;
            return Flow::default();
        };
        let flow = Flow::of(rate, &self.span);
        account.asked += flow.gave;
        account.owed += flow.gave;
        account.expected = flow.next;
        flow
    }

    fn is_active(&self, active: &(dyn Fn(f64) -> bool + Sync)) -> bool {
        active(0.5 * (self.span.times[0] + self.span.times[1]))
    }

    fn cells(&self, shape: SourceShape<'a>) -> Option<ShapeCells<'a>> {
        ShapeCells::new(shape, &self.settings.domain, self.solid, self.span.times[1])
    }

    /// The volume in cells, m³, but for a constant.
    fn volume(&self, surface: &dyn Surface, cells: &ShapeCells<'_>) -> f64 {
        let [low, high] = cells.bounds();
        let distance = self.solid.map(|solid| move |point: Vec3| solid.distance(point));
        let solid = distance.as_ref().map(|distance| distance as &Distance<'_>);
        surface.volume(low, high, solid) * self.cell_volume()
    }

    fn seconds(&self) -> f64 {
        self.span.times[1] - self.span.times[0]
    }

    fn cell_volume(&self) -> f64 {
        self.settings.cell_volume()
    }
}

impl Exchanged<'_> {
    /// The speed of the liquid that comes in or vanishes, m/s; `cell`: the side of a cell, m.
    pub(super) fn speed(&self, cell: f64) -> f64 {
        let pours = self.pours.iter().map(|pour| pour.speed(cell));
        let imposed = self.entering.iter().filter_map(|entering| entering.velocity.map(|v| f64::from(largest(v))));
        pours.chain(imposed).fold(0.0, f64::max)
    }

    /// What the velocity carries, `carried` or itself, where liquid comes into air: there it is that of the liquid, not what
    /// the flow beside it was continued to, or it would come in the faster the farther it fell. `reach`: cells moved.
    pub(super) fn entered(
        &self,
        motion: &Motion,
        velocity: &MacVelocity,
        carried: Option<FaceFields<f32>>,
        reach: f32,
    ) -> Option<FaceFields<f32>> {
        if self.entering.iter().all(|entering| !entering.is_filled) {
            return carried;
        }
        let mut carried = carried.unwrap_or_else(|| velocity.faces().clone());
        for entering in self.entering.iter().filter(|entering| entering.is_filled) {
            entering.for_each_face(reach + AROUND, |axis, cell, value| {
                let is_known = motion.rows().find(cell).is_some_and(|at| motion.known[at] >> axis & 1 == 1);
                if let Some(at) = velocity.rows().find(cell).filter(|_| !is_known) {
                    carried[axis][at] = value;
                }
            });
        }
        Some(carried)
    }

    /// The same on faces far from the flow, which was known on `rows`.
    pub(super) fn enter_far(&self, rows: &CellRows, cells: &LiquidCells, faces: &mut FaceFields<f32>) {
        for entering in self.entering.iter().filter(|entering| entering.is_filled) {
            entering.for_each_face(f32::INFINITY, |axis, cell, velocity| {
                if let Some(at) = cells.rows.find(cell).filter(|at| cells.moving[*at] >> axis & 1 == 1)
                    && rows.find(cell).is_none()
                {
                    faces[axis][at] = velocity;
                }
            });
        }
    }

    /// Makes the faces inside the shapes whose velocity is imposed move with it, as a solid's do, but liquid passes. Returns
    /// them.
    pub(super) fn impose(&self, cells: &mut LiquidCells) -> Vec<Imposed> {
        let mut imposed = Vec::new();
        for entering in self.entering.iter().filter(|entering| entering.velocity.is_some()) {
            entering.for_each_face(0.0, |axis, cell, velocity| {
                if let Some(at) = cells.rows.find(cell).filter(|at| cells.moving[*at] >> axis & 1 == 1) {
                    cells.moving[at] &= !(1 << axis);
                    imposed.push(Imposed { axis, cell, velocity });
                }
            });
        }
        if !imposed.is_empty() {
            let len = cells.rows.len();
            let still = || std::array::from_fn(|_| vec![0.0; len]);
            let solid_velocity = cells.solid_velocity.get_or_insert_with(still);
            Imposed::close(&imposed, &cells.rows, &mut cells.open, solid_velocity);
        }
        imposed
    }
}

/// A face whose velocity is imposed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Imposed {
    axis: usize,
    cell: Cell,
    /// m/s.
    velocity: f32,
}

impl Imposed {
    /// Closes faces of `rows` to the flow that is solved for.
    pub(super) fn close(
        all: &[Self],
        rows: &CellRows,
        open: &mut FaceFields<f32>,
        solid_velocity: &mut FaceFields<f32>,
    ) {
        Self::set(all, rows, open, |_| 0.0);
        Self::set(all, rows, solid_velocity, |velocity| velocity);
    }

    /// Sets faces of `rows` to what `value` makes of their velocities.
    pub(super) fn set(all: &[Self], rows: &CellRows, faces: &mut FaceFields<f32>, value: impl Fn(f32) -> f32) {
        for face in all {
            if let Some(at) = rows.find(face.cell) {
                faces[face.axis][at] = value(face.velocity);
            }
        }
    }
}

impl Entering<'_> {
    /// Calls `f` with each low face less than `near` cells from the shape and the velocity there.
    fn for_each_face(&self, near: f32, mut f: impl FnMut(usize, Cell, f32)) {
        let velocity = self.velocity.unwrap_or_default();
        for cell in self.cells.rows().iter() {
            for axis in 0..3 {
                if near == f32::INFINITY || self.cells.distance(Site::FACES[axis].of(cell)) < near {
                    f(axis, cell, velocity[axis]);
                }
            }
        }
    }
}
