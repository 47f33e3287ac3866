//! Soft bodies at their extremes: absurd numbers, nothing at all, springs, pins and goals that no body should have, hands
//! that go through in a frame.
//!
//! Each row of a table is a scene, and is held to the same with every integrator: what comes out is finite and the same bits
//! on one thread and on seven, a frame takes a bounded number of iterations, what could not be met is in the metrics (tets
//! inside out, volume, what is nearer to the ground than asked); or the scene is refused by a message, never by a panic.

mod contact;
mod empty;
mod numbers;
mod stuff;

use engine::error::ErrorKind;
use engine::geometry::{Attr, Component, Geometry, P};
use engine::time::Frame;
use numerics::random::Key;

use super::distance;
use super::scene::{Cooked, Scene};
use super::shapes::{block, changed, cuboid};

type V = [f64; 3];

/// Frames of every scene.
const FRAMES: i64 = 5;
/// Iterations that a frame may take: linear, Newton's, and steps. The solver cuts a frame into 256 steps at most.
const MOST: [(&str, f64); 3] = [("cg", 4e4), ("newton", 2000.0), ("substeps_used", 256.0)];
const INTEGRATORS: [&str; 3] = ["default", "euler", "accurate"];

/// A block of water of 0.1 m, 64 particles, at this height.
fn cube(height: f64) -> Component {
    block([3; 3], 0.1 / 3.0, [0.0, height, 0.0])
}

/// Holds the node to what the module says, in each of these scenes; gives what the default integrator made.
fn hold<const N: usize>(rows: [(&str, Scene); N]) -> Vec<Cooked> {
    let held = rows.into_iter().map(|(what, scene)| {
        let mut first = None;
        for integrator in INTEGRATORS {
            let what = format!("{what}, {integrator}");
            let scene = scene.clone().set("integrator", format!("\"{integrator}\""));
            let cooked = scene.cook(1..=FRAMES, 1);
            assert!(cooked == scene.cook(1..=FRAMES, 7), "{what}: other bits on 7 threads than on one");
            assert_eq!(cooked.errors, [], "{what}");
            check(&what, &scene, &cooked);
            first = first.or(Some(cooked));
        }
        first.unwrap()
    });
    held.collect()
}

/// Holds the node to a refusal whose message has these words, for each of these scenes.
fn refused<const N: usize>(rows: [(&str, Scene, &str); N]) {
    for (what, scene, words) in rows {
        let cooked = scene.cook(1..=FRAMES, 2);
        let said = cooked
            .errors
            .iter()
            .all(|(kind, said)| matches!(kind, ErrorKind::Refused | ErrorKind::NotFinite) && said.contains(words));
        assert!(said && !cooked.errors.is_empty(), "{what}: {:?}", cooked.errors);
    }
}

fn check(what: &str, scene: &Scene, cooked: &Cooked) {
    for (name, most) in MOST {
        assert!(cooked.most(name) <= most, "{what}: `{name}` is {}", cooked.most(name));
    }
    for (name, values) in &cooked.metrics {
        assert!(values.values().all(|x| x.is_finite()), "{what}: `{name}` is {values:?}");
    }
    let corners = cooked.tets[0].as_ref().unwrap().tets().unwrap().tet_corners();
    let rest = cooked.at(0);
    for frame in 0..cooked.tets.len() {
        let what = format!("{what}, frame {}", frame + 1);
        for geometry in [&cooked.surface[frame], &cooked.tets[frame]] {
            let points = super::points(geometry.as_ref().unwrap());
            assert!(points.as_flattened().iter().all(|x| x.is_finite()), "{what}");
        }
        let points = cooked.at(frame);
        let said = |name: &str| cooked.metrics.get(name).and_then(|all| all.get(&Frame::whole(frame as i64 + 1)));
        if let Some(said) = said("inverted_tets") {
            let found = inverted(&rest, &points, corners);
            assert!(found as f64 <= *said, "{what}: {found} tets are inside out, {said} are published");
        }
        if let (Some(said), Some(kept)) = (said("deepest_overlap"), scene.kept_from_ground()) {
            let lowest = points.iter().map(|p| p[1]).fold(f64::INFINITY, f64::min);
            assert!(lowest >= kept - said - rounding(&points), "{what}: {lowest} over the ground, {said} is published");
        }
    }
}

/// What storing points may move one by, metres.
fn rounding(points: &[V]) -> f64 {
    let largest = points.as_flattened().iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    largest * f64::from(f32::EPSILON)
}

/// Tets that lie the other way round than at rest by more than rounding; those that were flat are none.
fn inverted(rest: &[V], points: &[V], tets: &[[u32; 4]]) -> usize {
    let volume = |at: &[V], tet: &[u32; 4]| super::volume(tet.map(|corner| at[corner as usize]));
    let size = |at: &[V], tet: &[u32; 4]| {
        let far = tet.iter().map(|corner| distance(&at[*corner as usize], &at[tet[0] as usize]));
        far.fold(0.0, f64::max)
    };
    let turned = |tet: &&[u32; 4]| {
        let (before, after, length) = (volume(rest, tet), volume(points, tet), size(points, tet));
        let doubt = 1e-3 * before.abs() + 10.0 * rounding(points) * length * length;
        let flat = before.abs() <= 1e-4 * size(rest, tet) * size(rest, tet) * size(rest, tet);
        !flat && after * before.signum() < -doubt
    };
    tets.iter().filter(turned).count()
}

/// A number for each particle.
fn with(mut body: Component, name: &'static str, of: impl Fn(usize) -> f32) -> Component {
    let values = (0..body.point_count()).map(of).collect();
    body.set(Attr::<f32>::point(name), values).unwrap();
    body
}

/// On the ground, a thickness above it.
fn grounded(body: impl Into<Geometry>) -> Scene {
    Scene::of(body).set("ground", true)
}
