//! A moving point against the triangles of a moving surface: crossings and proximity.
//!
//! The side that the point came from decides. A closed surface can only be entered from outside; an open one has
//! two sides. After the first crossing only that triangle counts; other triangles are judged at that time.

use super::surface::{Moment, Positions, TriangleSurface};
use numerics::closest_point::ClosestPoint;
use numerics::coplanarity::{MotionSeparation, face_separation, sign_changes};
use numerics::vector::DVec3;

/// Distance from a triangle's plane at which a point lies on it, relative to the lengths involved: above rounding.
pub(super) const ON: f64 = 1e-9;
/// Largest distance by which a point that starts inside is pushed out, in gaps.
const PUSH: f64 = 10.0;

/// A moving surface: poses at some times, with linear motion between them.
#[derive(Clone, Copy)]
pub(super) struct MovingSurface<'a> {
    pub(super) surface: &'a TriangleSurface,
    pub(super) poses: &'a [Positions<'a>],
}

impl<'a> MovingSurface<'a> {
    pub(super) fn start(&self) -> Moment<'a> {
        Moment::of(self.poses[0])
    }

    pub(super) fn end(&self) -> Moment<'a> {
        Moment::of(self.poses[self.poses.len() - 1])
    }

    /// Positions of a point in all poses.
    pub(super) fn path(&self, point: u32) -> Vec<DVec3> {
        self.poses.iter().map(|pose| DVec3::from(pose[point as usize])).collect()
    }

    /// Positions at a time that counts poses.
    pub(super) fn moment(&self, time: f64) -> Moment<'a> {
        let piece = (time as usize).min(self.poses.len() - 2);
        Moment { from: self.poses[piece], to: self.poses[piece + 1], share: time - piece as f64 }
    }
}

/// Which distances and sides count.
#[derive(Clone, Copy)]
pub(super) struct ContactRules {
    /// Distance to keep.
    pub(super) gap: f64,
    /// Distance at which elements count as close.
    pub(super) reach: f64,
    /// Whether points that start inside are pushed out through the closest triangle.
    pub(super) push: bool,
}

/// A point and a triangle that may be in contact.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hit {
    pub(super) face: u32,
    /// Barycentric weights in the triangle.
    pub(super) weights: [f64; 3],
    /// Unit normal from the triangle to the point, at the end of the motion.
    pub(super) normal: DVec3,
    /// Depth below the triangle's plane that is still allowed at the end of the motion, for a point that starts inside
    /// and is pushed out gradually.
    pub(super) shift: f64,
    /// Distance at the end.
    clearance: f64,
}

/// The first of `faces` through which a point on `path` enters a closed surface.
pub(super) fn entered(path: &[DVec3], on: &MovingSurface<'_>, faces: &[u32]) -> Option<u32> {
    let crossed = faces.iter().filter_map(|face| match crossing(path, on, *face, 0.0) {
        Approach::Crosses(time, _) => Some((time, *face)),
        _ => None,
    });
    crossed.reduce(|best, next| if next.0 < best.0 { next } else { best }).map(|(_, face)| face)
}

/// The point of a surface that keeps `point` out, for one that went in through `face`; `None` once it is out again on
/// that side.
pub(super) fn way_back(surface: &TriangleSurface, at: &Moment<'_>, face: u32, point: DVec3) -> Option<ClosestPoint> {
    let nearest = surface.walk_to(at, face, point).0;
    is_behind(surface, at, &nearest, point).then_some(nearest)
}

/// The contacts of a point on `path`, which has a position for each pose, with `faces`, ascending.
/// `closest_at_start` finds the closest triangle at the start, for a point that may start inside and has no triangle
/// close to it. A point that went in through the triangle `entry` in an earlier step is kept out by what lies there.
pub(super) fn hits(
    path: &[DVec3],
    on: &MovingSurface<'_>,
    (faces, entry): (&[u32], Option<u32>),
    closest_at_start: &dyn Fn() -> Option<ClosestPoint>,
    rules: &ContactRules,
) -> Vec<Hit> {
    let (surface, end) = (on.surface, path[path.len() - 1]);
    let plane = |face: u32, side: f64, shift: f64| {
        let (nearest, normal) = surface.walk_to(&on.end(), face, end);
        let normal = normal.or_else(|| surface.normal(&on.start(), face))? * side;
        let clearance = normal.dot(&(end - nearest.point)) + shift;
        Some(Hit { face: nearest.face, weights: nearest.weights, normal, shift, clearance })
    };
    if let Some(back) = entry.and_then(|face| way_back(surface, &on.start(), face, path[0])) {
        return Vec::from_iter(plane(back.face, 1.0, (back.distance - PUSH * rules.gap).max(0.0)));
    }
    let mut met = (path.len() - 1) as f64;
    let mut through: Vec<(u32, f64)> = Vec::new();
    let mut near: Vec<u32> = Vec::new();
    for face in faces {
        match crossing(path, on, *face, rules.reach) {
            Approach::Far => continue,
            Approach::Near => {}
            Approach::Crosses(time, above) => {
                through.push((*face, if above { 1.0 } else { -1.0 }));
                met = met.min(time);
            }
        }
        near.push(*face);
    }
    if surface.closed && rules.push {
        let start = on.start();
        let nearest = surface.nearest(&start, near.iter().copied(), path[0]);
        let nearest = nearest.filter(|nearest| nearest.distance <= rules.reach).or_else(closest_at_start);
        if let Some(nearest) = nearest.filter(|nearest| is_behind(surface, &start, nearest, path[0])) {
            return Vec::from_iter(plane(nearest.face, 1.0, (nearest.distance - PUSH * rules.gap).max(0.0)));
        }
    }
    let mut found: Vec<Hit> = through.iter().filter_map(|(face, side)| plane(*face, *side, 0.0)).collect();
    let at = on.moment(met);
    let here = point_at(path, met);
    for face in &near {
        let nearest = ClosestPoint::on(*face, here, surface.corners(&at, *face));
        // The triangle it crosses at that time already is a contact.
        let least = if !through.is_empty() { 1e-6 * rules.reach } else { 0.0 };
        if nearest.distance <= rules.reach && nearest.distance >= least {
            found.extend(close(on, &at, nearest, here, end));
        }
    }
    if found.is_empty() {
        found.extend(passed_closely(path, on, &near, rules.reach));
    }
    merged(found)
}

/// The contact of a point that came close to some of the triangles `near` in between without crossing any: with the
/// closest of them at the end of the motion.
fn passed_closely(path: &[DVec3], on: &MovingSurface<'_>, near: &[u32], reach: f64) -> Option<Hit> {
    let (surface, end) = (on.surface, path[path.len() - 1]);
    let passed = near.iter().filter(|face| approaches(path, on, **face, reach));
    let nearest = surface.nearest(&on.end(), passed.copied(), end)?;
    if surface.closed && is_behind(surface, &on.end(), &nearest, end) {
        return None;
    }
    let normal = (end - nearest.point).try_normalize(0.0).or_else(|| surface.normal(&on.end(), nearest.face))?;
    Some(Hit { face: nearest.face, weights: nearest.weights, normal, shift: 0.0, clearance: nearest.distance })
}

fn point_at(path: &[DVec3], time: f64) -> DVec3 {
    let piece = (time as usize).min(path.len() - 2);
    path[piece].lerp(&path[piece + 1], time - piece as f64)
}

/// Whether a point is inside a closed surface, given its closest point there.
fn is_behind(surface: &TriangleSurface, at: &Moment<'_>, nearest: &ClosestPoint, point: DVec3) -> bool {
    surface.outward(at, nearest).dot(&(point - nearest.point)) < 0.0
}

/// Behaviour of a point relative to a triangle during the motion.
enum Approach {
    /// Stays away.
    Far,
    /// May come close.
    Near,
    /// Crosses it, first at this time, and whether from above; for closed surfaces only inwards.
    Crosses(f64, bool),
}

fn crossing(path: &[DVec3], on: &MovingSurface<'_>, face: u32, reach: f64) -> Approach {
    let [a, b, c] = on.surface.triangles[face as usize];
    let configuration = |pose: usize| {
        let at = |point: u32| DVec3::from(on.poses[pose][point as usize]);
        let origin = at(a);
        [at(b) - origin, at(c) - origin, path[pose] - origin]
    };
    let mut far = true;
    let mut start = configuration(0);
    for piece in 0..path.len() - 1 {
        let end = configuration(piece + 1);
        let apart = face_separation(&start, &end, reach);
        far &= apart == MotionSeparation::Far;
        if apart == MotionSeparation::Unknown {
            for (t, above) in sign_changes(&start, &end).iter().filter(|root| root.1 || !on.surface.closed) {
                let [b, c, p] = [0, 1, 2].map(|k| start[k].lerp(&end[k], t));
                let size = b.norm().max(c.norm()).max(start[2].norm()).max(end[2].norm());
                if ClosestPoint::on(face, p, [DVec3::zeros(), b, c]).distance <= ON * size {
                    return Approach::Crosses(piece as f64 + t, above);
                }
            }
        }
        start = end;
    }
    if far { Approach::Far } else { Approach::Near }
}

/// The contact of a point at `here` with a triangle close to it, if no adjacent triangle is closer; given for the end
/// of the motion.
fn close(on: &MovingSurface<'_>, at: &Moment<'_>, nearest: ClosestPoint, here: DVec3, end: DVec3) -> Option<Hit> {
    let (surface, last) = (on.surface, &on.end());
    let away = here - nearest.point;
    if (surface.closed && is_behind(surface, at, &nearest, here)) || !surface.is_nearest_around(at, &nearest, &away) {
        return None;
    }
    let face = nearest.face;
    let frame = |at: &Moment<'_>| {
        let [a, b, _] = surface.corners(at, face);
        let normal = surface.normal(at, face)?;
        let along = (b - a).try_normalize(0.0)?;
        Some([along, normal.cross(&along), normal])
    };
    let normal = match (away.try_normalize(0.0), frame(at), frame(last)) {
        (Some(away), Some(then), Some(now)) => {
            (0..3).map(|k| now[k] * then[k].dot(&away)).sum::<DVec3>().try_normalize(0.0)?
        }
        (Some(away), _, _) => away,
        (None, Some(_), Some(now)) => now[2],
        _ => return None,
    };
    let corners = surface.corners(last, face);
    let point: DVec3 = (0..3).map(|k| corners[k] * nearest.weights[k]).sum();
    Some(Hit { face, weights: nearest.weights, normal, shift: 0.0, clearance: normal.dot(&(end - point)) })
}

/// Whether the point comes closer than `reach` to a triangle, by conservative advancement: steps as long as the
/// remaining distance at the top speed allows.
fn approaches(path: &[DVec3], on: &MovingSurface<'_>, face: u32, reach: f64) -> bool {
    /// Largest number of steps in an interval; undecided cases count as close.
    const MOST: usize = 64;
    for piece in 0..path.len() - 1 {
        let corners = |pose: usize| on.surface.corners(&Moment::of(on.poses[pose]), face);
        let (from, to) = (corners(piece), corners(piece + 1));
        let displacement = path[piece + 1] - path[piece];
        let speed = (0..3).map(|k| (displacement - (to[k] - from[k])).norm()).fold(0.0, f64::max);
        let (mut time, mut decided) = (0.0, false);
        for _ in 0..MOST {
            let p = path[piece].lerp(&path[piece + 1], time);
            let distance = ClosestPoint::on(face, p, [0, 1, 2].map(|k| from[k].lerp(&to[k], time))).distance;
            if distance <= reach * (1.0 + 1e-6) {
                return true;
            }
            time += (distance - reach) / speed;
            // Without relative motion the time is infinite.
            if time > 1.0 || time.is_nan() {
                decided = true;
                break;
            }
        }
        if !decided {
            return true;
        }
    }
    false
}

/// The deepest of contacts with similar normals, and only a few in all, ordered by triangle.
fn merged(mut hits: Vec<Hit>) -> Vec<Hit> {
    /// Cosine of the angle within which normals are similar.
    const SAME: f64 = 0.99;
    /// Largest number of contacts of a point with one surface.
    const MOST: usize = 4;
    hits.sort_by(|a, b| a.clearance.total_cmp(&b.clearance).then(a.face.cmp(&b.face)));
    let mut kept: Vec<Hit> = Vec::new();
    for hit in hits {
        if kept.len() < MOST && kept.iter().all(|other| other.normal.dot(&hit.normal) < SAME) {
            kept.push(hit);
        }
    }
    kept.sort_by_key(|hit| hit.face);
    kept
}
