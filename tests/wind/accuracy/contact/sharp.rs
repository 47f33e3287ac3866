//! Edges and needles: a turn meets them where they intersect its plane.

use super::*;

/// The angle and distance at which the line from `a` to `b` intersects the plane of the turn, if it does.
fn passes(turn: &Turn, a: DVec3, b: DVec3) -> Option<(f64, f64)> {
    let n = turn.u.cross(&turn.v);
    let [above, below] = [a, b].map(|end| n.dot(&(end - turn.pivot)));
    if above * below > 0.0 || above == below {
        return None;
    }
    let x = a + (b - a) * (above / (above - below)) - turn.pivot;
    Some((turn.angle(x), x.norm()))
}

/// Blades that open by 1° behind their edge.
pub(super) fn blades() -> [f64; 2] {
    edges(7, false)
}

/// Needles 1e-6 thick.
pub(super) fn needles() -> [f64; 2] {
    edges(8, true)
}

/// Turns against an oblique edge that crosses their plane; one mesh for each edge.
fn edges(salt: u64, needle: bool) -> [f64; 2] {
    let mut all = [0.0_f64; 2];
    for batch in 0..40 {
        let key = Key::new(salt).of(batch);
        let edge = random_unit(key);
        let aside = edge.cross(&random_unit(key.of(1))).normalize();
        let (s, c) = libm::sincos(0.5_f64.to_radians());
        let [a, b] = [-0.5, 0.5].map(|t| to_f32(edge * t));
        let across = edge.cross(&aside);
        let back = |sign: f64, base: Point| {
            let direction = aside * c + across * (sign * s);
            to_f32(to_f64(base) + direction * if needle { 1e-6 } else { 0.6 })
        };
        let points = vec![a, b, back(1.0, a), back(1.0, b), back(-1.0, a), back(-1.0, b)];
        let triangles = vec![[0, 1, 3], [0, 3, 2], [0, 1, 5], [0, 5, 4]];
        let turn = |k: u64| {
            let key = key.of(100 + k);
            // About a pivot from which it meets the edge.
            let n = (edge + random_unit(key) * 0.8).normalize();
            let radial = aside.cross(&n).normalize();
            let distance = 0.1 + 0.85 * key.of(5).f64();
            let angle = 0.05 + 2.0 * key.of(6).f64();
            let met = edge * (0.8 * key.of(7).f64() - 0.4);
            let pivot = met - radial * distance;
            // The direction of turning at the edge is n × radial.
            let v = n.cross(&radial);
            let (s, c) = libm::sincos(angle);
            let from = radial * c - v * s;
            let (s, c) = libm::sincos(0.5 * key.of(8).f64());
            let to = radial * c + v * s;
            let turn = Turn::new(pivot, from, to);
            // Blades lie behind their edge, as seen from the turn.
            if v.dot(&aside) < 0.5 || turn.goal_angle < 0.04 {
                return None;
            }
            let (angle, distance) = passes(&turn, to_f64(a), to_f64(b))?;
            let thick = if needle { 2e-6 / distance } else { 0.0 };
            Some((turn, if distance < 0.97 { First::At([angle - thick, angle + thick]) } else { First::Grazes }))
        };
        let mut turns: Vec<(Turn, First)> = (0..400).filter_map(turn).collect();
        // One that stays where it is, so that not all meet something.
        let still = Turn::new(DVec3::repeat(5.0), DVec3::y(), DVec3::x());
        turns.push((still, First::Never));
        let found = worst(&Case { points, triangles, turns });
        all = [all[0].max(found[0]), all[1].max(found[1])];
    }
    all
}

/// Upright needles at the crossings of a grid: the first of those within reach.
pub(super) fn grid() -> Case {
    let foot = |k: u32| DVec3::new(0.1 * f64::from(k % 12) - 0.55, 0.0, 0.1 * f64::from(k / 12) - 0.55);
    let needle = |k: u32| {
        let tip = foot(k) + DVec3::new(0.05, 1.0, -0.03);
        [foot(k), tip, tip + DVec3::new(1e-7, 0.0, 1e-7)].map(to_f32)
    };
    let points: Vec<Point> = (0..144).flat_map(needle).collect();
    let first = |turn: &Turn| {
        let n = turn.u.cross(&turn.v);
        let mut first = TAU;
        let mut doubtful = TAU;
        for foot in points.chunks(3) {
            let [low, high] = [to_f64(foot[0]), to_f64(foot[1])];
            let [above, below] = [low, high].map(|end| n.dot(&(end - turn.pivot)));
            let share = above / (above - below);
            let x = low + (high - low) * share - turn.pivot;
            let (angle, distance) = (turn.angle(x), x.norm());
            let at_its_end = [0.0, 1.0].iter().any(|end| (share - end).abs() < 1e-3);
            if (above - below).abs() < 0.02 || at_its_end || (distance - 1.0).abs() < 1e-3 {
                let near = distance < 1.1 && (-0.1..1.1).contains(&share);
                doubtful = if near { doubtful.min(angle) } else { doubtful };
            } else if (0.0..1.0).contains(&share) && distance < 1.0 {
                first = first.min(angle);
            }
            if distance < 0.02 || !(1e-3..TAU - 1e-3).contains(&angle) {
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
        let [x, y, z] = [0, 1, 2].map(|axis| key.of(axis).f64());
        DVec3::new(x - 0.5, 0.05 + 0.9 * y, z - 0.5)
    };
    let triangles = (0..144).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
    let turns = turns(4000, 4, pivot, first);
    Case { points, triangles, turns }
}
