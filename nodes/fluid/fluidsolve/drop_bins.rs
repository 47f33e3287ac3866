//! Which drops are near each other.

use std::ops::Range;

use super::spray::SprayDrop;

/// The side of a bin, solver cells.
const SIDE: f64 = 2.0;

/// Share by which distances and volumes may be off by rounding.
const ROUNDING: f64 = 1e-5;

/// The bin of a drop: its liquid, and where it is along z, y and x.
type Bin = (u32, [i64; 3]);

/// Drops in the order of their bins. Which drops are near one takes as long as there are drops near it.
pub(super) struct DropBins {
    /// Bins, and the numbers of the drops in them; ascending.
    drops: Vec<(Bin, usize)>,
    /// Before each of them and at the end: the volume of those before it, m³.
    volume: Vec<f64>,
    /// The lowest and the highest bin along z, y and x.
    bounds: [[i64; 3]; 2],
}

impl DropBins {
    pub(super) fn new(spray: &[SprayDrop]) -> Self {
        let bin = |drop: &SprayDrop| (drop.phase, along_zyx(drop).map(number));
        let mut drops: Vec<_> = spray.iter().enumerate().map(|(n, drop)| (bin(drop), n)).collect();
        drops.sort_unstable();
        let mut volume = vec![0.0];
        volume.extend(drops.iter().scan(0.0, |sum, (_, n)| {
            *sum += spray[*n].volume.max(0.0);
            Some(*sum)
        }));
        let bounds = drops.iter().fold([[i64::MAX; 3], [i64::MIN; 3]], |[low, high], ((_, at), _)| {
            [[0, 1, 2].map(|axis| low[axis].min(at[axis])), [0, 1, 2].map(|axis| high[axis].max(at[axis]))]
        });
        Self { drops, volume, bounds }
    }

    /// The drops of the same liquid as `drop` that may be up to `reach` cells from it: all that are, ascending, and some
    /// others. None where all of them have less volume than `enough`, m³, together.
    pub(super) fn near(&self, drop: &SprayDrop, reach: f32, enough: f64) -> Vec<usize> {
        let reach = f64::from(reach) * (1.0 + ROUNDING);
        let place = along_zyx(drop);
        let low: [i64; 3] = std::array::from_fn(|axis| number(place[axis] - reach).max(self.bounds[0][axis]));
        let high: [i64; 3] = std::array::from_fn(|axis| number(place[axis] + reach).min(self.bounds[1][axis]));
        let rows = (low[0]..=high[0]).flat_map(|z| (low[1]..=high[1]).map(move |y| [z, y]));
        let rows: Vec<Range<usize>> = rows
            .map(|[z, y]| {
                let start = self.drops.partition_point(|(bin, _)| *bin < (drop.phase, [z, y, low[2]]));
                let len = self.drops[start..].partition_point(|(bin, _)| *bin <= (drop.phase, [z, y, high[2]]));
                start..start + len
            })
            .collect();
        let together = rows.iter().fold(0.0, |sum, row| sum + self.volume[row.end] - self.volume[row.start]);
        if together < enough * (1.0 - ROUNDING) {
            return Vec::new();
        }
        let mut near: Vec<usize> = rows.into_iter().flat_map(|row| &self.drops[row]).map(|(_, n)| *n).collect();
        near.sort_unstable();
        near
    }
}

fn along_zyx(drop: &SprayDrop) -> [f64; 3] {
    let [x, y, z] = drop.place.map(f64::from);
    [z, y, x]
}

/// The number of a bin along an axis.
fn number(at: f64) -> i64 {
    (at / SIDE).floor() as i64
}
