//! The skin of a body: its surface triangles, and which of their elements are too close at rest to count as contacts.

use super::CollisionError;
use super::closest_point::{ClosestPoint, along};
use super::obstacle::{check_points, check_triangles};
use super::surface::{Edge, Moment, NONE, TriangleSurface};
use super::swept::Elements;

/// An edge longer than this many times its rest length and the skin's mean edge is released.
const LONG: f64 = 8.0;

/// A closed surface over particles, facing outwards.
#[derive(Clone, Debug)]
pub struct BodySkin {
    pub(super) surface: TriangleSurface,
    pub(super) faces: Elements<3>,
    pub(super) edges: Elements<2>,
    rest: Vec<[f64; 3]>,
    /// Mean rest length of the edges, metres.
    mean: f64,
    /// For each surface particle, those within two links, ascending.
    starts: Vec<u32>,
    rings: Vec<u32>,
}

impl BodySkin {
    /// A skin of `triangles` over particles that are at `rest` without load; `links` are the springs of the body,
    /// which define neighbours in addition to the triangles' edges.
    ///
    /// # Errors
    /// If an index is out of range or a coordinate is not finite.
    pub fn new(rest: &[[f64; 3]], triangles: &[[u32; 3]], links: &[[u32; 2]]) -> Result<Self, CollisionError> {
        check_triangles(rest.len(), triangles)?;
        check_points(rest)?;
        if let Some(index) = links.iter().position(|ends| ends.iter().any(|end| *end as usize >= rest.len())) {
            return Err(CollisionError::Link { index, ends: links[index], count: rest.len() });
        }
        let surface = TriangleSurface::new(rest.len(), triangles);
        let (starts, rings) = rings(&surface, rest.len(), links);
        Ok(Self {
            faces: Elements::new(surface.triangles.clone(), rest),
            edges: Elements::new(surface.edges.iter().map(|edge| edge.ends).collect(), rest),
            rest: rest.to_vec(),
            mean: surface.edges.iter().map(|edge| edge_length(edge, rest)).sum::<f64>()
                / surface.edges.len().max(1) as f64,
            surface,
            starts,
            rings,
        })
    }

    /// Number of particles of the body, interior ones included.
    pub(super) fn particles(&self) -> usize {
        self.rest.len()
    }

    /// Surface particles within two links of a particle, itself included.
    pub(super) fn around(&self, particle: u32) -> &[u32] {
        &self.rings[self.starts[particle as usize] as usize..self.starts[particle as usize + 1] as usize]
    }

    /// Distance of a particle from a triangle at rest, metres.
    pub(super) fn rest_to_face(&self, particle: u32, face: u32) -> f64 {
        let at = Moment::of(&self.rest);
        ClosestPoint::on(face, at.position(particle), self.surface.corners(&at, face)).distance
    }

    /// The elements released by obstacles with particles at `x`.
    pub(super) fn released(&self, x: &[[f64; 3]]) -> ReleasedElements {
        let surface = &self.surface;
        let edges: Vec<bool> = surface.edges.iter().map(|edge| self.is_overstretched(edge, x)).collect();
        if !edges.contains(&true) {
            return ReleasedElements::default();
        }
        let (mut faces, mut particles) = (vec![false; surface.triangles.len()], vec![true; self.rest.len()]);
        for (edge, released) in surface.edges.iter().zip(&edges) {
            if *released {
                edge.faces.iter().filter(|face| **face != NONE).for_each(|face| faces[*face as usize] = true);
            } else {
                edge.ends.iter().for_each(|end| particles[*end as usize] = false);
            }
        }
        ReleasedElements { edges, faces, particles }
    }

    /// Number of edges released by obstacles with particles at `x`: those more than eight times as long as at rest
    /// and as the skin's mean edge.
    pub fn released_edges(&self, x: &[[f64; 3]]) -> usize {
        self.surface.edges.iter().filter(|edge| self.is_overstretched(edge, x)).count()
    }

    fn is_overstretched(&self, edge: &Edge, x: &[[f64; 3]]) -> bool {
        edge_length(edge, x) > LONG * edge_length(edge, &self.rest).max(self.mean)
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
    edges: Vec<bool>,
    /// Whether each triangle has a released edge.
    faces: Vec<bool>,
    /// Whether all edges of a particle are released.
    particles: Vec<bool>,
}

impl ReleasedElements {
    pub(super) fn has_edge(&self, edge: u32) -> bool {
        self.edges.get(edge as usize) == Some(&true)
    }

    pub(super) fn has_face(&self, face: u32) -> bool {
        self.faces.get(face as usize) == Some(&true)
    }

    pub(super) fn has_particle(&self, particle: u32) -> bool {
        self.particles.get(particle as usize) == Some(&true)
    }
}

fn edge_length(edge: &Edge, places: &[[f64; 3]]) -> f64 {
    let at = Moment::of(places);
    (at.position(edge.ends[0]) - at.position(edge.ends[1])).norm()
}

/// For each surface particle, the surface particles within two links of it.
fn rings(surface: &TriangleSurface, count: usize, links: &[[u32; 2]]) -> (Vec<u32>, Vec<u32>) {
    let mut pairs: Vec<[u32; 2]> = links.iter().copied().chain(surface.edges.iter().map(|edge| edge.ends)).collect();
    pairs.extend(pairs.clone().into_iter().map(|[a, b]| [b, a]));
    pairs.sort_unstable();
    pairs.dedup();
    let mut first = vec![0; count + 1];
    for pair in &pairs {
        first[pair[0] as usize + 1] += 1;
    }
    for particle in 0..count {
        first[particle + 1] += first[particle];
    }
    let near = |particle: u32| pairs[first[particle as usize]..first[particle as usize + 1]].iter().map(|pair| pair[1]);
    let mut outer = vec![false; count];
    surface.vertices.iter().for_each(|vertex| outer[*vertex as usize] = true);
    let (mut starts, mut rings) = (vec![0], Vec::new());
    for particle in 0..count as u32 {
        if outer[particle as usize] {
            let mut ring: Vec<u32> = near(particle).flat_map(|next| near(next).chain([next])).collect();
            ring.push(particle);
            ring.retain(|other| outer[*other as usize]);
            ring.sort_unstable();
            ring.dedup();
            rings.extend(ring);
        }
        starts.push(rings.len() as u32);
    }
    (starts, rings)
}
