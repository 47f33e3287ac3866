use super::*;
use numerics::vector::{cross, length, sub};

/// The faces of a box, counter-clockwise seen from outside.
fn cuboid(low: [f32; 3], high: [f32; 3], color: [f32; 3]) -> Vec<[Corner; 3]> {
    let corner = |bits: usize| {
        let at = [0, 1, 2].map(|k| if bits >> k & 1 == 0 { low[k] } else { high[k] });
        Corner { at, normal: [0.0, 1.0, 0.0], color }
    };
    let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    quads.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).map(|face| face.map(corner)).collect()
}

fn area(triangles: &[[Corner; 3]], unlit: bool) -> f32 {
    let faces = triangles.iter().filter(|face| (face[0].normal == Corner::UNLIT) == unlit);
    faces.map(|[a, b, c]| 0.5 * length(cross(sub(b.at, a.at), sub(c.at, a.at)))).sum()
}

const X: Plane = Plane { axis: 0, at: 0.25 };

#[test]
fn a_cut_box_is_closed_by_a_flat_face_in_its_colour() {
    for axis in 0..3 {
        let cut = Plane { axis, at: 0.25 }.cut(cuboid([0.0; 3], [1.0; 3], [0.2, 0.3, 0.4]));
        assert!((area(&cut, true) - 1.0).abs() < 1e-5, "{axis}");
        assert!((area(&cut, false) - 2.0).abs() < 1e-5, "{axis}");
        let faces = cut.iter().flatten().filter(|corner| corner.normal == Corner::UNLIT);
        assert!(faces.clone().all(|corner| corner.at[axis] == 0.25));
        assert!(
            faces
                .flat_map(|corner| corner.color)
                .zip([0.2, 0.3, 0.4].iter().cycle())
                .all(|(a, b)| (a - b).abs() < 1e-6)
        );
    }
}

#[test]
fn a_hollow_is_open_and_an_overlap_is_filled_once() {
    let hole: Vec<_> =
        cuboid([0.0, 0.25, 0.25], [0.5, 0.75, 0.75], [0.5; 3]).into_iter().map(|[a, b, c]| [a, c, b]).collect();
    let hollow = [cuboid([0.0; 3], [1.0; 3], [0.5; 3]), hole].concat();
    assert!((area(&X.cut(hollow), true) - 0.75).abs() < 1e-5);
    let both = [cuboid([0.0; 3], [1.0; 3], [0.5; 3]), cuboid([0.0, 0.5, 0.0], [1.0, 1.5, 1.0], [0.5; 3])].concat();
    assert!((area(&X.cut(both), true) - 1.5).abs() < 1e-5);
}

#[test]
fn an_open_surface_gets_no_face_and_what_the_plane_misses_is_unchanged() {
    let sheet = cuboid([0.0; 3], [1.0; 3], [0.5; 3])[4..6].to_vec();
    assert_eq!(area(&X.cut(sheet), true), 0.0);
    let whole = cuboid([-1.0; 3], [0.0; 3], [0.5; 3]);
    assert_eq!(X.cut(whole.clone()).len(), whole.len());
    assert!(X.cut(cuboid([0.5; 3], [1.0; 3], [0.5; 3])).is_empty());
}

#[test]
fn a_line_is_cut_into_its_kept_pieces() {
    let line = [0.0_f32, 0.5, 0.75, 0.0, 0.25].map(|x| [x, 1.0, 2.0]);
    let at = |x: f32| [x, 1.0, 2.0];
    let pieces: Vec<_> = X.pieces(&line).into_iter().filter(|piece| piece.len() > 1).collect();
    assert_eq!(pieces, [vec![at(0.0), at(0.25)], vec![at(0.25), at(0.0), at(0.25)]]);
    assert!(X.pieces(&line[1..3]).iter().all(Vec::is_empty));
}

#[test]
fn a_plane_is_an_axis_and_a_position() {
    assert_eq!("x=0".parse(), Ok(Clip { axis: 0, value: 0.0 }));
    assert_eq!("z = -0.25".parse(), Ok(Clip { axis: 2, value: -0.25 }));
    for wrong in ["x", "w=1", "x=near", "y=inf", ""] {
        let error = wrong.parse::<Clip>().unwrap_err();
        assert_eq!(error, format!("`{wrong}` is not a plane, expected an axis and a position in metres like `x=0`"));
    }
}
