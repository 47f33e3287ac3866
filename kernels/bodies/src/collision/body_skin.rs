//! The skin of a body: its surface triangles, and which of their elements are too close at rest to count as contacts.

use super::obstacle::{check_points, check_triangles, narrow};
use super::surface::{Edge, Lists, Moment, NONE, TriangleSurface};
use super::{CaughtParticle, CollisionError};
use crate::embedding::{EmbeddedPoint, with_riding};
use crate::tets::SolidAngles;
use numerics::closest_point::{ClosestPoint, along};
use numerics::swept::SweptElements;
use numerics::vector::DVec3;
use std::collections::VecDeque;

/// An edge longer than this many times its rest length and the skin's mean edge is released.
const LONG: f64 = 8.0;

/// Winding number from which a particle is inside a surface that rides along, which may be open or cross itself.
const INSIDE: f64 = 0.5;

/// A surface over particles, closed and facing outwards, or over points that ride along on them.
#[derive(Clone, Debug)]
pub struct BodySkin {
    pub(super) surface: TriangleSurface,
    pub(super) edges: SweptElements<2>,
    pub(super) rest: Vec<[f64; 3]>,
    /// Mean rest length of the edges, metres.
    mean: f64,
    /// Contact points that meet the ground, obstacles and other skins, ascending: those of the surface and the particles
    /// within.
    pub(super) touching: Vec<u32>,
    /// Number of particles of the body, which other contact points ride along on.
    particles: usize,
    /// For each particle of the surface, those within two links, ascending; for each point that rides along, what it rides on.
    rings: Lists,
}

impl BodySkin {
    /// A skin of `triangles` over particles that are at `rest` without load; `links` are the springs of the body,
    /// which define neighbours in addition to the triangles' edges.
    ///
    /// # Errors
    /// If an index is out of range or a coordinate is not finite.
    pub fn new(rest: &[[f64; 3]], triangles: &[[u32; 3]], links: &[[u32; 2]]) -> Result<Self, CollisionError> {
        Self::several(rest, &[], &[triangles], links).map(|mut skins| skins.swap_remove(0))
    }

    /// Skins of several bodies, which `links` may join. Corners of surfaces are contact points: particles, of which there
    /// are as many as in `rest`, and after them the points that are `riding` along on these. A surface is over the ones or
    /// the others. An inner particle belongs to the first skin from which a walk along links reaches it, if it is inside
    /// what rides along.
    ///
    /// # Errors
    /// As [`BodySkin::new`].
    pub fn several(
        rest: &[[f64; 3]],
        riding: &[EmbeddedPoint],
        surfaces: &[&[[u32; 3]]],
        links: &[[u32; 2]],
    ) -> Result<Vec<Self>, CollisionError> {
        let particles = rest.len();
        if let Some(index) = links.iter().position(|ends| ends.iter().any(|end| *end as usize >= particles)) {
            return Err(CollisionError::Link(index, links[index], particles));
        }
        let rest = &with_riding(rest.to_vec(), riding);
        surfaces.iter().try_for_each(|triangles| check_triangles(rest.len(), triangles))?;
        check_points(rest)?;
        let surfaces: Vec<_> = surfaces
            .iter()
            .map(|triangles| {
                let surface = TriangleSurface::new(rest, triangles);
                let turn =
                    surface.closed && triangles[0][0] as usize >= particles && signed_volume(triangles, rest) < 0.0;
                let turned = || triangles.iter().map(|[a, b, c]| [*a, *c, *b]).collect::<Vec<_>>();
                if turn { TriangleSurface::new(rest, &turned()) } else { surface }
            })
            .collect();
        let edges = surfaces.iter().flat_map(|surface| &surface.edges).map(|edge| edge.ends);
        let carried = (particles as u32..).zip(riding);
        let carried = carried.flat_map(|(point, carrier)| carrier.sides().map(move |(particle, _)| [point, particle]));
        // The particles that share a link or an edge with each particle, or that it rides on.
        let pairs = links.iter().copied().chain(edges).chain(carried).flat_map(|[a, b]| [[a, b], [b, a]]);
        let neighbours = Lists::new(rest.len(), pairs.collect());
        let touching = touching(&surfaces, &neighbours, rest, particles);
        let skin = |(surface, touching): (TriangleSurface, Vec<u32>)| Self {
            particles,
            edges: SweptElements::new(surface.edges.iter().map(|edge| edge.ends).collect(), rest),
            rest: rest.to_vec(),
            mean: surface.edges.iter().map(|edge| edge_length(edge, rest)).sum::<f64>()
                / surface.edges.len().max(1) as f64,
            rings: rings(&surface, &neighbours, rest.len(), particles),
            surface,
            touching,
        };
        Ok(surfaces.into_iter().zip(touching).map(skin).collect())
    }

    /// The contact points that meet the ground, obstacles and other skins, ascending: those of the surface and the
    /// particles within.
    pub fn points(&self) -> &[u32] {
        &self.touching
    }

    /// The volume that a surface that rides along encloses with contact points at `x`, relative to that at rest; `None` if it
    /// does not ride, is open, or encloses nothing.
    pub fn carried_volume_ratio(&self, x: &[[f64; 3]]) -> Option<f64> {
        let surface = &self.surface;
        let rides = surface.vertices.first().is_some_and(|vertex| self.rides(*vertex));
        let is_closed = surface.edges.iter().all(|edge| edge.faces.iter().all(|face| *face != NONE));
        let volume = |x: &[[f64; 3]]| signed_volume(&surface.triangles, x);
        let rest = (rides && is_closed).then(|| volume(&self.rest)).filter(|rest| *rest != 0.0)?;
        Some(volume(x) / rest)
    }

    /// Whether a contact point rides along on particles.
    pub(super) fn rides(&self, point: u32) -> bool {
        point as usize >= self.particles
    }

    /// Surface particles within two links of one of them, itself included; the particles that a riding point rides on.
    pub(super) fn around(&self, particle: u32) -> &[u32] {
        self.rings.of(particle)
    }

    /// Distance of a particle from a triangle at rest, metres.
    pub(super) fn rest_to_face(&self, particle: u32, face: u32) -> f64 {
        let at = Moment::of(&self.rest);
        ClosestPoint::on(face, at.position(particle), self.surface.corners(&at, face)).distance
    }

    /// The elements released by obstacles with particles at `x`.
    pub(super) fn released(&self, x: &[[f64; 3]]) -> ReleasedElements {
        let surface = &self.surface;
        let is_long = |edge: &Edge| edge_length(edge, x) > LONG * edge_length(edge, &self.rest).max(self.mean);
        let edges: Vec<bool> = surface.edges.iter().map(is_long).collect();
        if !edges.contains(&true) {
            return ReleasedElements::default();
        }
        let (mut faces, mut particles) = (vec![false; surface.triangles.len()], vec![false; self.rest.len()]);
        surface.vertices.iter().for_each(|vertex| particles[*vertex as usize] = true);
        for (edge, released) in surface.edges.iter().zip(&edges) {
            if *released {
                edge.faces.iter().filter(|face| **face != NONE).for_each(|face| faces[*face as usize] = true);
            } else {
                edge.ends.iter().for_each(|end| particles[*end as usize] = false);
            }
        }
        ReleasedElements { edges, faces, particles }
    }

    /// These released elements, and the edges and triangles of particles on the wrong side of an obstacle, which would
    /// keep them there.
    pub(super) fn releasing(&self, released: &ReleasedElements, caught: &[CaughtParticle]) -> ReleasedElements {
        let mut all = released.clone();
        if caught.is_empty() {
            return all;
        }
        let surface = &self.surface;
        all.edges.resize(surface.edges.len(), false);
        all.faces.resize(surface.triangles.len(), false);
        let is_caught = |end: &u32| caught.binary_search_by_key(end, |caught| caught.particle).is_ok();
        for (released, edge) in all.edges.iter_mut().zip(&surface.edges) {
            *released |= edge.ends.iter().any(is_caught);
        }
        for (released, corners) in all.faces.iter_mut().zip(&surface.triangles) {
            *released |= corners.iter().any(is_caught);
        }
        all
    }

    /// Number of edges released by obstacles with particles at `x`: those more than eight times as long as at rest
    /// and as the skin's mean edge.
    pub fn released_edges(&self, x: &[[f64; 3]]) -> usize {
        self.released(x).edges.iter().filter(|released| **released).count()
    }

    /// Distance of two edges at rest, metres.
    pub(super) fn rest_between(&self, edge: u32, other: u32) -> f64 {
        let at = Moment::of(&self.rest);
        let [[p, q], [a, b]] =
            [edge, other].map(|edge| self.surface.edges[edge as usize].ends.map(|end| at.position(end)));
        let [s, t] = along([p, q], [a, b]);
        (p.lerp(&q, s) - a.lerp(&b, t)).norm()
    }
}

/// Elements of a skin that obstacles have released, because they are overstretched. A collider that snags the skin
/// would stretch it without limit, since contacts keep it on the side it came from.
#[derive(Clone, Debug, Default)]
pub(super) struct ReleasedElements {
    /// Whether each edge is released; empty if none is.
    pub(super) edges: Vec<bool>,
    /// Whether each triangle has a released edge.
    pub(super) faces: Vec<bool>,
    /// Whether all edges of a surface particle are released.
    pub(super) particles: Vec<bool>,
}

/// Whether an element is released, according to a list that is empty if none is.
pub(super) fn has(released: &[bool], element: u32) -> bool {
    released.get(element as usize) == Some(&true)
}

fn edge_length(edge: &Edge, places: &[[f64; 3]]) -> f64 {
    let at = Moment::of(places);
    (at.position(edge.ends[0]) - at.position(edge.ends[1])).norm()
}

/// Six times the volume that triangles enclose; relative to a point of theirs, so that far from the origin nothing is lost.
pub(super) fn signed_volume(triangles: &[[u32; 3]], places: &[[f64; 3]]) -> f64 {
    let origin = DVec3::from(places[triangles[0][0] as usize]);
    let corners = |face: &[u32; 3]| face.map(|corner| DVec3::from(places[corner as usize]) - origin);
    triangles.iter().map(corners).map(|[a, b, c]| a.dot(&b.cross(&c))).sum()
}

/// The points of each surface and the particles within, ascending: a walk from all surfaces at once gives each particle
/// to the first that reaches it. Particles outside what rides along on them touch nothing.
fn touching(surfaces: &[TriangleSurface], neighbours: &Lists, rest: &[[f64; 3]], particles: usize) -> Vec<Vec<u32>> {
    let mut skin_of = vec![NONE; rest.len()];
    let mut queue = VecDeque::new();
    for (skin, surface) in (0..).zip(surfaces) {
        queue.extend(surface.vertices.iter().map(|vertex| (*vertex, skin)));
    }
    while let Some((particle, skin)) = queue.pop_front() {
        if skin_of[particle as usize] == NONE {
            skin_of[particle as usize] = skin;
            queue.extend(neighbours.of(particle).iter().map(|other| (*other, skin)));
        }
    }
    let mut touching = vec![Vec::new(); surfaces.len()];
    for (point, skin) in (0..).zip(skin_of).filter(|(_, skin)| *skin != NONE) {
        touching[skin as usize].push(point);
    }
    for (surface, touching) in surfaces.iter().zip(&mut touching).filter(|_| particles < rest.len()) {
        let rides = surface.vertices.first().is_some_and(|first| *first as usize >= particles);
        let solid = rides.then(|| SolidAngles::new(&narrow(rest), &surface.triangles));
        let is_inside = |point: u32| {
            let winding = solid.as_ref().map_or(1.0, |solid| solid.winding(rest[point as usize].into()));
            (point as usize) < particles && winding >= INSIDE
        };
        touching.retain(|point| surface.vertices.binary_search(point).is_ok() || is_inside(*point));
    }
    touching
}

/// For each surface particle, the surface particles within two links of it; for each point that rides along, the particles
/// that it rides on.
fn rings(surface: &TriangleSurface, neighbours: &Lists, count: usize, particles: usize) -> Lists {
    let mut outer = vec![false; count];
    surface.vertices.iter().for_each(|vertex| outer[*vertex as usize] = true);
    let mut rings = Vec::new();
    for particle in 0..count as u32 {
        let next = neighbours.of(particle);
        if particle as usize >= particles {
            rings.extend(next.iter().filter(|other| (**other as usize) < particles).map(|other| [particle, *other]));
        } else if outer[particle as usize] {
            let near = next.iter().flat_map(|next| neighbours.of(*next)).chain(next).chain([&particle]);
            let mut ring: Vec<u32> = near.copied().filter(|other| outer[*other as usize]).collect();
            ring.sort_unstable();
            ring.dedup();
            rings.extend(ring.into_iter().map(|other| [particle, other]));
        }
    }
    Lists::new(count, rings)
}
