//! Properties of hairs between guides.

use super::*;
use crate::curve_scatter;
use crate::shared::planting::a_third_as_wide;
use conformance::{Bench, BenchResult, bench, conformance};
use numerics::shapes;

type Point = [f32; 3];

fn ball() -> Component {
    let shape = shapes::sphere([2.0; 3], 8);
    let points = shape.points.iter().map(|p| p.map(|x| x as f32)).collect();
    Component::mesh(shape.counts, shape.corners, points).unwrap()
}

/// Leaning straight curves of 5 CVs from Curve_Scatter, whose input and param have the same names as here.
fn scattered(skin: Component, density: f32) -> Component {
    bench(&curve_scatter::NODE).input(SKIN, skin).set(DENSITY, density).cook().curves().clone()
}

fn interpolate(guides: Component, skin: Component) -> Bench {
    bench(&NODE).input(GUIDES, guides).input(SKIN, skin).set(DENSITY, 80.0)
}

fn moved(part: &Component, to: impl Fn([f64; 3]) -> [f64; 3]) -> Component {
    let mut out = part.clone();
    out.edit(P).unwrap().iter_mut().for_each(|p| *p = to(p.map(f64::from)).map(|x| x as f32));
    out
}

/// Rotates about z, farther each frame, and translates.
fn rigid([x, y, z]: [f64; 3], frame: Frame) -> [f64; 3] {
    let a = 0.2 * (frame.number() - 1.0);
    let (s, c) = (2.0 * a / (1.0 + a * a), (1.0 - a * a) / (1.0 + a * a));
    [c * x - s * y + 0.5 * a, s * x + c * y, z - a]
}

/// Guides bent sideways, most at their tips; their roots stay.
fn blown(guides: &Component, by: f64) -> Component {
    let mut out = guides.clone();
    for (k, p) in out.edit(P).unwrap().iter_mut().enumerate() {
        p[0] += (by * (k % 5) as f64 * 0.01) as f32;
    }
    out
}

fn apart(a: &[Point], b: &[Point]) -> f64 {
    let one = |(a, b): (&Point, &Point)| (0..3).map(|k| (f64::from(a[k]) - f64::from(b[k])).abs()).fold(0.0, f64::max);
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(one).fold(0.0, f64::max)
}

fn roots(out: &BenchResult) -> Vec<Point> {
    RootPositions::of(out.curves().runs().starts(), out.curves().positions()).as_slice().to_vec()
}

#[test]
fn hairs_at_the_roots_of_guides_equal_the_guides() {
    // The same seed and density give the same roots.
    let guides = scattered(ball(), 40.0);
    let out = interpolate(guides.clone(), ball()).set(DENSITY, 40.0).cook();
    assert_eq!(out.curves().runs(), guides.runs());
    assert!(apart(out.curves().positions(), guides.positions()) < 1e-6);
    assert_eq!(out.curves().get(CURVE_ID), guides.get(CURVE_ID));
    assert_eq!(out.metrics["curves"], guides.element_count() as f64);
}

#[test]
fn roots_and_ids_do_not_depend_on_the_motion_of_guides() {
    let guides = scattered(ball(), 20.0);
    let swung = guides.clone();
    let wind = bench(&NODE)
        .moving(GUIDES, move |frame| blown(&swung, frame.number() - 1.0).into())
        .input(SKIN, ball())
        .set(DENSITY, 80.0);
    let frames = wind.frames([1, 2, 9]);
    let still = interpolate(guides, ball()).cook();
    assert_eq!(frames[0].geometry, still.geometry);
    for out in &frames {
        assert_eq!(roots(out), roots(&still));
        assert_eq!(out.curves().get(CURVE_ID), still.curves().get(CURVE_ID));
        assert_eq!(out.curves().get(PREF), Some(still.curves().positions()));
    }
    // They follow: by frame 9 every tip has moved as its guides have.
    let tips =
        |out: &BenchResult| -> Vec<Point> { out.curves().positions().iter().skip(4).step_by(5).copied().collect() };
    let (before, after) = (tips(&still), tips(&frames[2]));
    assert!(before.iter().zip(&after).all(|(a, b)| b[0] > a[0] + 1e-3), "{before:?} {after:?}");
}

#[test]
fn rigid_motion_of_the_scene_moves_hairs_rigidly() {
    let guides = scattered(ball(), 20.0);
    let carried = guides.clone();
    let moving = bench(&NODE)
        .moving(GUIDES, move |frame| moved(&carried, |p| rigid(p, frame)).into())
        .moving(SKIN, |frame| moved(&ball(), |p| rigid(p, frame)).into())
        .set(DENSITY, 80.0);
    let still = interpolate(guides, ball()).cook();
    for (frame, out) in [1, 2, 4].into_iter().zip(moving.frames([1, 2, 4])) {
        let expected = moved(still.curves(), |p| rigid(p, Frame::whole(frame)));
        assert!(apart(out.curves().positions(), expected.positions()) < 2e-6, "{frame}");
        assert!(apart(out.curves().get(PREF).unwrap(), still.curves().positions()) == 0.0);
    }
}

#[test]
fn the_number_of_cvs_is_that_of_the_param_or_of_the_guide_with_most() {
    let points = vec![[1.0, 0.0, 0.0], [1.2, 0.0, 0.0], [-1.0, 0.0, 0.0], [-1.1, 0.0, 0.0], [-1.2, 0.0, 0.0]];
    let guides = Component::curves(vec![2, 3], points).unwrap();
    let out = interpolate(guides.clone(), ball()).cook();
    assert!(out.curves().runs().counts().all(|count| count == 3));
    let out = interpolate(guides.clone(), ball()).set(CVS, 7).cook();
    assert!(out.curves().runs().counts().all(|count| count == 7));
    assert!(out.metrics["length_error"] < 2e-5);
    let out = interpolate(guides, ball()).set(CVS, 1).cook();
    assert!(out.curves().runs().counts().all(|count| count == 1));
}

#[test]
fn attributes_of_guides_are_blended() {
    let mut guides = scattered(ball(), 20.0);
    let (curves, cvs) = (guides.element_count(), guides.point_count());
    let along: Vec<f32> = (0..cvs).map(|k| (k % 5) as f32).collect();
    guides.set(WIDTH, along.clone()).unwrap();
    guides.set(Attr::<f32>::element("age"), (0..curves).map(|k| k as f32).collect()).unwrap();
    guides.set(Attr::<i32>::element("kind"), (0..curves as i32).map(|k| k + 100).collect()).unwrap();
    guides.set(N, guides.positions().iter().map(|p| to_f32(to_f64(*p).normalize())).collect()).unwrap();
    guides.set(Attr::<f32>::once("gain"), vec![3.0]).unwrap();
    let out = interpolate(guides, ball()).cook();
    let hairs = out.curves();
    // The same along every guide, so along every hair.
    let found = hairs.get(WIDTH).unwrap();
    assert!(found.iter().enumerate().all(|(k, width)| (width - (k % 5) as f32).abs() < 1e-5));
    let age = hairs.get(Attr::<f32>::element("age")).unwrap();
    assert!(age.len() == hairs.element_count() && age.iter().all(|age| (0.0..curves as f32).contains(age)));
    assert!(age.iter().any(|age| (age - age.round()).abs() > 0.1), "they are mixes");
    let kind = hairs.get(Attr::<i32>::element("kind")).unwrap();
    assert!(kind.iter().all(|kind| (100..100 + curves as i32).contains(kind)));
    assert!(hairs.get(N).unwrap().iter().all(|n| (apart(&[to_f32(to_f64(*n).normalize())], &[*n])) < 1e-6));
    assert_eq!(hairs.get(Attr::<f32>::once("gain")), Some(&[3.0][..]));
}

#[test]
fn one_guide_per_hair_makes_clumps() {
    // Each hair then has the length of one of the guides, up to rounding.
    let guides = scattered(ball(), 20.0);
    let whole = |cvs: &[Point]| -> f64 {
        let step = |pair: &[Point]| (to_f64(pair[1]) - to_f64(pair[0])).norm();
        cvs.windows(2).map(step).sum()
    };
    let lengths: Vec<f64> = guides.positions().chunks(5).map(whole).collect();
    let out = interpolate(guides, ball()).set(COUNT, 1).cook();
    for hair in out.curves().positions().chunks(5) {
        assert!(lengths.iter().any(|length| (whole(hair) - length).abs() < 1e-6));
    }
}

#[test]
fn a_mask_thins_hairs_and_an_unknown_mask_is_refused() {
    let mut skin = ball();
    let lawn: Vec<f32> = skin.positions().iter().map(|p| if p[1] > 0.5 { 1.0 } else { 0.0 }).collect();
    skin.set(Attr::<f32>::point("lawn"), lawn).unwrap();
    let guides = scattered(ball(), 20.0);
    let out = interpolate(guides.clone(), skin.clone()).set(MASK, "lawn".into()).cook();
    assert!(!roots(&out).is_empty() && roots(&out).iter().all(|root| root[1] > 0.0));
    let error = interpolate(guides, skin).set(MASK, "meadow".into()).try_cook().unwrap_err();
    assert_eq!(error.fact, "`mask` is `meadow`, which `skin` does not have");
}

#[test]
fn guides_or_faces_that_change_are_refused() {
    let guides = scattered(ball(), 20.0);
    let fewer = |frame: Frame| scattered(ball(), if frame.floor_number() == 1 { 20.0 } else { 5.0 }).into();
    let error = bench(&NODE).moving(GUIDES, fewer).input(SKIN, ball()).at(2.0).try_cook().unwrap_err();
    assert!(error.fact.starts_with("`guides` has ") && error.fact.contains("at the scene's first frame"), "{error}");
    let cut = |frame: Frame| {
        let points = ball().positions().to_vec();
        let one = Component::mesh(vec![3], vec![0, 1, 2], points).unwrap();
        if frame.floor_number() == 1 { ball().into() } else { one.into() }
    };
    let error = bench(&NODE).input(GUIDES, guides).moving(SKIN, cut).at(2.0).try_cook().unwrap_err();
    assert!(error.fact.starts_with("`skin` has 1 faces"), "{error}");
}

#[test]
fn no_hairs_grow_without_guides_or_skin() {
    let none = Component::curves(vec![], vec![]).unwrap();
    let empty = Component::mesh(vec![], vec![], vec![]).unwrap();
    let guides = scattered(ball(), 5.0);
    for (guides, skin) in [(none.clone(), ball()), (guides, empty.clone()), (none, empty)] {
        let out = interpolate(guides, skin).cook();
        assert_eq!((out.curves().element_count(), out.metrics["curves"]), (0, 0.0));
    }
}

#[test]
fn degenerate_guides_give_finite_hairs() {
    // One CV, equal CVs, far away, inside the ball.
    let points = vec![[1.0, 0.0, 0.0], [2.0; 3], [2.0; 3], [1e6, 0.0, 0.0], [1e6, 1.0, 0.0], [0.0; 3], [0.0, 0.1, 0.0]];
    let guides = Component::curves(vec![1, 2, 2, 2], points).unwrap();
    for count in [1, 3, 32] {
        let out = interpolate(guides.clone(), ball()).set(COUNT, count).cook();
        assert!(out.curves().element_count() > 0);
        assert!(out.curves().positions().as_flattened().iter().all(|x| x.is_finite()));
    }
}

#[test]
fn bits_do_not_depend_on_the_order_of_frames_or_the_number_of_threads() {
    let guides = scattered(ball(), 20.0);
    let moving = bench(&NODE)
        .moving(GUIDES, move |frame| moved(&blown(&guides, frame.number()), |p| rigid(p, frame)).into())
        .moving(SKIN, |frame| moved(&ball(), |p| rigid(p, frame)).into())
        .set(DENSITY, 80.0);
    let in_order = moving.frames(1..=4);
    let back = moving.clone().threads(7).frames((1..=4).rev());
    for (frame, expected) in (1..=4).zip(&in_order) {
        let alone = moving.clone().threads(1).at(f64::from(frame)).cook();
        assert_eq!(alone.geometry, expected.geometry, "{frame}");
        assert_eq!(back[4 - frame as usize].geometry, expected.geometry, "{frame}");
    }
}

#[test]
fn it_conforms() {
    conformance(&NODE).with(|bench| bench.changed(GUIDES, a_third_as_wide).changed(SKIN, a_third_as_wide)).run();
}
