//! Heights that `offset_scale` keeps.

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
    let how =
        Collide { skin: Some(skin), offset_scale: Some(share), offset_root: 0.0, gap: 1e-6, ..hairs::on(&obstacles) };
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
