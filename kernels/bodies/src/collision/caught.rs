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
use super::{CollisionScene, OverlapPartner, ReleasedElements, SkinObstaclePair, vertex};
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
        let (mut caught, released) = (Vec::new(), ReleasedElements::default());
        for obstacle in (0..self.obstacles.len()).filter(|index| self.obstacles[*index].surface.closed) {
            for (index, skin) in self.skins.iter().enumerate() {
                let mut own = Vec::new();
                self.against_obstacle(&query, (index, &released), &boxes, obstacle, &mut |meeting, tree| {
                    let (mut faces, mut path) = (Vec::new(), Vec::new());
                    for particle in &skin.touching {
                        super::path_of(meeting.body.poses, *particle, &mut path);
                        let entry = meeting.entry(*particle).or_else(|| {
                            tree.overlapping(&boxes[*particle as usize], &mut faces);
                            vertex::entered(&path, &meeting.still, &faces)
                        });
                        let (surface, end) = (meeting.still.surface, path[path.len() - 1]);
                        let back = entry.and_then(|face| vertex::way_back(surface, &meeting.still.end(), face, end));
                        let back = back.filter(|back| !self.is_below_ground(back.point));
                        own.extend(back.map(|back| CaughtParticle { obstacle, particle: *particle, face: back.face }));
                    }
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
        let own = &self.obstacles[obstacle];
        let (points, known) = (own.at(1.0), caught.len());
        for particle in &surface.vertices {
            let Some(face) = entries[part_of[*particle as usize] as usize] else { continue };
            let is_known = caught[..known].iter().any(|caught| caught.particle == *particle);
            let back = vertex::way_back(&own.surface, &Moment::of(&points), face, DVec3::from(x[*particle as usize]));
            if let Some(back) = back.filter(|back| !is_known && !self.is_below_ground(back.point)) {
                caught.push(CaughtParticle { obstacle, particle: *particle, face: back.face });
            }
        }
    }

    /// Whether a point is below the ground by more than the distance to keep.
    fn is_below_ground(&self, point: DVec3) -> bool {
        self.ground.is_some_and(|ground| DVec3::from(ground.up).dot(&point) < ground.height - ground.thickness)
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
