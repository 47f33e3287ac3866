//! Sums and updates of whole fields, in a fixed order and in parallel.

use numerics::parallel;
use numerics::simd::{Path, kernel};

/// Values that one thread adds up.
const CHUNK: usize = 8192;

/// Sums kept side by side, so that any SIMD width adds in the same order.
const LANES: usize = 16;

/// Σ aᵢ·bᵢ.
///
/// # Panics
/// Where the lengths differ.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len(), "a product of fields of different lengths");
    let path = Path::chosen();
    if a.len() <= CHUNK {
        return chunk_dot(path, a, b);
    }
    let sums = parallel::map(a.chunks(CHUNK).zip(b.chunks(CHUNK)), |_, (a, b)| chunk_dot(path, a, b));
    sums.iter().sum()
}

/// The largest |aᵢ|; NaN does not count.
pub fn largest(a: &[f64]) -> f64 {
    let path = Path::chosen();
    if a.len() <= CHUNK {
        return chunk_largest(path, a);
    }
    let all = parallel::map(a.chunks(CHUNK), |_, a| chunk_largest(path, a));
    all.into_iter().fold(0.0, f64::max)
}

/// yᵢ += s·xᵢ.
///
/// # Panics
/// Where the lengths differ.
pub fn add_scaled(y: &mut [f64], s: f64, x: &[f64]) {
    assert_eq!(y.len(), x.len(), "a sum of fields of different lengths");
    let path = Path::chosen();
    if y.len() <= CHUNK {
        return chunk_add_scaled(path, y, s, x);
    }
    parallel::for_each(y.chunks_mut(CHUNK).zip(x.chunks(CHUNK)), |_, (y, x)| chunk_add_scaled(path, y, s, x));
}

/// yᵢ = xᵢ + s·yᵢ.
///
/// # Panics
/// Where the lengths differ.
pub fn scale_and_add(y: &mut [f64], s: f64, x: &[f64]) {
    assert_eq!(y.len(), x.len(), "a sum of fields of different lengths");
    let path = Path::chosen();
    if y.len() <= CHUNK {
        return chunk_scale_and_add(path, y, s, x);
    }
    parallel::for_each(y.chunks_mut(CHUNK).zip(x.chunks(CHUNK)), |_, (y, x)| chunk_scale_and_add(path, y, s, x));
}

/// One step along a direction: xᵢ += s·directionᵢ and yᵢ −= s·imageᵢ, whose largest |yᵢ| it returns; NaN does not count.
///
/// # Panics
/// Where the lengths differ.
pub fn advance([x, y]: [&mut [f64]; 2], s: f64, [direction, image]: [&[f64]; 2]) -> f64 {
    let len = x.len();
    assert!([y.len(), direction.len(), image.len()] == [len; 3], "a step along a field of another length");
    let path = Path::chosen();
    let chunks = x.chunks_mut(CHUNK).zip(y.chunks_mut(CHUNK)).zip(direction.chunks(CHUNK).zip(image.chunks(CHUNK)));
    let all = parallel::map(chunks, |_, ((x, y), (direction, image))| {
        chunk_add_scaled(path, x, s, direction);
        chunk_add_scaled(path, y, -s, image);
        chunk_largest(path, y)
    });
    all.into_iter().fold(0.0, f64::max)
}

/// Calls `f` with parts of a field and where each starts; in parallel.
pub(crate) fn in_parts<T: Send>(field: &mut [T], f: impl Fn(usize, &mut [T]) + Sync) {
    parallel::for_each(field.chunks_mut(CHUNK), |n, part| f(n * CHUNK, part));
}

/// Σ weightᵢ·aᵢ·bᵢ, as [`dot`] has it of weightᵢ·aᵢ.
///
/// # Panics
/// Where the lengths differ.
pub(crate) fn weighted_dot(a: &[f64], b: &[f64], weight: impl Fn(usize) -> f64 + Sync) -> f64 {
    assert_eq!(a.len(), b.len(), "a product of fields of different lengths");
    let path = Path::chosen();
    let sums = parallel::map(a.chunks(CHUNK).zip(b.chunks(CHUNK)), |n, (a, b)| {
        let weighted: Vec<f64> = (n * CHUNK..).zip(a).map(|(at, a)| a * weight(at)).collect();
        chunk_dot(path, &weighted, b)
    });
    sums.iter().sum()
}

/// toᵢ = fromᵢ ÷ `by`.
///
/// # Panics
/// Where the lengths differ.
pub fn divide_into(to: &mut [f32], from: &[f64], by: f64) {
    assert_eq!(to.len(), from.len(), "a quotient of another length");
    let path = Path::chosen();
    parallel::for_each(to.chunks_mut(CHUNK).zip(from.chunks(CHUNK)), |_, (to, from)| chunk_divide(path, to, from, by));
}

/// toᵢ = fromᵢ·`by`; Σ toᵢ·withᵢ, as [`dot`] has it.
///
/// # Panics
/// Where the lengths differ.
pub fn multiply_into(to: &mut [f64], from: &[f32], by: f64, with: &[f64]) -> f64 {
    let len = to.len();
    assert!([from.len(), with.len()] == [len; 2], "a product of another length");
    let path = Path::chosen();
    let chunks = to.chunks_mut(CHUNK).zip(from.chunks(CHUNK).zip(with.chunks(CHUNK)));
    let sums = parallel::map(chunks, |_, (to, (from, with))| {
        chunk_multiply(path, to, from, by);
        chunk_dot(path, with, to)
    });
    sums.iter().sum()
}

kernel! {
    fn chunk_divide(to: &mut [f32], from: &[f64], by: f64) = divide_body;
}

kernel! {
    fn chunk_multiply(to: &mut [f64], from: &[f32], by: f64) = multiply_body;
}

#[inline(always)]
fn divide_body(to: &mut [f32], from: &[f64], by: f64) {
    for (to, from) in to.iter_mut().zip(from) {
        *to = (from / by) as f32;
    }
}

#[inline(always)]
fn multiply_body(to: &mut [f64], from: &[f32], by: f64) {
    for (to, from) in to.iter_mut().zip(from) {
        *to = f64::from(*from) * by;
    }
}

kernel! {
    fn chunk_dot(a: &[f64], b: &[f64]) -> f64 = dot_body;
}

kernel! {
    fn chunk_largest(a: &[f64]) -> f64 = largest_body;
}

kernel! {
    fn chunk_add_scaled(y: &mut [f64], s: f64, x: &[f64]) = add_scaled_body;
}

kernel! {
    fn chunk_scale_and_add(y: &mut [f64], s: f64, x: &[f64]) = scale_and_add_body;
}

#[inline(always)]
fn dot_body(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; LANES];
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<LANES>(), b.as_chunks::<LANES>());
    for (a, b) in a.iter().zip(b) {
        for lane in 0..LANES {
            sums[lane] += a[lane] * b[lane];
        }
    }
    for (lane, (a, b)) in a_rest.iter().zip(b_rest).enumerate() {
        sums[lane] += a * b;
    }
    sums.iter().sum()
}

#[inline(always)]
fn largest_body(a: &[f64]) -> f64 {
    let mut all = [0.0; LANES];
    let larger = |a: f64, b: f64| if b > a { b } else { a };
    let (a, rest) = a.as_chunks::<LANES>();
    for a in a {
        for lane in 0..LANES {
            all[lane] = larger(all[lane], a[lane].abs());
        }
    }
    for (lane, a) in rest.iter().enumerate() {
        all[lane] = larger(all[lane], a.abs());
    }
    all.into_iter().fold(0.0, larger)
}

#[inline(always)]
fn add_scaled_body(y: &mut [f64], s: f64, x: &[f64]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y += s * x;
    }
}

#[inline(always)]
fn scale_and_add_body(y: &mut [f64], s: f64, x: &[f64]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y = x + s * *y;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_are_those_of_a_loop() {
        for len in [0, 1, 17, CHUNK, 3 * CHUNK + 5] {
            let a: Vec<f64> = (0..len).map(|i| (i % 7) as f64 - 3.0).collect();
            let b: Vec<f64> = (0..len).map(|i| (i % 5) as f64 - 1.0).collect();
            // Whole numbers: exact in any order.
            assert_eq!(dot(&a, &b), a.iter().zip(&b).map(|(a, b)| a * b).sum::<f64>());
            assert_eq!(largest(&a), if len == 0 { 0.0 } else { 3.0 });
            let mut y = b.clone();
            add_scaled(&mut y, 2.0, &a);
            scale_and_add(&mut y, -1.0, &a);
            assert!(y.iter().zip(&a).zip(&b).all(|((y, a), b)| *y == a - (b + 2.0 * a)));
            let (mut x, mut y) = (a.clone(), b.clone());
            let most = advance([&mut x, &mut y], 2.0, [&b, &a]);
            assert!(x.iter().zip(&a).zip(&b).all(|((x, a), b)| *x == a + 2.0 * b));
            assert!(y.iter().zip(&a).zip(&b).all(|((y, a), b)| *y == b - 2.0 * a));
            assert_eq!(most, largest(&y));
            let mut narrow = vec![0.0; len];
            divide_into(&mut narrow, &a, 2.0);
            assert_eq!(multiply_into(&mut x, &narrow, 2.0, &b), dot(&a, &b));
            assert!(x == a);
            in_parts(&mut x, |first, part| (first..).zip(part).for_each(|(at, x)| *x += 2.0 * b[at]));
            assert!(x.iter().zip(&a).zip(&b).all(|((x, a), b)| *x == a + 2.0 * b));
            let odd = |at: usize| (at % 2) as f64;
            let expected = (0..len).map(|at| odd(at) * a[at] * b[at]).sum::<f64>();
            assert_eq!(weighted_dot(&a, &b, odd), expected);
        }
    }
}
