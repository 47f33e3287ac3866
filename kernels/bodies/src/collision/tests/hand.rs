//! Contacts with results worked out by hand.

use super::*;

/// An open square of two triangles at height 0, facing up.
const SQUARE: [[f64; 3]; 4] = [[-1.0, 0.0, -1.0], [-1.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 0.0, -1.0]];
const TWO: [[u32; 3]; 2] = [[0, 1, 2], [0, 2, 3]];

/// A tiny triangle of three particles at a point; tests look at the first.
fn speck(at: [f64; 3]) -> [[f64; 3]; 3] {
    [at, [at[0] + 1e-3, at[1] + 10.0, at[2]], [at[0], at[1] + 10.0, at[2] + 1e-3]]
}

#[test]
fn a_vertex_falling_through_a_square_gives_one_contact_above_it() {
    let plate = Obstacle::new(&TWO, &[pose(0.0, &SQUARE)], 1.0, 0.01, 0.5).unwrap();
    let (from, to) = (speck([0.0, 0.5, 0.0]), speck([0.0, -0.5, 0.0]));
    let skin = BodySkin::new(&from, &[[0, 1, 2]], &[]).unwrap();
    let mask = [0.5f32, 1.0, 1.0];
    let scene =
        CollisionScene { skins: &[skin], obstacles: &[plate], friction: Some(&mask), ..CollisionScene::default() };
    let contacts = find(&scene, &from, &to, [0.0, 1.0]);
    assert_eq!(contacts.len(), 1);
    let contact = contacts[0];
    assert_eq!((contact.points, contact.weights), ([0; 4], [1.0, 0.0, 0.0, 0.0]));
    assert_eq!((contact.normal, contact.offset, contact.gap), ([0.0, 1.0, 0.0], 0.0, 0.01));
    assert_eq!((contact.velocity, contact.friction), ([0.0; 3], 0.25));
    // From below it is kept below.
    let contacts =
        find(&scene, &to.map(|p| [p[0], p[1] - 20.0, p[2]]), &from.map(|p| [p[0], p[1] - 9.0, p[2]]), [0.0, 1.0]);
    let held: Vec<_> =
        contacts.iter().filter(|contact| contact.weights[0] == 1.0).map(|contact| contact.normal).collect();
    assert!(!held.is_empty() && held.iter().all(|normal| *normal == [0.0, -1.0, 0.0]), "{held:?}");
}

#[test]
fn a_rising_plate_gives_its_height_and_velocity() {
    let up = SQUARE.map(|[x, _, z]| [x, 0.4, z]);
    let plate = Obstacle::new(&TWO, &[pose(0.0, &SQUARE), pose(1.0, &up)], 0.5, 0.01, 0.5).unwrap();
    let still = speck([0.3, 0.1, 0.2]);
    let skin = BodySkin::new(&still, &[[0, 1, 2]], &[]).unwrap();
    let scene = CollisionScene { skins: &[skin], obstacles: &[plate], ..CollisionScene::default() };
    let contacts = find(&scene, &still, &still, [0.0, 0.5]);
    assert_eq!(contacts.len(), 1);
    assert!((contacts[0].offset - 0.2).abs() < 1e-15 && (contacts[0].velocity[1] - 0.8).abs() < 1e-15);
    assert_eq!(contacts[0].normal, [0.0, 1.0, 0.0]);
}

#[test]
fn crossing_edges_make_contact_at_their_crossing() {
    // A tent with its ridge along x at height 0, and a triangle with a lower side along z that comes down on it.
    let tent = [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.4], [0.0, -1.0, -0.4]];
    let ridge = Obstacle::new(&[[0, 2, 1], [0, 1, 3]], &[pose(0.0, &tent)], 1.0, 0.01, 0.5).unwrap();
    let from = [[0.5, 0.2, -0.1], [0.5, 0.2, 0.3], [0.5, 1.0, 0.0]];
    let to = from.map(|[x, y, z]| [x, y - 0.3, z]);
    let skin = BodySkin::new(&from, &[[0, 1, 2]], &[]).unwrap();
    let contacts = find(
        &CollisionScene { skins: &[skin], obstacles: &[ridge], ..CollisionScene::default() },
        &from,
        &to,
        [0.0, 1.0],
    );
    assert_eq!(contacts.len(), 1, "{contacts:?}");
    let Contact { points, weights, normal, offset, .. } = contacts[0];
    assert_eq!(points, [0, 1, 0, 0]);
    assert!((weights[0] - 0.75).abs() < 1e-12 && (weights[1] - 0.25).abs() < 1e-12);
    assert!((DVec3::from(normal) - DVec3::y()).norm() < 1e-12 && offset.abs() < 1e-12);
}

#[test]
fn a_spike_rising_into_a_triangle_pushes_it_up() {
    let spike = [[0.0, 0.0, 0.0], [0.1, -1.0, 0.0], [-0.1, -1.0, 0.1], [-0.1, -1.0, -0.1]];
    let risen = spike.map(|[x, y, z]| [x, y + 0.3, z]);
    let faces = [[0, 2, 1], [0, 3, 2], [0, 1, 3], [1, 2, 3]];
    let spike = Obstacle::new(&faces, &[pose(0.0, &spike), pose(1.0, &risen)], 1.0, 0.01, 0.5).unwrap();
    assert!(spike.surface.closed);
    let sheet = [[-1.0, 0.2, -1.0], [-1.0, 0.2, 2.0], [2.0, 0.2, -1.0]];
    let skin = BodySkin::new(&sheet, &[[0, 2, 1]], &[]).unwrap();
    let contacts = find(
        &CollisionScene { skins: &[skin], obstacles: &[spike], ..CollisionScene::default() },
        &sheet,
        &sheet,
        [0.0, 1.0],
    );
    assert_eq!(contacts.len(), 1, "{contacts:?}");
    let Contact { weights, normal, offset, velocity, .. } = contacts[0];
    assert!(weights[..3].iter().all(|weight| (weight - 1.0 / 3.0).abs() < 1e-12) && weights[3] == 0.0);
    assert!((DVec3::from(normal) - DVec3::y()).norm() < 1e-12 && (offset - 0.3).abs() < 1e-12);
    assert!((DVec3::from(velocity) - DVec3::y() * 0.3).norm() < 1e-12);
}

#[test]
fn points_of_a_spinning_cylinder_keep_their_radius_and_match_its_poses() {
    let (points, faces) = cylinder(8, 0.05, 0.4);
    let turned = |angle: f64, distance: f64| -> Vec<[f64; 3]> {
        let (sine, cosine) = libm::sincos(angle);
        points.iter().map(|[x, y, z]| [cosine * x - sine * y + distance, sine * x + cosine * y, *z]).collect()
    };
    let poses = [pose(0.0, &points), pose(0.5, &turned(2.5, 0.1)), pose(1.0, &turned(3.0, 0.1))];
    let pin = Obstacle::new(&faces, &poses, 0.04, 1e-3, 0.5).unwrap();
    for pose in &poses {
        assert_eq!(pin.at(pose.share), pose.positions);
    }
    for share in [0.1, 0.25, 0.4, 0.7] {
        let middle = 0.1_f64.min(0.2 * share);
        for ([x, y, _], [x0, y0, _]) in pin.at(share).into_iter().zip(&points) {
            let radius = |x: f64, y: f64| (x * x + y * y).sqrt();
            assert!((radius(x - middle, y) - radius(*x0, *y0)).abs() < 1e-9);
        }
        // The velocity is the derivative of the positions.
        let step = 1e-6;
        let side = faces.len() / 2;
        let corner = faces[side][0] as usize;
        let [before, after] = [share - step, share + step].map(|share| DVec3::from(pin.at(share)[corner]));
        let change = (after - before) / (2.0 * step * 0.04);
        let velocity = pin.velocity(share, side as u32, [1.0, 0.0, 0.0]);
        assert!((DVec3::from(velocity) - change).norm() < 1e-6 * change.norm());
    }
    assert_eq!(pin.at(-1.0), poses[0].positions);
    assert_eq!(pin.velocity(2.0, 0, [1.0, 0.0, 0.0]), [0.0; 3]);
}

#[test]
fn a_vertex_that_starts_inside_is_pushed_out_gradually_through_the_nearest_side() {
    let (points, faces) = cuboid([1.0; 3]);
    let cube = Obstacle::new(&faces, &[pose(0.0, &points)], 1.0, 0.01, 0.5).unwrap();
    let within = |depth: f64| [[0.1, 0.5 - depth, 0.2], [0.1, 9.0, 0.2], [0.1, 9.0, 0.3]];
    let skin = BodySkin::new(&within(0.0), &[[0, 1, 2]], &[]).unwrap();
    let scene = CollisionScene { skins: &[skin], obstacles: &[cube], ..CollisionScene::default() };
    for (depth, offset) in [(0.005, 0.5), (0.05, 0.5), (0.25, 0.35)] {
        let contacts = find(&scene, &within(depth), &within(depth), [0.0, 1.0]);
        let mine: Vec<_> = contacts.iter().filter(|contact| contact.weights[0] == 1.0).collect();
        assert_eq!(mine.len(), 1);
        assert_eq!(mine[0].normal, [0.0, 1.0, 0.0]);
        assert!((mine[0].offset - offset).abs() < 1e-12, "{} is not {offset}", mine[0].offset);
    }
}

#[test]
fn ground_contacts_come_first_and_those_above_them_are_kept() {
    let (points, faces) = cuboid([1.0; 3]);
    // A cube that comes down on a vertex on the ground, tilted so that it pushes down and sideways.
    let (sine, cosine) = libm::sincos(0.5);
    let tilted = |height: f64| -> Vec<[f64; 3]> {
        points.iter().map(|[x, y, z]| [cosine * x - sine * y, sine * x + cosine * y + height, *z]).collect()
    };
    let cube = Obstacle::new(&faces, &[pose(0.0, &tilted(0.9)), pose(1.0, &tilted(0.45))], 1.0, 0.01, 0.5).unwrap();
    let still = [[0.2, 0.01, 0.0], [5.0, 0.01, 0.0], [5.0, 0.01, 0.1]];
    let skin = BodySkin::new(&still, &[[0, 1, 2]], &[]).unwrap();
    let ground = Ground { up: [0.0, 1.0, 0.0], height: 0.0, thickness: 0.01, friction: 0.3 };
    let scene =
        CollisionScene { skins: &[skin], obstacles: &[cube], ground: Some(ground), ..CollisionScene::default() };
    let contacts = find(&scene, &still, &still, [0.0, 1.0]);
    assert!(contacts.len() > 3, "{contacts:?}");
    for (particle, contact) in (0..3).zip(&contacts) {
        assert_eq!((contact.points[0], contact.normal, contact.friction), (particle, [0.0, 1.0, 0.0], 0.3));
    }
    assert!(contacts[3..].iter().any(|contact| contact.normal[1] < -0.5 && contact.jammed), "{contacts:?}");
}

/// A plate that comes down counts as stopped where it leaves one gap of its own above that of the ground.
#[test]
fn a_plate_closing_on_the_ground_is_stopped_above_it() {
    let (points, faces) = cuboid([1.0, 0.2, 1.0]);
    let still = [[0.2, 0.008, 0.0], [0.3, 0.008, 0.0], [0.2, 0.008, 0.1]];
    let skins = [BodySkin::new(&still, &[[0, 1, 2]], &[]).unwrap()];
    let (thickness, gap, seconds) = (0.004, 0.003, 0.5);
    let ground = Some(Ground { up: [0.0, 1.0, 0.0], height: 0.0, thickness, friction: 0.3 });
    for (foot, stopped, jammed) in
        [(0.0075, 0.0075, false), (0.006, 0.007, false), (0.005, 0.007, true), (-0.05, 0.007, true)]
    {
        let poses = [0.1, foot].map(|foot| points.iter().map(|[x, y, z]| [*x, y + 0.1 + foot, *z]).collect::<Vec<_>>());
        let poses = [pose(0.0, &poses[0]), pose(1.0, &poses[1])];
        let obstacles = [Obstacle::new(&faces, &poses, seconds, gap, 0.5).unwrap()];
        let scene = CollisionScene { skins: &skins, obstacles: &obstacles, ground, ..CollisionScene::default() };
        let contacts = find(&scene, &still, &still, [0.0, 1.0]);
        let pressing: Vec<_> = contacts.iter().filter(|contact| contact.normal[1] < 0.0).collect();
        assert_eq!(pressing.len(), 3, "one a vertex, at {foot}");
        for contact in pressing {
            let falls = -contact.velocity[1] * seconds;
            assert!((contact.normal[1] + 1.0).abs() < 1e-9 && contact.jammed == jammed, "{foot}: {contact:?}");
            assert!((contact.offset + stopped).abs() < 1e-9, "{foot}: {contact:?}");
            assert!((falls - (0.1 - stopped)).abs() < 1e-9, "{foot}: from where it really was, {contact:?}");
        }
    }
}

#[test]
fn facing_sheets_touch_but_neighbouring_elements_do_not() {
    // A folded strip: its ends face each other.
    let mut points: Vec<[f64; 3]> = Vec::new();
    let mut triangles = Vec::new();
    for k in 0..=12u32 {
        let angle = std::f64::consts::PI * f64::from(k) / 12.0;
        points.extend([0.0, 0.3].map(|z| [libm::cos(angle), libm::sin(angle), z]));
        if k > 0 {
            let a = 2 * k - 2;
            triangles.extend([[a, a + 2, a + 3], [a, a + 3, a + 1]]);
        }
    }
    let skin = BodySkin::new(&points, &triangles, &[]).unwrap();
    let self_contact = Some(ContactParams { thickness: 0.01, friction: 0.5 });
    let skins = [skin];
    let scene = CollisionScene { skins: &skins, self_contact, ..CollisionScene::default() };
    assert_eq!(find(&scene, &points, &points, [0.0, 1.0]), []);
    // The first end is moved through the last.
    let mut to = points.clone();
    to[..2].iter_mut().for_each(|p| p[0] -= 2.2);
    to[..2].iter_mut().for_each(|p| p[1] += 0.15);
    let contacts = find(&scene, &points, &to, [0.0, 1.0]);
    assert!(contacts.iter().any(|contact| contact.points[0] < 2 && contact.weights[0] == 1.0), "{contacts:?}");
    for contact in &contacts {
        assert!(contact.weights.iter().sum::<f64>().abs() < 1e-12);
        let kind = |particle: u32| particle / 2;
        assert!(
            contact
                .points
                .iter()
                .any(|p| kind(*p) > kind(contact.points[0]) + 2 || kind(*p) + 2 < kind(contact.points[0]))
        );
    }
}

/// A spike rises to a millimetre below a sheet of two triangles with one corner pulled away. When that triangle is
/// stretched to more than eight times its rest length, it is released, and so is the corner, which has no other edges;
/// the rest of the sheet is not.
#[test]
fn overstretched_skin_is_released() {
    let rest = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 1.0]];
    let skin = [BodySkin::new(&rest, &[[0, 2, 1], [1, 2, 3]], &[]).unwrap()];
    let (points, triangles) = cuboid([0.2, 0.2, 0.2]);
    let under = |at: [f64; 3]| {
        let moved: Vec<[f64; 3]> = points.iter().map(|p| [p[0] + at[0], p[1] + at[1] - 0.101, p[2] + at[2]]).collect();
        Obstacle::new(&triangles, &[pose(0.0, &moved)], 1.0, 0.01, 0.0).unwrap()
    };
    for (corner, held) in [(6.0, true), (12.0, false)] {
        let mut x = rest;
        x[3] = [corner, 0.0, corner];
        let middle = 0.25 + corner / 3.0;
        let obstacles = [under([0.3, 0.0, 0.3]), under([middle, 0.0, middle]), under([corner, 0.0, corner])];
        let touched = obstacles.each_ref().map(|obstacle| {
            let scene =
                CollisionScene { skins: &skin, obstacles: std::slice::from_ref(obstacle), ..CollisionScene::default() };
            !find(&scene, &x, &x, [0.0, 1.0]).is_empty()
        });
        assert_eq!(touched, [true, held, held], "drawn out to {corner}");
        // Both edges at that corner.
        assert_eq!(skin[0].released_edges(&x), if held { 0 } else { 2 });
    }
}

/// A strip of five quads along x and four along z, bent so that its first and last quads cross as an X of two flaps, the last
/// 1.4 times as wide. Through the last go all nine edges along the first, diagonals included; through the first those three
/// lines and two diagonals of the last that are within its width.
#[test]
fn edges_of_two_flaps_that_cross_are_counted() {
    let flat: [[f64; 2]; 6] = std::array::from_fn(|k| [k as f64, 0.0]);
    let bent = [[0.0, 0.0], [1.0, 1.0], [2.0, 1.0], [2.0, -1.0], [1.0, 0.0], [0.0, 1.0]];
    let strip = |profile: [[f64; 2]; 6], wide: f64| -> Vec<[f64; 3]> {
        let z = |row: usize, k: i32| {
            let z = f64::from(k) / 4.0 - 0.5;
            if row < 4 { z } else { wide * z + 0.01 }
        };
        (0..6).flat_map(|row| (0..5).map(move |k| [profile[row][0], profile[row][1], z(row, k)])).collect()
    };
    let quad = |first: u32| [[first, first + 5, first + 6], [first, first + 6, first + 1]];
    let triangles: Vec<[u32; 3]> = (0..25).filter(|point| point % 5 < 4).flat_map(quad).collect();
    let count = |rest: &[[f64; 3]], x: &[[f64; 3]]| {
        let skins = [BodySkin::new(rest, &triangles, &[]).unwrap()];
        CollisionScene { skins: &skins, ..CollisionScene::default() }.self_crossings(x)
    };
    let (flat, crossed) = (strip(flat, 1.4), strip(bent, 1.4));
    assert_eq!(count(&flat, &crossed), 9 + 5);
    assert_eq!(count(&flat, &flat), 0);
    let apart = strip([[0.0, 0.0], [1.0, 1.0], [2.0, 1.0], [2.0, -1.0], [1.0, -1.0], [0.0, -1.0]], 1.4);
    assert_eq!(count(&flat, &apart), 0);
    assert_eq!(count(&crossed, &crossed), 0, "what crosses at rest does not count");
}
