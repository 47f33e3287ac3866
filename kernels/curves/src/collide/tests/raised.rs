//! Heights that `offset_scale` keeps.

use super::hair::Hair;
use super::kept::bodies;
use super::*;

/// Of the CVs whose goals are pressed below `share` of their rest height, the fraction that `collide` brings to it, less
/// `error` of it. Some come higher: those after a CV that is raised further.
fn kept_heights(fur: &kept::Fur, share: f64, error: f64) -> (usize, f64) {
    let (points, triangles) = &fur.mesh;
    let tree = TriangleTree::build(points, triangles);
    let normals = normals(points, triangles);
    let skin = SkinSurface { tree: &tree, triangles, normals: &normals };
    let obstacles = [&tree];
    let how = Collide {
        skin: Some(skin),
        offset_scale: Some(share.into()),
        offset_root: 0.0.into(),
        gap: 1e-6.into(),
        ..hairs::on(&obstacles)
    };
    let out = collide(&fur.starts, &fur.rest, &fur.goal, &how);
    assert!(out.length_error < 1e-5, "{}", out.length_error);
    let height = |p: Vec3| skin.height(&to_f64(p), f32::INFINITY).unwrap().0;
    let (mut pressed, mut kept) = (0, 0);
    for ends in fur.starts.windows(2) {
        for cv in ends[0] as usize + 1..ends[1] as usize {
            let wanted = share * height(fur.rest[cv]);
            if wanted > 1e-3 && height(fur.goal[cv]) < wanted {
                pressed += 1;
                kept += usize::from(height(out.points[cv]) > wanted * (1.0 - error));
            }
        }
    }
    (pressed, f64::from(kept as u32) / f64::from(pressed as u32))
}

#[test]
fn offset_scale_keeps_heights_on_a_plane_and_on_a_sphere() {
    for (name, least, error) in [("floor", 0.9999, 0.02), ("sphere", 0.96, 0.05)] {
        let mut fur = bodies().into_iter().find(|(found, _)| *found == name).unwrap().1.raised(1e-3);
        if name == "floor" {
            // The same plane, without ends within reach.
            fur.mesh = hairs::floor();
        }
        for share in [1.0, 0.5] {
            let (pressed, kept) = kept_heights(&fur, share, error);
            assert!(pressed > 100 && kept >= least, "{name}, {share}: {kept} of {pressed}");
        }
    }
}

#[test]
fn loft_keeps_its_share_of_heights_over_the_root_and_leaves_what_is_higher() {
    let fur = bodies().into_iter().find(|(name, _)| *name == "floor").unwrap().1.raised(1e-3);
    let (points, triangles) = hairs::floor();
    let tree = TriangleTree::build(&points, &triangles);
    let normals = normals(&points, &triangles);
    let skin = SkinSurface { tree: &tree, triangles: &triangles, normals: &normals };
    let obstacles = [&tree];
    let how = Collide { skin: Some(skin), offset_root: 0.0.into(), ..hairs::on(&obstacles) };
    let up = DVec3::y();
    for share in [0.1, 0.5, 1.0] {
        let how = Collide { loft: share.into(), ..how.clone() };
        let kept = at_rest(&fur.starts, &fur.rest, &how);
        let (mut lofted, mut same, mut goals) = (0, 0, Vec::new());
        for (curve, ends) in fur.starts.windows(2).enumerate() {
            let around = kept.around(curve);
            assert!(around.is_some_and(|around| (around.up - up).norm() < 1e-12));
            let cvs = ends[0] as usize..ends[1] as usize;
            let (rest, goal) = (&fur.rest[cvs.clone()], &fur.goal[cvs]);
            let hair = Hair { first: 0, shift: DVec3::zeros(), half_space: None, around, rest, goal, out: &mut [] };
            hair.set_goals(&how, &DVec3::zeros(), &mut goals);
            let mut all_kept = true;
            for k in 1..goal.len() {
                let length = (to_f64(goal[k]) - to_f64(goal[k - 1])).norm();
                assert!(((goals[k] - goals[k - 1]).norm() - length).abs() < 1e-9);
                let height = |p: DVec3, root: Vec3| p.y - f64::from(root[1]);
                let wanted = share * height(to_f64(rest[k]), rest[0]);
                let before = height(goals[k - 1], goal[0]);
                let unraised = f64::from(goal[k][1]) - f64::from(goal[k - 1][1]);
                if wanted > 0.0 && before + unraised < wanted {
                    // Straight up where the segment is too short.
                    let reached = wanted.min(before + length);
                    assert!((height(goals[k], goal[0]) - reached).abs() < 1e-9, "{share}, {curve}, {k}");
                    (lofted, all_kept) = (lofted + 1, false);
                }
            }
            if all_kept {
                same += 1;
                assert!(goals.iter().zip(goal).all(|(now, goal)| (now - to_f64(*goal)).norm() < 1e-9));
            }
        }
        assert!(lofted > 50 && same > 5, "{share}: {lofted}, {same}");
    }
    let with = |loft: f64, coherence: f64| {
        collide(
            &fur.starts,
            &fur.rest,
            &fur.goal,
            &Collide { loft: loft.into(), coherence: coherence.into(), ..how.clone() },
        )
    };
    assert_eq!(with(0.3, 1.0), with(0.0, 1.0));
    assert_ne!(with(0.3, 0.0).points, with(0.0, 0.0).points);
}

/// The surface around a root of a sphere drops as the sphere does, to second order; in a bowl it does not drop.
#[test]
fn the_surface_around_a_root_curves_as_the_skin() {
    use super::root_surface::RootSurface;
    let sphere = numerics::shapes::icosphere(1.0, 4);
    let points: Vec<Vec3> = sphere.points.iter().map(|p| p.map(|x| 2.0 * x as f32)).collect();
    let triangles = sphere.triangles();
    for (triangles, inwards) in
        [(triangles.clone(), false), (triangles.iter().map(|[a, b, c]| [*a, *c, *b]).collect(), true)]
    {
        let tree = TriangleTree::build(&points, &triangles);
        let normals = normals(&points, &triangles);
        let skin = SkinSurface { tree: &tree, triangles: &triangles, normals: &normals };
        for seed in 0..40 {
            let key = numerics::random::Key::new(seed);
            let out = DVec3::from_fn(|axis, _| key.of(axis as u64).f64() - 0.5).normalize();
            let around = RootSurface::of(&skin, &(out * 2.0), 0.8).unwrap();
            let side = perpendicular(&around.up, &DVec3::new(0.3, 0.5, 0.7));
            let (along, up) = (side * 0.4, around.up);
            // On the sphere of radius 2, 0.4 aside: 0.0404 below the tangent plane.
            let expected = if inwards { 0.0 } else { 0.04 };
            assert!((around.height(&along) - expected).abs() < 4e-3, "{seed}: {}", around.height(&along));
            let step = |slope: f64| (side - up * slope).normalize() * 0.4;
            let lofted = around.lofted(&DVec3::zeros(), &step(0.5), &(up * 0.4), 0.02).unwrap();
            assert!((around.height(&lofted) - 0.02).abs() < 1e-3 && (lofted.norm() - 0.4).abs() < 1e-9, "{seed}");
            assert_eq!(around.lofted(&DVec3::zeros(), &step(-0.5), &(up * 0.4), 0.02), None);
        }
    }
}
