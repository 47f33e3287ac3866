//! Attributes that depend on the motion of bodies.

use super::*;

const FACE_N: Attr<[f32; 3]> = Attr::element("N");

/// A cube with its surface, which has velocities and normals of before.
fn dressed(low: [f32; 3]) -> Geometry {
    let cube = block([1; 3], low, [0.1; 3]);
    let mut mesh = solid(low, 0.1);
    let (points, faces) = (mesh.point_count(), mesh.element_count());
    mesh.set(V, vec![[1.0, 0.0, 0.0]; points]).unwrap();
    mesh.set(N, vec![[0.0, 1.0, 0.0]; points]).unwrap();
    mesh.set(ORIENT, vec![[0.0, 0.0, 0.0, 1.0]; points]).unwrap();
    let triangles = mesh.triangles();
    let normal = |corners: &[u32; 3]| {
        let [a, b, c] = corners.map(|corner| mesh.positions()[corner as usize]);
        numerics::vector::unit(numerics::vector::cross(numerics::vector::sub(b, a), numerics::vector::sub(c, a)))
            .unwrap()
    };
    assert_eq!(triangles.corners.len(), faces);
    let normals = triangles.corners.iter().map(normal).collect();
    mesh.set(FACE_N, normals).unwrap();
    let mut cube = cube;
    cube.set(V, vec![[1.0, 0.0, 0.0]; cube.point_count()]).unwrap();
    cube.set(N, vec![[0.0, 1.0, 0.0]; cube.point_count()]).unwrap();
    cube.set(SURFACE_POINT, (0..cube.point_count() as i32).collect()).unwrap();
    Geometry::from(cube).with(mesh)
}

/// A body that is thrown and falls has v + g·t everywhere, in seconds of the scene.
#[test]
fn velocities_are_those_of_the_simulation() {
    for scale in [1.0_f32, 0.5] {
        let thrown = simulating(dressed([0.0; 3])).set(INITIAL_VELOCITY, [0.3, 0.0, 0.0]).set(TIME_SCALE, scale);
        let frames = thrown.frames([1, 7]);
        for (frame, time) in frames.iter().zip([0.0, 6.0 * H * f64::from(scale)]) {
            let expected = [0.3 * f64::from(scale), -G * time * f64::from(scale), 0.0];
            for v in frame.mesh().get(V).unwrap() {
                assert!((0..3).all(|k| (f64::from(v[k]) - expected[k]).abs() < 1e-5), "{v:?} {expected:?}");
            }
            assert_eq!(frame.mesh().get(ORIENT), None);
        }
    }
}

/// Pins turn a body by a quarter: its normals turn with it. Those of faces are those that its faces have.
#[test]
fn normals_turn_with_the_surface() {
    let start = solid([0.0; 3], 0.1).positions().to_vec();
    let at = move |frame: Frame| {
        let angle = (frame.number() - 1.0).min(12.0) / 12.0 * 90.0_f64;
        let (sine, cosine) = libm::sincos(angle.to_radians());
        let turn = |p: &[f32; 3]| {
            let [x, y] =
                [f64::from(p[0]) * cosine - f64::from(p[1]) * sine, f64::from(p[0]) * sine + f64::from(p[1]) * cosine];
            [x as f32, y as f32, p[2]]
        };
        Geometry::from(pins(start.iter().map(turn).collect(), 0.01))
    };
    let frames = simulating(dressed([0.0; 3])).moving(PINS, at).set(GRAVITY, [0.0; 3]).frames([1, 13]);
    let mesh = frames[1].mesh();
    for n in mesh.get(N).unwrap() {
        assert!((n[0] + 1.0).abs() < 1e-5 && n[1].abs() < 1e-5, "{n:?}");
    }
    let before = frames[0].mesh().get(FACE_N).unwrap();
    for (before, now) in before.iter().zip(mesh.get(FACE_N).unwrap()) {
        let turned = [-before[1], before[0], before[2]];
        assert!((0..3).all(|k| (turned[k] - now[k]).abs() < 1e-5), "{before:?} {now:?}");
    }
}

#[test]
fn surface_points_count_on_over_all_bodies() {
    let caged =
        |low: f32| Geometry::from(block([2; 3], [low, 0.0, 0.0], [0.2; 3])).with(solid([low + 0.05, 0.05, 0.05], 0.1));
    let bodies = simulating(dressed([0.0; 3])).input(BODIES, caged(1.0)).input(BODIES, dressed([2.0, 0.0, 0.0]));
    let engine = Engine::new(&Settings::default()).unwrap();
    let (cooked, _) = cook_all(&engine, &bodies.graph(), &[Frame::whole(1)]);
    let surface = cooked[&(0, Frame::whole(1))].mesh().unwrap();
    let tets = cooked[&(1, Frame::whole(1))].tets().unwrap();
    assert_eq!(tets.get(N), None);
    let rows = tets.get(SURFACE_POINT).unwrap();
    for (row, place) in rows.iter().zip(tets.positions()) {
        assert!(*row < 0 || surface.positions()[*row as usize] == *place, "{row} {place:?}");
    }
    // Eight corners each of the first and the last; what rides along on the second corresponds to none of its points.
    assert_eq!(rows.iter().filter(|row| **row >= 0).count(), 16);
    assert!(rows[8..35].iter().all(|row| *row == -1), "{rows:?}");
}
