//! Loops over all threads of rayon's pool.
//!
//! Rayon's iterators compile some 2,500 lines of machinery for each closure, which was half of what the kernels compiled to.
//! Here that machinery is compiled once, and a loop is an ordinary iterator over pieces of work: chunks of slices, zipped
//! as needed, each worth some microseconds. Results are in the order of the pieces, so sums over them are in a fixed order
//! whatever the number of threads.

use std::mem;
use std::sync::Mutex;

use rayon::iter::{IntoParallelIterator, ParallelIterator};

/// Elements of a piece of work, where each takes some 10 to 100 ns.
pub const CHUNK: usize = 512;

/// Calls `work` with each piece and its position, in any order.
pub fn for_each<P: Send>(pieces: impl IntoIterator<Item = P>, work: impl Fn(usize, P) + Sync) {
    let mut slots = Vec::new();
    for piece in pieces {
        slots.push(Mutex::new(Some(piece)));
    }
    run(slots.len(), &|n| {
        if let Some(piece) = take(&slots[n]) {
            work(n, piece);
        }
    });
}

/// What `work` makes of each piece and its position, in the order of the pieces.
pub fn map<P: Send, T: Send>(pieces: impl IntoIterator<Item = P>, work: impl Fn(usize, P) -> T + Sync) -> Vec<T> {
    let mut slots = Vec::new();
    for piece in pieces {
        slots.push((Mutex::new(Some(piece)), Mutex::new(None)));
    }
    run(slots.len(), &|n| {
        if let Some(piece) = take(&slots[n].0) {
            let result = work(n, piece);
            *slots[n].1.lock().unwrap_or_else(|poisoned| poisoned.into_inner()) = Some(result);
        }
    });
    let mut results = Vec::with_capacity(slots.len());
    for (_, result) in &slots {
        results.extend(take(result));
    }
    results
}

/// `value` of each number below `count`, in their order, where a value alone is too little for a piece of work: `chunk`
/// of them are one.
pub fn tabulate<T: Send>(count: usize, chunk: usize, value: impl Fn(usize) -> T + Sync) -> Vec<T> {
    tabulate_with(count, chunk, || (), |(), n| value(n))
}

/// [`tabulate`] with a state that `start` makes for each piece of work.
pub fn tabulate_with<T: Send, S>(
    count: usize,
    chunk: usize,
    start: impl Fn() -> S + Sync,
    value: impl Fn(&mut S, usize) -> T + Sync,
) -> Vec<T> {
    let starts = (0..count).step_by(chunk);
    let parts = map(starts, |_, first| {
        let mut state = start();
        (first..count.min(first + chunk)).map(|n| value(&mut state, n)).collect::<Vec<_>>()
    });
    concat(parts)
}

/// Sets each element to `value` of its position, `chunk` of them in a piece of work.
pub fn fill<T: Send>(elements: &mut [T], chunk: usize, value: impl Fn(usize) -> T + Sync) {
    for_each(elements.chunks_mut(chunk), |n, elements| {
        (n * chunk..).zip(elements).for_each(|(n, element)| *element = value(n));
    });
}

/// All elements of lists, in their order.
pub fn concat<T>(mut lists: Vec<Vec<T>>) -> Vec<T> {
    if lists.len() == 1 {
        return mem::take(&mut lists[0]);
    }
    let mut all = Vec::with_capacity(lists.iter().map(Vec::len).sum());
    lists.into_iter().for_each(|list| all.extend(list));
    all
}

fn take<T>(slot: &Mutex<Option<T>>) -> Option<T> {
    slot.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).take()
}

/// Calls `work` with each number below `count`. Not generic: the one place that rayon's iterators are compiled for.
#[expect(clippy::disallowed_methods, reason = "here alone")]
fn run(count: usize, work: &(dyn Fn(usize) + Sync)) {
    match count {
        0 => {}
        1 => work(0),
        _ => (0..count).into_par_iter().for_each(work),
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;

    #[test]
    fn each_piece_is_worked_on_once() {
        let mut squares = vec![0; 1000];
        let numbers: Vec<usize> = (0..1000).collect();
        for_each(squares.chunks_mut(7).zip(numbers.chunks(7)), |n, (squares, numbers)| {
            assert_eq!(numbers[0], 7 * n);
            squares.iter_mut().zip(numbers).for_each(|(square, number)| *square += number * number);
        });
        assert!(squares.iter().enumerate().all(|(n, square)| *square == n * n));
    }

    #[test]
    fn results_are_in_the_order_of_the_pieces() {
        let calls = AtomicUsize::new(0);
        let halves = map((0..501).map(|n| 2 * n), |n, piece| {
            calls.fetch_add(1, Ordering::Relaxed);
            (n, piece / 2)
        });
        assert_eq!(calls.into_inner(), 501);
        assert!(halves.iter().enumerate().all(|(n, half)| *half == (n, n)));
        assert!(map(0..0, |_, n: usize| n).is_empty());
    }

    #[test]
    fn values_are_in_the_order_of_their_numbers() {
        for (count, chunk) in [(0, 4), (1, 4), (4, 4), (5, 4), (1000, 3)] {
            let expected: Vec<_> = (0..count).map(|n| 3 * n).collect();
            assert_eq!(tabulate(count, chunk, |n| 3 * n), expected);
            let mut filled = vec![0; count];
            fill(&mut filled, chunk, |n| 3 * n);
            assert_eq!(filled, expected);
        }
    }
}
