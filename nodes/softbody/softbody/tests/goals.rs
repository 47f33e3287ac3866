//! When goals pull, how long they hold, and which have no effect.

use super::*;

#[test]
fn goals_that_have_no_effect_are_counted_and_the_first_is_named() {
    let goal = |frame: f32, body: Component| {
        let mut goal = pressed(0, body.into());
        goal.part_mut(Kind::Tets).unwrap().set(GOAL_FRAME, vec![frame]).unwrap();
        Geometry::from(goal.tets().unwrap().clone())
    };
    let with = |goals: Vec<Geometry>, on: GoalOn| {
        let soft = simulating(with_inside(0, cube().into())).set(GOAL_ON, on).set(START_FRAME, 1);
        goals.into_iter().fold(soft, |soft, goal| soft.input(GOALS, goal)).frames([1, 2]).remove(1).metrics
    };
    let of = |frame: f32| goal(frame, cube());
    let healthy = with(vec![of(12.0), of(24.0)], GoalOn::Interior);
    assert_eq!((healthy["idle_goals"], healthy["doubled_goals"], healthy["early_goals"]), (0.0, 0.0, 0.0));
    let doubled = with(vec![of(12.0), of(24.0), of(12.0)], GoalOn::Interior);
    assert_eq!((doubled["doubled_goals"], doubled["doubled_goals_wire"]), (1.0, 2.0));
    let early = with(vec![of(12.0), of(-5.0)], GoalOn::Interior);
    assert_eq!((early["early_goals"], early["early_goals_wire"]), (1.0, 1.0));
    assert_eq!(with(vec![of(1.0)], GoalOn::Interior)["early_goals"], 1.0, "it is over in the first step");
    let hollow = simulating(block([1; 3], [0.0; 3], [0.1; 3]));
    let mut shape = Geometry::from(block([1; 3], [0.0; 3], [0.1; 3]));
    for (attribute, value) in [(GOAL_FRAME, 2.0), (GOAL_STRENGTH, 2000.0), (GOAL_HOLD, 0.0)] {
        shape.part_mut(Kind::Tets).unwrap().set(attribute, vec![value]).unwrap();
    }
    let idle = hollow.input(GOALS, shape).frames([1, 2]).remove(1).metrics;
    assert_eq!((idle["idle_goals"], idle["idle_goals_wire"]), (1.0, 0.0));
}

/// A body moved along x, with goal attributes.
fn goal_along(mut body: Component, way: f32, numbers: &[(Attr<f32>, f32)]) -> Geometry {
    body.edit(P).unwrap().iter_mut().for_each(|p| p[0] += way);
    for (attribute, value) in [(GOAL_FRAME, 12.0), (GOAL_STRENGTH, 1e4), (GOAL_HOLD, 0.0)].iter().chain(numbers) {
        body.set(*attribute, vec![*value]).unwrap();
    }
    body.into()
}

fn pulled(goals: impl IntoIterator<Item = Geometry>) -> Bench {
    let soft = simulating(cube()).set(GOAL_ON, GoalOn::All).set(GRAVITY, [0.0; 3]).set(RESET_TO_GOALS, 0.0);
    goals.into_iter().fold(soft, |soft, goal| soft.input(GOALS, goal))
}

/// How far each frame's body has moved since the first frame.
fn moves(frames: &[BenchResult]) -> Vec<[f64; 3]> {
    let first = |frame: &BenchResult| frame.mesh().positions()[0].map(f64::from);
    let rest = first(&frames[0]);
    frames.iter().map(|frame| std::array::from_fn(|k| first(frame)[k] - rest[k])).collect()
}

/// Before its start a goal does not pull. Then the target moves evenly from where the body is to the goal, and the
/// body's distance from it is (v − u)·t·exp(−√k·t), with the body's and the target's velocities at the start.
#[test]
fn a_goal_pulls_from_its_start_frame_on() {
    let numbers = [(GOAL_FRAME, 21.0), (GOAL_START, 11.0), (GOAL_STRENGTH, 100.0)];
    let soft = pulled([goal_along(cube(), 0.3, &numbers)]).set(INITIAL_VELOCITY, [0.0, 0.5, 0.0]).set(SUBSTEPS, 64);
    let moves = moves(&soft.set(SELF_COLLISION, false).frames(1..=21));
    let found = 10.0 * H * 0.5;
    let target = [0.3 / (10.0 * H), -found / (10.0 * H)];
    for (frame, moved) in moves.iter().enumerate() {
        let free = 0.5 * H * frame.min(10) as f64;
        let time = H * frame.saturating_sub(10) as f64;
        let fading = time * libm::exp(-10.0 * time);
        let [x, y] = [target[0] * time - target[0] * fading, free + target[1] * time + (0.5 - target[1]) * fading];
        let limit = if frame <= 10 { 1e-7 } else { 2e-6 };
        assert!((moved[0] - x).abs() < limit && (moved[1] - y).abs() < limit, "{frame}: {moved:?} {x} {y}");
    }
}

/// Where a particle's share of the strength is 0, it is as free as without a goal: apart from a body of two separate cubes, of
/// which a goal pulls one.
#[test]
fn a_goal_pulls_the_particles_that_have_a_share_of_its_strength() {
    let two = || {
        let (mut points, mut tets) = (Vec::new(), Vec::new());
        for apart in [0.0, 3.0] {
            let first = points.len() as u32;
            points.extend(cube().positions().iter().map(|p| [p[0] + apart, p[1], p[2]]));
            tets.extend(cube().tet_corners().iter().map(|tet| tet.map(|corner| corner + first)));
        }
        Component::tets(tets, points).unwrap()
    };
    let half = two().point_count() / 2;
    let goal = |shares: [f32; 2]| {
        let mut goal = goal_along(two(), 0.2, &[(GOAL_FRAME, 9.0), (GOAL_HOLD, 20.0)]);
        let rows = (0..2 * half).map(|row| shares[row / half]).collect();
        goal.part_mut(Kind::Tets).unwrap().set(GOAL_SHARE, rows).unwrap();
        goal
    };
    let cooked = |shares: [f32; 2]| {
        let soft = simulating(two()).set(GOAL_ON, GoalOn::All).set(GRAVITY, [0.0; 3]).set(RESET_TO_GOALS, 0.0);
        soft.input(GOALS, goal(shares)).frames(1..=12)
    };
    let one = cooked([0.0, 1.0]);
    let (rest, last) = (one[0].mesh().positions(), one[11].mesh().positions());
    for (from, to) in rest.iter().zip(last) {
        let asked = if from[0] < 1.5 { 0.0 } else { 0.2 };
        let limit = if asked > 0.0 { 2e-3 } else { 1e-6 };
        assert!((to[0] - from[0] - asked).abs() < limit, "{from:?} moved to {to:?}");
    }
    assert!(one[11].metrics["goal_distance"] < 2e-3, "the mean is over the particles that are pulled");
    assert_eq!(one[11].metrics["idle_goals"], 0.0);
    assert_eq!(cooked([0.0, 0.0])[11].metrics["idle_goals"], 1.0);
}

#[test]
fn between_its_hold_and_the_start_of_the_next_goal_a_body_is_free() {
    let first = goal_along(cube(), 0.1, &[(GOAL_FRAME, 4.0), (GOAL_HOLD, 4.0)]);
    let next = |start: f32| goal_along(cube(), -0.1, &[(GOAL_FRAME, 20.0), (GOAL_START, start)]);
    let drag = |start: f32| moves(&pulled([first.clone(), next(start)]).frames([1, 8, 12, 14, 20]));
    let [waits, follows, held] = [14.0, -1e9, 8.0].map(drag);
    assert!((waits[1][0] - 0.1).abs() < 1e-3, "{waits:?}");
    let speed = |from: usize, to: usize, frames: f64| (waits[to][0] - waits[from][0]) / frames;
    assert!((speed(1, 2, 4.0) - speed(2, 3, 2.0)).abs() < 1e-8, "it moves evenly: {waits:?}");
    assert!((follows[2][0] - 0.1 + 0.2 * 4.0 / 12.0).abs() < 5e-3, "{follows:?}");
    assert_eq!(follows, held, "a start within the hold before it changes nothing");
    for moved in [waits, follows] {
        assert!((moved[4][0] + 0.1).abs() < 0.01, "{moved:?}");
    }
}

#[test]
fn a_goal_that_starts_to_pull_after_its_frame_pulls_at_once_or_not_at_all() {
    let late = |hold: f32| {
        let goal = goal_along(cube(), 0.1, &[(GOAL_FRAME, 4.0), (GOAL_START, 6.0), (GOAL_HOLD, hold)]);
        moves(&pulled([goal]).set(RESET_TO_GOALS, 1.0).frames([1, 6, 10]))
            .iter()
            .map(|moved| moved[0])
            .collect::<Vec<_>>()
    };
    assert_eq!(late(2.0), [0.0; 3]);
    let held = late(6.0);
    assert!(held[1] == 0.0 && (held[2] - 0.1).abs() < 1e-3, "{held:?}");
}

#[test]
fn a_hold_lasts_until_the_next_goal_at_most() {
    let goals = [(4.0, 20.0, 0.1), (12.0, 0.0, -0.1)]
        .map(|(frame, hold, way)| goal_along(cube(), way, &[(GOAL_FRAME, frame), (GOAL_HOLD, hold)]));
    let frames = pulled(goals).frames([1, 11, 12]);
    assert!((moves(&frames)[1][0] - 0.1).abs() < 1e-3, "{:?}", moves(&frames));
    assert_eq!((frames[2].metrics["doubled_goals"], frames[2].metrics["doubled_goals_wire"]), (1.0, 1.0));
}

#[test]
fn the_body_that_never_comes_near_its_goal_is_named() {
    let other = || block([3, 2, 2], [0.0, 1.0, 0.0], [0.1; 3]);
    let [near, weak] = [1e4, 1e-3].map(|strength| (GOAL_STRENGTH, strength));
    let goals = [
        goal_along(cube(), 0.3, &[near, (GOAL_FRAME, 10.0)]),
        goal_along(other(), 0.3, &[near, (GOAL_FRAME, 4.0)]),
        goal_along(other(), -0.3, &[weak, (GOAL_START, 5.0), (GOAL_FRAME, 8.0), (GOAL_HOLD, 2.0)]),
    ];
    let frames = pulled(goals).input(BODIES, other()).set(BODY_COLLISION, false).frames([3, 4, 8, 10]);
    assert!(!frames[0].metrics.contains_key("goal_miss"), "before any goal");
    assert!(frames[1].metrics["goal_miss"] < 0.1);
    for frame in &frames[2..] {
        let of = |name: &str| frame.metrics[name];
        assert!(of("goal_miss") > 0.25 && (of("goal_miss_body"), of("goal_miss_goal")) == (1.0, 2.0));
    }
    let held = goal_along(cube(), 0.3, &[(GOAL_STRENGTH, 200.0), (GOAL_FRAME, 4.0), (GOAL_HOLD, 20.0)]);
    let frames = pulled([held]).frames([4, 24]);
    assert!(frames[0].metrics["goal_miss"] > 0.25 && frames[1].metrics["goal_miss"] < 0.1, "it arrives in the hold");
}
