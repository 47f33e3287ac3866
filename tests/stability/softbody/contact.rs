//! Plates that leave no room, colliders that pass through within a frame, extreme friction and gravity.

use super::*;

/// A plate that moves down to the ground, or `below` it.
fn crushed(below: f64) -> Scene {
    let plate = move |frame: Frame| {
        let foot = 0.11 - (0.11 + below) * ((frame.number() - 1.0) / 3.0).min(1.0);
        cuboid([-1.0, foot, -1.0], [1.0, foot + 0.1, 1.0])
    };
    grounded(cube(0.002)).collider(plate)
}

/// A box that passes through the body within a frame.
fn slapped() -> Scene {
    let hand = |frame: Frame| {
        let x = (frame.number() - 1.5).clamp(-0.5, 0.5);
        cuboid([x - 0.05, 0.0, -0.2], [x + 0.05, 0.2, 0.3])
    };
    Scene::of(cube(0.02)).collider(hand)
}

/// A sheet without thickness that moves up through the body within a frame.
fn swept() -> Scene {
    let sheet = |frame: Frame| {
        let y = (frame.number() - 2.0).clamp(-0.5, 0.5) as f32;
        let places = vec![[-1.0, y, -1.0], [-1.0, y, 1.0], [1.0, y, 1.0], [1.0, y, -1.0]];
        Component::mesh(vec![4], vec![0, 1, 2, 3], places).unwrap().into()
    };
    Scene::of(cube(0.0)).collider(sheet)
}

pub(super) fn overlap_with_extreme_colliders_is_prevented_or_published() {
    let still = |low: V, high: V| move |_: Frame| cuboid(low, high);
    let flipping = |frame: Frame| {
        let side = if frame.floor_number() % 2 == 0 { -1.0 } else { 1.0 };
        cuboid([-0.2 * side, -0.1, -0.2], [0.2 * side, 0.0, 0.2])
    };
    let cooked = hold(
        "37",
        [
            ("pressed to nothing", crushed(0.0)),
            ("pressed below the ground", crushed(0.05)),
            ("pressed to nothing, E 1e9", crushed(0.0).set("stiffness", "1e9")),
            ("pressed to nothing, thin", crushed(0.0).set("thickness", "1e-5")),
            ("#38: a hand through it in a frame", slapped()),
            ("#38: a hand through it in a frame, on a ground", slapped().set("ground", true)),
            ("#38: a sheet through it in a frame", swept()),
            ("#24: a collider within it", grounded(cube(0.02)).collider(still([0.03, 0.05, 0.03], [0.06, 0.08, 0.06]))),
            ("#24: wholly within a collider", grounded(cube(0.02)).collider(still([-1.0; 3], [1.0; 3]))),
            ("#24: in the ground from the start", grounded(cube(-0.05))),
            ("#24: under the ground", grounded(cube(-0.5))),
            ("#25: a collider that turns inside out", Scene::of(cube(0.01)).collider(flipping)),
            ("#25: two colliders in one place", grounded(cube(0.0)).collider(crushed_by).collider(crushed_by)),
            (
                "#7: `thickness` larger than the body",
                grounded(cube(0.002)).set("thickness", 1).set("self_collision", true),
            ),
        ],
    );
    assert!(cooked[1].most("deepest_overlap") >= 1e-3, "there is no room, which is published");
}

fn crushed_by(_: Frame) -> Geometry {
    cuboid([-0.2, 0.08, -0.2], [0.2, 0.2, 0.2])
}

pub(super) fn bodies_of_extreme_friction_gravity_and_speed_come_to_rest_on_the_ground() {
    let sliding = |friction: &str| grounded(cube(0.001)).set("friction", friction).set("initial_velocity", "[3, 0, 0]");
    hold(
        "41",
        [
            ("#44: μ 0", sliding("0")),
            ("#44: μ 1", sliding("1")),
            ("#44: μ 1e6", sliding("1e6")),
            ("#44: μ 1e30", sliding("1e30")),
            ("gravity 1e4", grounded(cube(0.02)).set("gravity", "[0, -1e4, 0]")),
            ("gravity 1e4, E 1e9", grounded(cube(0.02)).set("gravity", "[0, -1e4, 0]").set("stiffness", "1e9")),
            ("gravity 1e4, upwards", grounded(cube(0.02)).set("gravity", "[0, 1e4, 0]")),
            ("thrown down at 1e4 m/s", grounded(cube(0.02)).set("initial_velocity", "[0, -1e4, 0]")),
            ("thrown down at 1e8 m/s", grounded(cube(0.02)).set("initial_velocity", "[0, -1e8, 0]")),
            ("thrown at each other", grounded(cube(0.02)).and(cube(0.13)).set("gravity", "[0, -200, 0]")),
        ],
    );
}
