//! The z-buffer: 16 samples per pixel, each with its own nearness and colour, tile by tile.
//!
//! Guarantees: the same bits on any number of threads, as a tile is one task with a fixed order of primitives; of two
//! equally near samples the first drawn stays. A primitive costs at most its pixels in the picture. Limit: a primitive
//! is shaded once per pixel, at the middle of the samples it covers, as graphics cards do with multisampling.

mod bins;
mod cover;
mod project;

use bins::{Bins, PixelBox};
pub(crate) use project::Screen;

use numerics::parallel;
use numerics::vector::Vec3;

/// Pixels per side of a tile, whose samples fit into a core's L2 cache.
pub(crate) const TILE: usize = 16;
/// Samples per pixel.
pub(crate) const SAMPLES: usize = 16;
/// One number per sample.
pub(crate) type Lanes = [f32; SAMPLES];
/// Nearness of an uncovered sample.
pub(crate) const UNCOVERED: f32 = f32::NEG_INFINITY;

/// Samples of a pixel, x right and y down from its upper left corner: a 4 × 4 grid turned so that no two samples share
/// a row or a column, which gives a nearly upright edge 16 shades of grey instead of 4.
pub(crate) const SAMPLE_X: Lanes = sample_axis(true);
pub(crate) const SAMPLE_Y: Lanes = sample_axis(false);

const fn sample_axis(is_x: bool) -> Lanes {
    let mut lanes = [0.0; SAMPLES];
    let mut k = 0;
    while k < SAMPLES {
        let (column, row) = (k % 4, k / 4);
        let (cell, turned) = if is_x { (column, row) } else { (row, 3 - column) };
        lanes[k] = (4 * cell + turned) as f32 / 16.0 + 1.0 / 32.0;
        k += 1;
    }
    lanes
}

/// Shading of covered pixels. Positions are x, y in pixels and nearness.
pub(crate) trait Shader: Sync {
    /// Colour of a sample.
    type Color: Copy + Default + Send;
    /// A point of a triangle; `normal` is on the visible side.
    fn surface(&self, at: Vec3, normal: Vec3, color: Vec3) -> Self::Color;
    /// A point of a strand that is lit already, at `across` times its radius from its axis; `radius` is in pixels.
    fn strand(&self, color: Vec3, across: f32, radius: f32) -> Self::Color;
    /// A point of a ball, `across` times its radius right of and above its centre; `lit` by that fraction of the key
    /// light.
    fn ball(&self, across: [f32; 2], color: Vec3, lit: f32) -> Self::Color;
}

/// Draws only nearness, as for a light.
pub(crate) struct DepthOnly;

impl Shader for DepthOnly {
    type Color = ();
    fn surface(&self, _: Vec3, _: Vec3, _: Vec3) {}
    fn strand(&self, _: Vec3, _: f32, _: f32) {}
    fn ball(&self, _: [f32; 2], _: Vec3, _: f32) {}
}

/// A drawn tile, row by row; at the right and lower border of a picture it may reach beyond.
pub(crate) struct Tile<C> {
    pub(crate) left: usize,
    pub(crate) top: usize,
    /// Nearness of each pixel's samples.
    pub(crate) depth: Vec<Lanes>,
    /// Colour of each pixel's samples; the default if uncovered.
    pub(crate) color: Vec<[C; SAMPLES]>,
}

impl<C: Copy + Default> Tile<C> {
    fn new(column: usize, row: usize) -> Self {
        Self {
            left: column * TILE,
            top: row * TILE,
            depth: vec![[UNCOVERED; SAMPLES]; TILE * TILE],
            color: vec![[C::default(); SAMPLES]; TILE * TILE],
        }
    }

    fn pixels(&self) -> PixelBox {
        PixelBox { low: [self.left, self.top], high: [self.left + TILE - 1, self.top + TILE - 1] }
    }

    /// Draws `depth` (uncovered samples are [`UNCOVERED`]) into pixel x, y of the picture if it is nearer.
    #[inline(always)]
    fn put(&mut self, [x, y]: [usize; 2], depth: &Lanes, shade: impl FnOnce(Vec3) -> C) {
        let pixel = (y - self.top) * TILE + (x - self.left);
        let behind = &mut self.depth[pixel];
        let mut wins = 0_u32;
        for k in 0..SAMPLES {
            wins |= u32::from(depth[k] > behind[k]) << k;
        }
        if wins == 0 {
            return;
        }
        let (mut sum, mut count) = ([0.0_f32; 3], 0.0_f32);
        for k in 0..SAMPLES {
            let covered = depth[k] > UNCOVERED;
            let weight = if covered { 1.0 } else { 0.0 };
            sum[0] += weight * SAMPLE_X[k];
            sum[1] += weight * SAMPLE_Y[k];
            sum[2] += if covered { depth[k] } else { 0.0 };
            count += weight;
        }
        let color = shade([x as f32 + sum[0] / count, y as f32 + sum[1] / count, sum[2] / count]);
        let colors = &mut self.color[pixel];
        for k in 0..SAMPLES {
            if wins >> k & 1 == 1 {
                behind[k] = depth[k];
                colors[k] = color;
            }
        }
    }
}

/// Draws `screen` and passes each tile to `finish`; the results are in rows of tiles, left to right.
pub(crate) fn draw<S: Shader, R: Send>(
    screen: &Screen,
    shader: &S,
    finish: impl Fn(Tile<S::Color>) -> R + Sync,
) -> Vec<R> {
    let [columns, rows] = screen.size.map(|pixels| pixels.div_ceil(TILE));
    let bins = |boxes: Vec<PixelBox>| Bins::of(&boxes, columns, rows);
    let triangles = bins(screen.triangles.iter().map(|triangle| triangle.pixels).collect());
    let segments = bins(screen.segments.iter().map(|segment| segment.pixels).collect());
    let dots = bins(screen.dots.iter().map(|dot| dot.pixels).collect());
    parallel::map(0..columns * rows, |_, index| {
        let (column, row) = (index % columns, index / columns);
        let mut tile = Tile::new(column, row);
        let within = tile.pixels();
        for triangle in triangles.at(column, row).map(|row| &screen.triangles[row]) {
            if let Some(pixels) = triangle.pixels.meet(&within) {
                cover::triangle(&mut tile, triangle, pixels, shader);
            }
        }
        for segment in segments.at(column, row).map(|row| &screen.segments[row]) {
            if let Some(pixels) = segment.pixels.meet(&within) {
                cover::segment(&mut tile, segment, pixels, shader);
            }
        }
        for dot in dots.at(column, row).map(|row| &screen.dots[row]) {
            if let Some(pixels) = dot.pixels.meet(&within) {
                cover::dot(&mut tile, dot, pixels, shader);
            }
        }
        finish(tile)
    })
}

#[cfg(test)]
mod tests;
