//! Extreme springs, masses, shapes, pins and goals.

use super::*;

fn power(seed: u64, index: usize, [low, high]: [f64; 2]) -> f32 {
    libm::pow(10.0, low + (high - low) * Key::new(seed).of(index as u64).f64()) as f32
}

/// Stiffness from an attribute.
const SOFT: &str = r#"{ "value": 1, "attribute": "soft" }"#;
const LIGHT: &str = r#"{ "value": 1000, "attribute": "light" }"#;

pub(super) fn bodies_with_springs_and_masses_of_any_ratio_hold_together() {
    // k of an edge of 3 cm is about a hundredth of E.
    let soft = |body: Component| with(body, "soft", |i| power(3, i, [-4.0, 14.0]));
    let light = |body: Component| with(body, "light", |i| if i % 2 == 0 { 1.0 } else { 1e-6 });
    let both = light(soft(cube(0.002)));
    let top: Vec<[f32; 3]> = cube(0.2).positions().iter().filter(|p| p[1] > 0.29).copied().collect();
    hold(
        "31",
        [
            ("k 1e-6 to 1e12, falling on the ground", grounded(soft(cube(0.02))).set("stiffness", SOFT)),
            (
                "k 1e-6 to 1e12, hanging",
                Scene::of(soft(cube(0.2))).set("stiffness", SOFT).pins(1e-3, move |_| top.clone()),
            ),
            ("#32: masses a million apart", grounded(light(cube(0.02))).set("density", LIGHT)),
            (
                "#31, 32: springs and masses of any ratio",
                grounded(both.clone()).set("stiffness", SOFT).set("density", LIGHT),
            ),
            (
                "#31, 32: springs and masses of any ratio, `volume` 0",
                grounded(both).set("stiffness", SOFT).set("density", LIGHT).set("volume", 0),
            ),
            ("no stiffness", grounded(cube(0.02)).set("stiffness", 0)),
            ("E 1e15", grounded(cube(0.02)).set("stiffness", "1e15")),
            ("undamped", grounded(cube(0.02)).set("damping", 0).set("stiffness", "1e7")),
            ("damped for a year", grounded(cube(0.02)).set("damping", "3e7")),
        ],
    );
}

pub(super) fn single_disconnected_inverted_and_flat_tets_move() {
    let corner = |points: Vec<[f32; 3]>, tets: Vec<[u32; 4]>| Component::tets(tets, points).unwrap();
    let one = [[0.0, 0.02, 0.0], [0.1, 0.02, 0.0], [0.0, 0.12, 0.0], [0.0, 0.02, 0.1]];
    let turned = {
        let body = cube(0.02);
        let other = |(k, tet): (usize, &[u32; 4])| if k % 2 == 0 { *tet } else { [tet[1], tet[0], tet[2], tet[3]] };
        corner(body.positions().to_vec(), body.tet_corners().iter().enumerate().map(other).collect())
    };
    let squashed = changed(&cube(0.02), |k, [x, y, z]| if k % 4 == 0 { [x, 0.02, z] } else { [x, y, z] });
    let crumpled = changed(&cube(0.1), |k, p| {
        std::array::from_fn(|axis| p[axis] + 0.08 * (Key::new(9).of(k as u64).of(axis as u64).f64() - 0.5))
    });
    let doubled = changed(&cube(0.02), |k, p| if k == 22 { cube(0.02).positions()[21].map(f64::from) } else { p });
    let pieces = cube(0.02).concat(&block([2; 3], 0.03, [0.3, 0.05, 0.0])).unwrap();
    let loose = corner([&one[..], &[[0.5, 0.1, 0.0]]].concat(), vec![[0, 1, 2, 3]]);
    hold(
        "42",
        [
            ("one tet", grounded(corner(one.to_vec(), vec![[0, 1, 2, 3]]))),
            ("one tet, turned", grounded(corner(one.to_vec(), vec![[0, 2, 1, 3]]))),
            ("a tet twice", grounded(corner(one.to_vec(), vec![[0, 1, 2, 3]; 2]))),
            ("a tet, and a point in none", grounded(loose)),
            ("#34: every other tet turned", grounded(turned)),
            ("#34: a quarter of its points pressed flat", grounded(squashed)),
            ("#34: crumpled from the start", grounded(crumpled)),
            ("#33: springs of no length", grounded(doubled)),
            ("#43: two pieces in one wire", grounded(pieces)),
            ("#39: two bodies in one place", grounded(cube(0.02)).and(cube(0.02))),
            ("#39: two bodies in one place, joined", grounded(cube(0.02)).and(cube(0.02)).set("coupling_radius", 0.02)),
            (
                "#39: two bodies 1 cm apart, touching themselves",
                grounded(cube(0.02)).and(cube(0.03)).set("self_collision", true),
            ),
        ],
    );
}

pub(super) fn pinned_particles_follow_pins_that_hold_everything_or_tear_the_body() {
    let body = cube(0.0);
    let all: Vec<[f32; 3]> = body.positions().to_vec();
    let side: Vec<[f32; 3]> = all.iter().filter(|p| p[0] == 0.0).copied().collect();
    let moved = |pins: &[[f32; 3]], offset: f32| -> Vec<[f32; 3]> {
        pins.iter().map(|[x, y, z]| [x + offset, *y, *z]).collect()
    };
    let (there, back) = (side.clone(), side.clone());
    let jerk = move |frame: Frame| moved(&there, if (1.5..2.5).contains(&frame.number()) { 10.0 } else { 0.0 });
    let away = move |frame: Frame| moved(&back, 10.0 * (frame.number() as f32 - 1.0));
    let cooked = hold(
        "36",
        [
            ("#35: everything pinned", Scene::of(body.clone()).pins(1e-3, move |_| all.clone())),
            (
                "#35: one pin for all",
                Scene::of(body.clone()).pins(1.0, |frame| vec![[frame.number() as f32, 0.0, 0.0]]),
            ),
            ("pulled 100 lengths in a frame and back", Scene::of(body.clone()).pins(1e-3, jerk.clone())),
            (
                "pulled 100 lengths in a frame and back, E 1e9",
                Scene::of(body.clone()).pins(1e-3, jerk.clone()).set("stiffness", "1e9"),
            ),
            (
                "pulled 100 lengths in a frame and back, touching itself",
                Scene::of(body.clone()).pins(1e-3, jerk).set("self_collision", true),
            ),
            ("pulled 100 lengths each frame", Scene::of(body.clone()).pins(1e-3, away)),
            ("#35: pins that hold nothing", Scene::of(body.clone()).pins(0.0, |_| vec![[9.0; 3]])),
            ("#35: no pins", Scene::of(body.clone()).pins(1.0, |_| vec![])),
        ],
    );
    assert!(cooked[0].last() == cooked[0].at(0), "pinned particles stay");
    for (place, offset) in [(1, 10.0), (2, 0.0)] {
        let held =
            |at: &[V]| at.iter().zip(body.positions()).filter(|(_, rest)| rest[0] == 0.0).all(|(p, _)| p[0] == offset);
        assert!(held(&cooked[2].at(place)), "they follow the pins there and back");
    }
}

pub(super) fn bodies_move_towards_goals_that_are_unreachable_or_change_every_frame() {
    let body = cube(0.0);
    let far = changed(&body, |_, [x, y, z]| [x + 1e3, y, z]);
    let nearer = |offset: f64| changed(&body, move |_, [x, y, z]| [x + offset, y, z]);
    let inside_out = changed(&body, |_, [x, y, z]| [0.1 - x, y, z]);
    let flat = changed(&body, |_, [x, _, z]| [x, 0.0, z]);
    let aimed = |goal: &Component, frame: f32| Scene::of(body.clone()).goal(goal.clone(), frame, 1e4, 1.0);
    hold(
        "40",
        [
            ("a goal a kilometre away", aimed(&far, 3.0)),
            ("a goal a kilometre away, all particles pulled", aimed(&far, 3.0).set("goal_on", "\"all\"")),
            ("a goal of the shape at rest", aimed(&body, 3.0)),
            ("a goal at the start", aimed(&nearer(0.1), 1.0)),
            ("a goal before the start", aimed(&nearer(0.1), -10.0)),
            ("a goal long after the end", aimed(&nearer(0.1), 1e9)),
            ("two goals in one frame", aimed(&nearer(0.1), 3.0).goal(nearer(-0.1), 3.0, 1e4, 1.0)),
            (
                "a goal in each frame",
                aimed(&nearer(0.1), 2.0).goal(nearer(-0.1), 3.0, 1e4, 0.0).goal(nearer(0.1), 4.0, 1e4, 0.0),
            ),
            ("a goal that is its mirror image", aimed(&inside_out, 3.0).set("goal_on", "\"all\"")),
            ("a goal that is a flat sheet", aimed(&flat, 3.0).set("goal_on", "\"all\"").set("reset_frames", 0)),
            ("a goal that pulls by 1e30", Scene::of(body.clone()).goal(nearer(0.1), 3.0, 1e30, 1.0)),
        ],
    );
}
