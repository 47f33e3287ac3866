//! Runs code over the rows of columns in batches, on all threads.
//!
//! Rows are split into chunks of fixed size, chunks into batches. Every row is computed independently, so the result
//! does not depend on the split or the number of threads. The values of a batch stay in the cache while its
//! instructions run, and values that are the same for all rows are computed once.

use std::sync::Arc;

use numerics::parallel;

use super::Env;
use super::code::Input;
use super::lower::{Lowered, Store};
use crate::geometry::Column;

/// Rows per batch: 512 bytes per value, so that 60 values fit in 32 kB.
const BATCH: usize = 64;
/// Rows per task of a thread.
const CHUNK: usize = 64 * BATCH;

/// A value that its column cannot store.
pub(super) struct OutOfRange {
    pub(super) store: Store,
    pub(super) row: usize,
    pub(super) value: f64,
}

/// Runs the code and stores its results in `written` (attribute and column with `rows` rows).
///
/// # Errors
/// The first value, by line and then by row, that is not finite or outside i32.
pub(super) fn run(
    lowered: &Lowered,
    env: &Env<'_>,
    sources: &[Option<&Column>],
    written: &mut [(usize, Column)],
    rows: usize,
) -> Result<(), OutOfRange> {
    let mut outputs = vec![0; sources.len()];
    for (output, (attribute, _)) in written.iter().enumerate() {
        outputs[*attribute] = output;
    }
    let mut chunks: Vec<Vec<ChunkMut<'_>>> = (0..rows.div_ceil(CHUNK)).map(|_| Vec::new()).collect();
    for (_, column) in written {
        for (chunk, part) in chunks.iter_mut().zip(parts(column)) {
            chunk.push(part);
        }
    }

    let count = rows as f64;
    let code = &lowered.code;
    let mut uniform = vec![[0.0]; code.uniform()];
    code.run(&mut uniform, 0, env.seed, |input, out| *out = [env.input(input, count)]);

    let bad = parallel::map(chunks, |chunk, mut parts| {
        let mut values = vec![[0.0; BATCH]; code.len()];
        for (value, [number]) in values.iter_mut().zip(&uniform) {
            *value = [*number; BATCH];
        }
        let mut bad = None;
        for start in (chunk * CHUNK..rows.min((chunk + 1) * CHUNK)).step_by(BATCH) {
            let length = BATCH.min(rows - start);
            code.run(&mut values, uniform.len(), env.seed, |input, out| match input {
                Input::Attribute { attribute, component } => {
                    if let Some(column) = sources[attribute as usize] {
                        read(column, component as usize, start, &mut out[..length]);
                    }
                }
                Input::Index => {
                    for (k, out) in out.iter_mut().enumerate() {
                        *out = (start + k) as f64;
                    }
                }
                input => *out = [env.input(input, count); BATCH],
            });
            for store in &lowered.stores {
                let part = &mut parts[outputs[store.attribute as usize]];
                let value = &values[store.value as usize][..length];
                if let Some(k) = part.write(store.component as usize, start - chunk * CHUNK, value) {
                    let found = OutOfRange { store: *store, row: start + k, value: value[k] };
                    bad = first(bad, Some(found));
                }
            }
        }
        bad
    });
    bad.into_iter().fold(None, first).map_or(Ok(()), Err)
}

/// The earlier of two, by line, then row, then component.
fn first(a: Option<OutOfRange>, b: Option<OutOfRange>) -> Option<OutOfRange> {
    let key = |bad: &OutOfRange| (bad.store.position, bad.row, bad.store.component);
    a.into_iter().chain(b).min_by_key(key)
}

/// Reads a component of the rows from `start` on.
fn read(column: &Column, component: usize, start: usize, out: &mut [f64]) {
    fn fill<T>(rows: &[T], out: &mut [f64], number: impl Fn(&T) -> f64) {
        for (out, row) in out.iter_mut().zip(rows) {
            *out = number(row);
        }
    }
    match column {
        Column::F1(rows) => fill(&rows[start..], out, |x| f64::from(*x)),
        Column::F3(rows) => fill(&rows[start..], out, |x| f64::from(x[component])),
        Column::F4(rows) => fill(&rows[start..], out, |x| f64::from(x[component])),
        Column::I1(rows) => fill(&rows[start..], out, |x| f64::from(*x)),
        Column::I3(rows) => fill(&rows[start..], out, |x| f64::from(x[component])),
        Column::I4(rows) => fill(&rows[start..], out, |x| f64::from(x[component])),
    }
}

/// The numbers of a chunk of rows, and the number of components of a row.
enum ChunkMut<'a> {
    Single(&'a mut [f32], usize),
    Integer(&'a mut [i32], usize),
}

/// Splits a column into chunks for writing.
fn parts(column: &mut Column) -> Vec<ChunkMut<'_>> {
    fn single(numbers: &mut [f32], width: usize) -> Vec<ChunkMut<'_>> {
        numbers.chunks_mut(CHUNK * width).map(|part| ChunkMut::Single(part, width)).collect()
    }
    fn integer(numbers: &mut [i32], width: usize) -> Vec<ChunkMut<'_>> {
        numbers.chunks_mut(CHUNK * width).map(|part| ChunkMut::Integer(part, width)).collect()
    }
    match column {
        Column::F1(rows) => single(Arc::make_mut(rows).as_mut_slice(), 1),
        Column::F3(rows) => single(Arc::make_mut(rows).as_flattened_mut(), 3),
        Column::F4(rows) => single(Arc::make_mut(rows).as_flattened_mut(), 4),
        Column::I1(rows) => integer(Arc::make_mut(rows).as_mut_slice(), 1),
        Column::I3(rows) => integer(Arc::make_mut(rows).as_flattened_mut(), 3),
        Column::I4(rows) => integer(Arc::make_mut(rows).as_flattened_mut(), 4),
    }
}

impl ChunkMut<'_> {
    /// Writes a component of the rows from `start` on. Returns the index of the first of `values` that cannot be
    /// stored.
    fn write(&mut self, component: usize, start: usize, values: &[f64]) -> Option<usize> {
        fn fill<T>(numbers: &mut [T], width: usize, from: usize, values: &[f64], to: impl Fn(f64) -> T) {
            for (number, value) in numbers[from..].iter_mut().step_by(width).zip(values) {
                *number = to(*value);
            }
        }
        match self {
            ChunkMut::Single(numbers, width) => {
                fill(numbers, *width, start * *width + component, values, |x| x as f32);
                values.iter().position(|x| !x.is_finite())
            }
            ChunkMut::Integer(numbers, width) => {
                fill(numbers, *width, start * *width + component, values, |x| x as i32);
                let held = f64::from(i32::MIN)..=f64::from(i32::MAX);
                values.iter().position(|x| !held.contains(x))
            }
        }
    }
}
