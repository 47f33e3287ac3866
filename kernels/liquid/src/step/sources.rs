//! Where liquid comes in and where it is taken away.

use numerics::vector::Vec3;
use serde::{Deserialize, Serialize};

use crate::carried::LiquidMaterial;
use crate::rows::Cell;

/// The shape of a source or a sink; it may move.
#[derive(Clone, Copy)]
pub struct SourceShape<'a> {
    /// The distance from it, in cells, at a time since the start of the frame, s, and a place in cells; negative inside.
    pub distance: &'a (dyn Fn(f64, Vec3) -> f32 + Sync),
    /// The cells `low` ≤ cell < `high` that it does not leave in the frame.
    pub bounds: [Cell; 2],
}

/// Changes the attributes of a point on the surface, at a place in cells.
pub type AttributeEdit<'a> = &'a (dyn Fn(Vec3, &mut [f32]) + Sync);

/// Where liquid comes in. Times are since the start of the frame, s.
#[derive(Clone, Copy)]
pub struct LiquidSource<'a> {
    /// Where.
    pub shape: SourceShape<'a>,
    /// The volume that it gives between two times, m³. None: it keeps its shape full.
    pub rate: Option<&'a (dyn Fn(f64, f64) -> f64 + Sync)>,
    /// The velocity of the liquid inside the shape, m/s, whatever is around it: a nozzle. None: liquid comes in at rest and
    /// moves freely.
    pub velocity: Option<&'a (dyn Fn(f64) -> Vec3 + Sync)>,
    /// What its liquid is made of. It counts where the liquid knows of materials ([`Liquid::set_materials`]).
    ///
    /// [`Liquid::set_materials`]: crate::step::Liquid::set_materials
    pub material: &'a (dyn Fn(f64) -> LiquidMaterial + Sync),
    /// Gives a point on the surface the attributes of its liquid.
    pub attributes: Option<AttributeEdit<'a>>,
    /// Whether it keeps its shape full and imposes its velocity. What `rate` gives comes all the same.
    pub active: &'a (dyn Fn(f64) -> bool + Sync),
}

/// Where liquid is taken away. Times are since the start of the frame, s.
#[derive(Clone, Copy)]
pub struct LiquidSink<'a> {
    /// Where.
    pub shape: SourceShape<'a>,
    /// The volume that it takes between two times as long as there is liquid in its shape, m³. None: it takes all that
    /// enters.
    pub rate: Option<&'a (dyn Fn(f64, f64) -> f64 + Sync)>,
    /// Whether it takes all that enters. What `rate` takes goes all the same.
    pub active: &'a (dyn Fn(f64) -> bool + Sync),
}

impl<'a> LiquidSource<'a> {
    /// A source that gives this volume between two times, m³, or keeps its shape full.
    pub fn new(shape: SourceShape<'a>, rate: Option<&'a (dyn Fn(f64, f64) -> f64 + Sync)>) -> Self {
        Self {
            shape,
            rate,
            velocity: None,
            material: &|_| LiquidMaterial::default(),
            attributes: None,
            active: &|_| true,
        }
    }
}

impl<'a> LiquidSink<'a> {
    /// A sink that takes this volume between two times, m³, or all that enters.
    pub fn new(shape: SourceShape<'a>, rate: Option<&'a (dyn Fn(f64, f64) -> f64 + Sync)>) -> Self {
        Self { shape, rate, active: &|_| true }
    }
}

/// What a source has given, or a sink has taken.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FlowAccount {
    /// In the last frame, m³.
    pub moved: f64,
    /// What its rate asked for in the last frame, m³.
    pub(super) asked: f64,
    /// What its rate asked for in the last frame and could not pass, m³: there was no liquid to give way or to take, or no
    /// room. It is not made good later.
    pub withheld: f64,
    /// A place in its liquid, in cells: the deepest of its shape.
    pub place: Vec3,
    /// What its rate asked for and has not passed yet, m³; below 0, what has passed too early.
    pub(super) owed: f64,
    /// What of it is in `moved` already, since it is about to pour.
    pub(super) advanced: f64,
    /// What its rate was to be in the next substep, m³/s.
    pub(super) expected: f64,
    /// What passes as divergence of its liquid, m³/s.
    pub(super) pouring: f64,
    /// What cuts of the surface have added instead of taking it, and those to come have to take first, m³.
    pub(super) gained: f64,
}

/// Share of what is owed that pours in a substep besides the rate, and of the rate by which more or less pours then, at most:
/// what a short substep gives must not be made good within it, since faster liquid makes substeps shorter still.
const CORRECTION: f64 = 0.5;

/// Share of a rate by which it may differ from what was expected, before what pours is chosen anew.
const SURPRISE: f64 = 0.1;

impl FlowAccount {
    /// Whether a source gave nothing in the last frame because its rate is less than the grid can show: it is collected.
    pub fn is_collecting(&self) -> bool {
        self.asked > 0.0 && self.moved == 0.0 && self.pouring == 0.0 && self.owed > 0.0
    }

    pub(super) fn start_frame(accounts: &mut Vec<Self>, count: usize) {
        accounts.resize(count, Self::default());
        accounts.iter_mut().for_each(|account| (account.moved, account.asked, account.withheld) = (0.0, 0.0, 0.0));
    }

    /// Counts what a cut of the surface took. One that only makes the surface anew may add a little; what is counted never
    /// goes back.
    pub(super) fn cut(&mut self, volume: f64) {
        let taken = volume - self.gained;
        self.gained = (-taken).max(0.0);
        self.moved += taken.max(0.0);
    }

    /// Counts what poured in a substep; returns the rate that it poured at, m³/s.
    pub(super) fn settle(&mut self, seconds: f64) -> f64 {
        let poured = self.pouring * seconds;
        self.owed -= poured;
        self.moved += poured;
        std::mem::take(&mut self.pouring)
    }

    /// The rate to pour at in the next substep, m³/s: what the rate will ask for, less what filling the shape will give, and
    /// part of what is owed.
    pub(super) fn rate_to_pour(&self, flow: &Flow, filled: f64, before: f64) -> f64 {
        if flow.gave <= 0.0 && flow.next <= 0.0 {
            return (self.owed / flow.next_seconds).clamp(0.0, before.max(0.0));
        }
        // A very short substep says nothing of how fast a shape goes on to be filled.
        let filling = filled / flow.seconds.max(flow.next_seconds);
        let wanted = flow.next - filling + CORRECTION * self.owed / flow.next_seconds;
        wanted.clamp(0.0, (1.0 + CORRECTION) * flow.next.max(flow.gave / flow.seconds))
    }

    /// Whether its rate from now on, m³/s, is another than was expected when what pours was chosen.
    pub(super) fn is_surprised(&self, rate: f64) -> bool {
        (rate - self.expected).abs() > SURPRISE * rate.max(self.expected)
    }

    /// Counts what is about to pour, and not what poured too early, so that what is counted at the end of a frame is what was
    /// asked for until then.
    pub(super) fn end_frame(&mut self) {
        let advanced = if self.pouring > 0.0 { self.owed } else { self.advanced.min(self.owed) };
        self.moved += advanced - self.advanced;
        self.advanced = advanced;
    }

    /// Gives up what is owed beyond `most`, m³.
    pub(super) fn withhold_beyond(&mut self, most: f64) {
        if self.owed > most {
            self.withheld += self.owed - most;
            self.owed = most;
        }
    }
}

/// A substep to what has a rate. Times are since the start of the frame, s.
#[derive(Clone, Copy, Debug)]
pub(super) struct Span {
    /// When it begins and ends.
    pub(super) times: [f64; 2],
    /// How long the next one is, as far as it is known.
    pub(super) next_seconds: f64,
    /// Whether that is in the next frame.
    pub(super) ends_frame: bool,
}

/// What a rate asks for in a substep and the next.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Flow {
    /// In the substep, m³.
    pub(super) gave: f64,
    /// In the next, m³/s.
    pub(super) next: f64,
    /// The lengths of both, s.
    pub(super) seconds: f64,
    pub(super) next_seconds: f64,
}

impl Flow {
    /// What a rate asks for between two times.
    pub(super) fn of(rate: &(dyn Fn(f64, f64) -> f64 + Sync), span: &Span) -> Self {
        let [from, to] = span.times;
        let (seconds, next_seconds) = (to - from, span.next_seconds);
        let next = match span.ends_frame {
            false => volume_between(rate, to, to + next_seconds) / next_seconds,
            true => {
                // On the line through the means of both halves of this one.
                let middle = 0.5 * (from + to);
                let [first, second] = [[from, middle], [middle, to]].map(|[from, to]| volume_between(rate, from, to));
                let [first, second] = [first, second].map(|volume| 2.0 * volume / seconds);
                (second + 1.5 * (second - first)).clamp(0.0, 2.0 * second)
            }
        };
        Self { gave: volume_between(rate, from, to), next, seconds, next_seconds }
    }
}

/// What a rate asks for between two times, m³; nothing where it is negative or not a number.
fn volume_between(rate: &(dyn Fn(f64, f64) -> f64 + Sync), from: f64, to: f64) -> f64 {
    let volume = rate(from, to);
    if volume.is_finite() { volume.max(0.0) } else { 0.0 }
}
