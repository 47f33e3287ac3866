//! Curves with CVs at other places along them, and their attributes there.

use curves::guides::CurveSample;
use engine::prelude::*;
use numerics::parallel::{self, CHUNK};
use numerics::vector::{to_f32, to_f64};

/// Curves with these numbers of CVs, which lie at the samples along `curves`. Attributes of CVs are interpolated; whole
/// numbers, and `orient`, are those of the nearer CV. What nobody takes is left out.
///
/// # Errors
/// If there are not as many samples as CVs.
pub(crate) fn sampled(cx: &Cx, curves: &Component, counts: Vec<u32>, samples: &[CurveSample]) -> Result<Component> {
    let points = curves.positions();
    let mixed = |sample: &CurveSample| {
        let [before, after] = [sample.before, sample.after].map(|row| points[row as usize]);
        // A sample at a CV has its bits.
        if sample.fraction == 0.0 || before == after {
            return before;
        }
        let (before, after) = (to_f64(before), to_f64(after));
        to_f32(before + (after - before) * f64::from(sample.fraction))
    };
    let new = parallel::tabulate(samples.len(), CHUNK, |row| mixed(&samples[row]));
    let mut out = Component::curves(counts, new)?;
    for (owner, name, column) in curves.columns().filter(|(_, name, _)| ***name != *P.name) {
        if !cx.wants_named(name) {
            continue;
        }
        let column = if owner == Owner::Point { attribute(curves, name, column, samples) } else { column.clone() };
        out.set_column(owner, name.clone(), column)?;
    }
    Ok(out)
}

/// The length of a curve.
pub(crate) fn length(cvs: &[[f32; 3]]) -> f64 {
    cvs.windows(2).map(|ends| (to_f64(ends[1]) - to_f64(ends[0])).norm()).sum()
}

/// An attribute of CVs at the new CVs.
fn attribute(curves: &Component, name: &str, column: &Column, samples: &[CurveSample]) -> Column {
    let table = curves.table(Owner::Point);
    if let Some(rows) = table.get::<f32>(name) {
        let rows: Vec<[f32; 1]> = rows.iter().map(|row| [*row]).collect();
        return Column::new(mixed(&rows, samples).into_iter().map(|[row]| row).collect::<Vec<f32>>());
    }
    if let Some(rows) = table.get::<[f32; 3]>(name) {
        let mut rows = mixed(rows, samples);
        if *name == *N.name {
            rows.iter_mut().for_each(|normal| *normal = to_f64(*normal).try_normalize(0.0).map_or(*normal, to_f32));
        }
        return Column::new(rows);
    }
    if let Some(rows) = table.get::<[f32; 4]>(name).filter(|_| *name != *ORIENT.name) {
        return Column::new(mixed(rows, samples));
    }
    let nearer = |sample: &CurveSample| if sample.fraction < 0.5 { sample.before } else { sample.after };
    column.gather(&samples.iter().map(nearer).collect::<Vec<u32>>())
}

fn mixed<const K: usize>(rows: &[[f32; K]], samples: &[CurveSample]) -> Vec<[f32; K]> {
    parallel::tabulate(samples.len(), CHUNK, |row| {
        let CurveSample { before, after, fraction } = samples[row];
        let (before, after) = (rows[before as usize], rows[after as usize]);
        if fraction == 0.0 {
            return before;
        }
        std::array::from_fn(|k| {
            let (before, after) = (f64::from(before[k]), f64::from(after[k]));
            (before + (after - before) * f64::from(fraction)) as f32
        })
    })
}
