//! Which gusts are alive when, and where they start.

use super::*;

const PLAIN: Draw = Draw {
    seed: 7,
    gusts: 40,
    radius: [0.3, 0.6],
    noise: [0.0, 0.3],
    start: [1.0, 48.0],
    life: [24.0, 96.0],
    decay: [6.0, 24.0],
    repeat: 0.0,
    period: 0,
};

#[test]
fn a_gust_lives_from_its_start_through_its_life_and_fades_over_its_decay() {
    let draw = Draw { gusts: 1, start: [10.0, 10.0], life: [20.0, 20.0], decay: [8.0, 8.0], ..PLAIN };
    let strength = |frame: f64| draw.at(frame).gusts.first().map_or(0.0, |gust| gust.strength);
    let expected =
        [(9.99, 0.0), (10.0, 1.0), (29.9, 1.0), (30.0, 1.0), (32.0, 0.75), (36.0, 0.25), (38.0, 0.0), (99.0, 0.0)];
    for (frame, value) in expected {
        assert_eq!(strength(frame), value, "frame {frame}");
    }
    let cut = Draw { decay: [0.0; 2], ..draw };
    assert_eq!([29.9, 30.0].map(|frame| cut.at(frame).gusts.len()), [1, 0]);
    assert_eq!(Draw { life: [0.0; 2], decay: [0.0; 2], ..draw }.at(10.0).gusts, []);
    assert_eq!(Draw { life: [0.0; 2], ..draw }.at(14.0).gusts[0].strength, 0.5);
}

#[test]
fn draws_lie_in_their_ranges_and_depend_on_seed_and_index_only() {
    let gusts = PLAIN.at(50.0).gusts;
    assert!(gusts.len() > 10 && gusts.len() < 40);
    for gust in &gusts {
        assert!((0.3..=0.6).contains(&gust.radius) && (0.0..=0.3).contains(&gust.noise));
        assert!((1.0..=48.0).contains(&gust.start) && (0.0..1.0).contains(&gust.speed));
        assert!(gust.position.iter().all(|x| (-1.0..1.0).contains(x)));
    }
    // More gusts do not change the others; another seed does.
    assert_eq!(Draw { gusts: 60, ..PLAIN }.at(50.0).gusts[..gusts.len()], gusts);
    assert_ne!(Draw { seed: 8, ..PLAIN }.at(50.0).gusts, gusts);
    // At a later moment the same gusts are found.
    let later = PLAIN.at(50.5).gusts;
    let same = gusts.iter().filter(|a| later.iter().any(|b| b.salt == a.salt && b.start == a.start));
    assert!(same.count() + 3 > gusts.len());
}

#[test]
fn a_gust_repeats_with_new_random_numbers() {
    let draw = Draw { gusts: 1, start: [10.0, 10.0], life: [20.0, 20.0], decay: [5.0, 5.0], repeat: 100.0, ..PLAIN };
    let at = |frame: f64| draw.at(frame).gusts;
    let starts = |frame: f64| at(frame).iter().map(|gust| gust.start).collect::<Vec<_>>();
    assert_eq!(starts(12.0), [10.0]);
    assert_eq!(starts(112.0), [110.0]);
    assert_eq!(starts(1_000_012.0), [1_000_010.0]);
    assert_eq!(starts(-88.0), [-90.0], "rounds reach back without end");
    assert_eq!(starts(50.0), [0.0; 0]);
    assert_ne!(at(12.0)[0].radius, at(112.0)[0].radius);
    // Round 0 equals the gust without repetition.
    assert_eq!(Draw { repeat: 0.0, ..draw }.at(12.0).gusts, at(12.0));
}

#[test]
fn overlapping_rounds_are_all_alive_and_found_directly() {
    let draw = Draw { gusts: 2, start: [0.0; 2], life: [95.0, 95.0], decay: [5.0, 5.0], repeat: 10.0, ..PLAIN };
    for frame in [0.0, 3.5, 1e6, -1e6, 1e9] {
        let living = draw.at(frame);
        // Ages 0 ≤ a < 100 in steps of 10: ten of each.
        assert_eq!((living.gusts.len(), living.dropped), (20, 0), "frame {frame}");
        assert!(living.gusts.iter().all(|gust| gust.start <= frame && gust.start > frame - 100.0));
    }
}

#[test]
fn too_many_rounds_are_bounded_and_counted() {
    let draw = Draw { gusts: 1000, life: [1e9, 1e9], repeat: 1.0, ..PLAIN };
    let living = draw.at(100.0);
    assert!(living.gusts.len() as u64 <= MOST_LIVING && living.gusts.len() > 50_000);
    assert!(living.dropped > 900_000_000_000);
    // Too short for a round: the gust does not repeat.
    assert_eq!(Draw { repeat: 1e-30, ..PLAIN }.at(50.0), PLAIN.at(50.0));
    assert_eq!(Draw { gusts: 0, ..PLAIN }.at(50.0), Living::default());
}

#[test]
fn the_plane_lies_upwind_of_the_box_and_covers_it() {
    let box_ = [[0.0, 0.0, 0.0], [4.0, 2.0, 6.0]];
    // Wind along x: the plane is 1 m before x = 0; its level side is −z, its upright side y.
    let plane = Plane::new(box_, [1.0, 0.0, 0.0], 1.0, [0.0; 2]);
    assert_eq!(plane.at([0.0, 0.0]), [-1.0, 1.0, 3.0]);
    assert_eq!(plane.at([1.0, 1.0]), [-1.0, 2.0, 0.0]);
    assert_eq!(plane.at([-1.0, -1.0]), [-1.0, 0.0, 6.0]);
    let plane = Plane::new(box_, [0.0, 0.0, -1.0], 0.5, [8.0, 0.0]);
    assert_eq!(plane.at([1.0, 1.0]), [-2.0, 2.0, 6.5]);
    for wind in [[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]] {
        let plane = Plane::new(box_, wind, 0.0, [0.0; 2]);
        let corner = plane.at([1.0, 1.0]);
        assert_eq!(plane.at([0.0, 0.0])[1], 1.0 - wind[1]);
        assert_eq!([(corner[0] - 2.0).abs(), (corner[2] - 3.0).abs()], [2.0, 3.0]);
    }
    // An oblique wind: no corner of the box is upwind of the plane.
    let wind = [0.6, -0.48, 0.64];
    let start = Plane::new(box_, wind, 0.0, [0.0; 2]).at([0.3, -0.8]);
    for corner in 0..8 {
        let p: [f64; 3] = std::array::from_fn(|k| f64::from(box_[corner >> k & 1][k]));
        let along: f64 = (0..3).map(|k| (p[k] - start[k]) * wind[k]).sum();
        assert!(along > -1e-12);
    }
}

#[test]
fn a_looped_gust_comes_again_with_the_same_random_numbers() {
    let moments = [0.0, 3.25, 20.0, 47.0];
    for (repeat, rounds) in [(0.0, 1), (12.0, 4), (11.0, 4), (1000.0, 1), (13.9, 3)] {
        let draw = Draw { repeat, ..PLAIN }.looped(48.0);
        assert_eq!(draw.period, rounds, "{repeat}");
        for moment in moments {
            let now = draw.at(moment).gusts;
            assert!(!now.is_empty());
            for loops in [1, -2, 1000] {
                let shift = 48.0 * f64::from(loops);
                let later = draw.at(moment + shift).gusts;
                assert_eq!(now.len(), later.len());
                for (a, b) in now.iter().zip(&later) {
                    assert!((b.start - a.start - shift).abs() < 1e-9 && (b.strength - a.strength).abs() < 1e-6);
                    assert_eq!(Gust { start: a.start, strength: a.strength, ..*b }, *a);
                }
            }
        }
    }
    let four = Draw { repeat: 12.0, gusts: 1, start: [1.0; 2], life: [11.0; 2], decay: [0.0; 2], ..PLAIN }.looped(48.0);
    let salts: Vec<u32> = (0..4).map(|round| four.at(2.0 + 12.0 * f64::from(round)).gusts[0].salt).collect();
    assert!((1..4).all(|k| salts[k] != salts[0]), "the rounds of a loop differ");
}
