//! Attributes that the family's nodes exchange.

use engine::prelude::*;

/// Of a source: what it adds, m³/s; 0 keeps its shape full.
pub(crate) const SOURCE_RATE: Attr<f32> = Attr::once("source_rate");
/// Of a source: 1 if it adds liquid, else 0.
pub(crate) const SOURCE_ACTIVE: Attr<i32> = Attr::once("source_active");
/// Of a source that has one: the velocity of the liquid inside it, m/s.
pub(crate) const SOURCE_VELOCITY: Attr<[f32; 3]> = Attr::once("source_velocity");
/// Of a source that has one: the dynamic viscosity of its liquid, Pa·s.
pub(crate) const SOURCE_VISCOSITY: Attr<f32> = Attr::once("source_viscosity");
/// Of a source that has one: the density of its liquid, kg/m³.
pub(crate) const SOURCE_DENSITY: Attr<f32> = Attr::once("source_density");
/// Of a sink: what it takes, m³/s; 0 takes all that enters.
pub(crate) const SINK_RATE: Attr<f32> = Attr::once("sink_rate");
/// Of a sink: 1 if it takes liquid, else 0.
pub(crate) const SINK_ACTIVE: Attr<i32> = Attr::once("sink_active");
/// Of a particle: [`PARTICLE_MARKER`], [`PARTICLE_SPRAY`] or [`PARTICLE_TRACER`].
pub(crate) const PARTICLE_KIND: Attr<i32> = Attr::point("kind");
/// Of a particle: the volume that it stands for, m³; 0 of markers and tracers.
pub(crate) const PARTICLE_VOLUME: Attr<f32> = Attr::point("volume");
/// Of a particle: the dynamic viscosity of the liquid there, Pa·s.
pub(crate) const PARTICLE_VISCOSITY: Attr<f32> = Attr::point("viscosity");
/// Of a particle: the density of the liquid there, kg/m³.
pub(crate) const PARTICLE_DENSITY: Attr<f32> = Attr::point("density");

/// The `kind` of a marker on the surface.
pub(crate) const PARTICLE_MARKER: i32 = 0;
/// The `kind` of a drop of spray.
pub(crate) const PARTICLE_SPRAY: i32 = 1;
/// The `kind` of a tracer.
pub(crate) const PARTICLE_TRACER: i32 = 3;

/// What a point has of an attribute of so many floats that it came without.
pub(crate) fn absent(name: &str, width: usize) -> &'static [f32] {
    match (name, width) {
        ("Cd", _) => &[1.0; 4][..width],
        ("orient", 4) => &[0.0, 0.0, 0.0, 1.0],
        _ => &[0.0; 4][..width],
    }
}

/// The floats of a column, one row after the other.
pub(crate) fn flat(column: &Column) -> &[f32] {
    match column {
        Column::F1(rows) => rows,
        Column::F3(rows) => rows.as_flattened(),
        Column::F4(rows) => rows.as_flattened(),
        Column::I1(_) | Column::I3(_) | Column::I4(_) => &[],
    }
}

/// The column of floats that follow one another, 1, 3 or 4 a row.
pub(crate) fn rows_of(width: usize, floats: Vec<f32>) -> Column {
    match width {
        1 => Column::new(floats),
        3 => Column::new(floats.as_chunks::<3>().0.to_vec()),
        _ => Column::new(floats.as_chunks::<4>().0.to_vec()),
    }
}
