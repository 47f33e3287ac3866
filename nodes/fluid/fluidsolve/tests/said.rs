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
         the start it is 3.3e-4 in the shortest substep, 1.1e-2 in one of a whole frame: in every substep. A Fluid_Source may \
         have another viscosity"
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
