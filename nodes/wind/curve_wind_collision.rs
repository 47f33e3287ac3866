//! Curve_Wind_Collision: curves bend around what the wind blows them into.
//!
//! W3. Root to tip, each segment turns from its rest direction, as far as the segments before it have already turned
//! that, towards the direction wind gave it, until it meets a collider. A segment that was pushed into one by the turn
//! of another is turned out first. `offset_root` brings roots off the skin, `offset_scale` keeps what wind presses flat
//! at a share of its rest distance.
//!
//! Departures:
//! * `exact` stops at the first contact itself instead of the last of `rotation_steps` steps that misses: nothing passes
//!   through a thin collider, and the cost does not grow with accuracy.
//! * A stop keeps `gap` of arc, so that positions rounded to a file's f32 do not cross.
//! * Neither W's collision nor the first contact is continuous in the wind. `coherence` leads directions out of the skin
//!   beforehand by a map that is: on the bear, in wind that moves 0.50 % of all curves by more than a quarter of their length in a
//!   frame, collision makes that 1.07 %, and 0.70 % at `coherence` 1 (tests/wind/coherence.rs).
//! * `offset_scale` raises goals that lie lower and leaves those that lie higher: wind that lifts fur off is kept.

use std::sync::Arc;

use curves::collide::{Collide, ContactMethod, at_rest, collide};
use engine::prelude::*;
use numerics::tree::TriangleTree;

use crate::shared::surface::{Surface, tree};

choice! {
    /// How a segment's turn is stopped.
    pub enum Method {
        Exact = "exact": "at the first contact, computed in closed form: nothing is missed",
        Steps = "steps": "the paper's: turned in `rotation_steps` steps, of which the last that crosses nothing is kept",
    }
}

inputs! { INPUTS:
    CURVES: Input = Input::one("curves", Kind::Curves, "The curves where wind wants them.");
    REST: Input = Input::one("rest", Kind::Curves,
        "The same curves before the wind, at the same frame: where they grow on a skin that moves.");
    COLLIDERS: Input<Many> = Input::many("colliders", Kind::Mesh,
        "Meshes that are in the way, the skin itself among them. They may move and deform.");
    SKIN: Input<Opt> = Input::optional("skin", Kind::Mesh,
        "The mesh that the curves grow on, for `offset_root` and `offset_scale`. Without it the first collider is taken.");
}

params! { PARAMS:
    METHOD: Param<Method> = Param::choice("method", Method::Exact, "How a segment's turn is stopped.");
    ROTATION_STEPS: Param<i64> = Param::int("rotation_steps", 10, "Steps of a turn. More come nearer to the contact.")
        .within(1.0, 1e6).soft(2.0, 64.0).when(|params| params.get(METHOD) == Method::Steps);
    OFFSET_ROOT: Param<f64> = Param::double("offset_root", 1e-4,
        "How far outside of the skin a root is brought, its curve with it. Below `gap` the beginning of a curve is not \
         tested, as it lies in the skin.")
        .unit(Unit::Metres).at_least(0.0).soft(0.0, 0.01);
    OFFSET_SCALE: Param<f64> = Param::double("offset_scale", -1.0,
        "Keeps curves this many times as far off the skin as they are at rest: 1 keeps the coat's volume, less presses \
         it down. Below 0 it is off.")
        .soft(-1.0, 1.0);
    GAP: Param<f64> = Param::double("gap", 1e-4, "The way that a turn stops short of what it meets.")
        .unit(Unit::Metres).at_least(0.0).soft(0.0, 0.01);
    WIDTH: Param<Maskable> = Param::maskable("width", 0.0, "How thick curves are when they collide.")
        .unit(Unit::Metres).at_least(0.0).soft(0.0, 0.01);
    COHERENCE: Param<f64> = Param::double("coherence", 0.0,
        "How far what wind blows into the skin is led out of it before it collides, so that it does not jump from one \
         side to another as the wind turns: 0 is the paper's collision, 1 has hardly more jumps than the wind itself. \
         What lies flat in the wind at 0 stands up a little the more the wind blows straight into the skin.")
        .within(0.0, 1.0);
    BLEND: Param<Maskable> = Param::maskable("blend", 1.0,
        "Share of each segment's collision that is kept: 0 leaves the curves to the wind, 1 lets nothing through. \
         Lengths are kept at any value.").within(0.0, 1.0);
}

const OUT: Output = Output::like("curves", &CURVES, "The curves, around what is in their way. Lengths are kept.");

const CROSSINGS_LEFT: Metric = Metric::new(
    "crossings_left",
    Unit::None,
    "Segments that cross a collider as they are written; 0 while `blend` is 0.",
);
const UNFREED: Metric =
    Metric::new("unfreed_segments", Unit::None, "Segments that no turn frees from the collider they are in.");
const STARTED_INSIDE: Metric = Metric::new("started_inside", Unit::None, "Curves that cross a collider at rest.");
const CONTACTS: Metric =
    Metric::new("contacts", Unit::None, "Segments that a collider keeps from where wind wants them.");
const DEEPEST: Metric =
    Metric::new("deepest_overlap", Unit::Metres, "How far the deepest unfreed segment reaches through a surface.");
const LENGTH_ERROR: Metric =
    Metric::new("length_error", Unit::None, "The largest change of a length, as a share of the curve's length.");

/// See the module.
pub static NODE: Node = Node::new(
    "Curve_Wind_Collision",
    2,
    "Curves bend around what wind blows them into. Each segment, root to tip, turns from where it grows towards where \
     wind wants it, until it touches a collider. Put it after the wind, and give it the curves from before the wind as \
     `rest`. What could not be freed is counted, not hidden.",
    Cook::Pure(cook),
)
.inputs(INPUTS)
.params(PARAMS)
.outputs(&[&OUT])
.reads(&[&P])
.writes(&[&P])
.metrics(&[&CROSSINGS_LEFT, &UNFREED, &STARTED_INSIDE, &CONTACTS, &DEEPEST, &LENGTH_ERROR])
.leaves_out(leaves_out);

fn cook(cx: &Cx) -> Result<Outputs> {
    let mut out = cx.input(CURVES).clone();
    let (curves, rest) = (cx.part(CURVES), cx.part(REST));
    if curves.runs() != rest.runs() {
        return Err(Error::refused(format!(
            "`curves` ({}) and `rest` ({}) are not the same curves",
            count(curves),
            count(rest)
        ))
        .hint("give `rest` the curves as they were before the wind nodes"));
    }
    let (width, blend) = (cx.mask(WIDTH, curves)?, cx.mask(BLEND, curves)?);
    let colliders: Vec<&Component> = cx.input(COLLIDERS).iter().filter_map(|wire| wire.mesh()).collect();
    let Some(first) = colliders.first().filter(|_| blend.value > 0.0) else {
        for metric in [CROSSINGS_LEFT, UNFREED, STARTED_INSIDE, CONTACTS, DEEPEST, LENGTH_ERROR] {
            cx.publish(metric, 0.0);
        }
        return Ok(OUT.with(out));
    };
    let trees: Vec<Arc<TriangleTree>> = colliders.iter().map(|mesh| tree(mesh)).collect();
    let obstacles: Vec<&TriangleTree> = trees.iter().map(Arc::as_ref).collect();
    let skin = Surface::of(cx.input(SKIN).and_then(Geometry::mesh).unwrap_or(first));
    let mut how = Collide {
        obstacles: &obstacles,
        skin: Some(skin.skin()),
        method: match cx.get(METHOD) {
            Method::Exact => ContactMethod::Exact,
            Method::Steps => ContactMethod::Steps(cx.get(ROTATION_STEPS) as u32),
        },
        coherence: cx.get(COHERENCE),
        gap: cx.get(GAP),
        offset_root: cx.get(OFFSET_ROOT),
        offset_scale: Some(cx.get(OFFSET_SCALE)).filter(|scale| *scale >= 0.0),
        at_rest: None,
        blend,
        width,
    };
    let starts = curves.runs().starts();
    // While nothing moves, what is so at rest is looked at once.
    let still = Still { obstacles: trees.clone(), skin: skin.tree().clone(), offset: how.offset_root };
    let at_rest = rest.kept(still, || Ok(at_rest(starts, rest.positions(), &how)))?;
    how.at_rest = Some(&at_rest);
    let collided = collide(starts, rest.positions(), curves.positions(), &how);
    cx.publish(CROSSINGS_LEFT, collided.crossings_left as f64);
    cx.publish(UNFREED, collided.unfreed_segments as f64);
    cx.publish(STARTED_INSIDE, collided.started_inside as f64);
    cx.publish(CONTACTS, collided.contacts as f64);
    cx.publish(DEEPEST, collided.deepest_overlap);
    cx.publish(LENGTH_ERROR, collided.length_error);
    out.part_mut(Kind::Curves).expect("the engine refuses a wire without curves").set(P, collided.points)?;
    Ok(OUT.with(out))
}

/// What curves at rest are looked at with; equal where trees are the very same.
struct Still {
    obstacles: Vec<Arc<TriangleTree>>,
    skin: Arc<TriangleTree>,
    offset: f64,
}

impl PartialEq for Still {
    fn eq(&self, other: &Self) -> bool {
        let same = |(a, b): (&Arc<TriangleTree>, &Arc<TriangleTree>)| Arc::ptr_eq(a, b);
        self.obstacles.len() == other.obstacles.len()
            && self.obstacles.iter().zip(&other.obstacles).all(same)
            && Arc::ptr_eq(&self.skin, &other.skin)
            && self.offset == other.offset
    }
}

fn count(curves: &Component) -> String {
    let plural = |count: usize, word: &str| format!("{count} {word}{}", if count == 1 { "" } else { "s" });
    format!("{}, {}", plural(curves.element_count(), "curve"), plural(curves.point_count(), "CV"))
}

fn leaves_out(params: &Params, wires: &Wires) -> Vec<LeftOut> {
    if wires.count(&COLLIDERS) == 0 {
        return vec![LeftOut::new("all", "there are no `colliders`")];
    }
    if params.get(BLEND).value == 0.0 {
        return vec![LeftOut::new("all", "`blend` is 0")];
    }
    let mut left_out = Vec::new();
    if params.get(COHERENCE) == 0.0 {
        left_out.push(LeftOut::new("lead_out", "`coherence` is 0"));
    }
    if params.get(OFFSET_SCALE) < 0.0 {
        left_out.push(LeftOut::new("offset", "`offset_scale` is below 0"));
    }
    left_out
}

#[cfg(test)]
mod tests;
