//! Shelter against closed forms and against counting rays.

use super::*;
use numerics::random::Key;
use numerics::shapes;
use numerics::vector::{DVec3, to_f64};

/// A sphere of radius 1.
fn sphere(n: usize) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let mesh = shapes::sphere([2.0; 3], n);
    (mesh.points.iter().map(|point| point.map(|x| x as f32)).collect(), mesh.triangles())
}

/// Curves of one CV each.
fn lone(points: &[Vec3]) -> Vec<u32> {
    (0..=points.len() as u32).collect()
}

pub(super) const STILL: Shield<'static> = Shield {
    wind: [1.0, 0.0, 0.0],
    offset: Masked::uniform(10.0),
    distance: 0.0,
    falloff: 1.0,
    cone: 0.0,
    skin_gap: 0.0,
};

/// The result for each point as a curve of one CV.
fn shares(points: &[Vec3], mesh: &(Vec<Vec3>, Vec<[u32; 3]>), how: &Shield<'_>) -> Vec<f32> {
    shield(&lone(points), points, &[Collider::of(&mesh.0, &mesh.1)], how)
}

/// A wall across x at `x`, two units high and wide.
fn wall(x: f32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    (vec![[x, -1.0, -1.0], [x, 1.0, -1.0], [x, 1.0, 1.0], [x, -1.0, 1.0]], vec![[0, 1, 2], [0, 2, 3]])
}

#[test]
fn half_a_curve_behind_a_wall_is_half_sheltered() {
    let points = [[0.5, 0.0, 0.0], [0.5, 0.9, 0.0], [0.5, 1.1, 0.0], [0.5, 3.0, 0.0], [-0.5, 0.0, 0.0]];
    let (wall, triangles) = wall(0.0);
    let colliders = [Collider::of(&wall, &triangles)];
    assert_eq!(shield(&[0, 4, 5], &points, &colliders, &STILL), [0.5, 0.0]);
    assert_eq!(shield(&[0, 4, 5], &points, &colliders, &Shield { offset: 0.49.into(), ..STILL }), [0.0, 0.0]);
    assert_eq!(shield(&[0, 4, 5], &points, &colliders, &Shield { wind: [-3.0, 0.0, 0.0], ..STILL }), [0.0, 1.0]);
    assert_eq!(shield(&[0, 4, 5], &points, &[], &STILL), [0.0, 0.0]);
    assert_eq!(shield(&[0, 4, 5], &points, &colliders, &Shield { offset: 0.0.into(), ..STILL }), [0.0, 0.0]);
}

/// Each CV looks as far as its own mask says, along a line, through a cone, and where shelter fades.
#[test]
fn a_mask_of_the_offset_is_each_cvs_own() {
    let (wall, triangles) = wall(0.0);
    let colliders = [Collider::of(&wall, &triangles)];
    // Rows of CVs 0.5, 1 and 1.5 m behind the wall, near the middle of it.
    let at = |k: usize| [0.5 + 0.5 * (k % 3) as f32, 0.01 * k as f32 - 0.1, 0.02];
    let points: Vec<Vec3> = (0..24).map(at).collect();
    let mask: Vec<f32> = (0..24).map(|k| [0.0, 0.07, 0.12, -1.0, f32::NAN, 0.16][k / 4]).collect();
    for (cone, distance) in [(0.0, 0.0), (0.0, 4.0), (0.05, 0.0), (0.05, 4.0)] {
        let how = Shield { cone, distance, ..STILL };
        let found = shield(
            &lone(&points),
            &points,
            &colliders,
            &Shield { offset: Masked { value: 10.0, mask: Some(&mask) }, ..how },
        );
        for k in 0..24 {
            let offset = Masked::uniform(10.0 * mask[k]);
            let alone = shield(&[0, 1], &points[k..=k], &colliders, &Shield { offset, ..how });
            assert!((found[k] - alone[0]).abs() < 1e-5, "{k}: {} {}", found[k], alone[0]);
            assert_eq!(found[k] > 0.0, 10.0 * mask[k] > points[k][0], "{k}");
        }
    }
}

#[test]
fn two_walls_shelter_all_that_either_shelters() {
    let (low, triangles) = wall(0.0);
    let high: Vec<Vec3> = low.iter().map(|[x, y, z]| [x - 1.0, y + 2.5, *z]).collect();
    let points = [[0.5, 0.0, 0.0], [0.5, 2.0, 0.0], [0.5, 1.2, 0.0]];
    let colliders = [&low, &high].map(|points| Collider::of(points, &triangles));
    assert_eq!(shield(&lone(&points), &points, &colliders, &STILL), [1.0, 1.0, 0.0]);
}

#[test]
fn a_sphere_shelters_its_silhouette_at_any_offset() {
    // A ray upwind along x from p meets the unit sphere where y² + z² < 1, between √(1 − y² − z²) either side of
    // x = 0. The mesh lies within 3e-4 of the sphere: points closer than that to the silhouette are left out.
    let mesh = sphere(64);
    let points: Vec<Vec3> =
        (0..4000u64).map(|i| [0, 1, 2].map(|axis| Key::new(1).of(i).of(axis).f32() * 5.0 - 2.5)).collect();
    for offset in [0.2, 1.0, 3.0, 10.0, 1e4] {
        let found = shares(&points, &mesh, &Shield { offset: offset.into(), ..STILL });
        let mut sure = 0;
        for (point, found) in points.iter().zip(found) {
            let [x, y, z] = point.map(f64::from);
            let inside = 1.0 - y * y - z * z;
            let half = inside.max(0.0).sqrt();
            let distances = [x + half, x - half];
            let near = |distance: f64| {
                distance.abs() < 2e-3 / half.max(1e-2) || (distance - f64::from(offset)).abs() < 2e-3 / half.max(1e-2)
            };
            if inside.abs() < 2e-3 || distances.iter().any(|distance| near(*distance)) {
                continue;
            }
            let expected = inside > 0.0
                && distances.iter().any(|distance| (0.0..=f64::from(offset)).contains(distance) && *distance > 0.0);
            assert_eq!(found, f32::from(u8::from(expected)), "{point:?} at {offset}");
            sure += 1;
        }
        assert!(sure > 3000, "{sure}");
    }
}

#[test]
fn roots_on_a_sphere_are_sheltered_on_its_lee_side_only() {
    // On the vertices, on the middles of edges and in faces, at any turn of the wind; a face's width from the
    // terminator.
    let (points, triangles) = sphere(24);
    let mut roots = points.clone();
    for [a, b, c] in &triangles {
        let [a, b, c] = [a, b, c].map(|point| points[*point as usize]);
        roots.push([0, 1, 2].map(|k| 0.5 * (a[k] + b[k])));
        roots.push([0, 1, 2].map(|k| (a[k] + b[k] + c[k]) / 3.0));
    }
    let mesh = (points, triangles);
    for wind in [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.3, 0.5, -0.8], [1.0, 1.0, 1.0]] {
        let found = shares(&roots, &mesh, &Shield { wind, ..STILL });
        let downwind = DVec3::from(wind).normalize();
        for (root, found) in roots.iter().zip(found) {
            let lee = to_f64(*root).dot(&downwind);
            if lee.abs() > 0.07 {
                assert_eq!(found, f32::from(u8::from(lee > 0.0)), "{root:?} in {wind:?}");
            }
        }
    }
}

#[test]
fn a_flat_ground_shelters_nothing_that_grows_on_it() {
    let ground = shapes::grid([2.0; 2], 20);
    let mesh = (ground.points.iter().map(|p| p.map(|x| x as f32)).collect::<Vec<Vec3>>(), ground.triangles());
    let roots: Vec<Vec3> = (0..500u64)
        .map(|i| [Key::new(2).of(i).of(0).f32() * 1.8 - 0.9, 0.0, Key::new(2).of(i).of(1).f32() * 1.8 - 0.9])
        .collect();
    for wind in [[1.0, 0.0, 0.0], [1.0, 1e-3, 0.2], [1.0, 0.3, 0.0], [0.0, -1.0, 0.0]] {
        for cone in [0.0, 0.1] {
            assert!(shares(&roots, &mesh, &Shield { wind, cone, ..STILL }).iter().all(|share| *share == 0.0));
        }
    }
}

#[test]
fn reversing_the_wind_mirrors_the_shelter() {
    let (points, triangles) = sphere(16);
    let curves: Vec<Vec3> =
        (0..600u64).map(|i| [0, 1, 2].map(|axis| Key::new(3).of(i).of(axis).f32() * 3.0 - 1.5)).collect();
    let mirrored: Vec<Vec3> = curves.iter().map(|[x, y, z]| [-x, *y, *z]).collect();
    let mirror: Vec<Vec3> = points.iter().map(|[x, y, z]| [-x, *y, *z]).collect();
    let starts: Vec<u32> = (0..=120).map(|curve| 5 * curve).collect();
    let one = shield(&starts, &curves, &[Collider::of(&points, &triangles)], &STILL);
    let back = Shield { wind: [-1.0, 0.0, 0.0], ..STILL };
    let other = shield(&starts, &mirrored, &[Collider::of(&mirror, &triangles)], &back);
    assert_eq!(one, other);
    assert!(one.iter().any(|share| *share > 0.3 && *share < 0.9));
}

#[test]
fn no_ray_passes_between_triangles_that_share_points() {
    // A crumpled sheet; rays exactly at its vertices, at the middles of its edges and just beside both.
    let n = 12u32;
    let at = |i: u32, j: u32| {
        let key = Key::new(4).of(u64::from(i)).of(u64::from(j));
        [key.of(0).f32() * 0.2, i as f32 + 0.6 * key.of(1).f32(), j as f32 + 0.6 * key.of(2).f32()]
    };
    let points: Vec<Vec3> = (0..=n).flat_map(|i| (0..=n).map(move |j| at(i, j))).collect();
    let corner = |i: u32, j: u32| i * (n + 1) + j;
    let faces = (0..n).flat_map(|i| (0..n).map(move |j| (i, j)));
    let triangles: Vec<[u32; 3]> = faces
        .flat_map(|(i, j)| {
            let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
            [[a, b, c], [a, c, d]]
        })
        .collect();
    let mut behind = Vec::new();
    for i in 2..n - 2 {
        for j in 2..n - 2 {
            let (p, q) = (at(i, j), at(i + 1, j + 1));
            behind.extend([[1.0, p[1], p[2]], [1.0, 0.5 * (p[1] + q[1]), 0.5 * (p[2] + q[2])]]);
            behind.push([1.0, p[1] + 1e-6, p[2] - 1e-6]);
        }
    }
    let mesh = (points, triangles);
    for turn in 0..20 {
        let wind = [1.0, 0.02 * f64::from(turn) - 0.2, 0.01 * f64::from(turn)];
        assert!(shares(&behind, &mesh, &Shield { wind, ..STILL }).iter().all(|share| *share == 1.0));
    }
}

#[test]
fn shelter_is_the_same_at_any_scale_and_far_from_the_origin() {
    let (points, triangles) = sphere(16);
    let curves: Vec<Vec3> =
        (0..600u64).map(|i| [0, 1, 2].map(|axis| Key::new(5).of(i).of(axis).f32() * 3.0 - 1.5)).collect();
    let starts: Vec<u32> = (0..=120).map(|curve| 5 * curve).collect();
    for cone in [0.0, 0.1] {
        let how =
            Shield { wind: [0.5, 0.4, 0.8], offset: 8.0.into(), distance: 0.0, falloff: 1.0, cone, skin_gap: 0.0 };
        let expected = shield(&starts, &curves, &[Collider::of(&points, &triangles)], &how);
        for power in [-40, -10, 20, 100] {
            let scale = libm::scalbnf(1.0, power);
            let [points, curves] =
                [&points, &curves].map(|all| -> Vec<Vec3> { all.iter().map(|p| p.map(|x| x * scale)).collect() });
            let how = Shield { offset: how.offset.map(|offset| offset * scale), ..how };
            let found = shield(&starts, &curves, &[Collider::of(&points, &triangles)], &how);
            assert_eq!(found, expected, "{scale}");
        }
    }
}

#[test]
fn any_input_gives_a_fraction() {
    let inf = f32::INFINITY;
    let points = [[f32::NAN, 0.0, 0.0], [inf, 0.0, 0.0], [1e38, -1e38, 1e38], [1e-45, 0.0, 0.0], [0.5, 0.0, 0.0]];
    let (mut wall, triangles) = wall(0.0);
    for cone in [0.0, 0.1] {
        for (offset, distance) in
            [(1e-45, 0.0), (10.0, 0.0), (f32::MAX, 0.0), (10.0, 1e-45), (f32::MAX, f32::MAX), (10.0, 0.7)]
        {
            let how = Shield { offset: offset.into(), distance, falloff: distance, cone, ..STILL };
            for mesh in [wall.clone(), vec![[0.0; 3]; 4], vec![[f32::NAN; 3]; 4], vec![[3e38, -3e38, 3e38]; 4]] {
                let colliders = [Collider::of(&mesh, &triangles)];
                let found = shield(&[0, 3, 3, 5], &points, &colliders, &how);
                assert!(found.len() == 3 && found.iter().all(|share| (0.0..=1.0).contains(share)), "{found:?}");
            }
        }
    }
    wall.clear();
    let nothing = [Collider::of(&wall, &[])];
    assert_eq!(shield(&[0, 1], &points[4..], &nothing, &STILL), [0.0]);
    assert!(shield(&[], &[], &nothing, &STILL).is_empty());
    assert!(shield(&[0], &[], &nothing, &STILL).is_empty());
}

/// Rays far apart are followed alone, those close together side by side: here the same rays among others far away, and
/// sixteen times at one place.
#[test]
fn rays_see_the_same_alone_and_side_by_side() {
    let (points, triangles) = sphere(60);
    let colliders = [Collider::of(&points, &triangles)];
    let at = |i: u64| [0, 1, 2].map(|axis| Key::new(8).of(i).of(axis).f32() * 3.0 - 1.5);
    let alone: Vec<Vec3> = (0..200).map(at).collect();
    let how = Shield { wind: [0.5, 0.4, 0.8], ..STILL };
    let expected = shield(&lone(&alone), &alone, &colliders, &how);
    assert!(expected.contains(&1.0) && expected.contains(&0.0));
    for (one, expected) in alone.iter().zip(&expected) {
        let crowd = vec![*one; LANES];
        assert_eq!(shield(&lone(&crowd), &crowd, &colliders, &how), vec![*expected; LANES]);
    }
}

#[test]
fn every_simd_path_and_any_number_of_threads_gives_the_same_bits() {
    let (points, triangles) = sphere(20);
    let curves: Vec<Vec3> =
        (0..3000u64).map(|i| [0, 1, 2].map(|axis| Key::new(6).of(i).of(axis).f32() * 3.0 - 1.5)).collect();
    let starts: Vec<u32> = (0..=600).map(|curve| 5 * curve).collect();
    let colliders = [Collider::of(&points, &triangles)];
    for (cone, distance) in [(0.0, 0.0), (0.07, 0.0), (0.0, 0.8), (0.07, 0.8)] {
        let how = Shield { wind: [0.5, 0.4, 0.8], cone, distance, falloff: 1.7, ..STILL };
        let expected = shield_on(Path::BASELINE, &starts, &curves, &colliders, &how);
        for path in Path::all() {
            for threads in [1, 2, 7] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                let found = pool.install(|| shield_on(path, &starts, &curves, &colliders, &how));
                assert_eq!(found, expected, "{} on {threads}", path.name());
            }
        }
    }
}

#[test]
fn a_ray_that_meets_a_sphere_fades_with_its_distance_in_closed_form() {
    // Roots downwind of the unit sphere, along x from it: the far side of the sphere as seen from them is nearest, at
    // x − √(1 − y² − z²), less the sagitta of the facets.
    let (points, triangles) = sphere(64);
    let roots: Vec<Vec3> = (0..400u64)
        .map(|i| {
            let key = Key::new(9).of(i);
            [1.2 + key.of(0).f32(), 1.4 * key.of(1).f32() - 0.7, 1.4 * key.of(2).f32() - 0.7]
        })
        .filter(|[_, y, z]| y * y + z * z < 0.6)
        .collect();
    let how = Shield { distance: 2.0, falloff: 2.5, ..STILL };
    let found = shares(&roots, &(points, triangles), &how);
    for ([x, y, z], found) in roots.iter().zip(found) {
        let s = f64::from(*x) - (1.0 - f64::from(y * y + z * z)).sqrt();
        let expected = libm::pow((1.0 - s / 2.0).max(0.0), 2.5);
        assert!((f64::from(found) - expected).abs() < 4e-3, "{x} {y} {z}: {found} for {expected}");
    }
}

mod cones {
    use super::*;

    /// The fraction of 20,000 rays, evenly spread over the disc of a cone, that hit the sphere.
    fn sampled(p: Vec3, mesh: &(Vec<Vec3>, Vec<[u32; 3]>), cone: f64) -> f32 {
        let slope = libm::tan(cone);
        let n = 2000;
        let mut met = 0.0;
        for k in 0..n {
            let radius = slope * ((f64::from(k) + 0.5) / f64::from(n)).sqrt();
            let angle = 2.399_963 * f64::from(k);
            let wind = [1.0, radius * libm::cos(angle), radius * libm::sin(angle)];
            met += shares(&[p], mesh, &Shield { wind, offset: 100.0.into(), ..STILL })[0];
        }
        met / n as f32
    }

    #[test]
    fn the_covered_fraction_of_a_cone_matches_that_of_many_rays() {
        let mesh = sphere(8);
        for p in [
            [3.0, 0.9, 0.1],
            [3.0, 1.0, 0.0],
            [2.5, -0.8, 0.75],
            [6.0, 0.5, 0.7],
            [1.2, 0.9, 0.3],
            [20.0, 0.3, 0.2],
            [3.0, 0.0, 0.0],
            [3.0, 2.0, 0.0],
            [-3.0, 0.0, 0.0],
        ] {
            for cone in [0.02_f32, 0.1, 0.3] {
                let how = Shield { offset: 1e6.into(), cone, ..STILL };
                let (found, expected) = (shares(&[p], &mesh, &how)[0], sampled(p, &mesh, f64::from(cone)));
                assert!((found - expected).abs() < 3e-3, "{p:?}, {cone}: {found}, expected {expected}");
            }
        }
    }

    #[test]
    fn a_cone_centred_on_an_edge_is_half_covered_for_either_winding() {
        let (points, triangles) = wall(0.0);
        let turned: Vec<[u32; 3]> = triangles.iter().map(|[a, b, c]| [*a, *c, *b]).collect();
        let loose: Vec<Vec3> = triangles.iter().flatten().map(|point| points[*point as usize]).collect();
        for mesh in [(points.clone(), triangles), (points, turned), (loose, vec![[0, 1, 2], [3, 4, 5]])] {
            let how = Shield { cone: 0.1, offset: 1e6.into(), ..STILL };
            let slope = libm::tan(0.1) as f32;
            // At the edge; half a radius inside (1 − 0.1955); a quarter at the corner; fully covered, and not at all.
            let at = |y: f32, z: f32| shares(&[[2.0, y, z]], &mesh, &how)[0];
            for (y, z, expected) in [
                (1.0, 0.3, 0.5),
                (1.0 - slope, 0.3, 0.804_5),
                (1.0 + slope, 0.3, 0.195_5),
                (1.0, 1.0, 0.25),
                (0.0, 0.0, 1.0),
                (1.5, 0.0, 0.0),
            ] {
                assert!((at(y, z) - expected).abs() < 1e-4, "{y} {z}: {}, expected {expected}", at(y, z));
            }
        }
    }

    #[test]
    fn covered_fractions_are_continuous_as_the_wind_turns() {
        // A hundred thousandth of a turn at a time past a tumbled cube: a ray's share would jump by 1.
        let cube = shapes::block([1.0; 3], [1; 3]);
        let triangles = cube.triangles();
        let points: Vec<Vec3> = cube
            .points
            .iter()
            .map(|[x, y, z]| [0.8 * x - 0.6 * y, 0.48 * x + 0.64 * y - 0.6 * z, 0.36 * x + 0.48 * y + 0.8 * z])
            .map(|p| p.map(|x| x as f32))
            .collect();
        let mesh = (points, triangles);
        let cvs = [[1.0, 0.0, 0.0], [2.0, 0.2, 0.1], [1.0, -0.4, 0.5]];
        let mut before: Option<Vec<f32>> = None;
        let (mut least, mut most) = (1.0_f32, 0.0_f32);
        let mut largest = 0.0_f32;
        for step in 0..20_000 {
            let angle = f64::from(step) * 1e-4 - 1.0;
            let wind = [libm::cos(angle), libm::sin(angle), 0.2 * libm::sin(3.0 * angle)];
            let now = shares(&cvs, &mesh, &Shield { wind, cone: 0.1, ..STILL });
            if let Some(before) = before {
                largest = before.iter().zip(&now).fold(largest, |largest, (a, b)| largest.max((a - b).abs()));
            }
            least = now.iter().copied().fold(least, f32::min);
            most = now.iter().copied().fold(most, f32::max);
            before = Some(now);
        }
        // An edge sweeps 1.17e-4 rad of a disc 0.2 rad wide at a time: 2 ÷ (π · 0.1) of that.
        assert!(largest < 1.5e-3, "{largest}");
        assert_eq!((least, most), (0.0, 1.0));
    }

    /// Several walls as one mesh, each at an x, from a y to a y, over z = −9…9.
    fn walls(of: &[[f32; 3]]) -> (Vec<Vec3>, Vec<[u32; 3]>) {
        let (mut points, mut triangles) = (Vec::new(), Vec::new());
        for [x, low, high] in of {
            let first = points.len() as u32;
            points.extend([[*x, *low, -9.0], [*x, *high, -9.0], [*x, *high, 9.0], [*x, *low, 9.0]]);
            triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        }
        (points, triangles)
    }

    /// Half-planes behind one another count once: the nearer edges of each decide, in one mesh and in several, whichever way
    /// they are wound. In closed form, the share beyond a line at a distance of d radii.
    #[test]
    fn walls_behind_one_another_count_once() {
        let slope = libm::tan(0.1) as f32;
        let beyond = |d: f32| {
            let d = f64::from(d.clamp(-1.0, 1.0));
            (libm::acos(d) - d * (1.0 - d * d).sqrt()) / std::f64::consts::PI
        };
        let how = Shield { cone: 0.1, offset: 1e6.into(), ..STILL };
        for edges in [[0.0, 0.0], [0.0, 0.5], [-0.3, 0.2], [-0.7, -0.7], [0.6, -0.1], [0.9, 0.8]] {
            // Seen from x = 0 in wind along x: walls at 1 and 2 m upwind, which reach down to their edges.
            let at = |n: usize| [-1.0 - n as f32, edges[n] * slope * (1.0 + n as f32), 9.0];
            let expected = beyond(edges[0].min(edges[1]));
            let one = walls(&[at(0), at(1)]);
            let found = shares(&[[0.0; 3]], &one, &how)[0];
            assert!((f64::from(found) - expected).abs() < 0.03, "{edges:?}: {found} for {expected}");
            let (near, mut far) = (walls(&[at(0)]), walls(&[at(1)]));
            for _ in 0..2 {
                let colliders = [Collider::of(&near.0, &near.1), Collider::of(&far.0, &far.1)];
                let found = shield(&[0, 1], &[[0.0; 3]], &colliders, &how)[0];
                assert!((f64::from(found) - expected).abs() < 0.03, "{edges:?}: {found} for {expected}");
                far.1.iter_mut().for_each(|corners| corners.swap(0, 1));
            }
        }
        // From opposite sides: what is covered by either.
        let two = walls(&[[-1.0, 0.3 * slope, 9.0], [-2.0, -9.0, -0.2 * slope]]);
        let expected = beyond(0.3) + beyond(0.1);
        let found = shares(&[[0.0; 3]], &two, &how)[0];
        assert!((f64::from(found) - expected).abs() < 1e-4, "{found} for {expected}");
    }

    /// Of layers at several distances the nearest counts, where shelter fades.
    #[test]
    fn of_fading_layers_the_nearest_counts() {
        let how = Shield { cone: 0.1, offset: 1e6.into(), distance: 4.0, ..STILL };
        let all = walls(&[[-1.0, -9.0, 9.0], [-2.0, -9.0, 9.0], [-3.5, -9.0, 9.0]]);
        assert!((shares(&[[0.0; 3]], &all, &how)[0] - 0.75).abs() < 2e-3);
        // The nearer one covers half, the farther one all.
        let half = walls(&[[-1.0, 0.0, 9.0], [-2.0, -9.0, 9.0]]);
        let found = shares(&[[0.0; 3]], &half, &how)[0];
        assert!((found - 0.625).abs() < 5e-3, "{found}");
    }

    /// A wall that moves up behind another and a row of slats that turns change the share evenly.
    #[test]
    fn overlapping_layers_are_continuous() {
        let how = Shield { cone: 0.1, offset: 1e6.into(), ..STILL };
        let slats: Vec<[f32; 3]> =
            (0..12).map(|k| [-1.0 - 0.3 * k as f32, -0.4 + 0.06 * k as f32, -0.35 + 0.07 * k as f32]).collect();
        let mesh = walls(&slats);
        let mut before: Option<f32> = None;
        let (mut largest, mut least, mut most) = (0.0_f32, 1.0_f32, 0.0_f32);
        for step in 0..8000 {
            let angle = f64::from(step) * 1e-4 - 0.4;
            let wind = [libm::cos(angle), libm::sin(angle), 0.05 * libm::sin(5.0 * angle)];
            let now = shares(&[[0.0; 3]], &mesh, &Shield { wind, ..how })[0];
            if let Some(before) = before {
                largest = largest.max((now - before).abs());
            }
            (least, most) = (least.min(now), most.max(now));
            before = Some(now);
        }
        // Four edges at a time at 2 ÷ (π · 0.1) of 1.2e-4 rad.
        assert!(largest < 6e-3, "{largest}");
        assert!(least < 0.1 && most > 0.5, "{least} {most}");
    }
}
