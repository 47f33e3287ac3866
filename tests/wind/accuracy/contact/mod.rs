//! Where turning segments stop at obstacles.
//!
//! Each shape's first contact is a closed form in the angle φ of the turn. Where a mesh approximates a round shape, two
//! radii bound it: that of its vertices and that of its face centres. Grazing turns, whose contact depends on rounding,
//! are left out.

mod round;
mod sharp;
mod steps;

use curves::collide::{Collide, ContactMethod, collide};
use numerics::random::Key;
use numerics::tree::TriangleTree;
use numerics::vector::{DVec3, to_f32, to_f64};
use std::f64::consts::{PI, TAU};

use super::Figure;

type Point = [f32; 3];

fn random_unit(key: Key) -> DVec3 {
    let v = DVec3::from([0, 1, 2].map(|axis| 2.0 * key.of(axis).f64() - 1.0));
    if (0.01..1.0).contains(&v.dot(&v)) { v / v.norm() } else { random_unit(key.of(9)) }
}

/// A segment of length 1 about to turn about one end.
struct Turn {
    rest: [Point; 2],
    goal: [Point; 2],
    pivot: DVec3,
    /// Its direction, and the direction in which it turns: unit, perpendicular.
    u: DVec3,
    v: DVec3,
    /// Angle of the turn.
    goal_angle: f64,
}

impl Turn {
    fn new(pivot: DVec3, from: DVec3, to: DVec3) -> Self {
        let start = to_f32(pivot);
        let pivot = to_f64(start);
        let [rest, goal] = [from, to].map(|direction| [start, to_f32(pivot + direction)]);
        // Directions of the rounded positions.
        let [u, to] = [rest, goal].map(|ends| (to_f64(ends[1]) - pivot).normalize());
        let v = (to - u * to.dot(&u)).normalize();
        let mut turn = Self { rest, goal, pivot, u, v, goal_angle: 0.0 };
        turn.goal_angle = turn.angle(to);
        turn
    }

    /// The angle of a direction in the plane of the turn, 0 to 2π.
    fn angle(&self, direction: DVec3) -> f64 {
        libm::atan2(direction.dot(&self.v), direction.dot(&self.u)).rem_euclid(TAU)
    }

    fn direction(&self, angle: f64) -> DVec3 {
        self.u * libm::cos(angle) + self.v * libm::sin(angle)
    }
}

/// The angle at which a turn first meets something.
enum First {
    Never,
    /// Between these angles, which differ only because the mesh approximates a round shape.
    At([f64; 2]),
    Grazes,
}

/// A mesh, and turns with their first contact.
struct Case {
    points: Vec<Point>,
    triangles: Vec<[u32; 3]>,
    turns: Vec<(Turn, First)>,
}

/// Distance kept from contact; for segments of length 1 approximately also the angle.
const GAP: f64 = 1e-6;

/// Thin curves without a skin.
fn plain<'a>(obstacles: &'a [&'a TriangleTree], method: ContactMethod, gap: f64) -> Collide<'a> {
    Collide {
        obstacles,
        skin: None,
        method,
        coherence: 0.0.into(),
        gap: gap.into(),
        offset_root: gap.into(),
        offset_scale: None,
        loft: 0.0.into(),
        at_rest: None,
        blend: 1.0.into(),
        width: 0.0.into(),
    }
}

/// The largest error of the angle at which turns stop, and the largest distance beyond first contact.
fn worst(case: &Case) -> [f64; 2] {
    let tree = TriangleTree::build(&case.points, &case.triangles);
    let obstacles = [&tree];
    let starts: Vec<u32> = (0..=case.turns.len() as u32).map(|turn| 2 * turn).collect();
    let ends = |of: fn(&Turn) -> [Point; 2]| case.turns.iter().flat_map(|(turn, _)| of(turn)).collect::<Vec<_>>();
    let out = collide(
        &starts,
        &ends(|turn| turn.rest),
        &ends(|turn| turn.goal),
        &plain(&obstacles, ContactMethod::Exact, GAP),
    );
    let (mut error, mut past, mut met) = (0.0_f64, 0.0_f64, 0);
    for ((turn, first), written) in case.turns.iter().zip(out.points.chunks(2)) {
        let angle = turn.angle(to_f64(written[1]) - turn.pivot);
        let angle = if angle > 1.5 * PI { angle - TAU } else { angle };
        let [low, high] = match first {
            First::Grazes => continue,
            First::Never => [turn.goal_angle; 2],
            First::At(between) => between.map(|angle| angle.min(turn.goal_angle)),
        };
        met += usize::from(high < turn.goal_angle);
        error = error.max((angle - low).abs()).max((angle - high).abs());
        past = past.max(angle - high);
    }
    assert!(met > 100 && met < case.turns.len(), "{met} of {} turns meet something", case.turns.len());
    [error, past]
}

/// Random turns about pivots given by `pivot`.
fn turns(
    count: u64,
    salt: u64,
    pivot: impl Fn(Key) -> DVec3,
    first: impl Fn(&Turn) -> Option<First>,
) -> Vec<(Turn, First)> {
    let turn = |k: u64| {
        let key = Key::new(salt).of(k);
        let turn = Turn::new(pivot(key), random_unit(key.of(20)), random_unit(key.of(21)));
        first(&turn).map(|first| (turn, first))
    };
    (0..count).filter_map(turn).collect()
}

pub(super) fn figures() -> Vec<Figure> {
    let cases = [
        ("Curve_Wind_Collision: first contact with a plane", worst(&round::floor())),
        ("first contact with a sphere", worst(&round::sphere())),
        ("first contact with a cylinder's flank", worst(&round::cylinder())),
        ("first contact with the edge of a blade of 1°", sharp::blades()),
        ("first contact with a needle 1e-6 thick", sharp::needles()),
        ("first contact with the first of 144 needles", worst(&sharp::grid())),
    ];
    let past = cases.iter().map(|(_, [_, past])| *past).fold(0.0, f64::max);
    let mut figures: Vec<Figure> =
        cases.iter().map(|(law, [error, _])| Figure::error(law, *error, 1e-4, " rad")).collect();
    figures.push(Figure::error("largest distance of any of these beyond first contact", past, 1e-5, " L"));
    figures.push(Figure::within(
        "`steps` converges to `exact` as 1/steps, 2 to 256 steps: slope",
        &[steps::slope()],
        [0.8, 1.2],
    ));
    figures
}
