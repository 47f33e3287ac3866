//! Contact with the ground, with plates and with a rolling pin; measured on the node.

use engine::geometry::{Component, Geometry};
use engine::time::Frame as Time;

use super::*;
use crate::scene::{Cooked, Scene};

const G: f64 = 9.81;
/// Frames a second.
const FPS: f64 = 24.0;
const THICKNESS: f64 = 1e-3;

/// A block of 0.4 m that falls 0.2 m, with this E, `damping` and `volume`, at frames 1, 240 and 241.
fn dropped(modulus: f64, damping: f64, volume: f64) -> Cooked {
    let block = shapes::block([4; 3], 0.1, [0.0, 0.2, 0.0]);
    let scene = Scene::of(block).set("stiffness", modulus).set("damping", damping).set("volume", volume);
    let cooked = scene.set("ground", true).cook([1, 240, 241], 2);
    assert_eq!(cooked.errors, []);
    cooked
}

/// Relative error of the height of the middle of a block on the ground: the mean sag of the column is ρgh²/3E, and
/// `thickness` keeps its base off the ground.
fn height_error() -> f64 {
    let modulus = 1e6;
    let height = mean(&dropped(modulus, 2e-3, 1.0).last())[1];
    let exact = 0.2 + THICKNESS - 1000.0 * G * 0.4 * 0.4 / (3.0 * modulus);
    (height - exact).abs() / 0.4
}

/// The fastest particle of such blocks after 240 frames, in g·dt.
fn speed_at_rest() -> f64 {
    let fastest = |modulus: f64, volume: f64| {
        let cooked = dropped(modulus, 2e3 / modulus, volume);
        largest(cooked.at(1).iter().zip(&cooked.at(2)).map(|(a, b)| distance(a, b))) * FPS / (G / FPS)
    };
    largest([fastest(5e4, 0.0), fastest(5e4, 1.0), fastest(1e7, 1.0)])
}

/// A block on a slope of 30° with friction μ: its displacement along the slope in a second ÷ its length, and the
/// relative error of its acceleration g(sin 30° − μ cos 30°).
fn on_slope(friction: f64) -> [f64; 2] {
    let (sine, cosine) = (0.5, 0.75_f64.sqrt());
    let block = shapes::block([4, 2, 4], 0.1, [0.0, 0.9 * THICKNESS, 0.0]);
    let gravity = format!("[{}, {}, 0]", G * sine, -G * cosine);
    let scene = Scene::of(block).set("gravity", gravity).set("stiffness", 1e6).set("damping", 0.005);
    let cooked = scene.set("ground", true).set("friction", friction).cook([25, 49, 73], 2);
    let [a, b, c] = [0, 1, 2].map(|place| mean(&cooked.at(place))[0]);
    [(b - a).abs() / 0.4, (c - 2.0 * b + a) / (G * (sine - friction * cosine))]
}

/// A block that hits the ground at 2 m/s along it and 2 m/s across it, one step a frame: relative error of the speed that
/// it keeps along it. Sliding friction is μ times the normal force at any time, so what it loses is μ times the change of
/// speed across.
fn hit(modulus: f64, friction: f64) -> f64 {
    let block = shapes::block([4; 3], 0.025, [0.0, 0.05, 0.0]);
    let scene = Scene::of(block).set("initial_velocity", "[2, -2, 0]").set("gravity", "[0, 0, 0]");
    let scene = scene.set("stiffness", modulus).set("damping", 1e-3).set("ground", true).set("friction", friction);
    let cooked = scene.set("substeps", 1).cook([9, 10], 2);
    let [a, b] = [0, 1].map(|place| mean(&cooked.at(place)));
    let [along, across] = [0, 1].map(|axis| (b[axis] - a[axis]) * FPS);
    (along / (2.0 - friction * (2.0 + across)) - 1.0).abs()
}

/// An undamped cube of 0.1 m that is thrown straight at the ground: relative error of its speed of rebound, against 256
/// steps a frame.
fn rebound(modulus: f64, height: f64, speed: f64) -> f64 {
    let speed_after = |substeps: u32| {
        let block = shapes::block([2; 3], 0.05, [0.0, height, 0.0]);
        let scene = Scene::of(block).set("initial_velocity", format!("[0, {}, 0]", -speed)).set("gravity", "[0, 0, 0]");
        let scene = scene.set("stiffness", modulus).set("damping", 0).set("friction", 0).set("ground", true);
        let cooked = scene.set("substeps", substeps).cook([12, 13], 2);
        mean(&cooked.at(1))[1] - mean(&cooked.at(0))[1]
    };
    (speed_after(0) / speed_after(256) - 1.0).abs()
}

/// A stack of boxes of 0.1 m, each on the one below it, for a second: iterations of linear solves per Newton iteration,
/// solves that reached their limit, and Newton iterations.
fn stack(count: usize) -> (f64, usize, usize) {
    let side = 0.1 + THICKNESS;
    let boxed = |at: usize| shapes::block([4; 3], 0.025, [0.0, THICKNESS + side * at as f64, 0.0]);
    let scene = (1..count).fold(Scene::of(boxed(0)), |scene, at| scene.and(boxed(at)));
    let cooked = scene.set("stiffness", 1e5).set("ground", true).cook(1..=24, 2);
    assert_eq!(cooked.errors, []);
    let sum = |name: &str| cooked.metric(name).iter().sum::<f64>();
    (sum("cg") / sum("newton"), sum("caps_hit") as usize, sum("newton") as usize)
}

/// A block of 0.6 by 0.6 m, `cells` cells of 0.1 m high, pressed to half its height between plates.
fn pressed(cells: u32) -> Cooked {
    let height = 0.1 * f64::from(cells);
    let block = shapes::mirrored([6, cells, 6], 0.1, [0.0, THICKNESS, 0.0]);
    let upper = move |frame: Time| {
        let distance = 0.5 * height * ((frame.number() - 1.0) / 48.0).min(1.0);
        let foot = height + 2.0 * THICKNESS - distance;
        shapes::cuboid([-0.5, foot, -0.5], [1.1, foot + 0.1, 1.1])
    };
    let scene = Scene::of(block).collider(|_| shapes::cuboid([-0.5, -0.1, -0.5], [1.1, 0.0, 1.1])).collider(upper);
    let scene = scene.set("gravity", "[0, 0, 0]").set("stiffness", 1e5).set("damping", 0.02);
    let cooked = scene.cook(1..=97, 2);
    assert_eq!(cooked.errors, []);
    cooked
}

/// Distance of the centre of its bulge from that of its base, and difference of its widths, ÷ its width.
fn askew(points: &[V]) -> f64 {
    let ends = |axis: usize| {
        let along = || points.iter().map(|p| p[axis]);
        [along().fold(f64::INFINITY, f64::min), along().fold(f64::NEG_INFINITY, f64::max)]
    };
    let [x, z] = [0, 2].map(ends);
    let width = x[1] - x[0];
    largest([(x[0] + x[1] - 0.6).abs() / width, (z[0] + z[1] - 0.6).abs() / width, (width / (z[1] - z[0]) - 1.0).abs()])
}

const SIDES: usize = 32;

/// A pin that rolls ten thicknesses per frame, 1 cm deep in the dough.
fn pin(frame: Time) -> Geometry {
    let distance = (frame.number() - 1.0) * 10.0 * THICKNESS;
    let (mut points, mut counts, mut corners) = (Vec::new(), vec![4; SIDES], Vec::new());
    for k in 0..SIDES {
        let (sine, cosine) = libm::sincos(std::f64::consts::TAU * k as f64 / SIDES as f64 - distance / 0.05);
        let place = |z: f64| [0.05 * cosine - 0.08 + distance, 0.05 * sine + 0.1, z].map(|x| x as f32);
        points.extend([place(-0.09), place(0.21)]);
        let next = (k + 1) % SIDES;
        corners.extend([2 * k, 2 * next, 2 * next + 1, 2 * k + 1]);
    }
    for side in [0, 1] {
        counts.push(SIDES as u32);
        corners.extend((0..SIDES).map(|k| 2 * if side == 0 { SIDES - 1 - k } else { k } + side));
    }
    Component::mesh(counts, corners.iter().map(|corner| *corner as u32).collect(), points).unwrap().into()
}

/// Whether a point is inside the pin: behind all of its sides by more than the rounding of stored positions.
fn within(points: &[V], p: &V) -> bool {
    let depth = |k: usize| {
        let (a, b) = (points[2 * k], points[2 * ((k + 1) % SIDES)]);
        let out = DVec3::from(plus_multiple(b, a, -1.0)).cross(&DVec3::z());
        let from = plus_multiple(*p, a, -1.0);
        -(out[0] * from[0] + out[1] * from[1]) / out.norm()
    };
    (-0.09..0.21).contains(&p[2]) && (0..SIDES).all(|k| depth(k) > 1e-7)
}

/// Dough under the pin: the published deepest overlap ÷ `thickness`, how many of its particles are inside the pin or
/// below the ground, and of how many.
fn rolled(modulus: f64) -> (f64, usize, usize) {
    let dough = shapes::block([12, 3, 6], 0.02, [0.0; 3]);
    let scene = Scene::of(dough).collider(pin).set("stiffness", modulus).set("damping", 0.02).set("friction", 0.3);
    let cooked = scene.set("ground", true).set("ground_height", -THICKNESS).run(31);
    let (mut passed, mut count) = (0, 0);
    for frame in 0..31 {
        let pin = crate::measure::points(&pin(Time::whole(frame as i64 + 1)));
        let points = cooked.at(frame);
        passed += points.iter().filter(|p| within(&pin, p) || p[1] < -THICKNESS).count();
        count += points.len();
    }
    (cooked.most("deepest_overlap") / THICKNESS, passed, count)
}

pub(super) fn figures() -> Vec<Figure> {
    let sticks = [0.7, 1.0, 1e6].map(|friction| on_slope(friction)[0]);
    let slides = [0.0, 0.3, 0.5].map(|friction| (on_slope(friction)[1] - 1.0).abs());
    let hits = [1e5, 1e6, 1e7, 1e8].map(|modulus| largest([0.1, 0.2, 0.3, 0.5].map(|friction| hit(modulus, friction))));
    // As in the kernel's own test of bounces.
    let throws = [(2e4, 0.21, 2.0), (2e5, 0.31, 10.0), (6e5, 0.31, 10.0), (2e6, 0.31, 10.0)];
    let rebounds = throws.map(|(modulus, height, speed)| rebound(modulus, height, speed));
    let [(alone, ..), (stacked, caps, solves)] = [1, 3].map(stack);
    let [cube, flat] = [6, 3].map(pressed);
    let volume = |pressed: &Cooked| (pressed.metric("volume_ratio").last().unwrap() - 1.0).abs();
    let turned = |pressed: &Cooked| *pressed.metric("inverted_tets").last().unwrap() as usize;
    let deepest = |pressed: &Cooked| pressed.most("deepest_overlap") / THICKNESS;
    let rolled = [2e4, 5e3].map(rolled);
    let overlap = largest(rolled.iter().map(|found| found.0).chain([deepest(&cube), deepest(&flat)]));
    vec![
        Figure::error("A block dropped on the ground: error of the height of its middle", height_error(), 1e-2, " L"),
        Figure::error("speed of its fastest particle after 240 frames", speed_at_rest(), 1e-4, " g·dt"),
        Figure::error("on a slope of 30° with μ ≥ 0.7: creep in a second", largest(sticks), 1e-4, " L"),
        Figure::error("with μ ≤ 0.5: error of the acceleration g(sin 30° − μ cos 30°)", largest(slides), 1e-2, ""),
        Figure::error(
            "hitting it at 45°, E 1e5 to 1e8 Pa, μ 0.1 to 0.5: error of the speed kept along it",
            largest(hits),
            5e-2,
            "",
        ),
        Figure::error(
            "A cube thrown at the ground, E 2e4 to 2e6 Pa: error of the speed of its rebound, against 256 steps per frame",
            largest(rebounds),
            0.1,
            "",
        ),
        Figure::error(
            "Three boxes in a stack: linear iterations per Newton iteration ÷ those of one box",
            stacked / alone,
            4.0,
            "",
        ),
        Figure::never("its solves that reached their limit of iterations", caps, solves),
        Figure::error(
            "Pressed to half its height between plates: volume error of a cube and of a block half as high",
            largest([volume(&cube), volume(&flat)]),
            2e-2,
            "",
        ),
        Figure::error("asymmetry of the block's bulge", askew(&flat.last()), 2e-2, " L"),
        // Springs pressed to half their length push sideways more than their neighbours resist, with every integrator.
        Figure::error("asymmetry of the cube, which buckles to one side", askew(&cube.last()), 2e-2, " L").missed(),
        Figure::never("inverted tets in both", turned(&cube) + turned(&flat), 6 * 6 * 6 * (6 + 3)),
        Figure::error(
            "Under those plates, and under a pin that rolls 10 `thickness` per frame: `deepest_overlap`",
            overlap,
            1.0,
            " `thickness`",
        ),
        Figure::never(
            "particles inside the pin or the ground",
            rolled.iter().map(|found| found.1).sum(),
            rolled.iter().map(|found| found.2).sum(),
        ),
    ]
}
