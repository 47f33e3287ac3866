//! Goals, pins and coupling springs, measured on the node.

use engine::time::Frame as Time;

use super::*;
use crate::scene::Scene;

/// The block of 0.3 m at half its height and the same volume.
fn flat(body: &engine::geometry::Component) -> engine::geometry::Component {
    let wider = std::f64::consts::SQRT_2;
    shapes::changed(body, |_, [x, y, z]| [x * wider, y * 0.5, z * wider])
}

/// After a goal was reached, became the rest shape and was released: the largest strain of a spring relative to its
/// length in the goal, with the rounding of stored positions, and the elastic energy left ÷ E·V.
fn released() -> ([f64; 2], f64) {
    let (modulus, side) = (1e4, 0.3_f64);
    let body = shapes::block([3; 3], 0.1, [0.0; 3]);
    let scene = Scene::of(body.clone()).goal(flat(&body), 24.0, 1e4, 24.0).set("gravity", "[0, 0, 0]");
    let cooked = scene.set("stiffness", modulus).set("damping", 0.2).set("drag", 5).cook([480], 2);
    let found = cooked.last();
    let stored: Vec<[f32; 3]> = found.iter().map(|p| p.map(|x| x as f32)).collect();
    let strains = shapes::springs(&flat(&body), 1.0).into_iter().map(|spring| {
        let [a, b] = spring.ends.map(|end| found[end]);
        [(distance(&a, &b) / spring.length - 1.0).abs(), storage(&stored) / spring.length]
    });
    let worst = strains.reduce(|a, b| if b[0] > a[0] { b } else { a }).unwrap();
    (worst, cooked.metric("elastic").last().unwrap() / (modulus * side * side * side))
}

/// A goal on the interior is the only force on a block: the number of surface particles that move, and of all.
fn pulled_surface() -> (usize, usize) {
    let body = shapes::block([3; 3], 0.1, [0.0; 3]);
    let scene = Scene::of(body.clone()).goal(flat(&body), 2.0, 1e4, 24.0).set("gravity", "[0, 0, 0]");
    let cooked = scene.set("stiffness", 0).set("volume", 0).run(6);
    let moved = |from: &[V], to: &[V]| from.iter().zip(to).map(|(a, b)| distance(a, b)).collect::<Vec<_>>();
    let skin = |place: usize| crate::measure::points(cooked.surface[place].as_ref().unwrap());
    assert!(largest(moved(&cooked.at(0), &cooked.at(5))) > 0.01, "the interior moves towards the goal");
    let surface = moved(&skin(0), &skin(5));
    (surface.iter().filter(|moved| **moved > 0.0).count(), surface.len())
}

/// Number of pinned particles, over all frames, that are not exactly at their animated positions, and of all.
fn off_pins() -> [usize; 2] {
    let body = shapes::block([4, 2, 2], 0.1, [0.0; 3]);
    let held: Vec<usize> = (0..body.point_count()).filter(|i| body.positions()[*i][0] == 0.0).collect();
    // One moving point pins all nine.
    let hand = |frame: Time| {
        let at = frame.number() - 1.0;
        [0.1 * libm::sin(at), 0.1 + 0.03 * at, 0.1 * libm::cos(0.7 * at)].map(|x| x as f32)
    };
    let cooked = Scene::of(body.clone()).pins(0.2, move |frame| vec![hand(frame)]).set("ground", true).run(24);
    let near: Vec<usize> = (0..body.point_count())
        .filter(|i| {
            distance(&body.positions()[*i].map(f64::from), &hand(Time::whole(1)).map(f64::from)) <= f64::from(0.2_f32)
        })
        .collect();
    assert!(held.iter().any(|i| near.contains(i)) && near.len() < body.point_count());
    let mut off = 0;
    for frame in 0..24 {
        let (from, to) = (hand(Time::whole(1)), hand(Time::whole(frame as i64 + 1)));
        let found = cooked.at(frame);
        for particle in &near {
            let place = body.positions()[*particle];
            let moved = |k: usize| f64::from(to[k]) + (f64::from(place[k]) - f64::from(from[k]));
            off += usize::from((0..3).any(|k| found[*particle][k] != f64::from(moved(k) as f32)));
        }
    }
    [off, 24 * near.len()]
}

/// The largest length ÷ rest length of the coupling springs between a pinned cube and one that hangs from it.
fn joined() -> f64 {
    let (lower, upper) = (shapes::block([2; 3], 0.05, [0.0; 3]), shapes::block([2; 3], 0.05, [0.0, 0.102, 0.0]));
    let top: Vec<[f32; 3]> = upper.positions().iter().filter(|p| p[1] > 0.2).copied().collect();
    let scene = Scene::of(lower.clone()).and(upper.clone()).pins(1e-3, move |_| top.clone());
    let scene = scene.set("coupling_radius", 5e-3).set("coupling_stiffness", 2e4).set("stiffness", 1e5);
    let cooked = scene.set("body_collision", false).run(48);
    let count = lower.point_count();
    let on_top = (0..count).filter(|i| lower.positions()[*i][1] > 0.09);
    let pairs: Vec<[usize; 2]> = on_top.map(|i| [i, count + i - 6]).collect();
    let length = |points: &[V], [a, b]: [usize; 2]| distance(&points[a], &points[b]);
    let rest = cooked.at(0);
    let of = |frame: usize| {
        let points = cooked.at(frame);
        largest(pairs.iter().map(|pair| length(&points, *pair) / length(&rest, *pair)))
    };
    largest((0..48).map(of))
}

pub(super) fn figures() -> Vec<Figure> {
    let (strain, energy) = released();
    let (pulled, [off, pinned]) = (pulled_surface(), off_pins());
    vec![
        Figure::stored("A goal that became the rest shape and was released: strain relative to it", [strain], 1e-6, ""),
        Figure::error("energy left in its springs ÷ E·V", energy, 1e-12, ""),
        Figure::never("surface particles moved by a goal on the interior, without springs", pulled.0, pulled.1),
        Figure::never("pinned particles that differ in any bit from the animation", off, pinned),
        Figure::within(
            "Coupling springs that carry a hanging body: largest length ÷ rest length",
            &[joined()],
            [1.0, 1.1],
        ),
    ]
}
