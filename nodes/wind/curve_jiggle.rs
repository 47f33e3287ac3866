//! Curve_Jiggle: curves lag behind their incoming motion and swing.
//!
//! W5 runs "a simple curve jiggle simulation" after the wind to soften passing gusts. Here every CV is tied by a damped
//! spring to its position on the incoming curve: x'' = −2ζω(x' − d·target') − ω²(x − target), ω = 2π·`frequency` ÷
//! `ramp`(u), d = 1 for `drag` "target" and 0 for "world".
//!
//! Departures:
//! * The response to a target that moves linearly from frame to frame is exact, not time-stepped: it is stable for any
//!   stiffness and frame rate, and slow or stiff curves cost the same.
//! * Lengths are restored on the output, root to tip, and never fed back into the springs.
//! * Any frame can be cooked alone. It depends on previous frames only within a window, whose length follows from
//!   `tolerance` and the slowest root of the equation: beyond it, less than that fraction of any swing remains.
//! * If `skin` is wired, each curve swings in the frame in which Curve_Attach would move it: in every step the fraction
//!   `inherit_motion` of that frame's rigid motion is applied to the swing and its target, and only the rest is lagged.
//!   Where the skin collapses to a line or a point it carries curves without rotating them.
//! * Curves of a clump are drawn from their own swing to the mean swing of the clump, on the output: as springs are linear,
//!   that is the swing of a curve on the mean of their targets.
//! * While `blend` is 0, or `ramp` is nowhere above 0, nothing swings: when they rise, curves start from rest.

use crate::shared::clump;
use crate::shared::group::{self, Group};
use curves::attach::{RootPositions, SkinBinding};
use curves::jiggle::{Drag, Jiggle, MASK_RANGE, RigidStep, Spring, steps_to_forget, with_lengths_of};
use engine::prelude::*;
use numerics::masked::Masked;
use numerics::ramp::Ramp;
use std::f64::consts::PI;
use std::sync::Arc;

choice! {
    /// What the damper resists.
    DragChoice for Drag {
        Drag::Target => "target": "motion relative to the incoming curve: curves keep up with steady motion",
        Drag::World => "world": "all motion, as still air does: curves trail behind while they move",
    }
}

inputs! { INPUTS:
    CURVES: Input = Input::one("curves", Kind::Curves, "The curves to follow, root first. They may move, but must \
        keep their CVs.")
        .read_at(|_| Times::NOW.and(Times::START));
    SKIN: Input<Opt> = Input::optional("skin", Kind::Mesh,
        "The mesh that the curves grow on. It may move, but must keep its faces. If it is wired, a running animal does \
         not drag its fur behind it.")
        .read_at(|_| Times::NOW.and(Times::START));
}

params! { PARAMS:
    FREQUENCY: Param<Maskable> = Param::maskable("frequency", 3.0,
        "Swings per second of an undamped tip: low values suit long soft curves, high values short stiff ones. The \
         mask is clamped to ¼…4.").unit(Unit::Hertz).above(0.0).soft(0.5, 12.0);
    DAMPING: Param<Maskable> = Param::maskable("damping", 0.3,
        "Damping ratio: at 0.05 curves swing for a long time, at 1 they come to rest without overshoot, above 1 they \
         do so more slowly. The mask is clamped to ¼…4.").above(0.0).soft(0.05, 2.0);
    RAMP: Param<Arc<Ramp>> = Param::ramp("ramp", &[[0.0, 0.0], [1.0, 1.0]],
        "Softness from root (0) to tip (1): divides `frequency`, so at ½ a CV swings twice as fast as at 1. Where it \
         is 0 or less, CVs follow the incoming curve exactly; the root always does.");
    DRAG: Param<DragChoice> = Param::choice("drag", Drag::Target, "The motion that damping resists.");
    INHERIT_MOTION: Param<Maskable> = Param::maskable("inherit_motion", 1.0,
        "How much of the skin's own motion curves follow without lag: at 1 only motion relative to the skin, such as \
         wind, makes them swing; at 0 they also lag behind the skin itself, as if no skin were wired. The mask is read at \
         the root.")
        .within(0.0, 1.0);
    TOLERANCE: Param<f64> = Param::double("tolerance", 1e-3,
        "Fraction of a swing that may be neglected. It sets how many previous frames the result depends on: smaller \
         values cost more and come closer to a simulation from the scene's start.")
        .above(0.0).soft(1e-6, 0.1);
    PREROLL: Param<i64> = Param::int("preroll", 0,
        "Frames to simulate before the scene's first frame, if the inputs move there. With 0 the scene starts at \
         rest. Sequences of files need files for these frames, or a `frame` that holds the first: see Mesh_In.").unit(Unit::Frames).within(0.0, 1e6).soft(0.0, 48.0);
    BLEND: Param<Maskable> = Param::maskable("blend", 1.0,
        "How much of the swing is applied: 0 gives the incoming curves, 1 the whole swing. Lengths are kept at any \
         value. While it is 0 nothing swings; when it rises from 0, curves start from rest.").within(0.0, 1.0);
    GROUP: Param<Name> = group::param();
    CLUMP: Param<Name> = clump::NAME;
    CLUMP_RADIUS: Param<f32> = clump::RADIUS;
    CLUMP_BLEND: Param<Maskable> = clump::BLEND;
}

const OUT: Output = Output::like("curves", &CURVES, "The swinging curves. Lengths and roots are those of `curves`.");

metrics! { METRICS:
    WINDOW_FRAMES = Metric::new("window_frames", Unit::Frames,
        "Number of previous frames that the result depends on, unless the scene starts later.");
    MAX_OFFSET = Metric::new("max_offset", Unit::Metres, "The largest distance of a CV from its incoming position.");
    EMPTY_GROUP = group::EMPTY;
}

pub(crate) static NODE: Node = Node::new(
    "Curve_Jiggle",
    3,
    "Makes curves lag behind their incoming motion and swing: they follow a gust softly and overshoot when it stops. A \
     damped spring ties each CV to its position on the incoming curve, stiff at the root and soft at the tip. Any \
     frame can be cooked alone.",
    Cook::resumable_window::<Swing>(past),
)
.inputs(INPUTS)
.params(PARAMS)
.accuracy(&[Accuracy::smaller("tolerance", Trials::These(&["1e-1", "1e-2", "1e-3", "1e-4", "1e-5"])).order(1.0)])
.outputs(&[&OUT])
.reads(&[&P])
.writes(&[&P])
.attributes(|params| group::attributes(params, &[GROUP, CLUMP]))
.metrics(METRICS)
.neutral(|params, _| stands_still(params))
.leaves_out(|params, wires| match params {
    _ if wires.count(&SKIN) == 0 => vec![LeftOut::new("skin", "no `skin` is wired")],
    _ if params.get(INHERIT_MOTION).value == 0.0 => vec![LeftOut::new("skin", "`inherit_motion` is 0")],
    _ => Vec::new(),
})
.follows(&CURVES, keep_lengths);

/// The state: springs, and the geometry that the next step needs.
struct Swing {
    /// Curves and skin at the scene's first frame: they give the arc length of each CV and the binding of each
    /// root.
    rest: Component,
    rest_skin: Option<Component>,
    /// Curves and skin at the state's frame.
    before: Component,
    skin: Option<Component>,
    /// `None` while nothing swings.
    springs: Option<Jiggle>,
}

/// A binding as a key: it equals itself alone.
#[derive(Clone)]
struct SameBinding(Arc<Option<SkinBinding>>);

impl PartialEq for SameBinding {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

impl Chain for Swing {
    fn start(cx: &FrameCx) -> Result<Self> {
        let swing = Self {
            rest: cx.part_at_start(CURVES).clone(),
            rest_skin: cx.part_at_start(SKIN).cloned(),
            before: cx.part(CURVES).clone(),
            skin: cx.part(SKIN).cloned(),
            springs: None,
        };
        swing.check(cx)?;
        Ok(swing)
    }

    fn step(&mut self, cx: &StepCx) -> Result<()> {
        self.check(cx)?;
        let curves = cx.part(CURVES);
        let carries = self.inherited(cx)?;
        let springs = self.springs.get_or_insert_with(|| {
            Jiggle::at_rest(curves.runs().starts(), self.rest.positions(), self.before.positions())
        });
        let ramp = cx.get(RAMP);
        let spring = Spring {
            frequency: cx.mask(FREQUENCY, curves)?.map(f64::from),
            damping: cx.mask(DAMPING, curves)?.map(f64::from),
            softness: &ramp,
            drag: cx.get(DRAG),
        };
        springs.step(curves.positions(), &spring, cx.dt(), carries.as_deref());
        self.advance(cx);
        Ok(())
    }

    fn step_neutral(&mut self, cx: &StepCx) -> Result<()> {
        self.check(cx)?;
        self.springs = None;
        self.advance(cx);
        Ok(())
    }

    fn output(&self, cx: &FrameCx) -> Result<Outputs> {
        let mut curves = cx.edit(CURVES);
        let blend = cx.mask(BLEND, cx.part(CURVES))?;
        let group = Group::of(&cx.get(GROUP), cx.part(CURVES))?;
        cx.publish(EMPTY_GROUP, group::is_empty(group.as_ref()));
        let factors = group.map(|group| group.factors(blend));
        let clock = Clock { fps: cx.fps(), seed: 0 };
        cx.publish(WINDOW_FRAMES, f64::from(past(cx.params(), clock).frames));
        let mut farthest = 0.0;
        if let Some(springs) = &self.springs {
            let blend = group::masked(blend, factors.as_deref());
            let shaped = match clump::of(cx.params(), cx.part(CURVES), Some(&self.rest))? {
                Some(clumps) => springs.shape_clumped(blend, &clumps, cx.mask(CLUMP_BLEND, cx.part(CURVES))?),
                None => springs.shape(blend),
            };
            farthest = shaped.max_offset;
            curves.set(P, shaped.points)?;
        }
        cx.publish(MAX_OFFSET, farthest);
        Ok(OUT.with(curves))
    }
}

impl Resumable for Swing {
    /// Offsets and velocities; `None` while nothing swings.
    type Saved = Option<Vec<f64>>;

    fn save(&self) -> Self::Saved {
        self.springs.as_ref().map(Jiggle::swing)
    }

    fn resume(saved: Self::Saved, cx: &FrameCx) -> Result<Self> {
        let mut swing = Self::start(cx)?;
        if let Some(saved) = saved {
            let (rest, now) = (swing.rest.positions(), swing.before.positions());
            let springs = Jiggle::swinging(swing.before.runs().starts(), rest, now, &saved);
            swing.springs = Some(springs.ok_or_else(|| Error::refused("the saved swing is that of other curves"))?);
        }
        Ok(swing)
    }
}

impl Swing {
    /// Refuses curves, and a skin, that are not those of the scene's first frame.
    fn check(&self, cx: &FrameCx) -> Result<()> {
        check_same("curves", cx.part(CURVES), &self.rest)?;
        match cx.part(SKIN).zip(self.rest_skin.as_ref()) {
            Some((skin, rest)) => check_same("skin", skin, rest),
            None => Ok(()),
        }
    }

    /// Makes the current frame that of the state.
    fn advance(&mut self, cx: &StepCx) {
        self.before = cx.part(CURVES).clone();
        self.skin = cx.part(SKIN).cloned();
    }

    /// The motion that each curve inherits from its skin over the step to this frame; `None` where it inherits none.
    fn inherited(&self, cx: &StepCx) -> Result<Option<Vec<RigidStep>>> {
        let share = cx.mask(INHERIT_MOTION, cx.part(CURVES))?;
        let (Some(rest), Some(skin), Some(now)) = (&self.rest_skin, &self.skin, cx.part(SKIN)) else { return Ok(None) };
        if share.value == 0.0 {
            return Ok(None);
        }
        let roots = RootPositions::of(self.rest.runs().starts(), self.rest.positions());
        let bind = || Ok(SkinBinding::to_closest(rest.positions(), &rest.triangles().corners, roots.as_slice()));
        let key = SameBinding(rest.kept(roots.clone(), bind)?);
        // A skin without faces moves nothing.
        let Some(binding) = &*key.0 else { return Ok(None) };
        // Cached with the skin: the next step reads them again, a second state at the same frame too, and a skin that
        // stands still keeps them.
        let poses = |skin: &Component| skin.kept(key.clone(), || Ok(binding.poses(skin.positions())));
        let (before, now) = (poses(skin)?, poses(now)?);
        if share.mask.is_none() {
            return Ok(Some(RigidStep::all_between(binding, &before, &now, f64::from(share.value))));
        }
        // A curve without CVs has no root.
        let at_root = |cvs: std::ops::Range<usize>| if cvs.is_empty() { 0.0 } else { share_at(share, cvs.start) };
        let shares: Vec<f64> = cx.part(CURVES).runs().ranges().map(at_root).collect();
        Ok(Some(RigidStep::each_between(binding, &before, &now, &shares)))
    }
}

/// The number at a root, 0..1; NaN counts as 0.
fn share_at(share: Masked<'_, f32>, root: usize) -> f64 {
    let share = share.at(root);
    f64::from(if share > 0.0 { share.min(1.0) } else { 0.0 })
}

/// Refuses a component whose topology is not that of the scene's first frame.
fn check_same(input: &str, now: &Component, first: &Component) -> Result<()> {
    let topology = now.topology().same(first.topology()) || now.topology() == first.topology();
    if topology && now.point_count() == first.point_count() {
        return Ok(());
    }
    let count = |part: &Component| {
        let elements = if part.kind() == Kind::Curves { "curves" } else { "faces" };
        format!("{} {elements} of {} points", part.element_count(), part.point_count())
    };
    if now.point_count() == first.point_count()
        && now.faces().zip(first.faces()).is_some_and(|(a, b)| a.is_inside_out(b))
    {
        let fact = format!("`{input}` is mirrored, which turns its faces inside out since the scene's first frame");
        return Err(Error::refused(fact)
            .hint("keep the sign of its animated `scale`, or mirror the output of this node instead"));
    }
    let differ = match (count(now), count(first)) {
        (now, first) if now == first => format!("it has {now} with another topology"),
        (now, first) => format!("it had {first} then, and has {now} now"),
    };
    Err(Error::refused(format!("`{input}` has changed since the scene's first frame: {differ}"))
        .hint("curves keep swinging from frame to frame: add or remove points after this node"))
}

/// Why nothing swings; `None` if something does.
fn stands_still(params: &Params) -> Option<&'static str> {
    if params.get(BLEND).value == 0.0 {
        return Some("`blend` is 0");
    }
    (params.get(RAMP).max() <= 0.0).then_some("`ramp` is nowhere above 0")
}

/// Frames until less than `tolerance` of a swing remains where curves are softest. Masks may scale frequency and
/// damping within [`MASK_RANGE`].
fn past(params: &Params, clock: Clock) -> Past {
    let preroll = params.get(PREROLL) as u32;
    if stands_still(params).is_some() {
        return Past { frames: 0, preroll };
    }
    let range = |masked: &Maskable| match masked.attribute {
        Some(_) => MASK_RANGE.map(|share| f64::from(share) * f64::from(masked.value)),
        None => [f64::from(masked.value); 2],
    };
    let slowest = range(&params.get(FREQUENCY))[0] / f64::from(params.get(RAMP).max());
    let phase = 2.0 * PI * slowest / clock.fps;
    Past { frames: steps_to_forget(phase, range(&params.get(DAMPING)), params.get(TOLERANCE)), preroll }
}

/// Between two frames, too, segments have the lengths of those of `curves`.
fn keep_lengths(input: &Geometry, between: &mut Geometry) {
    let (Some(curves), Some(swinging)) = (input.curves(), between.part_mut(Kind::Curves)) else { return };
    if let Some(points) = swinging.edit(P) {
        with_lengths_of(curves.positions(), curves.runs().starts(), points);
    }
}

#[cfg(test)]
mod tests;
