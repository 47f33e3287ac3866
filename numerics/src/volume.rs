//! Volumes of tets and of closed surfaces.
//!
//! Promise: coordinates are taken relative to the first point and multiplied in f64, so a body far from the origin loses
//! no precision; sums in fixed chunks, so the same bits on any number of threads. Limit: a surface that crosses itself
//! counts a region as often as it winds around it. m³ from metres; negative where tets or faces are inside out.

use crate::parallel;
use crate::vector::{DVec3, to_f64};

/// Terms of a sum that one thread adds up.
const CHUNK: usize = 4096;

/// Six times the volume of a tet, computed relative to its corner `a`.
pub fn six_volumes([a, b, c, d]: [[f32; 3]; 4]) -> f64 {
    triple(from(a, b), from(a, c), from(a, d))
}

/// The volume of all tets together.
///
/// # Panics
/// Where a corner is not an index of `points`.
pub fn of_tets(points: &[[f32; 3]], tets: &[[u32; 4]]) -> f64 {
    sum(tets, |tet| six_volumes(tet.map(|corner| points[corner as usize]))) / 6.0
}

/// The volume enclosed by polygons: face i has the points `corners[starts[i]..starts[i + 1]]`. A face that is not flat
/// counts as the fan from its first corner. `None` where the surface is open: some edge is not used equally often in both
/// directions.
///
/// # Panics
/// Where a corner is not an index of `points`.
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
    Some(sum(&faces, fan) / 6.0)
}

/// Whether every edge of the polygons is used equally often in both directions.
fn is_closed(starts: &[u32], corners: &[u32]) -> bool {
    let edge = |from: u32, to: u32| u64::from(from) << 32 | u64::from(to);
    let mut forward: Vec<u64> = Vec::with_capacity(corners.len());
    for run in starts.windows(2) {
        let face = &corners[run[0] as usize..run[1] as usize];
        forward.extend((0..face.len()).map(|k| edge(face[k], face[(k + 1) % face.len()])));
    }
    let mut backward: Vec<u64> = forward.iter().map(|edge| edge.rotate_left(32)).collect();
    parallel::for_each([&mut forward, &mut backward], |_, edges| edges.sort_unstable());
    forward == backward
}

/// Adds up the terms of each chunk, then the chunks in their order.
fn sum<T: Sync>(terms: &[T], term: impl Fn(&T) -> f64 + Sync) -> f64 {
    parallel::map(terms.chunks(CHUNK), |_, chunk| chunk.iter().map(&term).sum::<f64>()).iter().sum()
}

fn from(origin: [f32; 3], p: [f32; 3]) -> DVec3 {
    to_f64(p) - to_f64(origin)
}

fn triple(a: DVec3, b: DVec3, c: DVec3) -> f64 {
    a.dot(&b.cross(&c))
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
    fn a_box_encloses_its_volume_anywhere_and_the_negative_inside_out() {
        let mut block = shapes::block([1.0, 2.0, 4.0], [3, 2, 5]);
        assert!((measured(&block, 0.0).unwrap() - 8.0).abs() < 1e-5);
        assert!((measured(&shapes::block([1.0, 2.0, 4.0], [4; 3]), 1024.0).unwrap() - 8.0).abs() < 1e-12);
        block.corners.reverse();
        block.counts.reverse();
        assert!((measured(&block, 0.0).unwrap() + 8.0).abs() < 1e-5);
    }

    #[test]
    fn open_surfaces_have_no_volume() {
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
