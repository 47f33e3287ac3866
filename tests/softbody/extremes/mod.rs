//! Soft bodies at extremes: absurd numbers, empty inputs, unreasonable springs, pins and goals, colliders that pass
//! through within a frame.
//!
//! Each row of a table is a scene. With every integrator, its result is finite and has the same bits on one thread and
//! on seven, a frame takes a bounded number of iterations, and violations are published as metrics (inverted tets,
//! volume, distances from the ground below `thickness`); or the scene is refused with a message, never with a panic.

mod contact;
mod empty;
mod numbers;
mod stuff;

use engine::error::ErrorKind;
use engine::geometry::{Attr, Component, Geometry, P};
use engine::time::Frame;
use numerics::random::Key;

use crate::measure::{distance, points};
use crate::scene::{Cooked, Scene};
use crate::shapes::{block, changed, cuboid};

type V = [f64; 3];

/// Frames of every scene.
const FRAMES: i64 = 4;
/// Largest number of linear iterations, Newton iterations and steps in a frame. The solver divides a frame into at most
/// 256 steps.
const MOST: [(&str, f64); 3] = [("cg", 1e6), ("newton", 1e4), ("substeps_used", 256.0)];
const INTEGRATORS: [&str; 3] = ["default", "euler", "accurate"];

/// A block of water of 0.1 m, 27 particles, at this height.
fn cube(height: f64) -> Component {
    block([2; 3], 0.05, [0.0, height, 0.0])
}

/// Checks the guarantees of this module for each of these scenes; returns the results of the default integrator.
fn hold<const N: usize>(rows: [(&str, Scene); N]) -> Vec<Cooked> {
    let (mut held, mut broken) = (Vec::new(), Vec::new());
    for (what, scene) in rows {
        for integrator in INTEGRATORS {
            let scene = scene.clone().set("integrator", format!("\"{integrator}\"")).set("tolerance", 1e-2);
            let cooked = scene.cook(1..=FRAMES, 1);
            let mut faults = faults(&scene, &cooked);
            if cooked != scene.cook(1..=FRAMES, 7) {
                faults.push("other bits on 7 threads than on one".into());
            }
            broken.extend(faults.iter().map(|fault| format!("{what}, {integrator}: {fault}\n")));
            if integrator == INTEGRATORS[0] {
                held.push(cooked);
            }
        }
    }
    assert!(broken.is_empty(), "\n{}", broken.concat());
    held
}

/// Checks that each of these scenes is refused with a message that contains these words.
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

/// Violations of the guarantees of this module.
fn faults(scene: &Scene, cooked: &Cooked) -> Vec<String> {
    if !cooked.errors.is_empty() {
        return cooked.errors.iter().map(|(_, said)| said.clone()).collect();
    }
    let mut faults = Vec::new();
    for (name, values) in &cooked.metrics {
        let most = MOST.iter().find(|(known, _)| known == name).map_or(f64::MAX, |(_, most)| *most);
        if !values.values().all(|x| x.abs() <= most) {
            faults.push(format!("`{name}` is {:?}", values.values()));
        }
    }
    let corners = cooked.tets[0].as_ref().unwrap().tets().unwrap().tet_corners();
    let rest = cooked.at(0);
    for frame in 0..cooked.tets.len() {
        let [surface, points] = [&cooked.surface, &cooked.tets].map(|frames| points(frames[frame].as_ref().unwrap()));
        if !surface.iter().chain(&points).flatten().all(|x| x.is_finite()) {
            faults.push(format!("frame {} is not finite", frame + 1));
        }
        let said = |name: &str| cooked.metrics.get(name).and_then(|all| all.get(&Frame::whole(frame as i64 + 1)));
        let found = inverted(&rest, &points, corners);
        if let Some(said) = said("inverted_tets").filter(|said| found as f64 > **said) {
            faults.push(format!("frame {}: {found} tets are inside out, {said} are published", frame + 1));
        }
        if let (Some(said), Some(kept)) = (said("deepest_overlap"), scene.kept_from_ground()) {
            let lowest = surface.iter().map(|p| p[1]).fold(f64::INFINITY, f64::min);
            if lowest < kept - said - rounding(&points) {
                faults.push(format!("frame {}: {lowest} over the ground, {said} is published", frame + 1));
            }
        }
    }
    faults
}

/// Rounding of stored positions, metres.
fn rounding(points: &[V]) -> f64 {
    let largest = points.as_flattened().iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    largest * f64::from(f32::EPSILON)
}

/// Tets that are inverted relative to their rest shape by more than rounding, without those that were flat.
fn inverted(rest: &[V], points: &[V], tets: &[[u32; 4]]) -> usize {
    let volume = |at: &[V], tet: &[u32; 4]| crate::measure::volume(tet.map(|corner| at[corner as usize]));
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

/// The scene with a ground, one thickness below the body.
fn grounded(body: impl Into<Geometry>) -> Scene {
    Scene::of(body).set("ground", true)
}
