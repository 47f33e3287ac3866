use super::*;
use conformance::{Bench, BenchResult, bench, conformance, cook_all};
use engine::cook::{Engine, Settings};

mod bounce;
mod carried;
mod close;
mod goals;
mod inside;
mod riding;

use inside::solid;

const G: f64 = 9.81;
/// Seconds of a frame.
const H: f64 = 1.0 / 24.0;

/// A block of cubes of six tets each, `count` of them along each axis.
fn block(count: [usize; 3], low: [f32; 3], size: [f32; 3]) -> Component {
    let row = |[x, y, z]: [usize; 3]| ((z * (count[1] + 1) + y) * (count[0] + 1) + x) as u32;
    let (mut points, mut tets) = (Vec::new(), Vec::new());
    for z in 0..=count[2] {
        for y in 0..=count[1] {
            for x in 0..=count[0] {
                points.push(std::array::from_fn(|k| low[k] + size[k] * [x, y, z][k] as f32 / count[k] as f32));
                if x == count[0] || y == count[1] || z == count[2] {
                    continue;
                }
                for (place, order) in
                    [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]].iter().enumerate()
                {
                    let mut at = [x, y, z];
                    let mut corners = [row(at); 4];
                    for (k, axis) in order.iter().enumerate() {
                        at[*axis] += 1;
                        corners[k + 1] = row(at);
                    }
                    if place >= 3 {
                        corners.swap(1, 2);
                    }
                    tets.push(corners);
                }
            }
        }
    }
    Component::tets(tets, points).unwrap()
}

fn cube() -> Component {
    block([2; 3], [0.0; 3], [0.1; 3])
}

fn simulating(bodies: impl Into<Geometry>) -> Bench {
    bench(&NODE).input(BODIES, bodies)
}

fn height(tasted: &BenchResult) -> f32 {
    tasted.mesh().positions().iter().map(|p| p[1]).fold(f32::NEG_INFINITY, f32::max)
}

/// Height of the bodies in samples: just above the suite's ball, a collider that they fall on.
const ABOVE: f32 = 0.085;

/// Replaces non-empty samples by a block with inner points, a different one for each wire: the suite's own bodies have
/// no inner points and are all the same. Where samples have `surface_point`, it makes a point inside the longer block
/// one of the surface.
fn with_inside(wire: usize, given: Geometry) -> Geometry {
    let Some(tets) = given.tets().filter(|tets| tets.point_count() > 0) else { return given };
    let mut block = block([2 + wire, 2, 2], [0.0, ABOVE + 0.12 * wire as f32, 0.0], [0.1; 3]);
    if tets.get(SURFACE_POINT).is_some() {
        let inside = [1, 1, 1 + wire];
        let row = (inside[0] * 3 + inside[1]) * (3 + wire) + inside[2];
        let marked = (0..block.point_count()).map(|point| if wire == 1 && point == row { 0 } else { -1 });
        block.set(SURFACE_POINT, marked.collect::<Vec<i32>>()).unwrap();
    }
    if tets.get(FILL).is_some() {
        block.set(FILL, (0..block.element_count()).map(|tet| 0.1 + 0.1 * (tet % 10) as f32).collect()).unwrap();
    }
    block.into()
}

/// The same, pressed flat: the first body at frame 2, others at frame 3, from frame 2 on where samples have
/// `goal_start`.
fn pressed(wire: usize, given: Geometry) -> Geometry {
    let mut geometry = with_inside(wire, given.clone());
    if let Some(tets) = geometry.part_mut(Kind::Tets).filter(|tets| tets.point_count() > 0) {
        tets.edit(P).unwrap().iter_mut().for_each(|p| *p = [1.3 * p[0], 0.6 * p[1], 1.3 * p[2]]);
        let frame = if wire == 0 { 2.0 } else { 3.0 };
        for (attribute, value) in [(GOAL_FRAME, frame), (GOAL_STRENGTH, 2000.0), (GOAL_HOLD, 0.0)] {
            tets.set(attribute, vec![value]).unwrap();
        }
        if given.tets().is_some_and(|tets| tets.get(GOAL_START).is_some()) {
            tets.set(GOAL_START, vec![2.0]).unwrap();
        }
    }
    geometry
}

/// Pins at the corners of that cube.
fn at_corners(_: usize, given: Geometry) -> Geometry {
    let Some(first) = given.points().and_then(|points| points.positions().first()) else { return given };
    pins([[0.0; 3], [0.1, 0.0, 0.0]].map(|p| [p[0] + 0.01 * first[0], p[1] + ABOVE, p[2]]).to_vec(), 0.02).into()
}

fn pins(places: Vec<[f32; 3]>, radius: f32) -> Component {
    let count = places.len();
    let mut pins = Component::points(places);
    for (attribute, value) in [(PIN_RADIUS, radius), (PIN_STRENGTH, 0.0), (PIN_RELEASE, 1e9)] {
        pins.set(attribute, vec![value; count]).unwrap();
    }
    pins
}

/// Trials vary wires and attributes in turns of 2, 3 and 4, so that each of seven samples meets all of them.
#[test]
fn it_conforms() {
    let rich = |bench: Bench| bench.changed(BODIES, with_inside).changed(GOALS, pressed).changed(PINS, at_corners);
    conformance(&NODE)
        .with(rich)
        .with(move |bench| rich(bench).set(PLASTIC_YIELD, 0.01).set(PLASTIC_CREEP, 20.0).set(GOAL_ON, GoalOn::All))
        .with(|bench| bench)
        .with(move |bench| {
            let alone = rich(bench).changed(COLLIDERS, |_, _| Component::mesh(vec![], vec![], vec![]).unwrap().into());
            alone.set(BODY_COLLISION, false).set(SELF_COLLISION, false).set(INTEGRATOR, Stepping::Accurate)
        })
        .with(move |bench| rich(bench).set(THICKNESS, 0.09).set(GOAL_ON, GoalOn::All))
        .with(move |bench| {
            rich(bench).set(COUPLING_RADIUS, 0.05).set(COUPLING_STIFFNESS, 0.1).set(GRAVITY, [0.0, -200.0, 0.0])
        })
        .with(rich)
        .run();
}

#[test]
fn a_body_falls_along_a_parabola() {
    let frames = simulating(cube()).frames([1, 2, 13]);
    let rest = frames[0].mesh().positions();
    for (frame, time) in frames[1..].iter().zip([H, 12.0 * H]) {
        let fallen = 0.5 * G * time * time;
        for (p, q) in rest.iter().zip(frame.mesh().positions()) {
            assert!((f64::from(p[1] - q[1]) - fallen).abs() < 1e-6 * fallen.max(1.0), "{p:?} {q:?}");
            assert!((p[0] - q[0]).abs() < 1e-7 && (p[2] - q[2]).abs() < 1e-7);
        }
    }
}

/// Within 24 frames: gravity from 0 to g moves a body by g/6, drag from 0 to 4/s leaves e⁻² of its speed, and time from
/// standing still to its full rate lasts half as long.
#[test]
fn keyed_gravity_drag_and_time_act_as_their_integrals() {
    let last = |bench: Bench| bench.frames([1, 25]).swap_remove(1);
    let down = [0.0, -9.81, 0.0];
    let keyed = |substeps: i64| {
        let falling = simulating(cube()).set(SUBSTEPS, substeps);
        let thrown = falling.clone().set(GRAVITY, [0.0; 3]).set(INITIAL_VELOCITY, [2.0, 0.0, 0.0]);
        let fallen = |bench: Bench| f64::from(-last(bench).mesh().positions()[0][1]);
        let slowed = thrown.keyed(DRAG, &[(1.0, 0.0), (25.0, 4.0)]);
        let slowed = (2.0 * last(slowed).metrics["kinetic"]).sqrt();
        [
            fallen(falling.clone().keyed(GRAVITY, &[(1.0, [0.0; 3]), (25.0, down)])) / (G / 6.0),
            fallen(falling.keyed(TIME_SCALE, &[(1.0, 0.0), (25.0, 1.0)])) / (G / 8.0),
            slowed / (2.0 * libm::exp(-2.0)),
        ]
    };
    let (coarse, fine) = (keyed(0), keyed(16));
    assert!(coarse.iter().all(|share| (share - 1.0).abs() < 1e-3), "{coarse:?}");
    assert!(fine.iter().all(|share| (share - 1.0).abs() < 1e-5), "{fine:?}");
}

/// Time comes to a stop as gravity rises in the scene's time: both at once.
#[test]
fn gravity_is_that_of_the_scene_s_time_where_time_is_scaled() {
    let both = simulating(cube()).keyed(TIME_SCALE, &[(1.0, 1.0), (2.0, 0.0)]);
    let both = both.keyed(GRAVITY, &[(1.0, [0.0; 3]), (2.0, [0.0, -9.81, 0.0])]).set(SUBSTEPS, 64);
    // With s the share of the frame: dτ = (1 − s) H ds, so v = gH ∫ s (1 − s) ds, and the fall is ∫ v dτ.
    let exact = G * H * H * (1.0 / 8.0 - 1.0 / 10.0);
    let fallen = f64::from(-both.frames([2])[0].mesh().positions()[0][1]);
    assert!((fallen / exact - 1.0).abs() < 2e-3, "{fallen} instead of {exact}");
}

/// Cubes cut around their diagonals, and a regular tet stretched to twice its height, whose springs have the modulus
/// C₃₃ − 2C₁₃²/(C₁₁ + C₁₂) along it, from products of the directions of its edges.
#[test]
fn bodies_of_long_tets_are_told_from_even_ones() {
    let long = [[1.0, 1.0, 2.0], [1.0, -1.0, -2.0], [-1.0, 1.0, -2.0], [-1.0, -1.0, 2.0]];
    let long = Component::tets(vec![[0, 1, 2, 3]], long.map(|[x, y, z]| [0.1 * x + 1.0, 0.1 * y, 0.1 * z]).to_vec());
    let of = |bench: Bench| {
        let metrics = bench.frames([1, 2]).pop().unwrap().metrics;
        ["stiffest_direction", "stiffest_direction_wire", "softest_direction"].map(|metric| metrics[metric])
    };
    let even = of(simulating(cube()));
    assert!(even[0] < 1.7 && even[1] == 0.0 && even[2] > 0.3, "{even:?}");
    let both = of(simulating(cube()).input(BODIES, long.unwrap()));
    let exact = 4.0 * 16.0 / 25.0 - 2.0 * 64.0 / 625.0 / 1.08;
    assert!((both[0] / exact - 1.0).abs() < 1e-6 && both[1] == 1.0 && both[2] <= even[2], "{both:?}, not {exact}");
}

#[test]
fn pinned_particles_follow_their_pins_and_the_rest_hangs_from_them() {
    let at = |frame: Frame| {
        let way = 0.01 * (frame.number() as f32 - 1.0);
        Geometry::from(pins(vec![[way, 0.1, 0.0], [way, 0.1, 0.1]], 0.06))
    };
    let frames = simulating(cube()).moving(PINS, at).frames(1..=12);
    let rest = frames[0].mesh().positions();
    // On the upper edge at x = 0, and half-way from there: particles within 6 cm of one of the pins.
    let held = |p: &[f32; 3]| {
        [0.0_f32, 0.1]
            .iter()
            .any(|z| (p[0] * p[0] + (p[1] - 0.1) * (p[1] - 0.1) + (p[2] - z) * (p[2] - z)).sqrt() <= 0.06)
    };
    assert!((4..14).contains(&rest.iter().filter(|p| held(p)).count()));
    for (k, frame) in frames.iter().enumerate() {
        let way = 0.01 * k as f32;
        for (p, q) in rest.iter().zip(frame.mesh().positions()).filter(|(p, _)| held(p)) {
            assert!((q[0] - (p[0] + way)).abs() < 1e-7 && q[1] == p[1] && q[2] == p[2], "{p:?} {q:?} at {k}");
        }
    }
    let lowest = frames[11].mesh().positions().iter().map(|p| p[1]).fold(f32::INFINITY, f32::min);
    assert!((-0.06..0.0).contains(&lowest), "{lowest}");
}

#[test]
fn a_goal_that_was_reached_becomes_the_rest_shape() {
    let mut goal = pressed(0, cube().into());
    let tets = goal.part_mut(Kind::Tets).unwrap();
    tets.set(GOAL_FRAME, vec![12.0]).unwrap();
    tets.set(GOAL_HOLD, vec![24.0]).unwrap();
    let frames = simulating(cube())
        .input(GOALS, goal)
        .set(GOAL_ON, GoalOn::All)
        .set(GRAVITY, [0.0; 3])
        .set(VOLUME, 0.0)
        .set(DAMPING, 0.05.into())
        .frames([1, 48]);
    let rest = frames[0].mesh().positions();
    let (low, high) = frames[1]
        .mesh()
        .positions()
        .iter()
        .fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), p| (low.min(p[1]), high.max(p[1])));
    assert!((high - low - 0.06).abs() < 1e-6, "{low} {high}");
    assert!(frames[1].metrics["elastic"] < 1e-6, "{:?}", frames[1].metrics);
    assert_eq!(rest.len(), 26, "the inner point is not part of the surface");
}

#[test]
fn a_block_rests_on_the_ground() {
    let frames = simulating(block([3; 3], [0.0; 3], [0.1; 3]))
        .set(GROUND, true)
        .set(STIFFNESS, 1e5.into())
        .frames([1, 120, 121]);
    let lowest = |frame: &BenchResult| frame.mesh().positions().iter().map(|p| p[1]).fold(f32::INFINITY, f32::min);
    assert!((0.0..=1e-3).contains(&lowest(&frames[1])), "{}", lowest(&frames[1]));
    let moved = frames[1].mesh().positions().iter().zip(frames[2].mesh().positions()).map(|(p, q)| (p[1] - q[1]).abs());
    assert!(moved.fold(0.0, f32::max) < 1e-6);
    // A cube of 1 dm³ with the weight of water and E = 1e5 is compressed by ½ρgh/E on average.
    assert!((height(&frames[1]) - 0.1).abs() < 2e-3, "{}", height(&frames[1]));
}

#[test]
fn a_fine_surface_is_carried_by_coarse_tets() {
    let fine =
        Component::mesh(vec![3], vec![0, 1, 2], vec![[0.01, 0.02, 0.03], [0.05, 0.06, 0.03], [0.09, 0.02, 0.04]])
            .unwrap();
    let frames = simulating(Geometry::from(cube()).with(fine.clone())).frames([1, 5]);
    let fallen = (0.5 * G * 16.0 * H * H) as f32;
    assert_eq!(frames[0].mesh().runs(), fine.runs());
    for (p, q) in fine.positions().iter().zip(frames[1].mesh().positions()) {
        assert!((p[1] - q[1] - fallen).abs() < 1e-6 && (p[0] - q[0]).abs() < 1e-7);
    }
}

#[test]
fn a_carried_surface_far_outside_the_tets_is_counted() {
    let outside = |points: Vec<[f32; 3]>| {
        let mesh = Component::mesh(vec![3], vec![0, 1, 2], points).unwrap();
        simulating(Geometry::from(cube()).with(mesh)).frames([1])[0].metrics["carried_outside"]
    };
    assert_eq!(outside(vec![[0.0; 3], [0.1, 0.0, 0.0], [0.0, 0.13, 0.0]]), 0.0, "within a tet's height of 0.05");
    assert_eq!(outside(vec![[0.0; 3], [0.2, 0.0, 0.0], [0.0, 0.17, 0.0]]), 2.0);
}

#[test]
fn a_goal_that_matches_no_body_or_two_is_refused() {
    let (goal, other) = (pressed(0, cube().into()), block([1; 3], [0.0; 3], [0.1; 3]));
    let refused = |bench: Bench| bench.input(GOALS, goal.clone()).at(2.0).try_cook().unwrap_err().fact;
    assert_eq!(
        refused(simulating(other)),
        "`goals` 0 has 48 tets of 27 points, and no body has the same: 6 tets of 8 points"
    );
    assert_eq!(refused(simulating(cube()).input(BODIES, cube())), "`goals` 0 has the tets of both `bodies` 0 and 1");
}

#[test]
fn coupled_bodies_stay_together_and_tear_when_pulled_apart() {
    let upper = || block([2, 1, 2], [0.0, 0.102, 0.0], [0.1, 0.05, 0.1]);
    // The upper one is held at its top; the lower one hangs from the springs between them.
    let held = pins(vec![[0.0, 0.152, 0.0], [0.1, 0.152, 0.0], [0.0, 0.152, 0.1], [0.1, 0.152, 0.1]], 0.01);
    let coupled = |stiffness: f64| {
        simulating(cube())
            .input(BODIES, upper())
            .input(PINS, held.clone())
            .set(COUPLING_RADIUS, 5e-3)
            .set(COUPLING_STIFFNESS, stiffness)
            .set(COUPLING_BREAK, 3.0)
            .set(STIFFNESS, 1e5.into())
            .frames([1, 24])
    };
    let drop = |frames: &[BenchResult]| {
        frames[0].part(Kind::Mesh).positions()[0][1] - frames[1].part(Kind::Mesh).positions()[0][1]
    };
    let held = coupled(2e4);
    assert!(held[1].metrics["torn"] == 0.0 && drop(&held) < 0.01, "{} {:?}", drop(&held), held[1].metrics);
    let torn = coupled(1.0);
    assert!(torn[1].metrics["torn"] == 9.0 && drop(&torn) > 0.5, "{} {:?}", drop(&torn), torn[1].metrics);
}

#[test]
fn plastic_work_is_published_where_springs_flow() {
    let work = |creep: f32| {
        let block = block([2; 3], [0.0; 3], [0.1; 3]);
        let soft = simulating(block).set(GROUND, true).set(STIFFNESS, 2e3.into());
        let frames = soft.set(PLASTIC_YIELD, 0.01).set(PLASTIC_CREEP, creep).frames([1, 12]);
        frames[1].metrics["plastic_work"]
    };
    assert_eq!(work(0.0), 0.0);
    assert!(work(20.0) > 0.0, "{}", work(20.0));
}

/// A closed cube as a collider.
/// The collider is 0.4 mm beside the body, or 20 mm beside it with a point of the carried surface 5 mm inside.
#[test]
fn overlap_is_measured_on_the_points_that_are_returned() {
    let overlap = |bench: Bench| bench.cook().metrics;
    let beside = |x: f32| simulating(cube()).input(COLLIDERS, solid([x, -0.05, -0.05], 0.2));
    let near = overlap(beside(0.1004));
    assert!((near["deepest_overlap"] - 6e-4).abs() < 1e-6 && near["points_inside"] == 0.0, "{near:?}");
    let fine = Component::mesh(vec![3], vec![0, 1, 2], vec![[0.0; 3], [0.125, 0.05, 0.05], [0.0, 0.1, 0.0]]).unwrap();
    let carried = simulating(Geometry::from(cube()).with(fine)).input(COLLIDERS, solid([0.12, -0.05, -0.05], 0.2));
    let carried = overlap(carried);
    assert!((carried["deepest_overlap"] - 6e-3).abs() < 1e-6 && carried["points_inside"] == 1.0, "{carried:?}");
    let above = overlap(simulating(cube()).set(GROUND, true).set(GROUND_HEIGHT, -2e-4));
    assert!((above["deepest_overlap"] - 8e-4).abs() < 1e-9, "{above:?}");
    assert_eq!(overlap(beside(0.2))["deepest_overlap"], 0.0);
}

#[test]
fn how_well_a_body_carries_its_weight_is_published_where_something_holds_it_up() {
    let ratio = |bench: Bench| bench.frames([1, 2])[1].metrics.get("stiffness_to_weight").copied();
    let [exact, below] = [0.1, 0.2].map(|height| 5e3 / (1000.0 * G * height));
    let same = |found: Option<f64>, exact: f64| found.is_some_and(|found| (found / exact - 1.0).abs() < 1e-6);
    let ground = |bench: Bench| bench.set(GROUND, true);
    assert!(same(ratio(ground(simulating(cube()))), exact));
    let tall = block([1, 2, 1], [0.3, 0.0, 0.0], [0.1, 0.2, 0.1]);
    assert!(same(ratio(ground(simulating(cube()).input(BODIES, tall))), below), "the one that carries it worst");
    assert!(same(ratio(simulating(cube()).input(COLLIDERS, solid([0.0, -0.3, 0.0], 0.2))), exact));
    assert_eq!(ratio(simulating(cube())), None, "it falls");
    assert_eq!(ratio(ground(simulating(cube()).set(GRAVITY, [0.0; 3]))), None);
}

#[test]
fn contacts_with_a_collider_that_leaves_no_room_above_the_ground_are_counted() {
    let jammed = |foot: f32| {
        let slab = block([2, 1, 2], [0.0; 3], [0.1, 0.0012, 0.1]);
        let plate = solid([-0.05, foot, -0.05], 0.2);
        simulating(slab).input(COLLIDERS, plate).set(GROUND, true).frames([1, 2])[1].metrics["jammed"]
    };
    assert!(jammed(0.0012) > 0.0);
    assert_eq!(jammed(0.0022), 0.0, "2 `thickness` are left");
}

#[test]
fn steps_that_miss_the_tolerance_are_counted() {
    let missed = |tolerance: f64| {
        let stiff = simulating(cube()).set(STIFFNESS, 1e6.into()).set(INITIAL_VELOCITY, [0.0, -3.0, 0.0]);
        let accurate = stiff.set(GROUND, true).set(INTEGRATOR, Stepping::Accurate).set(TOLERANCE, tolerance);
        accurate.frames([1, 3])[1].metrics["tolerance_missed"]
    };
    assert_eq!(missed(0.1), 0.0);
    assert!(missed(1e-9) > 0.0);
}

#[test]
fn pins_that_reach_nothing_are_counted_and_the_first_is_named() {
    let far = pins(vec![[0.0, 0.1, 0.0], [0.0, 5.0, 0.0]], 0.02);
    let near = pins(vec![[0.1, 0.1, 0.0]], 0.02);
    let frames = simulating(cube()).input(PINS, near.clone()).input(PINS, far).frames([1, 2]);
    for frame in &frames {
        let of = |name: &str| frame.metrics[name];
        assert_eq!((of("idle_pins"), of("idle_pins_wire"), of("idle_pins_point")), (1.0, 1.0, 1.0));
    }
    assert_eq!(simulating(cube()).input(PINS, near).frames([1, 2])[1].metrics["idle_pins"], 0.0);
}

/// A wire without `body` is one body; numbers of other wires follow on.
#[test]
fn bodies_of_all_wires_have_numbers_of_their_own() {
    let numbered = |low: f32, numbers: &[i32]| {
        let mut block = block([2, 1, 1], [low, 0.0, 0.0], [0.1; 3]);
        if !numbers.is_empty() {
            block.set(BODY_NUMBER, (0..12).map(|tet| numbers[tet / 6]).collect()).unwrap();
        }
        block
    };
    let bodies = simulating(numbered(0.0, &[0, 1]));
    let graph = bodies.input(BODIES, numbered(1.0, &[])).input(BODIES, numbered(2.0, &[1, 0])).graph();
    let engine = Engine::new(&Settings::default()).unwrap();
    let (cooked, _) = cook_all(&engine, &graph, &[Frame::whole(1)]);
    let tets = cooked[&(1, Frame::whole(1))].tets().unwrap();
    let numbers: Vec<i32> = tets.get(BODY_NUMBER).unwrap().chunks(6).map(|body| body[0]).collect();
    assert_eq!(numbers, [0, 1, 2, 2, 4, 3]);
}

#[test]
fn the_filled_share_of_tets_scales_mass_and_stiffness() {
    let filled = |fill: f32| {
        let mut cube = cube();
        cube.set(FILL, vec![fill; cube.element_count()]).unwrap();
        cube
    };
    let falling = |body: Component| simulating(body).set(DENSITY, 1000.0.into()).frames(1..=2);
    let [whole, half, none] =
        [falling(filled(1.0)), falling(filled(0.5)), falling(cube())].map(|frames| frames[1].metrics["kinetic"]);
    // ½ m (g h)² of a cube of 0.1 m.
    let expected = 0.5 * (G * H) * (G * H);
    assert!((whole / expected - 1.0).abs() < 1e-6 && (half / whole - 0.5).abs() < 1e-9, "{whole} {half}");
    assert_eq!(whole, none, "tets without the attribute are full");
}
