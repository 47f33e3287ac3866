//! Sixteen places at once: where their values are stored is found one place after the other, the rest is computed side by
//! side. The bits are those of [`Sampler`] for one place.

use numerics::lanes::{F32x16, LANES, Lanes, get};

use crate::velocity::sampler::split_along;
use crate::velocity::{FaceFields, FaceMask, Sampler, Site, trilinear};

/// The cell below each place along one axis, and how far from it the place is.
#[derive(Clone, Copy)]
struct Split {
    cell: [i32; LANES],
    t: F32x16,
}

impl Split {
    /// `offset`: from the low corner of a cell to its value.
    #[inline(always)]
    fn of(places: &F32x16, offset: f32) -> Self {
        let mut split = Self { cell: [0; LANES], t: F32x16::splat(0.0) };
        for lane in 0..LANES {
            (split.cell[lane], split.t.0[lane]) = split_along(places.0[lane], offset);
        }
        split
    }

    /// Along the three axes. `offset`: from the low corner of a cell to its value.
    #[inline(always)]
    fn along_axes([x, y, z]: &Lanes<3>, offset: [f32; 3]) -> [Self; 3] {
        [Self::of(x, offset[0]), Self::of(y, offset[1]), Self::of(z, offset[2])]
    }
}

/// The eight values around each place: pairs along x; y ascends first, then z.
pub(super) struct ValuesAround {
    pairs: [[[f32; 2]; LANES]; 4],
    t: Lanes<3>,
}

impl ValuesAround {
    /// The values of a field; where not all are stored, eight times [`Sampler::value`].
    #[inline(always)]
    pub(super) fn of(sampler: &mut Sampler<'_>, field: &[f32], site: Site, places: &Lanes<3>) -> Self {
        let [x, y, z] = Split::along_axes(places, site.offset());
        Self::between(sampler, field, site, [&x, &y, &z], places)
    }

    #[inline(always)]
    fn between(
        sampler: &mut Sampler<'_>,
        field: &[f32],
        site: Site,
        [x, y, z]: [&Split; 3],
        places: &Lanes<3>,
    ) -> Self {
        let mut values = Self { pairs: [[[0.0; 2]; LANES]; 4], t: [x.t, y.t, z.t] };
        for lane in 0..LANES {
            match sampler.places([x.cell[lane], y.cell[lane], z.cell[lane]]) {
                Some(at) => values.store(lane, field, at),
                None => {
                    let value = sampler.value_beside(field, site, get(places, lane));
                    for pairs in &mut values.pairs {
                        pairs[lane] = [value; 2];
                    }
                }
            }
        }
        values
    }

    /// The values of a field where all are stored and lie on cells whose mask has all of `bits`; 0 elsewhere. For which places.
    #[inline(always)]
    pub(super) fn where_stored(
        sampler: &mut Sampler<'_>,
        field: &[f32],
        site: Site,
        places: &Lanes<3>,
        masks: &[FaceMask],
        bits: FaceMask,
    ) -> (Self, [bool; LANES]) {
        let [x, y, z] = Split::along_axes(places, site.offset());
        let mut values = Self { pairs: [[[0.0; 2]; LANES]; 4], t: [x.t, y.t, z.t] };
        let mut found = [false; LANES];
        for lane in 0..LANES {
            if let Some(at) = sampler.places([x.cell[lane], y.cell[lane], z.cell[lane]])
                && in_all(masks, at) & bits == bits
            {
                found[lane] = true;
                values.store(lane, field, at);
            }
        }
        (values, found)
    }

    #[inline(always)]
    fn store(&mut self, lane: usize, field: &[f32], at: [u32; 4]) {
        for row in 0..4 {
            let at = at[row] as usize;
            let pair = &field[at..at + 2];
            self.pairs[row][lane] = [pair[0], pair[1]];
        }
    }

    /// The eight values of one place, x fastest.
    #[inline(always)]
    fn corners(&self, lane: usize) -> [f32; 8] {
        let [[a, b], [c, d]] = [self.pairs[0][lane], self.pairs[1][lane]];
        let [[e, f], [g, h]] = [self.pairs[2][lane], self.pairs[3][lane]];
        [a, b, c, d, e, f, g, h]
    }

    /// The value at each place.
    #[inline(always)]
    pub(super) fn value(&self) -> F32x16 {
        let mut out = F32x16::splat(0.0);
        let [x, y, z] = &self.t;
        for lane in 0..LANES {
            out.0[lane] = trilinear(self.corners(lane), [x.0[lane], y.0[lane], z.0[lane]]);
        }
        out
    }

    /// The least and the largest of the eight.
    #[inline(always)]
    pub(super) fn range(&self) -> [F32x16; 2] {
        let [mut low, mut high] = [F32x16::splat(0.0); 2];
        for lane in 0..LANES {
            let corners = self.corners(lane);
            let [mut least, mut most] = [corners[0]; 2];
            for value in &corners[1..] {
                least = if *value < least { *value } else { least };
                most = if *value > most { *value } else { most };
            }
            (low.0[lane], high.0[lane]) = (least, most);
        }
        [low, high]
    }
}

/// The bits that the masks of all eight cells around have.
#[inline(always)]
fn in_all(masks: &[FaceMask], at: [u32; 4]) -> FaceMask {
    let mut all = FaceMask::MAX;
    for row in 0..4 {
        let at = at[row] as usize;
        let pair = &masks[at..at + 2];
        all &= pair[0] & pair[1];
    }
    all
}

/// The velocity at each place, as [`Sampler::velocity`] has it.
#[inline(always)]
pub(super) fn velocity(sampler: &mut Sampler<'_>, faces: &FaceFields<f32>, places: &Lanes<3>) -> Lanes<3> {
    // Between faces and between centres, along each axis.
    let [x, y, z] = Split::along_axes(places, [0.0; 3]);
    let [a, b, c] = Split::along_axes(places, [0.5; 3]);
    [
        ValuesAround::between(sampler, &faces[0], Site::FaceX, [&x, &b, &c], places).value(),
        ValuesAround::between(sampler, &faces[1], Site::FaceY, [&a, &y, &c], places).value(),
        ValuesAround::between(sampler, &faces[2], Site::FaceZ, [&a, &b, &z], places).value(),
    ]
}
