//! What can be worked out by hand.

use super::*;

pub(super) fn pose(share: f64, positions: &[[f64; 3]]) -> Pose {
    Pose { share, positions: positions.to_vec() }
}

/// A square of two triangles at height 0, open, its normal up.
pub(super) const SQUARE: [[f64; 3]; 4] = [[-1.0, 0.0, -1.0], [-1.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 0.0, -1.0]];
pub(super) const TWO: [[u32; 3]; 2] = [[0, 1, 2], [0, 2, 3]];

/// One triangle of three particles around a point, tiny: its first particle is what tests look at.
fn speck(at: [f64; 3]) -> [[f64; 3]; 3] {
    [at, [at[0] + 1e-3, at[1] + 10.0, at[2]], [at[0], at[1] + 10.0, at[2] + 1e-3]]
}

fn find(scene: &Scene<'_>, from: &[[f64; 3]], to: &[[f64; 3]], times: [f64; 2]) -> (Vec<Contact>, Found) {
    let mut out = Vec::new();
    let found = scene.search(&Query { from, to, times }, &mut out);
    (out, found)
}

#[test]
fn a_vertex_that_falls_through_a_square_is_told_once_and_held_above() {
    let plate = Obstacle::new(&TWO, &[pose(0.0, &SQUARE)], 1.0, 0.01, 0.5).unwrap();
    let (from, to) = (speck([0.0, 0.5, 0.0]), speck([0.0, -0.5, 0.0]));
    let skin = Skin::new(&from, &[[0, 1, 2]], &[]).unwrap();
    let mask = [0.5f32, 1.0, 1.0];
    let scene =
        Scene { skins: &[skin], obstacles: &[plate], friction: Some(&mask), ..Scene::default() };
    let (contacts, found) = find(&scene, &from, &to, [0.0, 1.0]);
    assert_eq!(found, Found { contacts: 1, deepest_overlap: 0.0 });
    let contact = contacts[0];
    assert_eq!((contact.particles, contact.weights), ([0; 4], [1.0, 0.0, 0.0, 0.0]));
    assert_eq!((contact.normal, contact.offset, contact.gap), ([0.0, 1.0, 0.0], 0.0, 0.01));
    assert_eq!((contact.velocity, contact.friction), ([0.0; 3], 0.25));
    // From below it is held below.
    let (contacts, _) = find(&scene, &to.map(|p| [p[0], p[1] - 20.0, p[2]]), &from.map(|p| [p[0], p[1] - 9.0, p[2]]), [0.0, 1.0]);
    let held: Vec<_> = contacts.iter().filter(|contact| contact.weights[0] == 1.0).map(|contact| contact.normal).collect();
    assert!(!held.is_empty() && held.iter().all(|normal| *normal == [0.0, -1.0, 0.0]), "{held:?}");
}

#[test]
fn a_plate_that_comes_up_brings_its_height_and_velocity() {
    let up = SQUARE.map(|[x, _, z]| [x, 0.4, z]);
    let plate = Obstacle::new(&TWO, &[pose(0.0, &SQUARE), pose(1.0, &up)], 0.5, 0.01, 0.5).unwrap();
    let still = speck([0.3, 0.1, 0.2]);
    let skin = Skin::new(&still, &[[0, 1, 2]], &[]).unwrap();
    let scene = Scene { skins: &[skin], obstacles: &[plate], ..Scene::default() };
    let (contacts, _) = find(&scene, &still, &still, [0.0, 0.5]);
    assert_eq!(contacts.len(), 1);
    assert!((contacts[0].offset - 0.2).abs() < 1e-15 && (contacts[0].velocity[1] - 0.8).abs() < 1e-15);
    assert_eq!(contacts[0].normal, [0.0, 1.0, 0.0]);
}
