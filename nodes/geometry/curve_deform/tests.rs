//! Properties of grooms that follow guides.

use super::*;
use conformance::{Bench, BenchResult, bench, conforms};
use curves::attach::attach_curves;
use numerics::trig::sin_cos;
use numerics::vector::rotation;

type Point = [f32; 3];

/// A floor of 4 by 4 squares of 0.25 m, facing up.
fn floor() -> Component {
    let points = (0..25_u8).map(|i| [0.25 * f32::from(i / 5), 0.0, 0.25 * f32::from(i % 5)]).collect();
    let corners = (0..16_u32).map(|i| i / 4 * 5 + i % 4).flat_map(|a| [a, a + 1, a + 6, a + 5]).collect();
    Component::mesh(vec![4; 16], corners, points).unwrap()
}

/// `n` by `n` curves of 5 CVs on the floor, 0.1 m long, that lean by `lean`, alternately to either side.
fn field(n: usize, lean: f32) -> Component {
    let curve = |i: usize| {
        let at = |k: usize| 0.08 + 0.84 * k as f32 / (n - 1).max(1) as f32;
        let root = [at(i / n), 0.0, at(i % n)];
        let lean = if i.is_multiple_of(2) { lean } else { -lean };
        let up = (1.0 - lean * lean).sqrt();
        (0..5).map(move |k| {
            let r = 0.025 * k as f32;
            [root[0], root[1] + r * up, root[2] + r * lean]
        })
    };
    Component::curves(vec![5; n * n], (0..n * n).flat_map(curve).collect()).unwrap()
}

fn moved(part: &Component, to: impl Fn(DVec3) -> DVec3) -> Component {
    let mut out = part.clone();
    out.edit(P).unwrap().iter_mut().for_each(|p| *p = to_f32(to(to_f64(*p))));
    out
}

/// Each curve turned about its root, about z.
fn turned(part: &Component, angle: f64) -> Component {
    let pose = RootPose { translation: DVec3::zeros(), rotation: rotation(DVec3::z(), angle), lost: false };
    let poses = vec![pose; part.element_count()];
    let mut out = part.clone();
    out.set(P, attach_curves(part.runs().starts(), part.positions(), &poses).points).unwrap();
    out
}

fn rigid(p: DVec3) -> DVec3 {
    rotation(DVec3::new(0.6, 0.0, 0.8), 1.2) * p + DVec3::new(1.0, 2.0, -1.0)
}

fn deform(curves: Component, guides: [Component; 2]) -> Bench {
    let [rest, now] = guides;
    bench(&NODE).input(CURVES, curves).input(REST_GUIDES, rest).input(GUIDES, now)
}

fn on_skin(curves: Component, guides: [Component; 2], skins: [Component; 2]) -> Bench {
    let [rest, now] = skins;
    deform(curves, guides).input(REST_SKIN, rest).input(SKIN, now)
}

fn apart(out: &BenchResult, expected: &Component) -> f64 {
    let pairs = out.curves().positions().iter().zip(expected.positions());
    pairs.map(|(a, b)| (to_f64(*a) - to_f64(*b)).amax()).fold(0.0, f64::max)
}

#[test]
fn conforms_to_its_declaration() {
    conforms(&NODE);
}

#[test]
fn guides_and_skin_at_rest_change_no_array() {
    let (curves, guides) = (field(12, 0.3), field(4, 0.0));
    let column = |part: &Component, name: &str| part.table(Owner::Point).column(name).unwrap().clone();
    for out in [
        deform(curves.clone(), [guides.clone(), guides.clone()]).cook(),
        on_skin(curves.clone(), [guides.clone(), guides.clone()], [floor(), floor()]).cook(),
    ] {
        assert!(column(out.curves(), "P").same(&column(&curves, "P")));
        assert!(column(out.curves(), "Pref").same(&column(&curves, "P")));
        assert_eq!((out.metrics["length_error"], out.metrics["kept_out"]), (0.0, 0.0));
    }
}

/// Where some guides turn, hairs that follow only guides at rest keep their bits.
#[test]
fn hairs_of_guides_at_rest_keep_their_bits() {
    let (curves, guides) = (field(12, 0.3), field(4, 0.0));
    let mut now = guides.clone();
    // Only the guides nearest to x = 0 turn.
    now.edit(P).unwrap()[..20].copy_from_slice(&turned(&guides, 0.7).positions()[..20]);
    let out = on_skin(curves.clone(), [guides, now], [floor(), floor()]).cook();
    let (before, after) = (curves.positions(), out.curves().positions());
    assert_eq!(before[5 * 90..], after[5 * 90..]);
    assert_ne!(before[..5 * 30], after[..5 * 30]);
}

#[test]
fn rigid_motion_of_guides_and_skin_is_rigid() {
    let (curves, guides) = (field(12, 0.3), field(4, 0.2));
    let now = moved(&guides, rigid);
    let expected = moved(&curves, rigid);
    let with = on_skin(curves.clone(), [guides.clone(), now.clone()], [floor(), moved(&floor(), rigid)]).cook();
    let without = deform(curves, [guides, now]).cook();
    for out in [with, without] {
        assert!(apart(&out, &expected) < 2e-6, "{}", apart(&out, &expected));
        // Segments of 0.025 m some 3 m from the origin: 4 ulp of 2.4e-7 are 1e-5 of a curve.
        assert!(out.metrics["length_error"] < 2e-5 && out.metrics["kept_out"] == 0.0);
    }
}

/// Hairs that cross the skin at rest are freed at rest as they are in motion: none jumps with the first move.
#[test]
fn what_crosses_the_skin_at_rest_is_freed_there_too() {
    let (mut curves, guides) = (field(14, 0.0), field(4, 0.2));
    // Every other curve arches over into the floor.
    let heights = [0.0, 0.02, 0.02, -0.01, -0.03];
    for cvs in curves.edit(P).unwrap().chunks_mut(5).skip(1).step_by(2) {
        let root = cvs[0];
        (0..5).for_each(|k| cvs[k] = [root[0] + 0.02 * k as f32, root[1] + heights[k], root[2]]);
    }
    let rest = on_skin(curves.clone(), [guides.clone(), guides.clone()], [floor(), floor()]).cook();
    let below = rest.curves().positions().iter().filter(|cv| cv[1] < -1e-6 && cv[0] < 1.0).count();
    assert_eq!((below, rest.metrics["kept_out"]), (0, 98.0));
    // The others keep their bits.
    for (a, b) in rest.curves().positions().chunks(5).zip(curves.positions().chunks(5)).step_by(2) {
        assert_eq!(a, b);
    }
    let now = moved(&guides, rigid);
    let out = on_skin(curves, [guides, now], [floor(), moved(&floor(), rigid)]).cook();
    let far = apart(&out, &moved(rest.curves(), rigid));
    assert!(far < 1e-4, "{far}");
}

/// Guides that all turn by the same angle about their roots turn each hair about its own, on a skin that bends too.
#[test]
fn hairs_turn_as_guides_do() {
    let (curves, guides) = (field(12, 0.3), field(4, 0.0));
    let out = on_skin(curves.clone(), [guides.clone(), turned(&guides, 0.6)], [floor(), floor()]).cook();
    assert!(apart(&out, &turned(&curves, 0.6)) < 1e-6);
    let half = on_skin(curves.clone(), [guides.clone(), turned(&guides, 0.6)], [floor(), floor()])
        .set(BLEND, 0.5.into())
        .cook();
    assert!(apart(&half, &turned(&curves, 0.3)) < 1e-6);
}

#[test]
fn at_blend_0_hairs_only_follow_the_skin() {
    let roll = |p: DVec3| {
        let (sine, cosine) = sin_cos(p.x as f32);
        let (sine, cosine) = (f64::from(sine), f64::from(cosine));
        DVec3::new((1.0 + p.y) * sine, (1.0 + p.y) * cosine, p.z)
    };
    let (curves, guides) = (field(12, 0.3), field(4, 0.0));
    let skin = moved(&floor(), roll);
    let out = on_skin(curves.clone(), [guides.clone(), turned(&moved(&guides, roll), 0.5)], [floor(), skin.clone()])
        .set(BLEND, 0.0.into())
        .set(KEEP_OUT, false)
        .cook();
    let roots = RootPositions::of(curves.runs().starts(), curves.positions());
    let binding = SkinBinding::to_closest(floor().positions(), &floor().triangles().corners, roots.as_slice()).unwrap();
    let attached = attach_curves(curves.runs().starts(), curves.positions(), &binding.poses(skin.positions()));
    let off = out.curves().positions().iter().zip(&attached.points).map(|(a, b)| (to_f64(*a) - to_f64(*b)).amax());
    assert!(off.fold(0.0, f64::max) < 1e-6);
}

/// Guides laid down on the floor lay hairs down that leaned to either side; those that would end below it do not.
#[test]
fn hairs_are_kept_out_of_the_skin() {
    let lowered = |curves: &Component, angle: f64| turned(curves, -angle);
    let (mut curves, guides) = (field(14, 0.0), field(4, 0.0));
    // Every other curve leans forwards by 0.3 rad, so that it ends that far below its guides.
    for cvs in curves.edit(P).unwrap().chunks_mut(5).skip(1).step_by(2) {
        let root = cvs[0];
        let (sine, cosine) = sin_cos(0.3);
        for (k, cv) in cvs.iter_mut().enumerate() {
            let r = 0.025 * k as f32;
            *cv = [root[0] + r * sine, root[1] + r * cosine, root[2]];
        }
    }
    let lying = lowered(&guides, 1.5);
    let bench = on_skin(curves.clone(), [guides, lying], [floor(), floor()]);
    let below = |out: &BenchResult| {
        let hairs = out.curves().positions().chunks(5);
        hairs.filter(|cvs| cvs.iter().any(|cv| cv[1] < -1e-6 && cv[0] < 1.0)).count()
    };
    let through = bench.clone().set(KEEP_OUT, false).cook();
    assert!(below(&through) >= 80, "{}", below(&through));
    let out = bench.cook();
    assert_eq!(below(&out), 0);
    assert!(out.metrics["kept_out"] >= 80.0 && out.metrics["crossings_left"] == 0.0);
    assert!(out.metrics["length_error"] < 1e-5);
    // Hairs that stay above it are as without.
    for (a, b) in out.curves().positions().chunks(5).zip(through.curves().positions().chunks(5)).step_by(2) {
        assert_eq!(a, b);
    }
}

#[test]
fn vectors_and_orientations_turn() {
    let (mut curves, guides) = (field(6, 0.0), field(3, 0.0));
    let (cvs, count) = (curves.point_count(), curves.element_count());
    curves.set(N, vec![[0.0, 1.0, 0.0]; cvs]).unwrap();
    curves.set(ORIENT, vec![[0.0, 0.0, 0.0, 1.0]; cvs]).unwrap();
    curves.set(Attr::<Point>::element("v"), vec![[0.0, 1.0, 0.0]; count]).unwrap();
    let angle = std::f64::consts::FRAC_PI_2;
    let rest = [floor(), floor()];
    let out = on_skin(curves.clone(), [guides.clone(), turned(&guides, angle)], rest).set(KEEP_OUT, false).cook();
    let close = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6);
    let half = std::f32::consts::FRAC_1_SQRT_2;
    assert!(out.curves().get(N).unwrap().iter().all(|n| close(n, &[-1.0, 0.0, 0.0])));
    assert!(out.curves().get(ORIENT).unwrap().iter().all(|q| close(q, &[0.0, 0.0, half, half])));
    // The skin is at rest, so what belongs to whole curves is too.
    assert!(out.curves().get(Attr::<Point>::element("v")).unwrap().iter().all(|v| *v == [0.0, 1.0, 0.0]));
    let now = [moved(&guides, rigid), moved(&floor(), rigid)];
    let [guides_now, skin_now] = now;
    let out = on_skin(curves, [guides, guides_now], [floor(), skin_now]).cook();
    let expected = to_f32(rotation(DVec3::new(0.6, 0.0, 0.8), 1.2) * DVec3::y());
    assert!(out.curves().get(Attr::<Point>::element("v")).unwrap().iter().all(|v| close(v, &expected)));
    // Segments of 0.025 m, some 3 m away, have directions to 1e-5.
    let near = |n: &Point| n.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 3e-5);
    assert!(out.curves().get(N).unwrap().iter().all(near));
}

#[test]
fn curves_beyond_the_radius_are_counted_and_stay() {
    let (curves, guides) = (field(12, 0.3), field(2, 0.0));
    let out =
        on_skin(curves.clone(), [guides.clone(), turned(&guides, 0.6)], [floor(), floor()]).set(RADIUS, 0.1).cook();
    let far =
        |root: &Point| guides.positions().iter().step_by(5).all(|guide| (to_f64(*guide) - to_f64(*root)).norm() > 0.1);
    let roots = curves.positions().iter().step_by(5);
    assert_eq!(out.metrics["unguided"], roots.clone().filter(|root| far(root)).count() as f64);
    for (k, root) in roots.enumerate() {
        let [before, after] = [curves.positions(), out.curves().positions()].map(|points| &points[5 * k..][..5]);
        assert_eq!(before == after, far(root), "{root:?}");
    }
}

#[test]
fn other_guides_and_skins_are_refused() {
    let error = deform(field(4, 0.0), [field(3, 0.0), field(2, 0.0)]).try_cook().unwrap_err();
    assert_eq!(
        error.fact,
        "`guides` has 4 curves and 20 CVs, `rest_guides` 9 curves and 45 CVs, or their distribution differs"
    );
    let other = Component::mesh(vec![3], vec![0, 1, 2], vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]).unwrap();
    let guides = [field(3, 0.0), field(3, 0.0)];
    let error = on_skin(field(4, 0.0), guides.clone(), [floor(), other]).try_cook().unwrap_err();
    assert!(error.fact.starts_with("`skin` has 1 faces and 3 points, at rest 16 faces"), "{}", error.fact);
    let none = || Component::mesh(Vec::new(), Vec::new(), Vec::new()).unwrap();
    let error = on_skin(field(4, 0.0), guides, [none(), none()]).try_cook().unwrap_err();
    assert_eq!(error.fact, "the skin at rest has no face to attach curves to");
}

/// Cooked with any number of threads, alone or after others, a frame has the same bits; from the second frame on the skin
/// is known, which changes none.
#[test]
fn frames_have_the_same_bits_in_any_order() {
    let guides = field(4, 0.0);
    let at = {
        let guides = guides.clone();
        move |frame: Frame| Geometry::from(turned(&guides, -0.25 * (frame.number() - 1.0)))
    };
    let curves = field(20, 0.6);
    let scene = bench(&NODE).input(CURVES, curves).input(REST_GUIDES, guides).moving(GUIDES, at).input(SKIN, floor());
    let bits = |out: &BenchResult| out.curves().table(Owner::Point).column("P").unwrap().to_bytes();
    let in_order = scene.frames(1..=8);
    assert!(in_order[7].metrics["kept_out"] > 0.0);
    for frame in [8_i64, 3, 5, 1] {
        let alone = scene.clone().threads(if frame == 3 { 1 } else { 7 }).at(frame as f64).cook();
        assert_eq!(bits(&alone), bits(&in_order[frame as usize - 1]), "frame {frame}");
    }
}

/// Guides that were not carried along are counted, and those that were, lifted a little or bent, are not.
#[test]
fn guides_that_the_moving_skin_leaves_behind_are_counted() {
    let (curves, guides) = (field(12, 0.3), field(4, 0.0));
    let pushed = |part: &Component, by: f64| moved(part, |p| p + DVec3::new(by, 0.5 * by, 0.0));
    let off = |now: Component, by: f64| {
        let skins = [floor(), pushed(&floor(), by)];
        on_skin(curves.clone(), [guides.clone(), now], skins).cook().metrics["guides_off_skin"]
    };
    for by in [0.02, 1.0] {
        assert_eq!(off(guides.clone(), by), 16.0);
        assert_eq!(off(turned(&guides, 0.5), by), 16.0);
        assert_eq!(off(pushed(&guides, by), by), 0.0);
        // Lifted by a tenth of their lengths from where the skin carries them.
        let lifted = moved(&turned(&pushed(&guides, by), 0.5), |p| p + DVec3::y() * 0.01);
        assert_eq!(off(lifted, by), 0.0);
    }
    // On a skin that rests, guides may stand anywhere.
    assert_eq!(off(moved(&guides, |p| p + DVec3::y() * 0.1), 0.0), 0.0);
}

#[test]
fn curves_without_guides_are_counted() {
    let (curves, guides, none) = (field(12, 0.3), field(4, 0.0), Component::curves(Vec::new(), Vec::new()).unwrap());
    let unguided = |guides: Component, radius: f32| {
        let now = turned(&guides, 0.5);
        on_skin(curves.clone(), [guides, now], [floor(), floor()]).set(RADIUS, radius).cook().metrics["unguided"]
    };
    assert_eq!(unguided(guides.clone(), 0.0), 0.0);
    assert_eq!(unguided(none, 0.0), 144.0);
    let some = unguided(guides, 0.1);
    assert!(some > 0.0 && some < 144.0, "{some}");
}
