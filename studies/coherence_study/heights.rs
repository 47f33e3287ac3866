//! Which heights above the skin `offset_scale` and `loft` keep.

use crate::collided_with;
use crate::scene::{Case, Groom, Sample};
use curves::collide::Collide;
use numerics::vector::{Vec3, to_f64};

/// Heights at rest below this are not judged, metres.
const LEAST: f64 = 1e-3;

/// What keeps heights, and which share of them.
#[derive(Clone, Copy, Debug)]
pub(crate) enum KeptBy {
    OffsetScale(f64),
    Loft(f64),
}

/// Of the CVs that the wind presses below their share of the height at rest, those that are brought back.
#[derive(Clone, Copy, Default)]
pub(crate) struct Heights {
    pub(crate) pressed: usize,
    /// At most 2 and 5 % lower than wanted.
    kept: [usize; 2],
    /// At most 5 % higher besides: others come higher, being drawn along by a CV that is raised more.
    within: usize,
    /// Largest |length − before| of a segment ÷ curve length.
    pub(crate) length_error: f64,
}

/// What "at most so much lower" means, as a share of the height wanted.
const ERRORS: [f64; 2] = [0.02, 0.05];

impl Heights {
    /// On a still skin, in so many samples of a turn of the wind.
    pub(crate) fn on(groom: &Groom, by: KeptBy, samples: u32) -> Self {
        let mut sum = Self::default();
        for sample in 0..samples {
            sum.add(groom, &groom.at(Case::Still, 360.0 * f64::from(sample) / f64::from(samples)), by);
        }
        sum
    }

    fn add(&mut self, groom: &Groom, sample: &Sample, by: KeptBy) {
        let (share, out) = match by {
            KeptBy::OffsetScale(share) => {
                (share, collided_with(groom, sample, |how| Collide { offset_scale: Some(share.into()), ..how }))
            }
            KeptBy::Loft(share) => (share, collided_with(groom, sample, |how| Collide { loft: share.into(), ..how })),
        };
        self.length_error = self.length_error.max(out.length_error);
        let [rest, goal, now] = [&sample.rest, &sample.goal, &out.points].map(|points| heights(groom, sample, points));
        for cv in (0..now.len()).filter(|cv| groom.is_judged(sample.rest[*cv])) {
            let wanted = share * rest[cv];
            if wanted < LEAST || goal[cv] >= wanted {
                continue;
            }
            self.pressed += 1;
            for (kept, error) in self.kept.iter_mut().zip(ERRORS) {
                *kept += usize::from(now[cv] >= wanted * (1.0 - error));
            }
            self.within += usize::from((now[cv] - wanted).abs() <= ERRORS[1] * wanted);
        }
    }

    /// Shares, in percent, that are at most 2 and at most 5 % too low, and that are within 5 %.
    pub(crate) fn percents(&self) -> [f64; 3] {
        [self.kept[0], self.kept[1], self.within].map(|count| 100.0 * count as f64 / self.pressed as f64)
    }
}

/// Heights above the skin, negative inside, metres.
fn heights(groom: &Groom, sample: &Sample, points: &[Vec3]) -> Vec<f64> {
    let height = |p: &Vec3| {
        let Some(at) = sample.tree.closest(*p, f32::INFINITY) else { return f64::INFINITY };
        let away = to_f64(*p) - to_f64(at.point);
        let corners = groom.body.triangles[at.triangle as usize].map(|corner| to_f64(sample.normals[corner as usize]));
        let normal = (0..3).map(|k| corners[k] * f64::from(at.weights[k])).sum::<numerics::vector::DVec3>();
        away.norm().copysign(away.dot(&normal))
    };
    points.iter().map(height).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bodies::Body;

    #[test]
    fn offset_scale_keeps_heights_on_a_plane_and_on_closed_bodies() {
        for (body, rank, least) in
            [("plane", 0, 100.0), ("camel", 1, 96.0), ("folds", 1, 96.0), ("knot", 1, 96.0), ("sphere", 1, 96.0)]
        {
            let groom = Groom::on(Body::named(body), 1_500);
            for share in [1.0, 0.5] {
                let heights = Heights::on(&groom, KeptBy::OffsetScale(share), 3);
                let kept = heights.percents()[rank];
                println!("{body}, {share}: {:?} of {}", heights.percents(), heights.pressed);
                assert!(heights.pressed > 300 && kept >= least, "{body}, {share}: {kept} %");
                assert!(heights.length_error <= 1e-5, "{body}, {share}: {}", heights.length_error);
            }
        }
    }
}
