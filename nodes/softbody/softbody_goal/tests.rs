use super::*;
use bodies::tets::{CagedSurface, ClosedSurface, FillSettings, PolygonSurface};
use conformance::{Bench, bench, conformance};
use numerics::shapes::{self, Polygons};

type Map = fn([f64; 3]) -> [f64; 3];

fn mesh(shape: &Polygons) -> Component {
    let points = shape.points.iter().map(|p| p.map(|x| x as f32)).collect();
    Component::mesh(shape.counts.clone(), shape.corners.clone(), points).unwrap()
}

fn ball() -> Component {
    mesh(&shapes::sphere([1.0; 3], 5))
}

/// The filled ball: tets, and the surface with them.
fn body() -> Geometry {
    let ball = ball();
    let faces = ball.faces().unwrap();
    let surface = PolygonSurface { starts: faces.runs.starts(), corners: &faces.corners, points: ball.positions() };
    let solid =
        ClosedSurface::of(&surface, false).unwrap().fill(&FillSettings { spacing: 0.0, interior: true }).unwrap();
    let skin = ball.point_count() as i32;
    let mut tets = Component::tets(solid.tets, solid.points).unwrap();
    let rows = (0..tets.point_count() as i32).map(|k| if k < skin { k } else { -1 }).collect();
    tets.set(SURFACE_POINT, rows).unwrap();
    Geometry::from(tets).with(ball)
}

fn moved(mut part: Component, map: Map) -> Component {
    part.edit(P).unwrap().iter_mut().for_each(|p| *p = map(p.map(f64::from)).map(|x| x as f32));
    part
}

fn making(body: impl Into<Geometry>, shape: Component) -> Bench {
    bench(&NODE).input(BODY, body).input(SHAPE, shape)
}

/// `surface_point` of the samples' bodies is random in 0 to 3: a shape of four points fits.
fn four_points(_: usize, given: Geometry) -> Geometry {
    let points = given.mesh().unwrap().positions();
    if points.len() < 4 {
        return given;
    }
    Component::mesh(vec![3; 4], vec![0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3], points[..4].to_vec()).unwrap().into()
}

#[test]
fn it_conforms() {
    conformance(&NODE).with(|bench| bench.changed(SHAPE, four_points)).with(|bench| bench).run();
}

#[test]
fn the_interior_follows_an_affine_shape_exactly() {
    let map: Map = |[x, y, z]| [1.0 + 0.5 * x - y, 0.25 * z + 2.0 * y, 0.75 * z + 0.125 * x];
    let out = making(body(), moved(ball(), map)).set(FRAME, 24.0).set(STRENGTH, 50.0.into()).set(HOLD, 3.0).cook();
    let goal = out.part(Kind::Tets);
    for (rest, point) in body().tets().unwrap().positions().iter().zip(goal.positions()) {
        let at = map(rest.map(f64::from));
        assert!((0..3).all(|k| (f64::from(point[k]) - at[k]).abs() < 1e-6), "{rest:?}");
    }
    let once = |attribute| goal.get::<f32>(attribute).unwrap()[0];
    assert_eq!((once(GOAL_FRAME), once(GOAL_STRENGTH), once(GOAL_HOLD)), (24.0, 50.0, 3.0));
    // The determinant of [[1/2, −1, 0], [0, 2, 1/4], [1/8, 0, 3/4]] is 3/4 − 1/32.
    assert!((out.metrics["volume_ratio"] - 0.71875).abs() < 1e-6);
    assert_eq!((out.metrics["inverted_tets"], out.metrics["loose_points"]), (0.0, 0.0));
}

#[test]
fn the_surface_equals_the_shape_to_the_bit() {
    let shape = moved(ball(), |[x, y, z]| [x + 0.3 * y * y, 0.6 * y, z - 0.4 * x * y]);
    let out = making(body(), shape.clone()).cook();
    assert_eq!(out.part(Kind::Tets).positions()[..shape.point_count()], *shape.positions());
    assert!(out.metrics["residual"] <= 1.1e-10 && out.metrics["cg"] > 0.0, "{:?}", out.metrics);
}

#[test]
fn the_rest_shape_keeps_every_bit_and_other_arrays_are_shared() {
    let body = body();
    let out = making(body.clone(), ball()).cook();
    let (goal, rest) = (out.part(Kind::Tets), body.tets().unwrap());
    assert_eq!(goal.positions(), rest.positions());
    assert!(goal.topology().same(rest.topology()));
    let rows = |part: &Component| part.table(Owner::Point).column("surface_point").unwrap().address();
    assert_eq!(rows(goal), rows(rest));
    assert!(out.geometry.mesh().is_none(), "a goal consists of tets only");
}

#[test]
fn tets_inverted_by_a_self_crossing_shape_are_counted() {
    let out = making(body(), moved(ball(), |[x, y, z]| [x, if y > 0.0 { -2.0 * y } else { y }, z])).cook();
    assert!(out.metrics["inverted_tets"] > 50.0, "{:?}", out.metrics);
}

#[test]
fn a_shape_of_another_surface_is_refused_with_both_counts() {
    let refused = |body: Geometry, shape: Component| making(body, shape).try_cook().unwrap_err().fact;
    let other = mesh(&shapes::sphere([1.0; 3], 4));
    let own = format!("{} faces and {} points", ball().element_count(), ball().point_count());
    let (faces, points) = (other.element_count(), other.point_count());
    let fact = format!("`shape` has {faces} faces and {points} points, but the mesh that comes with `body` has {own}");
    assert_eq!(refused(body(), other.clone()), fact);
    let mut alone = body();
    alone.remove(Kind::Mesh);
    let fact = format!("`shape` has {points} points, but the surface of `body` has {}", ball().point_count());
    assert_eq!(refused(alone.clone(), other), fact);
    assert!(making(alone, ball()).try_cook().is_ok());

    let mut flipped = ball();
    let mut corners = flipped.faces().unwrap().corners.clone();
    corners.swap(0, 1);
    flipped = Component::mesh(flipped.faces().unwrap().runs.counts().collect(), corners, flipped.positions().to_vec())
        .unwrap();
    let points = ball().point_count();
    let fact =
        "join its {} points otherwise than those of the mesh that comes with `body`".replace("{}", &points.to_string());
    assert_eq!(refused(body(), flipped), format!("the faces of `shape` {fact}"));
}

#[test]
fn a_body_without_a_valid_surface_point_is_refused() {
    let with = |change: fn(&mut Component)| {
        let mut body = body();
        change(body.part_mut(Kind::Tets).unwrap());
        making(body, ball()).try_cook().unwrap_err().fact
    };
    let missing = with(|tets| drop(tets.remove(Owner::Point, "surface_point")));
    assert_eq!(missing, "`body` needs `surface_point`, which it does not have");
    let numbers = with(|tets| {
        let column = Column::new(vec![0.0_f32; tets.point_count()]);
        tets.set_column(Owner::Point, "surface_point", column).unwrap();
    });
    assert_eq!(numbers, "`body` needs `surface_point`, which is one float for each point");
    let mut alone = body();
    alone.remove(Kind::Mesh);
    alone.part_mut(Kind::Tets).unwrap().edit(SURFACE_POINT).unwrap().fill(-1);
    let none = making(alone, ball()).try_cook().unwrap_err().fact;
    assert_eq!(
        none,
        "`surface_point` of `body` is below 0 everywhere, and no mesh comes with it: it has no surface to shape"
    );
    let far = with(|tets| tets.edit(SURFACE_POINT).unwrap()[0] = 7000);
    assert!(far.starts_with("`surface_point` of `body` goes up to 7000, but its surface has "));
}

#[test]
fn a_keyed_strength_changes_only_the_strength() {
    let shape = moved(ball(), |[x, y, z]| [x + 0.3 * y * y, y, z]);
    let keyed = making(body(), shape).keyed(STRENGTH, &[(1.0, 10.0.into()), (5.0, 30.0.into())]);
    let frames = keyed.frames([1, 3]);
    let strength = |k: usize| frames[k].part(Kind::Tets).get(GOAL_STRENGTH).unwrap()[0];
    assert_eq!((strength(0), strength(1)), (10.0, 20.0));
    assert_eq!(frames[0].part(Kind::Tets).positions(), frames[1].part(Kind::Tets).positions());
    assert_eq!(frames[0].metrics["cg"], frames[1].metrics["cg"]);
}

/// A mask on the body's points becomes each particle's share of the strength; without one there is no such attribute.
#[test]
fn a_masked_strength_is_a_share_for_each_particle() {
    let masked = |share: fn(&[f32; 3]) -> f32| {
        let mut body = body();
        let shares: Vec<f32> = body.tets().unwrap().positions().iter().map(share).collect();
        body.part_mut(Kind::Tets).unwrap().set(Attr::<f32>::point("core"), shares.clone()).unwrap();
        (making(body, ball()).set(STRENGTH, Maskable { value: 50.0, attribute: Some("core".into()) }).cook(), shares)
    };
    let (upper, shares) = masked(|p| if p[1] > 0.0 { 0.5 } else { 0.0 });
    assert_eq!(upper.part(Kind::Tets).get(GOAL_SHARE), Some(&shares[..]));
    assert_eq!(upper.part(Kind::Tets).get(GOAL_STRENGTH), Some(&[50.0][..]));
    let free = shares.iter().filter(|share| **share == 0.0).count() as f64;
    assert_eq!((upper.metrics["idle"], upper.metrics["free_points"]), (0.0, free));
    let none = masked(|_| 0.0).0.metrics;
    assert_eq!((none["idle"], none["free_points"]), (1.0, shares.len() as f64));
    assert_eq!(making(body(), ball()).cook().part(Kind::Tets).get(GOAL_SHARE), None);
}

#[test]
fn a_start_that_is_not_before_the_frame_is_published() {
    let late = |start: f32| making(body(), ball()).set(FRAME, 24.0).set(START_FRAME, start).cook();
    assert_eq!([12.0, 24.0, 30.0].map(|start| late(start).metrics["late_start"]), [0.0, 1.0, 1.0]);
    assert_eq!(late(12.0).part(Kind::Tets).get(GOAL_START), Some(&[12.0][..]));
    assert_eq!(making(body(), ball()).cook().part(Kind::Tets).get(GOAL_START), Some(&[ALWAYS][..]));
}

/// The ball as a mesh that rides along in a cage.
fn caged() -> Geometry {
    let ball = ball();
    let faces = ball.faces().unwrap();
    let surface = PolygonSurface { starts: faces.runs.starts(), corners: &faces.corners, points: ball.positions() };
    let solid = CagedSurface::of(surface, 0.5, false).unwrap().fill().tets;
    let mut tets = Component::tets(solid.tets, solid.points).unwrap();
    let rows = vec![-1; tets.point_count()];
    tets.set(SURFACE_POINT, rows).unwrap();
    Geometry::from(tets).with(ball)
}

#[test]
fn a_caged_body_takes_the_shape_of_the_mesh_that_rides_along() {
    let sheared: Map = |[x, y, z]| [1.0 + 0.5 * x - y, 0.25 * z + 2.0 * y, 0.75 * z + 0.125 * x];
    let out = making(caged(), moved(ball(), sheared)).cook();
    for (rest, point) in caged().tets().unwrap().positions().iter().zip(out.part(Kind::Tets).positions()) {
        let at = sheared(rest.map(f64::from));
        assert!((0..3).all(|k| (f64::from(point[k]) - at[k]).abs() < 2e-6), "{point:?}, expected {at:?}");
    }
    assert!(out.metrics["shape_error"] < 1e-6, "{:?}", out.metrics);
    // A wave shorter than the tets.
    let wavy = moved(ball(), |[x, y, z]| [x, y + 0.3 * libm::sin(20.0 * x), z]);
    let out = making(caged(), wavy).cook();
    assert!(out.metrics["shape_error"] > 0.02, "{:?}", out.metrics);
    assert_eq!(out.metrics["loose_points"], 0.0);
}

#[test]
fn a_shape_of_another_mesh_than_the_one_that_rides_along_is_refused() {
    let other = mesh(&shapes::sphere([1.0; 3], 4));
    let fact = making(caged(), other).try_cook().unwrap_err().fact;
    assert!(fact.contains("but the mesh that comes with `body` has"), "{fact}");
}
