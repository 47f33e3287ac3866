//! The surface where it is not in a solid, and the volume that it shows there.

use numerics::parallel;
use numerics::vector::{Vec3, add, dot, scale, sub, unit};

use super::{CHUNK, MarkedSurface};
use crate::extract::QuadMesh;
use crate::level_set::{BAND, Distance, PhiSampler, PhiView, outward};
use crate::rows::Cell;

/// Thickness of a film on a solid, in surface cells, from which a mesh of these cells shows it without holes: more than the
/// diagonal of a cell.
const FILM: f32 = 1.8;

/// How much larger φ must be a cell farther from the solid for a place to count as a film on it: at the first value it does
/// not, from the second on it does fully. φ rises by 1 over an even film, by a half in a groove where lobes met, and hardly
/// at all where a surface meets the solid at a right angle.
const RISE: [f32; 2] = [0.2, 0.5];

/// The same where only even films count: beside a shore, where the surface of a pool meets the solid, and on a thin solid,
/// where other surfaces may belong to liquid on its far side.
const RISE_OF_EVEN: [f32; 2] = [0.8, 0.95];

/// How much larger φ is a cell farther out of a solid from which on it is no distance: what is in the solid then belongs to its
/// other side, up to the middle of a wall that has moved since. Of a thin solid, it does where φ is not below 0 on its surface.
const STEEP: f32 = 1.5;

/// Height, in surface cells, of a place that is outside the solid where a side of it is as close as its distance says.
const CLEAR: f32 = 0.5;

/// How far to look for a shore, in surface cells, towards where liquid gets thinner: at a shore the solid is dry there, in a
/// groove it is not.
const BESIDE: f32 = 3.0;

/// Distance, in surface cells, that films on both sides of a thin solid keep from its middle.
const APART: f32 = 0.4;

/// Surface cells around a box whose mesh what is in it may change.
const CHANGED: i32 = 2;

/// Those around these that the mesh of them depends on.
const SEEN: i32 = 4;

impl MarkedSurface {
    /// φ of surface cells, positive in a solid, but for films on it that are thinner than [`FILM`] cells: they reach into
    /// the solid as far as they are too thin for cells to show, so that their surface has no holes.
    pub fn phi_outside(&self, solid: &Distance<'_>) -> Vec<f32> {
        self.view_outside(self.set.view(), solid)
    }

    /// The same of one of its views.
    pub(super) fn view_outside(&self, view: PhiView<'_>, solid: &Distance<'_>) -> Vec<f32> {
        let size = self.resolution as f32;
        let distance = |at: Vec3| size * solid(scale(at, 1.0 / size));
        let start = || PhiSampler::new(view);
        let [clipped] = view.rows.tabulate_with(start, |sampler, cell, n| {
            let (at, phi) = (cell.map(|x| x as f32 + 0.5), view.phi[n]);
            if phi >= BAND {
                return [BAND];
            }
            let height = distance(at);
            let thickness = height - phi;
            let mut depth = 0.0;
            if (0.0..FILM).contains(&thickness)
                && height.abs() < 2.0 * FILM
                && let Some(normal) = outward(&distance, at)
            {
                // Over a film φ rises with the height; where a surface meets the solid it does not.
                let rise = sampler.at(add(at, normal)) - phi;
                let inside = -distance(sub(at, scale(normal, height + FILM)));
                let is_thin = inside < 0.5 * FILM;
                let is_even = is_thin || is_shore(&distance, sampler, at, normal);
                let [least, most] = if is_even { RISE_OF_EVEN } else { RISE };
                let mut share = ((rise - least) / (most - least)).clamp(0.0, 1.0);
                if share > 0.0 && height < 0.0 {
                    let is_other_side = if is_thin { phi >= rise * height } else { rise > STEEP };
                    // In a corner no side is as close as the distance says.
                    let is_corner = || distance(add(at, scale(normal, CLEAR - height))) < 0.5 * CLEAR;
                    share = if is_other_side || is_corner() { 0.0 } else { share };
                }
                let wanted = share * (FILM - thickness);
                // Half the thickness of the solid, where that is less than a film reaches.
                depth = wanted.min(0.5 * (FILM + inside) - APART).max(0.0);
            }
            [phi.max(-height - depth).min(BAND)]
        });
        clipped
    }

    /// Moves points of a mesh in surface cells that are in a solid onto it.
    pub(super) fn put_outside(&self, mesh: &mut QuadMesh, solid: &Distance<'_>) {
        let size = self.resolution as f32;
        let distance = |at: Vec3| size * solid(scale(at, 1.0 / size));
        parallel::for_each(mesh.points.chunks_mut(CHUNK), |_, points| {
            for point in points {
                let height = distance(*point);
                if height < 0.0
                    && let Some(normal) = outward(&distance, *point)
                {
                    *point = add(*point, scale(normal, -height));
                }
            }
        });
    }

    /// The volume, in surface cells, that the mesh shows between two corners, but for a constant that depends on what is
    /// beyond them: the difference between two is that of the liquid.
    pub(super) fn volume_within(&self, low: Cell, high: Cell, solid: Option<&Distance<'_>>) -> f64 {
        let [low, high] = [(low, -CHANGED), (high, CHANGED)].map(|(corner, by)| corner.map(|x| x + by));
        let rows = self.set.rows().clipped(low.map(|x| x - SEEN), high.map(|x| x + SEEN));
        let phi = rows.resampled(self.set.rows(), self.set.phi(), BAND);
        let view = PhiView { rows: &rows, phi: &phi, ..self.set.view() };
        let clipped = solid.map(|solid| self.view_outside(view, solid));
        let view = PhiView { phi: clipped.as_deref().unwrap_or(view.phi), ..view };
        let is_within = |cell: Cell| (0..3).all(|axis| low[axis] <= cell[axis] && cell[axis] < high[axis]);
        let (mesh, within) = self.meshed(view, solid, |inside, outside| is_within(inside) && is_within(outside));
        let origin = low.map(|x| x as f32);
        let quads = mesh.quads.iter().zip(within).filter(|(_, within)| *within);
        quads.fold(0.0, |sum, (quad, _)| sum + mesh.six_volumes(origin, *quad)) / 6.0
    }
}

/// Whether the solid is dry [`BESIDE`] cells from a place, where the liquid on it gets thinner.
fn is_shore(solid: &Distance<'_>, sampler: &mut PhiSampler<'_>, at: Vec3, normal: Vec3) -> bool {
    let (_, gradient) = sampler.gradient(at);
    let Some(along) = unit(sub(gradient, scale(normal, dot(gradient, normal)))) else { return false };
    let beside = add(at, scale(along, BESIDE));
    sampler.at(sub(beside, scale(normal, solid(beside)))) >= 0.0
}
