//! Soft bodies: how well they meet their laws, what they do at extremes, and figures of dough and an egg as paper R
//! describes them; all are printed as they are checked (`cargo test --test softbody -- --nocapture`).

#![allow(clippy::unwrap_used, reason = "a test's helpers")]

mod accuracy;
#[path = "../cooked/mod.rs"]
mod cooked;
mod egg;
mod extremes;
#[path = "../laws/mod.rs"]
mod laws;
mod pound;
mod rolling;
mod scene;
mod shapes;

use engine::geometry::{Geometry, Kind};
use numerics::vector::DVec3;

/// Points of the only component there is.
fn points(geometry: &Geometry) -> Vec<[f64; 3]> {
    let part = [Kind::Mesh, Kind::Tets].iter().find_map(|kind| geometry.part(*kind)).unwrap();
    part.positions().iter().map(|p| p.map(f64::from)).collect()
}

fn distance(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    (DVec3::from(*a) - DVec3::from(*b)).norm()
}

/// Six times the signed volume of a tet.
fn volume([a, b, c, d]: [[f64; 3]; 4]) -> f64 {
    let [p, q, r] = [b, c, d].map(|corner| DVec3::from(corner) - DVec3::from(a));
    p.dot(&q.cross(&r))
}

/// Volume of all tets.
fn volume_of(geometry: &Geometry) -> f64 {
    let at = points(geometry);
    let tets = geometry.tets().unwrap().tet_corners();
    tets.iter().map(|tet| volume(tet.map(|corner| at[corner as usize])) / 6.0).sum()
}
