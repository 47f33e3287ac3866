//! Memory of side: particles on the wrong side of a closed obstacle, and where they went in.
//!
//! Where there is no room, or too few iterations, a particle ends a frame inside an obstacle or beyond it. From positions
//! alone its side is then unknown: the closest face of a thin plate may be the wrong one, and beyond the plate the
//! particle would be kept there, so the skin stays hooked to it. The triangle through which it went in is therefore
//! kept, and moves with the obstacle: what lies there draws the particle back until it is out on that side.
//!
//! Skin that was squeezed around the rim of a plate went in nowhere. It is on the wrong side where all its edges to the larger
//! part of the skin go through the obstacle, and went in where one of them does.
//!
//! Limits: open obstacles have no wrong side; there is no way back below the ground; a body of which most particles are beyond an obstacle is left there.

use super::surface::Moment;
use super::{CollisionScene, Ground, OverlapPartner, SkinObstaclePair, vertex};
use crate::mass_spring::ContactQuery;
use crate::tets::Enclosure;
use numerics::pieces::pieces;
use numerics::swept;
use numerics::vector::DVec3;
use serde::{Deserialize, Serialize};

/// A particle on the wrong side of an obstacle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct CaughtParticle {
    /// Index of the obstacle.
    pub obstacle: usize,
    /// The particle.
    pub particle: u32,
    /// The triangle of the obstacle through which it went in.
    pub face: u32,
}

impl CollisionScene<'_> {
    /// The particles on the wrong side of obstacles after a frame in which particles moved from `from` to `to`: those
    /// that were before and have not come back, and those that went in.
    pub fn caught_after(&self, from: &[[f64; 3]], to: &[[f64; 3]]) -> Vec<CaughtParticle> {
        let query = ContactQuery { from, to, times: [0.0, 1.0] };
        let boxes = swept::swept_boxes(&[from, to]);
        let mut caught = Vec::new();
        for obstacle in (0..self.obstacles.len()).filter(|index| self.obstacles[*index].surface.closed) {
            for (index, skin) in self.skins.iter().enumerate() {
                let mut own = Vec::new();
                self.against_obstacle(&query, index, &boxes, obstacle, &mut |meeting, tree| {
                    let (mut faces, end) = (Vec::new(), meeting.still.end());
                    own.extend(skin.touching.iter().filter_map(|particle| {
                        let path = meeting.body.path(*particle);
                        let entry = meeting.entry(*particle).or_else(|| {
                            tree.overlapping(&boxes[*particle as usize], &mut faces);
                            vertex::entered(&path, &meeting.still, &faces)
                        });
                        self.still_caught(&end, to, CaughtParticle { obstacle, particle: *particle, face: entry? })
                    }));
                });
                self.add_severed((index, obstacle), to, &mut own);
                if !own.is_empty() && 2 * self.beyond(obstacle, to, &own) <= skin.touching.len() {
                    caught.extend(own);
                }
            }
        }
        caught.sort_unstable();
        caught
    }

    /// Adds the particles on the surface of a skin whose edges to its largest part all go through an obstacle: this part is
    /// on the right side.
    fn add_severed(&self, (skin_index, obstacle): (usize, usize), x: &[[f64; 3]], caught: &mut Vec<CaughtParticle>) {
        // What is being pushed out passes through meanwhile.
        if self.separating(skin_index, OverlapPartner::Obstacle(obstacle)).is_some() {
            return;
        }
        let cut = self.cut_edges(skin_index, obstacle, x);
        if cut.is_empty() {
            return;
        }
        let surface = &self.skins[skin_index].surface;
        let mut is_cut = vec![false; surface.edges.len()];
        cut.iter().for_each(|(edge, _)| is_cut[*edge] = true);
        let whole = surface.edges.iter().zip(&is_cut).filter(|(_, cut)| !**cut).map(|(edge, _)| edge.ends);
        let part_of = pieces(x.len(), whole);
        let mut sizes = vec![0_usize; x.len()];
        surface.vertices.iter().for_each(|vertex| sizes[part_of[*vertex as usize] as usize] += 1);
        let Some(largest) = (0..x.len()).rev().max_by_key(|part| sizes[*part]) else { return };
        // The triangle through which each part went in.
        let mut entries: Vec<Option<u32>> = vec![None; x.len()];
        for (edge, first) in &cut {
            let [a, b] = surface.edges[*edge].ends.map(|end| part_of[end as usize] as usize);
            for (own, other, face) in [(a, b, first[1]), (b, a, first[0])] {
                if own != largest && other == largest {
                    entries[own].get_or_insert(face);
                }
            }
        }
        let known: Vec<u32> = caught.iter().map(|caught| caught.particle).collect();
        let points = self.obstacles[obstacle].at(1.0);
        caught.extend(surface.vertices.iter().filter_map(|particle| {
            let face = entries[part_of[*particle as usize] as usize].filter(|_| !known.contains(particle))?;
            self.still_caught(&Moment::of(&points), x, CaughtParticle { obstacle, particle: *particle, face })
        }));
    }

    /// A particle that was caught, and now is at `x`: with the triangle that draws it back, if it is not out again on that side
    /// and there is a way back.
    fn still_caught(&self, at: &Moment<'_>, x: &[[f64; 3]], caught: CaughtParticle) -> Option<CaughtParticle> {
        let CaughtParticle { obstacle, particle, face } = caught;
        let back = vertex::way_back(&self.obstacles[obstacle].surface, at, face, x[particle as usize].into())?;
        let is_below = |ground: &Ground| DVec3::from(ground.up).dot(&back.point) < ground.height - ground.thickness;
        let is_free = !self.ground.as_ref().is_some_and(is_below);
        is_free.then_some(CaughtParticle { face: back.face, ..caught })
    }

    /// How many of these particles are not inside an obstacle, but have come out on another side.
    fn beyond(&self, obstacle: usize, x: &[[f64; 3]], caught: &[CaughtParticle]) -> usize {
        let obstacle = &self.obstacles[obstacle];
        let particles = caught.iter().map(|caught| caught.particle).collect();
        let solid = Enclosure::new(&obstacle.at(1.0), &obstacle.surface.triangles, 0.0);
        caught.len() - solid.within(x, particles).len()
    }

    /// Those of an obstacle, by particle.
    pub(super) fn caught_by(&self, obstacle: usize) -> &[CaughtParticle] {
        let first = self.caught.partition_point(|caught| caught.obstacle < obstacle);
        let count = self.caught[first..].partition_point(|caught| caught.obstacle == obstacle);
        &self.caught[first..first + count]
    }
}

impl SkinObstaclePair<'_> {
    /// The triangle of the obstacle through which a particle on the wrong side went in.
    pub(super) fn entry(&self, particle: u32) -> Option<u32> {
        let index = self.caught.binary_search_by_key(&particle, |caught| caught.particle).ok()?;
        Some(self.caught[index].face)
    }
}
