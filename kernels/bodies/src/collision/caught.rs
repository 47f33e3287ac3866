//! Memory of side: particles on the wrong side of a closed obstacle, and where they went in.
//!
//! Where there is no room, or too few iterations, a particle ends a frame inside an obstacle or beyond it. From positions
//! alone its side is then unknown: the closest face of a thin plate may be the wrong one, and beyond the plate the
//! particle would be kept there, so the skin stays hooked to it. The triangle through which it went in is therefore
//! kept, and moves with the obstacle: what lies there draws the particle back until it is out on that side.
//!
//! Limits: open obstacles have no wrong side; there is no way back below the ground; a body of which most particles are beyond an obstacle is left there.

use super::{CollisionScene, ReleasedElements, SkinObstaclePair, vertex};
use crate::mass_spring::ContactQuery;
use crate::tets::Enclosure;
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
        for obstacle in (0..self.obstacles.len()).filter(|index| self.obstacles[*index].is_closed()) {
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
                if 2 * self.beyond(obstacle, to, &own) <= skin.touching.len() {
                    caught.extend(own);
                }
            }
        }
        caught.sort_unstable();
        caught
    }

    /// Whether a point is below the ground by more than the distance to keep.
    fn is_below_ground(&self, point: DVec3) -> bool {
        self.ground.is_some_and(|ground| DVec3::from(ground.up).dot(&point) < ground.height - ground.thickness)
    }

    /// How many of these particles are not inside an obstacle, but have come out on another side.
    fn beyond(&self, obstacle: usize, x: &[[f64; 3]], caught: &[CaughtParticle]) -> usize {
        if caught.is_empty() {
            return 0;
        }
        let obstacle = &self.obstacles[obstacle];
        let particles: Vec<u32> = caught.iter().map(|caught| caught.particle).collect();
        let mut inside = vec![false; x.len()];
        Enclosure::new(&obstacle.at(1.0), &obstacle.surface.triangles, 0.0).mark(x, &particles, &mut inside);
        particles.iter().filter(|particle| !inside[**particle as usize]).count()
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
