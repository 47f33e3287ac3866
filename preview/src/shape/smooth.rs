//! Normals at the corners of triangles: smooth across gentle bends, sharp at creases.
//!
//! Guarantees: a corner's normal is the area-weighted mean over the triangles at its point that bend away from its own
//! by less than `CREASE`. Limit: a point with more than `MOST_AROUND` triangles is smooth all round; an `N` attribute
//! is not read, as a node that moves points may not have updated it.

use numerics::parallel;
use numerics::vector::{Vec3, add, cross, dot, sub, unit};

/// Cosine of the angle between triangles above which their edge is drawn sharp: 40 degrees. A sphere of 9 or more
/// segments stays smooth, an octagonal prism shows its edges.
const CREASE: f32 = 0.766;
/// Largest number of triangles at a point that are compared with each other; the cost is its square.
const MOST_AROUND: usize = 64;
/// Number of triangles in a task, and of those whose corners are.
const TASK: usize = 4096;
const CORNER_TASK: usize = 256;

/// Normals at the three corners of each triangle. Rows of `triangles` are rows of `points`.
pub(crate) fn corner_normals(points: &[Vec3], triangles: &[[u32; 3]]) -> Vec<[Vec3; 3]> {
    // Length: twice the triangle's area.
    let mut faces = vec![[0.0; 3]; triangles.len()];
    parallel::fill(&mut faces, TASK, |row| {
        let [a, b, c] = triangles[row].map(|k| points[k as usize]);
        cross(sub(b, a), sub(c, a))
    });
    let mut units = vec![[0.0; 3]; triangles.len()];
    parallel::fill(&mut units, TASK, |row| unit(faces[row]).unwrap_or([0.0; 3]));
    let around = Around::of(points.len(), triangles);
    let mut normals = vec![[[0.0; 3]; 3]; triangles.len()];
    parallel::fill(&mut normals, CORNER_TASK, |own| {
        triangles[own].map(|point| {
            let around = around.triangles(point);
            let smooth = |t: &&u32| around.len() > MOST_AROUND || dot(units[**t as usize], units[own]) > CREASE;
            let sum = around.iter().filter(smooth).fold([0.0; 3], |sum, t| add(sum, faces[*t as usize]));
            unit(sum).unwrap_or(units[own])
        })
    });
    normals
}

/// The triangles at each point.
struct Around {
    starts: Vec<u32>,
    triangles: Vec<u32>,
}

impl Around {
    fn of(points: usize, triangles: &[[u32; 3]]) -> Self {
        let mut starts = vec![0_u32; points + 1];
        for corner in triangles.as_flattened() {
            starts[*corner as usize + 1] += 1;
        }
        for k in 0..points {
            starts[k + 1] += starts[k];
        }
        let mut free = starts.clone();
        let mut rows = vec![0_u32; triangles.len() * 3];
        for (row, corners) in triangles.iter().enumerate() {
            for corner in corners {
                let slot = &mut free[*corner as usize];
                rows[*slot as usize] = row as u32;
                *slot += 1;
            }
        }
        Self { starts, triangles: rows }
    }

    fn triangles(&self, point: u32) -> &[u32] {
        &self.triangles[self.starts[point as usize] as usize..self.starts[point as usize + 1] as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use numerics::vector::length;

    /// Two triangles that share the edge 0–1, the second turned out of the first's plane.
    fn hinge(degrees: f64) -> [Vec3; 2] {
        let (sin, cos) = libm::sincos(degrees.to_radians());
        let points = [[0.0; 3], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [-cos as f32, -sin as f32, 0.0]];
        let normals = corner_normals(&points, &[[0, 1, 2], [1, 0, 3]]);
        [normals[0][0], normals[1][1]]
    }

    #[test]
    fn a_gentle_bend_is_smooth_and_a_sharp_one_a_crease() {
        let [a, b] = hinge(30.0);
        assert!(length(sub(a, b)) < 1e-6);
        let [a, b] = hinge(50.0);
        assert!((a[1] - 1.0).abs() < 1e-6 && b[1] < 0.7);
    }

    #[test]
    fn a_triangle_without_area_has_no_normal_and_does_not_change_its_neighbours() {
        let points = [[0.0; 3], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]];
        let normals = corner_normals(&points, &[[0, 1, 2], [0, 0, 1]]);
        assert_eq!(normals[0], [[0.0, 1.0, 0.0]; 3]);
        assert!(normals[1].as_flattened().iter().all(|x| x.is_finite()));
    }
}
