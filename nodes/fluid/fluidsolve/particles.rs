//! The markers on the surface, the spray and the tracers, as points.

use engine::prelude::*;
use liquid::step::{Motion, Surface};
use numerics::vector::scale;

use super::domain::domain;
use super::run::{Run, pace};
use super::{DENSITY, VISCOSITY};
use crate::shared::attributes::{
    PARTICLE_DENSITY, PARTICLE_KIND, PARTICLE_MARKER, PARTICLE_SPRAY, PARTICLE_TRACER, PARTICLE_VISCOSITY,
    PARTICLE_VOLUME,
};
use crate::shared::surface::velocity_at;
use crate::shared::volume::Lattice;

/// How many points a state has.
pub(super) fn particle_count(run: &Run) -> usize {
    run.surface.markers().markers.len() + run.spray.len() + run.motion.tracers().points().len()
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
    let tracers = run.motion.tracers();
    let first_tracer = points.len();
    points.extend(tracers.points().iter().map(|place| lattice.in_metres(*place)));
    let velocity = cx.wants(V).then(|| {
        let mut velocity = velocity_at(volume, &points[..on_surface]);
        velocity.extend(run.spray.iter().map(|drop| scale(drop.velocity, pace(cx))));
        let carried = tracers.carried(run.surface.view(), &domain(cx));
        let of_tracers = velocity_at(volume, &points[first_tracer..]).into_iter().zip(carried);
        velocity.extend(of_tracers.map(|(velocity, is_carried)| if is_carried { velocity } else { [0.0; 3] }));
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
        let mut ids: Vec<i32> = markers.ids.iter().map(|id| *id as i32).collect();
        ids.extend(run.spray.iter().map(|drop| drop.id));
        ids.extend(tracers.numbers().iter().map(|number| run.tracer_ids[*number as usize]));
        particles.set(ID, ids)?;
    }
    if cx.wants(PARTICLE_KIND) {
        let kind = |n: usize| {
            if n < on_surface {
                PARTICLE_MARKER
            } else if n < first_tracer {
                PARTICLE_SPRAY
            } else {
                PARTICLE_TRACER
            }
        };
        particles.set(PARTICLE_KIND, (0..count).map(kind).collect())?;
    }
    if cx.wants(PARTICLE_VOLUME) {
        let mut volumes = vec![0.0; on_surface];
        volumes.extend(run.spray.iter().map(|drop| drop.volume as f32));
        volumes.resize(count, 0.0);
        particles.set(PARTICLE_VOLUME, volumes)?;
    }
    set_materials(cx, run, &mut particles)?;
    run.columns.set(cx, &mut particles, &run.surface, run.spray.len(), tracers.numbers())?;
    Ok(particles)
}

/// Says what the liquid at each point is made of.
fn set_materials(cx: &Cx, run: &Run, particles: &mut Component) -> Result<()> {
    let wanted = [(PARTICLE_VISCOSITY, cx.get(VISCOSITY) as f32), (PARTICLE_DENSITY, cx.get(DENSITY) as f32)];
    if wanted.iter().all(|(attribute, _)| !cx.wants(*attribute)) {
        return Ok(());
    }
    let unit = 1.0 / run.surface.resolution() as f32;
    let markers: Vec<[f32; 3]> = run.surface.markers().markers.iter().map(|marker| scale(marker.point, unit)).collect();
    let mut rows = materials_at(&run.motion, &markers);
    rows.extend(run.spray.iter().map(|drop| drop.material));
    rows.extend(materials_at(&run.motion, run.motion.tracers().points()));
    for (n, (attribute, own)) in wanted.into_iter().enumerate().filter(|(_, (attribute, _))| cx.wants(*attribute)) {
        particles.set(attribute, rows.iter().map(|row| row[n].unwrap_or(own)).collect())?;
    }
    Ok(())
}

/// Viscosity, Pa·s, and density, kg/m³, of the liquid at places in solver cells, where they are not the solver's.
fn materials_at(motion: &Motion, places: &[[f32; 3]]) -> Vec<[Option<f32>; 2]> {
    match motion.materials() {
        Some(materials) => {
            materials.closest_to(places).into_iter().map(|material| [material.viscosity, material.density]).collect()
        }
        None => vec![[None; 2]; places.len()],
    }
}
