//! What a simulation says of itself: which solve runs, what is left out, and what could not be met.

use super::*;

/// What `explain` says of a simulation, and the stages that it leaves out.
fn said(bench: &Bench) -> (Vec<String>, Vec<String>) {
    let engine = Engine::new(&Settings::default()).unwrap();
    let report = cook_all(&engine, &bench.graph(), &[Frame::whole(1)]).1;
    let node = report.nodes.into_iter().find(|node| node.type_name == "FluidSolve").unwrap();
    (node.explained, node.left_out.into_iter().map(|stage| stage.stage.to_owned()).collect())
}

fn pool() -> Bench {
    solving(cuboid([-1.0; 3], [2.0, 0.43, 2.0]))
}

#[test]
fn explain_says_which_solve_runs() {
    let line = |bench: Bench| said(&bench).0[1].clone();
    // 1/24 s · 16² ÷ 1000 = 1/93.75 for each Pa·s.
    assert_eq!(
        line(pool().set(VISCOSITY, 1.0)),
        "pressure and viscosity are solved together where viscosity·dt/(density·cell²) is at least 0.0001. With the values at \
         the start it is 3.3e-4 in the shortest substep, 1.1e-2 in one of a whole frame: in every substep. Liquid from a \
         Fluid_Source with a viscosity of its own is solved with that"
    );
    for (coupling, viscosity, how, verdict) in [
        (Coupling::Auto, 0.1, "together", "in substeps of at least 1/10 frame"),
        (Coupling::Auto, 0.001, "together", "in none, pressure alone acts"),
        (Coupling::Auto, 0.0, "together", "in none, pressure alone acts"),
        (Coupling::On, 0.001, "together", "in every substep"),
        (Coupling::Off, 0.1, "one after the other", "in substeps of at least 1/10 frame"),
    ] {
        let line = line(pool().set(STOKES, coupling).set(VISCOSITY, viscosity));
        assert!(line.contains(how) && line.contains(verdict), "{coupling:?} {viscosity}: {line}");
    }
}

#[test]
fn explain_says_how_large_the_box_is() {
    let grown = pool().set(DOMAIN_TO, [1.0, 1.03, 1.0]);
    assert_eq!(said(&grown).0[0], "the box has 16 × 17 × 16 cells, up to [1.0, 1.0625, 1.0]");
    assert_eq!(said(&grown.set(FOLLOW, true)).0.len(), 1);
}

#[test]
fn liquid_without_viscosity_leaves_its_stress_out() {
    let leaves_out = |bench: Bench| said(&bench).1.contains(&"viscous stress".to_owned());
    assert!(leaves_out(pool().set(VISCOSITY, 0.0)));
    assert!(!leaves_out(pool().set(VISCOSITY, 1e-9)));
    assert!(!leaves_out(pool().set(STOKES, Coupling::Off)));
}

#[test]
fn solves_one_after_the_other_are_measured_as_such() {
    let block = solving(cuboid([0.3, -1.0, 0.3], [0.7, 0.6, 0.7])).set(VISCOSITY, 1e4);
    let [together, apart] = [Coupling::Auto, Coupling::Off].map(|coupling| {
        let out = block.clone().set(STOKES, coupling).frames(1..=3);
        out[2].metrics.clone()
    });
    assert!(together["coupled_iterations"] > 0.0 && together["viscosity_iterations"] == 0.0, "{together:?}");
    assert!(apart["coupled_iterations"] == 0.0 && apart["viscosity_iterations"] > 0.0, "{apart:?}");
    assert!(apart["pressure_iterations"] > 0.0 && apart["viscosity_residual"] <= 1e-4, "{apart:?}");
    assert_eq!((together["caps_hit"], apart["caps_hit"]), (0.0, 0.0));
}

#[test]
fn shapes_that_move_too_far_in_a_frame_are_counted() {
    let plate = |x: f32| cuboid([x, 0.6, 0.2], [x + 0.1, 0.8, 0.8]);
    let nozzle = |x: f32| cuboid([x, 0.85, 0.4], [x + 0.1, 0.95, 0.6]);
    let out = pool()
        .moving(COLLIDERS, move |frame| plate(if frame.number() < 2.5 { 0.1 } else { -4.5 }).into())
        .moving(SOURCES, move |frame| nozzle(if frame.number() < 2.5 { 0.3 } else { 5.0 }).into())
        .frames(1..=4);
    let fast: Vec<f64> = out[1..].iter().map(|frame| metric(frame, FAST_SHAPES)).collect();
    assert_eq!(fast, [0.0, 2.0, 0.0]);
}

/// A plate of three cells moves by eight through a block that is 0.5 m high and wide: five cells of it are behind the plate.
#[test]
fn what_a_collider_passes_over_is_counted() {
    let plate = |x: f32| cuboid([x, -1.0, -1.0], [x + 3.0 / 16.0, 2.0, 2.0]);
    let passed = |step: f32| {
        let bench = solving(cuboid([3.0 / 16.0, 0.25, 0.25], [1.0, 0.75, 0.75]))
            .set(GRAVITY, [0.0; 3])
            .set(MAX_SUBSTEPS, 1)
            .moving(COLLIDERS, move |frame| plate(step * (frame.number() as f32 - 1.0)).into());
        metric(&bench.frames(1..=2)[1], PASSED_THROUGH)
    };
    let exact = 5.0 / 16.0 * 0.25;
    assert!((passed(0.5) / exact - 1.0).abs() < 0.05, "{}", passed(0.5));
    assert_eq!(passed(0.125), 0.0);
}

#[test]
fn what_is_left_out_at_the_start_is_told() {
    let of = |bench: Bench, name: Metric| metric(&bench.cook(), name);
    let half = solving(cuboid([0.75, 0.2, 0.2], [1.25, 0.7, 0.8]));
    assert!((of(half.clone(), OUTSIDE) - 0.5).abs() < 0.01 && of(half, IN_COLLIDERS) == 0.0);
    let block = || solving(cuboid([0.3; 3], [0.7; 3]));
    let far = |second: [f32; 3]| block().input(LIQUID, cuboid(second, second.map(|x| x + 0.1)));
    assert_eq!((of(far([5.0, 0.5, 0.5]), OUTSIDE), of(far([0.8; 3]), OUTSIDE)), (1.0, 0.0));
    let shut = block().input(COLLIDERS, cuboid([0.1; 3], [0.9; 3]));
    assert_eq!((of(shut.clone(), IN_COLLIDERS), of(shut.clone(), VOLUME_NOW), of(shut, OUTSIDE)), (1.0, 0.0, 0.0));
    let tiny = solving(cuboid([0.59; 3], [0.63; 3]));
    assert!(of(tiny, UNSEEN) > 0.5 && of(block(), UNSEEN) < 0.01);
    let points = |places: Vec<[f32; 3]>| Component::points(places);
    let traced = block().input(TRACERS, points(vec![[0.5; 3], [5.0; 3], [0.5, -0.1, 0.5]]));
    assert_eq!(of(traced, TRACERS_OUTSIDE), 2.0);
}

#[test]
fn sources_and_sinks_at_the_wrong_input_and_liquid_that_is_lost_are_told() {
    let shape = || ball([0.5, 0.8, 0.5], 0.1);
    let (source, sink) = (with(shape(), &[(SOURCE_RATE, 0.0)]), with(shape(), &[(SINK_RATE, 0.0)]));
    for (bench, count) in [
        (pool().input(SOURCES, source.clone()).input(SINKS, sink.clone()), 0.0),
        (pool().input(SOURCES, sink), 1.0),
        (pool().input(SINKS, source), 1.0),
    ] {
        assert_eq!(metric(&bench.frames(1..=2)[1], MISWIRED), count);
    }
    let fast = pool().set(INITIAL_VELOCITY, [1e30, 0.0, 0.0]).frames(1..=2);
    assert!(metric(&fast[1], CFL_REACHED) > 64.0 && metric(&fast[1], LONG_SUBSTEPS) == 1.0);
    assert_eq!(metric(&fast[1], SOLVES_CUT_SHORT), 0.0);
}

#[test]
fn a_rate_that_is_too_little_for_the_grid_is_collected_and_told() {
    let source = with(ball([0.5, 0.8, 0.5], 0.1), &[(SOURCE_RATE, 0.01)]);
    let out = solving(cuboid([-1.0; 3], [2.0, 0.2, 2.0])).input(SOURCES, source).frames(1..=9);
    let collecting: Vec<f64> = out[1..].iter().map(|frame| metric(frame, COLLECTING)).collect();
    // 1.7 of 4.2 cells.
    assert_eq!(collecting[..2], [1.0, 1.0]);
    assert!(metric(&out[8], SOURCED) > 0.5 * 8.0 * 0.01 * H, "{collecting:?}");
}

#[test]
fn a_rate_that_falls_to_0_is_noted() {
    let body = |rate: f32| with(ball([0.5, 0.6, 0.5], 0.15), &[(SOURCE_RATE, rate)]);
    let ends = bench(&NODE)
        .moving(SOURCES, move |frame| body(if frame.number() < 3.0 { 0.02 } else { 0.0 }).into())
        .set(CELL, 1.0 / 16.0)
        .set(DOMAIN_FROM, [0.0; 3])
        .set(DOMAIN_TO, [1.0; 3]);
    let ended: Vec<f64> = ends.frames(1..=5).iter().skip(1).map(|frame| metric(frame, RATE_ENDED)).collect();
    assert_eq!(ended, [0.0, 0.0, 1.0, 1.0]);
    let full = solving(cuboid([0.2; 3], [0.4; 3])).input(SOURCES, body(0.0)).frames(1..=3);
    assert_eq!(metric(&full[2], RATE_ENDED), 0.0);
}

#[test]
fn what_a_source_says_in_vain_is_noted() {
    let shape = || ball([0.5; 3], 0.2);
    let in_vain = |bench: Bench| metric(&bench.frames(1..=1)[0], IN_VAIN);
    let mut thrown = shape();
    thrown.set(SOURCE_VELOCITY, vec![[1.0, 0.0, 0.0]]).unwrap();
    let mut off = shape();
    off.set(SOURCE_ACTIVE, vec![0]).unwrap();
    let rated = || with(shape(), &[(SOURCE_RATE, 0.1)]);
    for mesh in [thrown, off, rated()] {
        assert_eq!(in_vain(solving(mesh)), 1.0);
    }
    assert_eq!(in_vain(solving(with(shape(), &[(SOURCE_RATE, 0.0), (SOURCE_VISCOSITY, 3.0)]))), 0.0);
    // The same mesh is the source, which starts full.
    assert_eq!(in_vain(solving(rated()).input(SOURCES, rated())), 0.0);
}

#[test]
fn attributes_that_clash_are_noted() {
    let value = |width: usize| match width {
        1 => Column::new(vec![1.5_f32]),
        _ => Column::new(vec![[1.0_f32, 2.0, 3.0]]),
    };
    for (width, clashes) in [(1, 1.0), (3, 0.0)] {
        let mut pool = cuboid([-1.0; 3], [2.0, 0.43, 2.0]);
        pool.set(Attr::<[f32; 3]>::point("q"), vec![[1.0, 2.0, 3.0]; 8]).unwrap();
        let mut tracers = Component::points(vec![[0.5, 0.2, 0.5]]);
        tracers.set_column(Owner::Point, "q", value(width)).unwrap();
        let out = solving(pool).input(TRACERS, tracers).frames(1..=2);
        assert_eq!(out.iter().map(|frame| metric(frame, CLASHES)).collect::<Vec<_>>(), [clashes; 2]);
    }
}

/// One step of single precision is 1/4 m from 2^21 m on, four cells here.
#[test]
fn a_liquid_far_from_the_origin_is_noted() {
    for (x, step) in [(0.0, 0.0), (2_097_152.0, 4.0)] {
        let block = cuboid([x, 0.25, 0.25], [x + 1.0, 0.75, 0.75]);
        let from = f64::from(x);
        let out =
            solving(block).set(DOMAIN_FROM, [from, 0.0, 0.0]).set(DOMAIN_TO, [from + 1.0, 1.0, 1.0]).frames(1..=1);
        let found = metric(&out[0], POSITION_STEP);
        assert!((found - step).abs() < 1e-4, "{found}");
    }
}
