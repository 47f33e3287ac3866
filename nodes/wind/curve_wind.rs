//! Curve_Wind: wind bends curves, root to tip.
//!
//! W2. At each CV the rest of the curve turns about it, from the direction of its current tip towards the wind plus
//! noise; the angle is scaled by `global_rotate`, `ramp_rotate` (along the curve) and the CV's `envelope`. Noise is
//! sampled at the root, moved along the wind by the arc length × `waviness`.
//!
//! Departures:
//! * Noise moves **downwind** with time, by ∫ `scroll` · wind dt: W scrolls nothing, and moving it with the frame would
//!   jump where speed or direction are keyed.
//! * A curve of n segments bends more than one of n/2: `resolution_free` takes a share of the angle a length instead.
//! * `blend` turns each segment back towards where it came from, so that half a wind keeps lengths too.

use engine::prelude::*;
use numerics::bend::{Bend, BendNoise, Mode as BendMode, bend};
use numerics::noise::{Field, Kind as NoiseKind};
use numerics::ramp::Ramp;
use std::sync::Arc;

choice! {
    /// What varies the wind's direction.
    pub enum Noise {
        None = "none": "the wind is the same everywhere",
        Perlin = "perlin": "smooth, in all sizes from a gust to a flutter",
        Billow = "billow": "rounded swells with creases between them",
        Wavelet = "wavelet": "each octave keeps to its own size, so detail does not shimmer",
    }
}

choice! {
    /// Where noise is sampled.
    pub enum Space {
        World = "world": "where the root is now, so a moving animal runs through the pattern",
        Rest = "rest": "where the root was at rest, so the pattern sticks to a moving animal: `Pref` of the root where \
                the curves have it, else its place at the scene's first frame",
    }
}

choice! {
    /// How the angle is shared out along the curve.
    pub enum Mode {
        Paper = "paper": "every CV turns by the same share, so more CVs bend more",
        ResolutionFree = "resolution_free": "the bend is the same for any number of CVs, as `reference_segments` \
                segments of the paper's mode; a share of 1 or more lies along the wind at once",
    }
}

inputs! { INPUTS:
    CURVES: Input = Input::one("curves", Kind::Curves, "The curves, root first. Their `envelope` scales the wind CV by CV.")
        .read_at(|params| if rest_from_start(params) { Times::NOW.and(Times::START) } else { Times::NOW });
}

params! { PARAMS:
    WIND_DIR: Param<[f64; 3]> = Param::direction("wind_dir", [1.0, 0.0, 0.0],
        "Where the wind blows to. Its length does not matter.").history();
    NOISE: Param<Noise> = Param::choice("noise", Noise::Perlin, "What varies the wind's direction from place to place.");
    AMPLITUDE: Param<f32> = Param::float("amplitude", 0.5,
        "How far noise turns the wind: 0 leaves it straight, 1 makes noise as strong as the wind.")
        .at_least(0.0).soft(0.0, 2.0).when(has_kind);
    FREQUENCY: Param<f64> = Param::double("frequency", 2.0,
        "How fine the noise is: its largest swirls are about one over this across.")
        .unit(Unit::PerMetre).at_least(0.0).soft(0.1, 20.0).when(has_noise);
    OCTAVES: Param<i64> = Param::int("octaves", 2, "Sizes of swirls, each half as large as the one before.")
        .within(1.0, 16.0).soft(1.0, 4.0).when(has_noise);
    ROUGHNESS: Param<f32> = Param::float("roughness", 0.5,
        "How strong each smaller size is: 0 leaves only the largest, 1 makes all equally strong.")
        .within(0.0, 1.0).when(|params| has_noise(params) && params.get(OCTAVES) > 1);
    SCROLL: Param<f64> = Param::double("scroll", 1.0,
        "How fast the pattern of noise moves downwind. 0 holds it still.")
        .unit(Unit::MetresPerSecond).soft(-10.0, 10.0).history().when(has_noise);
    NOISE_SPACE: Param<Space> = Param::choice("noise_space", Space::World,
        "Whether the pattern of noise stays in the world or on the animal.").when(has_noise);
    WAVINESS: Param<f32> = Param::float("waviness", 0.0,
        "How far along the wind noise is sampled, as a share of the arc length from the root: 0 bends a curve as one, \
         1 and more make waves run through it.")
        .soft(0.0, 4.0).when(has_noise);
    GLOBAL_ROTATE: Param<Masked> = Param::masked("global_rotate", 0.5,
        "Share of the angle to the wind by which each CV turns the rest of the curve: 0 leaves the curves alone, 1 lays \
         them along the wind.").soft(0.0, 1.0);
    RAMP_ROTATE: Param<Arc<Ramp>> = Param::ramp("ramp_rotate", &[[0.0, 1.0]],
        "Scales the turn along the curve, from root (0) to tip (1): less at the root makes a stiff base.");
    MODE: Param<Mode> = Param::choice("mode", Mode::Paper, "How the turn is shared out along the curve.");
    REFERENCE_SEGMENTS: Param<i64> = Param::int("reference_segments", 4,
        "Segments of a curve that bends as much in the paper's mode.")
        .within(1.0, 10_000.0).soft(1.0, 32.0).when(|params| params.get(MODE) == Mode::ResolutionFree);
    BLEND: Param<Masked> = Param::masked("blend", 1.0,
        "Share of each segment's turn that is kept: 0 leaves the curves alone, 1 is the whole wind. Lengths are kept at \
         any value.").within(0.0, 1.0);
    SEED: Param<Seed> = Param::seed("Picks another pattern of noise.").when(has_noise);
}

const OUT: Output = Output::like("curves", &CURVES, "The curves, bent. Lengths and roots are kept.");

const MAX_ANGLE: Metric = Metric::new("max_angle", Unit::Radians, "The largest turn of a segment.");
const LENGTH_ERROR: Metric =
    Metric::new("length_error", Unit::None, "The largest change of a length, as a share of the curve's length.");

/// See the module.
pub static NODE: Node = Node::new(
    "Curve_Wind",
    1,
    "Wind bends curves, root to tip, without stretching them. Each CV turns the rest of its curve towards the wind, which \
     noise varies from place to place and carries downwind. An `envelope` on the CVs, 1 where it is missing, scales the \
     wind: gusts and shielding write it.",
    Cook::Frame { cook, reads_clock: |params| has_noise(params) && params.get(SCROLL) != 0.0 },
)
.inputs(INPUTS)
.params(PARAMS)
.outputs(&[&OUT])
.reads(&[&P, &ENVELOPE, &PREF])
.writes(&[&P])
.metrics(&[&MAX_ANGLE, &LENGTH_ERROR])
.leaves_out(leaves_out)
.integrates(|params| direction(params).map(|x| x * params.get(SCROLL)));

fn cook(cx: &FrameCx) -> Result<Outputs> {
    let mut out = cx.input(CURVES).clone();
    let curves = cx.part(CURVES);
    let (rotate, rotate_mask) = cx.mask(GLOBAL_ROTATE, curves)?;
    let (blend, blend_mask) = cx.mask(BLEND, curves)?;
    if rotate == 0.0 || blend == 0.0 {
        return still(cx, out);
    }
    let field = noise_kind(cx.params())
        .map(|kind| Field::new(kind, cx.get(OCTAVES) as u32, cx.get(ROUGHNESS), u64::from(cx.get(SEED).0)));
    let roots = if field.is_some() { noise_roots(cx, curves)? } else { None };
    let ramp = cx.get(RAMP_ROTATE);
    let bent = bend(
        curves.runs().starts(),
        curves.positions(),
        &Bend {
            wind: direction(cx.params()).map(|x| x as f32),
            rotate,
            rotate_mask,
            envelope: curves.get(ENVELOPE),
            ramp: &ramp,
            mode: match cx.get(MODE) {
                Mode::Paper => BendMode::Paper,
                Mode::ResolutionFree => {
                    BendMode::ResolutionFree { reference_segments: cx.get(REFERENCE_SEGMENTS) as f32 }
                }
            },
            blend,
            blend_mask,
            noise: field.as_ref().map(|field| BendNoise {
                field,
                amplitude: cx.get(AMPLITUDE),
                frequency: cx.get(FREQUENCY),
                waviness: cx.get(WAVINESS),
                origin: noise_origin(cx),
                roots: roots.as_deref(),
            }),
        },
    );
    cx.publish(MAX_ANGLE, f64::from(bent.max_angle));
    cx.publish(LENGTH_ERROR, f64::from(bent.length_error));
    out.part_mut(Kind::Curves).expect("the engine refuses a wire without curves").set(P, bent.points)?;
    Ok(OUT.with(out))
}

/// Nothing turns: the curves go through as they are.
fn still(cx: &FrameCx, out: Geometry) -> Result<Outputs> {
    cx.publish(MAX_ANGLE, 0.0);
    cx.publish(LENGTH_ERROR, 0.0);
    Ok(OUT.with(out))
}

/// The wind's direction, of length 1. Its numbers are brought near 1 first, so that any length will do.
fn direction(params: &Params) -> [f64; 3] {
    let v = params.get(WIND_DIR);
    let largest = v.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    let v = v.map(|x| x / largest);
    let length = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    v.map(|x| x / length)
}

fn has_kind(params: &Params) -> bool {
    params.get(NOISE) != Noise::None
}

fn has_noise(params: &Params) -> bool {
    has_kind(params) && params.get(AMPLITUDE) != 0.0
}

fn rest_from_start(params: &Params) -> bool {
    has_noise(params) && params.get(NOISE_SPACE) == Space::Rest
}

fn noise_kind(params: &Params) -> Option<NoiseKind> {
    match params.get(NOISE) {
        _ if !has_noise(params) => None,
        Noise::None => None,
        Noise::Perlin => Some(NoiseKind::Perlin),
        Noise::Billow => Some(NoiseKind::Billow),
        Noise::Wavelet => Some(NoiseKind::Wavelet),
    }
}

/// What is added to a root to find its noise: the scene's origin, less how far the pattern has moved downwind.
fn noise_origin(cx: &FrameCx) -> [f64; 3] {
    let moved = cx.integral(cx.frame());
    std::array::from_fn(|axis| cx.origin()[axis] - moved[axis])
}

/// Where each curve's noise is sampled, if not at its root as it is now.
fn noise_roots(cx: &FrameCx, curves: &Component) -> Result<Option<Vec<[f32; 3]>>> {
    if !rest_from_start(cx.params()) {
        return Ok(None);
    }
    let rest = match curves.get(PREF) {
        Some(rest) => rest,
        None => {
            let start = cx.at_start(CURVES).curves().expect("the engine refuses a wire without curves");
            if start.runs() != curves.runs() {
                return Err(Error::refused(
                    "`noise_space` is \"rest\", but the curves are not those of the first frame",
                )
                .hint("give the curves a `Pref`, or use \"world\""));
            }
            start.positions()
        }
    };
    Ok(Some(curves.runs().ranges().map(|cvs| rest[cvs.start]).collect()))
}

fn leaves_out(params: &Params, _: &Wires) -> Vec<LeftOut> {
    let rotate = params.get(GLOBAL_ROTATE).value;
    if rotate == 0.0 {
        return vec![LeftOut::new("all", "`global_rotate` is 0")];
    }
    if params.get(BLEND).value == 0.0 {
        return vec![LeftOut::new("all", "`blend` is 0")];
    }
    match params.get(NOISE) {
        Noise::None => vec![LeftOut::new("noise", "`noise` is \"none\"")],
        _ if !has_noise(params) => vec![LeftOut::new("noise", "`amplitude` is 0")],
        _ => Vec::new(),
    }
}
