//! Contact between bodies, and of a body with itself.

use super::body_skin::BodySkin;
use super::edge;
use super::vertex::{self, ContactRules, MovingSurface};
use super::{ActOnPair, Buffers, CollisionScene, OverlapPartner, REACH, Yielding, collect_in_order};
use crate::mass_spring::{Contact, ContactQuery, Weighted};
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

/// Drops those of `others` that have a point near the `points` of an element, by links of the skin. What is near these is marked
/// with the `index` of the element.
fn drop_neighbours<'a>(
    skin: &BodySkin,
    (index, points): (u32, &[u32]),
    (others, marks): &mut Buffers,
    points_of: impl Fn(u32) -> &'a [u32],
) {
    marks.resize(skin.rest.len(), 0);
    points.iter().flat_map(|point| skin.around(*point)).for_each(|near| marks[*near as usize] = index + 1);
    let is_marked = |point: &u32| marks[*point as usize] == index + 1;
    let is_near =
        |point: &u32| if skin.rides(*point) { skin.around(*point).iter().any(is_marked) } else { is_marked(point) };
    others.retain(|other| !points_of(*other).iter().any(is_near));
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
    pub(super) fn pairs(&self, query: &ContactQuery<'_>, points: &[Cuboid], act: &mut ActOnPair<'_>) {
        let boxes = |reach: f64| -> Vec<Boxes<'_>> {
            let of = self.skins.iter().map(|skin| Boxes {
                bounds: swept::inflated(&swept::bounds_of_finite(&skin.touching, points), reach),
                faces: skin.surface.swept.sweep(points, reach),
                edges: skin.edges.sweep(points, reach),
            });
            of.collect()
        };
        let pair = |[first, second]: [usize; 2], params: ContactParams| {
            let self_contact = first == second;
            let partner = (!self_contact).then_some(OverlapPartner::Skin(first.max(second)));
            Pair {
                scene: self,
                query,
                points,
                skins: [first, second].map(|skin| &self.skins[skin]),
                self_contact,
                params,
                rules: ContactRules { gap: params.thickness, reach: REACH * params.thickness, push: !self_contact },
                yielding: self.yielding(first.min(second), partner, query.times),
            }
        };
        if let Some(params) = self.body_contact.filter(|_| self.skins.len() > 1) {
            let boxes = boxes(REACH * params.thickness);
            for second in 1..self.skins.len() {
                for first in 0..second {
                    let meet = swept::overlap(&boxes[first].bounds, &boxes[second].bounds);
                    let partner = OverlapPartner::Skin(second);
                    if meet && self.separating(first, partner).is_none() {
                        let mut contacts = Vec::new();
                        pair([first, second], params).particles(&boxes[second], &mut contacts);
                        pair([second, first], params).particles(&boxes[first], &mut contacts);
                        pair([first, second], params).edges(&boxes[second], &mut contacts);
                        act(first, Some(partner), contacts);
                    }
                }
            }
        }
        if let Some(params) = self.self_contact {
            for (skin, boxes) in boxes(REACH * params.thickness).iter().enumerate() {
                let (pair, mut contacts) = (pair([skin, skin], params), Vec::new());
                pair.particles(boxes, &mut contacts);
                pair.edges(boxes, &mut contacts);
                act(skin, None, contacts);
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
        let particles = if self.self_contact { &first.surface.vertices } else { &first.touching };
        collect_in_order(particles, out, |particle, buffers, out| {
            boxes.faces.overlapping(&self.points[particle as usize], &mut buffers.0);
            if self.self_contact {
                let corners = |face: u32| &first.surface.triangles[face as usize][..];
                drop_neighbours(first, (particle, &[particle]), buffers, corners);
            }
            let faces = &buffers.0;
            if faces.is_empty() {
                return;
            }
            let path = poses.map(|pose| DVec3::from(pose[particle as usize]));
            for hit in vertex::hits(&path, &on, (faces, None), &|| None, &self.rules) {
                let corners = &second.surface.triangles[hit.face as usize];
                let sides = [(&[particle][..], &[1.0][..]), (corners, &hit.weights)];
                out.extend(self.contact(sides, hit.normal, hit.shift, || first.rest_to_face(particle, hit.face)));
            }
        });
    }

    /// Edges of the first skin against those of the second.
    fn edges(&self, boxes: &Boxes<'_>, out: &mut Vec<Contact>) {
        let poses = [self.query.from, self.query.to];
        let [first, second] = self.skins;
        let [one, two] = [first, second].map(|skin| MovingSurface { surface: &skin.surface, poses: &poses });
        let indices: Vec<u32> = (0..first.surface.edges.len() as u32).collect();
        collect_in_order(&indices, out, |index, buffers, out| {
            let edge = &first.surface.edges[index as usize];
            boxes.edges.overlapping(&swept::bounds_of(&edge.ends, self.points), &mut buffers.0);
            if self.self_contact {
                buffers.0.retain(|other| *other > index);
                drop_neighbours(first, (index, &edge.ends), buffers, |other| &first.surface.edges[other as usize].ends);
            }
            for at in &buffers.0 {
                let other = &second.surface.edges[*at as usize];
                if let Some(hit) = edge::hit([&one, &two], [edge, other], &self.rules) {
                    let sides = [(&edge.ends[..], &hit.weights[0][..]), (&other.ends, &hit.weights[1])];
                    out.extend(self.contact(sides, hit.normal, 0.0, || first.rest_between(index, *at)));
                }
            }
        });
    }

    /// The contact of two elements, if they are of the same skin with a gap that is at most their distance `at_rest`.
    fn contact(
        &self,
        sides: [Weighted<'_>; 2],
        normal: DVec3,
        shift: f64,
        at_rest: impl FnOnce() -> f64,
    ) -> Option<Contact> {
        let ContactParams { thickness, friction } = self.params;
        let gap = if self.self_contact { thickness.min(at_rest()) } else { thickness };
        if gap < JOINED * thickness {
            return None;
        }
        let contact = Contact::between(sides, normal, gap);
        let friction = friction * self.scene.friction_scale(&contact);
        Some(self.yielding.of(Contact { offset: -shift, friction, ..contact }))
    }
}
