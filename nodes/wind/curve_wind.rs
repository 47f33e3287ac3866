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
//! * `blend` scales each segment's turn instead of mixing positions, so that a partial wind keeps lengths too.

use crate::shared::direction::unit_direction;
use crate::shared::group::{self, Group};
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
        World = "world": "at the root's current position, so a moving animal passes through the pattern",
        Rest = "rest": "at the root's rest position, so the pattern sticks to a moving animal: `Pref` of the root if \
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
        .read_at(|params| if rest_from_start(params) { Times::NOW.and(Times::START) } else { Times::NOW });
}

params! { PARAMS:
    WIND_DIR: Param<[f64; 3]> = Param::direction("wind_dir", [1.0, 0.0, 0.0],
        "The direction that the wind blows towards. Its length does not matter.").history();
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
    NOISE_SPACE: Param<Space> = Param::choice("noise_space", Space::World,
        "Whether the noise pattern stays in the world or sticks to the animal.").when(has_noise);
    WAVINESS: Param<f32> = Param::float("waviness", 0.0,
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
}

const OUT: Output = Output::like("curves", &CURVES, "The bent curves. Lengths and roots are unchanged.");

metrics! { METRICS:
    MAX_ANGLE = Metric::new("max_angle", Unit::Radians, "The largest angle by which a segment was turned.");
    LENGTH_ERROR = Metric::length_error();
}

pub(crate) static NODE: Node = Node::new(
    "Curve_Wind",
    2,
    "Bends curves in the wind, root to tip, without stretching them. Each CV turns the rest of its curve towards the \
     wind. Noise, which moves downwind, varies the wind's direction from place to place. An `envelope` on the CVs (1 \
     if missing) scales the wind; gusts and shielding write it.",
    Cook::Frame { cook, reads_clock: |params| has_noise(params) && params.get(SCROLL) != 0.0 },
)
.inputs(INPUTS)
.params(PARAMS)
.outputs(&[&OUT])
.reads(&[&P, &ENVELOPE, &PREF])
.writes(&[&P])
.attributes(|params| group::attributes(params, GROUP))
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
    let noise = |field| -> Result<BendNoise<'_>> {
        Ok(BendNoise {
            field,
            amplitude: cx.mask(AMPLITUDE, &curves)?,
            frequency: cx.get(FREQUENCY),
            waviness: cx.get(WAVINESS),
            origin: noise_origin(cx),
            roots: roots.as_deref(),
        })
    };
    let rotate = cx.mask(GLOBAL_ROTATE, &curves)?;
    let factors = Group::of(&cx.get(GROUP), &curves)?.map(|group| group.factors(rotate));
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

/// The offset from a root to its position in the noise: the scene's origin minus the distance that the pattern has
/// moved downwind.
fn noise_origin(cx: &FrameCx) -> [f64; 3] {
    let moved = cx.integral(cx.frame());
    std::array::from_fn(|axis| cx.origin()[axis] - moved[axis])
}

/// Where each curve's noise is sampled, if not at its current root.
fn noise_roots(cx: &FrameCx, curves: &Component) -> Result<Option<Vec<[f32; 3]>>> {
    if !rest_from_start(cx.params()) {
        return Ok(None);
    }
    let rest = match curves.get(PREF) {
        Some(rest) => rest,
        None => {
            let start = cx.part_at_start(CURVES);
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

#[cfg(test)]
mod tests {
    use super::*;
    use conformance::{Bench, BenchResult, bench, conforms};
    use engine::graph::Scene;
    use numerics::vector;

    /// A straight curve up from the origin, of `segments` segments and length 1.
    fn upright(segments: usize) -> Geometry {
        let cv = |k: usize| [0.0, k as f32 / segments as f32, 0.0];
        Component::curves(vec![segments as u32 + 1], (0..=segments).map(cv).collect()).unwrap().into()
    }

    /// A field of upright curves, a metre apart.
    fn field(n: usize) -> Geometry {
        let cvs = (0..n * n).flat_map(|i| (0..5).map(move |k| [(i % n) as f32, 0.25 * k as f32, (i / n) as f32]));
        Component::curves(vec![5; n * n], cvs.collect()).unwrap().into()
    }

    fn calm(curves: Geometry) -> Bench {
        bench(&NODE).input(CURVES, curves).set(NOISE, None)
    }

    /// Angle of each segment of the first curve to the wind along x, radians.
    fn angles(out: &BenchResult) -> Vec<f64> {
        let cvs = &out.curves().positions()[out.curves().runs().range(0)];
        let angle = |pair: &[[f32; 3]]| {
            let d: [f64; 3] = std::array::from_fn(|k| f64::from(pair[1][k]) - f64::from(pair[0][k]));
            libm::atan2((d[1] * d[1] + d[2] * d[2]).sqrt(), d[0])
        };
        cvs.windows(2).map(angle).collect()
    }

    #[test]
    fn conforms_to_its_declaration() {
        conforms(&NODE);
    }

    const RIGHT: f64 = std::f64::consts::FRAC_PI_2;

    #[test]
    fn the_angle_of_segment_k_is_multiplied_by_one_minus_g_to_the_k() {
        // W2 by hand: at every CV the rest of a straight curve turns by g times the remaining angle, so segment k = 1…
        // has 90° · (1 − g)^k: 45, 22.5, 11.25, 5.625 for g = ½.
        let out = calm(upright(4)).set(GLOBAL_ROTATE, 0.5.into()).cook();
        for (k, angle) in angles(&out).iter().enumerate() {
            let left = RIGHT / f64::from(2 << k);
            assert!((angle - left).abs() < 4e-6, "segment {}: {angle} rad, expected {left}", k + 1);
        }
        assert!((out.metrics["max_angle"] - (RIGHT - RIGHT / 16.0)).abs() < 4e-6);
        assert!(out.metrics["length_error"] < 1e-6);
    }

    #[test]
    fn resolution_free_bends_the_same_for_any_number_of_cvs() {
        let tip = |segments: usize| {
            let out = calm(upright(segments)).set(MODE, Mode::ResolutionFree).cook();
            out.curves().positions()[segments]
        };
        let fine = tip(1024);
        let [coarse, finer] = [8, 16].map(|segments| vector::length(vector::sub(tip(segments), fine)));
        assert!(coarse < 1e-2, "{coarse}");
        assert!((3.0..5.0).contains(&(coarse / finer)), "order 2: {coarse} to {finer}");
    }

    #[test]
    fn the_envelope_scales_the_turn_and_counts_as_one_if_missing() {
        let with = |envelope: f32| {
            let mut curves = upright(1);
            curves.part_mut(Kind::Curves).unwrap().set(ENVELOPE, vec![envelope; 2]).unwrap();
            angles(&calm(curves).cook())[0]
        };
        assert!((with(0.5) - RIGHT * 0.75).abs() < 1e-6);
        assert_eq!(with(0.0), RIGHT);
        assert_eq!(with(-3.0), RIGHT, "an envelope below 0 counts as 0");
        assert_eq!(with(1.0), angles(&calm(upright(1)).cook())[0]);
    }

    #[test]
    fn masks_scale_per_cv_and_missing_ones_are_refused() {
        let mut curves = upright(1);
        curves.part_mut(Kind::Curves).unwrap().set(Attr::<f32>::point("soft"), vec![0.5, 1.0]).unwrap();
        let masked = Maskable { value: 0.5, attribute: Some("soft".into()) };
        let out = calm(curves).set(GLOBAL_ROTATE, masked.clone()).cook();
        assert!((angles(&out)[0] - RIGHT * 0.75).abs() < 1e-6);
        let error = calm(upright(1)).set(GLOBAL_ROTATE, masked.clone()).try_cook().unwrap_err();
        assert_eq!(error.fact, "`global_rotate` is masked by `soft`, which the curves do not have");
        let mut curves = upright(1);
        curves.part_mut(Kind::Curves).unwrap().set(Attr::<[f32; 3]>::element("soft"), vec![[0.5; 3]]).unwrap();
        let error = calm(curves).set(GLOBAL_ROTATE, masked).try_cook().unwrap_err();
        assert_eq!(
            error.to_string(),
            "`global_rotate` is masked by `soft`, which is one float3 for each curve; expected one float for each CV"
        );
    }

    /// A mask of whole numbers, of each CV or of each curve, is that of the floats with these values.
    #[test]
    fn a_mask_may_be_whole_numbers_or_numbers_of_curves() {
        let with = |set: &dyn Fn(&mut Component)| {
            let mut curves = field(2);
            set(curves.part_mut(Kind::Curves).unwrap());
            let masked = Maskable { value: 0.5, attribute: Some("soft".into()) };
            calm(curves).set(GLOBAL_ROTATE, masked).cook().curves().positions().to_vec()
        };
        let of = |curve: usize| [0.0_f32, 1.0, 2.0, 0.5][curve];
        let floats = with(&|curves| curves.set(Attr::point("soft"), (0..20).map(|cv| of(cv / 5)).collect()).unwrap());
        let curves = with(&|curves| curves.set(Attr::element("soft"), (0..4).map(of).collect()).unwrap());
        assert_eq!(floats, curves);
        let ones =
            with(&|curves| curves.set(Attr::point("soft"), (0..20).map(|cv| of(cv / 5).floor()).collect()).unwrap());
        let whole = |count: usize| (0..count).map(|row| of(row * 4 / count) as i32).collect::<Vec<i32>>();
        assert_eq!(ones, with(&|curves| curves.set(Attr::point("soft"), whole(20)).unwrap()));
        assert_eq!(ones, with(&|curves| curves.set(Attr::element("soft"), whole(4)).unwrap()));
        assert_ne!(ones, floats);
    }

    /// Curves of the group bend as without one; the others keep their bits, and so does the part of a curve before its first
    /// CV in the group.
    #[test]
    fn outside_a_group_curves_keep_their_bits() {
        let mut curves = field(3);
        let part = curves.part_mut(Kind::Curves).unwrap();
        part.set(Attr::<i32>::element("third"), (0..9).map(|curve| curve % 3).collect()).unwrap();
        part.set(Attr::<f32>::point("tips"), (0..45).map(|cv| if cv % 5 >= 2 { 0.5 } else { 0.0 }).collect()).unwrap();
        let windy = |name: &str| bench(&NODE).input(CURVES, curves.clone()).set(GROUP, name.into()).cook();
        let at = |out: &BenchResult, cv: usize| out.curves().positions()[cv].map(f32::to_bits);
        let (still, all, third) = (curves.curves().unwrap().positions(), windy(""), windy("third"));
        for (cv, still) in still.iter().enumerate() {
            let expected = if cv / 5 % 3 == 0 { still.map(f32::to_bits) } else { at(&all, cv) };
            assert_eq!(at(&third, cv), expected, "CV {cv}");
        }
        let tips = windy("tips");
        for (cv, still) in still.iter().enumerate() {
            assert_eq!(at(&tips, cv) == still.map(f32::to_bits), cv % 5 <= 2, "CV {cv}");
        }
        assert!(tips.metrics["length_error"] < 1e-6);
    }

    /// Where the mask is 0 the wind blows straight, where it is 1 as without a mask.
    #[test]
    fn a_mask_scales_the_noise_where_it_is() {
        let with = |amplitude: f32, mask: Option<fn(usize) -> f32>| {
            let mut curves = field(2);
            let part = curves.part_mut(Kind::Curves).unwrap();
            let attribute = mask.map(|mask| {
                part.set(Attr::element("noisy"), (0..4).map(mask).collect()).unwrap();
                Name::from("noisy")
            });
            let bench = bench(&NODE).input(CURVES, curves).set(AMPLITUDE, Maskable { value: amplitude, attribute });
            bench.cook().curves().positions().to_vec()
        };
        let (straight, noisy) = (with(0.0, None), with(0.8, None));
        let mixed = with(0.8, Some(|curve| (curve % 2) as f32));
        for curve in 0..4 {
            let expected = if curve % 2 == 0 { &straight } else { &noisy };
            assert_eq!(mixed[curve * 5..][..5], expected[curve * 5..][..5], "curve {curve}");
            assert_ne!(straight[curve * 5 + 4], noisy[curve * 5 + 4]);
        }
    }

    #[test]
    fn half_blend_is_half_the_turn_and_keeps_lengths() {
        let whole = angles(&calm(upright(4)).cook());
        let out = calm(upright(4)).set(BLEND, 0.5.into()).cook();
        for (half, whole) in angles(&out).iter().zip(whole) {
            assert!((RIGHT - half - 0.5 * (RIGHT - whole)).abs() < 4e-6);
        }
        assert!(out.metrics["length_error"] < 1e-6);
    }

    #[test]
    fn without_a_turn_the_same_arrays_pass_through() {
        let curves = field(2);
        for share in [GLOBAL_ROTATE, BLEND] {
            let out = bench(&NODE).input(CURVES, curves.clone()).set(share, 0.0.into()).cook();
            let column = |part: &Component| part.table(Owner::Point).column("P").unwrap().address();
            assert_eq!(column(out.curves()), column(curves.curves().unwrap()));
        }
    }

    #[test]
    fn noise_scrolls_downwind() {
        // After a second at 2 m/s, the noise that was at x is at x + 2: curve 2 bends as curve 0 did.
        let windy = bench(&NODE).input(CURVES, field(4)).set(SCROLL, 2.0);
        let shape = |out: &BenchResult, curve: usize| {
            let cvs = &out.curves().positions()[out.curves().runs().range(curve)];
            cvs.iter().map(|cv| vector::sub(*cv, cvs[0])).collect::<Vec<_>>()
        };
        let (early, late) = (windy.clone().at(10.0).cook(), windy.at(34.0).cook());
        for (a, b) in shape(&early, 0).iter().zip(shape(&late, 2)) {
            assert!((0..3).all(|k| (a[k] - b[k]).abs() < 1e-5), "{a:?} {b:?}");
        }
        assert_ne!(shape(&early, 0), shape(&late, 0));
    }

    #[test]
    fn a_keyed_scroll_does_not_jump() {
        // From 1 to 100 m/s within a frame: the pattern must not move farther than its speed allows.
        let windy =
            bench(&NODE).input(CURVES, field(3)).set(FREQUENCY, 0.001).keyed(SCROLL, &[(10.0, 1.0), (11.0, 100.0)]);
        let frames = windy.frames(8..=14);
        let moved = |pair: &[BenchResult]| {
            let points = pair.iter().map(|out| out.curves().positions()).collect::<Vec<_>>();
            points[0].iter().zip(points[1]).map(|(a, b)| (a[0] - b[0]).abs()).fold(0.0, f32::max)
        };
        // 100 m/s × 1/24 s × 0.001 cells a metre is 0.004 cells; the field's slope is below 4 a cell.
        assert!(frames.windows(2).map(moved).fold(0.0, f32::max) < 0.02);
    }

    #[test]
    fn frames_cooked_alone_have_the_same_bits() {
        let windy = bench(&NODE)
            .input(CURVES, field(5))
            .keyed(WIND_DIR, &[(1.0, [1.0, 0.0, 0.0]), (20.0, [0.0, 0.2, 1.0])])
            .keyed(SCROLL, &[(1.0, 0.5), (20.0, 3.0)]);
        let bits = |out: &BenchResult| out.curves().table(Owner::Point).column("P").unwrap().to_bytes();
        let in_order = windy.frames(1..=20);
        for frame in [20_i64, 7, 13, 1] {
            let alone = windy.clone().threads(if frame == 7 { 1 } else { 7 }).at(frame as f64).cook();
            assert_eq!(bits(&alone), bits(&in_order[frame as usize - 1]), "frame {frame}");
        }
    }

    #[test]
    fn rest_noise_sticks_to_a_moving_animal() {
        let moving = |frame: Frame| {
            let mut curves = field(3);
            for row in curves.part_mut(Kind::Curves).unwrap().edit(P).unwrap() {
                row[0] += 0.37 * (frame.number() - 1.0) as f32;
            }
            curves
        };
        let windy = bench(&NODE).moving(CURVES, moving).set(SCROLL, 0.0);
        let bend = |space: Space, frame: f64| {
            let out = windy.clone().set(NOISE_SPACE, space).at(frame).cook();
            let cvs = out.curves().positions();
            [cvs[4][0] - cvs[0][0], cvs[4][1] - cvs[0][1]]
        };
        let close = |a: [f32; 2], b: [f32; 2]| (a[0] - b[0]).abs() < 1e-5 && (a[1] - b[1]).abs() < 1e-5;
        assert!(close(bend(Space::Rest, 1.0), bend(Space::Rest, 9.0)));
        assert!(!close(bend(Space::World, 1.0), bend(Space::World, 9.0)));
    }

    #[test]
    fn the_origin_of_the_scene_moves_the_noise_only() {
        let windy = bench(&NODE).input(CURVES, field(2));
        let at = |origin: [f64; 3], shift: f32| {
            let mut curves = field(2);
            curves.part_mut(Kind::Curves).unwrap().edit(P).unwrap().iter_mut().for_each(|row| row[0] += shift);
            let scene = Scene { origin, ..Scene::default() };
            let out = bench(&NODE).input(CURVES, curves).scene(scene).cook();
            out.curves().positions().iter().map(|row| [row[0] - shift, row[1], row[2]]).collect::<Vec<_>>()
        };
        let (near, far) = (at([0.0; 3], 8.0), at([8.0, 0.0, 0.0], 0.0));
        assert!(near.iter().zip(&far).all(|(a, b)| (0..3).all(|k| (a[k] - b[k]).abs() < 2e-6)));
        assert_ne!(windy.cook().curves().positions(), far);
    }

    #[test]
    fn wind_of_any_length_and_wind_against_the_curve_give_finite_results() {
        for wind in [[1e-300, 0.0, 0.0], [1e300, 1e300, 0.0], [0.0, -1.0, 0.0], [0.0, 1.0, 0.0]] {
            let out = calm(upright(4)).set(WIND_DIR, wind).cook();
            assert!(out.curves().positions().as_flattened().iter().all(|x| x.is_finite()), "{wind:?}");
            assert!(out.metrics["length_error"] < 1e-5);
        }
        let error = calm(upright(1)).set(WIND_DIR, [0.0; 3]).try_cook().unwrap_err();
        assert_eq!(error.fact, "`wind_dir` is [0, 0, 0], which has no direction");
    }

    #[test]
    fn empty_and_single_cv_curves_pass_through() {
        let none = Geometry::from(Component::curves(Vec::new(), Vec::new()).unwrap());
        assert_eq!(bench(&NODE).input(CURVES, none).cook().curves().point_count(), 0);
        let dots = Geometry::from(Component::curves(vec![1, 1], vec![[1.0; 3], [2.0; 3]]).unwrap());
        assert_eq!(bench(&NODE).input(CURVES, dots).cook().curves().positions(), [[1.0; 3], [2.0; 3]]);
    }
}
