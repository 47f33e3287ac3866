//! Where points hang on a skin at rest, and how they move with it.

use super::carry::Pose;
use super::rotation::nearest_rotation;
use super::vectors::{IDENTITY, Matrix, Vec3, add, cross, dot, length, mix, moved, scale, sub, unit, wide};
use crate::scatter::Spot;
use numerics::tree::TriangleTree;
use numerics::vector::{largest, power_of_two_to_one};
use rayon::prelude::*;

/// Rows that a task takes at least: some 20 µs of work.
const TASK: usize = 256;

/// Points bound to a skin at rest; see [`crate::attach`]. It holds what it needs of the skin: that part of it around
/// the points alone.
#[derive(Clone, Debug)]
pub struct Binding {
    hooks: Vec<Hook>,
    knots: Vec<Knot>,
    /// Rows of `faces` around each knot.
    rings: Vec<u32>,
    faces: Vec<Face>,
    farthest: f64,
}

/// Where one point hangs.
#[derive(Clone, Copy, Debug)]
struct Hook {
    /// Rows of `knots`.
    knots: [u32; 3],
    weights: Vec3,
    /// From the skin to the point.
    offset: Vec3,
}

/// A point of the skin that something hangs near.
#[derive(Clone, Copy, Debug)]
struct Knot {
    point: u32,
    rest: Vec3,
    /// Where its ring ends in `rings`.
    end: u32,
    /// 1 ÷ the area around it; 0 where there is none.
    per_area: f64,
    /// Unit, by area; zero where there is none.
    normal: Vec3,
}

/// A triangle around a knot. Its area times the gradient of its deformation is linear in where its points are.
#[derive(Clone, Copy, Debug)]
struct Face {
    points: [u32; 3],
    /// Area times the gradient of the second and third point's weight.
    gradients: [Vec3; 2],
    /// Unit normal times half the root of the normal's length, which is twice the area.
    normal: Vec3,
}

const NONE: u32 = u32::MAX;

/// Sizes of the skin from which a point is looked for on it; one farther away is brought there first. The tree squares
/// squares of distances.
const FARTHEST: f32 = 1e8;

impl Binding {
    /// Binds `roots` to their nearest points of the skin; none where there are roots and no triangle to bind them to. A
    /// root that is not finite is bound to the first triangle.
    ///
    /// # Panics
    /// Where a corner of `triangles` is out of range.
    pub fn nearest(points: &[[f32; 3]], triangles: &[[u32; 3]], roots: &[[f32; 3]]) -> Option<Self> {
        if roots.is_empty() {
            return Some(Self::new(points, triangles, &[], &[]));
        }
        // The tree squares squares, so it sees a skin of about 1 m around the origin, whatever its place and size.
        let corner = points[*triangles.as_flattened().iter().min()? as usize];
        let from_corner = |p: &[f32; 3]| numerics::vector::sub(*p, corner);
        let all = triangles.as_flattened().iter().map(|corner| largest(from_corner(&points[*corner as usize])));
        let (to, _) = power_of_two_to_one(all.fold(0.0, f32::max));
        let near = |p: &[f32; 3]| {
            let p = from_corner(p).map(|x| x * to);
            let far = largest(p) / FARTHEST;
            if far > 1.0 { p.map(|x| x / far) } else { p }
        };
        let tree = TriangleTree::build(&points.iter().map(near).collect::<Vec<_>>(), triangles);
        if tree.is_empty() {
            return None;
        }
        let from: Vec<[f32; 3]> = roots.iter().map(near).collect();
        let spots: Vec<Spot> = tree
            .closest_each(&from, f32::INFINITY)
            .into_iter()
            .map(|found| {
                let (triangle, [_, b, c]) = found.map_or((0, [1.0, 0.0, 0.0]), |found| (found.triangle, found.weights));
                let (b, c) = (f64::from(b), f64::from(c));
                Spot { triangle, weights: [1.0 - b - c, b, c] }
            })
            .collect();
        let offset = |(root, spot): (&[f32; 3], &Spot)| {
            let corners = triangles[spot.triangle as usize].map(|corner| wide(points[corner as usize]));
            sub(wide(*root), mix(spot.weights, corners))
        };
        let offsets: Vec<Vec3> = roots.iter().zip(&spots).map(offset).collect();
        Some(Self::new(points, triangles, &spots, &offsets))
    }

    /// Binds points that lie on the skin.
    ///
    /// # Panics
    /// Where a corner or a spot's triangle is out of range.
    pub fn on(points: &[[f32; 3]], triangles: &[[u32; 3]], spots: &[Spot]) -> Self {
        Self::new(points, triangles, spots, &vec![[0.0; 3]; spots.len()])
    }

    fn new(points: &[[f32; 3]], triangles: &[[u32; 3]], spots: &[Spot], offsets: &[Vec3]) -> Self {
        // Knots in the order of the skin's points, so that neighbours are neighbours in memory.
        let mut knot_of = vec![NONE; points.len()];
        for spot in spots {
            triangles[spot.triangle as usize].iter().for_each(|corner| knot_of[*corner as usize] = 0);
        }
        let mut knots = Vec::new();
        for (point, knot) in knot_of.iter_mut().enumerate().filter(|(_, knot)| **knot != NONE) {
            *knot = knots.len() as u32;
            let rest = wide(points[point]);
            knots.push(Knot { point: point as u32, rest, end: 0, per_area: 0.0, normal: [0.0; 3] });
        }
        let near: Vec<[u32; 3]> = triangles
            .iter()
            .filter(|corners| corners.iter().any(|corner| knot_of[*corner as usize] != NONE))
            .copied()
            .collect();
        let faces: Vec<Face> = near.par_iter().with_min_len(TASK).map(|corners| Face::new(points, *corners)).collect();

        let ends_at = |corners: &[u32; 3]| corners.map(|corner| knot_of[corner as usize]);
        for knot in near.iter().flat_map(ends_at).filter(|knot| *knot != NONE) {
            knots[knot as usize].end += 1;
        }
        let mut total = 0;
        for knot in &mut knots {
            (total, knot.end) = (total + knot.end, total);
        }
        let mut rings = vec![0; total as usize];
        for (face, corners) in near.iter().enumerate() {
            for knot in ends_at(corners).into_iter().filter(|knot| *knot != NONE) {
                let knot = &mut knots[knot as usize];
                rings[knot.end as usize] = face as u32;
                knot.end += 1;
            }
        }
        let mut start = 0;
        for knot in &mut knots {
            let ring = &rings[start..knot.end as usize];
            start = knot.end as usize;
            let normals = ring.iter().map(|face| faces[*face as usize].twice_area());
            let twice_area: f64 = normals.clone().map(length).sum();
            knot.per_area = if twice_area > 0.0 { 2.0 / twice_area } else { 0.0 };
            knot.normal = unit(normals.fold([0.0; 3], add));
        }
        let hook = |(spot, offset): (&Spot, &Vec3)| {
            let knots = triangles[spot.triangle as usize].map(|corner| knot_of[corner as usize]);
            Hook { knots, weights: spot.weights, offset: *offset }
        };
        let hooks = spots.iter().zip(offsets).map(hook).collect();
        let farthest = offsets.iter().map(|offset| length(*offset)).fold(0.0, f64::max);
        Self { hooks, knots, rings, faces, farthest }
    }

    /// How far the farthest point is from the skin, metres.
    pub fn farthest(&self) -> f64 {
        self.farthest
    }

    /// The skin's unit normal at each point, at rest; zero where there is none.
    pub fn normals(&self) -> Vec<[f64; 3]> {
        let normal = |hook: &Hook| unit(mix(hook.weights, hook.knots.map(|knot| self.knots[knot as usize].normal)));
        self.hooks.iter().map(normal).collect()
    }

    /// How each point has moved and turned, where the skin's points are `now`.
    ///
    /// # Panics
    /// Where there are fewer points than at rest.
    pub fn carry(&self, now: &[[f32; 3]]) -> Vec<Pose> {
        let faces: Vec<Matrix> = self.faces.par_iter().with_min_len(TASK).map(|face| face.stretched(now)).collect();
        let knots: Vec<(Matrix, Vec3)> = self
            .knots
            .par_iter()
            .enumerate()
            .with_min_len(TASK)
            .map(|(row, knot)| {
                let start = row.checked_sub(1).map_or(0, |before| self.knots[before].end as usize);
                let ring = self.rings[start..knot.end as usize].iter().map(|face| &faces[*face as usize]);
                let mut mean = [[0.0; 3]; 3];
                for face in ring {
                    mean = [0, 1, 2].map(|row| add(mean[row], scale(face[row], knot.per_area)));
                }
                (mean, sub(wide(now[knot.point as usize]), knot.rest))
            })
            .collect();
        let pose = |hook: &Hook| {
            let corners = hook.knots.map(|knot| knots[knot as usize]);
            let gradient = [0, 1, 2].map(|row| mix(hook.weights, corners.map(|(gradient, _)| gradient[row])));
            let turn = nearest_rotation(&gradient);
            let shift = mix(hook.weights, corners.map(|(_, shift)| shift));
            let shift = add(shift, moved(turn.unwrap_or(IDENTITY), hook.offset));
            Pose { shift, turn: turn.unwrap_or(IDENTITY), lost: turn.is_none() }
        };
        self.hooks.par_iter().with_min_len(TASK).map(pose).collect()
    }
}

impl Face {
    fn new(at: &[[f32; 3]], points: [u32; 3]) -> Self {
        let [a, b, c] = points.map(|point| wide(at[point as usize]));
        let across = cross(sub(b, a), sub(c, a));
        let normal = unit(across);
        let gradients = [cross(normal, sub(a, c)), cross(normal, sub(b, a))].map(|side| scale(side, 0.5));
        Self { points, gradients, normal: scale(normal, 0.5 * length(across).sqrt()) }
    }

    /// The normal, twice the area long.
    fn twice_area(&self) -> Vec3 {
        scale(self.normal, 4.0 * length(self.normal))
    }

    /// The rest area times the gradient of the deformation: in the plane that of the points, along the normal from
    /// normal to normal, stretched by the root of how the area has grown, so that scale changes no rotation.
    fn stretched(&self, now: &[[f32; 3]]) -> Matrix {
        let [a, b, c] = self.points.map(|point| wide(now[point as usize]));
        let (ab, ac) = (sub(b, a), sub(c, a));
        let across = cross(ab, ac);
        let root = dot(across, across).sqrt().sqrt();
        let out = scale(across, if root > 0.0 { 1.0 / root } else { 0.0 });
        let [second, third] = self.gradients;
        [0, 1, 2].map(|k| add(scale(self.normal, out[k]), add(scale(second, ab[k]), scale(third, ac[k]))))
    }
}
