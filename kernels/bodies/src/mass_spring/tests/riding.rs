//! Contacts of points that ride along on particles.

use super::contact::ground;
use super::*;
use crate::embedding::{EmbeddedPoint, embed};
use std::sync::Mutex;

/// Only the contacts of points from `first` on.
struct From<'a>(&'a dyn ContactFinder, u32);

impl ContactFinder for From<'_> {
    fn find(&self, query: &ContactQuery<'_>, out: &mut Vec<Contact>) {
        self.0.find(query, out);
        out.retain(|contact| contact.points[0] >= self.1);
    }
}

/// A block of 0.4 m, whose layer of riding points is 0.05 m above its lower face: in the middle of its lowest cubes.
fn block_with_points() -> (SoftBody, Vec<EmbeddedPoint>) {
    let (points, tets) = block([4; 3], 0.1);
    let narrow: Vec<[f32; 3]> = points.iter().map(|p| p.map(|x| x as f32)).collect();
    let layer: Vec<[f32; 3]> =
        (0..25).map(|k| [0.02 + 0.09 * (k % 5) as f32, 0.05, 0.02 + 0.09 * (k / 5) as f32]).collect();
    let riding = embed(&narrow, &tets, &layer).unwrap();
    let mesh = Mesh { points: &points, tets: &tets, riding: &riding, ..Mesh::default() };
    (SoftBody::new(&mesh, &material(1000.0, 1e5, 0.01), &[]).unwrap(), riding)
}

#[test]
fn a_block_rests_on_the_points_that_ride_along() {
    let (body, riding) = block_with_points();
    let plane = ground(0.5);
    let contacts = From(&plane, body.len() as u32);
    let mut state = State::at_rest(&body);
    let frame = SolverFrame { contacts: Some(&contacts), bounce: Some(0.0), ..SolverFrame::default() };
    let report = steps(&body, &mut state, &frame, 48);
    for point in &riding {
        let height = point.position(&state.positions)[1];
        assert!(height > 0.0 && height < 1e-3, "{height} {report:?}");
    }
    assert!(state.velocities.iter().all(|v| DVec3::from(*v).norm() < 1e-3), "{report:?}");
    // The normal forces carry its weight.
    let loads: f64 = state.loads[body.len()..].iter().sum();
    let weight = 9.81 * body.masses().iter().sum::<f64>();
    assert!((loads / weight - 1.0).abs() < 1e-2, "{loads} N for {weight} N");
    assert!(state.loads[..body.len()].iter().all(|load| *load == 0.0));
}

#[test]
fn sliding_on_points_that_ride_along_obeys_coulomb() {
    let (body, _) = block_with_points();
    let plane = ground(0.3);
    let contacts = From(&plane, body.len() as u32);
    let mut state = State::at_rest(&body);
    state.positions.iter_mut().for_each(|x| x[1] -= 0.0492);
    let gravity = [9.81 * 0.5, -9.81 * 0.75_f64.sqrt(), 0.0];
    let frame = SolverFrame { gravity, contacts: Some(&contacts), bounce: Some(0.0), ..SolverFrame::default() };
    let mut solver = BodySolver::new(&body);
    let mut speeds = Vec::new();
    for _ in 0..36 {
        let _ = solver.step(&body, &mut state, &frame);
        speeds.push(momentum(&body, &state).x / body.masses().iter().sum::<f64>());
    }
    let expected = 9.81 * (0.5 - 0.3 * 0.75_f64.sqrt()) * 0.5;
    let found = speeds[35] - speeds[23];
    assert!((found / expected - 1.0).abs() < 0.01, "{found} for {expected} m/s");
}

#[test]
fn a_contact_of_a_riding_point_is_that_of_its_particles_each_once() {
    let (body, riding) = block_with_points();
    let asked = Mutex::new(None);
    let first = body.len() as u32;
    struct Probe<'a>(&'a Mutex<Option<Vec<[f64; 3]>>>, [u32; 4]);
    impl ContactFinder for Probe<'_> {
        fn find(&self, query: &ContactQuery<'_>, out: &mut Vec<Contact>) {
            *self.0.lock().unwrap() = Some(query.from.to_vec());
            let weights = [1.0, -0.5, -0.25, -0.25];
            let (normal, velocity) = ([0.0, 1.0, 0.0], [0.0; 3]);
            let contact = Contact {
                points: self.1,
                weights,
                normal,
                offset: 0.2,
                gap: 0.16,
                velocity,
                friction: 0.0,
                jammed: false,
                open: false,
            };
            out.push(contact);
        }
    }
    // A corner of the block against three riding points: two bodies' worth of momentum, none of it new.
    let corner = (0..body.len()).find(|i| body.rest_point(*i) == [0.0, 0.4, 0.0]).unwrap() as u32;
    let probe = Probe(&asked, [corner, first, first + 1, first + 6]);
    let mut state = State::at_rest(&body);
    let report = steps(&body, &mut state, &SolverFrame { contacts: Some(&probe), ..BARE }, 1);
    assert!(report.kinetic > 0.0 && report.elastic > 0.0, "{report:?}");
    let asked = asked.into_inner().unwrap().unwrap();
    assert_eq!(asked.len(), body.len() + riding.len());
    let momentum = momentum(&body, &state).norm();
    assert!(momentum < 1e-9, "{momentum}");
}

#[test]
fn riding_points_with_a_wrong_particle_or_weight_are_refused() {
    let (points, tets) = block([1; 3], 0.1);
    let refused = |riding: EmbeddedPoint| {
        let mesh = Mesh { points: &points, tets: &tets, riding: &[riding], ..Mesh::default() };
        SoftBody::new(&mesh, &material(1.0, 1.0, 0.0), &[]).unwrap_err().to_string()
    };
    assert_eq!(
        refused(EmbeddedPoint::at_particle(8)),
        "riding point 0 joins particles [8, 0, 0, 0]; expected distinct indices below 8"
    );
    let weights = [f64::NAN, 0.0, 0.0, 0.0];
    assert!(refused(EmbeddedPoint { particles: [0; 4], weights }).contains("`weight` of 0 is NaN"));
}
