//! The skin around a root, as a surface of second order: what `loft` keeps curves above.

use super::perpendicular;
use super::skin::SkinSurface;
use numerics::vector::{DMat3, DVec3, to_f64};

/// Turns by which a segment approaches the height that it keeps.
const TURNS: usize = 3;

/// The largest drop of the surface below its tangent plane, in distances from the root.
const MOST_DROP: f64 = 0.5;

/// The skin around a root.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct RootSurface {
    /// Out of the skin at the root, unit.
    pub(super) up: DVec3,
    /// Its curvature: a step `t` in the tangent plane turns the normal by `bend · t`.
    pub(super) bend: DMat3,
}

impl RootSurface {
    /// The skin around `root`; `None` where it has no normal.
    #[inline(always)]
    pub(super) fn of(skin: &SkinSurface<'_>, root: &DVec3, same_side: f64) -> Option<Self> {
        let (up, _) = skin.facet(root, same_side)?;
        let bend = skin.bend(root).unwrap_or_else(DMat3::zeros);
        let level = DMat3::identity() - up * up.transpose();
        let bend = level * (bend + bend.transpose()) * 0.5 * level;
        Some(Self { up, bend: if bend.iter().all(|x| x.is_finite()) { bend } else { DMat3::zeros() } })
    }

    /// How far it lies below its tangent plane, `away` from its root; where it rises, not at all.
    #[inline(always)]
    fn drop(&self, away: &DVec3) -> f64 {
        (0.5 * away.dot(&(self.bend * away))).clamp(0.0, MOST_DROP * away.norm())
    }

    /// Height above it, `away` from its root.
    #[inline(always)]
    pub(super) fn height(&self, away: &DVec3) -> f64 {
        self.up.dot(away) + self.drop(away)
    }

    /// The step from a CV, `before` from the root, turned so that its end is `wanted` high; `None` if it is that high. It
    /// is where the turn from the direction at rest to the goal passes that height: where a turn would meet a floor there.
    #[inline(always)]
    pub(super) fn lofted(&self, before: &DVec3, step: &DVec3, rest: &DVec3, wanted: f64) -> Option<DVec3> {
        let length = step.norm();
        if wanted <= 0.0 || length == 0.0 || self.height(&(before + step)) >= wanted {
            return None;
        }
        let (goal, rest) = (step / length, rest.try_normalize(0.0).unwrap_or(self.up));
        let mut turned = goal;
        for _ in 0..TURNS {
            let drop = self.drop(&(before + turned * length));
            let rise = ((wanted - drop - self.up.dot(before)) / length).clamp(-1.0, 1.0);
            turned = match lowest_on_way(&rest, &goal, &self.up, rise) {
                Some(on_way) => on_way,
                // As low at rest: straight up from there.
                None => {
                    let level = (rest - self.up * self.up.dot(&rest)).try_normalize(1e-9);
                    let level = level.unwrap_or_else(|| perpendicular(&self.up, &goal));
                    level * (1.0 - rise * rise).sqrt() + self.up * rise
                }
            };
        }
        Some(turned * length)
    }
}

/// Where the turn from one unit vector to another sinks below the slope `rise` along `up`; `None` if it starts below.
fn lowest_on_way(from: &DVec3, to: &DVec3, up: &DVec3, rise: f64) -> Option<DVec3> {
    let side = (to - from * from.dot(to)).try_normalize(1e-9)?;
    let slopes = [up.dot(from), up.dot(&side)];
    let most = (slopes[0] * slopes[0] + slopes[1] * slopes[1]).sqrt();
    if slopes[0] < rise || most == 0.0 {
        return None;
    }
    let angle = libm::atan2(slopes[1], slopes[0]) + libm::acos((rise / most).clamp(-1.0, 1.0));
    let (sine, cosine) = libm::sincos(angle);
    Some(from * cosine + side * sine)
}

impl SkinSurface<'_> {
    /// How its normal changes along the face nearest to a point: by this times a step on the face.
    fn bend(&self, p: &DVec3) -> Option<DMat3> {
        let at = self.tree.closest(numerics::vector::to_f32(*p), f32::INFINITY)?;
        let [a, b, c] = self.corners(&at)?;
        let (along, across) = (b - a, c - a);
        let normal = along.cross(&across);
        let square = normal.norm_squared();
        let corners = self.triangles[at.triangle as usize];
        let [n, o, p] = corners.map(|corner| to_f64(self.normals[corner as usize]).try_normalize(0.0));
        let (n, o, p) = (n?, o?, p?);
        // The dual vectors of the sides.
        let [first, second] = [across.cross(&normal) / square, normal.cross(&along) / square];
        Some((o - n) * first.transpose() + (p - n) * second.transpose())
    }
}
