//! Which point of a skin each root is bound to, and how the skin around it has moved and rotated.

use super::closest::ClosestFaces;
use super::pose::RootPose;
use super::rotation::nearest_rotations;
use super::triangle_lanes::{Area, Columns, TriangleLanes, deformations, direction_or_zero};
use crate::surface::SurfacePoint;
use numerics::lanes::{F64x16, LANES};
use numerics::parallel;
use numerics::simd::{Path, kernel};
use numerics::vector::{DQuat, DVec3, to_f64};
use std::ops::{Add, Mul};

/// Number of rows in a task, in whole groups: some 20 µs of work.
const TASK: usize = 256;

/// Number of roots that a task binds: some 100 µs of work.
const BOUND_AT_ONCE: usize = 64;

/// Roots bound to a skin at rest; see [`crate::attach`]. Of the skin it keeps only the triangles around the roots.
#[derive(Clone, Debug)]
pub struct SkinBinding {
    roots: Vec<BoundRoot>,
    /// The corners of the triangles that hold a root, in the order of the skin's points, so that neighbours in the mesh
    /// are neighbours in memory.
    vertices: Vec<BoundVertex>,
    /// Rows of `triangles` around each vertex, one vertex after another.
    incident: Vec<u32>,
    triangles: Vec<TriangleLanes>,
    max_distance: f64,
}

/// The binding of one root.
#[derive(Clone, Copy, Debug)]
struct BoundRoot {
    /// At rest, metres.
    position: DVec3,
    /// From the skin to the root at rest, metres.
    offset: DVec3,
    /// Rows of `vertices`.
    vertices: [u32; 3],
    /// Barycentric weights.
    weights: [f64; 3],
}

/// A point of the skin.
#[derive(Clone, Copy, Debug)]
struct BoundVertex {
    /// Its index.
    point: u32,
    /// At rest, metres.
    position: DVec3,
    /// End of its rows in `incident`.
    incident_end: u32,
    /// 1 ÷ the area of the triangles around it; 0 if they have none.
    inverse_area: f64,
    /// The sum of the normals of the triangles around it, each as long as its triangle's area.
    area_vector: DVec3,
}

/// No row.
const NONE: u32 = u32::MAX;

/// Of the triangles, rows of `points`, the one closest to each of `places`, of several the first; all in metres. `None` if
/// there are places but no triangle with finite corners.
///
/// # Panics
/// If a corner of `triangles` is out of range.
pub fn closest_triangles(points: &[[f32; 3]], triangles: &[[u32; 3]], places: &[[f32; 3]]) -> Option<Vec<u32>> {
    let found = closest(points, triangles, places)?;
    Some(found.iter().map(|found| found.triangle).collect())
}

fn closest(points: &[[f32; 3]], triangles: &[[u32; 3]], places: &[[f32; 3]]) -> Option<Vec<SurfacePoint>> {
    if places.is_empty() {
        return Some(Vec::new());
    }
    let faces = ClosestFaces::new(points, triangles)?;
    Some(parallel::concat(parallel::map(places.chunks(BOUND_AT_ONCE), |_, places| faces.find_each(places))))
}

impl SkinBinding {
    /// Binds `roots` to the closest points of `triangles`, rows of `points`; all in metres. `None` if there are roots
    /// but no triangle with finite corners. A root that is not finite is bound to the first triangle.
    ///
    /// # Panics
    /// If a corner of `triangles` is out of range.
    pub fn to_closest(points: &[[f32; 3]], triangles: &[[u32; 3]], roots: &[[f32; 3]]) -> Option<Self> {
        let surface = closest(points, triangles, roots)?;
        Some(Self::new(points, triangles, &surface, roots.iter().map(|root| to_f64(*root)).collect()))
    }

    /// Binds roots that lie on the skin.
    ///
    /// # Panics
    /// If a corner of `triangles`, or a root's triangle, is out of range.
    pub fn to_surface(points: &[[f32; 3]], triangles: &[[u32; 3]], roots: &[SurfacePoint]) -> Self {
        let positions = roots.iter().map(|root| root.position(points, triangles)).collect();
        Self::new(points, triangles, roots, positions)
    }

    /// Binds roots at `positions` to points of the surface.
    fn new(points: &[[f32; 3]], faces: &[[u32; 3]], surface: &[SurfacePoint], positions: Vec<DVec3>) -> Self {
        let (mut vertices, row_of) = bound_vertices(points, faces, surface);
        let is_bound = |corner: &u32| row_of[*corner as usize] != NONE;
        let around: Vec<[u32; 3]> = faces.iter().filter(|corners| corners.iter().any(is_bound)).copied().collect();
        let simd = Path::chosen();
        let blocks = parallel::map(around.chunks(TASK), |_, corners| {
            corners.chunks(LANES).map(|corners| TriangleLanes::new(simd, points, corners)).collect::<Vec<_>>()
        });
        let (triangles, areas): (Vec<TriangleLanes>, Vec<[Area; LANES]>) = blocks.into_iter().flatten().unzip();

        let rows = |corners: &[u32; 3]| corners.map(|corner| row_of[corner as usize]);
        let incident = link_incident(&mut vertices, around.iter().map(rows));
        let areas = areas.as_flattened();
        for row in 0..vertices.len() {
            let around = incident[range(&vertices, row)].iter().map(|triangle| areas[*triangle as usize]);
            let area: f64 = around.clone().map(|(_, area)| area).sum();
            vertices[row].inverse_area = if area > 0.0 { 1.0 / area } else { 0.0 };
            vertices[row].area_vector = around.map(|(vector, _)| vector).fold(DVec3::zeros(), Add::add);
        }
        let root = |(on, position): (&SurfacePoint, DVec3)| {
            let offset = position - on.position(points, faces);
            BoundRoot { position, offset, vertices: rows(&faces[on.triangle as usize]), weights: on.weights }
        };
        let roots: Vec<BoundRoot> = surface.iter().zip(positions).map(root).collect();
        let max_distance = roots.iter().map(|root| root.offset.norm()).fold(0.0, f64::max);
        Self { roots, vertices, incident, triangles, max_distance }
    }

    /// The largest distance of a root from the skin, metres.
    pub fn max_distance(&self) -> f64 {
        self.max_distance
    }

    /// Number of roots whose distance from the skin is more than the length of their curve, which is
    /// `points[starts[i]..starts[i + 1]]`. Curves without length are not counted.
    ///
    /// # Panics
    /// If there are fewer curves than roots, or `starts` is out of range.
    pub fn far_roots(&self, starts: &[u32], points: &[[f32; 3]]) -> usize {
        let segment = |pair: &[[f32; 3]]| (to_f64(pair[1]) - to_f64(pair[0])).norm();
        let is_far = |(root, ends): &(&BoundRoot, &[u32])| {
            let (distance, curve) = (root.offset.norm(), &points[ends[0] as usize..ends[1] as usize]);
            // Most are clear after one segment.
            let mut lengths = curve.windows(2).map(segment);
            let first = lengths.next().unwrap_or(0.0);
            distance > first && (1e-300..distance).contains(&(first + lengths.sum::<f64>()))
        };
        self.roots.iter().zip(starts.windows(2)).filter(is_far).count()
    }

    /// The roots at rest, metres.
    pub fn roots(&self) -> impl ExactSizeIterator<Item = DVec3> {
        self.roots.iter().map(|root| root.position)
    }

    /// The skin's unit normal at each root, at rest; zero where it has none.
    pub fn normals(&self) -> Vec<DVec3> {
        let normals: Vec<DVec3> = self.vertices.iter().map(|vertex| direction_or_zero(vertex.area_vector)).collect();
        let normal = |vertex: u32| normals[vertex as usize];
        self.roots.iter().map(|root| direction_or_zero(weighted(root.weights, root.vertices.map(normal)))).collect()
    }

    /// How each root has moved and rotated since rest, given the skin's current points `now`.
    ///
    /// # Panics
    /// If there are fewer points than at rest.
    pub fn poses(&self, now: &[[f32; 3]]) -> Vec<RootPose> {
        let simd = Path::chosen();
        let mut deformed = vec![[[0.0; 9]; LANES]; self.triangles.len()];
        parallel::fill(&mut deformed, TASK / LANES, |block| deformations(simd, &self.triangles[block], now));
        let deformed = deformed.as_flattened();
        let mut motions = vec![[VertexMotion::NONE; LANES]; self.vertices.len().div_ceil(LANES)];
        parallel::fill(&mut motions, TASK / LANES, |block| vertex_motions(simd, self, LANES * block, deformed, now));
        let motions = motions.as_flattened();
        let rest = RootPose { translation: DVec3::zeros(), rotation: DQuat::identity(), lost: false };
        let mut poses = vec![rest; self.roots.len()];
        let pose_group = |poses: &mut [RootPose], roots: &[BoundRoot]| {
            let rotations = nearest_rotations(simd, &gradients_at(simd, roots, motions));
            for ((pose, root), rotation) in poses.iter_mut().zip(roots).zip(rotations) {
                let translations = root.vertices.map(|vertex| motions[vertex as usize].displacement);
                let translation = weighted(root.weights, translations);
                let lost = rotation.is_none();
                let rotation = rotation.unwrap_or_else(DQuat::identity);
                let translation = translation + (rotation * root.offset - root.offset);
                *pose = RootPose { translation, rotation, lost };
            }
        };
        parallel::for_each(poses.chunks_mut(TASK).zip(self.roots.chunks(TASK)), |_, (poses, roots)| {
            poses.chunks_mut(LANES).zip(roots.chunks(LANES)).for_each(|(poses, roots)| pose_group(poses, roots));
        });
        poses
    }
}

/// How the skin around a vertex has moved since rest.
#[derive(Clone, Copy)]
struct VertexMotion {
    /// The mean gradient of deformation.
    gradient: Columns,
    /// Of the vertex itself, metres.
    displacement: DVec3,
}

impl VertexMotion {
    const NONE: Self = Self { gradient: [0.0; 9], displacement: DVec3::new(0.0, 0.0, 0.0) };
}

kernel! {
    /// The motions of sixteen vertices from row `first` on, given the deformation of each triangle and the skin's current
    /// points `now`; zero where there is no vertex.
    fn vertex_motions(binding: &SkinBinding, first: usize, deformed: &[Columns], now: &[[f32; 3]])
        -> [VertexMotion; LANES] = motions;
}

#[inline(always)]
fn motions(binding: &SkinBinding, first: usize, deformed: &[Columns], now: &[[f32; 3]]) -> [VertexMotion; LANES] {
    let mut motions = [VertexMotion::NONE; LANES];
    for (motion, row) in motions.iter_mut().zip(first..binding.vertices.len()) {
        let vertex = &binding.vertices[row];
        for triangle in &binding.incident[range(&binding.vertices, row)] {
            let deformed = &deformed[*triangle as usize];
            for entry in 0..9 {
                motion.gradient[entry] += deformed[entry] * vertex.inverse_area;
            }
        }
        motion.displacement = to_f64(now[vertex.point as usize]) - vertex.position;
    }
    motions
}

kernel! {
    /// The gradient of deformation at up to sixteen roots, one a lane; 0 on lanes without one.
    fn gradients_at(roots: &[BoundRoot], motions: &[VertexMotion]) -> [F64x16; 9] = gradients;
}

#[inline(always)]
fn gradients(roots: &[BoundRoot], motions: &[VertexMotion]) -> [F64x16; 9] {
    let mut lanes = [F64x16::ZERO; 9];
    for (lane, root) in roots.iter().enumerate() {
        let [a, b, c] = root.vertices;
        let [a, b, c] = [&motions[a as usize].gradient, &motions[b as usize].gradient, &motions[c as usize].gradient];
        for entry in 0..9 {
            lanes[entry].0[lane] = weighted(root.weights, [a[entry], b[entry], c[entry]]);
        }
    }
    lanes
}

/// The corners of the triangles that `surface` names, and the row of each of the skin's points among them.
fn bound_vertices(
    points: &[[f32; 3]],
    triangles: &[[u32; 3]],
    surface: &[SurfacePoint],
) -> (Vec<BoundVertex>, Vec<u32>) {
    let mut row_of = vec![NONE; points.len()];
    for on in surface {
        triangles[on.triangle as usize].iter().for_each(|corner| row_of[*corner as usize] = 0);
    }
    let mut vertices = Vec::new();
    for (point, row) in row_of.iter_mut().enumerate().filter(|(_, row)| **row != NONE) {
        *row = vertices.len() as u32;
        let (position, area_vector) = (to_f64(points[point]), DVec3::zeros());
        vertices.push(BoundVertex { point: point as u32, position, incident_end: 0, inverse_area: 0.0, area_vector });
    }
    (vertices, row_of)
}

/// The triangles around each vertex, where `corners` gives the rows of each triangle's corners; sets `incident_end`.
fn link_incident(vertices: &mut [BoundVertex], corners: impl Iterator<Item = [u32; 3]> + Clone) -> Vec<u32> {
    let bound = |rows: [u32; 3]| rows.into_iter().filter(|row| *row != NONE);
    for row in corners.clone().flat_map(bound) {
        vertices[row as usize].incident_end += 1;
    }
    let mut total = 0;
    for vertex in &mut *vertices {
        (total, vertex.incident_end) = (total + vertex.incident_end, total);
    }
    let mut incident = vec![0; total as usize];
    for (triangle, rows) in corners.enumerate() {
        for row in bound(rows) {
            let vertex = &mut vertices[row as usize];
            incident[vertex.incident_end as usize] = triangle as u32;
            vertex.incident_end += 1;
        }
    }
    incident
}

/// The range of `incident` that holds the triangles around a vertex.
#[inline(always)]
fn range(vertices: &[BoundVertex], row: usize) -> std::ops::Range<usize> {
    let start = row.checked_sub(1).map_or(0, |before| vertices[before].incident_end);
    start as usize..vertices[row].incident_end as usize
}

/// The weighted sum of three.
#[inline(always)]
fn weighted<T: Mul<f64, Output = T> + Add<Output = T>>([first, second, third]: [f64; 3], [a, b, c]: [T; 3]) -> T {
    a * first + b * second + c * third
}
