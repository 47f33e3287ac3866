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
use crate::page::{self, Outcome, split};
use crate::scene::{Cooked, Scene};
use crate::shapes::{block, changed, cuboid};

type V = [f64; 3];

/// The part of the page.
const PART: &str = "Soft bodies";

/// Frames of every scene.
fn frames() -> std::ops::RangeInclusive<i64> {
    1..=page::frames(4)
}

/// Largest number of linear iterations, Newton iterations and steps in a frame. The solver divides a frame into at most
/// 256 steps.
const MOST: [(&str, f64); 3] = [("cg", 1e6), ("newton", 1e4), ("substeps_used", 256.0)];
const INTEGRATORS: [&str; 3] = ["default", "euler", "accurate"];

/// A block of water of 0.1 m, 27 particles, at this height.
fn cube(height: f64) -> Component {
    block([2; 3], 0.05, [0.0, height, 0.0])
}

/// Checks the guarantees of this module for each of these scenes, and records them as `numbers` of NUMERICS B, or as those
/// that a scene's name begins with; returns the results of the default integrator.
fn hold<const N: usize>(numbers: &str, rows: [(&str, Scene); N]) -> Vec<Cooked> {
    let (mut held, mut broken) = (Vec::new(), Vec::new());
    for (what, scene) in rows {
        let mut worst = Worst::default();
        for integrator in INTEGRATORS {
            let scene = scene.clone().set("integrator", format!("\"{integrator}\"")).set("tolerance", 1e-2);
            let cooked = scene.cook(frames(), 1);
            let mut faults = faults(&scene, &cooked);
            let threaded = page::is_full() || integrator == INTEGRATORS[0];
            if threaded && cooked != scene.cook(frames(), 7) {
                faults.push("other bits on 7 threads than on one".into());
            }
            broken.extend(faults.iter().map(|fault| format!("{what}, {integrator}: {fault}\n")));
            worst.add(&cooked);
            if integrator == INTEGRATORS[0] {
                held.push(cooked);
            }
        }
        if broken.is_empty() {
            let (numbers, case) = split(numbers, what);
            page::record(PART, numbers, case, worst.outcome(), &worst.figure());
        }
    }
    assert!(broken.is_empty(), "\n{}", broken.concat());
    held
}

/// The worst that a scene publishes.
#[derive(Default)]
struct Worst {
    volume: f64,
    overlap: f64,
    inverted: f64,
    caps: f64,
}

impl Worst {
    fn add(&mut self, cooked: &Cooked) {
        let most = |name: &str| cooked.metric(name).into_iter().fold(0.0_f64, f64::max);
        let off = cooked.metric("volume_ratio").into_iter().fold(0.0_f64, |most, ratio| most.max((ratio - 1.0).abs()));
        self.volume = self.volume.max(off);
        self.overlap = self.overlap.max(most("deepest_overlap"));
        self.inverted = self.inverted.max(most("inverted_tets"));
        self.caps = self.caps.max(most("caps_hit"));
    }

    fn outcome(&self) -> Outcome {
        if self.caps > 0.0 || self.inverted > 0.0 { Outcome::Capped } else { Outcome::Finite }
    }

    fn figure(&self) -> String {
        let Self { volume, overlap, inverted, caps } = self;
        format!(
            "volume off by {volume:.1e}, tets inside out: {inverted}, overlap {overlap:.1e} m, caps hit a frame: {caps}"
        )
    }
}

/// Checks that each of these scenes is refused with a message that contains these words, and records it.
fn refused<const N: usize>(numbers: &str, rows: [(&str, Scene, &str); N]) {
    for (what, scene, words) in rows {
        let cooked = scene.cook(frames(), 2);
        let said = cooked
            .errors
            .iter()
            .all(|(kind, said)| matches!(kind, ErrorKind::Refused | ErrorKind::NotFinite) && said.contains(words));
        assert!(said && !cooked.errors.is_empty(), "{what}: {:?}", cooked.errors);
        let (numbers, case) = split(numbers, what);
        page::record(PART, numbers, case, Outcome::Refused, &cooked.errors[0].1);
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

crate::page::groups! {
    contact::overlap_with_extreme_colliders_is_prevented_or_published,
    contact::bodies_of_extreme_friction_gravity_and_speed_come_to_rest_on_the_ground,
    empty::empty_and_degenerate_colliders_do_not_disturb_the_others,
    empty::empty_bodies_give_empty_results_or_are_refused,
    numbers::scenes_of_any_scale_position_and_frame_rate_stay_finite,
    numbers::nan_and_infinity_are_refused_by_name_in_every_input,
    numbers::unsorted_duplicate_single_and_missing_keyframes_work_or_are_refused_by_name,
    numbers::bodies_stay_finite_at_both_ends_of_every_range,
    stuff::bodies_with_springs_and_masses_of_any_ratio_hold_together,
    stuff::single_disconnected_inverted_and_flat_tets_move,
    stuff::pinned_particles_follow_pins_that_hold_everything_or_tear_the_body,
    stuff::bodies_move_towards_goals_that_are_unreachable_or_change_every_frame,
}
