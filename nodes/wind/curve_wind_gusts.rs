//! Curve_Wind_Gusts: gusts that pass over curves scale the wind.
//!
//! W5. A gust is a sphere that travels with the wind from a plane perpendicular to it; its influence is 1 at its centre
//! and 0 at its boundary. Or it is a Gust_Control, placed by hand. `gust` = clamp(`base` + Σ `strength` · influence, 0, 1),
//! `envelope` = clamp(incoming · `gust`, 0, 1).
//!
//! What W leaves open:
//! * A gust is a pure function of seed, index and repetition, so any frame can be cooked alone. Its path is ∫ speed ·
//!   wind dt from its start: where wind or speeds are keyed, travelling gusts change course and speed but never jump.
//!   The position of its speed within the range is drawn once. All other ranges are read at the cooked frame.
//! * The launch plane lies upwind of the curves at the scene's first frame, perpendicular to the mean wind over the
//!   frame before the gust's start, which does not depend on anything later.
//! * Noise dents a sphere in its own space, by direction: the gust never reaches beyond its radius, and the influence
//!   at its centre stays 1.
//! * A gust fades over its decay while it travels on.
//! * Each gust may also blow to a side of its own (`shear`): across the wind that launched it, in a direction drawn once.
//!   `gust_dir` is the sum over all gusts of influence · `shear` · that direction. Gusts placed by hand have none.
//! * With `loop` all gusts come again with the same random numbers, so that frame f + `loop` has the envelope of frame f
//!   where params do not differ. `repeat_every` is rounded so that the loop has a whole number of repetitions. Before
//!   frame 0 params are held, so gusts sent then repeat with a constant wind alone; `unlooped_gusts` counts the others.

use crate::shared::clump;
use crate::shared::direction::{GUST_DIR, no_gust_dir, unit_direction};
use crate::shared::group::{self, Group};
use crate::shared::gust_control;
use curves::clumps::drawn;
use curves::gusts::{
    Control, Draw, Gust, GustMasks, Gusts, Influence, Plane, Sphere, bounds, evaluate, scale, scaled, sideways,
};
use engine::prelude::*;
use numerics::ramp::Ramp;
use numerics::vector::DVec3;
use std::collections::BTreeMap;
use std::sync::Arc;

inputs! { INPUTS:
    CURVES: Input = Input::one("curves", Kind::Curves, "The curves, not yet bent by wind. Their `envelope` is scaled.")
        .read_at(|params| {
            if sends(params) || clump::reads_start(params) { Times::NOW.and(Times::START) } else { Times::NOW }
        });
    CONTROLS: Input<Many> = Input::many("controls", Kind::Points, "Gusts placed by hand: Gust_Control nodes.");
}

params! { PARAMS:
    WIND_DIR: Param<[f64; 3]> = Param::direction("wind_dir", [1.0, 0.0, 0.0],
        "The direction that the wind blows towards and gusts travel in. Its length is ignored.")
        .history().when(is_asked);
    NUM_GUSTS: Param<i64> = Param::int("num_gusts", 8, "Number of gusts. With 0 there are only those placed by hand.")
        .within(0.0, 1e6).soft(0.0, 100.0);
    RADIUS_RANGE: Param<Span> = Param::span("radius_range", [0.3, 0.6], "Range of the gusts' radii, from centre to \
        boundary. Each gust's is drawn at random from it.")
        .unit(Unit::Metres).at_least(0.0).soft(0.0, 10.0).when(is_asked);
    RADIUS_NOISE_RANGE: Param<Span> = Param::span("radius_noise_range", [0.0, 0.3],
        "How deeply noise dents a gust, as a fraction of its radius: at 0 it is a sphere, at 1 dents reach its centre. \
         Noise never enlarges a gust. Each gust's value is drawn at random from this range.")
        .within(0.0, 1.0).when(is_asked);
    SPEED_RANGE: Param<Span> = Param::span("speed_range", [1.0, 3.0],
        "Range of the speeds at which gusts travel. Animating this also changes the speed of gusts that are already \
            travelling.")
        .unit(Unit::MetresPerSecond).at_least(0.0).soft(0.0, 20.0).history().when(is_asked);
    START_FRAME_RANGE: Param<Span> = Param::span("start_frame_range", [1.0, 48.0],
        "Range of frames at which gusts start. Each gust's is drawn at random from it.")
        .unit(Unit::Frame).within(-1e9, 1e9).soft(-100.0, 1000.0).when(is_asked);
    LIFE_RANGE: Param<Span> = Param::span("life_range", [24.0, 96.0],
        "Range of durations for which gusts keep their full strength.")
        .unit(Unit::Frames).within(0.0, 1e9).soft(0.0, 240.0).when(is_asked);
    DECAY_RANGE: Param<Span> = Param::span("decay_range", [6.0, 24.0],
        "Range of durations over which gusts fade after their life, while they still travel. 0 ends them at once.")
        .unit(Unit::Frames).within(0.0, 1e9).soft(0.0, 240.0).when(is_asked);
    DISTANCE: Param<f64> = Param::double("distance", 0.0,
        "How far upwind of the curves gusts start. 0 uses the largest radius, so that gusts start just outside the \
         curves.")
        .unit(Unit::Metres).at_least(0.0).soft(0.0, 10.0).when(is_asked);
    AREA: Param<[f32; 2]> = Param::vec2("area", [0.0; 2],
        "Width and height of the rectangle, across the wind, in which gusts start. 0 uses the width or the height of \
         the curves as seen along the wind.").unit(Unit::Metres).at_least(0.0).soft(0.0, 10.0).when(is_asked);
    REPEAT_EVERY: Param<f64> = Param::double("repeat_every", 0.0,
        "Number of frames after which each gust is sent again, with new random values. With 0 it is sent once.")
        .unit(Unit::Frames).at_least(0.0).soft(0.0, 240.0).when(is_asked);
    LOOP: Param<f64> = Param::double("loop", 0.0,
        "Number of frames after which the same gusts repeat, for a cycle that can be looped; keyed params must repeat \
         too. Where `wind_dir` or `speed_range` is keyed, frames repeat once the gusts sent before frame 0 have faded. \
         `repeat_every` is adjusted so that it divides the loop. 0 does not loop.")
        .unit(Unit::Frames).within(0.0, 1e9).soft(0.0, 240.0).when(is_asked);
    FALLOFF: Param<Arc<Ramp>> = Param::smooth_ramp("falloff", &[[0.0, 1.0], [1.0, 0.0]],
        "Strength of the wind within a gust, from its centre (0) to its boundary (1): 1 is the full wind.")
        .when(is_asked);
    BASE: Param<Maskable> = Param::maskable("base", 0.0,
        "Strength of the wind outside gusts: at 0 it is calm between gusts; at 1 the full wind blows everywhere and \
         gusts add nothing.")
        .within(0.0, 1.0);
    STRENGTH: Param<Maskable> = Param::maskable("strength", 1.0,
        "Multiplies what each gust adds, those placed by hand included: at 0 there are none, above 1 their full strength \
         reaches farther towards their boundaries. The wind never exceeds its full strength.")
        .at_least(0.0).soft(0.0, 4.0);
    SHEAR: Param<Maskable> = Param::maskable("shear", 0.0,
        "How strongly each gust also blows sideways, in a direction of its own, relative to the wind: where a gust \
         passes, curves bend not only more but also in another direction. Gusts placed by hand blow with the wind. 0 \
         turns it off.")
        .soft(0.0, 1.0).when(is_asked);
    SEED: Param<Seed> = Param::seed("Each seed gives other gusts.").when(is_asked);
    GROUP: Param<Name> = group::param();
    CLUMP: Param<Name> = clump::NAME;
    CLUMP_RADIUS: Param<f32> = clump::RADIUS;
    CLUMP_BLEND: Param<Maskable> = clump::BLEND;
}

/// Strength of the wind at a CV by gusts alone.
const GUST: Attr<f32> = Attr::point("gust");

const OUT: Output = Output::like(
    "curves",
    &CURVES,
    "The curves, with their `envelope` scaled by the gusts, and `gust`, by which it was scaled; with `shear` also \
     `gust_dir`, which Curve_Wind adds to the direction of the wind.",
);

metrics! { METRICS:
    EMPTY_GROUP = group::EMPTY;
    ACTIVE_GUSTS = Metric::new("active_gusts", Unit::None,
        "Gusts that are blowing or fading, without those placed by hand.");
    REACHED_POINTS = Metric::new("reached_points", Unit::None, "CVs within any gust, including those placed by hand.");
    DROPPED_GUSTS = Metric::new("dropped_gusts", Unit::None,
        "Gusts left out, the oldest repetitions first, because more than 65,536 would blow at the same time.")
        .warn_above(0.0,
        "More than 65,536 gusts would blow at the same time, so the oldest are missing. Lower `num_gusts`, \
         `life_range` or `decay_range`, or raise `repeat_every`.");
    UNLOOPED_GUSTS = Metric::new("unlooped_gusts", Unit::None,
        "With `loop`: blowing gusts that were sent before frame 0, although the wind has changed since.")
        .warn_above(0.0,
        "With `loop`, these frames do not repeat: gusts blow in them that were sent before frame 0, where params are held, \
         although the wind has changed since. Use frames after these as the cycle, or do not animate the wind.");
}

pub(crate) static NODE: Node = Node::new(
    "Curve_Wind_Gusts",
    3,
    "Sends gusts over the curves: writes their `envelope`, by which Curve_Wind scales the wind, so that it blows where \
     a gust passes. Gusts are spheres that travel with the wind, each with its own random size, speed and start, or \
     regions placed by hand with Gust_Control.",
    Cook::Frame { cook, reads_clock: sends },
)
.inputs(INPUTS)
.params(PARAMS)
.outputs(&[&OUT])
.reads(&[
    &P,
    &ENVELOPE,
    &GUST_DIR,
    &gust_control::POINTS,
    &gust_control::SHAPE,
    &gust_control::OUTER,
    &gust_control::OUTER_BELOW,
    &gust_control::OUTER_ABOVE,
    &gust_control::STRENGTH,
    &gust_control::RAMP,
])
.writes(&[&ENVELOPE, &GUST, &GUST_DIR])
.attributes(|params| group::attributes(params, &[GROUP, CLUMP]))
.metrics(METRICS)
.neutral(|params, wires| {
    let full = is_full(params) && params.get(SHEAR).value == 0.0;
    (full && wires.count(&CONTROLS) == 0).then_some("`base` is 1")
})
.neutral_fills(&[Fill::missing(ENVELOPE, 1.0), Fill::always(GUST, 1.0), Fill::missing_vectors(GUST_DIR)])
.leaves_out(leaves_out)
.integrates(direction)
.integrates(|params| along(params, params.get(SPEED_RANGE).low))
.integrates(|params| along(params, params.get(SPEED_RANGE).high));

fn cook(cx: &FrameCx) -> Result<Outputs> {
    let mut curves = cx.edit(CURVES);
    let controls = controls(cx)?;
    let full = is_full(cx.params()) && controls.iter().all(Control::only_adds);
    let shears = cx.get(SHEAR).value != 0.0 && cx.wants(GUST_DIR);
    let sent = if (full && !shears) || !sends(cx.params()) { Sent::default() } else { sent(cx) };
    cx.publish(ACTIVE_GUSTS, sent.spheres.len() as f64);
    cx.publish(DROPPED_GUSTS, sent.dropped as f64);
    cx.publish(UNLOOPED_GUSTS, sent.unlooped as f64);
    let group = Group::of(&cx.get(GROUP), &curves)?;
    cx.publish(EMPTY_GROUP, group::is_empty(group.as_ref()));
    let felt = felt(cx, &curves, group.as_ref(), &controls, &sent, [!full, shears])?;
    let incoming = curves.get(ENVELOPE);
    let wanted = cx.wants(GUST);
    let (envelope, gust) = match (felt.values, &group) {
        (None, _) => {
            let ones = || Column::new(vec![1.0_f32; curves.point_count()]);
            (incoming.is_none().then(ones), wanted.then(ones))
        }
        (Some(values), None) => {
            let envelope = incoming.filter(|_| wanted).map(|incoming| Column::new(scaled(&values, incoming)));
            let values = Column::new(values);
            // Without an incoming envelope both are one array.
            (Some(envelope.unwrap_or_else(|| values.clone())), wanted.then_some(values))
        }
        (Some(values), Some(group)) => {
            let (envelope, gust) = on_group(group, &curves, values);
            (Some(Column::new(envelope)), Some(Column::new(gust)))
        }
    };
    cx.publish(REACHED_POINTS, felt.reached as f64);
    if let Some(envelope) = envelope {
        curves.set_column(Owner::Point, ENVELOPE.name, envelope)?;
    }
    if let Some(gust) = gust.filter(|_| wanted) {
        curves.set_column(Owner::Point, GUST.name, gust)?;
    }
    if !shears && cx.needs(GUST_DIR) && curves.get(GUST_DIR).is_none() {
        let none = no_gust_dir(cx.part(CURVES));
        curves.set_column(Owner::Point, GUST_DIR.name, none)?;
    }
    if let Some(sides) = felt.sides {
        let mut all = curves.get(GUST_DIR).map_or_else(|| vec![[0.0; 3]; curves.point_count()], <[[f32; 3]]>::to_vec);
        let shear = cx.mask(SHEAR, cx.part(CURVES))?;
        let mut add = |cv: usize, side: [f32; 3]| {
            for axis in 0..3 {
                // Infinity times 0 is NaN and counts as 0.
                let sum = all[cv][axis] + shear.at(cv) * side[axis];
                all[cv][axis] = if sum.is_nan() { 0.0 } else { sum.clamp(-LARGEST, LARGEST) };
            }
        };
        match &group {
            None => sides.into_iter().enumerate().for_each(|(cv, side)| add(cv, side)),
            Some(group) => group.cvs().zip(sides).for_each(|(cv, side)| add(cv, side)),
        }
        curves.set(GUST_DIR, all)?;
    }
    Ok(OUT.with(curves))
}

/// Largest part of `gust_dir` along an axis: the wind itself, of length 1, is then below rounding.
const LARGEST: f32 = 1e12;

/// What the CVs of a group, or all, feel of gusts.
struct Felt {
    /// `gust`; with the incoming envelope where nobody takes `gust` itself. `None` if it is 1 everywhere.
    values: Option<Vec<f32>>,
    reached: usize,
    /// `gust_dir` for a `shear` of 1.
    sides: Option<Vec<[f32; 3]>>,
}

/// `which` asks for values and for sides.
fn felt(
    cx: &FrameCx,
    curves: &Component,
    group: Option<&Group>,
    controls: &[Control],
    sent: &Sent,
    which: [bool; 2],
) -> Result<Felt> {
    let falloff = cx.get(FALLOFF);
    let input = cx.part(CURVES);
    let (base, strength) = (cx.mask(BASE, input)?, cx.mask(STRENGTH, input)?);
    let moved = clumped(cx, input)?;
    let points = moved.as_deref().unwrap_or_else(|| input.positions());
    let of_group = |mask: &[f32]| group.map(|group| group.cvs().map(|cv| mask[cv]).collect::<Vec<f32>>());
    let own = [base.mask, strength.mask].map(|mask| mask.map(|mask| of_group(mask).unwrap_or_else(|| mask.to_vec())));
    let masks = GustMasks { base: own[0].as_deref(), strength: own[1].as_deref() };
    let chosen: Option<Vec<[f32; 3]>> = group.map(|group| group.cvs().map(|cv| points[cv]).collect());
    let points = chosen.as_deref().unwrap_or(points);
    // Gusts alone, where anyone takes them, otherwise what comes in is scaled at once.
    let incoming = curves.get(ENVELOPE).filter(|_| !cx.wants(GUST) && group.is_none());
    let gusts = Gusts { base: base.value, falloff: &falloff, spheres: &sent.spheres, controls, incoming, masks };
    let found = which[0].then(|| evaluate(points, &gusts));
    let sides = which[1].then(|| sideways(points, &gusts, &sent.sides));
    let (values, reached) = found.map_or((None, 0), |Influence { values, reached }| (Some(values), reached));
    Ok(Felt { values, reached, sides })
}

/// Where CVs feel gusts, if not at their own positions: as far from the mean root of their clump as from their own.
fn clumped(cx: &FrameCx, curves: &Component) -> Result<Option<Vec<[f32; 3]>>> {
    let start = clump::reads_start(cx.params()).then(|| cx.part_at_start(CURVES));
    let Some(clumps) = clump::of(cx.params(), curves, start)? else { return Ok(None) };
    let (share, ways) = (cx.mask(CLUMP_BLEND, curves)?, clumps.to_means(clump::roots(curves).as_slice()));
    let mut points = curves.positions().to_vec();
    for (cvs, way) in curves.runs().ranges().zip(&ways) {
        for cv in cvs {
            points[cv] = drawn(points[cv], way, share.at(cv));
        }
    }
    Ok(Some(points))
}

/// `envelope` and `gust` where only the CVs of a group feel gusts, of these strengths. Others keep what they have, or have 1.
fn on_group(group: &Group, curves: &Component, felt: Vec<f32>) -> (Vec<f32>, Vec<f32>) {
    let before = |of: Attr<f32>| curves.get(of).map_or_else(|| vec![1.0; curves.point_count()], <[f32]>::to_vec);
    let (mut envelope, mut gust) = (before(ENVELOPE), before(GUST));
    let mut scaled = felt.clone();
    scale(&mut scaled, &group.cvs().map(|cv| envelope[cv]).collect::<Vec<f32>>());
    for ((cv, felt), scaled) in group.cvs().zip(felt).zip(scaled) {
        (envelope[cv], gust[cv]) = (scaled, felt);
    }
    (envelope, gust)
}

fn controls(cx: &FrameCx) -> Result<Vec<Control>> {
    let mut controls = Vec::new();
    for (wire, points) in cx.part(CONTROLS).into_iter().enumerate() {
        let found = gust_control::controls(points, wire)?;
        controls.extend(found.into_iter().map(|control| control.times(cx.get(STRENGTH).value)));
    }
    Ok(controls)
}

/// The gusts alive at this frame.
#[derive(Default)]
struct Sent {
    spheres: Vec<Sphere>,
    /// Where each blows besides, of length 1.
    sides: Vec<[f32; 3]>,
    /// How many were left out.
    dropped: u64,
    /// How many will not come again, although the gusts loop.
    unlooped: usize,
}

fn sent(cx: &FrameCx) -> Sent {
    struct Around(Option<[[f32; 3]; 2]>);
    let around = cx.part_at_start(CURVES).derived(|start| Around(bounds(start.positions())));
    let Some(bounds) = around.0 else { return Sent::default() };
    let ends = |range: Param<Span>| {
        let Span { low, high } = cx.get(range);
        [low, high]
    };
    let frames = |range: Param<Span>| ends(range).map(f64::from);
    let draw = Draw {
        seed: u64::from(cx.get(SEED).0),
        gusts: cx.get(NUM_GUSTS) as u32,
        radius: ends(RADIUS_RANGE),
        noise: ends(RADIUS_NOISE_RANGE),
        start: frames(START_FRAME_RANGE),
        life: frames(LIFE_RANGE),
        decay: frames(DECAY_RANGE),
        repeat: cx.get(REPEAT_EVERY),
        period: 0,
    };
    let draw = if cx.get(LOOP) > 0.0 { draw.looped(cx.get(LOOP)) } else { draw };
    let living = draw.at(cx.frame().number());
    let distance = cx.get(DISTANCE);
    let distance = if distance > 0.0 { distance } else { f64::from(cx.get(RADIUS_RANGE).high) };
    let area = cx.get(AREA).map(f64::from);
    let [_, slow, fast] = cx.integrals(cx.frame()).map(DVec3::from);
    let strength = cx.get(STRENGTH).value;
    // Gusts that start within the same frame are launched by the same wind.
    let mut known = BTreeMap::new();
    let sphere = |gust: &Gust| {
        let whole = gust.start.floor() as i64;
        let (plane, launch) = known.entry(whole).or_insert_with(|| {
            let launch = Launch::at(cx, whole);
            (Plane::new(bounds, launch.wind, distance, area), launch)
        });
        let from = DVec3::from(plane.at(gust.position));
        let side = plane.direction(gust.side).map(|x| x as f32);
        let sphere = Sphere {
            centre: (from + launch.travelled([slow, fast], gust)).into(),
            radius: gust.radius,
            strength: gust.strength * strength,
            noise: gust.noise,
            salt: gust.salt,
        };
        (sphere, side)
    };
    let (spheres, sides) = living.gusts.iter().map(sphere).unzip();
    let old = living.gusts.iter().filter(|gust| gust.start < 0.0).count();
    let unlooped = if cx.get(LOOP) > 0.0 && has_turned(cx) { old } else { 0 };
    Sent { spheres, sides, dropped: living.dropped, unlooped }
}

/// Whether the wind that gusts travel with has changed since frame 0.
fn has_turned(cx: &FrameCx) -> bool {
    if cx.frame().number() <= 0.0 {
        return false;
    }
    let [held, now] = [cx.integrands::<3>(0.0), cx.integrals::<3>(cx.frame())];
    held.iter().zip(&now).any(|(held, now)| {
        let held = DVec3::from(*held) * cx.seconds();
        (held - DVec3::from(*now)).norm() > 1e-9 * held.norm().max(1.0)
    })
}

/// The wind at a whole frame at which gusts start, and over the frame before it.
struct Launch {
    /// Its mean direction over the frame before, of length 1.
    wind: [f64; 3],
    /// ∫ speed · wind dt up to the whole frame, at the lower and the upper end of the range of speeds.
    upto: [DVec3; 2],
    /// The same over only the frame before.
    step: [DVec3; 2],
}

/// If the mean of unit directions is shorter than this, it has no reliable direction: the wind has reversed.
const REVERSED: f64 = 0.1;

impl Launch {
    fn at(cx: &FrameCx, frame: i64) -> Self {
        let [toward, slow, fast] = cx.integrals(Frame::whole(frame)).map(DVec3::from);
        let [_, slow_before, fast_before] = cx.integrals(Frame::whole(frame - 1)).map(DVec3::from);
        // Where the wind reversed within the frame before, its mean over more frames decides.
        let mean = |frames: i64| {
            let [before] = cx.integrals(Frame::whole(frame - frames));
            (toward - DVec3::from(before)) * cx.fps() / frames as f64
        };
        let wind = [1, 2, 4, 8, 16].into_iter().map(mean).find(|mean| mean.norm() > REVERSED);
        Self {
            wind: wind.map_or_else(|| direction(cx.params()), |mean| unit_direction(mean.into())),
            upto: [slow, fast],
            step: [slow - slow_before, fast - fast_before],
        }
    }

    /// How far a gust has travelled, metres along each axis, given the integrals up to now. Within the frame in which
    /// it starts, the wind is taken to be that of the frame before: exact where it is constant, otherwise a constant
    /// offset of its start.
    fn travelled(&self, now: [DVec3; 2], gust: &Gust) -> DVec3 {
        let share = gust.start - gust.start.floor();
        let [slow, fast] = [0, 1].map(|end| now[end] - self.upto[end] - self.step[end] * share);
        slow + (fast - slow) * gust.speed
    }
}

/// The wind's direction, of length 1.
fn direction(params: &Params) -> [f64; 3] {
    unit_direction(params.get(WIND_DIR))
}

fn along(params: &Params, speed: f32) -> [f64; 3] {
    direction(params).map(|x| x * f64::from(speed))
}

fn is_asked(params: &Params) -> bool {
    params.get(NUM_GUSTS) > 0
}

/// Whether the wind blows at its full strength everywhere, whatever gusts there are, unless they take from it.
fn is_full(params: &Params) -> bool {
    let base = params.get(BASE);
    base.value == 1.0 && base.attribute.is_none() && params.get(FALLOFF).min() >= 0.0
}

/// Whether any gust that is sent can reach anything.
fn sends(params: &Params) -> bool {
    no_gusts(params).is_none()
}

/// Why no gust that is sent has an effect.
fn no_gusts(params: &Params) -> Option<&'static str> {
    if !is_asked(params) {
        return Some("`num_gusts` is 0");
    }
    if params.get(RADIUS_RANGE).high == 0.0 {
        return Some("`radius_range` is 0");
    }
    if params.get(LIFE_RANGE).high == 0.0 && params.get(DECAY_RANGE).high == 0.0 {
        return Some("`life_range` and `decay_range` are 0");
    }
    (params.get(FALLOFF).is_constant() == Some(0.0)).then_some("`falloff` is 0")
}

fn leaves_out(params: &Params, wires: &Wires) -> Vec<LeftOut> {
    let mut left_out = Vec::new();
    match no_gusts(params) {
        Some(why) => left_out.push(LeftOut::new("gusts", why)),
        None if params.get(RADIUS_NOISE_RANGE).high == 0.0 => {
            left_out.push(LeftOut::new("noise", "`radius_noise_range` is 0"));
        }
        None => {}
    }
    if params.get(SHEAR).value == 0.0 {
        left_out.push(LeftOut::new("shear", "`shear` is 0"));
    }
    if wires.count(&CONTROLS) == 0 {
        left_out.push(LeftOut::new("controls", "no `controls` are wired"));
    }
    left_out
}

#[cfg(test)]
mod tests;
