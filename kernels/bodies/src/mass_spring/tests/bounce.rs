//! Impacts: how fast bodies leave what they hit, and where their energy goes.

use super::contact::{Planes, ground};
use super::*;

/// A cube of 0.1 m that is thrown straight at the ground, without gravity.
struct Throw {
    stiffness: f64,
    damping: f64,
    /// Of its lower side at the start, metres.
    height: f64,
    speed: f64,
}

/// Its centre of mass after twelve frames, and what it took.
struct Thrown {
    /// Rebound ÷ impact speed.
    rebound: f64,
    newton: u32,
    /// Energy lost by time stepping and contacts, and energy left ÷ energy at the start.
    lost: f64,
    left: f64,
}

impl Throw {
    fn result(&self, frame: &SolverFrame<'_>) -> Thrown {
        let body = block_body([2; 3], 0.05, &material(1e3, self.stiffness, self.damping));
        let mut state = State::at_rest(&body);
        state.positions.iter_mut().for_each(|x| x[1] += self.height);
        state.velocities.fill([0.0, -self.speed, 0.0]);
        let plane = ground(0.0);
        let frame = SolverFrame { gravity: [0.0; 3], contacts: Some(&plane), ..*frame };
        let mut solver = BodySolver::new(&body);
        let mass: f64 = body.masses().iter().sum();
        let energy = 0.5 * mass * self.speed * self.speed;
        let mut thrown = Thrown { rebound: 0.0, newton: 0, lost: 0.0, left: 0.0 };
        for _ in 0..12 {
            let report = solver.step(&body, &mut state, &frame);
            thrown.newton += report.newton;
            thrown.lost += report.energy_lost / energy;
            thrown.left = (report.kinetic + report.elastic + report.volume_energy) / energy;
        }
        thrown.rebound = momentum(&body, &state).y / (mass * self.speed);
        thrown
    }
}

/// Undamped at 10 m/s, over a decade of stiffness, and slow and soft.
const THROWS: [Throw; 4] = [
    Throw { stiffness: 2e4, damping: 0.0, height: 0.21, speed: 2.0 },
    Throw { stiffness: 2e5, damping: 0.0, height: 0.31, speed: 10.0 },
    Throw { stiffness: 6e5, damping: 0.0, height: 0.31, speed: 10.0 },
    Throw { stiffness: 2e6, damping: 0.0, height: 0.31, speed: 10.0 },
];

/// Impacts take more steps than flight, so that a body bounces as it does with short steps throughout.
#[test]
fn a_cube_bounces_as_with_256_steps_a_frame_at_half_the_cost() {
    for throw in &THROWS {
        let [own, short] = [0, 256].map(|substeps| throw.result(&SolverFrame { substeps, ..SolverFrame::default() }));
        let what = format!("E {:.0e}: {:.3} and {:.3}", throw.stiffness, own.rebound, short.rebound);
        println!("{what}, Newton {} and {}", own.newton, short.newton);
        assert!(short.rebound > 0.3 && (own.rebound / short.rebound - 1.0).abs() < 0.15, "{what}");
        assert!(f64::from(own.newton) < 0.45 * f64::from(short.newton), "{what}: {} of {}", own.newton, short.newton);
    }
}

/// What is pinned does not bounce, whichever of its particles is.
#[test]
fn impacts_of_pinned_bodies_take_one_step() {
    let body = block_body([2; 3], 0.05, &material(1e3, 2e5, 0.0));
    let impact = |pins: &[Pin]| {
        let mut state = State::at_rest(&body);
        state.positions.iter_mut().for_each(|x| x[1] += 0.01);
        state.velocities.fill([0.0, -3.0, 0.0]);
        let plane = ground(0.0);
        let frame = SolverFrame { contacts: Some(&plane), pins, ..BARE };
        BodySolver::new(&body).step(&body, &mut state, &frame)
    };
    assert!(impact(&[]).substeps > 1);
    for particle in (0..body.len()).filter(|particle| body.rest_point(*particle)[1] > 0.09) {
        let mut at = body.rest_point(particle);
        at[1] += 0.01;
        let report = impact(&[Pin { particle: particle as u32, between: [at; 2] }]);
        assert_eq!((report.substeps, report.contacts > 0), (1, true), "{particle}");
    }
}

#[test]
fn bodies_leave_at_the_given_share_of_their_speed_of_approach() {
    for throw in &THROWS {
        for (bounce, substeps) in [(0.0, 0), (0.0, 64), (0.1, 0), (0.3, 0), (0.3, 64), (1.0, 0)] {
            let limited = throw.result(&SolverFrame { bounce: Some(bounce), substeps, ..SolverFrame::default() });
            let material = throw.result(&SolverFrame { substeps, ..SolverFrame::default() });
            let expected = material.rebound.min(bounce);
            let off = limited.rebound - expected;
            let what = format!("E {:.0e}, bounce {bounce}, {substeps} steps", throw.stiffness);
            println!("{what}: {:.4} for {expected:.4}", limited.rebound);
            // A cube that does not leave goes on to vibrate on the ground.
            let allowed = if bounce == 0.0 { 5e-3 } else { 2e-3 };
            assert!(off.abs() < allowed, "{what}: {} for {expected}", limited.rebound);
        }
    }
}

#[test]
fn energy_lost_is_what_an_undamped_impact_does_not_give_back() {
    for throw in &THROWS {
        for (bounce, substeps) in [(None, 0), (None, 64), (Some(0.3), 0), (Some(0.0), 0)] {
            let thrown = throw.result(&SolverFrame { bounce, substeps, ..SolverFrame::default() });
            let sum = thrown.lost + thrown.left;
            assert!(
                (sum - 1.0).abs() < 1e-6,
                "E {:.0e}, {bounce:?}: {} + {}",
                throw.stiffness,
                thrown.lost,
                thrown.left
            );
        }
    }
}

/// The sum of `energy_lost` over some frames, and the energy at the end.
fn energy_lost(body: &SoftBody, state: &mut State, frame: &SolverFrame<'_>, frames: usize) -> [f64; 2] {
    let mut solver = BodySolver::new(body);
    (0..frames).fold([0.0; 2], |[lost, _], _| {
        let report = solver.step(body, state, frame);
        [lost + report.energy_lost, report.kinetic + report.elastic + report.volume_energy]
    })
}

/// A plate that takes up a body without bounce does the work m·w², of which half becomes kinetic.
#[test]
fn a_plate_that_takes_up_a_body_loses_half_its_work() {
    let (speed, seconds) = (1.5, 1.0 / 24.0);
    let body = block_body([3; 3], 0.1, &material(1000.0, 1e5, 0.0));
    let mut state = State::at_rest(&body);
    state.positions.iter_mut().for_each(|x| x[1] += 0.02);
    let (mut solver, mut lost, mut report) = (BodySolver::new(&body), 0.0, FrameReport::default());
    for number in 0..16 {
        let heights = [number, number + 1].map(|frame| speed * seconds * f64::from(frame));
        let plate = Planes(vec![([0.0, 1.0, 0.0], heights, 0.0)], seconds);
        let frame = SolverFrame { contacts: Some(&plate), bounce: Some(0.0), ..BARE };
        report = solver.step(&body, &mut state, &frame);
        lost += report.energy_lost;
    }
    let half = 0.5 * 27.0 * speed * speed;
    println!("kinetic {} lost {lost} of {half}", report.kinetic);
    assert!(
        (report.kinetic / half - 1.0).abs() < 0.03 && (lost / half - 1.0).abs() < 0.03,
        "{} {lost}",
        report.kinetic
    );
}

/// What dashpots, friction and pins do is not lost.
#[test]
fn damping_friction_and_pins_lose_no_energy() {
    let body = block_body([4, 3, 3], 0.1, &material(1000.0, 1e5, 0.01));
    let mut state = State::at_rest(&body);
    for (x, v) in state.positions.iter().zip(&mut state.velocities) {
        *v = [2.0 * (x[0] - 0.2), 0.0, -3.0 * x[1]];
    }
    let start: f64 =
        state.velocities.iter().zip(body.masses()).map(|(v, m)| 0.5 * m * DVec3::from(*v).norm_squared()).sum();
    let frame = SolverFrame { substeps: 32, drag: 0.5, ..BARE };
    let [lost, left] = energy_lost(&body, &mut state, &frame, 12);
    println!("damped: start {start} left {left} lost {lost}");
    assert!(left < 0.7 * start && lost.abs() < 2e-3 * (start - left), "{start} {left} {lost}");

    let mut state = State::at_rest(&body);
    state.positions.iter_mut().for_each(|x| x[1] += 0.9 * 1e-3);
    state.velocities.fill([2.0, 0.0, 0.0]);
    let plane = ground(0.4);
    let frame = SolverFrame { contacts: Some(&plane), substeps: 4, ..SolverFrame::default() };
    let start = 0.5 * 36.0 * 4.0;
    let [lost, left] = energy_lost(&body, &mut state, &frame, 8);
    println!("sliding: start {start} left {left} lost {lost}");
    assert!(left < 0.5 * start && lost.abs() < 0.03 * (start - left), "{start} {left} {lost}");

    let mut state = State::at_rest(&body);
    let held: Vec<u32> = (0..body.len() as u32).filter(|i| body.rest_point(*i as usize)[0] == 0.0).collect();
    let mut solver = BodySolver::new(&body);
    let (mut lost, mut report) = (0.0, FrameReport::default());
    for _ in 0..6 {
        let pins: Vec<Pin> = held
            .iter()
            .map(|i| {
                let from = state.positions[*i as usize];
                Pin { particle: *i, between: [from, [from[0] - 0.02, from[1] + 0.03, from[2]]] }
            })
            .collect();
        report = solver.step(&body, &mut state, &SolverFrame { pins: &pins, substeps: 32, ..BARE });
        lost += report.energy_lost;
    }
    let gained = report.kinetic + report.elastic;
    println!("pulled: gained {gained} lost {lost}");
    assert!(gained > 5.0 && lost.abs() < 0.1 * gained, "{gained} {lost}");
}
