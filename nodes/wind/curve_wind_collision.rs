//! Curve_Wind_Collision: keeps curves that are bent by wind out of colliders.
//!
//! W3. Root to tip, each segment starts from its rest direction, carried along by the turns of the segments before it,
//! and turns towards the direction that the wind gave it until it meets a collider. A segment that an earlier turn has
//! pushed into a collider is first turned out of it. `offset_root` lifts roots off the skin, in creases off all faces; `offset_scale` keeps
//! curves that the wind presses flat at a fraction of their rest height.
//!
//! Departures:
//! * `exact` stops at the first contact itself instead of after the last of `rotation_steps` steps without one: nothing
//!   passes through a thin collider, and cost does not grow with accuracy.
//! * Turns stop `gap` of arc length short of contact, so that positions rounded to a file's f32 do not cross.
//! * Neither W's collision nor the first contact is continuous in the wind. `coherence` redirects segments out of the
//!   skin by a continuous map, and lets them take a free direction however they get there: on the bear, in wind that moves
//!   0.50 % of all curves by more than a quarter of their length in a frame, collision raises that to 1.07 %, and to
//!   0.63 % at `coherence` 1 (tests/wind/coherence.rs); docs/wind.md has other bodies.
//! * `loft` keeps a share of the height of what the wind presses down, which first contact lays on the skin. Heights
//!   are those over the skin as it curves at the root: over its tangent plane fur would stand off a curved skin; over the skin
//!   itself, more tips jump, and collision takes twice as long. It is 0 by default: on smooth bodies a third fewer tips jump with it, on the bear a third more do (docs/wind.md).
//! * A segment may be carried to where no turn about its CV frees it, which W leaves open. Then the whole curve is blended
//!   towards rest, up to its first pose that crosses nothing.
//! * `offset_scale` only raises segments that would lie lower: wind may lift fur off the skin.

use std::sync::{Arc, OnceLock};

use curves::collide::{AtRest, Collide, ContactMethod, SkinMesh, collide};
use engine::prelude::*;
use numerics::tree::TriangleTree;
use numerics::vector::{largest, to_f64};

use crate::shared::group::{self, Group, taken};
use crate::shared::surface::{skin, tree};

choice! {
    /// How a segment's turn is stopped.
    enum Method {
        Exact = "exact": "at the first contact, computed in closed form, so that even a thin collider is not missed",
        Steps = "steps": "it turns in `rotation_steps` equal steps and stops before the first one that crosses a \
            collider, as in the paper; thin colliders may be missed",
    }
}

inputs! { INPUTS:
    CURVES: Input = Input::one("curves", Kind::Curves, "The curves after the wind has bent them.");
    REST: Input = Input::one("rest", Kind::Curves,
        "The same curves before the wind, at the same frame; on a moving skin, the curves from Curve_Attach.");
    COLLIDERS: Input<Many> = Input::many("colliders", Kind::Mesh,
        "Meshes that curves must not cross, the skin included. They may move and deform.");
    SKIN: Input<Opt> = Input::optional("skin", Kind::Mesh,
        "The mesh that the curves grow on, for `offset_root` and `offset_scale`. By default the first collider.");
}

params! { PARAMS:
    METHOD: Param<Method> = Param::choice("method", Method::Exact, "How the turn of a segment is stopped.");
    ROTATION_STEPS: Param<i64> = Param::int("rotation_steps", 10, "Number of steps of a turn. With more steps \
        segments stop closer to the contact, at proportionally higher cost.")
        .within(1.0, 1e6).soft(2.0, 64.0).when(|params| params.get(METHOD) == Method::Steps);
    OFFSET_ROOT: Param<Maskable> = Param::maskable("offset_root", 1e-4,
        "How far outside the skin each root is moved, together with its curve: in a crease, until it is this far from \
         all faces, if a move of at most 4 times this distance achieves that. If this is less than `gap`, the beginning \
         of a curve is not tested, because it touches the skin.")
        .unit(Unit::Metres).at_least(0.0).soft(0.0, 0.1);
    OFFSET_SCALE: Param<Maskable> = Param::maskable("offset_scale", -1.0,
        "Minimum height above the skin, relative to the height at rest: 1 keeps the volume of the coat, smaller values \
         let the wind press it down. Negative values turn this off.")
        .soft(-1.0, 1.0);
    LOFT: Param<Maskable> = Param::maskable("loft", 0.0,
        "Share of its rest height that the goal of a CV keeps, at least, where the wind presses it down. Heights are measured \
         above a smooth surface that curves as the skin does at the root: exact on a plane and, at 0.5, to 5 % on a sphere; elsewhere \
         a half to three quarters of the CVs keep their share to 5 %, others less. Use `offset_scale` where heights \
         must hold. A little keeps a coat from lying on the skin, so that far fewer curves touch it. On most \
         bodies fewer curves jump as the wind turns. It is multiplied by 1 − `coherence`. 0 is as in the paper.")
        .within(0.0, 1.0).when(|params| {
            let coherence = params.get(COHERENCE);
            params.get(OFFSET_SCALE).value < 0.0 && (coherence.value < 1.0 || coherence.attribute.is_some())
        });
    GAP: Param<Maskable> = Param::maskable("gap", 1e-4,
        "Distance, along the arc of its turn, at which a segment stops before a contact.")
        .unit(Unit::Metres).at_least(0.0).soft(0.0, 0.01);
    WIDTH: Param<Maskable> = Param::maskable("width", 0.0,
        "Diameter of the curves in collisions: their axes keep half of it from colliders, from where they are that far away \
         on; `offset_root` lifts roots. Where no turn of a segment is far enough from all surfaces, as in corners, it may \
         be less: see `too_near`. At 0 curves are infinitely thin.")
        .unit(Unit::Metres).at_least(0.0).soft(0.0, 0.01);
    COHERENCE: Param<Maskable> = Param::maskable("coherence", 0.0,
        "How strongly curves blown into the skin are redirected outward, so that they do not flip from one side to the \
         other as wind and skin move. At 0 each segment stops at its first contact, which depends on its whole path: a \
         few curves in a thousand jump in each frame. At 1 there are hardly more jumps than in the wind itself (see the \
         metric `jumps`), few curves touch the skin, and tips move 1 to 3 % less; collision takes 1.9 times as long. The \
         more directly the wind blows into the skin, the more upright curves stay that would otherwise lie flat. Above 0 \
         a curve may end on the other side of a fold of the skin, but of no other collider; values between 0 and 1 \
         redirect only partly, and leave some of the jumps.")
        .within(0.0, 1.0);
    BLEND: Param<Maskable> = Param::maskable("blend", 1.0,
        "How much of each segment's collision response is applied: 0 leaves the curves as the wind bends them, 1 keeps \
         them out of the colliders. Lengths are kept at any value.").within(0.0, 1.0);
    GROUP: Param<Name> = group::param();
}

/// Number of a curve's segments that cross a collider.
const UNFREED_SEGMENTS: Attr<i32> = Attr::element("unfreed");

/// 1 for a curve that is blended towards rest.
const BLENDED_CURVE: Attr<i32> = Attr::element("blended");

/// 1 for a curve whose root is nearer to the skin than `offset_root`.
const LOW_ROOT: Attr<i32> = Attr::element("low_root");

const OUT: Output = Output::like("curves", &CURVES, "The curves, bent around the colliders. Lengths are kept.");

metrics! { METRICS:
    CROSSINGS_LEFT = Metric::new("crossings_left", Unit::None,
        "Segments of the output that cross a collider; with a `group`, those of its curves. Not counted while `blend` is \
         0.")
        .warn_above(0.0,
        "These segments still reach into a collider; `unfreed` of the output says on which curves, so that they can be \
         seen and hidden. Either their curves cross a collider at rest and no turn frees them (`unfreed_segments`); or \
         `blend` is below 1. Raise `offset_root`, or start from curves that are clear of the colliders.");
    UNFREED = Metric::new("unfreed_segments", Unit::None,
        "Segments that cross a collider and that no turn can free, in curves that also cross one at rest.");
    BLENDED = Metric::new("blended_to_rest", Unit::None,
        "Curves that could not be freed by turning segments alone: they are blended towards rest until they cross \
            nothing.")
        .warn_above(MANY, "So many curves are held back near their rest shape, because one of their segments would cross a \
            collider however it turned; they may jump where that begins and ends. `blended` of the output says which. \
            Raise `coherence`, or resample the curves to shorter segments where the skin has folds.");
    STARTED_INSIDE = Metric::new("started_inside", Unit::None, "Curves that cross a collider in their rest shape.")
        .warn_above(0.0, "These curves cross a collider before any wind blows, so there is no free position to start \
            from: they are turned outwards as far as possible. If they grow on another mesh than the first collider, wire \
            the skin that they grow on into `skin`; if on several, merge these. Else clear them of the collider in \
            their rest shape, raise `offset_root`, or leave out that collider.");
    LOW_ROOTS = Metric::new("low_roots", Unit::None,
        "Roots in creases so narrow that a move of 4 times `offset_root` does not bring them `offset_root` away from all \
         faces. They are moved as far away as that allows.")
        .warn_above(MANY, "So many roots lie in creases too narrow for `offset_root`: their curves begin nearer to the skin \
            than that, and may touch it. `low_root` of the output says which. Lower `offset_root` (down to `gap`) until \
            they fit, or move these curves out of the creases.");
    CONTACTS = Metric::new("contacts", Unit::None,
        "Segments stopped by a collider before they reach the direction that the wind gave them.");
    DEEPEST = Metric::new("deepest_overlap", Unit::Metres,
        "How far the deepest unfreed segment reaches through a surface.");
    TOO_NEAR = Metric::new("too_near", Unit::None,
        "Segments whose axes are nearer to a collider than half of `width`, although their curves are that far away before. \
         With a `group`, those of its curves.")
        .warn_above(0.0, "These segments are nearer to a collider than half of `width`, by at most {missing_width} of that. \
            They lie where no turn is far enough from all surfaces, or `blend` is below 1. Lower `width` there, which may \
            be masked, or resample the curves to shorter segments.");
    MISSING_WIDTH = Metric::new("missing_width", Unit::None,
        "The largest share of half of `width` that these segments are too near: 1 for one that reaches the collider.");
    NEAR_ROOTS = Metric::new("near_roots", Unit::None,
        "Curves whose roots, after `offset_root`, are nearer to a collider than half of `width`.")
        .warn_above(0.0, "These curves begin nearer to a collider than half of `width`, so their axes are that far away only \
            from the end of a later segment on. Raise `offset_root` to half of `width`, or lower `width` at roots.");
    ROOTS_APART = Metric::new("roots_apart", Unit::Metres,
        "The largest distance between the root of a curve and its root in `rest`.");
    ROOTS_OFF = Metric::new("roots_off", Unit::None,
        "Curves whose roots are farther from those in `rest` than `offset_root` and `gap`.")
        .warn_above(0.0, "The roots of these curves are up to {roots_apart} m from their roots in `rest`, which are lifted off \
            the skin: their curves may begin below it, and are then kept below. Wire into `rest` the curves that go into \
            the first wind node, at the same pose of the skin.");
    ROOT_LIFT = Metric::new("root_lift", Unit::None,
        "The largest `offset_root`, as a share of the median length of the curves.")
        .warn_above(0.1, "`offset_root` moves curves off the skin by {root_lift} of their median length: they stand visibly \
            above it. Lower `offset_root` and `gap`. If the scene is in millimetres or centimetres, convert it to metres \
            with `scale` of the nodes that read it.");
    LENGTH_ERROR = Metric::length_error();
    EMPTY_GROUP = group::EMPTY;
    JUMPS = Metric::jumps();
}

/// Number of curves from which a note is worth reading: a few in a groom of thousands are not seen.
const MANY: f64 = 20.0;

pub(crate) static NODE: Node = Node::new(
    "Curve_Wind_Collision",
    12,
    "Keeps curves that are bent by wind out of colliders. Each segment, root to tip, turns from its rest direction \
     towards the direction that the wind gave it, until it touches a collider. Place this node after the wind, and wire \
     the curves from before the wind into `rest`. Attributes of each curve: `unfreed`, the number of segments that still \
     cross a collider; `blended`, 1 if it is held back near its rest shape; `low_root`, 1 if its root is nearer to the \
     skin than `offset_root`.",
    Cook::Pure(cook),
)
.inputs(INPUTS)
.params(PARAMS)
.accuracy(&[
    Accuracy::larger("rotation_steps", Trials::These(&["2", "4", "8", "16", "32", "64"]))
        .order(1.0)
        .exact("method", "exact")
        .needs("method", "steps"),
    Accuracy::words("method", &["steps", "exact"]),
])
.outputs(&[&OUT])
.reads(&[&P])
.writes(&[&P, &UNFREED_SEGMENTS, &BLENDED_CURVE, &LOW_ROOT])
.attributes(|params| group::attributes(params, &[GROUP]))
.metrics(METRICS)
.neutral(|params, wires| match params {
    _ if wires.count(&COLLIDERS) + wires.count(&SKIN) == 0 => Some("neither `colliders` nor `skin` is wired"),
    _ if params.get(BLEND).value == 0.0 => Some("`blend` is 0"),
    _ => None,
})
.neutral_fills(&[
    Fill::always_int(UNFREED_SEGMENTS, 0),
    Fill::always_int(BLENDED_CURVE, 0),
    Fill::always_int(LOW_ROOT, 0),
])
.leaves_out(|params, _| {
    let mut left_out = Vec::new();
    if params.get(COHERENCE).value == 0.0 {
        left_out.push(LeftOut::new("redirection", "`coherence` is 0"));
    }
    if params.get(OFFSET_SCALE).value < 0.0 {
        left_out.push(LeftOut::new("offset", "`offset_scale` is below 0"));
    }
    if params.get(LOFT).value == 0.0 {
        left_out.push(LeftOut::new("loft", "`loft` is 0"));
    }
    left_out
});

fn cook(cx: &Cx) -> Result<Outputs> {
    let (mut curves, rest) = (cx.edit(CURVES), cx.part(REST));
    if curves.runs() != rest.runs() {
        return Err(Error::refused(format!(
            "`curves` ({}) and `rest` ({}) are not the same curves",
            count(&curves),
            count(rest)
        ))
        .hint("give `rest` the curves as they were before the wind nodes"));
    }
    let group = Group::of(&cx.get(GROUP), &curves)?;
    cx.publish(EMPTY_GROUP, group::is_empty(group.as_ref()));
    let found = match group {
        None => collided(cx, &curves, rest)?,
        Some(group) => collided_of(cx, &group, &curves, rest)?,
    };
    curves.set(P, found.points)?;
    for (attr, values) in OF_CURVES.into_iter().zip(found.of_curves) {
        if cx.wants(attr) {
            curves.set_column(Owner::Element, attr.name, values)?;
        }
    }
    Ok(OUT.with(curves))
}

/// What is written of each curve.
const OF_CURVES: [Attr<i32>; 3] = [UNFREED_SEGMENTS, BLENDED_CURVE, LOW_ROOT];

/// Curves after collision.
struct Found {
    points: Vec<[f32; 3]>,
    /// The values of [`OF_CURVES`].
    of_curves: [Column; 3],
}

/// What depends on curves and obstacles at rest alone. Frames that need it first at the same time find it together.
struct KeptAtRest {
    curves: AtRest,
    /// [`LOW_ROOT`], one array for all frames.
    low_root: OnceLock<Column>,
    /// Median length of the curves, metres; 0 without curves.
    median_length: OnceLock<f64>,
}

/// The curves of a group collided; the others as they are, with 0 of everything.
fn collided_of(cx: &Cx, group: &Group, curves: &Component, rest: &Component) -> Result<Found> {
    let chosen = group.curves(curves.runs());
    let part = taken(curves, &chosen)?;
    let part_of_rest = rest.kept(chosen.clone(), || taken(rest, &chosen))?;
    let part_found = collided(cx, &part, &part_of_rest)?;
    let mut points = curves.positions().to_vec();
    for (curve, own) in chosen.iter().zip(part.runs().ranges()) {
        points[curves.runs().range(*curve as usize)].copy_from_slice(&part_found.points[own]);
    }
    let of_curves = part_found.of_curves.map(|own| {
        let own = i32::array(&own).map_or_else(Arc::default, Arc::clone);
        let mut all = vec![0; curves.element_count()];
        for (curve, value) in chosen.iter().zip(own.as_slice()) {
            all[*curve as usize] = *value;
        }
        Column::new(all)
    });
    Ok(Found { points, of_curves })
}

/// Curves collided, and the metrics published.
fn collided(cx: &Cx, curves: &Component, rest: &Component) -> Result<Found> {
    let colliders = cx.part(COLLIDERS);
    let trees: Vec<Arc<TriangleTree>> = colliders.iter().map(|mesh| tree(mesh)).collect();
    let obstacles: Vec<&TriangleTree> = trees.iter().map(Arc::as_ref).collect();
    let skin = cx.part(SKIN).or(colliders.first().copied()).map(skin);
    let blend = cx.mask(BLEND, curves)?;
    let factors = Group::of(&cx.get(GROUP), curves)?.map(|group| group.factors(blend));
    let offset_root = cx.mask(OFFSET_ROOT, curves)?.map(f64::from);
    let mut how = Collide {
        obstacles: &obstacles,
        skin: skin.as_deref().map(SkinMesh::surface),
        method: match cx.get(METHOD) {
            Method::Exact => ContactMethod::Exact,
            Method::Steps => ContactMethod::Steps(cx.get(ROTATION_STEPS) as u32),
        },
        coherence: cx.mask(COHERENCE, curves)?.map(f64::from),
        gap: cx.mask(GAP, curves)?.map(f64::from),
        offset_root,
        offset_scale: Some(cx.mask(OFFSET_SCALE, curves)?.map(f64::from)).filter(|scale| scale.value >= 0.0),
        loft: cx.mask(LOFT, curves)?.map(f64::from),
        at_rest: None,
        blend: group::masked(blend, factors.as_deref()),
        width: cx.mask(WIDTH, curves)?,
    };
    let starts = curves.runs().starts();
    // Computed once for still colliders and curves.
    let tree = skin.as_ref().map(|skin| skin.tree().clone());
    let at_root = |mask: &[f32]| {
        let roots = curves.runs().ranges().map(|cvs| mask.get(cvs.start).copied().unwrap_or_default());
        roots.collect::<Vec<f32>>()
    };
    let still = Still {
        obstacles: trees.clone(),
        skin: tree,
        offset: how.offset_root.value,
        offsets: offset_root.mask.map_or_else(Vec::new, at_root),
        lofts: how.loft.value > 0.0,
    };
    let of = || KeptAtRest {
        curves: AtRest::of(curves.element_count()),
        low_root: OnceLock::new(),
        median_length: OnceLock::new(),
    };
    let at_rest = rest.kept(still, || Ok(of()))?;
    how.at_rest = Some(&at_rest.curves);
    let collided = collide(starts, rest.positions(), curves.positions(), &how);
    cx.publish(CROSSINGS_LEFT, collided.crossings_left as f64);
    cx.publish(UNFREED, collided.unfreed_segments as f64);
    cx.publish(BLENDED, collided.blended_to_rest as f64);
    cx.publish(STARTED_INSIDE, collided.started_inside as f64);
    cx.publish(LOW_ROOTS, collided.low_roots as f64);
    cx.publish(CONTACTS, collided.contacts as f64);
    cx.publish(DEEPEST, collided.deepest_overlap);
    cx.publish(TOO_NEAR, collided.too_near as f64);
    cx.publish(MISSING_WIDTH, collided.missing_width);
    cx.publish(NEAR_ROOTS, collided.near_roots as f64);
    cx.publish(LENGTH_ERROR, collided.length_error);
    let roots = Roots::of(curves, rest, &how);
    cx.publish(ROOTS_APART, roots.apart);
    cx.publish(ROOTS_OFF, roots.off as f64);
    let median = match at_rest.median_length.get() {
        Some(median) => *median,
        None => {
            let median = median_length(rest);
            let _ = at_rest.median_length.set(median);
            median
        }
    };
    let lift = if how.skin.is_some() && median > 0.0 { roots.most_lifted / median } else { 0.0 };
    cx.publish(ROOT_LIFT, lift);
    let low_root = match at_rest.low_root.get() {
        Some(low_root) => low_root.clone(),
        None => {
            let low_root = Column::new(at_rest.curves.is_low().map(i32::from).collect());
            let _ = at_rest.low_root.set(low_root.clone());
            low_root
        }
    };
    let of_curves = [Column::new(collided.crossings), Column::new(collided.blended), low_root];
    Ok(Found { points: collided.points, of_curves })
}

/// The roots of curves, compared with those at rest.
#[derive(Default)]
struct Roots {
    /// The largest distance between both, metres.
    apart: f64,
    /// Number of roots farther away than what keeps them off the skin.
    off: usize,
    /// The largest distance that they are lifted, metres.
    most_lifted: f64,
}

impl Roots {
    fn of(curves: &Component, rest: &Component, how: &Collide<'_>) -> Self {
        let mut found = Self::default();
        // Looked up by name once, not for each curve.
        let [points, rest_points] = [curves, rest].map(Component::positions);
        for root in curves.runs().ranges().filter(|cvs| !cvs.is_empty()).map(|cvs| cvs.start) {
            let (now, before) = (points[root], rest_points[root]);
            let apart = (to_f64(now) - to_f64(before)).norm();
            let lifted = how.offset_root.at(root);
            // Positions rounded to f32 may be apart by some 2⁻²³ of them.
            let allowed = lifted.max(how.gap.at(root)) + ROUNDING * f64::from(largest(now));
            found.apart = found.apart.max(apart);
            found.off += usize::from(apart > allowed);
            found.most_lifted = found.most_lifted.max(lifted);
        }
        found
    }
}

/// Rounding of positions that two nodes computed, relative to their largest coordinate.
const ROUNDING: f64 = 1e-6;

/// The median length of curves, metres; 0 without curves. Of an even number the longer of the two in the middle.
fn median_length(curves: &Component) -> f64 {
    let length = |cvs: std::ops::Range<usize>| -> f64 {
        let steps = curves.positions()[cvs].windows(2);
        steps.map(|ends| (to_f64(ends[1]) - to_f64(ends[0])).norm()).sum()
    };
    let mut lengths: Vec<f64> = curves.runs().ranges().map(length).collect();
    let middle = lengths.len() / 2;
    if lengths.is_empty() { 0.0 } else { *lengths.select_nth_unstable_by(middle, f64::total_cmp).1 }
}

/// Everything that the test of rest curves depends on besides the curves; equal if the trees are the same objects.
struct Still {
    obstacles: Vec<Arc<TriangleTree>>,
    skin: Option<Arc<TriangleTree>>,
    offset: f64,
    /// What scales it at the root of each curve; empty without a mask.
    offsets: Vec<f32>,
    lofts: bool,
}

impl PartialEq for Still {
    fn eq(&self, other: &Self) -> bool {
        let same = |(a, b): (&Arc<TriangleTree>, &Arc<TriangleTree>)| Arc::ptr_eq(a, b);
        self.obstacles.len() == other.obstacles.len()
            && self.obstacles.iter().zip(&other.obstacles).all(same)
            && self.skin.iter().zip(&other.skin).all(same)
            && self.skin.is_some() == other.skin.is_some()
            && (self.offset, self.lofts) == (other.offset, other.lofts)
            && self.offsets == other.offsets
    }
}

fn count(curves: &Component) -> String {
    let plural = |count: usize, word: &str| format!("{count} {word}{}", if count == 1 { "" } else { "s" });
    format!("{}, {}", plural(curves.element_count(), "curve"), plural(curves.point_count(), "CV"))
}

#[cfg(test)]
mod tests;
