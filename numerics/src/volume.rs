//! Volumes of tets and of what a closed surface encloses.
//!
//! Promise: exact for what is exact in f64 with the coordinates taken from the first point, so a body far from the origin
//! loses nothing; sums in fixed chunks, so the same bits on any number of threads. Limit: a surface that crosses itself
//! counts what it winds around as often as it does. m³ from metres; negative where tets or faces are inside out.

use rayon::prelude::*;

/// Terms of a sum that are added up by one thread.
const CHUNK: usize = 4096;

type Vec3 = [f64; 3];

/// Six times the volume of a tet, its corner `a` the origin.
pub fn six_volumes([a, b, c, d]: [[f32; 3]; 4]) -> f64 {
    triple(from(a, b), from(a, c), from(a, d))
}

/// Of all tets together.
///
/// # Panics
/// Where a tet has a corner that is no point.
pub fn of_tets(points: &[[f32; 3]], tets: &[[u32; 4]]) -> f64 {
    sum(tets.par_chunks(CHUNK), |tet| six_volumes(tet.map(|corner| points[corner as usize]))) / 6.0
}

/// Enclosed by polygons, of which `starts` are the first corners and the number of corners, `corners` the points. A face
/// that is not flat is a fan from its first corner. `None` where the surface is open: some edge is not passed as often one
/// way as the other.
///
/// # Panics
/// Where a polygon has a corner that is no point.
pub fn enclosed(starts: &[u32], corners: &[u32], points: &[[f32; 3]]) -> Option<f64> {
    if !is_closed(starts, corners) {
        return None;
    }
    let Some(origin) = corners.first().map(|corner| points[*corner as usize]) else { return Some(0.0) };
    let at = |corner: u32| from(origin, points[corner as usize]);
    let faces: Vec<&[u32]> = starts.windows(2).map(|run| &corners[run[0] as usize..run[1] as usize]).collect();
    let fan = |face: &&[u32]| {
        let Some((first, rest)) = face.split_first() else { return 0.0 };
        rest.windows(2).map(|pair| triple(at(*first), at(pair[0]), at(pair[1]))).sum()
    };
    Some(sum(faces.par_chunks(CHUNK), fan) / 6.0)
}

/// Whether every edge of polygons is passed as often one way as the other.
fn is_closed(starts: &[u32], corners: &[u32]) -> bool {
    let way = |a: u32, b: u32| u64::from(a) << 32 | u64::from(b);
    let mut there: Vec<u64> = Vec::with_capacity(corners.len());
    for run in starts.windows(2) {
        let face = &corners[run[0] as usize..run[1] as usize];
        there.extend((0..face.len()).map(|k| way(face[k], face[(k + 1) % face.len()])));
    }
    let mut back: Vec<u64> = there.iter().map(|way| way.rotate_left(32)).collect();
    there.par_sort_unstable();
    back.par_sort_unstable();
    there == back
}

/// Adds up the terms of each chunk, then the chunks in their order.
fn sum<'a, T: Sync + 'a>(
    chunks: impl IndexedParallelIterator<Item = &'a [T]>,
    term: impl Fn(&T) -> f64 + Sync + Send,
) -> f64 {
    let sums: Vec<f64> = chunks.map(|chunk| chunk.iter().map(&term).sum()).collect();
    sums.iter().sum()
}

fn from(origin: [f32; 3], p: [f32; 3]) -> Vec3 {
    [0, 1, 2].map(|k| f64::from(p[k]) - f64::from(origin[k]))
}

fn triple(a: Vec3, b: Vec3, c: Vec3) -> f64 {
    a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::{self, Polygons};

    fn measured(shape: &Polygons, shift: f64) -> Option<f64> {
        let mut starts = vec![0];
        shape.counts.iter().for_each(|count| starts.push(starts[starts.len() - 1] + count));
        let points: Vec<_> = shape.points.iter().map(|p| p.map(|x| (x + shift) as f32)).collect();
        enclosed(&starts, &shape.corners, &points)
    }

    #[test]
    fn a_box_encloses_its_volume_wherever_it_stands_and_inside_out_less_than_nothing() {
        let mut block = shapes::block([1.0, 2.0, 4.0], [3, 2, 5]);
        assert!((measured(&block, 0.0).unwrap() - 8.0).abs() < 1e-5);
        assert!((measured(&shapes::block([1.0, 2.0, 4.0], [4; 3]), 1024.0).unwrap() - 8.0).abs() < 1e-12);
        block.corners.reverse();
        block.counts.reverse();
        assert!((measured(&block, 0.0).unwrap() + 8.0).abs() < 1e-5);
    }

    #[test]
    fn what_is_open_encloses_nothing_that_could_be_told() {
        assert_eq!(measured(&shapes::grid([1.0, 1.0], 4), 0.0), None);
        let mut block = shapes::block([1.0; 3], [2; 3]);
        block.corners.truncate(block.corners.len() - 4);
        block.counts.pop();
        assert_eq!(measured(&block, 0.0), None);
        assert_eq!(enclosed(&[0], &[], &[]), Some(0.0));
    }

    #[test]
    fn tets_add_up_with_their_signs() {
        let points = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        assert_eq!(of_tets(&points, &[[0, 1, 2, 3]]), 1.0 / 6.0);
        assert_eq!(of_tets(&points, &[[0, 1, 2, 3], [0, 2, 1, 3]]), 0.0);
    }
}
