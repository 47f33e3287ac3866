//! No tunnelling: fast vertices and edges, compared with brute force by another method.

use super::*;
use nalgebra::Matrix3;

/// Whether the segment from `p` crosses a triangle (Möller & Trumbore), and whether from above.
fn crossing_side(p: DVec3, displacement: DVec3, [a, b, c]: [DVec3; 3]) -> Option<bool> {
    let system = Matrix3::from_columns(&[-displacement, b - a, c - a]);
    let x = system.try_inverse()? * (p - a);
    let inside = x.iter().all(|x| (0.0..=1.0).contains(x)) && x[1] + x[2] <= 1.0;
    inside.then(|| (b - a).cross(&(c - a)).dot(&displacement) < 0.0)
}

/// Small triangles, and their positions after the motion.
fn specks(
    count: u64,
    size: f64,
    start: impl Fn(u64) -> DVec3,
    displacement: impl Fn(u64) -> DVec3,
) -> [Vec<[f64; 3]>; 2] {
    let from = (0..count).flat_map(|k| [0, 1, 2].map(|corner| (start(k) + random(77, 3 * k + corner) * size).into()));
    let from: Vec<[f64; 3]> = from.collect();
    let to = from.iter().zip(0..).map(|(p, index)| (DVec3::from(*p) + displacement(index / 3)).into()).collect();
    [from, to]
}

fn triples(count: u64) -> Vec<[u32; 3]> {
    (0..count as u32).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect()
}

#[test]
fn no_fast_vertex_tunnels_through_a_plate_or_a_blade() {
    const COUNT: u64 = 33_334;
    for (size, thickness) in [([1.0, 1e-3, 1.0], 1e-3), ([0.5, 1e-5, 0.05], 1e-3)] {
        let (points, faces) = cuboid(size);
        let displacement = DVec3::new(0.02, 0.1, -0.01);
        let moved: Vec<[f64; 3]> = points.iter().map(|p| (DVec3::from(*p) + displacement).into()).collect();
        let plate = Obstacle::new(&faces, &[pose(0.0, &points), pose(1.0, &moved)], 1.0, thickness, 0.5).unwrap();
        let above = |k: u64| {
            let p = random(1, k).component_mul(&DVec3::new(1.4 * size[0], 0.3, 1.4 * size[2]));
            DVec3::new(p.x, p.y + p.y.signum() * (0.5 * size[1] + 2e-5), p.z)
        };
        let [from, to] = specks(COUNT, 1e-5, above, |k| random(2, k).component_mul(&DVec3::new(0.3, 0.6, 0.3)));
        let skin = BodySkin::new(&from, &triples(COUNT), &[]).unwrap();
        let scene = CollisionScene { skins: &[skin], obstacles: &[plate], ..CollisionScene::default() };
        let contacts = find(&scene, &from, &to, [0.0, 1.0]);
        let mut of = vec![Vec::new(); from.len()];
        for contact in contacts.iter().filter(|contact| contact.weights == [1.0, 0.0, 0.0, 0.0]) {
            of[contact.points[0] as usize].push(contact);
        }
        let (mut through, mut near) = (0, 0);
        for vertex in 0..from.len() {
            let p = DVec3::from(from[vertex]);
            let relative = DVec3::from(to[vertex]) - p - displacement;
            let entered = faces.iter().any(|face| {
                crossing_side(p, relative, face.map(|corner| DVec3::from(points[corner as usize]))) == Some(true)
            });
            if entered {
                through += 1;
                let holds = |contact: &&Contact| {
                    let n = DVec3::from(contact.normal);
                    n.dot(&(p + displacement)) - contact.offset > -1e-12
                        && n.dot(&DVec3::from(to[vertex])) - contact.offset < 0.0
                };
                // It may also have moved around a corner; then at least one side has to stop it.
                assert!(of[vertex].iter().any(holds), "{vertex} went through: {:?}", of[vertex]);
            } else if vertex % 50 == 0 {
                let distance = |t: f64| {
                    let at = |face: &[u32; 3]| face.map(|corner| DVec3::from(points[corner as usize]));
                    let each = faces.iter().map(|face| ClosestPoint::on(0, p + relative * t, at(face)).distance);
                    each.fold(f64::INFINITY, f64::min)
                };
                let least = (0..=1000).map(|k| distance(f64::from(k) / 1000.0)).fold(f64::INFINITY, f64::min);
                near += usize::from(least < 1.99 * thickness);
                assert!(least > 1.99 * thickness || !of[vertex].is_empty(), "{vertex} came within {least}");
            }
        }
        assert!(through > 300 && near > 3, "{through} {near}");
    }
}

#[test]
fn no_fast_edge_tunnels_through_a_ridge() {
    const COUNT: u64 = 20_000;
    let tent = [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.4], [0.0, -1.0, -0.4]];
    let up = DVec3::new(0.03, 0.1, 0.02);
    let moved = tent.map(|p| (DVec3::from(p) + up).into());
    let ridge = Obstacle::new(&[[0, 2, 1], [0, 1, 3]], &[pose(0.0, &tent), pose(1.0, &moved)], 1.0, 1e-3, 0.5).unwrap();
    let mut from: Vec<[f64; 3]> = Vec::new();
    let mut to: Vec<[f64; 3]> = Vec::new();
    for k in 0..COUNT {
        let (at, along, displacement) = (random(3, k), random(4, k), random(5, k));
        let middle = DVec3::new(2.2 * at.x, 0.01 + 0.2 * (at.y + 0.5), 0.2 * at.z);
        let half = DVec3::new(0.1 * along.x, 0.05 * along.y, 0.1);
        let displacement = DVec3::new(0.2 * displacement.x, -0.2 * (displacement.y + 0.5), 0.2 * displacement.z);
        let trailing = middle - (displacement - up).normalize();
        for p in [middle - half, middle + half, trailing] {
            from.push(p.into());
            to.push((p + displacement).into());
        }
    }
    let skin = BodySkin::new(&from, &triples(COUNT), &[]).unwrap();
    let contacts = find(
        &CollisionScene { skins: &[skin], obstacles: &[ridge], ..CollisionScene::default() },
        &from,
        &to,
        [0.0, 1.0],
    );
    let mut through = 0;
    for k in 0..COUNT as usize {
        let [p, q, end] = [from[3 * k], from[3 * k + 1], to[3 * k]].map(DVec3::from);
        let [a, b] = [DVec3::from(tent[0]), DVec3::from(tent[1])];
        let displacement = end - p - up;
        // p + s(q − p) + t·displacement = a + u(b − a).
        let Some(inverse) = Matrix3::from_columns(&[q - p, displacement, a - b]).try_inverse() else { continue };
        let x = inverse * (a - p);
        if x.iter().all(|x| (0.0..=1.0).contains(x)) {
            through += 1;
            let pair = [3 * k as u32, 3 * k as u32 + 1];
            let mut mine = contacts.iter().filter(|contact| contact.points[..2] == pair && contact.weights[1] != 0.0);
            assert!(
                mine.any(|contact| DVec3::from(contact.normal).dot(&displacement) < 0.0
                    && (contact.weights[1] - x[0]).abs() < 1e-6),
                "{k} went through at {x:?}"
            );
        }
    }
    assert!(through > 2000, "{through}");
}

/// A spinning pin among triangles, at some scale.
fn spin(scale: f64) -> Vec<Contact> {
    const COUNT: u64 = 2000;
    let (points, faces) = cylinder(4, 0.1 * scale, 0.4 * scale);
    let (sine, cosine) = libm::sincos(0.8);
    let displacement = 0.05 * scale;
    let turned: Vec<[f64; 3]> =
        points.iter().map(|[x, y, z]| [cosine * x - sine * y + displacement, sine * x + cosine * y, *z]).collect();
    let poses = [pose(0.0, &points), pose(1.0, &turned)];
    let pin = Obstacle::new(&faces, &poses, 1.0, 2e-3 * scale, 0.5).unwrap();
    let [from, to] = specks(COUNT, 0.05 * scale, |k| random(8, k) * (0.5 * scale), |k| random(9, k) * (0.1 * scale));
    let skins = [BodySkin::new(&from, &triples(COUNT), &[]).unwrap()];
    let self_contact = Some(ContactParams { thickness: 1e-3 * scale, friction: 0.2 });
    let ground = Some(Ground { up: [0.0, 1.0, 0.0], height: -0.1 * scale, thickness: 1e-3 * scale, friction: 0.1 });
    find(
        &CollisionScene { skins: &skins, obstacles: &[pin], self_contact, ground, ..CollisionScene::default() },
        &from,
        &to,
        [0.1, 0.9],
    )
}

#[test]
fn any_number_of_threads_gives_the_same_contacts() {
    let with = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| spin(1.0));
    let alone = with(1);
    assert!(alone.len() > 1000, "{}", alone.len());
    assert!(
        alone
            .iter()
            .all(|contact| contact.offset.is_finite() && (DVec3::from(contact.normal).norm() - 1.0).abs() < 1e-9)
    );
    assert_eq!(with(2), alone);
    assert_eq!(with(7), alone);
}

#[test]
fn a_scene_a_thousand_times_larger_or_smaller_has_the_same_contacts() {
    let plain = spin(1.0);
    for scale in [1024.0, 1.0 / 1024.0, 1e3, 1e-3] {
        let scaled = spin(scale);
        assert_eq!(scaled.len(), plain.len(), "{scale}");
        for (a, b) in scaled.iter().zip(&plain) {
            assert_eq!(a.points, b.points);
            assert!((DVec3::from(a.normal) - DVec3::from(b.normal)).norm() < 1e-5, "{a:?} {b:?}");
            assert!((a.offset / scale - b.offset).abs() < 1e-6);
        }
    }
}

#[test]
fn non_finite_points_and_degenerate_triangles_are_ignored() {
    let (points, mut faces) = cuboid([1.0; 3]);
    faces.extend([[0, 0, 1], [0, 1, 1], [3, 3, 3]]);
    let cube = Obstacle::new(&faces, &[pose(0.0, &points)], 0.0, 0.0, 0.5).unwrap();
    let mut from: Vec<[f64; 3]> = (0..300).map(|k| (random(6, k) * 3.0).into()).collect();
    let to: Vec<[f64; 3]> = (0..300).map(|k| (random(7, k) * 3.0).into()).collect();
    let skin = BodySkin::new(&from, &triples(100), &[]).unwrap();
    from[17] = [f64::NAN, 0.0, 0.0];
    from[40] = [0.0, f64::INFINITY, 0.0];
    let params = Some(ContactParams { thickness: 0.0, friction: 1e6 });
    let skins = [skin.clone(), skin];
    let scene = CollisionScene {
        skins: &skins,
        obstacles: &[cube],
        self_contact: params,
        body_contact: params,
        ..CollisionScene::default()
    };
    let contacts = find(&scene, &from, &to, [0.5, 0.5]);
    assert!(!contacts.is_empty());
    for contact in &contacts {
        assert!(contact.normal.iter().chain(&contact.velocity).all(|x| x.is_finite()) && contact.offset.is_finite());
    }
    assert_eq!(Obstacle::new(&faces, &[], 1.0, 0.0, 0.0).unwrap_err(), CollisionError::NoPose);
    let twice = [pose(0.0, &points), pose(0.0, &points)];
    assert!(Obstacle::new(&faces, &twice, 1.0, 0.0, 0.0).unwrap_err().to_string().contains("`share`"));
    let none = CollisionScene::default();
    assert_eq!(find(&none, &[], &[], [0.0, 1.0]), []);
}
