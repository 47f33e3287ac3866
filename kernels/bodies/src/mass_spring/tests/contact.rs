//! Contact and friction with ground, plates, a rolling pin and another body.

use super::*;
use numerics::masked::Masked;

const THICKNESS: f64 = 1e-3;

/// Moving half-spaces: normal, height of the surface along it at the start and end of the frame, friction.
pub(super) struct Planes(pub(super) Vec<([f64; 3], [f64; 2], f64)>, pub(super) f64);

impl ContactFinder for Planes {
    fn find(&self, query: &ContactQuery<'_>, out: &mut Vec<Contact>) {
        for (normal, heights, friction) in &self.0 {
            let n = DVec3::from(*normal);
            let at = |time: f64| heights[0] + (heights[1] - heights[0]) * time;
            let offset = at(query.times[1]);
            for (particle, to) in query.to.iter().enumerate() {
                let nearest = (n.dot(&DVec3::from(*to)) - offset)
                    .min(n.dot(&DVec3::from(query.from[particle])) - at(query.times[0]));
                if nearest < 2.0 * THICKNESS {
                    out.push(Contact {
                        points: [particle as u32, 0, 0, 0],
                        weights: [1.0, 0.0, 0.0, 0.0],
                        normal: *normal,
                        offset,
                        gap: THICKNESS,
                        velocity: (n * ((heights[1] - heights[0]) / self.1)).into(),
                        friction: *friction,
                        jammed: false,
                        open: false,
                    });
                }
            }
        }
    }
}

pub(super) fn ground(friction: f64) -> Planes {
    Planes(vec![([0.0, 1.0, 0.0], [0.0, 0.0], friction)], 1.0 / 24.0)
}

/// A rolling cylinder along z: axis at the start and end of the frame, radius, angular velocity.
struct RollingPin {
    axis: [[f64; 2]; 2],
    radius: f64,
    angular_velocity: f64,
    friction: f64,
    seconds: f64,
}

impl ContactFinder for RollingPin {
    fn find(&self, query: &ContactQuery<'_>, out: &mut Vec<Contact>) {
        let time = query.times[1];
        let axis: [f64; 2] = std::array::from_fn(|k| self.axis[0][k] + (self.axis[1][k] - self.axis[0][k]) * time);
        for (particle, to) in query.to.iter().enumerate() {
            let from = query.from[particle];
            let near = |p: &[f64; 3]| DVec3::new(p[0] - axis[0], p[1] - axis[1], 0.0);
            let (d, d_from) = (near(to), near(&from));
            if d.norm().min(d_from.norm()) < self.radius + 2.0 * THICKNESS {
                // The side it comes from, if it would pass through.
                let n = if d.dot(&d_from) > 0.0 { d.normalize() } else { d_from.normalize() };
                let middle = DVec3::new(axis[0], axis[1], 0.0);
                let pace = DVec3::new(
                    (self.axis[1][0] - self.axis[0][0]) / self.seconds,
                    (self.axis[1][1] - self.axis[0][1]) / self.seconds,
                    0.0,
                );
                out.push(Contact {
                    points: [particle as u32, 0, 0, 0],
                    weights: [1.0, 0.0, 0.0, 0.0],
                    normal: n.into(),
                    offset: n.dot(&middle) + self.radius,
                    gap: THICKNESS,
                    velocity: (pace + DVec3::z().cross(&n) * (self.angular_velocity * self.radius)).into(),
                    friction: self.friction,
                    jammed: false,
                    open: false,
                });
            }
        }
    }
}

struct Both<'a>(&'a dyn ContactFinder, &'a dyn ContactFinder);

impl ContactFinder for Both<'_> {
    fn find(&self, query: &ContactQuery<'_>, out: &mut Vec<Contact>) {
        self.0.find(query, out);
        self.1.find(query, out);
    }
}

fn lowest(state: &State) -> f64 {
    state.positions.iter().map(|x| x[1]).fold(f64::INFINITY, f64::min)
}

fn fastest(state: &State) -> f64 {
    state.velocities.iter().map(|v| DVec3::from(*v).norm()).fold(0.0, f64::max)
}

fn centre(body: &SoftBody, state: &State) -> DVec3 {
    let masses = body.masses();
    let sum = state.positions.iter().zip(&masses).fold(DVec3::zeros(), |sum, (x, m)| sum + DVec3::from(*x) * *m);
    sum / masses.iter().sum::<f64>()
}

#[test]
fn a_block_dropped_on_the_ground_comes_to_rest_there() {
    let ground = ground(0.5);
    for (stiffness, volume, bounce) in [
        (5e4, 0.0, Some(0.0)),
        (5e4, 1.0, Some(0.0)),
        (1e7, 1.0, Some(0.0)),
        (5e4, 0.0, None),
        (5e4, 1.0, None),
        // A corner went round in circles.
        (5e6, 1.0, None),
        (1e7, 1.0, None),
    ] {
        let body = block_body([4, 4, 4], 0.1, &material(1000.0, stiffness, 2e3 / stiffness));
        let mut state = State::at_rest(&body);
        state.positions.iter_mut().for_each(|x| x[1] += 0.2);
        let frame = SolverFrame { contacts: Some(&ground), volume, bounce, ..SolverFrame::default() };
        let mut solver = BodySolver::new(&body);
        let mut newton = 0;
        for number in 0..240 {
            let report = solver.step(&body, &mut state, &frame);
            newton += report.newton;
            assert!(lowest(&state) > 0.0, "E {stiffness}, frame {number}: {} {report:?}", lowest(&state));
            // It must not bounce higher than it fell from.
            assert!(centre(&body, &state).y < 0.41, "frame {number}");
        }
        assert!(lowest(&state) < THICKNESS);
        assert!(fastest(&state) < 1e-4 * 9.81 / 24.0, "E {stiffness}, volume {volume}: {}", fastest(&state));
        assert!(bounce.is_none() || newton < 240 * 6, "{newton} iterations");
        // Its weight compresses a cube of height h by about ½ρgh²/E.
        let sag = 0.2 - centre(&body, &state).y;
        assert!(sag < 0.4 * 1000.0 * 9.81 * 0.16 / stiffness + THICKNESS, "{sag}");
    }
}

/// Springs alone, in cells of 5 mm; in free fall it would come 17 mm down in the frame. Stopped point by point, the skin let the
/// layers above it fall through.
#[test]
fn what_is_put_on_the_ground_takes_one_step_and_few_iterations() {
    let (points, tets) = cubes([10; 3], [0.0, THICKNESS, 0.0], [0.05; 3]);
    let mesh = Mesh { points: &points, tets: &tets, ..Mesh::default() };
    let body = SoftBody::new(&mesh, &material(1e3, 5e3, 0.01), &[]).unwrap();
    let frame = SolverFrame { volume: 0.0, contacts: Some(&ground(0.5)), ..SolverFrame::default() };
    let report = steps(&body, &mut State::at_rest(&body), &frame, 1);
    assert!(report.newton <= 12 && report.substeps == 1, "{report:?}");
}

#[test]
fn a_block_on_a_slope_sticks_below_the_friction_angle_and_slides_above() {
    let angle = 30.0_f64.to_radians();
    let (sine, cosine) = (libm::sin(angle), libm::cos(angle));
    let gravity = [9.81 * sine, -9.81 * cosine, 0.0];
    for (friction, sticks) in [(0.0, false), (0.3, false), (0.5, false), (0.7, true), (1.0, true), (1e6, true)] {
        let ground = ground(friction);
        let body = block_body([4, 2, 4], 0.1, &material(1000.0, 1e6, 0.005));
        let mut state = State::at_rest(&body);
        state.positions.iter_mut().for_each(|x| x[1] += 0.9 * THICKNESS);
        let frame = SolverFrame { gravity, contacts: Some(&ground), ..SolverFrame::default() };
        let mut solver = BodySolver::new(&body);
        let mut run = |state: &mut State, frames: usize| {
            for _ in 0..frames {
                let _ = solver.step(&body, state, &frame);
            }
        };
        run(&mut state, 24);
        let (before, speed) = (centre(&body, &state).x, momentum(&body, &state).x / 32.0);
        run(&mut state, 24);
        let (after, speed_after) = (centre(&body, &state).x, momentum(&body, &state).x / 32.0);
        if sticks {
            assert!((after - before).abs() < 1e-4 * 0.4, "μ {friction}: creeps {} a second", after - before);
        } else {
            let expected = 9.81 * (sine - friction * cosine);
            let found = speed_after - speed;
            assert!((found / expected - 1.0).abs() < 0.01, "μ {friction}: {found} for {expected}");
        }
    }
}

/// Sliding friction is μ times the normal force at any time, so the speed lost along the ground is μ times the change of
/// speed across it, however stiff the block and however short the impact. One step a frame.
#[test]
fn a_block_that_hits_the_ground_obliquely_is_slowed_by_friction_times_its_change_of_speed() {
    for stiffness in [1e5, 1e6, 1e7, 1e8] {
        for friction in [0.0, 0.1, 0.2, 0.3, 0.5] {
            let body = block_body([4, 4, 4], 0.025, &material(1000.0, stiffness, 1e-3));
            let mut state = State::at_rest(&body);
            state.positions.iter_mut().for_each(|x| x[1] += 0.05);
            state.velocities.fill([2.0, -2.0, 0.0]);
            let plane = ground(friction);
            let frame =
                SolverFrame { gravity: [0.0; 3], contacts: Some(&plane), substeps: 1, ..SolverFrame::default() };
            let _ = steps(&body, &mut state, &frame, 8);
            let mean = momentum(&body, &state);
            let expected = 2.0 - friction * (2.0 + mean.y);
            let off = (mean.x / expected - 1.0).abs();
            assert!(off < 0.05, "E {stiffness}, μ {friction}: {} for {expected} m/s", mean.x);
        }
    }
}

#[test]
fn contacts_hold_under_pins_that_press_ten_thicknesses_a_frame() {
    let ground = ground(0.5);
    for integrator in [Integrator::Default, Integrator::Euler] {
        let body = block_body([4, 4, 4], 0.1, &material(1000.0, 1e5, 0.01));
        let mut state = State::at_rest(&body);
        state.positions.iter_mut().for_each(|x| x[1] += THICKNESS);
        let top: Vec<usize> = (0..body.len()).filter(|i| body.rest_point(*i)[1] > 0.399).collect();
        let mut solver = BodySolver::new(&body);
        for number in 0..20 {
            let pins: Vec<Pin> = top
                .iter()
                .map(|i| {
                    let from = state.positions[*i];
                    Pin { particle: *i as u32, between: [from, [from[0], from[1] - 10.0 * THICKNESS, from[2]]] }
                })
                .collect();
            let frame = SolverFrame { contacts: Some(&ground), pins: &pins, integrator, ..SolverFrame::default() };
            let report = solver.step(&body, &mut state, &frame);
            assert!(lowest(&state) > 0.0, "{integrator:?}, frame {number}: {} {report:?}", lowest(&state));
            assert_eq!(report.inverted_tets, 0);
        }
    }
}

#[test]
fn a_block_pressed_to_half_its_height_keeps_its_volume_and_bulges_evenly() {
    let body = block_body([6, 6, 6], 0.1, &material(1000.0, 1e5, 0.02));
    let mut state = State::at_rest(&body);
    state.positions.iter_mut().for_each(|x| x[1] += THICKNESS);
    let mut solver = BodySolver::new(&body);
    let mut report = FrameReport::default();
    let top = |frame: usize| 0.6 + 2.0 * THICKNESS - 0.3 * (frame.min(48) as f64 / 48.0);
    for number in 0..96 {
        let plates = Planes(
            vec![([0.0, 1.0, 0.0], [0.0, 0.0], 0.5), ([0.0, -1.0, 0.0], [-top(number), -top(number + 1)], 0.5)],
            1.0 / 24.0,
        );
        let frame = SolverFrame { gravity: [0.0; 3], contacts: Some(&plates), ..SolverFrame::default() };
        report = solver.step(&body, &mut state, &frame);
        let highest = state.positions.iter().map(|x| x[1]).fold(0.0, f64::max);
        assert!(lowest(&state) > 0.0 && highest < top(number + 1), "frame {number}: {highest} {report:?}");
    }
    assert_eq!(report.inverted_tets, 0);
    assert!((report.volume_ratio - 1.0).abs() < 0.025, "{report:?}");
    let parallel = |axis: usize| {
        let along = || state.positions.iter().map(|x| x[axis]);
        along().fold(f64::MIN, f64::max) - along().fold(f64::MAX, f64::min)
    };
    assert!((parallel(0) / parallel(2) - 1.0).abs() < 0.05 && parallel(0) > 0.75, "{} {}", parallel(0), parallel(2));
}

#[test]
fn a_rolling_pin_drags_dough_along_and_does_not_sink_in() {
    let body = block_body([10, 2, 3], 0.05, &material(1000.0, 2e4, 0.02));
    let mut state = State::at_rest(&body);
    state.positions.iter_mut().for_each(|x| x[1] += THICKNESS);
    let ground = ground(1.0);
    let mut solver = BodySolver::new(&body);
    for number in 0..48 {
        let along =
            |frame: usize| [0.05 + 0.4 * frame as f64 / 48.0, 0.16 + 0.05 * (1.0 - (frame as f64 / 12.0).min(1.0))];
        let pin = RollingPin {
            axis: [along(number), along(number + 1)],
            radius: 0.1,
            angular_velocity: -2.0,
            friction: 0.8,
            seconds: 1.0 / 24.0,
        };
        let both = Both(&ground, &pin);
        let report = solver.step(&body, &mut state, &SolverFrame { contacts: Some(&both), ..SolverFrame::default() });
        let axis = along(number + 1);
        let deepest = state
            .positions
            .iter()
            .map(|x| ((x[0] - axis[0]) * (x[0] - axis[0]) + (x[1] - axis[1]) * (x[1] - axis[1])).sqrt() - 0.1)
            .fold(f64::INFINITY, f64::min);
        assert!(
            deepest > -0.3 * THICKNESS && lowest(&state) > -0.1 * THICKNESS,
            "frame {number}: {deepest} {} {report:?}",
            lowest(&state)
        );
        assert!(fastest(&state) < 3.0, "frame {number}: {}", fastest(&state));
    }
}

/// Particles of one block against the top of another: a grid of squares of two triangles.
struct Stack {
    lower: u32,
    side: f64,
    cells: u32,
}

impl ContactFinder for Stack {
    fn find(&self, query: &ContactQuery<'_>, out: &mut Vec<Contact>) {
        let n = self.cells + 1;
        let place = |x: u32, z: u32| x + n * (self.cells + n * z);
        for particle in self.lower as usize..query.to.len() {
            let to = query.to[particle];
            let base = query.to[place(0, 0) as usize];
            let cell = [(to[0] - base[0]) / self.side, (to[2] - base[2]) / self.side];
            let [i, k] = cell.map(|c| (c.floor().max(0.0) as u32).min(self.cells - 1));
            let [u, w] = [(cell[0] - f64::from(i)).clamp(0.0, 1.0), (cell[1] - f64::from(k)).clamp(0.0, 1.0)];
            let (corners, weights) = if u + w <= 1.0 {
                ([place(i, k), place(i + 1, k), place(i, k + 1)], [1.0 - u - w, u, w])
            } else {
                ([place(i + 1, k + 1), place(i, k + 1), place(i + 1, k)], [u + w - 1.0, 1.0 - u, 1.0 - w])
            };
            let height = |points: &[[f64; 3]]| {
                points[particle][1] - (0..3).map(|c| weights[c] * points[corners[c] as usize][1]).sum::<f64>()
            };
            if height(query.from) > -0.05 && height(query.to).min(height(query.from)) < 2.0 * THICKNESS {
                out.push(Contact {
                    points: [particle as u32, corners[0], corners[1], corners[2]],
                    weights: [1.0, -weights[0], -weights[1], -weights[2]],
                    normal: [0.0, 1.0, 0.0],
                    offset: 0.0,
                    gap: THICKNESS,
                    velocity: [0.0; 3],
                    friction: 0.5,
                    jammed: false,
                    open: false,
                });
            }
        }
    }
}

#[test]
fn colliding_blocks_conserve_momentum_and_rest_on_each_other() {
    let (mut points, mut tets) = block([3, 3, 3], 0.1);
    let lower = points.len() as u32;
    let (above, more) = block([3, 3, 3], 0.1);
    points.extend(above.iter().map(|x| [x[0] + 0.013, x[1] + 0.32, x[2] + 0.021]));
    tets.extend(more.iter().map(|tet| tet.map(|corner| corner + lower)));
    let mesh = Mesh { points: &points, tets: &tets, ..Mesh::default() };
    let body = SoftBody::new(&mesh, &material(1000.0, 1e5, 0.03), &[]).unwrap();
    let stack = Stack { lower, side: 0.1, cells: 3 };

    let mut state = State::at_rest(&body);
    state.velocities[lower as usize..].iter_mut().for_each(|v| *v = [0.0, -1.0, 0.0]);
    let (before, turning) = (momentum(&body, &state), angular_momentum(&body, &state));
    let mut solver = BodySolver::new(&body);
    let frame = SolverFrame { gravity: [0.0; 3], contacts: Some(&stack), ..SolverFrame::default() };
    let mut touched = 0;
    let kinetic = 0.5 * before.y * before.y / 27.0;
    for number in 0..24 {
        let report = solver.step(&body, &mut state, &frame);
        touched += report.contacts;
        assert!(report.kinetic + report.elastic < kinetic * 1.01, "frame {number}: {report:?}");
    }
    assert!(touched > 0);
    let after = momentum(&body, &state);
    assert!((after - before).norm() < 1e-6 * before.norm(), "{before} became {after}");
    let after = angular_momentum(&body, &state);
    assert!((after - turning).norm() < 1e-2 * turning.norm(), "{turning} became {after}");

    let ground = ground(0.5);
    let both = Both(&ground, &stack);
    let mut state = State::at_rest(&body);
    let frame = SolverFrame { contacts: Some(&both), ..SolverFrame::default() };
    let report = steps(&body, &mut state, &frame, 240);
    assert!(lowest(&state) > 0.0 && report.deepest_overlap < THICKNESS, "{report:?}");
    assert!(fastest(&state) < 1e-3 * 9.81 / 24.0, "{}", fastest(&state));
    let (low, high) = state.positions.split_at(lower as usize);
    let mean = |half: &[[f64; 3]]| half.iter().map(|x| x[1]).sum::<f64>() / half.len() as f64;
    assert!(mean(high) - mean(low) > 0.28, "{} over {}", mean(high), mean(low));
}

#[test]
fn extreme_friction_and_obstacles_stay_finite() {
    for friction in [0.0, 1.0, 1e6] {
        for (heights, bound) in [([0.0, 5.0], 200.0), ([0.0, -5.0], 20.0), ([1.0, 1.0], 20.0)] {
            let body = block_body([3, 3, 3], 0.1, &material(1000.0, 1e5, 0.01));
            let mut state = State::at_rest(&body);
            let mut solver = BodySolver::new(&body);
            for number in 0..10 {
                let now = if number == 3 { heights } else { [heights[usize::from(number > 3)]; 2] };
                let ground = Planes(vec![([0.0, 1.0, 0.0], now, friction)], 1.0 / 24.0);
                let report =
                    solver.step(&body, &mut state, &SolverFrame { contacts: Some(&ground), ..SolverFrame::default() });
                assert!(is_finite(&state) && report.stopped == 0);
                let far = state.positions.iter().flatten().fold(0.0_f64, |far, x| far.max(x.abs()));
                assert!(far < bound, "μ {friction}, {heights:?}, frame {number}: {far}");
            }
        }
    }
}

#[test]
fn bodies_with_extreme_stiffness_mass_or_start_come_to_rest_on_the_ground() {
    let ground = ground(0.5);
    let from = |index: usize, turned: bool| {
        let out = random(7, index) * 0.2;
        if turned { out } else { DVec3::zeros() }
    };
    for stiffness in [1e-6, 1.0, 1e3, 1e6, 1e9, 1e12] {
        for (ratio, turned) in [(1.0, false), (1e6, false), (1.0, true), (1e6, true)] {
            let (points, tets) = block([3, 3, 3], 0.1);
            let mask: Vec<f32> = (0..points.len()).map(|i| if i % 2 == 0 { 1.0 } else { 1.0 / ratio as f32 }).collect();
            let density = Masked { value: 1000.0, mask: Some(&mask) };
            let material = Material { density, ..material(1000.0, stiffness, 0.01) };
            let body =
                SoftBody::new(&Mesh { points: &points, tets: &tets, ..Mesh::default() }, &material, &[]).unwrap();
            let mut state = State::at_rest(&body);
            for (index, x) in state.positions.iter_mut().enumerate() {
                *x = (DVec3::from(*x) + DVec3::y() * 0.12 + from(index, turned)).into();
            }
            let mut solver = BodySolver::new(&body);
            for number in 0..48 {
                let report =
                    solver.step(&body, &mut state, &SolverFrame { contacts: Some(&ground), ..SolverFrame::default() });
                let what = || format!("E {stiffness}, ratio {ratio}, turned {turned}, frame {number}: {report:?}");
                assert!(is_finite(&state) && report.stopped == 0, "{}", what());
                assert!(lowest(&state) > -THICKNESS, "{} {}", lowest(&state), what());
                let far = state.positions.iter().flatten().fold(0.0_f64, |far, x| far.max(x.abs()));
                assert!(far < 1e3, "{far} {}", what());
            }
        }
    }
}

/// Dough that hits the ground much too fast for the frame is flattened and inverted within one step. That may only
/// take energy from its motion: no step ends with more energy than the one before, except for two thousandths that steps
/// before it lost. Starts that differ by 1e-9 m crumple in other ways.
#[test]
fn dough_smashed_within_one_step_gains_no_energy() {
    let speeds = [2.0, 3.0, 5.0, 8.0, 15.0, 30.0, 50.0, 100.0];
    for (speed, start) in speeds.into_iter().flat_map(|speed| [0, 4, 9].map(|start| (speed, start))) {
        let (key, noise) = (Key::new(start), if start > 0 { 1e-9 } else { 0.0 });
        let (points, tets) = block([6, 6, 6], 0.02);
        let body =
            SoftBody::new(&Mesh { points: &points, tets: &tets, ..Mesh::default() }, &material(1000.0, 5e3, 0.01), &[])
                .unwrap();
        let mut state = State::at_rest(&body);
        let random = |coordinate: usize| noise * (2.0 * key.of(coordinate as u64).f64() - 1.0);
        state.positions.as_flattened_mut().iter_mut().enumerate().for_each(|(at, x)| *x += random(at));
        state.positions.iter_mut().for_each(|p| p[1] += 1.5 * THICKNESS);
        state.velocities.iter_mut().for_each(|v| v[1] = -speed);
        let ground = ground(0.5);
        let mut solver = BodySolver::new(&body);
        let mut before = 0.5 * body.masses().iter().sum::<f64>() * speed * speed;
        for frame in 0..16 {
            let report = solver.step(&body, &mut state, &SolverFrame { contacts: Some(&ground), volume: 1.0, ..BARE });
            let after = report.kinetic + report.elastic + report.volume_energy;
            assert!(after <= before * 1.0025, "{speed} m/s, start {start}, frame {frame}: {before} J become {after}");
            before = after;
        }
    }
}

/// A body that starts a metre inside the ground leaves it by about a spring length a frame, and vertically: deep
/// contacts have no friction, and residuals of linear solves must not push it sideways.
#[test]
fn a_penetrating_body_separates_gradually() {
    let side = 0.1;
    let body = block_body([4, 4, 4], side, &material(1000.0, 1e5, 0.01));
    for substeps in [0, 1, 2, 4, 8, 16, 32, 64] {
        let mut state = State::at_rest(&body);
        state.positions.iter_mut().for_each(|p| p[1] -= 1.0);
        let ground = ground(0.5);
        let mut solver = BodySolver::new(&body);
        let frame = SolverFrame { contacts: Some(&ground), volume: 1.0, substeps, ..SolverFrame::default() };
        let mut most = 0.0_f64;
        for number in 0..96 {
            let _ = solver.step(&body, &mut state, &frame);
            most = most.max(fastest(&state));
            if number == 0 {
                let momenta = state.velocities.iter().zip(body.masses()).map(|(v, mass)| DVec3::from(*v) * mass);
                let momentum: DVec3 = momenta.sum();
                let aside = momentum.xz().norm() / momentum.y;
                assert!(aside < 1e-6, "{substeps} substeps: {aside} aside of one upwards");
            }
        }
        assert!(most < 4.0 * side * 24.0, "{substeps} substeps: thrown at {most} m/s");
        assert!(lowest(&state) > 0.0, "{substeps} substeps: {} m below", -lowest(&state));
    }
}

/// Rebound ÷ impact speed of a cube of 0.1 m thrown at the ground from a `height`, m, at a `speed`, m/s.
fn restitution(body: &SoftBody, height: f64, speed: f64, integrator: Integrator, substeps: u32) -> f64 {
    let mut state = State::at_rest(body);
    state.positions.iter_mut().for_each(|x| x[1] += height);
    state.velocities.fill([0.0, -speed, 0.0]);
    let plane = ground(0.5);
    let frame =
        SolverFrame { gravity: [0.0; 3], contacts: Some(&plane), integrator, substeps, ..SolverFrame::default() };
    let (mut solver, mut fastest) = (BodySolver::new(body), 0.0_f64);
    for _ in 0..12 {
        let _ = solver.step(body, &mut state, &frame);
        fastest = fastest.max(momentum(body, &state).y / body.masses().iter().sum::<f64>() / speed);
    }
    fastest
}

/// A step that would gain energy or fails is damped; it has to meet the tolerance all the same.
#[test]
fn the_accurate_integrator_agrees_with_itself_and_with_short_steps_on_how_high_a_cube_bounces() {
    for (stiffness, damping, height, speed) in [(2e4, 1e-3, 0.21, 2.0), (2e4, 1e-3, 0.31, 10.0), (2e5, 0.0, 0.31, 10.0)]
    {
        let body = block_body([2; 3], 0.05, &material(1e3, stiffness, damping));
        let accurate = |tolerance| restitution(&body, height, speed, Integrator::Accurate { tolerance }, 0);
        let (rough, fine) = (accurate(1e-3), accurate(1e-5));
        let short = restitution(&body, height, speed, Integrator::Default, 256);
        assert!(
            (rough / fine - 1.0).abs() < 0.03,
            "E {stiffness}: {rough}, and {fine} at a hundredth of the tolerance"
        );
        assert!((rough / short - 1.0).abs() < 0.03, "E {stiffness}: {rough}, and {short} by 256 steps");
    }
}
