//! Liquids of several materials, attributes and tracers.

use super::*;
use liquid::tag::{TagSource, TagValues};
use numerics::vector::{length, scale, sub};

/// The output `particles` at a frame.
pub(super) fn particles_at(bench: &Bench, frame: i64) -> Component {
    let (engine, frame) = (Engine::new(&Settings::default()).unwrap(), Frame::whole(frame));
    cook_all(&engine, &bench.graph(), &[frame]).0[&(1, frame)].points().unwrap().clone()
}

/// Points of one kind, with a column.
fn of_kind<T: Item>(particles: &Component, kind: i32, attribute: Attr<T>) -> Vec<T> {
    let kinds = particles.get(PARTICLE_KIND).unwrap();
    let rows = particles.get(attribute).unwrap().iter().zip(kinds);
    rows.filter(|(_, of)| **of == kind).map(|(row, _)| *row).collect()
}

const HEAT: Attr<f32> = Attr::point("heat");
const CD: Attr<[f32; 3]> = Attr::point("Cd");

/// Tracers in a falling ball fall as far as it; what they brought along stays theirs. One in the air stays.
#[test]
fn tracers_fall_with_the_liquid_and_keep_their_attributes() {
    let mut tracers = Component::points(vec![[0.5, 0.7, 0.5], [0.6, 0.75, 0.45], [0.1, 0.1, 0.1]]);
    tracers.set(ID, vec![7, 3, 12]).unwrap();
    tracers.set(CD, vec![[1.0, 0.0, 0.5], [0.25; 3], [0.0; 3]]).unwrap();
    let plain = Component::points(vec![[0.45, 0.65, 0.55]]);
    let bench = solving(ball([0.5, 0.7, 0.5], 0.22))
        .input(TRACERS, tracers)
        .input(TRACERS, plain)
        .set(GRAVITY, [0.0, -2.0, 0.0]);
    let out = bench.clone().frames(1..=13);
    let [start, end] = [1, 13].map(|frame| particles_at(&bench, frame));
    assert_eq!(metric(&out[12], PARTICLES_NOW), end.point_count() as f64);
    for particles in [&start, &end] {
        assert_eq!(of_kind(particles, 3, ID), [7, 3, 12, 3]);
        assert_eq!(of_kind(particles, 3, CD), [[1.0, 0.0, 0.5], [0.25; 3], [0.0; 3], [1.0; 3]]);
        assert_eq!(of_kind(particles, 3, PARTICLE_VISCOSITY), [1.0; 4]);
        assert!(of_kind(particles, 0, CD).iter().all(|color| *color == [1.0; 3]));
    }
    let way = height(&out[0]) - height(&out[12]);
    let [from, to] = [&start, &end].map(|particles| of_kind(particles, 3, P));
    for n in [0, 1, 3] {
        let moved = sub(from[n], to[n]);
        assert!((f64::from(moved[1]) / way - 1.0).abs() < 2e-3, "{moved:?} of {way}");
        assert!(moved[0].abs() + moved[2].abs() < 1e-4, "{moved:?}");
    }
    assert_eq!(from[2], to[2]);
}

/// The velocity of a tracer is how it moves: that of the liquid next to it, and none out of its reach, as far as the
/// velocity of the volume goes on there.
#[test]
fn a_tracer_that_liquid_has_not_reached_has_no_velocity() {
    let places = vec![[0.3, 0.5, 0.5], [0.56, 0.5, 0.5], [0.67, 0.5, 0.5], [0.3, 0.5, 0.95]];
    let bench = solving(ball([0.3, 0.5, 0.5], 0.22))
        .input(TRACERS, Component::points(places))
        .set(GRAVITY, [0.0; 3])
        .set(INITIAL_VELOCITY, [0.5, 0.0, 0.0]);
    for frame in [1, 2] {
        let velocity = of_kind(&particles_at(&bench, frame), 3, V);
        for (v, expected) in velocity.iter().zip([0.5, 0.5, 0.0, 0.0]) {
            assert!((v[0] - expected).abs() < 1e-3 && v[1].abs() + v[2].abs() < 1e-3, "{frame}: {velocity:?}");
        }
    }
}

/// Attributes of the meshes are on the markers from the start, and stay between the values that came in.
#[test]
fn markers_have_the_attributes_of_their_liquid() {
    let mut pool = cuboid([-1.0, -1.0, -1.0], [2.0, 0.3, 2.0]);
    pool.set(HEAT, vec![0.25; 8]).unwrap();
    let mut drop = ball([0.5, 0.65, 0.5], 0.2);
    let heat = drop.positions().iter().map(|p| 0.5 + 2.5 * (p[1] - 0.65)).collect();
    drop.set(HEAT, heat).unwrap();
    let bench = solving(pool).input(LIQUID, drop).set(VISCOSITY, 0.1);
    let start = particles_at(&bench, 1);
    for (p, heat) in of_kind(&start, 0, P).iter().zip(of_kind(&start, 0, HEAT)) {
        let exact = if p[1] > 0.4 { 0.5 + 2.5 * (p[1] - 0.65) } else { 0.25 };
        assert!((heat - exact).abs() < 0.03, "{p:?}: {heat} of {exact}");
    }
    let end = of_kind(&particles_at(&bench, 10), 0, HEAT);
    assert!(end.iter().all(|heat| (-0.01..=1.01).contains(heat)), "{end:?}");
    assert!(end.iter().any(|heat| *heat > 0.6) && end.contains(&0.25));
}

/// A source of honey above water: each point has one of the two, and both are there.
#[test]
fn a_source_has_a_liquid_of_its_own() {
    let honey = with(ball([0.5, 0.6, 0.5], 0.15), &[(SOURCE_VISCOSITY, 50.0), (SOURCE_DENSITY, 1400.0)]);
    let mut honey_source = honey;
    let count = honey_source.point_count();
    honey_source.set(HEAT, vec![0.75; count]).unwrap();
    let bench = solving(cuboid([-1.0; 3], [2.0, 0.25, 2.0])).input(SOURCES, honey_source).set(VISCOSITY, 0.01);
    let end = particles_at(&bench, 8);
    let rows: Vec<_> =
        of_kind(&end, 0, PARTICLE_VISCOSITY).into_iter().zip(of_kind(&end, 0, PARTICLE_DENSITY)).collect();
    assert!(rows.iter().all(|row| [(50.0, 1400.0), (0.01, 1000.0)].contains(row)), "{rows:?}");
    let thick = rows.iter().filter(|row| row.0 == 50.0).count();
    assert!(thick > 30 && rows.len() - thick > 200, "{thick} of {}", rows.len());
    // Its attributes come with it.
    let heat = of_kind(&end, 0, HEAT).into_iter().zip(&rows);
    let right = heat.filter(|(heat, row)| (*heat > 0.5) == (row.0 == 50.0)).count();
    assert!(right * 10 > rows.len() * 9, "{right} of {}", rows.len());
}

/// A source far from all other liquid brings no value but its own.
#[test]
fn attributes_stay_within_those_that_came_in() {
    let heated = |mut mesh: Component, heat: f32| {
        let count = mesh.point_count();
        mesh.set(HEAT, vec![heat; count]).unwrap();
        mesh
    };
    let nozzle = with(ball([0.5, 0.75, 0.5], 0.08), &[(SOURCE_RATE, 0.02), (SOURCE_VISCOSITY, 40.0)]);
    let bench = solving(heated(cuboid([-1.0; 3], [2.0, 0.2, 2.0]), 0.5)).input(SOURCES, heated(nozzle, 0.75));
    for frame in 1..=8 {
        let particles = particles_at(&bench, frame);
        let heat = of_kind(&particles, 0, HEAT);
        assert!(heat.iter().all(|heat| (0.4999..0.7501).contains(heat)), "{frame}: {heat:?}");
        let all = of_kind(&particles, 0, P).into_iter().zip(heat);
        let jet: Vec<f32> = all.filter(|(p, _)| p[1] > 0.5).map(|(_, heat)| heat).collect();
        let of_source = jet.iter().filter(|heat| **heat > 0.74).count();
        assert!(frame < 6 || jet.len() > 20, "{frame}: {}", jet.len());
        assert!(of_source * 20 >= jet.len() * 19, "{frame}: {of_source} of {}", jet.len());
    }
}

/// The heavier of two balls in a pool sinks, the lighter rises.
#[test]
fn heavy_liquid_sinks_and_light_liquid_rises() {
    let heavy = with(ball([0.3, 0.45, 0.5], 0.13), &[(SOURCE_DENSITY, 2000.0), (SOURCE_VISCOSITY, 100.0)]);
    let light = with(ball([0.7, 0.45, 0.5], 0.13), &[(SOURCE_DENSITY, 500.0), (SOURCE_VISCOSITY, 100.0)]);
    let mut tracers = Component::points(vec![[0.3, 0.45, 0.5], [0.7, 0.45, 0.5]]);
    tracers.set(ID, vec![0, 1]).unwrap();
    let bench = solving(cuboid([-1.0; 3], [2.0, 0.8, 2.0]))
        .input(LIQUID, heavy)
        .input(LIQUID, light)
        .input(TRACERS, tracers)
        .set(VISCOSITY, 0.01);
    let end = particles_at(&bench, 6);
    let heights: Vec<f32> = of_kind(&end, 3, P).iter().map(|p| p[1]).collect();
    assert!(heights[0] < 0.4 && heights[1] > 0.5, "{heights:?}");
    assert_eq!(of_kind(&end, 3, PARTICLE_DENSITY), [2000.0, 500.0]);
}

/// Of two halves, one three times as dense, the centre of mass is at a quarter of the way.
#[test]
fn liquid_spins_about_its_centre_of_mass() {
    let heavy = with(cuboid([0.25; 3], [0.5, 0.75, 0.75]), &[(SOURCE_DENSITY, 3000.0)]);
    let out = solving(heavy)
        .input(LIQUID, cuboid([0.5, 0.25, 0.25], [0.75; 3]))
        .set(GRAVITY, [0.0; 3])
        .set(INITIAL_SPIN, [0.0, 2.0, 0.0])
        .cook();
    let mesh = out.mesh();
    for (p, v) in mesh.positions().iter().zip(mesh.get(V).unwrap()) {
        let exact = [2.0 * (p[2] - 0.5), 0.0, -2.0 * (p[0] - 0.4375)];
        assert!((0..3).all(|k| (v[k] - exact[k]).abs() < 0.05), "{p:?}: {v:?}, not {exact:?}");
    }
}

#[test]
fn what_is_no_material_is_refused() {
    let refused = |bench: Bench| bench.try_frames(&[Frame::whole(2)]).err().map(|error| error.error.fact.clone());
    let bad = |attribute, value| with(ball([0.5; 3], 0.1), &[(attribute, value)]);
    assert_eq!(
        refused(solving(bad(SOURCE_VISCOSITY, -3.0))).unwrap(),
        "`liquid` 0 (counted from 0) has a `source_viscosity` of -3"
    );
    let pool = solving(ball([0.5; 3], 0.2)).input(SOURCES, bad(SOURCE_DENSITY, 0.0));
    assert_eq!(refused(pool).unwrap(), "`sources` 0 (counted from 0) has a `source_density` of 0");
}

/// The attributes of the markers at the vertices of the surface.
fn tagged(bench: &Bench, frame: i64) -> (Vec<[f32; 3]>, Vec<[f32; 3]>) {
    let (engine, frame) = (Engine::new(&Settings::default()).unwrap(), Frame::whole(frame));
    let cooked = cook_all(&engine, &bench.graph(), &[frame]).0;
    let [surface, particles] = [0, 1].map(|output| cooked[&(output, frame)].clone());
    let (surface, particles) = (surface.mesh().unwrap(), particles.points().unwrap());
    let source = TagSource::new(particles.positions(), particles.get(N));
    let rows = particles.get(UVW).unwrap().as_flattened();
    let values = [TagValues { rows, width: 3 }];
    let tagged = source.tag(surface.positions(), surface.get(N), source.suitable_radius(), &values);
    assert_eq!(tagged.far, 0);
    (surface.positions().to_vec(), tagged.rows[0].as_chunks::<3>().0.to_vec())
}

/// Texture coordinates that are positions at the start: how far those of a ball are from where its surface was, 1 being
/// its diameter, after it fell for 12 frames, after it turned by 90°, and at rest.
#[test]
fn texture_coordinates_follow_a_ball_that_falls_and_one_that_turns() {
    let centre = [0.5, 0.7, 0.5];
    let mut liquid = ball(centre, 0.22);
    let start = liquid.positions().to_vec();
    liquid.set(UVW, start).unwrap();
    let still = solving(liquid.clone()).set(GRAVITY, [0.0; 3]).set(VISCOSITY, 1e6);
    let off = |bench: &Bench, frame: i64, back: &dyn Fn([f32; 3]) -> [f32; 3]| {
        let (points, uvw) = tagged(bench, frame);
        let off = points.iter().zip(&uvw).map(|(p, uvw)| length(sub(*uvw, back(*p))) / 0.44);
        off.fold(0.0, f32::max)
    };
    // A vertex of so small a ball lies R²/8r outside the markers around it, R being a cell, and R²/6r outside φ = 0, so that
    // quads do not lie inside: 6e-3 and 8e-3 diameters.
    assert!(off(&still, 1, &|p| p) < 1.6e-2, "{}", off(&still, 1, &|p| p));
    assert!(off(&still, 13, &|p| p) < 1.6e-2, "{}", off(&still, 13, &|p| p));
    let falling = still.clone().set(GRAVITY, [0.0, -2.0, 0.0]);
    let out = falling.clone().frames([1, 13]);
    let way = (height(&out[0]) - height(&out[1])) as f32;
    let error = off(&falling, 13, &|p| add(p, [0.0, way, 0.0]));
    assert!(way > 0.2 && error < 1.6e-2, "{way}: {error}");
    let turning = still.set(INITIAL_SPIN, [0.0, 0.0, std::f64::consts::PI]);
    // How far so few cells turn is the solver's error, not that of the coordinates: it is measured by their mean.
    let (points, uvw) = tagged(&turning, 13);
    let pairs = || points.iter().zip(&uvw).map(|(p, uvw)| (sub(*p, centre), sub(*uvw, centre)));
    let mean = pairs().fold([0.0; 3], |sum, ([x, y, _], [a, b, _])| add(sum, [a * x + b * y, a * y - b * x, 0.0]));
    let [cosine, sine, _] = scale(mean, 1.0 / length(mean));
    assert!(sine > 0.98, "turned by 80° to 100°: {sine}");
    let back = |[x, y, z]: [f32; 3]| [cosine * x + sine * y, cosine * y - sine * x, z];
    let error = pairs().map(|(p, uvw)| length(sub(uvw, back(p))) / 0.44).fold(0.0, f32::max);
    assert!(error < 2e-2, "{error}");
}
