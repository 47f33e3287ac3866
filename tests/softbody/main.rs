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

/// Points of the only component there is.
fn points(geometry: &Geometry) -> Vec<[f64; 3]> {
    let part = [Kind::Mesh, Kind::Tets].iter().find_map(|kind| geometry.part(*kind)).unwrap();
    part.positions().iter().map(|p| p.map(f64::from)).collect()
}

fn distance(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    (0..3).map(|k| (a[k] - b[k]) * (a[k] - b[k])).sum::<f64>().sqrt()
}

/// Six times the signed volume of a tet.
fn volume([a, b, c, d]: [[f64; 3]; 4]) -> f64 {
    let [p, q, r] = [b, c, d].map(|corner| std::array::from_fn::<f64, 3, _>(|k| corner[k] - a[k]));
    p[0] * (q[1] * r[2] - q[2] * r[1]) + p[1] * (q[2] * r[0] - q[0] * r[2]) + p[2] * (q[0] * r[1] - q[1] * r[0])
}

/// Volume of all tets.
fn volume_of(geometry: &Geometry) -> f64 {
    let at = points(geometry);
    let tets = geometry.tets().unwrap().tet_corners();
    tets.iter().map(|tet| volume(tet.map(|corner| at[corner as usize])) / 6.0).sum()
}
