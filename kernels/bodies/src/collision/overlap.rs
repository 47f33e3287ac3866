//! What lies inside something that should keep it out: at the start, when bodies are pushed apart, and in any result.
//!
//! A body that overlaps an obstacle or another body at the start would be held on the wrong side by contacts that keep
//! whatever is beyond a surface there. For a number of frames such a pair therefore has other contacts: each point that
//! lies inside is held below the surface that it leaves by, at a depth that falls at the same speed for all of them, so
//! that the pair comes apart evenly and without shear. The direction is the one of shortest way out among those of a
//! lattice and the one in which the common volume shrinks fastest.
//!
//! Points on the surface of a side are tested a little below it, so that surfaces that coincide count where what is
//! below them overlaps.
//!
//! Limit: bodies of which only edges cross, with no point of one inside the other, are not pushed apart;
//! [`CollisionScene::crossings`] finds them.

use super::obstacle::Obstacle;
use super::solid::Solid;
use super::surface::{Moment, TriangleSurface};
use super::{ActOnPair, Closeness, CollisionScene, ReleasedElements, Yielding};
use crate::mass_spring::{Contact, ContactFinder, ContactQuery, Weighted};
use crate::tets::{Enclosure, Exit};
use numerics::closest_point::ClosestPoint;
use numerics::swept;
use numerics::vector::DVec3;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Depth in gaps below which a point that is returned counts as touching.
const TOUCHING: f64 = 0.01;
/// Distance in gaps below their surface at which its points are tested for overlap. In a corner of a box, which is tested
/// along its diagonal, that is still deeper than a gap below each face.
pub(super) const BELOW: f64 = 2.0;
/// Share of its height above the ground by which a body is squeezed against the ground, if that is the shortest way out.
const SQUEEZED: f64 = 0.25;

/// What a body overlaps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum OverlapPartner {
    /// The ground.
    Ground,
    /// The obstacle of this index.
    Obstacle(usize),
    /// The skin of this index.
    Skin(usize),
}

/// A body and what it overlaps at the start.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Overlap {
    /// Index of the body's skin; with another skin the lower one.
    pub skin: usize,
    /// What it overlaps.
    pub partner: OverlapPartner,
    /// Unit direction in which it is pushed out.
    pub direction: [f64; 3],
    /// How far it has to go until it keeps its distance, metres.
    pub depth: f64,
}

/// How bodies that overlap or are too close are pushed apart in a frame.
#[derive(Clone, Copy, Debug, Default)]
pub struct Separation<'a> {
    /// The overlaps at the start.
    pub overlaps: &'a [Overlap],
    /// What is too close at the start.
    pub close: &'a [Closeness],
    /// By how much all contacts yield at the start and the end of the frame because the distance to keep grew, metres.
    pub grown: [f64; 2],
    /// Number of frames in which they are to come apart.
    pub frames: u32,
    /// Number of those that are over.
    pub over: u32,
    /// Length of the frame, seconds.
    pub seconds: f64,
}

/// What obstacles release as it is being pushed out of them, by the indices of the skin and of the obstacle.
type Pushed = BTreeMap<(usize, usize), ReleasedElements>;

/// Where bodies are, relative to what should keep them out.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Penetration {
    /// Number of points inside a closed obstacle or another skin.
    pub inside: usize,
    /// The largest distance to keep − signed distance of surfaces, metres; 0 if all keep their distance.
    pub deepest: f64,
}

/// One side of an overlap.
struct Side<'a> {
    of: &'a Solid<'a>,
    /// Its points, with those of the surface moved below it.
    below: Vec<[f64; 3]>,
    enclosure: Enclosure,
}

impl<'a> Side<'a> {
    /// `touching` is the depth from which points count as inside.
    fn new(of: &'a Solid<'a>, [gap, touching]: [f64; 2]) -> Self {
        let below = below(&of.points, of.surface, BELOW * gap);
        Self { of, below, enclosure: Enclosure::new(&of.points, &of.surface.triangles, touching) }
    }

    /// Which of its points are inside the other.
    fn within(&self, other: &Self) -> Vec<bool> {
        let mut inside = vec![false; self.of.points.len()];
        if other.of.surface.closed {
            other.enclosure.mark(&self.of.points, self.of.candidates, &mut inside);
            other.enclosure.mark(&self.below, self.of.candidates, &mut inside);
        }
        inside
    }

    /// How far a point was moved along a direction to be below the surface.
    fn lowered(&self, point: usize, direction: DVec3) -> f64 {
        direction.dot(&(DVec3::from(self.below[point]) - DVec3::from(self.of.points[point])))
    }

    /// Where those of its points that are inside the other, or a little below the surface are, leave it in a direction.
    fn exits(&self, other: &Self, candidates: &[u32], direction: DVec3) -> Vec<Exit> {
        let mut exits = other.enclosure.exits(&self.below, candidates, direction);
        for exit in &mut exits {
            exit.distance = (exit.distance + self.lowered(exit.point as usize, direction)).max(0.0);
        }
        // Those that are inside by less than that.
        let is_known = |point: &u32| exits.binary_search_by_key(point, |exit| exit.point).is_ok();
        let others: Vec<u32> = candidates.iter().copied().filter(|point| !is_known(point)).collect();
        exits.extend(other.enclosure.exits(&self.of.points, &others, direction));
        exits.sort_by_key(|exit| exit.point);
        exits
    }

    /// How far it has to go in a direction until no line through a point of its surface, as far as it is inside, is in
    /// the other: what is beyond a thin part of the other has to pass it, too.
    fn way_out(&self, other: &Self, direction: DVec3, gap: f64) -> f64 {
        if !(self.of.surface.closed && other.of.surface.closed) {
            return 0.0;
        }
        let vertices = &self.of.surface.vertices;
        let mut own = vec![0.0; self.of.points.len()];
        for exit in self.enclosure.exits(&self.below, vertices, direction) {
            own[exit.point as usize] = exit.distance;
        }
        let mut way = 0.0_f64;
        other.enclosure.stretches(&self.below, vertices, direction, |point, stretches| {
            let point = point as usize;
            let (mut left, own) = (0.0_f64, own[point] - BELOW * gap);
            for [enters, leaves] in stretches {
                if *enters < left + own && *leaves > left {
                    left = *leaves;
                }
            }
            if left > 0.0 {
                way = way.max(left + self.lowered(point, direction));
            }
        });
        way
    }

    /// The triangle by which a point of another side leaves it, and the barycentric weights of where.
    fn place(&self, other: &Self, exit: &Exit, direction: DVec3) -> ([u32; 3], [f64; 3]) {
        let passed = DVec3::from(other.of.points[exit.point as usize]) + direction * exit.distance;
        let corners = self.of.surface.corners(&Moment::of(&self.of.points), exit.face);
        (self.of.surface.triangles[exit.face as usize], ClosestPoint::on(exit.face, passed, corners).weights)
    }

    /// Sum of the area vectors of its triangles that are inside, given which of its points are.
    fn area_within(&self, inside: &[bool]) -> DVec3 {
        let at = Moment::of(&self.of.points);
        let faces = self.of.surface.triangles.iter().zip(0..);
        let faces = faces.filter(|(corners, _)| corners.iter().all(|corner| inside[*corner as usize]));
        faces.map(|(_, face)| self.of.surface.corners(&at, face)).map(|[a, b, c]| (b - a).cross(&(c - a))).sum()
    }
}

impl CollisionScene<'_> {
    /// The overlaps at the start of the frame, with particles at `x`, and the number of particles that lie inside a
    /// closed obstacle, inside another skin, or below the ground: deeper than the distance to keep, so that touching
    /// does not count. Obstacles that are open or face inwards have no inside.
    pub fn overlaps(&self, x: &[[f64; 3]]) -> (Vec<Overlap>, usize) {
        let (mut found, mut inside) = (Vec::new(), vec![false; x.len()]);
        let boxes = swept::swept_boxes(&[x]);
        let solids = self.solids(x, &boxes, 0.0);
        for (skin, own) in solids[0].iter().enumerate() {
            self.below_ground(skin, x, &mut found, &mut inside);
            for other in self.partners(&solids, skin) {
                let is_skin = matches!(other.is, OverlapPartner::Skin(_));
                if !(is_skin || other.surface.closed) {
                    continue;
                }
                let sides = [own, other].map(|of| Side::new(of, [other.gap; 2]));
                let room = if is_skin { None } else { self.room(own, x) };
                let marked = add_overlap((skin, other), [&sides[0], &sides[1]], room, &mut found);
                for marked in &marked[..1 + usize::from(is_skin)] {
                    inside.iter_mut().zip(marked).for_each(|(all, own)| *all |= own);
                }
            }
        }
        (found, inside.iter().filter(|inside| **inside).count())
    }

    /// Indices of obstacles that are rooms and have points of bodies outside them at the start of the frame: farther out
    /// than the distance to keep.
    pub fn rooms_beside(&self, x: &[[f64; 3]]) -> Vec<usize> {
        let points: Vec<[f64; 3]> = self.skins.iter().flat_map(|skin| &skin.touching).map(|p| x[*p as usize]).collect();
        let is_beside = |obstacle: &Obstacle| {
            let turned: Vec<[u32; 3]> = obstacle.surface.triangles.iter().map(|[a, b, c]| [*a, *c, *b]).collect();
            let room = Enclosure::new(&obstacle.at(0.0), &turned, 0.0);
            let mut inside = vec![false; points.len()];
            let steps = (0..3).flat_map(|axis| [-obstacle.thickness, obstacle.thickness].map(|by| (axis, by)));
            for (axis, by) in std::iter::once((0, 0.0)).chain(steps) {
                let mut beside = points.clone();
                beside.iter_mut().for_each(|point| point[axis] += by);
                let left = (0..points.len() as u32).filter(|point| !inside[*point as usize]).collect::<Vec<_>>();
                room.mark(&beside, &left, &mut inside);
            }
            inside.contains(&false)
        };
        (0..self.obstacles.len()).filter(|k| self.obstacles[*k].is_room() && is_beside(&self.obstacles[*k])).collect()
    }

    /// The upward direction of the ground, and how far a skin may be pushed down towards it.
    fn room(&self, skin: &Solid<'_>, x: &[[f64; 3]]) -> Option<(DVec3, f64)> {
        let ground = self.ground?;
        let up = DVec3::from(ground.up);
        let heights = skin.candidates.iter().map(|point| up.dot(&DVec3::from(x[*point as usize])) - ground.height);
        Some((up, SQUEEZED * heights.fold(0.0, f64::max)))
    }

    fn below_ground(&self, skin: usize, x: &[[f64; 3]], found: &mut Vec<Overlap>, inside: &mut [bool]) {
        let Some(ground) = self.ground else { return };
        let mut deepest = 0.0_f64;
        for particle in &self.skins[skin].touching {
            let depth = ground.height - DVec3::from(x[*particle as usize]).dot(&DVec3::from(ground.up));
            inside[*particle as usize] |= depth > ground.thickness;
            deepest = deepest.max(depth);
        }
        if deepest > ground.thickness && deepest.is_finite() {
            let depth = deepest + ground.thickness;
            found.push(Overlap { skin, partner: OverlapPartner::Ground, direction: ground.up, depth });
        }
    }

    /// The overlaps that are being pushed apart.
    fn separated(&self) -> &[Overlap] {
        let separation = self.separation.filter(|separation| separation.over < separation.frames);
        separation.map_or(&[], |separation| separation.overlaps)
    }

    /// That of a skin and a partner.
    pub(super) fn separating(&self, skin: usize, partner: OverlapPartner) -> Option<&Overlap> {
        self.separated().iter().find(|overlap| overlap.skin == skin && overlap.partner == partner)
    }

    /// How contacts yield at the end of the query for a point that has this `depth` below its gap at the start.
    pub(super) fn allowed(&self, overlap: &Overlap, depth: f64, times: [f64; 2]) -> Yielding {
        let Some(separation) = self.separation else { return Yielding::default() };
        let (whole, passed) = (f64::from(separation.frames), times[1] - times[0]);
        let left = whole - f64::from(separation.over) - times[0];
        let even = depth - overlap.depth * passed / whole;
        let allowed = even.min(depth * (1.0 - passed / left)).max(0.0);
        Yielding::falling([depth, allowed], separation.seconds * passed)
    }

    /// Contacts without friction of the pairs that are being pushed apart; returns what is pushed out of obstacles.
    pub(super) fn separate(&self, query: &ContactQuery<'_>, act: &mut ActOnPair<'_>) -> Pushed {
        let mut pushed = Pushed::new();
        if self.separated().is_empty() {
            return pushed;
        }
        let boxes = swept::swept_boxes(&[query.from]);
        let [skins, obstacles] = self.solids(query.from, &boxes, query.times[0]);
        for overlap in self.separated() {
            let (other, obstacle) = match overlap.partner {
                OverlapPartner::Obstacle(index) => (&obstacles[index], Some(&self.obstacles[index])),
                OverlapPartner::Skin(index) if self.body_contact.is_some() => (&skins[index], None),
                OverlapPartner::Ground | OverlapPartner::Skin(_) => continue,
            };
            let (gap, direction) = (other.gap, DVec3::from(overlap.direction));
            let end = obstacle.map(|obstacle| obstacle.at(query.times[1]));
            let [first, other] = [&skins[overlap.skin], other].map(|of| Side::new(of, [gap, 0.0]));
            let (mut contacts, mut particles) = (Vec::new(), vec![false; query.from.len()]);
            for (own, [inner, outer], normal) in
                [(true, [&first, &other], direction), (false, [&other, &first], -direction)]
            {
                for exit in inner.exits(outer, inner.of.candidates, normal) {
                    let (corners, shares) = outer.place(inner, &exit, normal);
                    let sides: [Weighted<'_>; 2] = [(&[exit.point], &[1.0]), (&corners, &shares)];
                    let contact = match obstacle.zip(end.as_ref()) {
                        None => Contact::between(sides, normal, gap),
                        Some((obstacle, end)) => {
                            let [body, (points, shares)] = if own { sides } else { [sides[1], sides[0]] };
                            Contact {
                                offset: direction.dot(&Moment::of(end).weighted(points, shares)),
                                velocity: obstacle.velocity_of(query.times[1], points, shares).into(),
                                ..Contact::between([body, (&[], &[])], direction, gap)
                            }
                        }
                    };
                    contacts.push(self.allowed(overlap, exit.distance + gap, query.times).of(contact));
                    if own {
                        particles[exit.point as usize] = true;
                    }
                }
            }
            act(overlap.skin, Some(overlap.partner), contacts);
            if let OverlapPartner::Obstacle(index) = overlap.partner {
                pushed.insert((overlap.skin, index), ReleasedElements { particles, ..Default::default() });
            }
        }
        pushed
    }

    /// Where contact points at `x` are at the end of the frame.
    pub fn penetration(&self, x: &[[f64; 3]]) -> Penetration {
        let scene = CollisionScene { separation: None, ..*self };
        let mut contacts = Vec::new();
        scene.find(&ContactQuery { from: x, to: x, times: [1.0; 2] }, &mut contacts);
        let depths = contacts.iter().map(|contact| contact.depth(x));
        let mut found = Penetration { inside: 0, deepest: depths.fold(0.0, f64::max) };
        if let Some(ground) = self.ground {
            let points = self.skins.iter().flat_map(|skin| &skin.touching).map(|point| x[*point as usize]);
            let heights = points.map(|p| DVec3::from(p).dot(&DVec3::from(ground.up)) - ground.height);
            found.deepest = heights.fold(found.deepest, |deepest, height| deepest.max(ground.thickness - height));
        }
        let boxes = swept::swept_boxes(&[x]);
        let solids = self.solids(x, &boxes, 1.0);
        let [skins, obstacles] = &solids;
        let skins_in_contact = if self.body_contact.is_some() { &skins[..] } else { &[] };
        let mut inside = vec![false; x.len()];
        for solid in obstacles.iter().chain(skins_in_contact).filter(|solid| solid.surface.closed) {
            let others = skins.iter().filter(|skin| skin.is != solid.is && swept::overlap(&skin.bounds, &solid.bounds));
            let near = others.flat_map(|skin| skin.candidates).copied();
            let near: Vec<u32> = near.filter(|point| swept::overlap(&boxes[*point as usize], &solid.bounds)).collect();
            if near.is_empty() {
                continue;
            }
            // Points outside are left to contacts, which know how near they are.
            let within = Enclosure::new(&solid.points, &solid.surface.triangles, 0.0).within(x, near);
            let from: Vec<_> = within.iter().map(|point| x[*point as usize]).collect();
            for (point, distance) in within.iter().zip(solid.distances(&from)) {
                let Some(distance) = distance else { continue };
                inside[*point as usize] |= distance > TOUCHING * solid.gap;
                found.deepest = found.deepest.max(solid.gap + distance);
            }
        }
        let pierced = self.deepest_piercing(&solids);
        let gap = solids.iter().flatten().map(|solid| solid.gap).fold(0.0, f64::max);
        if pierced > TOUCHING * gap {
            found.deepest = found.deepest.max(gap + pierced);
        }
        found.inside = inside.iter().filter(|inside| **inside).count();
        found
    }
}

/// Adds the overlap of a skin, by index, with another solid, if there is one; returns which points of both are inside the
/// other. `ground` is its upward direction, and how far the first side may be pushed down.
fn add_overlap(
    (skin, solid): (usize, &Solid<'_>),
    [side, other]: [&Side<'_>; 2],
    ground: Option<(DVec3, f64)>,
    found: &mut Vec<Overlap>,
) -> [Vec<bool>; 2] {
    let (gap, inside) = (solid.gap, [side.within(other), other.within(side)]);
    let [own, others] = [(side, &inside[0]), (other, &inside[1])].map(|(side, inside)| {
        let all = side.of.candidates.iter().copied().filter(|point| inside[*point as usize]);
        all.collect::<Vec<u32>>()
    });
    if own.is_empty() && others.is_empty() {
        return inside;
    }
    let shrinks = other.area_within(&inside[1]) - side.area_within(&inside[0]);
    let lattice = (0..27).filter(|k| *k != 13).map(|k| {
        let axis = |k: i32| f64::from(k % 3 - 1);
        DVec3::new(axis(k), axis(k / 3), axis(k / 9))
    });
    let directions = std::iter::once(shrinks).chain(lattice).filter_map(|direction| direction.try_normalize(0.0));
    let is_allowed = |direction: DVec3, depth: f64| {
        ground.is_none_or(|(up, room)| direction.dot(&up) > -1e-9 || -direction.dot(&up) * depth <= room)
    };
    let (mut depth, mut shortest) = (f64::INFINITY, None);
    for direction in directions {
        let (out, past) = (side.exits(other, &own, direction), other.exits(side, &others, -direction));
        let points = out.iter().chain(&past).map(|exit| exit.distance).fold(0.0, f64::max);
        if points < depth && is_allowed(direction, points + gap) {
            let lines = side.way_out(other, direction, gap).max(other.way_out(side, -direction, gap));
            if points.max(lines) < depth && is_allowed(direction, points.max(lines) + gap) {
                (depth, shortest) = (points.max(lines), Some(direction));
            }
        }
    }
    if let Some(direction) = shortest {
        found.push(Overlap { skin, partner: solid.is, direction: direction.into(), depth: depth + gap });
    }
    inside
}

/// Points, with those of a surface moved below it by a distance.
pub(super) fn below(points: &[[f64; 3]], surface: &TriangleSurface, distance: f64) -> Vec<[f64; 3]> {
    let (at, mut below) = (Moment::of(points), points.to_vec());
    let mut is_moved = vec![false; points.len()];
    for (corners, face) in surface.triangles.iter().zip(0..) {
        for (k, corner) in corners.iter().enumerate() {
            if std::mem::replace(&mut is_moved[*corner as usize], true) {
                continue;
            }
            let point = at.position(*corner);
            let weights = std::array::from_fn(|other| if other == k { 1.0 } else { 0.0 });
            let outward = surface.outward(&at, &ClosestPoint { face, weights, point, distance: 0.0 });
            below[*corner as usize] = (point - outward.try_normalize(0.0).unwrap_or_default() * distance).into();
        }
    }
    below
}
