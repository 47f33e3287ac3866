//! Curve_Wind: wind bends curves, root to tip.
//!
//! W2. At each CV the rest of the curve turns about that CV, from the direction of its current tip towards the wind
//! plus noise; the angle is scaled by `global_rotate`, `ramp_rotate` (along the curve) and the CV's `envelope`. Noise
//! is sampled at the root, offset along the wind by arc length × `waviness`.
//!
//! Departures:
//! * Noise moves **downwind** with time, by ∫ `scroll` · wind dt: W does not scroll the noise, and an offset
//!   proportional to the frame number would jump where speed or direction are keyed.
//! * In the paper a curve of n segments bends more than one of n/2; `resolution_free` turns by a share of the angle per
//!   length instead.
//! * With `loop` the pattern is a blend of two, a loop apart: one fades out while the other fades in, so that frame
//!   f + `loop` has the noise of frame f. Squares of both parts sum to 1, which keeps its strength on average.
//! * `gust_dir`, what gusts add to a wind of length 1, is added to wind and noise.
//! * `blend` scales each segment's turn instead of mixing positions, so that a partial wind keeps lengths too.

use crate::shared::clump;
use crate::shared::direction::{GUST_DIR, gust_dir, unit_direction};
use crate::shared::group::{self, Group};
use curves::clumps::drawn;
use curves::wind_bend::{Bend, BendMode, BendNoise, bend};
use engine::prelude::*;
use numerics::noise::{Field, NoiseKind};
use numerics::ramp::Ramp;
use std::sync::Arc;

choice! {
    /// What varies the wind's direction.
    NoiseChoice for Option<NoiseKind> {
        None => "none": "the wind is the same everywhere",
        Some(NoiseKind::Perlin) => "perlin": "smooth, with detail at every scale from gusts to flutter",
        Some(NoiseKind::Billow) => "billow": "rounded swells separated by creases",
        Some(NoiseKind::Wavelet) => "wavelet": "each octave (layer of noise) contains detail of its own size only, so \
            fine detail does not shimmer",
    }
}

choice! {
    /// Where noise is sampled.
    enum Space {
        World = "world": "sampled at the root's current position, so a moving animal passes through the pattern",
        Rest = "rest": "sampled at the root's rest position, so the pattern sticks to a moving animal: `Pref` of the root if \
                the curves have it, otherwise its position at the scene's first frame",
    }
}

choice! {
    /// How the turn is distributed along the curve.
    enum Mode {
        Paper = "paper": "every CV turns by the same fraction of the remaining angle: curves with more CVs bend more",
        ResolutionFree = "resolution_free": "the bend does not depend on the number of CVs: it is that of a \
                curve of `reference_segments` segments in `paper` mode. With a `global_rotate` of 1 or more the whole \
                curve lies along the wind",
    }
}

inputs! { INPUTS:
    CURVES: Input = Input::one("curves", Kind::Curves, "The curves, root first. Their `envelope` scales the wind at \
        each CV.")
        .read_at(|params| {
            let start = rest_from_start(params) || finds_clumps(params);
            if start { Times::NOW.and(Times::START) } else { Times::NOW }
        });
}

params! { PARAMS:
    WIND_DIR: Param<[f64; 3]> = Param::direction("wind_dir", [1.0, 0.0, 0.0],
        "The direction that the wind blows towards. Its length is ignored.").history();
    NOISE: Param<NoiseChoice> = Param::choice("noise", Some(NoiseKind::Perlin),
        "The noise that varies the wind's direction from place to place.");
    AMPLITUDE: Param<Maskable> = Param::maskable("amplitude", 0.5,
        "Strength of the noise relative to the wind: at 0 the wind blows straight, at 1 noise and wind are equally \
         strong.")
        .at_least(0.0).soft(0.0, 2.0).when(has_kind);
    FREQUENCY: Param<f64> = Param::double("frequency", 2.0,
        "How fine the noise is: its largest features are about 1/`frequency` metres across.")
        .unit(Unit::PerMetre).at_least(0.0).soft(0.1, 20.0).when(has_noise);
    OCTAVES: Param<i64> = Param::int("octaves", 2, "Number of layers of noise, each with features half as large as the \
        one before: more give finer detail and cost more.")
        .within(1.0, 16.0).soft(1.0, 4.0).when(has_noise);
    ROUGHNESS: Param<f32> = Param::float("roughness", 0.5,
        "Strength of each octave relative to the one before: at 0 only the largest remains, at 1 all are equally \
         strong.")
        .within(0.0, 1.0).when(|params| has_noise(params) && params.get(OCTAVES) > 1);
    SCROLL: Param<f64> = Param::double("scroll", 1.0,
        "How fast the noise pattern moves downwind. 0 holds it still.")
        .unit(Unit::MetresPerSecond).soft(-10.0, 10.0).history().when(has_noise);
    LOOP: Param<f64> = Param::double("loop", 0.0,
        "Number of frames after which the noise repeats, for a cycle that can be looped; keyed params must repeat too, \
         also before the first frame if Curve_Jiggle's `preroll` reads it. The pattern cross-fades into itself, so it should move by the size of a feature or more in this time. 0 does \
         not loop.")
        .unit(Unit::Frames).within(0.0, 1e9).soft(0.0, 240.0).when(|params| has_noise(params) && params.get(SCROLL) != 0.0);
    NOISE_SPACE: Param<Space> = Param::choice("noise_space", Space::World,
        "Whether the noise pattern stays in the world or sticks to the animal.").when(has_noise);
    WAVINESS: Param<Maskable> = Param::maskable("waviness", 0.0,
        "How much the noise changes along a curve: at 0 each curve bends as a whole; from about 1 on, waves run \
         through it. Each CV samples the noise this many times its arc length downwind of the root.")
        .soft(0.0, 4.0).when(has_noise);
    GLOBAL_ROTATE: Param<Maskable> = Param::maskable("global_rotate", 0.5,
        "Fraction of the angle to the wind by which each CV turns the rest of its curve: 0 leaves the curves alone, 1 \
         lays them along the wind.").soft(0.0, 1.0);
    RAMP_ROTATE: Param<Arc<Ramp>> = Param::ramp("ramp_rotate", &[[0.0, 1.0]],
        "Scales the turn along the curve, from root (0) to tip (1). Lower values near the root make a stiff base.");
    MODE: Param<Mode> = Param::choice("mode", Mode::Paper, "How the turn is distributed along the curve.");
    REFERENCE_SEGMENTS: Param<i64> = Param::int("reference_segments", 4,
        "In `resolution_free` mode every curve bends like one with this number of segments in `paper` mode.")
        .within(1.0, 10_000.0).soft(1.0, 32.0).when(|params| params.get(MODE) == Mode::ResolutionFree);
    BLEND: Param<Maskable> = Param::maskable("blend", 1.0,
        "How much of each segment's turn is applied: 0 leaves the curves alone, 1 applies the whole wind. Lengths are \
         kept at any value.").within(0.0, 1.0);
    SEED: Param<Seed> = Param::seed("Each seed gives another noise pattern.").when(has_noise);
    GROUP: Param<Name> = group::param();
    CLUMP: Param<Name> = clump::NAME;
    CLUMP_RADIUS: Param<f32> = clump::RADIUS;
    CLUMP_BLEND: Param<Maskable> = clump::BLEND;
}

const OUT: Output = Output::like("curves", &CURVES, "The bent curves. Lengths and roots are unchanged.");

metrics! { METRICS:
    MAX_ANGLE = Metric::new("max_angle", Unit::Radians, "The largest angle by which a segment was turned.");
    LENGTH_ERROR = Metric::length_error();
    EMPTY_GROUP = group::EMPTY;
}

pub(crate) static NODE: Node = Node::new(
    "Curve_Wind",
    2,
    "Bends curves in the wind, root to tip, without stretching them. Each CV turns the rest of its curve towards the \
     wind. Noise, which moves downwind, varies the wind's direction from place to place. An `envelope` on the CVs (1 if \
     missing) scales the wind, and `gust_dir` is added to its direction. Curve_Wind_Gusts writes both, \
     Curve_Wind_Shielding `envelope`.",
    Cook::Frame { cook, reads_clock: |params| has_noise(params) && params.get(SCROLL) != 0.0 },
)
.inputs(INPUTS)
.params(PARAMS)
.outputs(&[&OUT])
.reads(&[&P, &ENVELOPE, &PREF, &GUST_DIR])
.reads_if_there(&[&GUST_DIR])
.writes(&[&P])
.attributes(|params| group::attributes(params, &[GROUP, CLUMP]))
.metrics(METRICS)
.neutral(|params, _| match params {
    _ if params.get(GLOBAL_ROTATE).value == 0.0 => Some("`global_rotate` is 0"),
    _ if params.get(BLEND).value == 0.0 => Some("`blend` is 0"),
    _ => None,
})
.leaves_out(|params, _| match params {
    _ if !has_kind(params) => vec![LeftOut::new("noise", "`noise` is \"none\"")],
    _ if !has_noise(params) => vec![LeftOut::new("noise", "`amplitude` is 0")],
    _ => Vec::new(),
})
.integrates(|params| direction(params).map(|x| x * params.get(SCROLL)));

fn cook(cx: &FrameCx) -> Result<Outputs> {
    let mut curves = cx.edit(CURVES);
    let field = cx.get(NOISE).filter(|_| has_noise(cx.params()));
    let field =
        field.map(|kind| Field::new(kind, cx.get(OCTAVES) as u32, cx.get(ROUGHNESS), u64::from(cx.get(SEED).0)));
    let roots = if field.is_some() { noise_roots(cx, &curves)? } else { None };
    let scroll = Scroll::at(cx);
    let noise = |field| -> Result<BendNoise<'_>> {
        Ok(BendNoise {
            field,
            amplitude: cx.mask(AMPLITUDE, &curves)?,
            frequency: cx.get(FREQUENCY),
            waviness: cx.mask(WAVINESS, &curves)?,
            origin: scroll.origin,
            other: scroll.other,
            roots: roots.as_deref(),
        })
    };
    let rotate = cx.mask(GLOBAL_ROTATE, &curves)?;
    let group = Group::of(&cx.get(GROUP), &curves)?;
    cx.publish(EMPTY_GROUP, group::is_empty(group.as_ref()));
    let factors = group.map(|group| group.factors(rotate));
    let bent = bend(
        curves.runs().starts(),
        curves.positions(),
        &Bend {
            wind: direction(cx.params()).map(|x| x as f32),
            rotate: group::masked(rotate, factors.as_deref()),
            envelope: curves.get(ENVELOPE),
            ramp: &cx.get(RAMP_ROTATE),
            mode: match cx.get(MODE) {
                Mode::Paper => BendMode::Paper,
                Mode::ResolutionFree => {
                    BendMode::ResolutionFree { reference_segments: cx.get(REFERENCE_SEGMENTS) as f32 }
                }
            },
            blend: cx.mask(BLEND, &curves)?,
            noise: field.as_ref().map(noise).transpose()?,
            // Without shear it is 0 everywhere, which need not be read at each CV.
            gusts: gust_dir(&curves),
        },
    );
    cx.publish(MAX_ANGLE, f64::from(bent.max_angle));
    cx.publish(LENGTH_ERROR, f64::from(bent.length_error));
    curves.set(P, bent.points)?;
    Ok(OUT.with(curves))
}

/// The wind's direction, of length 1.
fn direction(params: &Params) -> [f64; 3] {
    unit_direction(params.get(WIND_DIR))
}

fn has_kind(params: &Params) -> bool {
    params.get(NOISE).is_some()
}

fn has_noise(params: &Params) -> bool {
    has_kind(params) && params.get(AMPLITUDE).value != 0.0
}

fn rest_from_start(params: &Params) -> bool {
    has_noise(params) && params.get(NOISE_SPACE) == Space::Rest
}

fn finds_clumps(params: &Params) -> bool {
    has_noise(params) && clump::reads_start(params)
}

/// The offset from a root to its position in the noise: the scene's origin minus the distance that the pattern has
/// moved downwind.
struct Scroll {
    origin: [f64; 3],
    /// The same a loop before, and its share.
    other: Option<([f64; 3], f32)>,
}

impl Scroll {
    fn at(cx: &FrameCx) -> Self {
        let from = |moved: [f64; 3]| std::array::from_fn(|axis| cx.origin()[axis] - moved[axis]);
        let ticks = (cx.get(LOOP) * Frame::TICKS as f64).round() as i64;
        if ticks == 0 {
            return Self { origin: from(cx.integral(cx.frame())), other: None };
        }
        let passed = cx.frame().ticks().rem_euclid(ticks);
        let [now, before] = [passed, passed - ticks].map(|ticks| from(moved(cx, Frame::whole(0).plus_ticks(ticks))));
        Self { origin: now, other: Some((before, (passed as f64 / ticks as f64) as f32)) }
    }
}

/// ∫ `scroll` · wind dt from frame 0 to `upto`. After the frame that is cooked, which is asked for before frame 0 alone,
/// scroll and wind are taken as they are then.
fn moved(cx: &FrameCx, upto: Frame) -> [f64; 3] {
    let now = cx.frame().max(Frame::whole(0));
    if upto <= now {
        return cx.integral(upto);
    }
    let ([speed], since) = (cx.integrands(cx.frame().number()), cx.integral(now));
    let seconds = upto.seconds(cx.fps()) - now.seconds(cx.fps());
    std::array::from_fn(|axis| since[axis] + speed[axis] * seconds)
}

/// Where each curve's noise is sampled, if not at its current root.
fn noise_roots(cx: &FrameCx, curves: &Component) -> Result<Option<Vec<[f32; 3]>>> {
    let start = finds_clumps(cx.params()).then(|| cx.part_at_start(CURVES));
    let (rest, clumps) = (rest_roots(cx, curves)?, clump::of(cx.params(), curves, start)?);
    let Some(clumps) = clumps else { return Ok(rest) };
    let share = cx.mask(CLUMP_BLEND, curves)?;
    let mut roots = rest.unwrap_or_else(|| clump::roots(curves).as_slice().to_vec());
    let ways = clumps.to_means(&roots);
    for ((cvs, root), way) in curves.runs().ranges().zip(&mut roots).zip(&ways) {
        if !cvs.is_empty() {
            *root = drawn(*root, way, share.at(cvs.start));
        }
    }
    Ok(Some(roots))
}

/// Where the curves' roots are at rest, if that is where noise is sampled.
fn rest_roots(cx: &FrameCx, curves: &Component) -> Result<Option<Vec<[f32; 3]>>> {
    if !rest_from_start(cx.params()) {
        return Ok(None);
    }
    let or_else = "give the curves a `Pref`, or set `noise_space` to \"world\"";
    let rest = cx.at_rest(CURVES, curves).map_err(|error| error.hint(or_else))?;
    Ok(Some(curves.runs().ranges().map(|cvs| rest[cvs.start]).collect()))
}

#[cfg(test)]
mod tests;
