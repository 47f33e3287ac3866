//! What is there, with what went, is what there was and what came.

use super::carried::particles_at;
use super::*;
use crate::shared::attributes::PARTICLE_SPRAY;

/// The volumes of drops too small for the grid at a frame, m³, and how high they are.
fn drops(bench: &Bench, frame: i64) -> Vec<(f32, f32)> {
    let particles = particles_at(bench, frame);
    let (kinds, volumes) = (particles.get(PARTICLE_KIND).unwrap(), particles.get(PARTICLE_VOLUME).unwrap());
    let spray = kinds.iter().zip(volumes).zip(particles.positions()).filter(|((kind, _), _)| **kind == PARTICLE_SPRAY);
    spray.map(|((_, volume), place)| (*volume, place[1])).collect()
}

/// A block that is too fast to be followed is drops for a moment, and liquid again.
#[test]
fn liquid_that_was_too_fast_comes_back() {
    let block = solving(cuboid([0.25, 0.3, 0.25], [0.75, 0.7, 0.75]))
        .set(INITIAL_VELOCITY, [0.0, -8.0, 0.0])
        .set(VISCOSITY, 0.001)
        .set(MAX_SUBSTEPS, 1);
    let out = block.frames(1..=20);
    let cell = 1.0 / 4096.0_f32;
    let spray = drops(&block, 5);
    assert!(spray.iter().all(|(volume, y)| *volume < 8.0 * cell && *y >= 0.0), "{spray:?}");
    assert!(metric(&out[19], VOLUME_BALANCE).abs() < 5e-3, "{:?}", out[19].metrics);
    assert!(metric(&out[19], SPRAY) < 0.05 * metric(&out[0], VOLUME_NOW));
}

#[test]
fn no_spray_stays_in_a_pool() {
    let drop = ball([0.5, 0.75, 0.5], 0.14);
    let pool = cuboid([-1.0; 3], [2.0, 0.24, 2.0]);
    let splash = solving(pool).input(LIQUID, drop).set(VISCOSITY, 0.001);
    let spray = drops(&splash, 30);
    assert!(spray.iter().all(|(_, y)| *y > 0.1), "{spray:?}");
    let balance: Vec<f64> = splash.frames(2..=30).iter().map(|frame| metric(frame, VOLUME_BALANCE)).collect();
    assert!(balance.iter().all(|balance| balance.abs() < 0.01), "{balance:?}");
}

/// A surface finer than the solver's cells gets its volume back as fast as one as coarse.
#[test]
fn a_fine_surface_is_kept_too() {
    for resolution in [1, 3] {
        let block = solving(cuboid([0.25, 0.3, 0.25], [0.75, 0.7, 0.75]));
        let out = block.set(VISCOSITY, 0.5).set(RESOLUTION, resolution).frames(1..=14);
        let balance: Vec<f64> = out[1..].iter().map(|frame| metric(frame, VOLUME_BALANCE)).collect();
        let off = balance.iter().filter(|balance| balance.abs() > 0.01).count();
        assert!(off <= 2 && balance[12].abs() < 2e-3, "{resolution}: {balance:?}");
    }
}

/// What a sink takes never falls and is never more than there was.
#[test]
fn a_sink_takes_no_more_than_there_was() {
    let all = cuboid([-0.1; 3], [1.1; 3]);
    let out = solving(cuboid([0.2, 0.2, 0.2], [0.7, 0.6, 0.8])).input(SINKS, all).frames(1..=3);
    let (started, sunk) = (metric(&out[0], VOLUME_NOW), metric(&out[2], SUNK));
    assert!((sunk / started - 1.0).abs() < 1e-9 && metric(&out[2], VOLUME_NOW) == 0.0, "{sunk} of {started}");

    let drain = cuboid([0.3, -0.1, 0.3], [0.7, 0.05, 0.7]);
    let falling = solving(cuboid([0.2, 0.2, 0.2], [0.7, 0.6, 0.8])).input(SINKS, drain).set(VISCOSITY, 1.0);
    let mut before = 0.0;
    for frame in &falling.frames(1..=14)[1..] {
        assert!(metric(frame, SUNK) >= before && metric(frame, VOLUME_BALANCE).abs() < 0.03, "{:?}", frame.metrics);
        before = metric(frame, SUNK);
    }
    assert!(before > 0.0);
}

/// Equal parts of a thin and of a thick liquid run into each other on a floor that they cover a cell and a half deep: neither
/// takes the place of the other. Corrected by pieces alone, the thin one has an eighth of its volume left at the end.
#[test]
fn each_of_two_liquids_keeps_its_volume() {
    let liquid = |x: f32, viscosity: f32| with(ball([x, 0.25, 0.5], 0.22), &[(SOURCE_VISCOSITY, viscosity)]);
    let out = solving(liquid(0.26, 0.1)).input(LIQUID, liquid(0.74, 50.0)).frames(2..=40);
    let drift: Vec<f64> = out.iter().map(|frame| metric(frame, MATERIAL_DRIFT)).collect();
    assert!(drift.iter().all(|drift| *drift < 0.05), "{drift:?}");
}

/// A slab under an open ceiling falls: air follows it.
#[test]
fn no_liquid_comes_in_through_an_open_ceiling() {
    let slab = solving(cuboid([-1.0, 0.7, -1.0], [2.0, 2.0, 2.0])).set(WALL_Y_MAX, Walls::Open).set(VISCOSITY, 0.0);
    let out = slab.frames(1..=6);
    for frame in &out[1..] {
        let share = metric(frame, VOLUME_NOW) / metric(&out[0], VOLUME_NOW);
        assert!((share - 1.0).abs() < 0.05 && metric(frame, LEFT_DOMAIN).abs() < 1e-9, "{:?}", frame.metrics);
    }
}

/// A ball that a source makes where nothing moves grows by all that the source gives, from when cells can show it.
#[test]
fn a_source_without_gravity_makes_a_ball_of_its_volume() {
    let body = with(ball([0.5; 3], 0.25), &[(SOURCE_RATE, 0.02)]);
    let bench = bench(&NODE).input(SOURCES, body).set(CELL, 1.0 / 16.0).set(DOMAIN_FROM, [0.0; 3]);
    let out = bench.set(DOMAIN_TO, [1.0; 3]).set(GRAVITY, [0.0; 3]).set(VISCOSITY, 1000.0).frames(1..=13);
    let shares: Vec<f64> = out[5..].iter().map(|frame| metric(frame, VOLUME_NOW) / metric(frame, SOURCED)).collect();
    assert!(shares.iter().all(|share| (share - 1.0).abs() < 0.05), "{shares:?}");
    assert!(out[1..].iter().all(|frame| metric(frame, SPRAY) == 0.0));
    // The part of the shape that is filled grows cell by cell: up to a frame's gift is still owed.
    for (n, frame) in out.iter().enumerate().skip(1) {
        let owed = 0.02 * n as f64 * H - metric(frame, SOURCED);
        assert!((-1e-9..1.01 * 0.02 * H).contains(&owed), "{n}: {owed}");
    }
}

/// A drop of spray keeps its id while it flies: nobody else gets it.
#[test]
fn drops_keep_their_ids() {
    let block = solving(cuboid([0.25, 0.3, 0.25], [0.75, 0.7, 0.75]))
        .set(INITIAL_VELOCITY, [0.0, -8.0, 0.0])
        .set(VISCOSITY, 0.001)
        .set(MAX_SUBSTEPS, 1);
    let drops = |frame: i64| -> Vec<(i32, f32)> {
        let particles = particles_at(&block, frame);
        let ids = particles.get(ID).unwrap();
        let mut unique = ids.to_vec();
        unique.sort_unstable();
        unique.dedup();
        assert_eq!(unique.len(), ids.len());
        let rows = particles.get(PARTICLE_KIND).unwrap().iter().zip(ids).zip(particles.get(PARTICLE_VOLUME).unwrap());
        rows.filter(|((kind, _), _)| **kind == PARTICLE_SPRAY).map(|((_, id), volume)| (*id, *volume)).collect()
    };
    let (mut stayed, mut last) = (0, Vec::new());
    for frame in 2..=16 {
        let now = drops(frame);
        for (id, volume) in &now {
            if let Some((_, before)) = last.iter().find(|(before, _)| before == id) {
                assert_eq!(volume, before, "frame {frame}, {id}");
                stayed += 1;
            }
        }
        last = now;
    }
    assert!(stayed > 5, "{stayed}");
}
