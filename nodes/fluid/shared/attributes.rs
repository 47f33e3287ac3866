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
/// Of a particle: 0 a marker on the surface, 1 spray, 3 a tracer.
pub(crate) const PARTICLE_KIND: Attr<i32> = Attr::point("kind");
/// Of a particle: the volume that it stands for, m³; 0 of markers and tracers.
pub(crate) const PARTICLE_VOLUME: Attr<f32> = Attr::point("volume");
/// Of a particle: the dynamic viscosity of the liquid there, Pa·s.
pub(crate) const PARTICLE_VISCOSITY: Attr<f32> = Attr::point("viscosity");
/// Of a particle: the density of the liquid there, kg/m³.
pub(crate) const PARTICLE_DENSITY: Attr<f32> = Attr::point("density");
