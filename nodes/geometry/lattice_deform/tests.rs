use super::*;
use conformance::{Bench, bench, conformance};
use engine::geometry::Grid;
use numerics::shapes::{self, Polygons};

type Point = [f32; 3];

fn mesh(shape: &Polygons) -> Component {
    let points = shape.points.iter().map(|p| p.map(|x| x as f32)).collect();
    Component::mesh(shape.counts.clone(), shape.corners.clone(), points).unwrap()
}

fn ball() -> Component {
    mesh(&shapes::sphere([1.0; 3], 6))
}

fn deform(geometry: impl Into<Geometry>) -> Bench {
    bench(&NODE).input(GEOMETRY, geometry)
}

/// Offsets of the eight corners of the default box that give an affine map.
fn corners(offset: impl Fn([f64; 3]) -> [f64; 3]) -> Arc<Vec<Point>> {
    let corner = |k: usize| [k & 1, k >> 1 & 1, k >> 2].map(|k| k as f64 - 0.5);
    Arc::new((0..8).map(|k| offset(corner(k)).map(|x| x as f32)).collect())
}

/// Twice as wide.
fn wide() -> Arc<Vec<Point>> {
    corners(|[x, _, _]| [x, 0.0, 0.0])
}

#[test]
fn it_conforms() {
    let pulled = |bench: Bench| bench.set(OFFSETS, corners(|[x, y, z]| [0.3 * y, 0.2 * x * z, 0.1 + 0.1 * x]));
    // Two divisions along each axis, so that the bases differ, in a box smaller than the samples.
    let finer = |bench: Bench| {
        let mut offsets = vec![[0.0; 3]; 27];
        offsets[13] = [0.02, 0.05, -0.01];
        offsets[14] = [0.3, 0.0, 0.1];
        bench.set(DIVISIONS, [2; 3]).set(OFFSETS, Arc::new(offsets)).set(FROM, [-0.05; 3]).set(TO, [0.05, 0.06, 0.04])
    };
    conformance(&NODE).with(finer).with(pulled).with(|bench| bench).run();
}

#[test]
fn offsets_of_an_affine_map_give_that_map() {
    let map = |[x, y, z]: [f64; 3]| [1.0 + 0.5 * y - 0.25 * x, 0.75 * z, 0.5 * x - 0.5 * z];
    for basis in [LatticeBasis::Trilinear, LatticeBasis::Bernstein] {
        let out = deform(ball()).set(OFFSETS, corners(map)).set(BASIS, basis).cook();
        for (rest, point) in ball().positions().iter().zip(out.mesh().positions()) {
            let by = map(rest.map(f64::from));
            assert!((0..3).all(|k| (f64::from(point[k]) - f64::from(rest[k]) - by[k]).abs() < 1e-6));
        }
        // The determinant of [[3/4, 1/2, 0], [0, 1, 3/4], [1/2, 0, 1/2]] is 9/16.
        assert!((out.metrics["volume_ratio"] - 0.5625).abs() < 1e-6);
        assert!((out.metrics["min_jacobian"] - 0.5625).abs() < 1e-6);
        assert_eq!(out.metrics["folded"], 0.0);
    }
}

#[test]
fn zero_offsets_share_every_array_and_are_reported() {
    for offsets in [Vec::new(), vec![[0.0; 3]; 8]] {
        let mesh = ball();
        let out = deform(mesh.clone()).set(OFFSETS, Arc::new(offsets)).cook();
        assert_eq!(out.geometry.arrays(), Geometry::from(mesh).arrays());
        assert_eq!((out.metrics["folded"], out.metrics["volume_ratio"]), (0.0, 1.0));
    }
}

#[test]
fn only_positions_and_vectors_change() {
    let mut given = ball();
    given.set(V, vec![[1.0, 2.0, 3.0]; given.point_count()]).unwrap();
    given.set(PREF, vec![[7.0; 3]; given.point_count()]).unwrap();
    given.set(WIDTH, vec![0.5; given.point_count()]).unwrap();
    given.set(Attr::<[f32; 3]>::element("N"), vec![[1.0, 1.0, 0.0]; given.element_count()]).unwrap();
    let out = deform(given.clone()).set(OFFSETS, wide()).cook();
    let out = out.mesh();
    assert!(out.topology().same(given.topology()));
    for name in ["Pref", "width"] {
        let column = |mesh: &Component| mesh.table(Owner::Point).column(name).unwrap().address();
        assert_eq!(column(out), column(&given));
    }
    assert_eq!(out.get(V).unwrap()[3], [2.0, 2.0, 3.0]);
    // A face perpendicular to (1, 1) is perpendicular to (1, 2) after stretching along x.
    let [x, y, _] = out.get(Attr::<[f32; 3]>::element("N")).unwrap()[0];
    assert!((x - 0.2_f32.sqrt()).abs() < 1e-6 && (y - 0.8_f32.sqrt()).abs() < 1e-6);
}

#[test]
fn every_component_is_deformed_and_orientations_rotate() {
    // A quarter turn about z.
    let turn = corners(|[x, y, _]| [-y - x, x - y, 0.0]);
    let mut points = Component::points(vec![[0.5, 0.0, 0.25]]);
    points.set(ORIENT, vec![[0.0, 0.0, 0.0, 1.0]]).unwrap();
    let curves = Component::curves(vec![2], vec![[0.25, 0.0, 0.0], [0.5, 0.0, 0.0]]).unwrap();
    let tets = Component::tets(vec![[0, 1, 2, 3]], vec![[0.0; 3], [0.5, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 0.0, 0.5]]);
    let out = deform(Geometry::from(points).with(curves).with(tets.unwrap()).with(ball())).set(OFFSETS, turn).cook();
    let close =
        |a: &[Point], b: &[Point]| a.as_flattened().iter().zip(b.as_flattened()).all(|(a, b)| (a - b).abs() < 1e-6);
    assert!(close(out.part(Kind::Points).positions(), &[[0.0, 0.5, 0.25]]));
    assert!(close(out.curves().positions(), &[[0.0, 0.25, 0.0], [0.0, 0.5, 0.0]]));
    assert!(close(&out.part(Kind::Tets).positions()[2..], &[[-0.5, 0.0, 0.0], [0.0, 0.0, 0.5]]));
    let orient = out.part(Kind::Points).get(ORIENT).unwrap()[0];
    let h = std::f32::consts::FRAC_1_SQRT_2;
    assert!(orient.iter().zip([0.0, 0.0, h, h]).all(|(a, b)| (a - b).abs() < 1e-6), "{orient:?}");
}

#[test]
fn keyed_offsets_are_interpolated_linearly() {
    let still = Arc::new(vec![[0.0; 3]; 8]);
    let keyed = deform(Component::points(vec![[0.25, 0.0, 0.0]])).keyed(OFFSETS, &[(1.0, still), (5.0, wide())]);
    let at = |frame: f64| keyed.clone().at(frame).cook().part(Kind::Points).positions()[0];
    assert_eq!((at(1.0), at(3.0), at(9.0)), ([0.25, 0.0, 0.0], [0.375, 0.0, 0.0], [0.5, 0.0, 0.0]));
}

#[test]
fn outside_the_box_the_deformation_is_held_or_extrapolated() {
    let wide = deform(Component::points(vec![[1.5, 0.0, 9.0]])).set(OFFSETS, wide());
    let at = |outside| wide.clone().set(OUTSIDE, outside).cook().part(Kind::Points).positions()[0];
    assert_eq!(at(Extrapolation::Hold), [2.0, 0.0, 9.0]);
    assert_eq!(at(Extrapolation::Extend), [3.0, 0.0, 9.0]);
}

#[test]
fn folded_points_are_counted_and_have_negative_volume() {
    let out = deform(ball()).set(OFFSETS, corners(|[_, y, _]| [0.0, -1.5 * y, 0.0])).cook();
    assert_eq!(out.metrics["folded"], ball().point_count() as f64);
    assert!((out.metrics["min_jacobian"] + 0.5).abs() < 1e-6 && (out.metrics["volume_ratio"] + 0.5).abs() < 1e-6);
    let sheet = deform(mesh(&shapes::grid([1.0, 1.0], 3))).set(OFFSETS, wide()).cook();
    assert!(!sheet.metrics.contains_key("volume_ratio"), "an open sheet has none");
}

#[test]
fn invalid_lattices_are_refused() {
    let refused = |bench: Bench| bench.try_cook().unwrap_err();
    let count = refused(deform(ball()).set(OFFSETS, Arc::new(vec![[0.0; 3]; 9])));
    assert_eq!(count.fact, "`offsets` has 9 vectors for the control points of 1×1×1 divisions");
    assert_eq!(count.hint.as_deref(), Some("expected 2×2×2 = 8, or none"));
    let flat = refused(deform(ball()).set(OFFSETS, wide()).set(TO, [0.5, -0.5, 0.5]));
    assert_eq!(flat.fact, "`from` is [-0.5, -0.5, -0.5] and `to` [0.5, -0.5, 0.5], which is not a box");
    let mut volume = Geometry::default();
    let grid = Grid { origin: [0.0; 3], cell: 0.5, size: [1, 1, 1] };
    volume.put_volume(Volume::new(grid, vec![-0.25], [vec![0.0; 2], vec![0.0; 2], vec![0.0; 2]]).unwrap());
    assert!(refused(deform(volume).set(OFFSETS, wide())).fact.starts_with("a volume cannot be deformed"));
}

#[test]
fn extreme_positions_are_deformed_or_refused() {
    let at = |point: Point, outside| {
        deform(Component::points(vec![point])).set(OFFSETS, wide()).set(OUTSIDE, outside).try_cook()
    };
    assert_eq!(at([1e30, 0.0, 0.0], Extrapolation::Hold).unwrap().part(Kind::Points).positions(), [[1e30, 0.0, 0.0]]);
    assert_eq!(at([1e30, 0.0, 0.0], Extrapolation::Extend).unwrap().part(Kind::Points).positions(), [[2e30, 0.0, 0.0]]);
    assert_eq!(at([3e38, 0.0, 0.0], Extrapolation::Extend).unwrap_err().kind, ErrorKind::NotFinite);
    let empty = Component::curves(vec![], vec![]).unwrap();
    assert!(deform(empty).set(OFFSETS, wide()).cook().curves().positions().is_empty());
}
