//! Properties of attached curves.

use super::*;
use conformance::{Bench, BenchResult, bench, conforms};
use numerics::trig::sin_cos;
use numerics::vector::to_f64;

type Point = [f32; 3];

/// 4 by 4 squares of size 1 in x and z, facing up; every other one has a fifth corner on a side.
fn floor() -> Component {
    let mut points: Vec<Point> = (0..25_u8).map(|i| [f32::from(i / 5), 0.0, f32::from(i % 5)]).collect();
    let (mut counts, mut corners) = (Vec::new(), Vec::new());
    for i in 0..16_u32 {
        let a = i / 4 * 5 + i % 4;
        let mut face = vec![a, a + 1, a + 6, a + 5];
        if i % 2 == 1 {
            let [x, _, z] = points[a as usize];
            face.push(points.len() as u32);
            points.push([x + 0.5, 0.0, z]);
        }
        counts.push(face.len() as u32);
        corners.extend(face);
    }
    Component::mesh(counts, corners, points).unwrap()
}

/// Leaning straight curves of 3 CVs, 0.2 long, all over the floor, with roots slightly above it.
fn hair() -> Component {
    let curve = |i: u32| {
        let root = [0.39 * (i / 10) as f32 + 0.1, 0.01 * (i % 3) as f32, 0.39 * (i % 10) as f32 + 0.1];
        (0..3).map(move |k| [root[0] + 0.06 * k as f32, root[1] + 0.08 * k as f32, root[2]])
    };
    Component::curves(vec![3; 100], (0..100).flat_map(curve).collect()).unwrap()
}

fn moved(part: &Component, to: impl Fn([f64; 3]) -> [f64; 3]) -> Component {
    let mut out = part.clone();
    out.edit(P).unwrap().iter_mut().for_each(|p| *p = to(p.map(f64::from)).map(|x| x as f32));
    out
}

/// Rotation about z by twice the angle of that tangent, then translation by (1, 2, 3).
fn rigid([x, y, z]: [f64; 3], tangent: f64) -> [f64; 3] {
    let whole = 1.0 + tangent * tangent;
    let (s, c) = (2.0 * tangent / whole, (1.0 - tangent * tangent) / whole);
    [c * x - s * y + 1.0, s * x + c * y + 2.0, z + 3.0]
}

/// The floor rolled up about z, twisted and stretched.
fn rolled([x, y, z]: [f64; 3]) -> [f64; 3] {
    let (a, r) = (0.6 * x + 0.1 * z, 1.5 - y);
    let (s, c) = sin_cos(a as f32);
    [r * f64::from(s), 1.5 - r * f64::from(c), 1.3 * z + 0.2 * x]
}

fn attach(curves: Component, rest: Component, skin: Component) -> Bench {
    bench(&NODE).input(CURVES, curves).input(REST_SKIN, rest).input(SKIN, skin)
}

fn apart(a: &[Point], b: &[Point]) -> f64 {
    let one = |(a, b): (&Point, &Point)| (0..3).map(|k| (f64::from(a[k]) - f64::from(b[k])).abs()).fold(0.0, f64::max);
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(one).fold(0.0, f64::max)
}

fn distance(a: Point, b: Point) -> f64 {
    (to_f64(b) - to_f64(a)).norm()
}

#[test]
fn rigid_motion_of_the_skin_moves_curves_rigidly() {
    for tangent in [0.0, 0.15, 1.0, 14.0] {
        let out = attach(hair(), floor(), moved(&floor(), |p| rigid(p, tangent))).cook();
        let expected = moved(&hair(), |p| rigid(p, tangent));
        assert!(apart(out.curves().positions(), expected.positions()) < 2e-6);
        assert_eq!(out.metrics["unturned"], 0.0);
        // Curves of 0.2 m some 8 m from the origin: 4 ulp of 9.5e-7 are 2e-5 of them.
        assert!(out.metrics["length_error"] < 2e-5, "{}", out.metrics["length_error"]);
    }
}

#[test]
fn scaling_the_skin_moves_roots_and_keeps_the_shape_of_curves() {
    let out = attach(hair(), floor(), moved(&floor(), |p| p.map(|x| 3.0 * x))).cook();
    for (now, rest) in out.curves().positions().chunks(3).zip(hair().positions().chunks(3)) {
        let foot = [3.0 * rest[0][0], rest[0][1], 3.0 * rest[0][2]];
        for k in 0..3 {
            let expected = [0, 1, 2].map(|d| foot[d] + (rest[k][d] - rest[0][d]));
            assert!(apart(&[now[k]], &[expected]) < 2e-6, "{now:?} {expected:?}");
        }
    }
}

#[test]
fn bending_the_skin_keeps_lengths_and_heights_of_roots() {
    let out = attach(hair(), floor(), moved(&floor(), rolled)).cook();
    for (now, rest) in out.curves().positions().chunks(3).zip(hair().positions().chunks(3)) {
        for k in 0..2 {
            assert!((distance(now[k], now[k + 1]) - distance(rest[k], rest[k + 1])).abs() < 2e-6);
        }
    }
    assert!((out.metrics["bound"] - 0.02).abs() < 1e-7);
    assert!(out.metrics["length_error"] < 2e-5);
}

#[test]
fn a_skin_at_rest_changes_no_array() {
    let curves = hair();
    let out = attach(curves.clone(), floor(), floor()).cook();
    let column = |part: &Component, name: &str| part.table(Owner::Point).column(name).unwrap().clone();
    assert!(column(out.curves(), "P").same(&column(&curves, "P")));
    assert!(column(out.curves(), "Pref").same(&column(&curves, "P")));
}

#[test]
fn pref_is_written_if_it_is_missing() {
    let skin = || moved(&floor(), rolled);
    let out = attach(hair(), floor(), skin()).cook();
    assert_eq!(out.curves().get(PREF), Some(hair().positions()));
    let mut curves = hair();
    curves.set(PREF, vec![[7.0; 3]; 300]).unwrap();
    let out = attach(curves, floor(), skin()).cook();
    assert_eq!(out.curves().get(PREF), Some(&[[7.0; 3]; 300][..]));
}

#[test]
fn velocities_normals_and_orientations_rotate_and_other_attributes_stay() {
    // A quarter turn about z: x becomes y.
    let mut curves = hair();
    curves.set(V, vec![[2.0, 0.0, 0.0]; 300]).unwrap();
    curves.set(Attr::<Point>::element("N"), vec![[1.0, 0.0, 0.0]; 100]).unwrap();
    curves.set(ORIENT, vec![[0.0, 0.0, 0.0, 1.0]; 300]).unwrap();
    curves.set(ENVELOPE, vec![0.25; 300]).unwrap();
    curves.set(Attr::<Point>::point("colour"), vec![[1.0, 0.0, 0.0]; 300]).unwrap();
    let out = attach(curves, floor(), moved(&floor(), |p| rigid(p, 1.0))).cook();
    let out = out.curves();
    assert!(apart(out.get(V).unwrap(), &[[0.0, 2.0, 0.0]; 300]) < 1e-5);
    assert!(apart(out.get(Attr::<Point>::element("N")).unwrap(), &[[0.0, 1.0, 0.0]; 100]) < 1e-5);
    let half = std::f32::consts::FRAC_1_SQRT_2;
    assert!(out.get(ORIENT).unwrap().iter().all(|q| (q[2] - half).abs() < 1e-5 && (q[3] - half).abs() < 1e-5));
    assert_eq!(out.get(ENVELOPE), Some(&[0.25; 300][..]));
    assert_eq!(out.get(Attr::<Point>::point("colour")), Some(&[[1.0, 0.0, 0.0]; 300][..]));
}

#[test]
fn other_components_pass_through() {
    let mut both = Geometry::from(hair());
    both.put(floor());
    let out = bench(&NODE).input(CURVES, both).input(REST_SKIN, floor()).input(SKIN, moved(&floor(), rolled)).cook();
    assert_eq!(out.mesh().positions(), floor().positions());
}

#[test]
fn a_skin_with_other_faces_is_refused_with_both_counts() {
    let one = Component::mesh(vec![3], vec![0, 1, 2], floor().positions().to_vec()).unwrap();
    let error = attach(hair(), floor(), one).try_cook().unwrap_err();
    let expected = "`skin` has 1 faces and 33 points, `rest_skin` 16 faces and 33 points, or their topology differs";
    assert_eq!(error.fact, expected);
}

#[test]
fn a_skin_without_faces_is_refused_unless_there_are_no_curves() {
    let empty = || Component::mesh(vec![], vec![], vec![]).unwrap();
    let error = attach(hair(), empty(), empty()).try_cook().unwrap_err();
    assert_eq!(error.fact, "`rest_skin` has no face to attach 100 curves to");
    let none = Component::curves(vec![], vec![]).unwrap();
    assert_eq!(attach(none.clone(), empty(), empty()).cook().curves().point_count(), 0);
    assert_eq!(attach(none, floor(), moved(&floor(), rolled)).cook().metrics["bound"], 0.0);
}

#[test]
fn curves_on_a_collapsed_skin_move_without_rotating_and_are_counted() {
    let out = attach(hair(), floor(), moved(&floor(), |_| [5.0; 3])).cook();
    assert_eq!(out.metrics["unturned"], 100.0);
    for (now, rest) in out.curves().positions().chunks(3).zip(hair().positions().chunks(3)) {
        assert!(apart(&now[..1], &[[5.0, 5.0 + rest[0][1], 5.0]]) < 1e-6);
        assert!((distance(now[0], now[2]) - distance(rest[0], rest[2])).abs() < 2e-6);
    }
}

#[test]
fn degenerate_curves_and_skins_give_finite_results() {
    // One CV, equal CVs, a root far away; a face without area at rest.
    let points = vec![[1.0, 0.0, 1.0], [2.0; 3], [2.0; 3], [1e6, 0.0, 0.0], [1e6, 1.0, 0.0]];
    let curves = Component::curves(vec![1, 2, 2], points).unwrap();
    let mut rest = floor();
    rest.edit(P).unwrap()[6] = [1.0, 0.0, 2.0];
    let out = attach(curves, rest.clone(), moved(&rest, rolled)).cook();
    assert!(out.curves().positions().as_flattened().iter().all(|x| x.is_finite()));
    assert!(out.metrics["bound"] > 9e5);
}

#[test]
fn bits_do_not_depend_on_the_order_of_frames_or_the_number_of_threads() {
    let skin = |frame: Frame| moved(&floor(), |p| rigid(rolled(p), 0.1 * frame.number())).into();
    let curves = |frame: Frame| moved(&hair(), |[x, y, z]| [x + 0.1 * frame.number() * y, y, z]).into();
    let moving = bench(&NODE).moving(CURVES, curves).input(REST_SKIN, floor()).moving(SKIN, skin);
    let in_order = moving.frames(1..=5);
    let back: Vec<BenchResult> = moving.clone().threads(7).frames((1..=5).rev());
    for (frame, expected) in (1..=5).zip(&in_order) {
        let alone = moving.clone().threads(1).at(f64::from(frame)).cook();
        assert_eq!(alone.geometry, expected.geometry, "{frame}");
        assert_eq!(back[5 - frame as usize].geometry, expected.geometry, "{frame}");
    }
}

#[test]
fn it_conforms() {
    conforms(&NODE);
}

#[test]
fn a_mirrored_skin_is_refused_as_such() {
    let mut mirrored = moved(&floor(), |[x, y, z]| [-x, y, z]);
    let faces = mirrored.faces().unwrap();
    let reversed =
        faces.iter().flat_map(|face| [&face[..1], &face[1..].iter().rev().copied().collect::<Vec<_>>()].concat());
    mirrored =
        Component::mesh(faces.runs.counts().collect(), reversed.collect(), mirrored.positions().to_vec()).unwrap();
    let error = attach(hair(), floor(), mirrored).try_cook().unwrap_err();
    assert_eq!(error.fact, "`skin` is `rest_skin` mirrored, with its faces inside out");
}
