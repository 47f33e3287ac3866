//! Whole curves.

use super::*;
use numerics::masked::Masked;

const PLAIN: Masked<'static, f32> = Masked::uniform(0.0);
const WHOLE: Masked<'static, f32> = Masked::uniform(1.0);

pub(super) fn on<'a>(obstacles: &'a [&'a TriangleTree]) -> Collide<'a> {
    Collide {
        obstacles,
        skin: None,
        method: ContactMethod::Exact,
        gap: 1e-4.into(),
        offset_root: 1e-4.into(),
        offset_scale: None,
        loft: 0.0.into(),
        coherence: 0.0.into(),
        at_rest: None,
        blend: WHOLE,
        width: PLAIN,
    }
}

/// A square floor of two triangles at height 0.
pub(super) fn floor() -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let points = vec![[-9.0, 0.0, -9.0], [-9.0, 0.0, 9.0], [9.0, 0.0, 9.0], [9.0, 0.0, -9.0]];
    (points, vec![[0, 1, 2], [0, 2, 3]])
}

/// A sphere of radius 1 about the origin, by rows of quads.
pub(super) fn sphere(rows: u32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let columns = 2 * rows;
    let mut points = vec![[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]];
    for row in 1..rows {
        let (side, up) = libm::sincos(std::f64::consts::PI * f64::from(row) / f64::from(rows));
        for column in 0..columns {
            let (z, x) = libm::sincos(std::f64::consts::TAU * f64::from(column) / f64::from(columns));
            points.push([(x * side) as f32, up as f32, (z * side) as f32]);
        }
    }
    let at = |row: u32, column: u32| match row {
        0 => 0,
        row if row == rows => 1,
        row => 2 + (row - 1) * columns + column % columns,
    };
    let mut triangles = Vec::new();
    for row in 0..rows {
        for column in 0..columns {
            let [a, b, c, d] = [at(row, column), at(row, column + 1), at(row + 1, column + 1), at(row + 1, column)];
            if row > 0 {
                triangles.push([a, b, d]);
            }
            if row + 1 < rows {
                triangles.push([b, c, d]);
            }
        }
    }
    (points, triangles)
}

/// Upright fur on the unit sphere, and its shape in a wind along `wind`: each segment turned by half of the remaining
/// angle.
pub(super) fn fur(curves: u64, cvs: usize, long: f64, wind: DVec3) -> (Vec<u32>, Vec<Vec3>, Vec<Vec3>) {
    let (mut rest, mut goal) = (Vec::new(), Vec::new());
    for k in 0..curves {
        let up = random_unit(Key::new(5).of(k));
        let step = long / (cvs - 1) as f64;
        let lean = (up + random_vector(Key::new(6).of(k)) * 0.3).normalize();
        let mut direction = lean;
        let mut at = up * 1.001;
        for cv in 0..cvs {
            let straight = up * 1.001 + lean * (step * cv as f64);
            rest.push(straight.map(|x| x as f32).into());
            goal.push(at.map(|x| x as f32).into());
            direction =
                (direction + wind * (1.0 - direction.dot(&wind) * 0.5)).try_normalize(1e-3).unwrap_or(direction);
            at += direction * step;
        }
    }
    ((0..=curves as u32).map(|k| k * cvs as u32).collect(), rest, goal)
}

fn crossings(starts: &[u32], points: &[Vec3], (mesh, triangles): &(Vec<Vec3>, Vec<[u32; 3]>)) -> usize {
    let corners: Vec<_> = triangles.iter().map(|t| t.map(|corner| to_f64(mesh[corner as usize]))).collect();
    let segments = starts.windows(2).flat_map(|ends| points[ends[0] as usize..ends[1] as usize].windows(2));
    segments.filter(|pair| corners.iter().any(|corners| crosses(&to_f64(pair[0]), &to_f64(pair[1]), corners))).count()
}

pub(super) fn worst_length(starts: &[u32], goal: &[Vec3], points: &[Vec3]) -> f64 {
    let mut worst = 0.0_f64;
    for ends in starts.windows(2) {
        let cvs = ends[0] as usize..ends[1] as usize;
        let lengths = |points: &[Vec3]| -> Vec<f64> {
            points[cvs.clone()].windows(2).map(|pair| (to_f64(pair[1]) - to_f64(pair[0])).norm()).collect()
        };
        let (before, after) = (lengths(goal), lengths(points));
        let whole: f64 = before.iter().sum();
        for (a, b) in before.iter().zip(after) {
            worst = worst.max((a - b).abs() / whole);
        }
    }
    worst
}

#[test]
fn a_hair_blown_down_stops_one_gap_above_the_floor() {
    // From its root 0.1 above the floor a segment of length 1 is to point down: it stops at sin φ = 0.1, minus an arc
    // of 1e-4 at radius 1.
    let (points, triangles) = floor();
    let tree = TriangleTree::build(&points, &triangles);
    let obstacles = [&tree];
    let rest = [[0.0, 0.1, 0.0], [0.0, 1.1, 0.0]];
    let goal = [[0.0, 0.1, 0.0], [0.6, -0.7, 0.0]];
    let out = collide(&[0, 2], &rest, &goal, &on(&obstacles));
    let angle = libm::asin(0.1) - 1e-4;
    let tip = [libm::cos(angle), 0.1 - libm::sin(angle)];
    assert!((f64::from(out.points[1][0]) - tip[0]).abs() < 1e-6, "{:?} {tip:?}", out.points[1]);
    assert!((f64::from(out.points[1][1]) - tip[1]).abs() < 1e-6);
    assert_eq!((out.contacts, out.unfreed_segments, out.started_inside), (1, 0, 0));
}

#[test]
fn a_hair_without_contact_keeps_its_goal_s_bits() {
    let (points, triangles) = floor();
    let tree = TriangleTree::build(&points, &triangles);
    let obstacles = [&tree];
    let rest = [[0.0, 0.1, 0.0], [0.0, 0.4, 0.0], [0.0, 0.7, 0.0]];
    let goal = [[0.0, 0.1, 0.0], [0.17, 0.34, 0.03], [0.456, 0.41, 0.06]];
    assert_eq!(collide(&[0, 3], &rest, &goal, &on(&obstacles)).points, goal);
    let empty = TriangleTree::build(&[], &[]);
    assert_eq!(collide(&[0, 3], &rest, &goal, &on(&[&empty])).points, goal);
}

#[test]
fn a_segment_pushed_through_a_wall_by_the_previous_one_turns_out_of_it() {
    // The rest curve goes up, then hooks over to +x. Turning the first segment to +x hooks the second down through the
    // floor, from where it turns up again until it is free: level, one gap above the floor.
    let (points, triangles) = floor();
    let tree = TriangleTree::build(&points, &triangles);
    let obstacles = [&tree];
    let rest = [[0.0, 0.01, 0.0], [0.0, 0.51, 0.0], [0.5, 0.51, 0.0]];
    let goal = [[0.0, 0.01, 0.0], [0.5, 0.01, 0.0], [0.5, -0.49, 0.0]];
    let out = collide(&[0, 3], &rest, &goal, &on(&obstacles));
    assert_eq!((out.unfreed_segments, out.contacts), (0, 1));
    let [x, y, _] = out.points[2];
    assert!(y > 0.0 && y < 0.001 && x > 0.99, "{:?}", out.points[2]);
}

#[test]
fn exact_contact_stops_at_a_blade_that_steps_miss() {
    // A blade one degree wide at a third of the turn: ten steps of 9 degrees jump over it.
    let blade = |angle: f64| -> Vec3 { [(0.5 * libm::cos(angle)) as f32, (0.5 * libm::sin(angle)) as f32, 0.0] };
    let middle = 0.55;
    let mut points = vec![blade(middle), blade(middle + 0.017)];
    points.extend([[0.9, 0.55, -0.2], [0.9, 0.55, 0.2]]);
    let tree = TriangleTree::build(&points, &[[0, 2, 3], [1, 2, 3]]);
    let obstacles = [&tree];
    let (rest, goal) = ([[0.0; 3], [1.0, 0.0, 0.0]], [[0.0; 3], [0.0, 1.0, 0.0]]);
    let with = |method| collide(&[0, 2], &rest, &goal, &Collide { method, ..on(&obstacles) });
    let exact = with(ContactMethod::Exact);
    assert_eq!(exact.contacts, 1);
    let angle = libm::atan2(f64::from(exact.points[1][1]), f64::from(exact.points[1][0]));
    assert!(angle < middle && angle > middle - 0.05, "{angle}");
    assert_eq!(with(ContactMethod::Steps(10)).points[1], goal[1]);
}

#[test]
fn fur_in_any_wind_crosses_nothing_and_keeps_its_lengths() {
    let mesh = sphere(24);
    let tree = TriangleTree::build(&mesh.0, &mesh.1);
    let obstacles = [&tree];
    for (k, wind) in [DVec3::x(), -DVec3::y(), random_unit(Key::new(8))].iter().enumerate() {
        for (cvs, long) in [(2, 0.2), (5, 0.4), (12, 1.5)] {
            let (starts, rest, goal) = fur(400, cvs, long, *wind);
            assert_eq!(crossings(&starts, &rest, &mesh), 0);
            let before = crossings(&starts, &goal, &mesh);
            assert!(before > 20, "the wind of case {k} presses {before} segments into the skin");
            let out = collide(&starts, &rest, &goal, &on(&obstacles));
            assert_eq!(out.unfreed_segments, 0, "case {k}, {cvs} CVs");
            assert_eq!(crossings(&starts, &out.points, &mesh), 0);
            assert!(worst_length(&starts, &goal, &out.points) < 1e-6);
            assert_eq!(out.started_inside, 0);
        }
    }
}

#[test]
fn fur_with_coherence_crosses_nothing_either() {
    let mesh = sphere(12);
    let tree = TriangleTree::build(&mesh.0, &mesh.1);
    let obstacles = [&tree];
    let normals = normals(&mesh.0, &mesh.1);
    let skin = SkinSurface { tree: &tree, triangles: &mesh.1, normals: &normals };
    for (k, wind) in [DVec3::x(), -DVec3::y(), random_unit(Key::new(8))].iter().enumerate() {
        for coherence in [0.3, 1.0] {
            let (starts, rest, goal) = fur(1000, 6, 0.5, *wind);
            let how = Collide { skin: Some(skin), coherence: coherence.into(), ..on(&obstacles) };
            let out = collide(&starts, &rest, &goal, &how);
            assert_eq!(out.unfreed_segments, 0, "case {k}, {coherence}");
            assert_eq!(crossings(&starts, &out.points, &mesh), 0, "case {k}, {coherence}");
            assert!(worst_length(&starts, &goal, &out.points) < 1e-6);
        }
    }
}

#[test]
fn steps_converge_to_exact_with_order_1() {
    let mesh = sphere(24);
    let tree = TriangleTree::build(&mesh.0, &mesh.1);
    let obstacles = [&tree];
    let (starts, rest, goal) = fur(2000, 2, 0.3, DVec3::x());
    let exact = collide(&starts, &rest, &goal, &Collide { gap: 1e-9.into(), ..on(&obstacles) }).points;
    let error = |steps: u32| {
        let how = Collide { method: ContactMethod::Steps(steps), gap: 1e-9.into(), ..on(&obstacles) };
        let out = collide(&starts, &rest, &goal, &how).points;
        out.iter().zip(&exact).map(|(a, b)| f64::from(vector::length(vector::sub(*a, *b)))).sum::<f64>()
    };
    let errors = [2, 4, 8, 16, 32, 64, 128, 256].map(error);
    let slope = libm::log(errors[7] / errors[1]) / libm::log(256.0 / 4.0);
    assert!((-1.2..-0.8).contains(&slope), "{slope}: {errors:?}");
}

#[test]
fn the_skin_lifts_roots_and_keeps_goals_off() {
    let mesh = sphere(48);
    let tree = TriangleTree::build(&mesh.0, &mesh.1);
    let obstacles = [&tree];
    let normals = normals(&mesh.0, &mesh.1);
    let skin = SkinSurface { tree: &tree, triangles: &mesh.1, normals: &normals };
    let (starts, rest, goal) = fur(200, 5, 0.3, DVec3::x());
    let lifted = Collide { skin: Some(skin), offset_root: 0.01.into(), ..on(&obstacles) };
    let out = collide(&starts, &rest, &goal, &lifted);
    let height = |p: &Vec3| f64::from(vector::length(*p)) - 1.0;
    let roots: Vec<f64> = out.points.iter().step_by(5).map(height).collect();
    // A facet of π/48 by π/48 lies up to 2 (1 − cos(π/96)) below the sphere.
    assert!(roots.iter().all(|height| (0.0089..0.0101).contains(height)), "{roots:?}");
    for scale in [1.0, 0.5] {
        let kept =
            Collide { skin: Some(skin), offset_root: 0.0.into(), offset_scale: Some(scale.into()), ..on(&obstacles) };
        let out = collide(&starts, &rest, &goal, &kept);
        // Lengths are kept, so a CV lies slightly lower than requested, especially at a bend.
        let share: Vec<f64> = out.points.iter().zip(&rest).map(|(now, rest)| height(now) / height(rest)).collect();
        let low = share.iter().filter(|share| **share < 0.6 * scale).count();
        assert!(low < share.len() / 100, "{scale}: {low}");
        assert!(worst_length(&starts, &goal, &out.points) < 1e-6);
    }
}

#[test]
fn without_offset_roots_on_the_skin_keep_their_bits() {
    let mesh = sphere(24);
    let tree = TriangleTree::build(&mesh.0, &mesh.1);
    let obstacles = [&tree];
    let (starts, mut rest, mut goal) = fur(300, 4, 0.3, DVec3::x());
    // Roots on corners of the mesh: nothing is closer.
    for (k, ends) in starts.windows(2).enumerate() {
        let corner = to_f64(mesh.0[k % mesh.0.len()]);
        let base = to_f64(goal[ends[0] as usize]);
        let shift = corner - base;
        for cv in ends[0] as usize..ends[1] as usize {
            goal[cv] = (to_f64(goal[cv]) + shift).map(|x| x as f32).into();
            let u = 0.1 * (cv - ends[0] as usize) as f64;
            rest[cv] = (corner * (1.0 + u)).map(|x| x as f32).into();
        }
    }
    let out = collide(&starts, &rest, &goal, &Collide { offset_root: 0.0.into(), ..on(&obstacles) });
    for ends in starts.windows(2) {
        assert_eq!(out.points[ends[0] as usize], goal[ends[0] as usize]);
    }
    assert!(out.unfreed_segments < 5, "{}", out.unfreed_segments);
}

#[test]
fn blend_turns_back_towards_the_goal() {
    let (points, triangles) = floor();
    let tree = TriangleTree::build(&points, &triangles);
    let obstacles = [&tree];
    let (rest, goal) = ([[0.0, 0.5, 0.0], [0.0, 1.5, 0.0]], [[0.0, 0.5, 0.0], [0.8, -0.1, 0.0]]);
    let angle = |value: f32| {
        let how = Collide { blend: Masked::uniform(value), ..on(&obstacles) };
        let tip = collide(&[0, 2], &rest, &goal, &how).points[1];
        (libm::atan2(f64::from(0.5 - tip[1]), f64::from(tip[0])), tip)
    };
    let (whole, none) = (angle(1.0).0, angle(0.0).0);
    assert!((whole - (std::f64::consts::FRAC_PI_6 - 1e-4)).abs() < 1e-6);
    assert_eq!(angle(0.0).1, goal[1]);
    assert!((angle(0.25).0 - (none + 0.25 * (whole - none))).abs() < 1e-6);
}

#[test]
fn degenerate_curves_and_meshes_are_valid() {
    let nan = f32::NAN;
    // Triangles without area, a point, and NaN.
    let points = vec![[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [nan, 0.0, 0.0]];
    let tree = TriangleTree::build(&points, &[[0, 1, 2], [1, 1, 1], [0, 1, 3]]);
    let obstacles = [&tree];
    let equal = [[0.5, 0.1, 0.0]; 4];
    assert_eq!(collide(&[0, 4], &equal, &equal, &on(&obstacles)).points, equal);
    let one = [[0.5, 0.1, 0.0]];
    assert_eq!(collide(&[0, 1], &one, &one, &on(&obstacles)).points, one);
    let broken = [[0.0; 3], [nan, 1.0, 0.0]];
    let out = collide(&[0, 2], &broken, &broken, &on(&obstacles)).points;
    assert!(out[1][0].is_nan() && out[1][1] == 1.0);
    // Opposite directions turn about some axis, without a NaN.
    let (rest, goal) = ([[0.0, 1.0, 0.0], [0.0, 2.0, 0.0]], [[0.0, 1.0, 0.0], [0.0, 0.0, 0.0]]);
    let floor = floor();
    let tree = TriangleTree::build(&floor.0, &floor.1);
    let obstacles = [&tree];
    let out = collide(&[0, 2], &rest, &goal, &on(&obstacles));
    assert!(out.points[1].iter().all(|x| x.is_finite()));
    assert_eq!(crossings(&[0, 2], &out.points, &floor), 0);
}

#[test]
fn any_threads_and_any_path_give_the_same_bits() {
    let mesh = sphere(24);
    let tree = TriangleTree::build(&mesh.0, &mesh.1);
    let obstacles = [&tree];
    let normals = normals(&mesh.0, &mesh.1);
    let skin = SkinSurface { tree: &tree, triangles: &mesh.1, normals: &normals };
    let (starts, rest, goal) = fur(500, 5, 0.4, DVec3::x());
    let how =
        Collide { skin: Some(skin), offset_scale: Some(0.3.into()), width: Masked::uniform(1e-3), ..on(&obstacles) };
    let expected = collide(&starts, &rest, &goal, &how);
    for path in Path::all() {
        for threads in [1, 2, 7] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let out = pool.install(|| collide_on(path, &starts, &rest, &goal, &how));
            assert_eq!(out, expected, "{} on {threads} threads", path.name());
        }
    }
}
