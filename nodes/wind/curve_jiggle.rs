//! Curve_Jiggle: curves swing after what moves them.
//!
//! W5 runs "a simple curve jiggle simulation" after the wind to soften gusts that pass. Here every CV hangs on a damped
//! spring from where the incoming curve puts it: x'' = −2ζω(x' − d·target') − ω²(x − target), ω = 2π·`frequency` ÷
//! `ramp`(u).
//!
//! Departures:
//! * The answer to a target that moves straight from frame to frame is exact, not stepped: any stiffness and frame rate is
//!   stable, and slow or stiff curves cost the same.
//! * Lengths are restored on what comes out, root to tip, and never fed back: the springs do not know of them.
//! * Any frame cooks alone. It hangs on the frames before it only as far as `tolerance` says: a window, from the slowest
//!   root of the equation, after which less than that share of any swing is left.
//! * Where the `skin` is wired, each curve swings in the frame of the face under its root: every step, `inherit_motion` of
//!   that face's rigid motion carries the swing and its target along, and only the rest of the motion is lagged.
//! * While `blend` is 0 or `ramp` nowhere above 0 nothing swings: when they rise, curves start from rest.

use curves::jiggle::{
    Carry, Drag as SpringDrag, Frame as FaceFrame, Jiggle, MASK_RANGE, Roots, Spring, steps_to_forget,
    with_lengths_between,
};
use engine::prelude::*;
use numerics::ramp::Ramp;
use std::f64::consts::PI;
use std::sync::Arc;

choice! {
    /// What the damper resists.
    pub enum Drag {
        Target = "target": "motion against the incoming curve: curves keep up with steady motion",
        World = "world": "all motion, as still air does: curves trail behind what moves steadily",
    }
}

inputs! { INPUTS:
    CURVES: Input = Input::one("curves", Kind::Curves, "The curves to follow, root first; the same curves at every frame.")
        .read_at(|_| Times::NOW.and(Times::START));
    SKIN: Input<Opt> = Input::optional("skin", Kind::Mesh,
        "What the curves grow on; the same mesh at every frame. Wired, a running animal does not drag its fur behind it.")
        .read_at(|_| Times::NOW.and(Times::START));
}

params! { PARAMS:
    FREQUENCY: Param<Maskable> = Param::maskable("frequency", 3.0,
        "How many times a second a free tip swings: low is long and soft, high is short and stiff. Its mask counts from \
         ¼ to 4.").unit(Unit::Hertz).above(0.0).soft(0.5, 12.0);
    DAMPING: Param<Maskable> = Param::maskable("damping", 0.3,
        "How soon swings die away: 0.05 rings on for many swings, 1 comes to rest without one, more creeps. Its mask \
         counts from ¼ to 4.").above(0.0).soft(0.05, 2.0);
    RAMP: Param<Arc<Ramp>> = Param::ramp("ramp", &[[0.0, 0.0], [1.0, 1.0]],
        "How soft the curve is from root (0) to tip (1): divides the frequency. 0 and less follows the incoming curve \
         exactly; the root always does.");
    DRAG: Param<Drag> = Param::choice("drag", Drag::Target, "What the damping acts against.");
    INHERIT_MOTION: Param<f32> = Param::float("inherit_motion", 1.0,
        "Share of the skin's own motion that curves go along with at once: 1 swings only after what moves the curves on \
         the skin, such as wind; 0 also lags behind the skin itself, as without one.").within(0.0, 1.0);
    TOLERANCE: Param<f64> = Param::double("tolerance", 1e-3,
        "Share of a swing below which it is forgotten. It sets how many frames back the result looks: smaller is dearer, \
         and closer to having run from the scene's start.").above(0.0).soft(1e-6, 0.1);
    PREROLL: Param<i64> = Param::int("preroll", 0,
        "Frames before the scene's first that already set the curves swinging, if the inputs move there. 0 starts the \
         scene at rest.").unit(Unit::Frames).within(0.0, 1e6).soft(0.0, 48.0);
    BLEND: Param<Maskable> = Param::maskable("blend", 1.0,
        "How much of the swing shows: 0 gives the incoming curves, 1 all of it. Lengths are kept at any value. While it \
         is 0 nothing swings: as it rises, curves start from rest.").within(0.0, 1.0);
}

const OUT: Output = Output::like("curves", &CURVES, "The curves, swinging. Lengths and roots are those of `curves`.");

const WINDOW_FRAMES: Metric =
    Metric::new("window_frames", Unit::Frames, "How many frames back the result looks, unless the scene starts later.");
const MAX_OFFSET: Metric = Metric::new("max_offset", Unit::Metres, "The farthest a CV is from its incoming place.");

/// See the module.
pub static NODE: Node = Node::new(
    "Curve_Jiggle",
    1,
    "Curves swing after what moves them: softly past a gust, on after a stop. Each CV hangs on a damped spring from where \
     the incoming curve puts it, stiff at the root and soft at the tip. Any frame cooks alone.",
    Cook::window::<Swing>(past),
)
.inputs(INPUTS)
.params(PARAMS)
.outputs(&[&OUT])
.reads(&[&P])
.writes(&[&P])
.metrics(&[&WINDOW_FRAMES, &MAX_OFFSET])
.leaves_out(leaves_out)
.mends_between(keep_lengths);

/// The curves' state.
struct Swing {
    /// Curves and skin at the scene's first frame: where along its curve a CV lies, and on which face a root grew.
    rest: Geometry,
    rest_skin: Option<Geometry>,
    /// Curves and skin at the frame the state stands at.
    before: Geometry,
    skin: Option<Geometry>,
    /// None while nothing swings.
    springs: Option<Jiggle>,
    /// Once asked for; none where the skin has no face with an area.
    roots: Option<Option<Roots>>,
    /// Of the skin at the frame the state stands at, where they were asked for.
    frames: Option<Vec<FaceFrame>>,
}

impl Chain for Swing {
    fn start(cx: &FrameCx) -> Result<Self> {
        let swing = Self {
            rest: cx.at_start(CURVES).clone(),
            rest_skin: cx.at_start(SKIN).cloned(),
            before: cx.input(CURVES).clone(),
            skin: cx.input(SKIN).cloned(),
            springs: None,
            roots: None,
            frames: None,
        };
        swing.check(cx)?;
        Ok(swing)
    }

    fn step(&mut self, cx: &StepCx) -> Result<()> {
        self.check(cx)?;
        if stands_still(cx.params()).is_some() {
            self.springs = None;
            self.frames = None;
        } else {
            let curves = cx.part(CURVES);
            let carries = self.carries(cx);
            let springs = self.springs.get_or_insert_with(|| {
                let [rest, before] = [&self.rest, &self.before].map(positions);
                Jiggle::at_rest(curves.runs().starts(), rest, before)
            });
            let ramp = cx.get(RAMP);
            let spring = Spring {
                frequency: cx.mask(FREQUENCY, curves)?.map(f64::from),
                damping: cx.mask(DAMPING, curves)?.map(f64::from),
                softness: &ramp,
                drag: match cx.get(DRAG) {
                    Drag::Target => SpringDrag::Target,
                    Drag::World => SpringDrag::World,
                },
            };
            springs.step(curves.positions(), &spring, cx.dt(), carries.as_deref());
        }
        self.before = cx.input(CURVES).clone();
        self.skin = cx.input(SKIN).cloned();
        Ok(())
    }

    fn output(&self, cx: &FrameCx) -> Result<Outputs> {
        let mut out = cx.input(CURVES).clone();
        let blend = cx.mask(BLEND, cx.part(CURVES))?;
        let clock = Clock { fps: cx.fps(), seed: 0 };
        cx.publish(WINDOW_FRAMES, f64::from(past(cx.params(), clock).frames));
        let mut farthest = 0.0;
        if let Some(springs) = &self.springs {
            let shaped = springs.shape(blend);
            farthest = shaped.max_offset;
            let curves = out.part_mut(Kind::Curves).expect("the engine refuses a wire without curves");
            curves.set(P, shaped.points)?;
        }
        cx.publish(MAX_OFFSET, farthest);
        Ok(OUT.with(out))
    }
}

impl Swing {
    /// Refuses curves, and a skin, that are not those of the scene's first frame.
    fn check(&self, cx: &FrameCx) -> Result<()> {
        check_same("curves", cx.part(CURVES), self.rest.curves())?;
        match cx.input(SKIN).and_then(Geometry::mesh) {
            Some(skin) => check_same("skin", skin, self.rest_skin.as_ref().and_then(Geometry::mesh)),
            None => Ok(()),
        }
    }

    /// What carries each curve over the step to this frame, where the skin does.
    fn carries(&mut self, cx: &StepCx) -> Option<Vec<Carry>> {
        let share = f64::from(cx.get(INHERIT_MOTION));
        let before = self.frames.take();
        let skin = cx.input(SKIN)?.mesh()?;
        if share == 0.0 {
            return None;
        }
        let rest_skin = self.rest_skin.as_ref()?.mesh()?;
        let bind = || {
            let curves = self.rest.curves()?;
            let all = curves.positions();
            // A curve without a CV has no root; any place will do.
            let root = |cvs: std::ops::Range<usize>| all.get(cvs.start).copied().unwrap_or_default();
            let roots: Vec<[f32; 3]> = curves.runs().ranges().map(root).collect();
            let faces = rest_skin.faces()?;
            Roots::bind(faces.runs.starts(), &faces.corners, rest_skin.positions(), &roots)
        };
        let roots = self.roots.get_or_insert_with(bind).as_ref()?;
        let from = match before {
            Some(frames) => frames,
            None => roots.frames(self.skin.as_ref()?.mesh()?.positions()),
        };
        let to = roots.frames(skin.positions());
        let carries = Carry::all_between(&from, &to, share);
        self.frames = Some(to);
        Some(carries)
    }
}

fn positions(curves: &Geometry) -> &[[f32; 3]] {
    curves.curves().expect("the engine refuses a wire without curves").positions()
}

fn check_same(input: &str, now: &Component, first: Option<&Component>) -> Result<()> {
    let same = |first: &Component| {
        (now.topology().same(first.topology()) || now.topology() == first.topology())
            && now.point_count() == first.point_count()
    };
    let Some(first) = first.filter(|first| !same(first)) else { return Ok(()) };
    let count = |part: &Component| {
        let elements = if part.kind() == Kind::Curves { "curves" } else { "faces" };
        format!("{} {elements} of {} points", part.element_count(), part.point_count())
    };
    let differ = match (count(now), count(first)) {
        (now, first) if now == first => format!("{now}, joined otherwise"),
        (now, first) => format!("{now}, then {first}"),
    };
    Err(Error::refused(format!("`{input}` is not what it was at the scene's first frame: {differ}"))
        .hint("a swing goes on from frame to frame; make points come and go after it"))
}

/// Why nothing swings.
fn stands_still(params: &Params) -> Option<&'static str> {
    if params.get(BLEND).value == 0.0 {
        return Some("`blend` is 0");
    }
    (params.get(RAMP).max() <= 0.0).then_some("`ramp` is nowhere above 0")
}

/// Frames until all but `tolerance` of a swing is forgotten, where curves are softest. Masks may scale frequency and
/// damping within their range.
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

fn leaves_out(params: &Params, wires: &Wires) -> Vec<LeftOut> {
    if let Some(why) = stands_still(params) {
        return vec![LeftOut::new("all", why)];
    }
    if wires.count(&SKIN) == 0 {
        return vec![LeftOut::new("skin", "no `skin` is wired")];
    }
    match params.get(INHERIT_MOTION) {
        0.0 => vec![LeftOut::new("skin", "`inherit_motion` is 0")],
        _ => Vec::new(),
    }
}

/// Between frames, segments are as long as between the lengths they have there.
fn keep_lengths(near: [&Geometry; 2], share: f32, between: &mut Geometry) {
    let [Some(from), Some(to)] = near.map(Geometry::curves) else { return };
    let Some(curves) = between.part_mut(Kind::Curves) else { return };
    if from.runs() != to.runs() {
        return;
    }
    if let Some(points) = curves.edit(P) {
        with_lengths_between(from.runs().starts(), [from.positions(), to.positions()], share, points);
    }
}

#[cfg(test)]
mod tests;
