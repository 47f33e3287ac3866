//! The floor under the scene: only the shadows on it are drawn over the backdrop, so it has no horizon and hides
//! nothing.
//!
//! Guarantees: the floor is at the lowest point of the bounds and only darkens, softly: where the key light is blocked,
//! and close under objects that nearly touch it. Limit: no shadows farther than `HALF` from the middle of the scene,
//! and none for an eye below the floor.

use crate::light::{DepthMap, Light};
use crate::scene::Scene;
use crate::view::View;
use numerics::parallel;
use numerics::vector::{Vec3, add, scale, sub};

/// Half the side of the floor, stage units; and texels per side.
const HALF: f32 = 2.6;
const TEXELS: usize = 320;
/// Rows of texels that a thread blurs at a time.
const ROWS: usize = 16;
/// Height at which an object above the floor darkens it half as much as one that touches it, stage units.
const CONTACT_HEIGHT: f32 = 0.05;
/// Fraction of the backdrop's light that is removed by full shadow, and by full contact.
const SHADOW: f32 = 0.38;
const CONTACT: f32 = 0.45;
/// Radius of the box filters, texels; three of them in a row approximate a Gaussian.
const SHADOW_BLUR: usize = 4;
const CONTACT_BLUR: usize = 3;

/// Darkness of the floor.
pub(crate) struct Ground {
    height: f32,
    light: Vec<f32>,
}

impl Ground {
    /// The floor at `height` under a scene in `light`.
    pub(crate) fn of(scene: &Scene, light: &Light, height: f32) -> Self {
        let up = [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]];
        let from_below = DepthMap::from(scene, [0.0, height, 0.0], up);
        let near = |distance: f32| {
            let heights = distance.max(0.0) / CONTACT_HEIGHT;
            1.0 / (1.0 + heights * heights)
        };
        let texels = |value: &(dyn Fn(Vec3) -> f32 + Sync)| -> Vec<f32> {
            let middle = |k: usize| ((k as f32 + 0.5) / TEXELS as f32 * 2.0 - 1.0) * HALF;
            let texel = |k: usize| value([middle(k % TEXELS), height, middle(k / TEXELS)]);
            let mut texels = vec![0.0; TEXELS * TEXELS];
            parallel::fill(&mut texels, TEXELS, texel);
            texels
        };
        let shadow = blur(texels(&|at| 1.0 - light.reaching(at)), SHADOW_BLUR);
        let contact = blur(texels(&|at| from_below.seen(at, near)), CONTACT_BLUR);
        let both = shadow.iter().zip(&contact);
        Self {
            height,
            light: both.map(|(shadow, contact)| (1.0 - SHADOW * shadow) * (1.0 - CONTACT * contact)).collect(),
        }
    }

    /// Fraction of the backdrop's light that remains at the pixel x, y.
    pub(crate) fn light(&self, view: &View, x: f32, y: f32) -> f32 {
        let eye = view.eye();
        let ray = sub(view.unproject([x, y, 1.0]), eye);
        let distance = (self.height - eye[1]) / ray[1];
        // Written so that level rays and NaN do not hit the floor.
        if !(distance > 0.0 && ray[1] < 0.0) {
            return 1.0;
        }
        let [u, _, v] = add(eye, scale(ray, distance)).map(|x| (x / HALF + 1.0) * 0.5 * TEXELS as f32 - 0.5);
        let inside = |x: f32| x >= 0.0 && x < (TEXELS - 1) as f32;
        if !(inside(u) && inside(v)) {
            return 1.0;
        }
        let (column, row) = (u as usize, v as usize);
        let (u, v) = (u - column as f32, v - row as f32);
        let at = |dx: usize, dy: usize| self.light[(row + dy) * TEXELS + column + dx];
        (1.0 - v) * ((1.0 - u) * at(0, 0) + u * at(1, 0)) + v * ((1.0 - u) * at(0, 1) + u * at(1, 1))
    }
}

/// Three box filters along rows and columns, with 0 beyond the border.
fn blur(mut texels: Vec<f32>, reach: usize) -> Vec<f32> {
    for _ in 0..6 {
        // Filters rows and writes them as columns: after two rounds both directions are done and the layout is
        // restored.
        let blurred = parallel::tabulate(TEXELS, ROWS, |row| box_filter(&texels[row * TEXELS..][..TEXELS], reach));
        texels = (0..TEXELS * TEXELS).map(|k| blurred[k % TEXELS][k / TEXELS]).collect();
    }
    texels
}

fn box_filter(row: &[f32], reach: usize) -> Vec<f32> {
    let share = 1.0 / (2 * reach + 1) as f32;
    let window = |k: usize| &row[k.saturating_sub(reach)..(k + reach + 1).min(row.len())];
    (0..row.len()).map(|k| window(k).iter().sum::<f32>() * share).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blurring_keeps_the_sum_and_spreads_it_evenly() {
        let mut texels = vec![0.0; TEXELS * TEXELS];
        let (row, column) = (100, 150);
        texels[row * TEXELS + column] = 1.0;
        let blurred = blur(texels, 2);
        assert!((blurred.iter().sum::<f32>() - 1.0).abs() < 1e-4);
        let at =
            |dx: isize, dy: isize| blurred[(row as isize + dy) as usize * TEXELS + (column as isize + dx) as usize];
        assert!(at(0, 0) > at(3, 0) && at(3, 0) > 0.0 && at(7, 0) == 0.0);
        assert!((at(3, 0) - at(0, -3)).abs() < 1e-7);
    }
}
