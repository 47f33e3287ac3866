//! One substep.

use numerics::vector::{Vec3, add, length, scale, sub};

use crate::level_set::{Distance, Held, PhiChange, PhiView, far_from_surface, floor, held};
use crate::rows::{Cell, CellRows, Finder, Periods};
use crate::step::continuity::Swelling;
use crate::step::domain::{Domain, Obstacle, Solid};
use crate::step::exchange::{Exchange, Imposed};
use crate::step::flight::flying;
use crate::step::force::cut_cells;
use crate::step::mean::{Kept, Start};
use crate::step::motion::{Gain, LiquidCells, Motion, largest_of};
use crate::step::outflow::outflow;
use crate::step::passed::{is_passing, passed_over};
use crate::step::pools::Pools;
use crate::step::project::{Materials, Projection};
use crate::step::remainder::{self, Others, Remainder};
use crate::step::sources::{LiquidSink, LiquidSource, SourceShape, Span};
use crate::step::turned;
use crate::step::{LiquidReport, LiquidSettings, Splitting};
use crate::velocity::{Advection, Around, FaceFields, MacVelocity, Method, Sampler, Slopes};

/// What is around a liquid.
#[derive(Clone, Copy)]
pub struct Surroundings<'a> {
    /// Gravity at a time since the start of the frame, m/s².
    pub gravity: &'a (dyn Fn(f64) -> [f64; 3] + Sync),
    /// Dynamic viscosity at a time since the start of the frame, Pa·s, where no
    /// [`LiquidMaterial`](crate::carried::LiquidMaterial) says otherwise.
    pub viscosity: &'a (dyn Fn(f64) -> f64 + Sync),
    /// What liquid does not enter.
    pub solid: Option<Solid<'a>>,
    /// Where liquid comes in. Their order is that of their accounts: it stays from frame to frame.
    pub sources: &'a [LiquidSource<'a>],
    /// Where it is taken away; likewise.
    pub sinks: &'a [LiquidSink<'a>],
    /// Asked before each substep: whether the frame is no longer wanted. It then ends where it is.
    pub cancelled: &'a (dyn Fn() -> bool + Sync),
}

impl<'a> Surroundings<'a> {
    /// Gravity and viscosity at a time since the start of the frame, m/s² and Pa·s; nothing else.
    pub const fn new(
        gravity: &'a (dyn Fn(f64) -> [f64; 3] + Sync),
        viscosity: &'a (dyn Fn(f64) -> f64 + Sync),
    ) -> Self {
        Self { gravity, viscosity, solid: None, sources: &[], sinks: &[], cancelled: &|| false }
    }

    /// The shapes of sources and sinks.
    pub(super) fn shapes(&self) -> impl Iterator<Item = SourceShape<'a>> + use<'_, 'a> {
        self.sources.iter().map(|source| source.shape).chain(self.sinks.iter().map(|sink| sink.shape))
    }
}

/// The surface of a liquid.
pub trait Surface {
    /// φ, a distance near the surface.
    fn view(&self) -> PhiView<'_>;

    /// Moves by a flow that moves nothing in the liquid farther than `reach` cells.
    fn advance(&mut self, flow: &Moving<'_>, reach: f32);

    /// φ on the finest grid that there is, and how many of its cells lie along a cell's edge.
    fn finest_view(&self) -> (PhiView<'_>, i32) {
        (self.view(), 1)
    }

    /// Moves outward; [`Surface::advance`] follows. A surface may do without, and change its volume.
    fn swell(&mut self, _swelling: &Swelling<'_>) {}

    /// Continues the liquid into a solid that it touches, and takes it out of the rest of the solid, which would leave it
    /// behind as it moves on. `solid` is the distance from it, in cells, negative inside. A surface may do without.
    fn meet(&mut self, _solid: &Distance<'_>) {}

    /// Changes φ of the cells `low` ≤ cell < `high` to what `change` makes of a place in them and φ there, both in cells;
    /// the result need be a distance only where it is next to 0.
    fn change(&mut self, low: Cell, high: Cell, change: &PhiChange<'_>);

    /// The volume between two corners, ÷ cell³, without what is in a solid, but for a constant that depends on what is beyond
    /// them: the difference between two is that of the liquid.
    fn volume(&self, low: Cell, high: Cell, solid: Option<&Distance<'_>>) -> f64;

    /// Changes the attributes of points on it to what `edit` makes of their places, in cells, and of them. A surface may do
    /// without.
    fn edit_attributes(&mut self, _edit: &(dyn Fn(Vec3, &mut [f32]) + Sync)) {}
}

/// Volume, ÷ cell³, that a surface is to gain at a place in cells.
pub type Owed = (Vec3, f32);

/// The ways of points in a substep.
#[derive(Clone, Copy)]
pub struct Moving<'a> {
    /// Velocity, m/s.
    pub velocity: &'a MacVelocity,
    /// Cells moved at 1 m/s.
    pub step: f32,
    /// After how many cells it repeats.
    pub periods: Periods,
    /// What is not passed, however thin.
    pub(crate) solid: Option<Obstacle<'a>>,
}

impl<'a> Moving<'a> {
    /// The way, in cells, at a place in cells. Fast where successive places are near each other.
    pub fn reader(&self) -> impl FnMut(Vec3) -> Vec3 + use<'a> {
        let Self { velocity, step, periods, .. } = *self;
        let mut sampler = Sampler::new(velocity.rows());
        move |point| scale(velocity.at(&mut sampler, periods.home_point(point)), step)
    }

    /// The way, in cells, at the middle of a cell; 0 where no liquid comes. Fast where successive cells are near each other.
    pub(crate) fn centre_reader(&self) -> impl FnMut(Cell) -> Vec3 + use<'a> {
        let Self { velocity, step, periods, .. } = *self;
        let (mut around, mut way, finder) = (Around::new(velocity.rows()), self.reader(), Finder::new(velocity.rows()));
        move |cell| match if periods.any() { None } else { around.places(cell) } {
            Some(places) => scale(places.at_centre(velocity.faces()), step),
            None if periods.any() || finder.find(cell).is_some() => way(cell.map(|x| x as f32 + 0.5)),
            None => [0.0; 3],
        }
    }

    /// What is left of a way, in cells, from a place, where a thin solid is in it: forwards in time, or backwards where
    /// `direction` is −1 instead of 1.
    pub(crate) fn held(&self, from: Vec3, way: Vec3, direction: f32) -> Option<Held> {
        let (solid, from) = (self.solid?, self.periods.home_point(from));
        // The solid is where it is in the middle of the substep, and half its way from where the liquid's way begins and from
        // where that ends.
        if solid.distance(from) > length(way) + 1.5 * self.solid_way() {
            return None;
        }
        let half = scale(solid.velocity(from), 0.5 * direction * self.step);
        let moved = scale(half, 2.0);
        let held = held(&|point| solid.distance(point), add(from, half), sub(way, moved))?;
        Some(Held { way: add(held.way, moved), ..held })
    }

    /// Cells that the solid's surface moves, at most.
    pub(crate) fn solid_way(&self) -> f32 {
        self.solid.map_or(0.0, |solid| solid.speed() * self.step)
    }
}

/// Differences of velocity between neighbouring faces that are continued, in cells a substep: a flow that changes faster
/// would turn its cells over.
pub(super) const STEEPEST: f32 = 0.25;

/// Layers past the liquid, besides the cells that it moves in a substep, in which velocity goes on as it changes: the faces of
/// the next substep come from there. Farther out there may be films too thin for a cell, which would fly off.
pub(super) const SLOPING_LAYERS: u32 = 2;

/// Cells that liquid is followed over in a substep, at most, so that a substep takes a bounded time: what moves farther ends
/// anywhere.
pub(super) const FARTHEST: f32 = 64.0;

/// Times in a substep, at most, that a surface gets back what it did not keep.
pub(super) const LOOKS: u32 = 4;

/// Cells past the liquid whose velocity is needed where nothing moves farther than `reach` cells: a surface follows the flow
/// as far as it may come.
pub(super) fn layers(reach: f32) -> i32 {
    far_from_surface(reach).ceil() as i32 + 1
}

/// Cells past the liquid whose velocity a substep needs, at most.
pub(super) fn most_layers() -> i32 {
    layers(FARTHEST)
}

/// Moves on by a substep. Gravity and viscosity are read in the middle. `kept`: what is kept of the last substep, unless something
/// has changed since; what is kept of this one takes its place.
pub(super) fn substep(
    settings: &LiquidSettings,
    surface: &mut dyn Surface,
    motion: &mut Motion,
    around: &Surroundings<'_>,
    span: Span,
    kept: &mut Option<Kept>,
) -> LiquidReport {
    let times = span.times;
    let (seconds, middle) = (times[1] - times[0], 0.5 * (times[0] + times[1]));
    // The liquid follows what the solid is on the way, in the middle, and is pushed by it from where both are at the end.
    let [on_way, solid] = [middle, times[1]].map(|time| around.solid.map(|solid| solid.at(time)));
    let step = (seconds / settings.cell) as f32;
    let gravity = (around.gravity)(middle).map(|g| g * seconds);
    let own = [(around.viscosity)(middle), settings.density];
    let start = Start { settings, surface, around, span, kept: kept.as_ref() };
    let mut before_end = start.begin(motion);
    let periods = settings.domain.periods();
    let turned = |gain| turned::carried(motion, gain, periods, seconds, [step, STEEPEST / step]);
    let carried = motion.gain.as_ref().map(turned);
    let mean = start.mean_velocity(motion, carried.as_ref(), gravity, &mut before_end);
    *kept = None;
    let Continued { velocity, carried, way, reach } =
        continued(&settings.domain, motion, (mean.as_ref(), carried), on_way, step);
    let flow = Moving { velocity: &velocity, step, periods, solid: on_way };
    let outflow = outflow(&settings.domain, surface.view(), &flow, on_way, settings.cell_volume());
    let left_domain = outflow.iter().map(|outflow| outflow.volume).sum();
    motion.outflow.extend(outflow);
    motion.carry(&flow, surface.view(), settings);
    let shapes: Vec<_> = around.shapes().collect();
    let solids = around.solid.map(|solid| times.map(|time| solid.at(time)));
    let is_thin = solids.is_some_and(|[before, _]| Pools::are_needed(&surface.view(), before));
    let is_counted = !is_passing(&flow);
    let others = Others { domain: &settings.domain, solids, is_counted, is_thin, shapes: &shapes, time: middle };
    let held = remainder::Held::of(velocity.rows(), surface, &others, reach);
    if let Some(swelling) = Swelling::of(&flow, &surface.view(), &settings.domain) {
        surface.swell(&swelling);
    }
    surface.advance(&flow, reach);
    if let Some(cells) = held.come_through(&surface.view()) {
        make_air(surface, &cells);
    }
    if let Some(solid) = solid {
        surface.meet(&|point| solid.distance(point));
    }
    // What moves farther ends anywhere, and another look would add to that.
    let looks = if reach < FARTHEST { LOOKS } else { 1 };
    Remainder::of(Some(&flow), &held, &others, reach).give_back(surface, looks);
    let passed =
        around.solid.map_or(0.0, |solid| passed_over(&surface.view(), motion, &settings.domain, &flow, (solid, times)));
    let mut exchanged = Exchange { settings, around, solid, span }.apply(surface, motion);

    let mut cells = LiquidCells::of(&settings.domain, surface, solid);
    let imposed = exchanged.impose(&mut cells);
    cells.fill_images();
    let carried = exchanged.entered(motion, &velocity, carried, reach);
    let bounds = settings.domain.bounds();
    let (method, scheme) = (Method::Ralston, settings.scheme);
    let advection = Advection { velocity: &velocity, bounds, periods, step, method, scheme };
    let mut faces = advection.carry(carried.as_ref().unwrap_or(velocity.faces()), &cells.rows, &cells.moving);
    exchanged.enter_far(velocity.rows(), &cells, &mut faces);
    let stored_cells = velocity.rows().len();
    drop((velocity, carried));
    Imposed::set(&imposed, &cells.rows, &mut faces, |velocity| velocity);
    cells.images.fill_each(&mut faces);
    let before = faces.clone();
    for axis in 0..3 {
        let moving = faces[axis].iter_mut().zip(&cells.moving).filter(|(_, mask)| **mask >> axis & 1 == 1);
        moving.for_each(|(u, _)| *u += gravity[axis] as f32);
    }

    let materials = motion.materials_of(&cells, surface.view(), &settings.domain, own.map(|own| own as f32));
    let materials = Materials::new(own, materials, settings, seconds);
    let speed = motion.largest_speed().max(exchanged.speed(settings.cell));
    let cut = solid.map_or_else(Vec::new, |solid| cut_cells(&settings.domain, &cells, solid));
    let mut projection =
        Projection { settings, cells: &cells, materials, solid, cut: &cut, imposed: &imposed, speed, gravity, seconds };
    if speed.max(projection.pull()) == 0.0 {
        // Of liquid at rest without weight only solids say how fast it will be.
        projection.speed = cells.largest_solid_speed();
    }
    let (mut report, equations) = projection.apply(&before, &mut exchanged.pours, &mut faces, motion);
    cells.images.fill_each(&mut faces);
    report.substeps = 1;
    report.cfl_reached = f64::from(way);
    report.count_solves(&before_end);
    report.stored_cells = stored_cells;
    report.liquid_cells = cells.liquid.len();
    report.left_domain = left_domain;
    report.passed_through = passed * settings.cell_volume();
    motion.gain = (settings.splitting == Splitting::KeepsSpin).then(|| {
        let gained =
            |axis: usize| faces[axis].iter().zip(&before[axis]).map(|(after, before)| after - before).collect();
        Gain { faces: [gained(0), gained(1), gained(2)], seconds }
    });
    motion.liquid_cells = cells.liquid.len();
    motion.flying = flying(&cells, &settings.domain);
    motion.known = cells.known.clone();
    motion.velocity = MacVelocity::new(cells.rows.clone(), faces);
    // Faces with an imposed velocity count as closed in the cells.
    *kept = imposed.is_empty().then(|| Kept::new(cells, equations));
    report
}

/// Makes cells air.
fn make_air(surface: &mut dyn Surface, cells: &CellRows) {
    let Some((low, high)) = cells.bounds() else { return };
    surface.change(low, high, &|place, phi| if cells.find(place.map(floor)).is_some() { phi.max(1.0) } else { phi });
}

/// A velocity continued past the liquid.
struct Continued {
    /// That with which the surface moves.
    velocity: MacVelocity,
    /// What is carried in its place, where that is another, on its rows.
    carried: Option<FaceFields<f32>>,
    /// Cells that the fastest liquid moves, and how far it is followed.
    way: f32,
    reach: f32,
}

/// How the liquid moves in a substep. `mean`, `carried`: its mean velocity, and what is carried, where that is not the velocity at
/// the start; `step`: cells moved at 1 m/s.
fn continued(
    domain: &Domain,
    motion: &Motion,
    (mean, carried): (Option<&FaceFields<f32>>, Option<FaceFields<f32>>),
    solid: Option<Obstacle<'_>>,
    step: f32,
) -> Continued {
    let (steepest, own) = (STEEPEST / step, motion.velocity.faces());
    let way = mean.map_or_else(|| motion.largest_speed(), largest_of) as f32 * step;
    let reach = way.min(FARTHEST);
    let rows = motion.rows_in_reach(domain, mean.unwrap_or(own), step, reach);
    let carried = carried.or_else(|| mean.map(|_| own.clone()));
    let nearest = Slopes::nearest(steepest);
    // What is carried becomes the liquid's where that comes to. With the nearest differences, which short substeps hardly limit,
    // thin sheets of splashes drove themselves to ten times their energy.
    let of_carried = Slopes { steepest, smooth: true };
    let layers = SLOPING_LAYERS + reach.ceil() as u32;
    let mean = mean.unwrap_or(own);
    let (velocity, carried) = match carried {
        Some(carried) => {
            let slopes = [nearest, of_carried];
            let [velocity, carried] = motion.continued([mean, &carried], &rows, (slopes, layers), domain, solid);
            (velocity, Some(carried))
        }
        None => {
            let [velocity] = motion.continued([mean], &rows, ([nearest], layers), domain, solid);
            (velocity, None)
        }
    };
    let velocity = motion.balanced(&velocity, &rows, domain, solid, steepest);
    Continued { velocity: MacVelocity::new(rows, velocity), carried, way, reach }
}
