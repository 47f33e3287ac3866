//! Filled surfaces: by hand, then general properties.

use super::super::{ClosedSurface, FillSettings, PolygonSurface, ShellSide, SurfaceFault, TetMesh};
use super::{Mesh, ball, block, joined, turned_block};
use numerics::random::Key;
use numerics::vector::{DVec3, to_f64};

fn closed(mesh: &Mesh) -> ClosedSurface {
    let starts = mesh.starts();
    ClosedSurface::of(&PolygonSurface { starts: &starts, corners: &mesh.corners, points: &mesh.points }, true).unwrap()
}

fn fill(mesh: &Mesh, spacing: f64, interior: bool) -> (ClosedSurface, TetMesh) {
    let closed = closed(mesh);
    let solid = closed.fill(&FillSettings { spacing, interior }).unwrap();
    sound(&closed, &solid);
    (closed, solid)
}

fn volume(solid: &TetMesh, tet: &[u32; 4]) -> f64 {
    let [a, b, c, d] = tet.map(|corner| to_f64(solid.points[corner as usize]));
    (b - a).dot(&(c - a).cross(&(d - a))) / 6.0
}

/// Properties of every filled surface.
fn sound(closed: &ClosedSurface, solid: &TetMesh) {
    let n = closed.points.len();
    assert_eq!(solid.points[..n], closed.points, "the surface's points come first, as they are");
    assert!(solid.sides[..n].iter().all(|side| *side != ShellSide::Interior));
    assert!(solid.sides[n..].iter().all(|side| *side == ShellSide::Interior));
    assert!(solid.points.as_flattened().iter().all(|x| x.is_finite()));
    for (tet, sliver) in solid.tets.iter().zip(&solid.slivers) {
        assert!(*sliver || volume(solid, tet) > 0.0, "no tet but a sliver is inverted");
    }
    // A face belongs to at most two tets, with opposite orientation.
    let mut faces: Vec<([u32; 3], bool)> = Vec::new();
    for [a, b, c, d] in &solid.tets {
        for face in [[b, d, c], [a, c, d], [a, d, b], [a, b, c]] {
            let mut sorted = face.map(|corner| *corner);
            let swaps =
                usize::from(face[0] > face[1]) + usize::from(face[1] > face[2]) + usize::from(face[0] > face[2]);
            sorted.sort_unstable();
            faces.push((sorted, swaps % 2 == 1));
        }
    }
    faces.sort_unstable();
    for same in faces.chunk_by(|a, b| a.0 == b.0) {
        assert!(same.len() == 1 || (same.len() == 2 && same[0].1 != same[1].1), "{same:?}");
        let on_surface = same[0].0.iter().all(|point| (*point as usize) < n);
        let whole = same.len() == 2 || on_surface || solid.measured.missing_faces > 0;
        assert!(whole, "a face of one tet has all its points on the surface");
    }
    // Every edge of the surface is an edge of a tet, or counted as missing.
    let has = |a: u32, b: u32| solid.tets.iter().any(|tet| tet.contains(&a) && tet.contains(&b));
    if n < 300 {
        let missing = closed.edges().iter().filter(|[a, b]| !has(*a, *b)).count();
        assert_eq!(missing, solid.measured.missing_edges);
    }
    let sum: f64 = solid.tets.iter().map(|tet| volume(solid, tet)).sum();
    let error = (sum - closed.volume()).abs() / closed.volume();
    assert!((error - solid.measured.volume_error).abs() < 1e-9);
    if solid.measured.missing_faces == 0 {
        assert!(error < 1e-6, "{error}");
    }
    assert_eq!(solid.slivers.iter().filter(|sliver| **sliver).count(), solid.measured.slivers);
}

#[test]
fn a_tet_shaped_surface_is_one_tet_at_any_scale() {
    for scale in [1e-40, 1e-3, 1.0, 1e3, 1e37] {
        let mut tet =
            Mesh { points: vec![[0.0; 3], [scale, 0.0, 0.0], [0.0, scale, 0.0], [0.0, 0.0, scale]], ..Mesh::default() };
        [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]].iter().for_each(|face| tet.face(face));
        let (_, solid) = fill(&tet, 0.0, true);
        assert_eq!((solid.tets.len(), solid.bodies, solid.slivers), (1, vec![0], vec![false]));
        assert!(solid.measured.volume_error < 1e-12, "{scale}");
        // Right angles at the three edges from the corner, arccos(1⁄√3) at the others.
        assert!((solid.measured.min_dihedral - libm::acos(1.0 / 3.0_f64.sqrt())).abs() < 1e-6);
    }
}

#[test]
fn a_regular_tet_has_quality_one() {
    let points = vec![[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
    let mut tet = Mesh { points, ..Mesh::default() };
    [[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]].iter().for_each(|face| tet.face(face));
    let (_, solid) = fill(&tet, 0.0, false);
    assert!((solid.measured.quality_median - 1.0).abs() < 1e-12);
    assert!((solid.measured.min_dihedral - libm::acos(1.0 / 3.0)).abs() < 1e-12);
}

#[test]
fn a_double_pyramid_is_two_tets() {
    let mut two = Mesh {
        points: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.2, 0.2, -1.0]],
        ..Mesh::default()
    };
    [[0, 1, 3], [1, 2, 3], [2, 0, 3], [1, 0, 4], [2, 1, 4], [0, 2, 4]].iter().for_each(|face| two.face(face));
    let (_, solid) = fill(&two, 0.0, false);
    assert_eq!((solid.tets.len(), solid.measured.missing_faces, solid.measured.volume_error), (2, 0, 0.0));
}

#[test]
fn a_cube_has_its_volume_and_points_at_the_spacing() {
    let (_, solid) = fill(&block([1.0; 3], [0.0; 3]), 0.1, true);
    assert_eq!(solid.measured.missing_faces, 0);
    assert!(solid.measured.volume_error < 1e-7);
    // 2 points in each of the (0.8 ÷ 0.1083)³ = 403 cubes that are a tenth away from the faces, whose long sides
    // count as two spacings.
    let inside = (solid.points.len() - 8) as f64;
    assert!((0.8..1.2).contains(&(inside / (2.0 * 403.0))), "{inside}");
    let edges = solid
        .tets
        .iter()
        .filter(|tet| tet.iter().all(|corner| *corner >= 8))
        .flat_map(|tet| (0..4).flat_map(move |i| (0..i).map(move |j| (tet[i], tet[j]))));
    let lengths: Vec<f64> = edges
        .map(|(a, b)| {
            let (a, b) = (solid.points[a as usize], solid.points[b as usize]);
            (to_f64(a) - to_f64(b)).norm()
        })
        .collect();
    let mean = lengths.iter().sum::<f64>() / lengths.len() as f64;
    assert!((mean / 0.1 - 1.0).abs() < 0.05, "{mean}");
}

#[test]
fn interior_points_can_be_disabled() {
    let ball = ball(6, 1.0);
    let (closed, solid) = fill(&ball, 0.0, false);
    assert_eq!(solid.points.len(), closed.points.len());
    let (_, with) = fill(&ball, 0.0, true);
    assert!(with.measured.quality_median > 0.7, "{}", with.measured.quality_median);
    assert!(solid.measured.quality_median < 0.3, "{}", solid.measured.quality_median);
}

#[test]
fn a_ball_in_a_ball_is_a_cavity_exact_to_its_facets() {
    let (outer, inner) = (ball(10, 1.0), ball(6, 0.6));
    let hollow = joined(&[outer.clone(), inner.clone()]);
    let (closed, solid) = fill(&hollow, 0.1, true);
    assert_eq!((closed.bodies, solid.measured.missing_faces), (1, 0));
    assert!(solid.measured.volume_error < 1e-7, "{}", solid.measured.volume_error);
    let whole = |mesh: &Mesh| closed_volume(mesh);
    assert!((closed.volume() - (whole(&outer) - whole(&inner))).abs() < 1e-12);
    let n = outer.points.len();
    assert!(solid.sides[..n].iter().all(|side| *side == ShellSide::Outer));
    assert!(solid.sides[n..closed.points.len()].iter().all(|side| *side == ShellSide::Inner));
    // No tet crosses the cavity.
    assert!(solid.tets.iter().all(|tet| {
        let middle = tet.iter().map(|corner| to_f64(solid.points[*corner as usize])).sum::<DVec3>() / 4.0;
        middle.norm() > 0.57
    }));
}

fn closed_volume(mesh: &Mesh) -> f64 {
    closed(mesh).volume()
}

#[test]
fn a_yolk_inside_the_white_is_a_separate_body() {
    // Three balls: outer surface of the white, its cavity, and the yolk inside.
    let egg = joined(&[ball(8, 1.0), ball(6, 0.6), ball(5, 0.5)]);
    let (closed, solid) = fill(&egg, 0.15, true);
    assert_eq!(closed.bodies, 2);
    let of = |body: u32| -> f64 {
        let tets = solid.tets.iter().zip(&solid.bodies).filter(|(_, of)| **of == body);
        tets.map(|(tet, _)| volume(&solid, tet)).sum()
    };
    assert!((of(0) - (closed_volume(&ball(8, 1.0)) - closed_volume(&ball(6, 0.6)))).abs() < 1e-6);
    assert!((of(1) - closed_volume(&ball(5, 0.5))).abs() < 1e-6);
}

#[test]
fn touching_bodies_share_no_points() {
    let two = joined(&[block([1.0; 3], [0.0; 3]), block([1.0; 3], [1.0, 0.0, 0.0]), block([1.0; 3], [0.0, 1.0, 0.0])]);
    let (closed, solid) = fill(&two, 0.25, true);
    assert_eq!(closed.bodies, 3);
    let mut body = vec![None; solid.points.len()];
    for (tet, of) in solid.tets.iter().zip(&solid.bodies) {
        for corner in tet {
            assert_eq!(*body[*corner as usize].get_or_insert(*of), *of);
        }
    }
    assert_eq!((solid.measured.bare_points, solid.measured.missing_faces), (0, 0));
    assert!(solid.measured.volume_error < 1e-6);
}

#[test]
fn a_rotated_block_of_many_quads_is_exact_to_rounding() {
    // Its sides are planar only up to rounding: slivers lie on them, inside and out.
    let (_, solid) = fill(&turned_block(6), 0.0, true);
    assert!(solid.measured.volume_error < 1e-6, "{:?}", solid.measured);
    assert_eq!((solid.measured.missing_edges, solid.measured.bare_points), (0, 0));
}

#[test]
fn scaling_and_translation_do_not_change_the_result() {
    let ball = ball(6, 1.0);
    let (_, solid) = fill(&ball, 0.2, true);
    for scale in [1.0 / 1024.0, 1024.0, 1e-3, 1e3] {
        let (_, scaled) = fill(&ball.scaled(scale), 0.2 * f64::from(scale), true);
        // Powers of two change no bit. Other factors round the cospherical points of a ball anew, and with them its
        // slivers.
        if scale == 1024.0 || scale == 1.0 / 1024.0 {
            assert_eq!(scaled.tets, solid.tets);
        }
        assert!((scaled.tets.len() as f64 / solid.tets.len() as f64 - 1.0).abs() < 0.01, "{scale}");
        assert!((scaled.measured.quality_median - solid.measured.quality_median).abs() < 1e-3);
    }
    let far = ball.moved([64.0, -128.0, 0.0]);
    let (_, far) = fill(&far, 0.2, true);
    assert!((far.tets.len() as f64 / solid.tets.len() as f64 - 1.0).abs() < 0.1);
    assert!(far.measured.volume_error < 1e-6, "{:?}", far.measured);
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let hollow = joined(&[ball(8, 1.0), ball(5, 0.5)]);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let (_, solid) = pool.install(|| fill(&hollow, 0.12, true));
        (solid.tets, solid.points, solid.bodies, solid.measured)
    };
    let one = with(1);
    assert!(one == with(2) && one == with(7));
}

#[test]
fn too_fine_a_spacing_is_refused_with_the_number_of_points() {
    let closed = closed(&block([1.0; 3], [0.0; 3]));
    let fault = closed.fill(&FillSettings { spacing: 1e-4, interior: true }).unwrap_err();
    assert!(
        matches!(fault, SurfaceFault::TooManyPoints { points, .. } if (1.4e12..1.8e12).contains(&points)),
        "{fault}"
    );
    // A spacing wider than the body leaves no room for points, which is not a fault.
    let solid = closed.fill(&FillSettings { spacing: 5.0, interior: true }).unwrap();
    assert_eq!(solid.points.len(), 8);
}

#[test]
fn an_empty_surface_has_no_tets() {
    let solid = closed(&Mesh::default()).fill(&FillSettings { spacing: 0.0, interior: true }).unwrap();
    assert!(solid.tets.is_empty() && solid.points.is_empty());
    assert_eq!(solid.measured, super::super::FillQuality::default());
}

/// A mesh of the example graphs.
pub(super) fn asset(text: &str) -> Mesh {
    let mut mesh = Mesh::default();
    for line in text.lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => mesh.points.push([0; 3].map(|_| words.next().unwrap().parse().unwrap())),
            Some("f") => {
                let corner = |word: &str| word.split('/').next().unwrap().parse::<u32>().unwrap() - 1;
                mesh.face(&words.map(corner).collect::<Vec<_>>());
            }
            _ => {}
        }
    }
    mesh
}

#[test]
fn a_lump_of_dough_is_filled_completely_with_good_tets() {
    let lump = asset(include_str!("../../../../../graphs/assets/blobby_4k_watertight.obj"));
    let (_, solid) = fill(&lump, 0.0, true);
    let measured = solid.measured;
    assert!(measured.quality_median > 0.9 && measured.volume_error < 1e-12, "{measured:?}");
    assert_eq!((measured.missing_faces, measured.missing_edges, measured.bare_points), (0, 0, 0));
    assert!(measured.slivers < 10, "{measured:?}");
    // TetGen, told to keep all faces and add no points, makes as many tets.
    let raw = closed(&lump).filled(&FillSettings { spacing: 0.0, interior: false }, |tets| tets.finish()).unwrap();
    assert_eq!((raw.tets.len(), raw.measured.missing_faces), (6371, 0));
    assert!((0.1..0.15).contains(&raw.measured.quality_median));
    // Fewer and better ones are left of these.
    let (_, solid) = fill(&lump, 0.0, false);
    assert!(solid.tets.len() < 6000 && solid.measured.missing_faces == 0 && solid.measured.volume_error < 1e-12);
    assert!(4 * solid.measured.slivers < raw.measured.slivers, "{:?} {:?}", solid.measured, raw.measured);
    assert!(solid.measured.quality_median > raw.measured.quality_median);
}

#[test]
fn no_damage_to_a_ball_causes_a_panic() {
    let ball = Mesh::of_triangles(&ball(3, 1.0));
    let (mut filled, mut refused) = (0, 0);
    for trial in 0..400 {
        let key = Key::new(77).of(trial);
        let mut mesh = ball.clone();
        let any = |draw: u64, below: usize| (key.of(draw).u64() % below as u64) as usize;
        for change in 0..1 + trial % 5 {
            let draw = |k: u64| 10 * change + k;
            let (point, other) = (any(draw(1), mesh.points.len()), any(draw(2), mesh.points.len()));
            let face = any(draw(3), mesh.counts.len());
            match any(draw(4), 7) {
                0 => mesh.points[point] = mesh.points[other],
                1 => mesh.points[point] = [0, 1, 2].map(|axis| key.of(draw(5)).of(axis).f32() - 0.5),
                2 => mesh.points[point][1] = 0.0,
                3 => mesh.corners[3 * face..3 * face + 3].reverse(),
                4 => mesh.corners[3 * face] = other as u32,
                5 => mesh.corners.extend_from_within(3 * face..3 * face + 3),
                _ => mesh.points.iter_mut().for_each(|p| p[2] *= 1e-6),
            }
        }
        let starts: Vec<u32> = (0..=mesh.corners.len() as u32).step_by(3).collect();
        let surface = PolygonSurface { starts: &starts, corners: &mesh.corners, points: &mesh.points };
        let solid = ClosedSurface::of(&surface, true).and_then(|closed| {
            let solid = closed.fill(&FillSettings { spacing: 0.3, interior: true })?;
            sound(&closed, &solid);
            Ok(solid)
        });
        filled += usize::from(solid.is_ok());
        refused += usize::from(solid.is_err());
    }
    assert!(filled > 50 && refused > 50, "{filled} {refused}");
}
