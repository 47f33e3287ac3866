//! How much of cells is liquid.

use numerics::simd::{Path, kernel};
use numerics::vector::{Vec3, add, dot, length};

use crate::level_set::PhiView;
use crate::level_set::cubic::curved;
use crate::rows::{Cell, Finder};
use crate::step::Surface;
use crate::step::domain::{Domain, Obstacle};
use crate::velocity::Site;

/// |φ| of a cell, in cells, from which on it is all liquid or all air.
pub(crate) const WHOLE: f32 = 1.0;

/// How far from the middle of a surface cell, in surface cells along each axis, the 2³ places are where it is looked at.
const ASIDE: f32 = 0.25;

/// Distance of the middle of a cell from a solid, in cells, up to which that may cover some of its parts.
const CUT: f32 = 1.25;

/// The slope of the distance from a solid, at least, by which it says where the surface is: it is nearly even in a thin one.
const LEAST_STEEP: f32 = 0.1;

/// The cell of the domain that a cell repeats, or is next to.
pub(super) fn inner(domain: &Domain, cell: Cell) -> Cell {
    let home = domain.periods().home(cell);
    [0, 1, 2].map(|axis| home[axis].clamp(domain.low[axis], domain.high[axis] - 1))
}

/// How much of cells is liquid, without what is in a solid.
pub(crate) struct Shares<'a> {
    domain: &'a Domain,
    solid: Option<Obstacle<'a>>,
    /// φ of the surface.
    view: PhiView<'a>,
    /// The same on its own cells, and how many of these lie along a cell's edge.
    finest: PhiView<'a>,
    fine: i32,
}

impl<'a> Shares<'a> {
    pub(crate) fn of(surface: &'a dyn Surface, domain: &'a Domain, solid: Option<Obstacle<'a>>) -> Self {
        let (finest, fine) = surface.finest_view();
        Self { domain, solid, view: surface.view(), finest, fine }
    }

    /// The shares of a cell that are liquid if the surface moves outward by so many cells, and the middle of the first of them, in
    /// cells: by φ in the middle of 2³ parts of each surface cell. Fast where successive cells are near each other.
    pub(crate) fn reader<const N: usize>(&self) -> impl FnMut(Cell, [f32; N]) -> ([f32; N], Vec3) {
        let (path, coarse, around) = (Path::chosen(), Finder::new(self.view.rows), self.around());
        let (mut near, mut heights) = (Vec::new(), Vec::new());
        let fine = self.fine as usize;
        move |cell, outward| {
            let phi = coarse.find(cell).map_or(self.view.outside, |at| self.view.phi[at]);
            let height = self
                .solid
                .filter(|_| phi <= WHOLE)
                .map_or(f32::INFINITY, |solid| solid.distance(Site::Centre.of(cell)));
            let phi_outside = phi.max(-height);
            if phi_outside.abs() > WHOLE || !self.domain.contains(cell) {
                let is_whole = phi_outside < 0.0 && self.domain.contains(cell);
                return ([if is_whole { 1.0 } else { 0.0 }; N], Site::Centre.of(cell));
            }
            around(cell, &mut near);
            let solid = self.solid.filter(|_| height < CUT);
            heights.clear();
            if let Some(solid) = solid {
                self.heights(solid, cell, &mut heights);
            }
            let (sums, moment) = sums_of(path, &near, &heights, fine, outward);
            let middle = moment.map(|moment| moment / (sums[0].max(f32::MIN_POSITIVE) * fine as f32));
            let middle = if sums[0] > 0.0 { middle } else { [0.5; 3] };
            (sums.map(|sum| sum / (8 * fine * fine * fine) as f32), add(cell.map(|x| x as f32), middle))
        }
    }

    /// The heights of the surface cells of a cell and those around above a solid, in surface cells, x fastest.
    fn heights(&self, solid: Obstacle<'_>, cell: Cell, heights: &mut Vec<f32>) {
        let (fine, size) = (self.fine as f32, self.fine as usize + 2);
        heights.extend((0..size * size * size).map(|n| {
            let own = [n % size, n / size % size, n / size / size];
            let place = [0, 1, 2].map(|axis| cell[axis] as f32 + (own[axis] as f32 - 0.5) / fine);
            fine * solid.distance(place)
        }));
    }

    /// φ of the surface cells of a cell and those around, x fastest.
    fn around(&self) -> impl Fn(Cell, &mut Vec<f32>) {
        let (finder, r, view) = (Finder::new(self.finest.rows), self.fine, &self.finest);
        let size = r + 2;
        let [periods, start] = [self.domain.periods().0, self.domain.low].map(|cells| cells.map(|x| r * x));
        let along = move |axis: usize, at: i32| match periods[axis] {
            0 => at.clamp(view.low[axis], view.high[axis] - 1),
            period => start[axis] + (at - start[axis]).rem_euclid(period),
        };
        move |cell, near| {
            let [x, y, z] = cell.map(|x| r * x - 1);
            // Beyond the sides a row ends, or repeats.
            let is_row = x == along(0, x) && x + size - 1 == along(0, x + size - 1);
            near.clear();
            for k in z..z + size {
                let z = along(2, k);
                for j in y..y + size {
                    let y = along(1, j);
                    match if is_row { finder.find_run([x, y, z], size) } else { None } {
                        Some(at) => near.extend_from_slice(&view.phi[at..at + size as usize]),
                        None => near.extend(
                            (x..x + size)
                                .map(|x| finder.find([along(0, x), y, z]).map_or(view.outside, |at| view.phi[at])),
                        ),
                    }
                }
            }
        }
    }
}

kernel! {
    fn sums_of<const N: usize>(near: &[f32], heights: &[f32], fine: usize, outward: [f32; N]) -> ([f32; N], Vec3) =
        sums_of_body;
}

/// The shares of all parts of the `fine`³ surface cells of a cell, summed up, if the surface moves outward by so many cells; of the
/// first of them, the same times the place of each part, in surface cells. `near`: φ of these and of those around; `heights`: theirs above
/// a solid, if there is one.
#[inline(always)]
fn sums_of_body<const N: usize>(near: &[f32], heights: &[f32], fine: usize, outward: [f32; N]) -> ([f32; N], Vec3) {
    // The compiler knows where everything is in 3³ values.
    if let (1, [], Ok(near)) = (fine, heights, <&[f32; 27]>::try_from(near)) {
        return sums_of_cells(near, &[], 1, outward);
    }
    sums_of_cells(near, heights, fine, outward)
}

#[inline(always)]
fn sums_of_cells<const N: usize>(near: &[f32], heights: &[f32], fine: usize, outward: [f32; N]) -> ([f32; N], Vec3) {
    let (unit, size) = (fine as f32, fine + 2);
    let (mut sums, mut moment) = ([0.0; N], [0.0; 3]);
    for n in 0..fine * fine * fine {
        let own = [n % fine, n / fine % fine, n / fine / fine];
        let [x, y, z] = own.map(|along| along + 1);
        let (at, steps) = (x + size * (y + size * z), [1, size, size * size]);
        let phi = parts(near, at, steps);
        let (covered, out) = if heights.is_empty() { ([0.0; 8], [0.0; 3]) } else { covered(heights, at, steps) };
        let aligned = if heights.is_empty() { 0.0 } else { cosine(slope(&phi), out) };
        for n in 0..N {
            let mut shares = [0.0; 8];
            for part in 0..8 {
                let below = share_below(phi[part] - unit * outward[n]);
                shares[part] = share_of_both(below, 1.0 - covered[part], aligned);
            }
            let sum = sum(shares);
            sums[n] += sum;
            if n == 0 {
                for axis in 0..3 {
                    moment[axis] += (own[axis] as f32 + 0.5) * sum + ASIDE * rise_along(&shares, axis);
                }
            }
        }
    }
    (sums, moment)
}

/// The sum of a value of each of 2³ parts.
#[inline(always)]
fn sum([a, b, c, d, e, f, g, h]: [f32; 8]) -> f32 {
    ((a + e) + (b + f)) + ((c + g) + (d + h))
}

/// The sum of the values of the parts above along an axis, less that of those below.
#[inline(always)]
fn rise_along(of: &[f32; 8], axis: usize) -> f32 {
    let mut signed = *of;
    for part in 0..8 {
        signed[part] = if part >> axis & 1 == 1 { of[part] } else { -of[part] };
    }
    sum(signed)
}

/// The share of a part of a surface cell that is below a surface, at this distance from its middle in surface cells.
#[inline(always)]
fn share_below(distance: f32) -> f32 {
    (0.5 - 2.0 * distance).clamp(0.0, 1.0)
}

/// The share of a part of a surface cell that is `below` a surface and `free` of a solid, where these are the shares of each alone.
/// `aligned`: the cosine of the angle between their ways out, 1 in a film on the solid.
#[inline(always)]
fn share_of_both(below: f32, free: f32, aligned: f32) -> f32 {
    let product = below * free;
    let extreme = if aligned > 0.0 { (below + free - 1.0).max(0.0) } else { below.min(free) };
    product + aligned.abs() * (extreme - product)
}

/// The mean slope over a surface cell of a field with these values in its parts.
#[inline(always)]
fn slope(of: &[f32; 8]) -> Vec3 {
    [0, 1, 2].map(|axis| 0.5 * rise_along(of, axis))
}

/// The cosine of the angle between two slopes.
#[inline(always)]
fn cosine(a: Vec3, b: Vec3) -> f32 {
    let lengths = length(a) * length(b);
    if lengths > 0.0 { (dot(a, b) / lengths).clamp(-1.0, 1.0) } else { 0.0 }
}

/// φ in the middle of the 2³ parts of a surface cell, x fastest. `at`: where it is in `phi`; `steps`: how far from there those beside it
/// are, along each axis.
#[inline(always)]
fn parts(phi: &[f32], at: usize, steps: [usize; 3]) -> [f32; 8] {
    // Linear interpolation is too high where φ is curved, by ½ t (1 − t) φ″ along each axis: by 3/32 φ″ here. That the share of a part
    // changes over half a cell along φ makes curved liquid larger by 1/96 φ″. Neither is true of a crease.
    let bend: f32 = steps.iter().map(|step| phi[at - step] + phi[at + step] - 2.0 * phi[at]).map(curved).sum();
    let too_high = bend / 12.0;
    // Along y, along z, along x.
    let aside = |[below, own, above]: [f32; 3]| [own + (below - own) * ASIDE, own + (above - own) * ASIDE];
    let [x, y, z] = steps;
    let first = at - x - y - z;
    let phi = &phi[first..=at + x + y + z];
    let rows: [[[f32; 2]; 3]; 3] = std::array::from_fn(|k| {
        std::array::from_fn(|i| {
            let low = k * z + i * x;
            aside([phi[low], phi[low + y], phi[low + 2 * y]])
        })
    });
    let lines: [[[f32; 2]; 2]; 3] =
        std::array::from_fn(|i| [0, 1].map(|j| aside([rows[0][i][j], rows[1][i][j], rows[2][i][j]])));
    let ends: [[[f32; 2]; 2]; 2] =
        std::array::from_fn(|j| [0, 1].map(|k| aside([lines[0][j][k], lines[1][j][k], lines[2][j][k]])));
    std::array::from_fn(|part| ends[part >> 1 & 1][part >> 2][part & 1] - too_high)
}

/// The surface cells around a part of one, which comes first; then those beside it, x fastest.
#[inline(always)]
fn corners(at: usize, steps: [usize; 3], part: usize) -> [usize; 8] {
    let beside = |at: usize, axis: usize| if part >> axis & 1 == 1 { at + steps[axis] } else { at - steps[axis] };
    std::array::from_fn(|k| (0..3).fold(at, |at, axis| if k >> axis & 1 == 1 { beside(at, axis) } else { at }))
}

/// How much a field with these values at the [`corners`] of a part rises there towards them, over a surface cell.
#[inline(always)]
fn rise(corners: &[f32; 8]) -> Vec3 {
    let weight = |k: usize, axis: usize| if k >> axis & 1 == 1 { ASIDE } else { 1.0 - ASIDE };
    [0, 1, 2].map(|axis| {
        (0..8).fold(0.0, |sum, k| {
            let along = if k >> axis & 1 == 1 { 1.0 } else { -1.0 };
            let across: f32 = (0..3).filter(|other| *other != axis).map(|other| weight(k, other)).product();
            sum + along * across * corners[k]
        })
    })
}

/// The shares of the 2³ parts of a surface cell that a solid covers, x fastest, and the way out of it. `heights`: those above it, as φ
/// of [`parts`].
#[inline(always)]
fn covered(heights: &[f32], at: usize, steps: [usize; 3]) -> ([f32; 8], Vec3) {
    let (mut out, own) = ([0.0; 3], parts(heights, at, steps));
    let shares = std::array::from_fn(|part| {
        let rise = rise(&corners(at, steps, part).map(|corner| heights[corner]));
        for axis in 0..3 {
            out[axis] += if part >> axis & 1 == 1 { rise[axis] } else { -rise[axis] };
        }
        share_below(own[part] / length(rise).clamp(LEAST_STEEP, 1.0))
    });
    (shares, out)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use numerics::vector::sub;

    use super::*;
    use crate::marked::MarkedSurface;
    use crate::rows::CellRows;
    use crate::step::{Solid, Wall};

    /// The sum of the shares of all cells of a ball of 4.3 cells radius, as it is and 0.1 cells larger.
    fn ball(domain: Domain, resolution: u32, middle: Vec3) -> [f64; 2] {
        let home = |p: Vec3| {
            [0, 1, 2].map(|n| {
                let way = p[n] - middle[n];
                if domain.periods().0[n] > 0 { way - 16.0 * (way / 16.0).round() } else { way }
            })
        };
        let surface = MarkedSurface::new(domain, resolution, |p| length(home(p)) - 4.3, 0, 1);
        let shares = Shares::of(&surface, &domain, None);
        let mut share = shares.reader();
        CellRows::cuboid(domain.low, domain.high).iter().fold([0.0; 2], |sums, cell| {
            let (shares, _) = share(cell, [0.0, 0.1]);
            [0, 1].map(|n| sums[n] + f64::from(shares[n]))
        })
    }

    /// The volume of a ball.
    fn ball_of(radius: f64) -> f64 {
        4.0 / 3.0 * PI * radius * radius * radius
    }

    #[test]
    fn balls_hold_their_volume_also_across_periods() {
        let closed = Domain::closed([0; 3], [16; 3]);
        let periodic = Domain { walls: [[Wall::Periodic; 2]; 3], ..closed };
        for resolution in [1, 2] {
            for (domain, middle) in [(closed, [8.1, 7.7, 8.4]), (periodic, [0.3, 15.2, 8.0])] {
                let [here, more] = ball(domain, resolution, middle);
                assert!((here / ball_of(4.3) - 1.0).abs() < 3e-3, "{resolution}: {here}");
                assert!(
                    ((more - here) / (ball_of(4.4) - ball_of(4.3)) - 1.0).abs() < 0.03,
                    "{resolution}: {here} {more}"
                );
            }
        }
    }

    /// Even films on a ball, a floor that cuts cells and a slope.
    #[test]
    fn films_on_solids_hold_their_volume() {
        type Distance = fn(f64, Vec3) -> f32;
        let domain = Domain::closed([0; 3], [24; 3]);
        let ball: Distance = |_, p| length(sub(p, [12.1, 11.7, 12.3])) - 7.3;
        let floor: Distance = |_, p| p[1] - 8.27;
        let slope: Distance = |_, p| (p[1] - 0.3 * p[0] - 5.3) * 0.957_826;
        let on_plane = |thickness: f64| 24.0 * 24.0 * thickness;
        let on_ball = |thickness: f64| ball_of(7.3 + thickness) - ball_of(7.3);
        for (thickness, resolution) in [0.2_f32, 0.4, 0.7, 1.0, 1.5, 2.5].into_iter().flat_map(|t| [(t, 1), (t, 2)]) {
            let exact = f64::from(thickness);
            for (solid, volume) in
                [(ball, on_ball(exact)), (floor, on_plane(exact)), (slope, on_plane(exact) / 0.957_826)]
            {
                let mut surface = MarkedSurface::new(domain, resolution, |p| solid(0.0, p) - thickness, 0, 1);
                surface.meet(&|p| solid(0.0, p));
                let still = Solid::still(&solid);
                let shares = Shares::of(&surface, &domain, Some(still.at(0.0)));
                let mut share = shares.reader();
                let cells = CellRows::cuboid(domain.low, domain.high);
                let sum: f64 = cells.iter().map(|cell| f64::from(share(cell, [0.0]).0[0])).sum();
                let most = if thickness < 0.3 { 0.03 } else { 5e-3 };
                assert!((sum / volume - 1.0).abs() < most, "{thickness}, {resolution}: {sum} {volume}");
            }
        }
    }

    /// A post through the surface of a pool.
    #[test]
    fn a_pool_around_a_post_holds_what_is_outside() {
        let domain = Domain::closed([0; 3], [12; 3]);
        let post = |_: f64, p: Vec3| (p[0] - 5.3).abs().max((p[2] - 6.2).abs()) - 2.15;
        let mut surface = MarkedSurface::new(domain, 1, |p| p[1] - 5.4, 0, 1);
        surface.meet(&|p| post(0.0, p));
        let still = Solid::still(&post);
        let shares = Shares::of(&surface, &domain, Some(still.at(0.0)));
        let mut share = shares.reader();
        let sum: f64 =
            CellRows::cuboid(domain.low, domain.high).iter().map(|cell| f64::from(share(cell, [0.0]).0[0])).sum();
        let volume = 5.4 * (144.0 - 4.3 * 4.3);
        assert!((sum / volume - 1.0).abs() < 3e-3, "{sum} {volume}");
    }

    /// Liquid that touches a wall goes on beyond it: cells next to it are full.
    #[test]
    fn a_pool_holds_its_depth() {
        let domain = Domain::closed([0; 3], [6, 8, 6]);
        let surface = MarkedSurface::new(domain, 1, |p| p[1] - 3.3, 0, 1);
        let (shares, mut sum) = (Shares::of(&surface, &domain, None), 0.0);
        let mut share = shares.reader();
        for cell in CellRows::cuboid(domain.low, domain.high).dilated(2).iter() {
            sum += share(cell, [0.0]).0[0];
        }
        assert!((sum / (36.0 * 3.3) - 1.0).abs() < 1e-3, "{sum}");
    }
}
