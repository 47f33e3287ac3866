//! Which particles of skins lie inside something that should keep them out.

use super::CollisionScene;
use crate::tets::{Enclosure, bounds};
use numerics::vector::DVec3;

impl CollisionScene<'_> {
    /// Number of particles of the skins that lie inside a closed obstacle, inside another skin, or below the ground at
    /// the start of the frame, with particles at `x`: deeper than the distance to keep, so that touching does not count.
    /// Obstacles that are open or face inwards have no inside.
    pub fn count_inside(&self, x: &[[f64; 3]]) -> usize {
        let mut inside = vec![false; x.len()];
        let skins: Vec<&[u32]> = self.skins.iter().map(|skin| &skin.touching[..]).collect();
        if let Some(ground) = self.ground {
            for particle in skins.iter().copied().flatten() {
                let height = DVec3::from(x[*particle as usize]).dot(&DVec3::from(ground.up)) - ground.height;
                inside[*particle as usize] |= height < -ground.thickness;
            }
        }
        for obstacle in self.obstacles.iter().filter(|obstacle| obstacle.is_closed()) {
            let solid = Enclosure::new(&obstacle.at(0.0), &obstacle.surface.triangles, obstacle.thickness);
            skins.iter().for_each(|particles| solid.mark(x, particles, &mut inside));
        }
        if let Some(contact) = self.body_contact {
            let boxes: Vec<[[f64; 3]; 2]> =
                skins.iter().map(|particles| bounds(particles.iter().map(|particle| x[*particle as usize]))).collect();
            for (own, skin) in self.skins.iter().enumerate().filter(|(_, skin)| skin.surface.closed) {
                let mut solid = None;
                let others = (0..skins.len()).filter(|other| *other != own && overlap(&boxes[own], &boxes[*other]));
                for other in others {
                    let solid =
                        solid.get_or_insert_with(|| Enclosure::new(x, &skin.surface.triangles, contact.thickness));
                    solid.mark(x, skins[other], &mut inside);
                }
            }
        }
        inside.iter().filter(|inside| **inside).count()
    }
}

fn overlap([low, high]: &[[f64; 3]; 2], [other_low, other_high]: &[[f64; 3]; 2]) -> bool {
    (0..3).all(|axis| low[axis] <= other_high[axis] && other_low[axis] <= high[axis])
}
