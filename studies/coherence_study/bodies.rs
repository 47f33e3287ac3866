//! Bodies that fur grows on: closed meshes and a plane, counter-clockwise from outside, some metres in size.

use numerics::shapes::icosphere;
use numerics::vector::{DVec3, Vec3, to_f32, to_f64};
use std::collections::BTreeMap;

/// A triangle mesh.
#[derive(Clone)]
pub(crate) struct Body {
    pub(crate) points: Vec<Vec3>,
    pub(crate) triangles: Vec<[u32; 3]>,
}

/// Size of the cells in which the animals are meshed, metres.
const CELL: f64 = 0.024;

/// A capsule: its ends and its radius, metres.
type Bone = (DVec3, DVec3, f64);

impl Body {
    pub(crate) fn named(name: &str) -> Self {
        match name {
            "sphere" => Self::sphere(),
            "knot" => Self::knot(),
            "camel" => Self::around(|p| union(&camel(), p)),
            "folds" => Self::around(|p| union(&camel(), p) + folds(p)),
            "plane" => Self::plane(),
            _ => panic!("`{name}`; expected camel, folds, knot, plane or sphere"),
        }
    }

    /// A square of 3 m that faces up.
    fn plane() -> Self {
        let points = [[-1.5, 0.0, -1.5], [-1.5, 0.0, 1.5], [1.5, 0.0, 1.5], [1.5, 0.0, -1.5]];
        Self { points: points.to_vec(), triangles: vec![[0, 1, 2], [0, 2, 3]] }
    }

    /// Of radius 1.
    fn sphere() -> Self {
        let sphere = icosphere(1.0, 5);
        Self { triangles: sphere.triangles(), points: sphere.points.iter().map(|p| to_f32((*p).into())).collect() }
    }

    /// A tube along a trefoil knot.
    fn knot() -> Self {
        const ALONG: u32 = 320;
        const AROUND: u32 = 32;
        let centre = |t: f64| {
            let (s, c) = libm::sincos(t);
            let (s2, c2) = libm::sincos(2.0 * t);
            DVec3::new(s + 2.0 * s2, c - 2.0 * c2, -libm::sin(3.0 * t)) * 0.3
        };
        let (mut points, mut triangles) = (Vec::new(), Vec::new());
        for row in 0..ALONG {
            let t = std::f64::consts::TAU * f64::from(row) / f64::from(ALONG);
            let tangent = (centre(t + 1e-4) - centre(t - 1e-4)).normalize();
            // Perpendicular to both the tube and the line to the axis of the knot.
            let side = tangent.cross(&centre(t)).normalize();
            let across = side.cross(&tangent);
            for column in 0..AROUND {
                let (s, c) = libm::sincos(std::f64::consts::TAU * f64::from(column) / f64::from(AROUND));
                points.push(to_f32(centre(t) + (across * c + side * s) * 0.13));
                let at = |row: u32, column: u32| row % ALONG * AROUND + column % AROUND;
                let [a, b] = [at(row, column), at(row + 1, column)];
                let [c, d] = [at(row + 1, column + 1), at(row, column + 1)];
                triangles.extend([[a, c, b], [a, d, c]]);
            }
        }
        Self { points, triangles }.outwards()
    }

    /// The surface at which a distance is 0, by tetrahedra: every cell is split into six about its diagonal.
    fn around(distance: impl Fn(DVec3) -> f64) -> Self {
        let (low, high) = (DVec3::new(-1.35, -0.1, -0.45), DVec3::new(1.45, 1.95, 0.45));
        let size = ((high - low) / CELL).map(|x| x as usize + 1);
        let at = |i: usize, j: usize, k: usize| low + DVec3::new(i as f64, j as f64, k as f64) * CELL;
        let index = |i: usize, j: usize, k: usize| (k * size.y + j) * size.x + i;
        let mut values = Vec::with_capacity(size.x * size.y * size.z);
        for k in 0..size.z {
            for j in 0..size.y {
                values.extend((0..size.x).map(|i| distance(at(i, j, k))));
            }
        }
        let mut surface = Tets { points: Vec::new(), triangles: Vec::new(), edges: BTreeMap::new() };
        for k in 0..size.z - 1 {
            for j in 0..size.y - 1 {
                for i in 0..size.x - 1 {
                    let corner = |side: usize| [i + (side & 1), j + (side >> 1 & 1), k + (side >> 2)];
                    for [p, q] in [[1, 3], [3, 2], [2, 6], [6, 4], [4, 5], [5, 1]] {
                        let tet = [0, p, q, 7].map(|side| {
                            let [i, j, k] = corner(side);
                            (index(i, j, k), at(i, j, k), values[index(i, j, k)])
                        });
                        surface.add(&tet);
                    }
                }
            }
        }
        Self { points: surface.points, triangles: surface.triangles }
    }

    /// Turned inside out if its volume is negative.
    fn outwards(mut self) -> Self {
        let corner = |k: u32| to_f64(self.points[k as usize]);
        let volume: f64 = self.triangles.iter().map(|[a, b, c]| corner(*a).dot(&corner(*b).cross(&corner(*c)))).sum();
        if volume < 0.0 {
            self.triangles.iter_mut().for_each(|corners| corners.swap(1, 2));
        }
        self
    }
}

/// A surface being made of tetrahedra.
struct Tets {
    points: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    /// The point on each edge that the surface cuts.
    edges: BTreeMap<[usize; 2], u32>,
}

impl Tets {
    /// Adds what lies in a tetrahedron of corners (index, position, distance).
    fn add(&mut self, corners: &[(usize, DVec3, f64); 4]) {
        let (inside, outside): (Vec<_>, Vec<_>) = corners.iter().partition(|corner| corner.2 < 0.0);
        let mut on = |a: &(usize, DVec3, f64), b: &(usize, DVec3, f64)| {
            *self.edges.entry([a.0.min(b.0), a.0.max(b.0)]).or_insert_with(|| {
                // Away from the ends, so that no triangle is a sliver.
                let share = (a.2 / (a.2 - b.2)).clamp(0.1, 0.9);
                self.points.push(to_f32(a.1 + (b.1 - a.1) * share));
                self.points.len() as u32 - 1
            })
        };
        let faces = match (&inside[..], &outside[..]) {
            ([a], [b, c, d]) | ([b, c, d], [a]) => vec![[on(a, b), on(a, c), on(a, d)]],
            ([a, b], [c, d]) => {
                let [ac, ad, bc, bd] = [on(a, c), on(a, d), on(b, c), on(b, d)];
                vec![[ac, ad, bd], [ac, bd, bc]]
            }
            _ => return,
        };
        let middle = |corners: &[(usize, DVec3, f64)]| {
            corners.iter().map(|corner| corner.1).sum::<DVec3>() / corners.len() as f64
        };
        let out = middle(&outside) - middle(&inside);
        for mut face in faces {
            let [a, b, c] = face.map(|point| to_f64(self.points[point as usize]));
            if (b - a).cross(&(c - a)).dot(&out) < 0.0 {
                face.swap(1, 2);
            }
            self.triangles.push(face);
        }
    }
}

/// Distance from the union of capsules: creases where they meet.
fn union(bones: &[Bone], p: DVec3) -> f64 {
    let distance = |(a, b, radius): &Bone| {
        let along = b - a;
        let share = ((p - a).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
        (p - a - along * share).norm() - radius
    };
    bones.iter().map(distance).fold(f64::INFINITY, f64::min)
}

/// Head towards +x, y up, 2.5 m long.
fn camel() -> Vec<Bone> {
    let bone = |a: [f64; 3], b: [f64; 3], radius: f64| (DVec3::from(a), DVec3::from(b), radius);
    let mut bones = vec![
        // Trunk and humps.
        bone([-0.6, 1.05, 0.0], [0.5, 1.05, 0.0], 0.28),
        bone([-0.35, 1.2, 0.0], [-0.3, 1.42, 0.0], 0.16),
        bone([0.2, 1.2, 0.0], [0.22, 1.4, 0.0], 0.16),
        // Neck, head, jaw, ears, tail.
        bone([0.55, 1.0, 0.0], [0.95, 0.95, 0.0], 0.15),
        bone([0.95, 0.95, 0.0], [1.1, 1.55, 0.0], 0.1),
        bone([1.08, 1.62, 0.0], [1.3, 1.56, 0.0], 0.1),
        bone([1.3, 1.52, 0.0], [1.36, 1.48, 0.0], 0.07),
        bone([1.02, 1.68, 0.08], [0.98, 1.8, 0.11], 0.03),
        bone([1.02, 1.68, -0.08], [0.98, 1.8, -0.11], 0.03),
        bone([-0.86, 1.1, 0.0], [-1.05, 0.6, 0.0], 0.035),
    ];
    for z in [-0.17, 0.17] {
        for (x, knee) in [(0.45, 0.02), (-0.62, -0.05)] {
            bones.push(bone([x, 0.95, z], [x + knee, 0.5, z], 0.11));
            bones.push(bone([x + knee, 0.5, z], [x, 0.06, z], 0.05));
            bones.push(bone([x, 0.03, z], [x + 0.06, 0.03, z], 0.055));
        }
    }
    bones
}

/// What is taken off the distance for folds across the trunk: grooves 5 cm deep, 14 cm apart, with sharp bottoms.
fn folds(p: DVec3) -> f64 {
    let wave = libm::sin(std::f64::consts::TAU * (p.x + 0.3 * p.y) / 0.28).abs();
    let trunk = ((0.62 - p.x.abs()) / 0.1).clamp(0.0, 1.0) * ((p.y - 0.7) / 0.1).clamp(0.0, 1.0);
    0.05 * trunk * (1.0 - wave)
}
