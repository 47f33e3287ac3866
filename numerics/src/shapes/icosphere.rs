//! A sphere of nearly equal triangles.

use super::Polygons;
use crate::vector::DVec3;
use std::collections::BTreeMap;

/// The golden rectangle's sides, its diagonal 2.
const SHORT: f64 = 0.525_731_112_119_133_6;
const LONG: f64 = 0.850_650_808_352_039_9;

/// Corners of the faces of an icosahedron.
const FACES: [[u32; 3]; 20] = [
    [0, 11, 5],
    [0, 5, 1],
    [0, 1, 7],
    [0, 7, 10],
    [0, 10, 11],
    [1, 5, 9],
    [5, 11, 4],
    [11, 10, 2],
    [10, 7, 6],
    [7, 1, 8],
    [3, 9, 4],
    [3, 4, 2],
    [3, 2, 6],
    [3, 6, 8],
    [3, 8, 9],
    [4, 9, 5],
    [2, 4, 11],
    [6, 2, 10],
    [8, 6, 7],
    [9, 8, 1],
];

/// A sphere: an icosahedron whose triangles are each split in four `times` times, 20 · 4^`times` triangles in all. Its
/// bounds are only approximately those of the sphere.
pub fn icosphere(radius: f64, times: usize) -> Polygons {
    let golden = [[-SHORT, LONG], [SHORT, LONG], [-SHORT, -LONG], [SHORT, -LONG]];
    let mut points = golden.map(|[s, l]| DVec3::new(s, l, 0.0)).to_vec();
    points.extend(golden.map(|[s, l]| DVec3::new(0.0, s, l)));
    points.extend(golden.map(|[s, l]| DVec3::new(l, 0.0, s)));
    let mut triangles = FACES.to_vec();
    for _ in 0..times {
        let mut middles = BTreeMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                let sum = points[a as usize] + points[b as usize];
                points.push(sum / sum.norm());
                points.len() as u32 - 1
            })
        };
        let mut finer = Vec::with_capacity(4 * triangles.len());
        for [a, b, c] in triangles {
            let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
            finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        triangles = finer;
    }
    let mut sphere = Polygons { points: points.iter().map(|p| (p * radius).into()).collect(), ..Polygons::default() };
    triangles.iter().for_each(|corners| sphere.face(corners.map(|corner| corner as usize)));
    sphere
}
