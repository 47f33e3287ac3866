use super::*;
use conformance::{Bench, BenchResult, bench, conformance};
use numerics::shapes;
use numerics::vector::to_f64;

fn mesh(shape: &shapes::Polygons) -> Component {
    let points = shape.points.iter().map(|point| point.map(|x| x as f32)).collect();
    Component::mesh(shape.counts.clone(), shape.corners.clone(), points).unwrap()
}

fn ball(n: usize, size: f64) -> Component {
    mesh(&shapes::sphere([size; 3], n))
}

fn filling(surface: impl Into<Geometry>) -> Bench {
    bench(&NODE).input(SURFACE, surface)
}

fn tets(out: &BenchResult) -> &Component {
    out.part(Kind::Tets)
}

fn volume(tets: &Component, which: impl Fn(usize) -> bool) -> f64 {
    let at = |corner: u32| to_f64(tets.positions()[corner as usize]);
    let one = |corners: &[u32; 4]| {
        let [a, b, c, d] = corners.map(at);
        (b - a).dot(&(c - a).cross(&(d - a))) / 6.0
    };
    tets.tet_corners().iter().enumerate().filter(|(tet, _)| which(*tet)).map(|(_, corners)| one(corners)).sum()
}

/// The mesh with its faces reversed.
fn inside_out(_: usize, given: Geometry) -> Geometry {
    let mesh = given.mesh().unwrap();
    let faces = mesh.faces().unwrap();
    let turned =
        Faces { runs: faces.runs.clone(), corners: faces.iter().flat_map(|face| face.iter().rev().copied()).collect() };
    let tables = Owner::ALL.map(|owner| mesh.table(owner).clone());
    let turned = Component::from_tables(Topology::Mesh(turned.into()), tables).unwrap();
    given.with(turned)
}

#[test]
fn it_conforms() {
    conformance(&NODE)
        .with(|bench| bench)
        .with(|bench| bench.changed(SURFACE, inside_out))
        .with(|bench| bench.set(METHOD, Method::Cage))
        .run();
}

#[test]
fn a_cube_is_five_or_six_tets_of_its_volume_and_is_passed_on() {
    let cube = mesh(&shapes::block([2.0, 1.0, 1.0], [1; 3]));
    let out = filling(cube.clone()).set(INTERIOR, false).cook();
    assert!((5..=6).contains(&tets(&out).element_count()));
    assert!((volume(tets(&out), |_| true) - 2.0).abs() < 1e-14);
    assert_eq!(tets(&out).positions(), cube.positions());
    let address = |mesh: &Component| mesh.table(Owner::Point).column("P").unwrap().address();
    assert_eq!(address(out.mesh()), address(&cube), "the surface is the input mesh itself");
    assert_eq!(tets(&out).get(SURFACE_POINT).unwrap(), [0, 1, 2, 3, 4, 5, 6, 7]);
    assert_eq!(tets(&out).get(SIDE).unwrap(), [1; 8]);
    assert_eq!((out.metrics["missing_faces"], out.metrics["repairs"]), (0.0, 0.0));
    assert!(out.metrics["volume_error"] < 1e-14);
}

#[test]
fn inner_points_are_marked_and_make_good_tets() {
    let ball = ball(8, 0.2);
    let n = ball.point_count();
    let out = filling(ball).cook();
    let tets = tets(&out);
    assert!(tets.point_count() > 2 * n);
    assert!(tets.get(SURFACE_POINT).unwrap()[n..].iter().all(|point| *point == -1));
    assert!(tets.get(SIDE).unwrap()[n..].iter().all(|side| *side == 0));
    assert_eq!(tets.get(SLIVER).unwrap().iter().sum::<i32>(), out.metrics["slivers"] as i32);
    assert!(out.metrics["quality_median"] > 0.7 && out.metrics["volume_error"] < 1e-6, "{:?}", out.metrics);
    assert!(out.metrics["min_dihedral"] > 0.01);
    let fine = filling(self::ball(8, 0.2)).set(SPACING, 0.01).cook();
    assert!(fine.metrics["tets"] > out.metrics["tets"]);
}

#[test]
fn an_egg_is_a_white_around_a_yolk() {
    let egg = ball(8, 0.06).concat(&ball(6, 0.03)).unwrap().concat(&ball(6, 0.0298)).unwrap();
    let out = filling(egg).cook();
    assert_eq!(out.metrics["bodies"], 2.0);
    assert!(out.metrics["repairs"] > 0.0, "the wall of the cavity faced outwards");
    let body = tets(&out).get(BODY_NUMBER).unwrap();
    let (white, yolk) = (volume(tets(&out), |tet| body[tet] == 0), volume(tets(&out), |tet| body[tet] == 1));
    let all = |n: usize, size: f64| volume(tets(&filling(ball(n, size)).cook()), |_| true);
    assert!((white / (all(8, 0.06) - all(6, 0.03)) - 1.0).abs() < 1e-5);
    assert!((yolk / all(6, 0.0298) - 1.0).abs() < 1e-5);
    let sides = tets(&out).get(SIDE).unwrap();
    let points = |side: i32| sides.iter().filter(|other| **other == side).count();
    assert_eq!(
        (points(1), points(2)),
        (ball(8, 1.0).point_count() + ball(6, 1.0).point_count(), ball(6, 1.0).point_count(),)
    );
}

/// An inside-out cube whose faces each have their own points, with an unused point and a duplicate face.
fn untidy() -> Component {
    let cube = mesh(&shapes::block([1.0; 3], [1; 3]));
    let mut points = vec![[7.0, 8.0, 9.0]];
    points.extend(cube.faces().unwrap().corners.iter().rev().map(|corner| cube.positions()[*corner as usize]));
    let corners: Vec<u32> = (1..=24).chain(1..=4).collect();
    let mut untidy = Component::mesh(vec![4; 7], corners, points).unwrap();
    untidy.set(Attr::<f32>::point("heat"), (0..25).map(|k| k as f32).collect()).unwrap();
    untidy.set(Attr::<i32>::element("paint"), (0..7).collect()).unwrap();
    untidy.set(Attr::<f32>::once("made"), vec![1.5]).unwrap();
    untidy
}

#[test]
fn repairs_keep_attributes_with_their_points_and_faces() {
    let out = filling(untidy()).cook();
    let mesh = out.mesh();
    assert_eq!((mesh.point_count(), mesh.element_count()), (8, 6));
    assert_eq!(tets(&out).positions()[..8], *mesh.positions());
    let heat = mesh.get(Attr::<f32>::point("heat")).unwrap();
    for (heat, point) in heat.iter().zip(mesh.positions()) {
        assert_eq!(untidy().positions()[*heat as usize], *point);
    }
    assert_eq!(mesh.get(Attr::<i32>::element("paint")).unwrap(), [0, 1, 2, 3, 4, 5]);
    assert_eq!(mesh.get(Attr::<f32>::once("made")).unwrap(), [1.5]);
    assert!((volume(tets(&out), |_| true) - 1.0).abs() < 1e-12);
    // 16 points merged and 1 removed, 1 face removed and 6 flipped.
    assert_eq!(out.metrics["repairs"], 24.0);
}

#[test]
fn defects_that_cannot_or_must_not_be_repaired_are_refused_with_their_location() {
    let fact = |bench: Bench| bench.try_cook().unwrap_err().to_string();
    assert_eq!(
        fact(filling(untidy()).set(REPAIR, Repair::None)),
        "faces 0 and 6 have the same points; `repair` \"safe\" removes them"
    );
    let sheet = mesh(&shapes::grid([1.0; 2], 1));
    assert_eq!(
        fact(filling(sheet)),
        "the surface is open: the edge of face 0 between points 0 and 1 has no other face (4 such edges in all); close \
         the hole, or give a thin wall a thickness; or set `method` to \"cage\", which takes open surfaces"
    );
    let fine = fact(filling(ball(4, 1.0)).set(SPACING, 1e-4));
    assert!(fine.starts_with("a spacing of 0.0001 m would make about 7"), "{fine}");
    assert!(fine.ends_with("e11 points, expected at most 4.19e6; make `spacing` larger"), "{fine}");
}

#[test]
fn an_empty_surface_gives_no_body() {
    let none = Component::mesh(Vec::new(), Vec::new(), Vec::new()).unwrap();
    let out = filling(none).cook();
    assert_eq!((tets(&out).element_count(), out.mesh().element_count(), out.metrics["tets"]), (0, 0, 0.0));
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let pair = ball(8, 0.2).concat(&ball(5, 0.1)).unwrap();
    let bits = |threads: usize| {
        let out = filling(pair.clone()).threads(threads).cook();
        let table =
            |owner: Owner| tets(&out).table(owner).iter().map(|(_, column)| column.to_bytes()).collect::<Vec<_>>();
        (tets(&out).tet_corners().to_vec(), table(Owner::Point), table(Owner::Element))
    };
    let one = bits(1);
    assert!(one == bits(2) && one == bits(7));
}

#[test]
fn pieces_lost_because_they_are_tiny_are_counted() {
    let moved = |mut part: Component| {
        part.edit(P).unwrap().iter_mut().for_each(|p| p[0] += 1.0);
        part
    };
    let lost = |size: f64| {
        let out = filling(moved(ball(3, size)).concat(&ball(4, 1.0)).unwrap()).cook();
        (out.metrics["lost_pieces"], out.metrics["bodies"])
    };
    assert_eq!(lost(0.1), (0.0, 2.0));
    assert_eq!(filling(untidy()).cook().metrics["lost_pieces"], 0.0, "a duplicate face is no loss");
    let tiny = ball(3, 1e-9).concat(&ball(3, 1e-9)).unwrap();
    let far = moved(ball(4, 1.0)).concat(&tiny).unwrap();
    let out = filling(far).cook();
    assert_eq!((out.metrics["lost_pieces"], out.metrics["bodies"]), (1.0, 1.0));
}

/// A unit cube of n × n quads a side without its lower side.
fn open_box(n: usize) -> Component {
    let whole = mesh(&shapes::block([1.0; 3], [n; 3]));
    let lower = |face: &&[u32]| !face.iter().all(|corner| whole.positions()[*corner as usize][1] < -0.49);
    let faces: Vec<&[u32]> = whole.faces().unwrap().iter().filter(lower).collect();
    let counts = faces.iter().map(|face| face.len() as u32).collect();
    Component::mesh(counts, faces.concat(), whole.positions().to_vec()).unwrap()
}

#[test]
fn an_open_box_is_caged_and_rides_along() {
    let open = open_box(8);
    let refused = filling(open.clone()).try_cook().unwrap_err().to_string();
    assert!(refused.contains("set `method` to \"cage\""), "{refused}");
    let out = filling(open.clone()).set(METHOD, Method::Cage).set(SPACING, 0.1).cook();
    let address = |mesh: &Component| mesh.table(Owner::Point).column("P").unwrap().address();
    assert_eq!(address(out.mesh()), address(&open), "the surface rides along as it is");
    assert!(tets(&out).get(SURFACE_POINT).unwrap().iter().all(|point| *point == -1));
    assert_eq!((out.metrics["bodies"], out.metrics["slivers"]), (1.0, 0.0));
    let fill = tets(&out).get(FILL).unwrap();
    assert!(fill.contains(&1.0) && fill.iter().all(|fill| (0.0625..=1.0).contains(fill)));
    let sides = tets(&out).get(SIDE).unwrap();
    assert!(sides.contains(&0) && sides.contains(&1) && !sides.contains(&2));
    let middle = |tet: usize| tets(&out).tet_corners()[tet].map(|corner| tets(&out).positions()[corner as usize]);
    let inside = |tet: &usize| middle(*tet).iter().flatten().all(|x| x.abs() < 0.4);
    assert!((0..fill.len()).filter(inside).all(|tet| fill[tet] == 1.0), "what the box surrounds is full");
}

#[test]
fn a_finer_mesh_rides_along_instead_of_the_surface() {
    let (coarse, fine) = (ball(4, 0.2), ball(16, 0.2));
    for method in [Method::Delaunay, Method::Cage] {
        let out = filling(coarse.clone()).input(CARRY, fine.clone()).set(METHOD, method).cook();
        assert_eq!(out.mesh().positions(), fine.positions());
        assert!(tets(&out).get(SURFACE_POINT).unwrap().iter().all(|point| *point == -1));
        let alone = filling(coarse.clone()).set(METHOD, method).cook();
        assert_eq!(tets(&out).positions(), tets(&alone).positions(), "the tets are those of the surface");
        assert_eq!(tets(&out).get(SIDE), tets(&alone).get(SIDE));
    }
}

#[test]
fn point_attributes_are_carried_to_the_tets_from_the_nearest_point() {
    let mut ball = ball(8, 0.2);
    let right: Vec<f32> = ball.positions().iter().map(|p| if p[0] > 0.0 { 1.0 } else { 0.25 }).collect();
    ball.set(Attr::<f32>::point("soft"), right.clone()).unwrap();
    ball.set(Attr::<[f32; 3]>::point("place"), ball.positions().to_vec()).unwrap();
    ball.set(Attr::<i32>::element("paint"), vec![1; ball.element_count()]).unwrap();
    for method in [Method::Delaunay, Method::Cage] {
        let out = filling(ball.clone()).set(METHOD, method).cook();
        let tets = tets(&out);
        let soft = tets.get(Attr::<f32>::point("soft")).unwrap();
        let place = tets.get(Attr::<[f32; 3]>::point("place")).unwrap();
        if method == Method::Delaunay {
            assert_eq!(soft[..right.len()], right);
            assert_eq!(place[..right.len()], *ball.positions());
        }
        for ((p, soft), place) in tets.positions().iter().zip(soft).zip(place) {
            let row = ball.positions().iter().position(|own| own == place).unwrap();
            assert_eq!(*soft, right[row], "both are of the same point");
            let distance = |own: &[f32; 3]| (to_f64(*own) - to_f64(*p)).norm();
            let least = ball.positions().iter().map(distance).fold(f64::INFINITY, f64::min);
            assert!(distance(place) <= 1.2 * least + 0.01, "{place:?} is near {p:?}");
        }
        assert!(tets.get(Attr::<i32>::element("paint")).is_none(), "faces have no tets");
    }
}
