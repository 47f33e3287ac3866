//! What starts inside something: found, and pushed apart along the shortest way, evenly.

use super::bodies::block;
use super::*;

const THICKNESS: f64 = 1e-3;

fn ground(height: f64) -> Option<Ground> {
    Some(Ground { up: [0.0, 1.0, 0.0], height, thickness: THICKNESS, friction: 0.5 })
}

fn skin((points, tets, faces): &super::bodies::Block) -> BodySkin {
    let links: Vec<[u32; 2]> = tets.iter().flat_map(|[a, b, c, d]| [[*a, *b], [*a, *c], [*a, *d]]).collect();
    BodySkin::new(points, faces, &links).unwrap()
}

/// A cube of 0.1 m whose lower 20 mm are in a box as wide as it is long: up is the shortest way.
#[test]
fn a_body_leaves_an_obstacle_the_shortest_way() {
    let body = block([4; 3], 0.025, [0.0; 3]);
    let (points, triangles) = cuboid([1.0; 3]);
    let points: Vec<[f64; 3]> = points.iter().map(|p| [p[0], p[1] - 0.48, p[2]]).collect();
    let obstacles = [Obstacle::new(&triangles, &[pose(0.0, &points)], 1.0, THICKNESS, 0.5).unwrap()];
    let skins = [skin(&body)];
    let scene = CollisionScene { skins: &skins, obstacles: &obstacles, ..CollisionScene::default() };
    let (found, inside) = scene.overlaps(&body.0);
    assert_eq!(inside, 25, "the lowest layer of particles");
    let [Overlap { skin: 0, partner: OverlapPartner::Obstacle(0), direction, depth }] = found[..] else {
        panic!("{found:?}")
    };
    assert!((depth - 0.021).abs() < 1e-7 && (direction[1] - 1.0).abs() < 1e-12, "{found:?}");

    // In the second quarter of the fourth of twelve frames nothing has moved yet, so it has to catch up.
    let separation = Some(Separation { overlaps: &found, frames: 12, over: 3, seconds: 0.04, ..Separation::default() });
    let scene = CollisionScene { separation, ..scene };
    let contacts = self::find(&scene, &body.0, &body.0, [0.25, 0.5]);
    assert_eq!(contacts.len(), 25);
    for contact in contacts {
        // 21 mm below the gap, of which a quarter of a frame out of 8.75 goes now.
        let left = 0.021 * (1.0 - 0.25 / 8.75);
        assert!((contact.offset - (0.02 - left)).abs() < 1e-7 && contact.normal == [0.0, 1.0, 0.0], "{contact:?}");
        assert!((contact.velocity[1] - (0.021 - left) / 0.01).abs() < 1e-6 && contact.friction == 0.0, "{contact:?}");
    }
    let separation =
        Some(Separation { overlaps: &found, frames: 12, over: 12, seconds: 0.04, ..Separation::default() });
    let after = self::find(&CollisionScene { separation, ..scene }, &body.0, &body.0, [0.0, 1.0]);
    assert!(after.iter().all(|contact| contact.friction > 0.0), "contacts are ordinary again");
}

/// A cube of 0.1 m with a plate of 10 mm through its middle, which only its middle layer of particles is inside: what is
/// below the plate has to pass it, too.
#[test]
fn a_body_leaves_a_thin_obstacle_as_a_whole() {
    let body = block([4; 3], 0.025, [0.0, -0.05, 0.0]);
    let (points, triangles) = cuboid([1.0, 0.01, 1.0]);
    let skins = [skin(&body)];
    for sunk in [0.0, 0.003] {
        let points: Vec<[f64; 3]> = points.iter().map(|p| [p[0], p[1] - sunk, p[2]]).collect();
        let obstacles = [Obstacle::new(&triangles, &[pose(0.0, &points)], 1.0, THICKNESS, 0.5).unwrap()];
        let scene = CollisionScene { skins: &skins, obstacles: &obstacles, ..CollisionScene::default() };
        let (found, _) = scene.overlaps(&body.0);
        let [Overlap { direction, depth, .. }] = found[..] else { panic!("{found:?}") };
        assert!((depth - (0.056 - sunk)).abs() < 1e-7 && (direction[1].abs() - 1.0).abs() < 1e-12, "{found:?}");
        assert!(sunk == 0.0 || direction[1] > 0.0, "{found:?}");
    }
}

#[test]
fn overlaps_are_found_with_the_ground_and_other_bodies_only_where_they_are() {
    let bodies = [block([2; 3], 0.05, [0.0; 3]), block([3, 2, 2], 0.05, [0.07, 0.01, 0.01])];
    let first = bodies[0].0.len() as u32;
    let all: Vec<[f64; 3]> = bodies.iter().flat_map(|body| &body.0).copied().collect();
    let shifted: Vec<[u32; 3]> = bodies[1].2.iter().map(|face| face.map(|corner| corner + first)).collect();
    let links: Vec<[u32; 2]> = (0..2)
        .flat_map(|body| bodies[body].1.iter().map(move |tet| tet.map(|corner| corner + body as u32 * first)))
        .flat_map(|[a, b, c, d]| [[a, b], [a, c], [a, d]])
        .collect();
    let skins = BodySkin::several(&all, &[], &[&bodies[0].2, &shifted], &links).unwrap();
    let body_contact = Some(ContactParams { thickness: THICKNESS, friction: 0.5 });
    let scene = CollisionScene { skins: &skins, body_contact, ..CollisionScene::default() };
    let (found, inside) = scene.overlaps(&all);
    let [Overlap { skin: 0, partner: OverlapPartner::Skin(1), direction, depth }] = found[..] else {
        panic!("{found:?}")
    };
    assert!(inside > 0 && direction[0] < -0.9 && (depth - 0.031).abs() < 2e-3, "{found:?}");
    assert_eq!(CollisionScene { body_contact: None, ..scene }.overlaps(&all), (vec![], 0));
    let below = CollisionScene { body_contact: None, ground: ground(0.005), ..scene }.overlaps(&all);
    let [Overlap { skin: 0, partner: OverlapPartner::Ground, depth, .. }] = below.0[..] else { panic!("{below:?}") };
    assert!((depth - 0.006).abs() < 1e-12 && below.1 == 9, "the second body begins above the ground: {below:?}");

    // A point in the middle of the face of the first that is 30 mm inside the second.
    let penetration = CollisionScene { ground: ground(0.0), ..scene }.penetration(&all);
    assert!((penetration.deepest - 0.031).abs() < 1e-6 && penetration.inside >= 8, "{penetration:?}");
}

/// A rod of 20 mm through two edges of a cube of 0.1 m, along its upper left edge at x = 0 and y = 0.05: no point of one is
/// inside the other. The edges are 10 mm deep in the rod, and two edges of the rod are as deep in the cube.
#[test]
fn edges_that_go_through_something_are_measured() {
    let body = block([1; 3], 0.1, [0.0; 3]);
    let skins = [skin(&body)];
    let (points, triangles) = cuboid([0.02, 0.02, 1.0]);
    let deepest = |x: f64, kept: usize| {
        let points: Vec<[f64; 3]> = points.iter().map(|p| [p[0] + x, p[1] + 0.05, p[2] + 0.05]).collect();
        let obstacle = Obstacle::new(&triangles[..kept], &[pose(0.0, &points)], 1.0, THICKNESS, 0.5).unwrap();
        let scene = CollisionScene { skins: &skins, obstacles: &[obstacle], ..CollisionScene::default() };
        let found = scene.penetration(&body.0);
        assert_eq!(found.inside, 0);
        found.deepest
    };
    assert!((deepest(0.0, triangles.len()) - (THICKNESS + 0.01)).abs() < 1e-6, "{}", deepest(0.0, triangles.len()));
    assert_eq!(deepest(-0.012, triangles.len()), 0.0, "it is 2 mm beside the cube");
    assert!((deepest(-0.0105, triangles.len()) - 0.5e-3).abs() < 1e-6, "it is 0.5 mm beside the cube");

    // Two bodies, of which one has the shape of the rod.
    let rod = block([1; 3], 0.02, [-0.01, 0.04, 0.04]);
    let rod: super::bodies::Block =
        (rod.0.iter().map(|p| [p[0], p[1], 50.0 * (p[2] - 0.05) + 0.05]).collect(), rod.1, rod.2);
    let first = body.0.len() as u32;
    let all: Vec<[f64; 3]> = body.0.iter().chain(&rod.0).copied().collect();
    let shifted: Vec<[u32; 3]> = rod.2.iter().map(|face| face.map(|corner| corner + first)).collect();
    let links: Vec<[u32; 2]> =
        (0..first).map(|point| [0, point]).chain((first..2 * first).map(|p| [first, p])).collect();
    let skins = BodySkin::several(&all, &[], &[&body.2, &shifted], &links).unwrap();
    let body_contact = Some(ContactParams { thickness: THICKNESS, friction: 0.5 });
    let found = CollisionScene { skins: &skins, body_contact, ..CollisionScene::default() }.penetration(&all);
    assert!((found.deepest - (THICKNESS + 0.01)).abs() < 1e-6 && found.inside == 0, "{found:?}");
}

/// What is closer than the distance to keep is found, and contacts yield by what is missing of it, a twelfth less a frame.
#[test]
fn contacts_of_what_starts_too_close_yield_evenly_less() {
    let body = block([2; 3], 0.05, [0.0, 0.4e-3, 0.0]);
    let skins = [skin(&body)];
    let (points, triangles) = cuboid([1.0; 3]);
    let points: Vec<[f64; 3]> = points.iter().map(|p| [p[0], p[1] - 0.5, p[2]]).collect();
    let obstacles =
        |kept: usize| [Obstacle::new(&triangles[..kept], &[pose(0.0, &points)], 1.0, THICKNESS, 0.5).unwrap()];
    let (closed, open) = (obstacles(triangles.len()), obstacles(triangles.len() - 1));
    let empty = CollisionScene { skins: &skins, ..CollisionScene::default() };
    let with = |obstacles| CollisionScene { obstacles, ..empty };
    for (scene, is_open, partner) in [
        (CollisionScene { ground: ground(0.0), ..empty }, false, OverlapPartner::Ground),
        (with(&closed), false, OverlapPartner::Obstacle(0)),
        (with(&open), true, OverlapPartner::Obstacle(0)),
    ] {
        let close = scene.too_close(&body.0, &[]);
        let [Closeness { skin: 0, partner: found, missing }] = close[..] else { panic!("{close:?}") };
        assert!(found == partner && (missing - 0.6e-3).abs() < 1e-6, "{close:?}");
        let at = |over: u32, times: [f64; 2]| {
            let separation = Separation { close: &close, frames: 12, over, seconds: 0.04, ..Separation::default() };
            let scene = CollisionScene { separation: Some(separation), ..scene };
            self::find(&scene, &body.0, &body.0, times).into_iter().filter(|c| c.normal[1] > 0.9).collect::<Vec<_>>()
        };
        let contacts = at(3, [0.0, 0.5]);
        assert!(contacts.len() >= 6, "{}", contacts.len());
        for contact in contacts {
            let left = missing * (1.0 - 3.5 / 12.0);
            assert!((contact.gap + contact.offset - (THICKNESS - left)).abs() < 1e-7, "{contact:?}");
            assert!((contact.velocity[1] - missing / 12.0 / 0.04).abs() < 1e-7, "{contact:?}");
            assert!(!is_open || contact.offset.abs() < 1e-7, "an open one keeps its side: {contact:?}");
        }
        for contact in at(12, [0.0, 1.0]) {
            assert!(
                (contact.gap + contact.offset - THICKNESS).abs() < 1e-7 && contact.velocity[1] == 0.0,
                "{contact:?}"
            );
        }
    }
    let apart = block([2; 3], 0.05, [0.0, THICKNESS, 0.0]);
    assert_eq!(CollisionScene { ground: ground(0.0), ..empty }.too_close(&apart.0, &[]), vec![]);
}
