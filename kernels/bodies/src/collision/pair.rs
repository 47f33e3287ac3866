//! Skins against each other and against themselves.

use super::edge;
use super::skin::Skin;
use super::swept::{self, BoxTree};
use super::vertex::{self, Moving, Rules};
use super::{REACH, Scene, Seen, in_order};
use crate::mass_spring::{Contact, Query};
use numerics::tree::Cuboid;
use numerics::vector::DVec3;

/// How surfaces of bodies touch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rub {
    /// Distance kept, metres.
    pub thickness: f64,
    /// Coulomb's μ.
    pub friction: f64,
}

/// Share of the gap below which what is that near at rest belongs together.
const JOINED: f64 = 1e-6;

/// Two skins, or one twice, on their way.
struct Pair<'a> {
    scene: &'a Scene<'a>,
    query: &'a Query<'a>,
    /// Boxes of particles on their way.
    points: &'a [Cuboid],
    skins: [&'a Skin; 2],
    /// Whether both are one.
    own: bool,
    rub: Rub,
    rules: Rules,
}

/// Which particles are around some: those with the number of the last that asked.
#[derive(Default)]
struct Marks {
    of: Vec<u32>,
    last: u32,
}

impl Marks {
    fn put(&mut self, skin: &Skin, particles: &[u32]) {
        if self.of.is_empty() || self.last == u32::MAX {
            self.of = vec![0; skin.particles()];
            self.last = 0;
        }
        self.last += 1;
        for other in particles.iter().flat_map(|particle| skin.around(*particle)) {
            self.of[*other as usize] = self.last;
        }
    }

    fn have(&self, particles: &[u32]) -> bool {
        particles.iter().any(|particle| self.of[*particle as usize] == self.last)
    }
}

/// Boxes of a skin on its way.
struct Boxes<'a> {
    faces: BoxTree<'a>,
    edges: BoxTree<'a>,
}

impl Scene<'_> {
    /// All pairs of skins, then each with itself.
    pub(super) fn pairs(&self, query: &Query<'_>, points: &[Cuboid], out: &mut Vec<Seen>) {
        let boxes = |reach: f64| -> Vec<Boxes<'_>> {
            let faces = self.skins.iter().map(|skin| skin.faces.sweep(points, reach));
            faces.zip(self.skins).map(|(faces, skin)| Boxes { faces, edges: skin.edges.sweep(points, reach) }).collect()
        };
        let pair = |skins: [usize; 2], own: bool, rub: Rub| Pair {
            scene: self,
            query,
            points,
            skins: skins.map(|skin| &self.skins[skin]),
            own,
            rub,
            rules: Rules { gap: rub.thickness, reach: REACH * rub.thickness, push: !own },
        };
        if let Some(rub) = self.between.filter(|_| self.skins.len() > 1) {
            let boxes = boxes(REACH * rub.thickness);
            for second in 1..self.skins.len() {
                for first in 0..second {
                    if swept::meet(&boxes[first].faces.bounds, &boxes[second].faces.bounds) {
                        pair([first, second], false, rub).vertices(&boxes[second], out);
                        pair([second, first], false, rub).vertices(&boxes[first], out);
                        pair([first, second], false, rub).edges(&boxes[second], out);
                    }
                }
            }
        }
        if let Some(rub) = self.own {
            for (skin, boxes) in boxes(REACH * rub.thickness).iter().enumerate() {
                let pair = pair([skin, skin], true, rub);
                pair.vertices(boxes, out);
                pair.edges(boxes, out);
            }
        }
    }
}

impl Pair<'_> {
    /// The first skin's vertices against the second's triangles.
    fn vertices(&self, boxes: &Boxes<'_>, out: &mut Vec<Seen>) {
        let ways = [self.query.from, self.query.to];
        let [first, second] = self.skins;
        let on = Moving { surface: &second.surface, poses: &ways };
        let tell = |marks: &mut Marks, vertices: &[u32], out: &mut Vec<Seen>| {
            let (mut faces, mut hits) = (Vec::new(), Vec::new());
            for vertex in vertices {
                boxes.faces.meeting(&self.points[*vertex as usize], &mut faces);
                if self.own {
                    marks.put(first, &[*vertex]);
                    faces.retain(|face| !marks.have(&first.surface.triangles[*face as usize]));
                }
                if faces.is_empty() {
                    continue;
                }
                hits.clear();
                let path = ways.map(|way| DVec3::from(way[*vertex as usize]));
                vertex::hits(&path, &on, &faces, || None, &self.rules, &mut hits);
                for hit in &hits {
                    let [a, b, c] = second.surface.triangles[hit.face as usize];
                    let [u, v, w] = hit.weights;
                    let gap = self.gap(|| first.rest_to_face(*vertex, hit.face));
                    out.extend(self.contact([*vertex, a, b, c], [1.0, -u, -v, -w], hit.normal, hit.shift, gap));
                }
            }
        };
        in_order(&first.surface.vertices, Marks::default, tell, out);
    }

    /// The first skin's edges against the second's.
    fn edges(&self, boxes: &Boxes<'_>, out: &mut Vec<Seen>) {
        let ways = [self.query.from, self.query.to];
        let [first, second] = self.skins;
        let [one, two] = [first, second].map(|skin| Moving { surface: &skin.surface, poses: &ways });
        let indices: Vec<u32> = (0..first.surface.edges.len() as u32).collect();
        let tell = |marks: &mut Marks, edges: &[u32], out: &mut Vec<Seen>| {
            let mut others = Vec::new();
            for index in edges {
                let edge = &first.surface.edges[*index as usize];
                boxes.edges.meeting(&swept::around(&edge.ends, self.points), &mut others);
                if self.own {
                    marks.put(first, &edge.ends);
                    others.retain(|other| *other > *index && !marks.have(&first.surface.edges[*other as usize].ends));
                }
                for other_index in &others {
                    let other = &second.surface.edges[*other_index as usize];
                    if let Some(hit) = edge::hit(&one, edge, &two, other, &self.rules) {
                        let [s, t] = hit.shares;
                        let ([a, b], [c, d]) = (edge.ends, other.ends);
                        let gap = self.gap(|| first.rest_between(*index, *other_index));
                        out.extend(self.contact([a, b, c, d], [1.0 - s, s, t - 1.0, -t], hit.normal, 0.0, gap));
                    }
                }
            }
        };
        in_order(&indices, Marks::default, tell, out);
    }

    /// The gap of a pair: no more than how far it is apart `at_rest`, where both are of one body.
    fn gap(&self, at_rest: impl FnOnce() -> f64) -> f64 {
        if self.own { self.rub.thickness.min(at_rest()) } else { self.rub.thickness }
    }

    fn contact(&self, particles: [u32; 4], weights: [f64; 4], normal: DVec3, shift: f64, gap: f64) -> Option<Seen> {
        if gap < JOINED * self.rub.thickness {
            return None;
        }
        let contact = Contact {
            particles,
            weights,
            normal: normal.into(),
            offset: -shift,
            gap,
            velocity: [0.0; 3],
            friction: self.rub.friction * self.scene.mask(&particles, &weights),
        };
        Some(Seen { contact, start: 0.0 })
    }
}
