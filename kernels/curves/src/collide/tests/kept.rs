//! Curves with what is kept of them at rest, against the path without: the same bits.

use super::*;
use numerics::masked::Masked;
use numerics::parallel;
use numerics::vector::to_f32;

type Mesh = (Vec<Vec3>, Vec<[u32; 3]>);

/// Fur on a mesh, at rest and blown.
pub(in crate::collide) struct Fur {
    pub(in crate::collide) mesh: Mesh,
    pub(in crate::collide) starts: Vec<u32>,
    pub(in crate::collide) rest: Vec<Vec3>,
    pub(in crate::collide) goal: Vec<Vec3>,
    /// The normal of the face under each curve.
    normals: Vec<DVec3>,
}

/// A closed body of unit size: radius by direction, on a grid of latitudes and longitudes.
fn body(rows: u32, radius: impl Fn(f64, f64) -> f64) -> Mesh {
    let columns = 2 * rows;
    let (mut points, mut triangles) = (Vec::new(), Vec::new());
    for row in 0..=rows {
        for column in 0..columns {
            let (v, u) = (f64::from(row) / f64::from(rows), f64::from(column) / f64::from(columns));
            let (side, up) = libm::sincos(std::f64::consts::PI * v);
            let (z, x) = libm::sincos(std::f64::consts::TAU * u);
            points.push(to_f32(DVec3::new(x * side, up, z * side) * radius(u, v)));
            let at = |row: u32, column: u32| row * columns + column % columns;
            if row < rows {
                let [a, b] = [at(row, column), at(row, column + 1)];
                let [c, d] = [at(row + 1, column + 1), at(row + 1, column)];
                triangles.extend([[a, b, d], [b, c, d]]);
            }
        }
    }
    (points, triangles)
}

/// Hairs at random points of the triangles, leaning and bent at random: some start inside or pass through.
fn grown(mesh: Mesh, curves: u64, long: f64, wildness: f64) -> Fur {
    let (mut rest, mut goal, mut starts) = (Vec::new(), Vec::new(), vec![0]);
    let mut normals = Vec::new();
    for curve in 0..curves {
        let key = Key::new(21).of(curve);
        let corners = mesh.1[key.of(0).u64() as usize % mesh.1.len()].map(|corner| to_f64(mesh.0[corner as usize]));
        let (mut a, mut b) = (key.of(1).f64(), key.of(2).f64());
        if a + b > 1.0 {
            (a, b) = (1.0 - a, 1.0 - b);
        }
        let root = corners[0] + (corners[1] - corners[0]) * a + (corners[2] - corners[0]) * b;
        let normal = (corners[1] - corners[0]).cross(&(corners[2] - corners[0])).try_normalize(0.0);
        normals.push(normal.unwrap_or(DVec3::x()));
        let mut along = (normals[curve as usize] + random_vector(key.of(3)) * wildness).normalize();
        let cvs = 2 + key.of(4).u64() as usize % 7;
        let step = long * (0.2 + key.of(5).f64()) / (cvs - 1) as f64;
        let wind = random_unit(Key::new(22).of(curve % 3));
        let [mut at, mut blown] = [root; 2];
        for cv in 0..cvs as u64 {
            rest.push(to_f32(at));
            goal.push(to_f32(blown));
            at += along * step;
            let bent = along + wind * (1.5 * key.of(6).f64()) + random_vector(key.of(7).of(cv)) * wildness;
            blown += bent.try_normalize(1e-9).unwrap_or(along) * step;
            along = (along + random_vector(key.of(8).of(cv)) * 0.3).normalize();
        }
        starts.push(rest.len() as u32);
    }
    Fur { mesh, starts, rest, goal, normals }
}

impl Fur {
    /// Everything scaled, then moved.
    fn placed(&self, scale: f64, to: DVec3) -> Self {
        let place = |points: &[Vec3]| points.iter().map(|p| to_f32(to_f64(*p) * scale + to)).collect();
        let mesh = (place(&self.mesh.0), self.mesh.1.clone());
        let [rest, goal] = [&self.rest, &self.goal].map(|points| place(points));
        Self { mesh, rest, goal, starts: self.starts.clone(), normals: self.normals.clone() }
    }

    /// All curves raised off their faces.
    pub(super) fn raised(mut self, by: f64) -> Self {
        for (ends, normal) in self.starts.windows(2).zip(&self.normals) {
            for cv in ends[0] as usize..ends[1] as usize {
                let raise = |p: Vec3| to_f32(to_f64(p) + normal * by);
                (self.rest[cv], self.goal[cv]) = (raise(self.rest[cv]), raise(self.goal[cv]));
            }
        }
        self
    }

    /// Asserts that all uses of what is kept give the bits of none, with settings in units of `scale`; returns the number of
    /// curves with a half-space.
    fn keeps_its_bits(&self, name: &str, scale: f64, settings: u64) -> usize {
        let (points, triangles) = &self.mesh;
        let tree = TriangleTree::build(points, triangles);
        let normals = normals(points, triangles);
        let pick = |k: u64, values: [f64; 3]| values[(settings / 3_u64.pow(k as u32) % 3) as usize];
        let mask: Vec<f32> = (0..self.rest.len()).map(|cv| (cv % 5) as f32 / 4.0).collect();
        let how = Collide {
            obstacles: &[&tree],
            skin: Some(SkinSurface { tree: &tree, triangles, normals: &normals }),
            method: if settings % 4 == 3 { ContactMethod::Steps(6) } else { ContactMethod::Exact },
            gap: (scale * pick(0, [1e-4, 0.0, 1e-2])).into(),
            offset_root: (scale * pick(1, [1e-4, 0.0, 2e-2])).into(),
            offset_scale: (settings % 5 == 4).then(|| 0.5.into()),
            loft: if settings % 5 == 3 { 0.2 } else { 0.0 }.into(),
            coherence: pick(2, [0.0, 0.0, 1.0]).into(),
            at_rest: None,
            blend: Masked::uniform(1.0),
            width: Masked { value: (scale * pick(3, [0.0, 0.0, 1e-2])) as f32, mask: Some(&mask) },
        };
        let plain = collide(&self.starts, &self.rest, &self.goal, &how);
        let kept = at_rest(&self.starts, &self.rest, &how);
        let described = format!("{plain:?}");
        for used in 0..3 {
            let with = collide(&self.starts, &self.rest, &self.goal, &Collide { at_rest: Some(&kept), ..how.clone() });
            for (cv, (a, b)) in plain.points.iter().zip(&with.points).enumerate() {
                assert_eq!(
                    a.map(f32::to_bits),
                    b.map(f32::to_bits),
                    "{name}, settings {settings}, use {used}, CV {cv}"
                );
            }
            assert_eq!(described, format!("{with:?}"), "{name}, settings {settings}, use {used}");
        }
        kept.half_spaces_found()
    }
}

/// Fur on a body of random spikes.
pub(super) fn burr(curves: u64, long: f64) -> Fur {
    let radius = |u: f64, v: f64| 0.7 + 0.6 * Key::new(5).of(u.to_bits()).of(v.to_bits()).f64();
    grown(body(24, radius), curves, long, 0.5)
}

pub(in crate::collide) fn bodies() -> Vec<(&'static str, Fur)> {
    let sine = |x: f64| libm::sin(std::f64::consts::TAU * x);
    let mut thin = body(12, |_, _| 1.0);
    thin.0.iter_mut().for_each(|p| p[1] *= 1e-3);
    let mut broken = body(12, |u, _| 1.0 + 0.2 * sine(3.0 * u));
    broken.0[40] = [f32::NAN, 0.0, 0.0];
    broken.0[90] = broken.0[91];
    broken.0[120] = broken.0[118];
    broken.1.extend([[5, 5, 5], [60, 61, 61], [10, 70, 200], [130, 131, 130]]);
    let floor = |size: f32| {
        let corner = |x: f32, z: f32| [x * size, 0.0, z * size];
        (vec![corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0)], vec![[0, 1, 2], [0, 2, 3]])
    };
    vec![
        ("sphere", grown(body(20, |_, _| 1.0), 250, 0.2, 0.4)),
        ("long hair", grown(body(12, |_, _| 1.0), 60, 2.5, 0.4)),
        ("folds", grown(body(20, |u, v| 1.0 + 0.4 * sine(5.0 * u) * sine(3.0 * v)), 250, 0.3, 0.5)),
        ("sharp creases", grown(body(16, |u, _| 1.0 + 0.5 * ((8.0 * u).fract() - 0.5).abs()), 250, 0.2, 0.6)),
        ("thin", grown(thin, 250, 0.2, 0.5)),
        ("penetrating", grown(body(12, |_, _| 1.0), 250, 0.4, 2.5)),
        ("broken", grown(broken, 250, 0.2, 0.5)),
        ("burr", burr(250, 0.6)),
        ("floor", grown(floor(2.0), 150, 0.3, 0.7)),
    ]
}

#[test]
fn what_is_kept_changes_no_bit() {
    for (name, fur) in bodies() {
        let mut found = 0;
        for settings in 0..12 {
            found += fur.keeps_its_bits(name, 1.0, settings * 7 + 1);
        }
        assert!(found > fur.starts.len(), "{name}: {found}");
    }
}

#[test]
fn nor_at_other_scales_and_places() {
    for (name, fur) in bodies() {
        for (k, scale) in [1e-12, 1e-4, 1e5, 1e15].into_iter().enumerate() {
            fur.placed(scale, DVec3::zeros()).keeps_its_bits(name, scale, 3 * k as u64 + 2);
            fur.placed(scale, DVec3::zeros()).keeps_its_bits(name, scale, 5 * k as u64);
        }
        for (k, far) in [10.0, 1e3, 1e6].into_iter().enumerate() {
            fur.placed(1.0, DVec3::new(far, -0.3 * far, far)).keeps_its_bits(name, 1.0, 7 * k as u64);
        }
    }
    // Two triangles of a million kilometres: the circle about a segment is known to a fraction of it.
    for size in [1e3_f32, 1e6, 1e9] {
        let points = vec![[-size, 0.0, -size], [-size, 0.0, size], [size, 0.0, size], [size, 0.0, -size]];
        let fur = grown(bodies().swap_remove(8).1.mesh, 300, 0.3, 0.7);
        let fur = Fur { mesh: (points, vec![[0, 1, 2], [0, 2, 3]]), ..fur };
        for settings in 0..6 {
            fur.keeps_its_bits("ground", 1.0, settings);
        }
    }
}

#[test]
fn nor_if_the_goal_leaves_the_reach_that_rest_had() {
    let fur = grown(body(20, |u, v| 1.0 + 0.3 * libm::sin(20.0 * u) * v * (1.0 - v)), 300, 0.2, 0.6);
    let mut longer = fur.placed(1.0, DVec3::zeros());
    longer.goal.clear();
    for ends in fur.starts.windows(2) {
        let cvs = &fur.goal[ends[0] as usize..ends[1] as usize];
        let [root, key] = [to_f64(cvs[0]), random_vector(Key::new(3).of(u64::from(ends[0]))) * 0.2];
        longer.goal.extend(cvs.iter().map(|cv| to_f32(root + key + (to_f64(*cv) - root) * 6.0)));
    }
    (0..9).for_each(|settings| {
        longer.keeps_its_bits("longer", 1.0, settings);
    });
}

#[test]
fn half_spaces_are_found_at_the_second_use_only() {
    let fur = grown(body(12, |_, _| 1.0), 50, 0.2, 0.2);
    let tree = TriangleTree::build(&fur.mesh.0, &fur.mesh.1);
    let normals = normals(&fur.mesh.0, &fur.mesh.1);
    let skin = SkinSurface { tree: &tree, triangles: &fur.mesh.1, normals: &normals };
    let obstacles = [&tree];
    let how = Collide { skin: Some(skin), ..hairs::on(&obstacles) };
    let kept = at_rest(&fur.starts, &fur.rest, &how);
    let how = Collide { at_rest: Some(&kept), ..how.clone() };
    for found in [0, 50, 50] {
        let _ = collide(&fur.starts, &fur.rest, &fur.goal, &how);
        assert_eq!(kept.half_spaces_found(), found);
    }
}

#[test]
fn uses_at_the_same_time_find_the_same() {
    let fur = grown(body(12, |_, _| 1.0), 300, 0.2, 0.2);
    let tree = TriangleTree::build(&fur.mesh.0, &fur.mesh.1);
    let normals = normals(&fur.mesh.0, &fur.mesh.1);
    let skin = SkinSurface { tree: &tree, triangles: &fur.mesh.1, normals: &normals };
    let obstacles = [&tree];
    let how = Collide { skin: Some(skin), offset_root: 0.01.into(), loft: 0.1.into(), ..hairs::on(&obstacles) };
    let alone = collide(&fur.starts, &fur.rest, &fur.goal, &how);
    let shared = AtRest::of(300);
    let how = Collide { at_rest: Some(&shared), ..how.clone() };
    let found = parallel::map(0..16, |_, _| collide(&fur.starts, &fur.rest, &fur.goal, &how));
    assert!(found.iter().all(|found| *found == alone));
    let once = at_rest(&fur.starts, &fur.rest, &Collide { at_rest: None, ..how.clone() });
    assert_eq!(shared.is_low().collect::<Vec<_>>(), once.is_low().collect::<Vec<_>>());
    assert!((0..300).all(|curve| shared.shift(curve) == once.shift(curve)));
    assert_eq!(shared.half_spaces_found(), 300);
}
