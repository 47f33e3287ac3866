//! Which primitives may touch which tile.
//!
//! Guarantees: the primitives of a tile have a fixed order for any number of threads: those that touch more than `WIDE`
//! tiles first, then the others, each in the given order. Limit: at most `WIDE` entries per primitive, so memory stays
//! linear; the box of a wide primitive is tested for every tile.

use super::TILE;

/// Number of tiles above which a primitive is not entered into each of them.
const WIDE: usize = 64;

/// Pixels from the first to the last, both included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PixelBox {
    pub(crate) low: [usize; 2],
    pub(crate) high: [usize; 2],
}

impl PixelBox {
    /// The pixels of a picture that the box from `low` to `high` touches, if any.
    pub(crate) fn within(low: [f32; 2], high: [f32; 2], size: [usize; 2]) -> Option<Self> {
        // Written so that NaN fails. A cast of a float beyond its range gives the nearest end.
        let touches = (0..2).all(|k| high[k] >= 0.0 && low[k] < size[k] as f32 && low[k] <= high[k]);
        touches.then(|| Self {
            low: low.map(|x| x.max(0.0) as usize),
            high: [0, 1].map(|k| (high[k] as usize).min(size[k] - 1)),
        })
    }

    /// The intersection of both.
    pub(crate) fn meet(&self, other: &Self) -> Option<Self> {
        let low = [0, 1].map(|k| self.low[k].max(other.low[k]));
        let high = [0, 1].map(|k| self.high[k].min(other.high[k]));
        (low[0] <= high[0] && low[1] <= high[1]).then_some(Self { low, high })
    }

    fn tiles(&self) -> [std::ops::RangeInclusive<usize>; 2] {
        [0, 1].map(|k| self.low[k] / TILE..=self.high[k] / TILE)
    }

    fn tile_count(&self) -> usize {
        let [columns, rows] = self.tiles();
        (columns.end() - columns.start() + 1) * (rows.end() - rows.start() + 1)
    }
}

/// Rows of primitives by tile.
pub(crate) struct Bins {
    columns: usize,
    starts: Vec<usize>,
    rows: Vec<u32>,
    wide: Vec<u32>,
}

impl Bins {
    /// Bins of a picture `columns` × `rows` tiles large, for primitives with these boxes.
    pub(crate) fn of(boxes: &[PixelBox], columns: usize, rows: usize) -> Self {
        let narrow = || boxes.iter().enumerate().filter(|(_, pixels)| pixels.tile_count() <= WIDE);
        let each_tile = |pixels: &PixelBox| {
            let [across, down] = pixels.tiles();
            down.flat_map(move |row| across.clone().map(move |column| row * columns + column))
        };
        let mut starts = vec![0; columns * rows + 1];
        narrow().for_each(|(_, pixels)| each_tile(pixels).for_each(|tile| starts[tile + 1] += 1));
        for tile in 0..columns * rows {
            starts[tile + 1] += starts[tile];
        }
        let mut free = starts.clone();
        let mut filled = vec![0; starts[columns * rows]];
        for (row, pixels) in narrow() {
            for tile in each_tile(pixels) {
                filled[free[tile]] = row as u32;
                free[tile] += 1;
            }
        }
        let wide = (0..boxes.len()).filter(|row| boxes[*row].tile_count() > WIDE).map(|row| row as u32).collect();
        Self { columns, starts, rows: filled, wide }
    }

    /// The primitives that may touch the tile.
    pub(crate) fn at(&self, column: usize, row: usize) -> impl Iterator<Item = usize> {
        let tile = row * self.columns + column;
        let own = &self.rows[self.starts[tile]..self.starts[tile + 1]];
        self.wide.iter().chain(own).map(|row| *row as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tile_lists_its_primitives_in_order_wide_ones_first() {
        let edge = TILE as f32;
        let size = [TILE * 20, TILE * 20];
        let pixels = |low: f32, high: f32| PixelBox::within([low; 2], [high; 2], size).unwrap();
        let boxes = [pixels(1.0, 2.0), pixels(0.0, 1e30), pixels(edge - 1.0, edge + 1.0), pixels(edge, edge + 2.0)];
        let bins = Bins::of(&boxes, 20, 20);
        assert_eq!(bins.at(0, 0).collect::<Vec<_>>(), [1, 0, 2]);
        assert_eq!(bins.at(1, 1).collect::<Vec<_>>(), [1, 2, 3]);
        assert_eq!(bins.at(19, 3).collect::<Vec<_>>(), [1]);
    }

    #[test]
    fn boxes_outside_or_of_nan_have_no_pixels() {
        let size = [8, 8];
        assert_eq!(PixelBox::within([-5.0, 0.0], [-0.1, 4.0], size), None);
        assert_eq!(PixelBox::within([8.0, 0.0], [9.0, 4.0], size), None);
        assert_eq!(PixelBox::within([f32::NAN, 0.0], [9.0, 4.0], size), None);
        assert_eq!(PixelBox::within([0.0, f32::NAN], [9.0, f32::NAN], size), None);
        let all = PixelBox::within([f32::NEG_INFINITY; 2], [f32::INFINITY; 2], size);
        assert_eq!(all, Some(PixelBox { low: [0, 0], high: [7, 7] }));
    }
}
