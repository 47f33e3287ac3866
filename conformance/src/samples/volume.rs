//! Sample volumes.

use engine::geometry::{Grid, Kind, Volume};
use numerics::random::Key;
use numerics::vector;

use super::Form;

/// A ball of liquid that falls and spins. Its two grids are cropped to what each of them holds, so they differ in place,
/// size and cell, and neither stores what is far from the liquid: a node that reads both by one index is wrong.
pub(super) fn volume(form: Form, seed: u64) -> Volume {
    // Cells of the level set across the ball's box of 0.2 m, and of the velocity.
    let n: u32 = match form {
        Form::Empty => 0,
        Form::Other => 5,
        Form::Large => 32,
        _ => 8,
    };
    let m = n.div_ceil(2) + 1;
    let sizes = if n == 0 { [[0; 3]; 2] } else { [[n, n + 1, n + 2], [m, m + 1, m]] };
    let scale = match form {
        Form::Huge => 1e28,
        Form::Tiny => 1e-41,
        _ => 1.0,
    };
    let far = if form == Form::Far { 1e6 } else { 0.0 };
    let key = Key::new(seed).of(Kind::Volume as u64);
    let (radius, speed) = (0.06 * (1.0 + 0.01 * key.f32()), key.of(9).f32());
    // Lengths from here on are divided by `scale`, the origin is the ball's centre.
    let cell = 0.2 / n.max(1) as f32;
    let [level_grid, velocity_grid] = [(-0.1, cell, sizes[0]), (-0.1 - cell, 2.0 * cell, sizes[1])]
        .map(|(low, cell, size)| Grid { origin: [far + low * scale; 3], cell: cell * scale, size });
    let band = 2.0 * cell;
    let phi = |p: [f32; 3]| vector::length(p) - radius;
    let level_set = |row: usize| {
        let p = position(sizes[0], row).map(|i| (i + 0.5) * cell - 0.1);
        phi(p).min(band) * scale
    };
    let velocity = |axis: usize, row: usize| {
        let mut p = position(velocity_grid.faces_size(axis), row).map(|i| (2.0 * i + 1.0) * cell - 0.1 - cell);
        p[axis] -= cell;
        let moves = vector::add([0.0, -1.0, 0.1], vector::cross([2.0, 5.0, -3.0], p));
        if phi(p) < band { moves[axis] * scale * speed } else { 0.0 }
    };
    let level_set: Vec<f32> = (0..level_grid.cells()).map(level_set).collect();
    let velocity =
        [0, 1, 2].map(|axis| (0..velocity_grid.faces(axis)).map(|row| velocity(axis, row)).collect::<Vec<_>>());
    let velocity = velocity.each_ref().map(Vec::as_slice);
    Volume::from_dense(level_grid, &level_set, band * scale, velocity_grid, velocity)
        .expect("as many rows as cells and faces")
}

/// The node of a dense array of `size` nodes, x fastest, then y, then z.
fn position(size: [u32; 3], row: usize) -> [f32; 3] {
    let [x, y, _] = size.map(|n| n as usize);
    [row % x, row / x % y, row / (x * y)].map(|i| i as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_two_grids_of_a_volume_have_nothing_in_common() {
        for form in [&[Form::Small, Form::Other, Form::Large][..], &Form::EXTREMES].concat() {
            let volume = volume(form, 1);
            let (level, velocity) = (volume.level_grid(), volume.velocity_grid());
            if form == Form::Empty {
                assert!(level.cells() == 0 && velocity.cells() == 0);
                continue;
            }
            assert!((0..3).all(|k| level.size[k] != velocity.size[k]), "{form:?}");
            assert!(level.cell != velocity.cell, "{form:?}");
            if form == Form::Far {
                // Cells there are smaller than the steps between f32 coordinates.
                continue;
            }
            // All liquid lies within the velocity's grid and moves.
            assert!((0..3).all(|k| level.origin[k] > velocity.origin[k]), "{form:?}");
            let mut sampler = volume.sampler();
            let liquid = volume.level_set().nodes().filter(|(_, phi)| *phi < 0.0);
            let at = |[i, j, k]: [u32; 3]| {
                [(i, 0), (j, 1), (k, 2)].map(|(i, k)| level.origin[k] + (i as f32 + 0.5) * level.cell)
            };
            let speeds: Vec<f32> = liquid.map(|(node, _)| vector::largest(sampler.velocity(at(node)))).collect();
            assert!(!speeds.is_empty() && speeds.iter().all(|speed| *speed > 0.0), "{form:?}");
        }
        let large = volume(Form::Large, 1);
        for (name, field) in large.fields() {
            let blocks: usize = field.size().iter().map(|n| n.div_ceil(8) as usize).product();
            assert!((1..blocks).contains(&field.block_count()), "`{name}` stores {} of {blocks}", field.block_count());
        }
    }
}
