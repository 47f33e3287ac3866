//! Tests of the tets, by what they are about; and the exact checks that several share.

mod complex;
mod predicates;

use super::lattice::Place;
use super::predicates::{in_sphere, orient};
use super::{Delaunay, NONE};
use crate::random::Key;

fn at(place: Place) -> [f64; 3] {
    place.map(f64::from)
}

/// Random places, each coordinate below `side`.
fn random(count: u64, side: i32, seed: u64) -> Vec<Place> {
    let key = Key::new(seed);
    (0..count).map(|k| [0, 1, 2].map(|axis| (key.of(k).of(axis).u64() % side as u64) as i32)).collect()
}

/// Six times the volume of all tets.
fn volume(places: &[Place], tets: &[[u32; 4]]) -> i128 {
    let whole = |corner: u32| places[corner as usize].map(i128::from);
    let six = |tet: &[u32; 4]| {
        let [a, b, c, d] = tet.map(whole);
        let [b, c, d] = [b, c, d].map(|p| [p[0] - a[0], p[1] - a[1], p[2] - a[2]]);
        b[0] * (c[1] * d[2] - c[2] * d[1]) + b[1] * (c[2] * d[0] - c[0] * d[2]) + b[2] * (c[0] * d[1] - c[1] * d[0])
    };
    tets.iter().map(six).sum()
}

/// Fails unless every tet is positive, knows its neighbours, and has no neighbour's far corner in its sphere: what a
/// Delaunay complex is, by Delaunay's lemma.
fn check(places: &[Place], Delaunay { tets, across, doubled }: &Delaunay) {
    let of = |tet: &[u32; 4]| tet.map(|corner| at(places[corner as usize]));
    for (index, (tet, others)) in tets.iter().zip(across).enumerate() {
        let [a, b, c, d] = of(tet);
        assert!(orient(&a, &b, &c, &d) > 0.0, "tet {index} is flat or inverted");
        for (corner, other) in others.iter().enumerate() {
            if *other == NONE {
                // A face of the hull: all places on one side.
                continue;
            }
            let back = across[*other as usize].iter().position(|tet| *tet == index as u32).unwrap();
            let far = tets[*other as usize][back];
            assert!(!tet.contains(&far));
            let shared = |tet: &[u32; 4], but: usize| {
                let mut face: Vec<u32> = (0..4).filter(|k| *k != but).map(|k| tet[k]).collect();
                face.sort_unstable();
                face
            };
            assert_eq!(shared(tet, corner), shared(&tets[*other as usize], back));
            assert!(in_sphere(&a, &b, &c, &d, &at(places[far as usize])) <= 0.0, "face {corner} of tet {index}");
        }
    }
    let mut used = vec![false; places.len()];
    tets.as_flattened().iter().for_each(|corner| used[*corner as usize] = true);
    for [double, of] in doubled {
        assert_eq!(places[*double as usize], places[*of as usize]);
        assert!(!used[*double as usize], "a double has no tet");
        used[*double as usize] = true;
    }
    assert!(tets.is_empty() || used.iter().all(|used| *used), "every place is in a tet or on another");
}
