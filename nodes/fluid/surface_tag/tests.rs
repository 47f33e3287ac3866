use super::*;
use conformance::{Bench, bench, conformance};
use engine::error::Error;
use numerics::random::Key;
use numerics::shapes::{self, Polygons};
use numerics::vector::{add, length, scale, sub, unit};

const HEAT: Attr<f32> = Attr::point("heat");
const TINT: Attr<[f32; 4]> = Attr::point("tint");
const CENTRE: [f32; 3] = [0.5, 2.0, -1.0];

/// A ball of radius 1 as a mesh with normals.
fn ball() -> Component {
    let Polygons { counts, corners, points } = shapes::sphere([2.0; 3], 8);
    let normals: Vec<[f32; 3]> = points.iter().map(|p| unit(p.map(|x| x as f32)).unwrap()).collect();
    let mut ball = Component::mesh(counts, corners, normals.iter().map(|n| add(*n, CENTRE)).collect()).unwrap();
    ball.set(N, normals).unwrap();
    ball
}

/// Points scattered about evenly over that ball, closer than its vertices, with a texture that is linear in space.
fn scattered() -> Component {
    let key = Key::new(1);
    let jitter = |n: usize| [0, 1, 2].map(|axis| key.of(n as u64).of(axis).between([-0.02, 0.02]));
    let even = shapes::sphere([2.0; 3], 24).points;
    let near = even.iter().enumerate().map(|(n, p)| add(p.map(|x| x as f32), jitter(n)));
    let normals: Vec<[f32; 3]> = near.filter_map(unit).collect();
    let at: Vec<[f32; 3]> = normals.iter().map(|n| add(*n, CENTRE)).collect();
    let mut points = Component::points(at.clone());
    points.set(UVW, at.iter().map(|p| uvw(*p)).collect()).unwrap();
    points.set(HEAT, at.iter().map(|p| p[1]).collect()).unwrap();
    points.set(TINT, at.iter().map(|p| [p[0], p[1], p[2], 0.25]).collect()).unwrap();
    points.set(N, normals).unwrap();
    points
}

/// Of a place on the ball.
fn uvw(p: [f32; 3]) -> [f32; 3] {
    let [x, y, z] = sub(p, CENTRE);
    [0.5 + 0.5 * z, 0.5 - 0.25 * x, 0.25 * y]
}

fn names(names: &[&str]) -> Arc<Vec<Name>> {
    Arc::new(names.iter().map(|name| Name::from(*name)).collect())
}

fn tagging(points: Component) -> Bench {
    bench(&NODE).input(SURFACE, ball()).input(REFERENCE, points)
}

fn refusal(bench: &Bench) -> Error {
    bench.try_cook().unwrap_err()
}

#[test]
fn texture_coordinates_and_reference_positions_are_those_of_the_points() {
    let out = tagging(scattered()).cook();
    let mesh = out.mesh();
    // What is left is how far the ball lies below its tangent plane: R²/2 at the radius, R²/8 in the mean of even points.
    let most = 0.5 * out.metrics["tag_radius"] * out.metrics["tag_radius"] / 4.0;
    assert!(most < 4e-3, "{most}");
    for ((p, texture), rest) in mesh.positions().iter().zip(mesh.get(UVW).unwrap()).zip(mesh.get(PREF).unwrap()) {
        assert!(f64::from(length(sub(*texture, uvw(*p)))) < most, "{p:?}: {texture:?} {:?}", uvw(*p));
        assert!(f64::from(length(sub(*rest, *p))) < 2.0 * most, "{p:?}: {rest:?}");
    }
    assert_eq!(out.metrics["untagged_vertices"], 0.0);
    assert_eq!((mesh.positions(), mesh.get(N)), (ball().positions(), ball().get(N)));
    assert!(mesh.get(HEAT).is_none(), "only what is named");
}

#[test]
fn attributes_of_one_three_and_four_floats_are_taken_over() {
    let mut points = scattered();
    let rest = points.positions().iter().map(|p| scale(*p, 3.0)).collect();
    points.set(PREF, rest).unwrap();
    let out = tagging(points).set(ATTRIBUTES, names(&["heat", "uvw", "tint", "heat"])).cook();
    let mesh = out.mesh();
    for (n, p) in mesh.positions().iter().enumerate() {
        let close = |a: f32, b: f32| assert!((a - b).abs() < 0.01, "{a} {b}");
        close(mesh.get(HEAT).unwrap()[n], p[1]);
        let tint = mesh.get(TINT).unwrap()[n];
        (0..3).for_each(|k| close(tint[k], p[k]));
        assert_eq!(tint[3], 0.25);
        (0..3).for_each(|k| close(mesh.get(PREF).unwrap()[n][k] / 3.0, p[k]));
    }
    let none = tagging(scattered()).set(ATTRIBUTES, names(&[])).cook();
    assert!(none.mesh().get(UVW).is_none() && none.mesh().get(PREF).is_some());
}

#[test]
fn a_missing_attribute_is_refused_with_what_is_meant() {
    let with = |name: &str| tagging(scattered()).set(ATTRIBUTES, names(&[name]));
    let error = refusal(&with("uww"));
    assert_eq!(error.to_string(), "`attributes` names `uww`, which `reference` does not have; did you mean `uvw`?");
    assert_eq!((error.param, error.of_types), (Some("attributes"), true));
    assert_eq!(
        refusal(&with("blue")).to_string(),
        "`attributes` names `blue`, which `reference` does not have; expected an attribute of the points, of one, three \
         or four floats each"
    );
    for name in ["P", "orient"] {
        assert!(refusal(&with(name)).to_string().starts_with(&format!("`attributes` names `{name}`: ")));
    }
    let mut points = scattered();
    points.set(ID, vec![3; points.point_count()]).unwrap();
    let error = refusal(&tagging(points).set(ATTRIBUTES, names(&["id"]))).to_string();
    assert!(error.starts_with("`attributes` names `id`, which is one int for each point in `reference`; "), "{error}");
    let mut mesh = ball();
    mesh.set(Attr::<f32>::element("heat"), vec![0.0; mesh.element_count()]).unwrap();
    let error =
        refusal(&bench(&NODE).input(SURFACE, mesh).input(REFERENCE, scattered()).set(ATTRIBUTES, names(&["heat"])));
    assert!(error.to_string().contains("which the faces of `surface` have"), "{error}");
}

#[test]
fn spray_does_not_count_and_kinds_can_be_chosen() {
    let mut points = scattered();
    let kinds: Vec<i32> =
        (0..points.point_count()).map(|n| [PARTICLE_MARKER, PARTICLE_TRACER, PARTICLE_SPRAY][n % 3]).collect();
    let heat = kinds.iter().map(|kind| [1.0, f32::MAX, 2.0, 5.0][*kind as usize]).collect();
    points.set(PARTICLE_KIND, kinds).unwrap();
    points.set(HEAT, heat).unwrap();
    let heat = |which: ReferencePoints| {
        let out = tagging(points.clone()).set(ATTRIBUTES, names(&["heat"])).set(POINTS, which).cook();
        let heat = out.mesh().get(HEAT).unwrap();
        heat.iter().fold([f32::MAX, f32::MIN], |[low, high], x| [low.min(*x), high.max(*x)])
    };
    assert_eq!(heat(ReferencePoints::Markers), [1.0; 2]);
    assert_eq!(heat(ReferencePoints::Tracers), [5.0; 2]);
    let [low, high] = heat(ReferencePoints::All);
    assert!((1.0..3.0).contains(&low) && high > 3.0 && high <= 5.0, "{low} {high}");
}

#[test]
fn vertices_without_points_take_the_nearest_and_are_counted() {
    let out = tagging(scattered()).set(RADIUS, 1e-6).set(ATTRIBUTES, names(&["heat"])).cook();
    let count = out.mesh().point_count() as f64;
    assert_eq!(out.metrics["untagged_vertices"], count);
    for (p, heat) in out.mesh().positions().iter().zip(out.mesh().get(HEAT).unwrap()) {
        assert!((p[1] - heat).abs() < 0.2, "{p:?}: {heat}");
    }
    let all = scattered();
    let is_right = |n: &u32| all.positions()[*n as usize][0] > CENTRE[0];
    let half: Vec<u32> = (0..all.point_count() as u32).filter(is_right).collect();
    let mut points = Component::points(half.iter().map(|n| all.positions()[*n as usize]).collect());
    points.set(UVW, half.iter().map(|n| all.get(UVW).unwrap()[*n as usize]).collect()).unwrap();
    let out = tagging(points).cook();
    let without = out.metrics["untagged_vertices"];
    assert!((0.3..0.5).contains(&(without / count)), "{without} of {count}");
}

#[test]
fn without_points_the_values_are_neutral() {
    let mut none = Component::points(Vec::new());
    none.set(UVW, Vec::new()).unwrap();
    none.set(Attr::<[f32; 3]>::point("Cd"), Vec::new()).unwrap();
    let out = tagging(none).set(ATTRIBUTES, names(&["uvw", "Cd"])).cook();
    let mesh = out.mesh();
    assert!(mesh.get(UVW).unwrap().iter().all(|x| *x == [0.0; 3]));
    assert!(mesh.get(Attr::<[f32; 3]>::point("Cd")).unwrap().iter().all(|x| *x == [1.0; 3]));
    assert_eq!(mesh.get(PREF).unwrap(), mesh.positions());
    assert_eq!(out.metrics["untagged_vertices"], mesh.point_count() as f64);
    let empty = Component::mesh(Vec::new(), Vec::new(), Vec::new()).unwrap();
    let out = bench(&NODE).input(SURFACE, empty).input(REFERENCE, scattered()).cook();
    assert_eq!((out.mesh().point_count(), out.metrics["untagged_vertices"]), (0, 0.0));
}

#[test]
fn the_bits_do_not_depend_on_threads_nor_the_values_on_the_order_of_points() {
    let bench = tagging(scattered()).set(ATTRIBUTES, names(&["uvw", "heat"]));
    let one = bench.clone().threads(1).cook();
    assert_eq!(one.geometry, bench.clone().threads(7).cook().geometry);
    let all = scattered();
    let order: Vec<u32> = (0..all.point_count() as u32).rev().collect();
    let mut turned = Component::points(order.iter().map(|n| all.positions()[*n as usize]).collect());
    for (name, column) in all.table(Owner::Point).iter().filter(|(name, _)| ***name != *P.name) {
        turned.set_column(Owner::Point, name.clone(), column.gather(&order)).unwrap();
    }
    let other = tagging(turned).set(ATTRIBUTES, names(&["uvw", "heat"])).cook();
    for (a, b) in one.mesh().get(HEAT).unwrap().iter().zip(other.mesh().get(HEAT).unwrap()) {
        assert!((a - b).abs() < 1e-5, "{a} {b}");
    }
}

#[test]
fn it_conforms() {
    let with = |list: &'static [&'static str]| move |bench: Bench| bench.set(ATTRIBUTES, names(list));
    conformance(&NODE).with(with(&["N"])).with(with(&["Pref"])).with(with(&[])).run();
}

#[test]
fn tracers_that_are_asked_for_and_not_there_are_told() {
    let of_kind = |kind: i32| {
        let mut points = scattered();
        points.set(PARTICLE_KIND, vec![kind; points.point_count()]).unwrap();
        tagging(points).set(ATTRIBUTES, names(&["heat"])).set(POINTS, ReferencePoints::Tracers).cook()
    };
    let told = |kind: i32| of_kind(kind).metrics["no_tracers"];
    assert_eq!((told(PARTICLE_TRACER), told(PARTICLE_MARKER)), (0.0, 1.0));
}
