//! Attributes that came with bodies and are no longer true once these move and deform.
//!
//! Velocities are those of the simulation. Normals of the surface turn with it, by the mean over the triangles around them
//! of the map that takes each triangle's normal at rest to the one it has now. Orientations, and normals on tets, are left
//! out: they belong to nothing that is still there.

use engine::prelude::*;
use numerics::vector::{DMat3, DVec3, to_f32, to_f64};

const FACE_N: Attr<[f32; 3]> = Attr::element(N.name);

/// Sets the `velocities` of a part of the bodies, metres per second of the scene, and brings the other attributes that
/// depend on its motion from those at `rest`.
pub(super) fn follow(cx: &Cx, rest: &Component, part: &mut Component, velocities: Vec<[f32; 3]>) -> Result<()> {
    part.remove(Owner::Element, V.name);
    if cx.wants(V) {
        part.set(V, velocities)?;
    } else {
        part.remove(Owner::Point, V.name);
    }
    for owner in [Owner::Point, Owner::Element] {
        part.remove(owner, ORIENT.name);
    }
    let normals = [rest.get(N), rest.get(FACE_N)];
    if normals == [None; 2] {
        return Ok(());
    }
    if !cx.wants(N) || rest.kind() != Kind::Mesh {
        part.remove(Owner::Point, N.name);
        part.remove(Owner::Element, N.name);
        return Ok(());
    }
    let triangles = rest.triangles();
    let mut at_points = vec![DMat3::zeros(); rest.point_count()];
    let mut on_faces = vec![DMat3::zeros(); rest.element_count()];
    for (corners, face) in triangles.corners.iter().zip(&triangles.faces) {
        let map = normal_map(rest.positions(), part.positions(), corners);
        corners.iter().for_each(|corner| at_points[*corner as usize] += map);
        on_faces[*face as usize] += map;
    }
    let turned = |normals: &[[f32; 3]], maps: &[DMat3]| normals.iter().zip(maps).map(turned).collect();
    if let Some(normals) = normals[0] {
        part.set(N, turned(normals, &at_points))?;
    }
    if let Some(normals) = normals[1] {
        part.set(FACE_N, turned(normals, &on_faces))?;
    }
    Ok(())
}

/// The map of normals from a triangle at `rest` to where it is `now`, times its area at rest; zero for one without an area.
fn normal_map(rest: &[[f32; 3]], now: &[[f32; 3]], corners: &[u32; 3]) -> DMat3 {
    // Both edges and the unit normal, and twice the area.
    let basis = |points: &[[f32; 3]]| {
        let [a, b, c] = corners.map(|corner| to_f64(points[corner as usize]));
        let (first, second) = (b - a, c - a);
        let across = first.cross(&second);
        let normal = across.try_normalize(0.0)?;
        Some(([first, second, normal], across.norm()))
    };
    let Some(((before, area), ([first, second, normal], area_now))) = basis(rest).zip(basis(now)) else {
        return DMat3::zeros();
    };
    // Products with the edges and the normal stay what they were.
    let dual = [second.cross(&normal) / area_now, normal.cross(&first) / area_now, normal];
    dual.iter().zip(before).map(|(dual, before)| dual * before.transpose()).sum::<DMat3>() * area
}

/// A normal mapped, as long as it was; unchanged where there is no map.
fn turned((normal, map): (&[f32; 3], &DMat3)) -> [f32; 3] {
    let before: DVec3 = to_f64(*normal);
    let mapped = (map * before).try_normalize(0.0);
    mapped.map_or(*normal, |mapped| to_f32(mapped * before.norm()))
}
