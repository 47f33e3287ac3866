//! Continuity in the cells next to the liquid, which are partly liquid (Harlow and Welch 1965, surface cells).

use crate::rows::{CellRows, Finder};
use crate::step::domain::{Domain, Obstacle};
use crate::step::motion::{Motion, hold_walls};
use crate::velocity::{FaceFields, FaceMask, Site};

impl Motion {
    /// A velocity continued to `rows`, in which as much flows into the cells next to the liquid as out of them: what is missing
    /// comes through their faces where the velocity is not known, at most `most`, m/s, through each. A surface that moved
    /// with what is only continued lost volume wherever liquid spreads or folds.
    pub(super) fn balanced(
        &self,
        velocity: &FaceFields<f32>,
        rows: &CellRows,
        domain: &Domain,
        solid: Option<Obstacle<'_>>,
        most: f32,
    ) -> FaceFields<f32> {
        let images = domain.periods().images(rows);
        let mut known: Vec<FaceMask> = rows.resampled(self.rows(), &self.known, 0);
        images.fill(&mut known);
        // What is to come in through each such face of a cell, m/s.
        let [missing] = rows.tabulate_with(
            || Finder::new(rows),
            |finder, cell, at| {
                let above = [0, 1, 2].map(|axis| {
                    let mut above = cell;
                    above[axis] += 1;
                    finder.find(above)
                });
                let [Some(x), Some(y), Some(z)] = above else { return [0.0] };
                let pairs = [x, y, z].into_iter().enumerate();
                let count = pairs
                    .clone()
                    .fold(0, |sum, (axis, above)| sum + (known[at] >> axis & 1) + (known[above] >> axis & 1));
                let is_beside = (1..6).contains(&count) && domain.contains(cell);
                if !is_beside || solid.is_some_and(|solid| solid.distance(Site::Centre.of(cell)) < 0.0) {
                    return [0.0];
                }
                let outflow = pairs.fold(0.0, |sum, (axis, above)| sum + velocity[axis][above] - velocity[axis][at]);
                [(outflow / f32::from(6 - count)).clamp(-most, most)]
            },
        );
        let mut faces = rows.tabulate_with(
            || Finder::new(rows),
            |finder, cell, at| {
                [0, 1, 2].map(|axis| {
                    let own = velocity[axis][at];
                    if known[at] >> axis & 1 == 1 {
                        return own;
                    }
                    let mut below = cell;
                    below[axis] -= 1;
                    own + missing[at] - finder.find(below).map_or(0.0, |below| missing[below])
                })
            },
        );
        hold_walls(domain, rows, &mut faces);
        images.fill_each(&mut faces);
        faces
    }
}

#[cfg(test)]
mod tests {
    use numerics::trig;
    use numerics::vector::{Vec3, length};

    use super::*;
    use crate::marked::MarkedSurface;
    use crate::step::{Liquid, LiquidSettings, Surroundings};
    use crate::velocity::Slopes;

    /// A ball in a flow that bends: what cells next to it, whose faces are not all known, lose in a second, m/s a cell.
    #[test]
    fn cells_next_to_the_liquid_lose_nothing() {
        let domain = Domain::closed([0; 3], [24; 3]);
        let ball = |p: Vec3| length([p[0] - 12.2, p[1] - 11.9, p[2] - 12.1]) - 6.3;
        let around = Surroundings::new(&|_| [0.0; 3], &|_| 0.0);
        let mut liquid = Liquid::new(LiquidSettings::new(domain, 1.0), MarkedSurface::new(domain, 1, ball, 0, 1));
        liquid.set_velocity(
            |[x, y, _]| {
                let ((sx, cx), (sy, cy)) = (trig::sin_cos(0.5 * x), trig::sin_cos(0.5 * y));
                [sx * cy, -cx * sy, 0.0]
            },
            &around,
        );
        let motion = liquid.motion();
        let rows = motion.rows_past_liquid(&domain, 4);
        let nearest = Slopes::nearest(1.0);
        let [continued] = motion.continued([motion.velocity().faces()], &rows, ([nearest], 3), &domain, None);
        let balanced = motion.balanced(&continued, &rows, &domain, None, 1.0);
        let lost = |faces: &FaceFields<f32>| {
            let mut sum = 0.0;
            for (at, cell) in rows.iter().enumerate() {
                let above = [0, 1, 2].map(|axis| {
                    let mut above = cell;
                    above[axis] += 1;
                    rows.find(above)
                });
                let [Some(x), Some(y), Some(z)] = above else { continue };
                let middle = Site::Centre.of(cell);
                if (0.0..0.5).contains(&ball(middle)) {
                    let out = [x, y, z].into_iter().enumerate();
                    sum += out.fold(0.0, |sum, (axis, above)| sum + faces[axis][above] - faces[axis][at]).abs();
                }
            }
            sum
        };
        let (before, after) = (lost(&continued), lost(&balanced));
        assert!(before > 1.0 && after < 0.5 * before, "{before} {after}");
    }
}
