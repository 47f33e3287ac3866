//! Where volume is given back: where the liquid is thick. A film of less than a cell loses volume in each step, more than all
//! the rest of a liquid; given back evenly that would keep films alive which the grid cannot show, as ribs and holes.

use numerics::vector::{Vec3, scale, sub, unit};

use crate::level_set::{PhiSampler, PhiView};

/// Cells behind the surface at which is looked.
const BEHIND: f32 = 1.5;
/// Depths there, in cells, from which on a surface moves, and moves as far as any. A sheet with free sides has them where it is
/// 2.1 and 2.7 cells thick, liquid on a wall at 1.1 and 1.7.
const DEPTHS: [f32; 2] = [0.6, 1.2];
/// Share of a piece's surface that is thick from which on no other part of it moves; with less, all of it does in proportion.
const ENOUGH: f64 = 0.1;

/// Reads how far a surface moves, as a share of where it is thick.
pub(super) struct Shares<'a> {
    phi: PhiSampler<'a>,
    /// φ outside solids, where there are any.
    outside: Option<PhiSampler<'a>>,
}

impl<'a> Shares<'a> {
    pub(super) fn new(phi: PhiView<'a>, outside: Option<&'a [f32]>) -> Self {
        let outside = outside.map(|outside| PhiSampler::new(PhiView { phi: outside, ..phi }));
        Self { phi: PhiSampler::new(phi), outside }
    }

    /// At a point of the surface with this normal.
    #[inline]
    pub(super) fn at(&mut self, point: Vec3, normal: Vec3) -> f32 {
        let behind = sub(point, scale(normal, BEHIND));
        let phi = self.phi.at(behind);
        // On a solid a film of any thickness has a surface.
        if self.outside.as_mut().is_some_and(|outside| outside.at(behind) > phi) {
            return 1.0;
        }
        ((-phi - DEPTHS[0]) / (DEPTHS[1] - DEPTHS[0])).clamp(0.0, 1.0)
    }

    /// At the point of the surface next to a place.
    #[inline]
    pub(super) fn beside(&mut self, place: Vec3) -> f32 {
        let (phi, gradient) = self.phi.gradient(place);
        unit(gradient).map_or(0.0, |normal| self.at(sub(place, scale(normal, phi)), normal))
    }
}

/// The free surface of a piece, and the part of it that is thick, in surface cells.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Area {
    pub(super) all: f64,
    pub(super) thick: f64,
}

impl Area {
    /// The area that counts where what is not thick moves by the share `least`.
    pub(super) fn moved(self, least: f32) -> f64 {
        self.thick + f64::from(least) * (self.all - self.thick)
    }

    /// How far all of a surface moves as a share of where it is thick, so that an area of `wanted` counts.
    pub(super) fn least(self, wanted: f64) -> f32 {
        let few = 1.0 - self.thick / (ENOUGH * self.all);
        let thin = (self.all - self.thick).max(f64::MIN_POSITIVE);
        few.max((wanted - self.thick) / thin).clamp(0.0, 1.0) as f32
    }
}

/// A share that is at least this much.
#[inline]
pub(super) fn raised(share: f32, least: f32) -> f32 {
    share + (1.0 - share) * least
}
