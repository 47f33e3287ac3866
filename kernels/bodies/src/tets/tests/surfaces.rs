//! Repairs and faults.

use super::super::{ClosedSurface, PolygonSurface, RepairCounts, SurfaceFault};
use super::{Mesh, ball, block, joined};

fn close(mesh: &Mesh, repair: bool) -> Result<ClosedSurface, SurfaceFault> {
    let starts: Vec<u32> = mesh.starts();
    ClosedSurface::of(&PolygonSurface { starts: &starts, corners: &mesh.corners, points: &mesh.points }, repair)
}

/// The fault with this text, with and without repairs.
fn refused(mesh: &Mesh, text: &str) {
    for repair in [false, true] {
        assert_eq!(close(mesh, repair).unwrap_err().to_string(), text);
    }
}

/// The fault with this text unless repairs are allowed.
fn repaired(mesh: &Mesh, text: &str) -> ClosedSurface {
    assert_eq!(close(mesh, false).unwrap_err().to_string(), text);
    let closed = close(mesh, true).unwrap();
    assert!(!closed.changes.is_none());
    // A repaired surface needs no further repair.
    let counts = closed.starts.windows(2).map(|run| run[1] - run[0]).collect();
    let again = Mesh { counts, corners: closed.corners.clone(), points: closed.points.clone() };
    let again = close(&again, false).unwrap();
    assert_eq!((again.corners, again.points), (closed.corners.clone(), closed.points.clone()));
    closed
}

#[test]
fn a_valid_cube_is_unchanged() {
    let cube = block([1.0; 3], [0.0; 3]);
    let closed = close(&cube, false).unwrap();
    assert_eq!((closed.changes, closed.bodies), (RepairCounts::default(), 1));
    assert_eq!((closed.corners.clone(), closed.points.clone()), (cube.corners, cube.points));
    assert_eq!((closed.volume(), closed.mean_edge(), closed.edges().len()), (1.0, 1.0, 12));
}

#[test]
fn an_empty_surface_is_closed() {
    let closed = close(&Mesh::default(), false).unwrap();
    assert_eq!((closed.volume(), closed.mean_edge(), closed.bodies), (0.0, 0.0, 0));
}

#[test]
fn duplicate_points_along_seams_are_merged() {
    // Each face of the cube has its own points.
    let cube = block([1.0; 3], [0.0; 3]);
    let points = cube.corners.iter().map(|corner| cube.points[*corner as usize]).collect();
    let cut = Mesh { corners: (0..24).collect(), points, counts: cube.counts.clone() };
    let closed = repaired(&cut, "points 1 and 4 have the same position (16 such points in all)");
    assert_eq!((closed.points.len(), closed.changes.joined_points), (8, 16));
    assert_eq!(closed.volume(), 1.0);
    assert!(closed.source_points.windows(2).all(|pair| pair[0] < pair[1]));
}

#[test]
fn touching_bodies_keep_separate_points() {
    let two = joined(&[block([1.0; 3], [0.0; 3]), block([1.0; 3], [1.0, 0.0, 0.0])]);
    let closed = close(&two, false).unwrap();
    assert_eq!((closed.points.len(), closed.bodies), (16, 2));
}

#[test]
fn faces_with_two_points_are_dropped() {
    let mut cube = block([1.0; 3], [0.0; 3]);
    cube.face(&[0, 1, 0]);
    cube.face(&[2, 2, 3]);
    let closed = repaired(&cube, "face 6 uses a point twice (2 such faces in all)");
    assert_eq!((closed.changes.dropped_faces, closed.source_faces), (2, vec![0, 1, 2, 3, 4, 5]));
}

#[test]
fn a_duplicate_face_is_dropped() {
    let mut cube = block([1.0; 3], [0.0; 3]);
    let mut again = cube.corners[4..8].to_vec();
    again.rotate_left(1);
    cube.face(&again);
    again.reverse();
    cube.face(&again);
    let closed = repaired(&cube, "faces 1 and 6 have the same points (2 such pairs in all)");
    assert_eq!((closed.changes.dropped_faces, closed.volume()), (2, 1.0));
}

#[test]
fn an_unused_point_is_dropped() {
    let mut cube = block([1.0; 3], [0.0; 3]);
    cube.points.insert(0, [9.0; 3]);
    cube.corners.iter_mut().for_each(|corner| *corner += 1);
    let closed = repaired(&cube, "point 0 has no face");
    assert_eq!((closed.points.len(), closed.source_points[0], closed.volume()), (8, 1, 1.0));
}

#[test]
fn faces_and_shells_with_wrong_orientation_are_flipped() {
    let mut cube = block([1.0; 3], [0.0; 3]);
    cube.corners[4..8].reverse();
    let closed = repaired(&cube, "faces 1 and 4 have opposite orientations (4 such pairs in all)");
    assert_eq!((closed.changes.turned_faces, closed.volume()), (1, 1.0));
    let mut cube = block([1.0; 3], [0.0; 3]);
    cube.corners.reverse();
    let closed = repaired(&cube, "the shell with face 0 faces inwards");
    assert_eq!((closed.changes.turned_faces, closed.volume()), (6, 1.0));
    assert_eq!(closed.face(2)[0], cube.corners[8], "the first corner stays the first");
}

#[test]
fn nested_shells_alternate_between_bodies_and_cavities() {
    // Four nested boxes, all facing outwards: wall, cavity, wall, cavity.
    let nested = |k: usize| block([4.0 - k as f32; 3], [0.5 * k as f32; 3]);
    let all = joined(&[nested(2), nested(0), nested(3), nested(1)]);
    let closed = repaired(&all, "the shell with face 12 faces away from the cavity it bounds (2 such shells in all)");
    assert_eq!(closed.volume(), 64.0 - 27.0 + 8.0 - 1.0);
    assert_eq!(closed.bodies, 2);
    assert_eq!(closed.changes.turned_faces, 12);
}

#[test]
fn holes_and_non_manifold_edges_are_refused() {
    let mut open = block([1.0; 3], [0.0; 3]);
    open.counts.pop();
    open.corners.truncate(20);
    let (points, face) = open_edge(&open);
    let text = format!(
        "the surface is open: the edge of face {face} between points {} and {} has no other face (4 such edges in all)",
        points[0], points[1]
    );
    refused(&open, &text);
    let mut fin = block([1.0; 3], [0.0; 3]);
    fin.points.push([2.0, 2.0, 0.5]);
    let (a, b) = (fin.corners[0].min(fin.corners[1]), fin.corners[0].max(fin.corners[1]));
    fin.face(&[a, b, 8]);
    refused(&fin, &format!("the edge between points {a} and {b} has 3 faces, expected 2"));
}

fn open_edge(mesh: &Mesh) -> ([u32; 2], usize) {
    let sides = mesh.sides();
    let alone = |side: &&([u32; 2], usize)| sides.iter().filter(|other| other.0 == side.0).count() == 1;
    *sides.iter().filter(alone).min().unwrap()
}

#[test]
fn surfaces_without_an_inside_are_refused() {
    let mut flat =
        Mesh { points: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.2, 0.2, 0.0]], ..Mesh::default() };
    [[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]].iter().for_each(|face| flat.face(face));
    refused(&flat, "the shell with face 0 encloses no volume");
    // A grid of n × n quads with joined ends, one pair of them reversed: a Klein bottle.
    let n = 5;
    let points = (0..n * n).map(|k| [k as f32, (k * k % 17) as f32, (k * k * k % 23) as f32]).collect();
    let mut bottle = Mesh { points, ..Mesh::default() };
    let at = |i: u32, j: u32| {
        let j = if i < n { j % n } else { (2 * n - j) % n };
        (i % n) * n + j
    };
    for i in 0..n {
        (0..n).for_each(|j| bottle.face(&[at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]));
    }
    assert!(matches!(close(&bottle, true), Err(SurfaceFault::NonOrientable { .. })));
    // Without repairs, inconsistent orientation is reported first.
    assert!(matches!(
        close(&bottle, false),
        Err(SurfaceFault::InconsistentOrientation { .. } | SurfaceFault::NonOrientable { .. })
    ));
}

#[test]
fn self_intersecting_surfaces_are_refused() {
    let crossed = joined(&[block([1.0; 3], [0.0; 3]), block([1.0; 3], [0.5, 0.3, 0.2])]);
    let fault = close(&crossed, true).unwrap_err();
    let SurfaceFault::SelfIntersection { faces, count, .. } = fault else { panic!("{fault}") };
    assert!(faces[0] < 6 && (6..12).contains(&faces[1]) && count > 1, "{faces:?} {count}");
    // A spike of a ball pulled through the opposite side.
    let mut ball = ball(4, 1.0);
    let top = (0..ball.points.len()).max_by(|a, b| ball.points[*a][1].total_cmp(&ball.points[*b][1])).unwrap();
    ball.points[top] = [0.1, -1.7, 0.05];
    assert!(matches!(close(&ball, true), Err(SurfaceFault::SelfIntersection { .. })));
}

#[test]
fn overlapping_shells_without_face_intersections_are_refused_when_filled() {
    // Two boxes of the same height and depth: their faces intersect only in edges.
    let overlapping = joined(&[block([1.0; 3], [0.0; 3]), block([1.0; 3], [0.5, 0.0, 0.0])]);
    let closed = close(&overlapping, true).unwrap();
    let fault = closed.fill(&super::super::FillSettings { spacing: 0.2, interior: true }).unwrap_err();
    assert!(matches!(fault, SurfaceFault::SelfOverlap { .. }), "{fault}");
}

#[test]
fn non_finite_points_are_refused() {
    let mut cube = block([1.0; 3], [0.0; 3]);
    cube.points[3][1] = f32::NAN;
    refused(&cube, "point 3 is not finite");
}
