//! Contact between bodies, and of a body with itself.

use super::body_skin::BodySkin;
use super::edge;
use super::vertex::{self, ContactRules, MovingSurface};
use super::{CollisionScene, OverlapPartner, REACH, Yielding, collect_in_order};
use crate::mass_spring::{Contact, ContactQuery};
use numerics::swept::{self, SweptBoxTree};
use numerics::tree::Cuboid;
use numerics::vector::DVec3;

/// Contact parameters of body surfaces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactParams {
    /// Distance to keep, metres.
    pub thickness: f64,
    /// Coulomb's friction coefficient μ.
    pub friction: f64,
}

/// Elements nearer than this fraction of the gap at rest are considered joined.
const JOINED: f64 = 1e-6;

/// Two moving skins, or one with itself.
struct Pair<'a> {
    scene: &'a CollisionScene<'a>,
    query: &'a ContactQuery<'a>,
    /// Swept boxes of the particles.
    points: &'a [Cuboid],
    skins: [&'a BodySkin; 2],
    /// Whether both skins are the same.
    self_contact: bool,
    params: ContactParams,
    rules: ContactRules,
    yielding: Yielding,
}

/// Marks the neighbourhood of some points, by the number of the query that marked them last.
#[derive(Default)]
struct Marks {
    of: Vec<u32>,
    last: u32,
}

impl Marks {
    fn put(&mut self, skin: &BodySkin, particles: &[u32]) {
        if self.of.is_empty() || self.last == u32::MAX {
            self.of = vec![0; skin.len()];
            self.last = 0;
        }
        self.last += 1;
        for other in particles.iter().flat_map(|particle| skin.around(*particle)) {
            self.of[*other as usize] = self.last;
        }
    }

    fn have(&self, skin: &BodySkin, points: &[u32]) -> bool {
        let marked = |point: &u32| self.of[*point as usize] == self.last;
        points
            .iter()
            .any(|point| if skin.rides(*point) { skin.around(*point).iter().any(marked) } else { marked(point) })
    }
}

/// Swept boxes of a skin.
struct Boxes<'a> {
    /// Bounds of all its particles.
    bounds: Cuboid,
    faces: SweptBoxTree<'a>,
    edges: SweptBoxTree<'a>,
}

impl CollisionScene<'_> {
    /// All pairs of skins, then each skin with itself.
    pub(super) fn pairs(&self, query: &ContactQuery<'_>, points: &[Cuboid], out: &mut Vec<Contact>) {
        let boxes = |reach: f64| -> Vec<Boxes<'_>> {
            let of = self.skins.iter().map(|skin| Boxes {
                bounds: swept::inflated(&swept::bounds_of_finite(&skin.touching, points), reach),
                faces: skin.faces.sweep(points, reach),
                edges: skin.edges.sweep(points, reach),
            });
            of.collect()
        };
        let pair = |skins: [usize; 2], self_contact: bool, params: ContactParams| Pair {
            scene: self,
            query,
            points,
            skins: skins.map(|skin| &self.skins[skin]),
            self_contact,
            params,
            rules: ContactRules { gap: params.thickness, reach: REACH * params.thickness, push: !self_contact },
            yielding: self.yielding(
                skins[0].min(skins[1]),
                (!self_contact).then(|| OverlapPartner::Skin(skins[0].max(skins[1]))),
                query.times,
            ),
        };
        if let Some(params) = self.body_contact.filter(|_| self.skins.len() > 1) {
            let boxes = boxes(REACH * params.thickness);
            for second in 1..self.skins.len() {
                for first in 0..second {
                    let meet = swept::overlap(&boxes[first].bounds, &boxes[second].bounds);
                    if meet && self.separating(first, OverlapPartner::Skin(second)).is_none() {
                        pair([first, second], false, params).particles(&boxes[second], out);
                        pair([second, first], false, params).particles(&boxes[first], out);
                        pair([first, second], false, params).edges(&boxes[second], out);
                    }
                }
            }
        }
        if let Some(params) = self.self_contact {
            for (skin, boxes) in boxes(REACH * params.thickness).iter().enumerate() {
                let pair = pair([skin, skin], true, params);
                pair.particles(boxes, out);
                pair.edges(boxes, out);
            }
        }
    }
}

impl Pair<'_> {
    /// Particles of the first skin against triangles of the second; of the same skin only those of its surface.
    fn particles(&self, boxes: &Boxes<'_>, out: &mut Vec<Contact>) {
        let poses = [self.query.from, self.query.to];
        let [first, second] = self.skins;
        let on = MovingSurface { surface: &second.surface, poses: &poses };
        let find_in = |marks: &mut Marks, particles: &[u32], out: &mut Vec<Contact>| {
            let mut faces = Vec::new();
            for particle in particles {
                boxes.faces.overlapping(&self.points[*particle as usize], &mut faces);
                if self.self_contact {
                    marks.put(first, &[*particle]);
                    faces.retain(|face| !marks.have(first, &first.surface.triangles[*face as usize]));
                }
                if faces.is_empty() {
                    continue;
                }
                let path = poses.map(|pose| DVec3::from(pose[*particle as usize]));
                for hit in vertex::hits(&path, &on, (&faces, None), &|| None, &self.rules) {
                    let [a, b, c] = second.surface.triangles[hit.face as usize];
                    let [u, v, w] = hit.weights;
                    let gap = self.gap(|| first.rest_to_face(*particle, hit.face));
                    out.extend(self.contact([*particle, a, b, c], [1.0, -u, -v, -w], hit.normal, hit.shift, gap));
                }
            }
        };
        let particles = if self.self_contact { &first.surface.vertices } else { &first.touching };
        collect_in_order(particles, &find_in, out);
    }

    /// Edges of the first skin against those of the second.
    fn edges(&self, boxes: &Boxes<'_>, out: &mut Vec<Contact>) {
        let poses = [self.query.from, self.query.to];
        let [first, second] = self.skins;
        let [one, two] = [first, second].map(|skin| MovingSurface { surface: &skin.surface, poses: &poses });
        let indices: Vec<u32> = (0..first.surface.edges.len() as u32).collect();
        let find_in = |marks: &mut Marks, edges: &[u32], out: &mut Vec<Contact>| {
            let mut others = Vec::new();
            for index in edges {
                let edge = &first.surface.edges[*index as usize];
                boxes.edges.overlapping(&swept::bounds_of(&edge.ends, self.points), &mut others);
                if self.self_contact {
                    marks.put(first, &edge.ends);
                    others.retain(|other| {
                        *other > *index && !marks.have(first, &first.surface.edges[*other as usize].ends)
                    });
                }
                for other_index in &others {
                    let other = &second.surface.edges[*other_index as usize];
                    if let Some(hit) = edge::hit([&one, &two], [edge, other], &self.rules) {
                        let [s, t] = hit.shares;
                        let ([a, b], [c, d]) = (edge.ends, other.ends);
                        let gap = self.gap(|| first.rest_between(*index, *other_index));
                        out.extend(self.contact([a, b, c, d], [1.0 - s, s, t - 1.0, -t], hit.normal, 0.0, gap));
                    }
                }
            }
        };
        collect_in_order(&indices, &find_in, out);
    }

    /// The gap of a pair; for elements of the same skin at most their distance at rest.
    fn gap(&self, at_rest: impl FnOnce() -> f64) -> f64 {
        if self.self_contact { self.params.thickness.min(at_rest()) } else { self.params.thickness }
    }

    fn contact(&self, points: [u32; 4], weights: [f64; 4], normal: DVec3, shift: f64, gap: f64) -> Option<Contact> {
        if gap < JOINED * self.params.thickness {
            return None;
        }
        Some(self.yielding.of(Contact {
            points,
            weights,
            normal: normal.into(),
            offset: -shift,
            gap,
            velocity: [0.0; 3],
            friction: self.params.friction * self.scene.friction_scale(&points, &weights),
            jammed: false,
            open: false,
        }))
    }
}
