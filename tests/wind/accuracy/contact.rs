//! Where segments that turn into something stop.
//!
//! Each shape's first contact is a closed form in the angle φ of the turn. Where a mesh stands for a round shape, two
//! radii bound it: that of its points and that of its faces' middles. Turns that graze (a contact that a hair's breadth
//! makes or breaks) are left out.

use numerics::collide::{Collide, Method, Scaled, collide};
use numerics::random::Key;
use numerics::shapes::icosphere;
use numerics::tree::TriangleTree;
use std::f64::consts::{PI, TAU};

use super::Figure;

type V = [f64; 3];
type Point = [f32; 3];

fn dot(a: V, b: V) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: V, b: V) -> V {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// a + t·b.
fn along(a: V, b: V, t: f64) -> V {
    std::array::from_fn(|k| a[k] + t * b[k])
}

fn unit(v: V) -> V {
    let length = dot(v, v).sqrt();
    v.map(|x| x / length)
}

fn random_unit(key: Key) -> V {
    let v: V = [0, 1, 2].map(|axis| 2.0 * key.of(axis).f64() - 1.0);
    if (0.01..1.0).contains(&dot(v, v)) { unit(v) } else { random_unit(key.of(9)) }
}

fn narrow(v: V) -> Point {
    v.map(|x| x as f32)
}

fn wide(v: Point) -> V {
    v.map(f64::from)
}

/// A segment of length 1 that is to turn about one end.
struct Turn {
    rest: [Point; 2],
    goal: [Point; 2],
    pivot: V,
    /// Where it points, and which way it turns: unit, at a right angle.
    u: V,
    v: V,
    /// How far.
    goal_angle: f64,
}

impl Turn {
    fn new(pivot: V, from: V, to: V) -> Self {
        let pivot = narrow(pivot);
        let [rest, goal] = [from, to].map(|way| [pivot, narrow(along(wide(pivot), way, 1.0))]);
        let pivot = wide(pivot);
        // As the rounded positions say.
        let [u, to] = [rest, goal].map(|ends| unit(along(wide(ends[1]), pivot, -1.0)));
        let v = unit(along(to, u, -dot(to, u)));
        let mut turn = Self { rest, goal, pivot, u, v, goal_angle: 0.0 };
        turn.goal_angle = turn.angle(to);
        turn
    }

    /// The angle of a direction in the plane of the turn, 0 to 2π.
    fn angle(&self, way: V) -> f64 {
        libm::atan2(dot(way, self.v), dot(way, self.u)).rem_euclid(TAU)
    }

    fn direction(&self, angle: f64) -> V {
        along(self.u.map(|x| libm::cos(angle) * x), self.v, libm::sin(angle))
    }
}

/// Where a turn first meets something.
enum First {
    Never,
    /// Between these angles, which are one but for what a mesh leaves of a round shape.
    At([f64; 2]),
    Grazes,
}

/// A mesh, and turns with their first contact.
struct Case {
    points: Vec<Point>,
    triangles: Vec<[u32; 3]>,
    turns: Vec<(Turn, First)>,
}

/// What is kept from contact: with 1 as the length this is the angle, or so.
const GAP: f64 = 1e-6;

/// The largest error of the angle at which turns stop, and the farthest that any goes on past its first contact.
fn worst(case: &Case) -> [f64; 2] {
    let tree = TriangleTree::build(&case.points, &case.triangles);
    let obstacles = [&tree];
    let how = Collide {
        obstacles: &obstacles,
        skin: None,
        method: Method::Exact,
        coherence: 0.0,
        gap: GAP,
        offset_root: GAP,
        offset_scale: None,
        at_rest: None,
        blend: Scaled { value: 1.0, mask: None },
        width: Scaled { value: 0.0, mask: None },
    };
    let starts: Vec<u32> = (0..=case.turns.len() as u32).map(|turn| 2 * turn).collect();
    let ends = |of: fn(&Turn) -> [Point; 2]| case.turns.iter().flat_map(|(turn, _)| of(turn)).collect::<Vec<_>>();
    let out = collide(&starts, &ends(|turn| turn.rest), &ends(|turn| turn.goal), &how);
    let (mut error, mut past, mut met) = (0.0_f64, 0.0_f64, 0);
    for ((turn, first), written) in case.turns.iter().zip(out.points.chunks(2)) {
        let angle = turn.angle(along(wide(written[1]), turn.pivot, -1.0));
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

/// Random turns about pivots that `pivot` gives.
fn turns(
    count: u64,
    salt: u64,
    pivot: impl Fn(Key) -> V,
    first: impl Fn(&Turn) -> Option<First>,
) -> Vec<(Turn, First)> {
    let turn = |k: u64| {
        let key = Key::new(salt).of(k);
        let turn = Turn::new(pivot(key), random_unit(key.of(20)), random_unit(key.of(21)));
        first(&turn).map(|first| (turn, first))
    };
    (0..count).filter_map(turn).collect()
}

/// A floor: the tip is at h + A·cos(φ − ψ), A and ψ those of u and v along y.
fn floor() -> Case {
    let points = vec![[-9.0, 0.0, -9.0], [-9.0, 0.0, 9.0], [9.0, 0.0, 9.0], [9.0, 0.0, -9.0]];
    let first = |turn: &Turn| {
        let height = turn.pivot[1];
        let (reach, at) = (libm::hypot(turn.u[1], turn.v[1]), libm::atan2(turn.v[1], turn.u[1]));
        let share = height / reach;
        Some(match () {
            () if height + turn.u[1] < 0.01 => return None,
            () if share > 1.001 => First::Never,
            () if share > 0.999 => First::Grazes,
            () => First::At([at + libm::acos(-share); 2]),
        })
    };
    let pivot = |key: Key| [0.3, 0.02 + 0.9 * key.of(1).f64(), -0.2];
    Case { points, triangles: vec![[0, 1, 2], [0, 2, 3]], turns: turns(4000, 1, pivot, first) }
}

/// The angle at which a segment of length 1 first meets a circle of radius `r` about `centre`, in the plane of the turn:
/// touching it, or with its tip. None where it does not; NaN where that is in doubt.
fn meets_circle(centre: [f64; 2], r: f64) -> Option<f64> {
    let (away, at) = (libm::hypot(centre[0], centre[1]), libm::atan2(centre[1], centre[0]));
    let short = away - r - 1.0;
    if short.abs() < 0.02 {
        return Some(f64::NAN);
    }
    if short > 0.0 {
        return None;
    }
    let aside = match away * away - r * r <= 1.0 {
        true => libm::asin(r / away),
        false => libm::acos((away * away + 1.0 - r * r) / (2.0 * away)),
    };
    // Blocked from at − aside to at + aside.
    let start = (at - aside).rem_euclid(TAU);
    Some(if start > TAU - 2.0 * aside - 0.02 || start < 0.02 { f64::NAN } else { start })
}

/// A sphere: the plane of the turn cuts it in a circle.
fn sphere() -> Case {
    let mesh = icosphere(1.0, 7);
    let triangles = mesh.triangles();
    let middle = |corners: &[u32; 3]| {
        let sum = corners.iter().fold([0.0; 3], |sum, corner| along(sum, mesh.points[*corner as usize], 1.0 / 3.0));
        dot(sum, sum).sqrt()
    };
    // A face is nearest to the centre at most as near as a flat cap through its points.
    let inner = triangles.iter().map(middle).fold(1.0, f64::min) - 1e-6;
    let first = |turn: &Turn| {
        let centre = [-dot(turn.pivot, turn.u), -dot(turn.pivot, turn.v)];
        let square = |r: f64| r * r - dot(turn.pivot, turn.pivot) + centre[0] * centre[0] + centre[1] * centre[1];
        Some(match square(1.0) {
            outside if outside < -0.02 => First::Never,
            near if near < 0.2 => First::Grazes,
            _ => match [1.0, inner].map(|r| meets_circle(centre, square(r).sqrt())) {
                [Some(low), Some(high)] if low.is_finite() && high.is_finite() => First::At([low, high]),
                [None, None] => First::Never,
                _ => First::Grazes,
            },
        })
    };
    let pivot = |key: Key| random_unit(key).map(|x| x * (1.15 + 0.8 * key.of(5).f64()));
    let points = mesh.points.iter().map(|point| narrow(*point)).collect();
    Case { points, triangles, turns: turns(3000, 2, pivot, first) }
}

/// A cylinder of radius ¼ about z, met by the segment's flank: its line touches it where (p × d)² = r²·d² across z, a
/// quadratic form in the sine and cosine of φ.
fn cylinder() -> Case {
    const RADIUS: f64 = 0.25;
    const SIDES: u32 = 2048;
    let ring = |k: u32, z: f64| {
        let (s, c) = libm::sincos(TAU * f64::from(k) / f64::from(SIDES));
        narrow([RADIUS * c, RADIUS * s, z])
    };
    let points = (0..SIDES).flat_map(|k| [ring(k, -3.0), ring(k, 3.0)]).collect();
    let side = |k: u32| {
        let (a, b) = (2 * k, 2 * ((k + 1) % SIDES));
        [[a, b, b + 1], [a, b + 1, a + 1]]
    };
    let touches = |turn: &Turn, r: f64| -> Option<f64> {
        let [p, u, v] = [turn.pivot, turn.u, turn.v].map(|x| [x[0], x[1]]);
        let turned = |d: [f64; 2]| p[0] * d[1] - p[1] * d[0];
        let flat = |a: [f64; 2], b: [f64; 2]| a[0] * b[0] + a[1] * b[1];
        let (a, e) = (turned(u) * turned(u) - r * r * flat(u, u), turned(v) * turned(v) - r * r * flat(v, v));
        let b = 2.0 * (turned(u) * turned(v) - r * r * flat(u, v));
        // (a + e)/2 + (a − e)/2 · cos 2φ + b/2 · sin 2φ = 0.
        let (size, at) = (libm::hypot(a - e, b), libm::atan2(b, a - e));
        let share = -(a + e) / size;
        if share.abs() > 0.98 {
            return Some(f64::NAN);
        }
        let roots = [1.0, -1.0].into_iter().flat_map(|sign| {
            let root = 0.5 * (at + sign * libm::acos(share));
            [root.rem_euclid(TAU), (root + PI).rem_euclid(TAU)]
        });
        // Of the line beyond both ends: behind the pivot it meets nothing, beyond the tip it is none of this law's.
        let ahead = roots.filter_map(|root| {
            let d = turn.direction(root);
            let way = -flat(p, [d[0], d[1]]) / flat([d[0], d[1]], [d[0], d[1]]);
            (way > 0.0).then_some((root, way))
        });
        let (root, way) = ahead.min_by(|a, b| a.0.total_cmp(&b.0))?;
        Some(if way < 0.95 { root } else { f64::NAN })
    };
    let first = |turn: &Turn| {
        let (p, d) = (turn.pivot, turn.u);
        let size = d[0] * d[0] + d[1] * d[1];
        let ahead = -(p[0] * d[0] + p[1] * d[1]) > 0.0;
        if ahead && (p[0] * d[1] - p[1] * d[0]).abs() < (RADIUS + 0.02) * size.sqrt() {
            return None;
        }
        match [RADIUS, RADIUS * libm::cos(PI / f64::from(SIDES))].map(|r| touches(turn, r)) {
            [Some(low), Some(high)] if low.is_finite() && high.is_finite() => Some(First::At([low, high])),
            [None, None] => Some(First::Never),
            _ => None,
        }
    };
    let pivot = |key: Key| {
        let (s, c) = libm::sincos(TAU * key.of(1).f64());
        let away = 0.3 + 0.3 * key.of(2).f64();
        [away * c, away * s, key.of(3).f64() - 0.5]
    };
    let triangles = (0..SIDES).flat_map(side).collect();
    Case { points, triangles, turns: turns(6000, 3, pivot, first) }
}

/// The angle and distance at which the line from `a` to `b` passes the plane of the turn, if it does.
fn passes(turn: &Turn, a: V, b: V) -> Option<(f64, f64)> {
    let n = cross(turn.u, turn.v);
    let [above, below] = [a, b].map(|end| dot(n, along(end, turn.pivot, -1.0)));
    if above * below > 0.0 || above == below {
        return None;
    }
    let x = along(along(a, along(b, a, -1.0), above / (above - below)), turn.pivot, -1.0);
    Some((turn.angle(x), dot(x, x).sqrt()))
}

/// Blades that open by 1° away from the turn, or needles a millionth thick, one a turn, by their edge, which stands
/// across the plane of the turn and leans by up to 60°. One at a time: each turn in a mesh of its own.
fn sharp(salt: u64, needle: bool) -> [f64; 2] {
    let mut all = [0.0_f64; 2];
    for batch in 0..40 {
        let key = Key::new(salt).of(batch);
        let edge = random_unit(key);
        let aside = unit(cross(edge, random_unit(key.of(1))));
        let (s, c) = libm::sincos(0.5_f64.to_radians());
        let [a, b] = [-0.5, 0.5].map(|t| narrow(edge.map(|x| t * x)));
        let across = cross(edge, aside);
        let back = |sign: f64, base: Point| {
            let way = along(aside.map(|x| c * x), across, sign * s);
            narrow(along(wide(base), way, if needle { 1e-6 } else { 0.6 }))
        };
        let points = vec![a, b, back(1.0, a), back(1.0, b), back(-1.0, a), back(-1.0, b)];
        let triangles = vec![[0, 1, 3], [0, 3, 2], [0, 1, 5], [0, 5, 4]];
        let turn = |k: u64| {
            let key = key.of(100 + k);
            // About a pivot from which it comes against the edge.
            let n = unit(along(edge, random_unit(key), 0.8));
            let radial = unit(cross(aside, n));
            let distance = 0.1 + 0.85 * key.of(5).f64();
            let angle = 0.05 + 2.0 * key.of(6).f64();
            let met = edge.map(|x| (0.8 * key.of(7).f64() - 0.4) * x);
            let pivot = along(met, radial, -distance);
            // The direction of turning at the edge is n × radial.
            let v = cross(n, radial);
            let (s, c) = libm::sincos(angle);
            let from = along(radial.map(|x| c * x), v, -s);
            let (s, c) = libm::sincos(0.5 * key.of(8).f64());
            let to = along(radial.map(|x| c * x), v, s);
            let turn = Turn::new(pivot, from, to);
            // Blades lie behind their edge, as seen from the turn.
            if dot(v, aside) < 0.5 || turn.goal_angle < 0.04 {
                return None;
            }
            let (angle, distance) = passes(&turn, wide(a), wide(b))?;
            let thick = if needle { 2e-6 / distance } else { 0.0 };
            Some((turn, if distance < 0.97 { First::At([angle - thick, angle + thick]) } else { First::Grazes }))
        };
        let mut turns: Vec<(Turn, First)> = (0..400).filter_map(turn).collect();
        // One that stays where it is, so that not all meet something.
        let still = Turn::new([5.0, 5.0, 5.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]);
        turns.push((still, First::Never));
        let found = worst(&Case { points, triangles, turns });
        all = [all[0].max(found[0]), all[1].max(found[1])];
    }
    all
}

/// Upright needles at the crossings of a grid: the first of those within reach.
fn needles() -> Case {
    let feet: Vec<V> =
        (0..144).map(|k| [0.1 * f64::from(k % 12) - 0.55, 0.0, 0.1 * f64::from(k / 12) - 0.55]).collect();
    let tip = |foot: V| along(foot, [0.05, 1.0, -0.03], 1.0);
    let points = feet
        .iter()
        .flat_map(|foot| [narrow(*foot), narrow(tip(*foot)), narrow(along(tip(*foot), [1e-7, 0.0, 1e-7], 1.0))]);
    let points: Vec<Point> = points.collect();
    let first = |turn: &Turn| {
        let n = cross(turn.u, turn.v);
        let mut first = TAU;
        let mut doubtful = TAU;
        for foot in points.chunks(3) {
            // Its ends, by a thousandth of it, decide nothing that is asked here.
            let [low, high] = [wide(foot[0]), wide(foot[1])];
            let [above, below] = [low, high].map(|end| dot(n, along(end, turn.pivot, -1.0)));
            let share = above / (above - below);
            let x = along(along(low, along(high, low, -1.0), share), turn.pivot, -1.0);
            let (angle, distance) = (turn.angle(x), dot(x, x).sqrt());
            if (above - below).abs() < 0.02
                || share.abs() < 1e-3
                || (share - 1.0).abs() < 1e-3
                || (distance - 1.0).abs() < 1e-3
            {
                doubtful = if distance < 1.1 && share > -0.1 && share < 1.1 { doubtful.min(angle) } else { doubtful };
            } else if (0.0..1.0).contains(&share) && distance < 1.0 {
                first = first.min(angle);
            }
            if distance < 0.02 || angle > TAU - 1e-3 || angle < 1e-3 {
                return None;
            }
        }
        Some(match () {
            () if doubtful <= first => First::Grazes,
            () if first == TAU => First::Never,
            () => First::At([first - 5e-6, first + 5e-6]),
        })
    };
    let pivot = |key: Key| {
        [0, 1, 2].map(|axis| [0.5, 0.45, 0.5][axis] * (2.0 * key.of(axis as u64).f64() - 1.0) + [0.0, 0.5, 0.0][axis])
    };
    let triangles = (0..144).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
    let turns = turns(4000, 4, pivot, first);
    Case { points, triangles, turns }
}

/// Slope of log error against log steps, over 2 to 256 steps, of hairs on a sphere blown along x.
fn slope_of_steps() -> f64 {
    let mesh = icosphere(1.0, 4);
    let points: Vec<Point> = mesh.points.iter().map(|point| narrow(*point)).collect();
    let tree = TriangleTree::build(&points, &mesh.triangles());
    let obstacles = [&tree];
    let hair = |k: u64| {
        let up = random_unit(Key::new(5).of(k));
        let foot = up.map(|x| 1.001 * x);
        let ends = |way: V| [narrow(foot), narrow(along(foot, unit(way), 0.3))];
        (ends(along(up, random_unit(Key::new(6).of(k)), 0.3)), ends(along(up, [1.0, 0.0, 0.0], 3.0)))
    };
    let (rest, goal): (Vec<_>, Vec<_>) = (0..4000).map(hair).unzip();
    let starts: Vec<u32> = (0..=4000).map(|k| 2 * k).collect();
    let end = |method: Method| {
        let how = Collide {
            obstacles: &obstacles,
            skin: None,
            method,
            coherence: 0.0,
            gap: 1e-9,
            offset_root: 1e-9,
            offset_scale: None,
            at_rest: None,
            blend: Scaled { value: 1.0, mask: None },
            width: Scaled { value: 0.0, mask: None },
        };
        collide(&starts, rest.as_flattened(), goal.as_flattened(), &how).points
    };
    let exact = end(Method::Exact);
    let error = |steps: u32| {
        let apart = |(a, b): (&Point, &Point)| {
            let d = along(wide(*a), wide(*b), -1.0);
            dot(d, d).sqrt()
        };
        end(Method::Steps(steps)).iter().zip(&exact).map(apart).sum::<f64>()
    };
    // The line through (ln steps, ln error) with the least squares.
    let rows: Vec<[f64; 2]> = (1..=8).map(|k| [f64::from(k), libm::log2(error(1 << k))]).collect();
    let mean = [0, 1].map(|axis| rows.iter().map(|row| row[axis]).sum::<f64>() / rows.len() as f64);
    let product = |a: usize, b: usize| rows.iter().map(|row| (row[a] - mean[a]) * (row[b] - mean[b])).sum::<f64>();
    -product(0, 1) / product(0, 0)
}

pub(super) fn figures() -> Vec<Figure> {
    let cases = [
        ("Curve_Wind_Collision: first contact with a plane", worst(&floor())),
        ("first contact with a sphere", worst(&sphere())),
        ("first contact with a cylinder's flank", worst(&cylinder())),
        ("first contact with the edge of a blade of 1°", sharp(7, false)),
        ("first contact with a needle 1e-6 thick", sharp(8, true)),
        ("first contact with the first of 144 needles", worst(&needles())),
    ];
    let past = cases.iter().map(|(_, [_, past])| *past).fold(0.0, f64::max);
    let mut figures: Vec<Figure> =
        cases.iter().map(|(law, [error, _])| Figure::error(law, *error, 1e-4, " rad")).collect();
    figures.push(Figure::error("how far any of these goes past its first contact", past, 1e-5, " L"));
    figures.push(Figure::within(
        "`steps` comes nearer to `exact` as 1/steps, 2 to 256: slope",
        &[slope_of_steps()],
        [0.8, 1.2],
    ));
    figures
}
