//! The markers on the surface and the spray, as points.

use engine::prelude::*;
use serde::{Deserialize, Serialize};

use super::Run;
use crate::shared::attributes::{PARTICLE_KIND, PARTICLE_VOLUME};
use crate::shared::surface::velocity_at;
use crate::shared::volume::Lattice;

/// A drop too small for the grid. It flies on its own and does not come back into the liquid.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct SprayDrop {
    /// Where it is, in solver cells.
    pub(super) place: [f32; 3],
    /// m/s.
    pub(super) velocity: [f32; 3],
    /// m³.
    pub(super) volume: f32,
}

impl SprayDrop {
    /// Flies on for some seconds under gravity, m/s², in cells of that side, m.
    pub(super) fn fly(&mut self, gravity: [f64; 3], seconds: f64, cell: f64) {
        for ((place, velocity), gravity) in self.place.iter_mut().zip(&mut self.velocity).zip(gravity) {
            let before = f64::from(*velocity);
            let after = before + gravity * seconds;
            *velocity = after as f32;
            *place += (0.5 * (before + after) * seconds / cell) as f32;
        }
    }
}

/// The points of a state, with the attributes that are wanted.
///
/// # Errors
/// None: each attribute has one row a point.
pub(super) fn particles(cx: &Cx, run: &Run, lattice: Lattice, volume: &Volume) -> Result<Component> {
    let markers = run.surface.markers();
    let fine = lattice.refined(run.surface.resolution());
    let mut points: Vec<[f32; 3]> = markers.markers.iter().map(|marker| fine.in_metres(marker.point)).collect();
    let on_surface = points.len();
    points.extend(run.spray.iter().map(|drop| lattice.in_metres(drop.place)));
    let velocity = cx.wants(V).then(|| {
        let mut velocity = velocity_at(volume, &points[..on_surface]);
        velocity.extend(run.spray.iter().map(|drop| drop.velocity));
        velocity
    });
    let count = points.len();
    let mut particles = Component::points(points);
    if let Some(velocity) = velocity {
        particles.set(V, velocity)?;
    }
    if cx.wants(N) {
        let mut normals: Vec<[f32; 3]> = markers.markers.iter().map(|marker| marker.normal).collect();
        normals.resize(count, [0.0; 3]);
        particles.set(N, normals)?;
    }
    if cx.wants(ID) {
        // Spray counts down from -1.
        let mut ids: Vec<i32> = markers.ids.iter().map(|id| *id as i32).collect();
        ids.extend((1..).take(count - on_surface).map(|n: i32| -n));
        particles.set(ID, ids)?;
    }
    if cx.wants(PARTICLE_KIND) {
        particles.set(PARTICLE_KIND, (0..count).map(|n| i32::from(n >= on_surface)).collect())?;
    }
    if cx.wants(PARTICLE_VOLUME) {
        let mut volumes = vec![0.0; on_surface];
        volumes.extend(run.spray.iter().map(|drop| drop.volume));
        particles.set(PARTICLE_VOLUME, volumes)?;
    }
    Ok(particles)
}
