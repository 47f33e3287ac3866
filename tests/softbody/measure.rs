//! Points, distances and volumes of cooked geometry.

use engine::geometry::{Geometry, Kind};
use numerics::vector::DVec3;

/// Points of the mesh or tets of a geometry that has one of them.
pub(crate) fn points(geometry: &Geometry) -> Vec<[f64; 3]> {
    let part = [Kind::Mesh, Kind::Tets].iter().find_map(|kind| geometry.part(*kind)).unwrap();
    part.positions().iter().map(|p| p.map(f64::from)).collect()
}

pub(crate) fn distance(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    (DVec3::from(*a) - DVec3::from(*b)).norm()
}

/// Six times the signed volume of a tet.
pub(crate) fn volume([a, b, c, d]: [[f64; 3]; 4]) -> f64 {
    let [p, q, r] = [b, c, d].map(|corner| DVec3::from(corner) - DVec3::from(a));
    p.dot(&q.cross(&r))
}

/// Volume of all tets.
pub(crate) fn volume_of(geometry: &Geometry) -> f64 {
    let at = points(geometry);
    let tets = geometry.tets().unwrap().tet_corners();
    tets.iter().map(|tet| volume(tet.map(|corner| at[corner as usize])) / 6.0).sum()
}
