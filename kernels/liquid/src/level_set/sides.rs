//! The sides of a solid, and what is thin between them.
//!
//! A solid's distance is sampled at the middles of cells, so between the two sides of a thin one it is rounded off: its
//! slope says neither which way out is, nor its value how far. Both are found by looking on either side.

use numerics::vector::{Vec3, add, cross, dot, length, perpendicular, scale, sub, unit};

use super::Distance;

/// Slope of a distance below which it does not say which way out of a solid is.
const FLAT: f32 = 0.5;

/// Second difference of the distance, over a cell to either side, from which a solid ends on both sides.
const CREASE: f32 = 0.5;

/// Height above a side at which there is a way to its edge, in cells, and the shares of that way at which it is looked at.
const HIGH: f32 = 0.5;
const WAY: [f32; 3] = [0.35, 0.7, 1.0];

/// Depth below a side at which its edge is looked for, in cells.
const BELOW: f32 = 1.0;

/// Cosine between the ways to both sides above which the solid is a wedge between them.
const STRAIGHT: f32 = -0.9;

/// The least step, in cells, in looking for the other side.
const STEP: f32 = 0.25;

/// Thickness, in cells, below which liquid on one side of a solid could reach what is on the other side: by the planes of
/// markers, by what is left as it was in its skin, and by the way of a step.
const THIN: f32 = 2.5;

/// Depth, in cells, at which a solid is looked at for whether it may be thin, and how deep it is there if not.
const LOOK: f32 = 1.5;
const THICK: f32 = 1.25;

/// 1 ÷ √2.
const ASLANT: f32 = std::f32::consts::FRAC_1_SQRT_2;

/// Cosine between the ways out of two sides below which one is behind the other.
const OPPOSITE: f32 = -0.3;

/// Difference between the ways out of both sides, in cells, up to which a place is half-way: away from edges, next to no face
/// of its cell is open.
const MIDDLE: f32 = 0.2;

/// Directions along which a thin solid is looked across: the edges and diagonals of a cube.
const ACROSS: [[i8; 3]; 13] = [
    [1, 0, 0],
    [0, 1, 0],
    [0, 0, 1],
    [1, 1, 0],
    [1, -1, 0],
    [1, 0, 1],
    [1, 0, -1],
    [0, 1, 1],
    [0, 1, -1],
    [1, 1, 1],
    [1, 1, -1],
    [1, -1, 1],
    [-1, 1, 1],
];

/// The unit vector out of a solid, whose distance `solid` is, at a place in cells; in the middle of a thin one out of either
/// side.
pub fn outward(solid: &Distance<'_>, at: Vec3) -> Option<Vec3> {
    let here = slope(solid, at);
    if dot(here, here) >= FLAT * FLAT {
        return unit(here);
    }
    let Some(across) = across(solid, at) else { return unit(here) };
    let across = if dot(across, here) < 0.0 { scale(across, -1.0) } else { across };
    unit(slope(solid, add(at, across))).or_else(|| unit(here))
}

fn slope(solid: &Distance<'_>, at: Vec3) -> Vec3 {
    [0, 1, 2].map(|axis| {
        let (mut below, mut above) = (at, at);
        (below[axis], above[axis]) = (at[axis] - 0.5, at[axis] + 0.5);
        solid(above) - solid(below)
    })
}

/// The direction in which a solid ends soonest on both sides, where it does.
#[cold]
fn across(solid: &Distance<'_>, at: Vec3) -> Option<Vec3> {
    let (here, mut most, mut best) = (solid(at), CREASE, None);
    for way in ACROSS {
        let way = way.map(f32::from);
        let way = scale(way, 1.0 / length(way));
        let rise = solid(add(at, way)) + solid(sub(at, way)) - 2.0 * here;
        if rise > most {
            (most, best) = (rise, Some(way));
        }
    }
    best
}

/// Where a place in a solid is between the side that is closer and the other one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sides {
    /// Unit, out of the closer side.
    pub(crate) normal: Vec3,
    /// How far away that side is, in cells.
    pub(crate) depth: f32,
    /// How far the other is; infinite where the solid is not thin.
    pub(crate) behind: f32,
    /// The way to it: unit.
    across: Vec3,
}

impl Sides {
    /// Those around a place in a solid whose distance there is −`depth`.
    pub(crate) fn of(solid: &Distance<'_>, at: Vec3, depth: f32) -> Option<Self> {
        let normal = outward(solid, at)?;
        let (behind, across) = behind(solid, at, depth, normal);
        if behind == f32::INFINITY {
            return Some(Self { normal, depth, behind, across });
        }
        // Between the sides of a thin solid its distance is rounded off.
        let ahead = way_out(solid, at, depth, normal).max(depth);
        Some(match ahead <= behind {
            true => Self { normal, depth: ahead, behind, across },
            false => Self { normal: scale(normal, -1.0), depth: behind, behind: ahead, across: normal },
        })
    }

    /// The same seen from the other side.
    pub(crate) fn other(&self) -> Self {
        Self { normal: scale(self.normal, -1.0), depth: self.behind, behind: self.depth, across: self.normal }
    }

    /// φ here, given how the liquid of each side goes on, that of the closer side first. Where only one side is wet, the
    /// surface is half-way, and φ the distance from there: with other values a mesh would enclose more or less as soon as
    /// φ becomes a distance.
    pub(super) fn joined(&self, [own, other]: [f32; 2]) -> f32 {
        let apart = self.behind - self.depth;
        if apart < MIDDLE {
            // Liquid on either side goes on, so that its surface is not on its own side of the solid.
            let wetter = own.min(other);
            return if own < 0.0 && other < 0.0 { wetter } else { wetter.max(-1.0) };
        }
        match (own < 0.0, other < 0.0) {
            (true, true) => own,
            (true, false) => own.max(-0.5 * apart),
            (false, _) => own.min(other.max(0.0) + 0.5 * apart),
        }
    }

    /// Whether the solid ends within `reach` along its sides, so that liquid goes from one to the other around its rim.
    pub(super) fn are_at_rim(&self, solid: &Distance<'_>, at: Vec3, reach: f32) -> bool {
        let [own, other] = [(self.normal, self.depth), (self.across, self.behind)].map(|(way, far)| scale(way, far));
        let middle = add(at, scale(add(own, other), 0.5));
        let is_around = |aside: Vec3| {
            let aside = scale(aside, reach);
            let sides = [(own, self.normal), (other, self.across)];
            solid(add(middle, aside)) > 0.0
                && sides.into_iter().all(|(side, way)| is_free_along(solid, add(at, side), way, aside))
        };
        match unit(add(self.normal, self.across)).filter(|_| dot(self.normal, self.across) > STRAIGHT) {
            Some(between) => is_around(between),
            None => asides(self.normal).into_iter().any(is_around),
        }
    }

    /// Whether liquid on one side could reach the other.
    pub(crate) fn is_thin(&self) -> bool {
        self.depth + self.behind < THIN
    }
}

/// Whether a solid ends within `reach` along the side at a place on it, out of which `normal` points.
pub(super) fn is_edge(solid: &Distance<'_>, place: Vec3, normal: Vec3, reach: f32) -> bool {
    let inside = sub(place, scale(normal, BELOW));
    asides(normal)
        .map(|aside| scale(aside, reach))
        .into_iter()
        .any(|aside| solid(add(inside, aside)) > 0.0 && is_free_along(solid, place, normal, aside))
}

/// Whether no other solid meets the side at a place on it along a way.
fn is_free_along(solid: &Distance<'_>, place: Vec3, normal: Vec3, aside: Vec3) -> bool {
    let above = add(place, scale(normal, HIGH));
    WAY.into_iter().all(|by| solid(add(above, scale(aside, by))) > 0.0)
}

/// Four directions along a side.
fn asides(normal: Vec3) -> [Vec3; 4] {
    let first = perpendicular(normal);
    let second = cross(normal, first);
    [first, scale(first, -1.0), second, scale(second, -1.0)]
}

/// Whether a solid may be thin behind a place `height` above it, or inside where that is negative. `normal`: out of it there.
pub(super) fn may_be_thin(solid: &Distance<'_>, at: Vec3, height: f32, normal: Vec3) -> bool {
    solid(sub(at, scale(normal, height.max(0.0) + LOOK))) > -THICK
}

/// A place in a solid close to its surface, and how deep it is, below one `height` above it along `normal`.
pub(crate) fn into(solid: &Distance<'_>, at: Vec3, height: f32, normal: Vec3) -> Option<(Vec3, f32)> {
    INTO.into_iter()
        .map(|further| sub(at, scale(normal, height + further)))
        .map(|inside| (inside, -solid(inside)))
        .find(|(_, depth)| *depth > 0.0)
}

/// How far it is to the side behind, straight or, where a thin solid ends at another, aslant, and the way there.
fn behind(solid: &Distance<'_>, at: Vec3, depth: f32, normal: Vec3) -> (f32, Vec3) {
    let straight = scale(normal, -1.0);
    let far = way_out(solid, at, depth, straight);
    if far < f32::INFINITY || !may_be_thin(solid, at, -depth, normal) {
        return (far, straight);
    }
    let ways = asides(normal).map(|aside| scale(add(straight, aside), ASLANT));
    let mut closest = (f32::INFINITY, straight);
    for way in ways {
        let far = way_out(solid, at, depth, way);
        // Around the edge of a thick solid is no other side.
        let is_other = || outward(solid, add(at, scale(way, far))).is_some_and(|out| dot(out, normal) < OPPOSITE);
        if far < closest.0 && is_other() {
            closest = (far, way);
        }
    }
    closest
}

/// How far it is out of a solid in a direction; infinite beyond [`THIN`].
fn way_out(solid: &Distance<'_>, at: Vec3, depth: f32, way: Vec3) -> f32 {
    let (mut gone, mut depth) = (0.0, depth);
    while gone < THIN {
        // What is closer than the surface is inside, too.
        let next = gone + depth.max(STEP);
        let there = -solid(add(at, scale(way, next)));
        if there <= 0.0 {
            return gone + (next - gone) * depth / (depth - there).max(f32::MIN_POSITIVE);
        }
        (gone, depth) = (next, there);
    }
    f32::INFINITY
}

/// How much farther than a distance says, in cells, the surface of a solid may be: a distance that is sampled at cells falls
/// more slowly towards a thin one.
const INTO: [f32; 4] = [0.1, 0.2, 0.3, 0.5];

/// Height above a side, in cells, from which a way is looked at that starts in a solid.
const CLEAR: f32 = 0.01;

/// A way that ends on a thin solid, where it slides along it.
#[derive(Clone, Copy, Debug)]
pub struct Held {
    /// In cells.
    pub way: Vec3,
    /// Unit, out of the solid.
    pub normal: Vec3,
}

/// What is left of a way from a place in cells where it would go into a thin solid; `None` where it does not.
pub(crate) fn held(solid: &Distance<'_>, from: Vec3, way: Vec3) -> Option<Held> {
    let mut held = held_by_side(solid, from, way)?;
    // Along this side it may come to others, up to a corner of three.
    let from = add(from, scale(held.normal, (CLEAR - solid(from)).max(0.0)));
    for _ in 0..2 {
        let Some(next) = held_by_side(solid, from, held.way) else { break };
        held.way = next.way;
    }
    Some(held)
}

/// The same for the first side that it comes to.
fn held_by_side(solid: &Distance<'_>, from: Vec3, way: Vec3) -> Option<Held> {
    let far = length(way);
    let (mut gone, mut height) = (0.0, solid(from));
    if height >= far {
        return None;
    }
    let mut next = 0.0;
    while height >= 0.0 {
        if gone >= far {
            return None;
        }
        next = (gone + height.max(STEP)).min(far);
        let there = solid(add(from, scale(way, next / far)));
        if there < 0.0 {
            break;
        }
        (gone, height) = (next, there);
    }
    let inside = add(from, scale(way, if far > 0.0 { next / far } else { 0.0 }));
    let below = solid(inside);
    let sides = Sides::of(solid, inside, -below).filter(Sides::is_thin)?;
    // A way that starts inside does not go deeper.
    let entry = if height < 0.0 { 0.0 } else { gone + (next - gone) * height / (height - below) };
    let share = if far > 0.0 { entry / far } else { 0.0 };
    let rest = scale(way, 1.0 - share);
    let into = dot(rest, sides.normal).min(0.0);
    Some(Held { way: sub(way, scale(sides.normal, into)), normal: sides.normal })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shape::{MeshShape, ShapeSettings, ShapeTopology};
    use numerics::shapes::grid;

    /// A sheet at a height, turned, as a collider that is thick enough.
    fn sheet(height: f32, turn: f32) -> (MeshShape, Vec3) {
        let shape = grid([60.0, 60.0], 1);
        let (sin, cos) = libm::sincosf(turn);
        let place = |[x, y, z]: [f64; 3]| {
            let [x, y, z] = [x, y, z].map(|x| x as f32);
            [10.0 + cos * x - sin * y, height + sin * x + cos * y, 10.0 + z]
        };
        let points: Vec<Vec3> = shape.points.iter().map(|p| place(*p)).collect();
        let settings = ShapeSettings { thicken: true, ..ShapeSettings::new([0; 3], [20; 3]) };
        (MeshShape::new(&ShapeTopology::new(&points, &shape.triangles()), &points, &settings), [-sin, cos, 0.0])
    }

    #[test]
    fn the_way_out_of_a_thin_solid_is_across_it() {
        for turn in [0.0, 0.3, 0.7] {
            for height in [10.0, 10.2, 10.5] {
                let (shape, normal) = sheet(height, turn);
                let solid = |p: Vec3| shape.at(p);
                for n in 0..9 {
                    let at = add([10.2, height, 10.3], scale(normal, 0.14 * (n - 4) as f32));
                    let at = [at[0], at[1] + 0.2 * libm::tanf(turn), at[2]];
                    let Some(out) = outward(&solid, at) else { panic!("{turn} {height} {n}") };
                    assert!(dot(out, normal).abs() > 0.9, "{turn} {height} {n}: {out:?}");
                    if solid(at) < 0.0 {
                        let sides = Sides::of(&solid, at, -solid(at)).unwrap();
                        assert!(sides.is_thin() && sides.depth <= sides.behind, "{turn} {height} {n}: {sides:?}");
                        assert!(sides.depth + sides.behind > 1.2, "{turn} {height} {n}: {sides:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_way_ends_on_a_thin_solid_and_goes_on_along_it() {
        for turn in [0.0, 0.3, 0.7] {
            let (shape, normal) = sheet(10.2, turn);
            let solid = |p: Vec3| shape.at(p);
            let from = add([10.2, 10.2 + 0.2 * libm::tanf(turn), 10.3], scale(normal, 2.0));
            let way = add(scale(normal, -4.0), [0.0, 0.0, 1.0]);
            let held = held(&solid, from, way).unwrap();
            let end = add(from, held.way);
            assert!(solid(end).abs() < 0.2 && dot(sub(end, from), normal) > -2.0, "{turn}: {held:?} {}", solid(end));
            assert!((held.way[2] - 1.0).abs() < 0.05, "{held:?}");
            assert!(super::held(&solid, from, [0.3, 0.0, 1.0]).is_none());
        }
    }

    #[test]
    fn a_thick_solid_has_one_side() {
        let floor = |p: Vec3| p[1] - 6.0;
        let sides = Sides::of(&floor, [1.0, 5.0, 1.0], 1.0).unwrap();
        assert!(sides.depth == 1.0 && sides.normal == [0.0, 1.0, 0.0] && !sides.is_thin());
        assert!(held(&floor, [1.0, 6.5, 1.0], [0.0, -2.0, 0.0]).is_none());
    }
}
