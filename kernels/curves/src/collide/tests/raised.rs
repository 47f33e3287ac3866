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
