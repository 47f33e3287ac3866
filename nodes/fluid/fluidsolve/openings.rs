//! Sources and sinks in motion over a step.

use engine::prelude::*;
use liquid::carried::LiquidMaterial;
use liquid::rows::Cell;
use liquid::shape::{MovingShape, ShapeSettings};
use liquid::step::{Domain, LiquidSink, LiquidSource, SourceShape};

use super::carried::MeshAttributes;
use super::shapes::{cells_inside, check_size, in_cells, topology};
use crate::shared::attributes::{
    SINK_ACTIVE, SINK_RATE, SOURCE_ACTIVE, SOURCE_DENSITY, SOURCE_RATE, SOURCE_VELOCITY, SOURCE_VISCOSITY,
};
use crate::shared::volume::Lattice;

/// Times within a step at which sources and sinks are sampled.
pub(super) const SAMPLES: u8 = 4;

/// A source or a sink over a step. Times are shares of it.
pub(super) struct Opening {
    shape: MovingShape,
    bounds: [Cell; 2],
    /// At equal times: what it gives or takes, m³/s; whether it does; the velocity of its liquid, m/s.
    rates: Vec<f64>,
    active: Vec<bool>,
    velocities: Option<Vec<[f32; 3]>>,
    /// What its liquid is made of.
    materials: Vec<LiquidMaterial>,
    /// The mesh at the end of the step.
    last: Component,
    /// The attributes of its liquid.
    attributes: Option<MeshAttributes>,
}

/// The attributes that say what an opening does.
#[derive(Clone, Copy)]
pub(super) struct Says {
    rate: Attr<f32>,
    active: Attr<i32>,
    velocity: Option<Attr<[f32; 3]>>,
    /// What its liquid is made of.
    material: fn(&Component, &str) -> Result<LiquidMaterial>,
}

/// Those of a source.
pub(super) const SOURCE: Says =
    Says { rate: SOURCE_RATE, active: SOURCE_ACTIVE, velocity: Some(SOURCE_VELOCITY), material: material_of };
/// Those of a sink.
pub(super) const SINK: Says =
    Says { rate: SINK_RATE, active: SINK_ACTIVE, velocity: None, material: |_, _| Ok(LiquidMaterial::default()) };

impl Opening {
    /// All openings of an input over a step.
    ///
    /// # Errors
    /// Where one is not closed, too large, changes its faces within the step, or asks for what is not available yet.
    pub(super) fn all(
        cx: &StepCx,
        input: Input<Many>,
        says: Says,
        domain: &Domain,
        lattice: Lattice,
    ) -> Result<Vec<Self>> {
        let samples = cx.samples(input);
        let wires = samples.first().map_or(0, |(_, wires)| wires.len());
        let mut openings = Vec::with_capacity(wires);
        for wire in 0..wires {
            let meshes: Vec<&Component> = samples.iter().filter_map(|(_, wires)| wires.get(wire)?.mesh()).collect();
            if let [first, .., last] = meshes[..] {
                let what = || format!("`{}` {wire} (counted from 0)", input.name());
                if first.topology() != last.topology() {
                    let fact = format!("{} changes its faces within a frame", what());
                    return Err(
                        Error::refused(fact).hint("a source or sink needs the same faces and points at every frame")
                    );
                }
                openings.push(Self::new(&meshes, [first, last], says, domain, lattice, &what())?);
            }
        }
        Ok(openings)
    }

    fn new(
        meshes: &[&Component],
        [first, last]: [&Component; 2],
        says: Says,
        domain: &Domain,
        lattice: Lattice,
        what: &str,
    ) -> Result<Self> {
        let settings = ShapeSettings::new(domain.low, domain.high);
        let topology = topology(first, lattice, what)?;
        let [from, to] = [first, last].map(|mesh| in_cells(mesh, lattice));
        let mut bounds = [domain.high, domain.low];
        for point in from.iter().chain(&to) {
            for k in 0..3 {
                let at = |x: f32| x.clamp(domain.low[k] as f32, domain.high[k] as f32) as i32;
                bounds[0][k] = bounds[0][k].min(at(point[k].floor()));
                bounds[1][k] = bounds[1][k].max(at(point[k].ceil()));
            }
        }
        check_size((0..3).fold(1.0, |cells, k| cells * f64::from(bounds[1][k] - bounds[0][k])), what)?;
        let once = |attribute: Attr<f32>, mesh: &Component| mesh.get(attribute).and_then(|rows| rows.first().copied());
        let materials = meshes.iter().map(|mesh| (says.material)(mesh, what)).collect::<Result<Vec<_>>>()?;
        let velocity = |mesh: &&Component| says.velocity.and_then(|attribute| mesh.get(attribute)?.first().copied());
        Ok(Self {
            shape: MovingShape::new(&topology, &from, &to, &settings),
            bounds,
            rates: meshes.iter().map(|mesh| f64::from(once(says.rate, mesh).unwrap_or(0.0))).collect(),
            active: meshes
                .iter()
                .map(|mesh| mesh.get(says.active).is_none_or(|rows| rows.first() != Some(&0)))
                .collect(),
            velocities: meshes.iter().map(velocity).collect(),
            materials,
            last: last.clone(),
            attributes: None,
        })
    }

    /// Whether it moves farther in the step than its shape follows accurately.
    pub(super) fn is_fast(&self) -> bool {
        self.shape.is_capped()
    }

    /// Whether it gives or takes at a rate, rather than keeping its shape full or empty.
    pub(super) fn has_rate(&self) -> bool {
        self.rates.iter().any(|rate| *rate > 0.0)
    }

    /// The sample at or before a share of the step, and how far it is to the next.
    fn sample(&self, share: f64) -> (usize, f64) {
        let last = self.active.len() - 1;
        let at = share.clamp(0.0, 1.0) * last as f64;
        let sample = (at as usize).min(last.saturating_sub(1));
        (sample, at - sample as f64)
    }

    pub(super) fn is_active(&self, share: f64) -> bool {
        self.active[self.sample(share).0]
    }

    /// The velocity of the liquid inside, m/s.
    fn velocity(&self, share: f64) -> [f32; 3] {
        let Some(velocities) = &self.velocities else { return [0.0; 3] };
        let (sample, mix) = self.sample(share);
        let next = velocities[(sample + 1).min(velocities.len() - 1)];
        numerics::vector::lerp(velocities[sample], next, mix as f32)
    }

    /// Whether its liquid is made of something else than the rest.
    pub(super) fn has_material(&self) -> bool {
        self.materials.iter().any(LiquidMaterial::is_own)
    }

    /// Cells that it keeps full in the end, about; 0 where it has a rate.
    pub(super) fn kept_cells(&self, domain: &Domain, lattice: Lattice) -> f64 {
        if self.has_rate() || !self.is_active(1.0) {
            return 0.0;
        }
        cells_inside(&self.last, &in_cells(&self.last, lattice), [domain.low, domain.high])
    }

    /// The mesh at the end of the step, and where its attributes go.
    pub(super) fn attributes(&mut self) -> (&Component, &mut Option<MeshAttributes>) {
        (&self.last, &mut self.attributes)
    }

    /// What its liquid is made of.
    fn material(&self, share: f64) -> LiquidMaterial {
        let (sample, mix) = self.sample(share);
        let [from, to] = [sample, sample + 1].map(|n| self.materials[n.min(self.materials.len() - 1)]);
        let between = |from: Option<f32>, to: Option<f32>| Some(from? + mix as f32 * (to? - from?));
        LiquidMaterial {
            viscosity: between(from.viscosity, to.viscosity),
            density: between(from.density, to.density),
            phase: from.phase,
        }
    }

    /// Makes its liquid one that does not mix with others.
    pub(super) fn set_phase(&mut self, phase: u32) {
        self.materials.iter_mut().for_each(|material| material.phase = phase);
    }

    /// ∫ of the rate between two shares of a step of that many seconds, m³: linear between samples, 0 where it is not active.
    fn volume(&self, from: f64, to: f64, seconds: f64) -> f64 {
        let intervals = self.active.len() - 1;
        let mut sum = 0.0;
        for sample in 0..intervals {
            let [low, high] = [sample, sample + 1].map(|n| n as f64 / intervals as f64);
            let (low, high) = (from.max(low), to.min(high));
            if low < high && self.active[sample] {
                let mix = 0.5 * (low + high) * intervals as f64 - sample as f64;
                sum += (high - low) * (self.rates[sample] + mix * (self.rates[sample + 1] - self.rates[sample]));
            }
        }
        sum * seconds
    }
}

/// What the liquid of a mesh is made of.
///
/// # Errors
/// Where its attributes are no viscosity or no density.
pub(super) fn material_of(mesh: &Component, what: &str) -> Result<LiquidMaterial> {
    let once = |attribute: Attr<f32>, is_one: fn(f32) -> bool, must: &str| {
        let Some(value) = mesh.get(attribute).and_then(|rows| rows.first().copied()) else { return Ok(None) };
        if is_one(value) {
            return Ok(Some(value));
        }
        let fact = format!("{what} has a `{}` of {value}", attribute.name);
        Err(Error::refused(fact).hint(format!("it must be {must}")))
    };
    Ok(LiquidMaterial {
        viscosity: once(SOURCE_VISCOSITY, |value| value >= 0.0, "0 or above")?,
        density: once(SOURCE_DENSITY, |value| value > 0.0, "above 0")?,
        phase: 0,
    })
}

/// Changes the attributes of a marker, given its place.
type Edit<'a> = Box<dyn Fn([f32; 3], &mut [f32]) + Sync + 'a>;

/// What the solver calls of an opening at times since the start of the frame, s.
pub(super) struct Timed<'a> {
    distance: Box<dyn Fn(f64, [f32; 3]) -> f32 + Sync + 'a>,
    rate: Box<dyn Fn(f64, f64) -> f64 + Sync + 'a>,
    active: Box<dyn Fn(f64) -> bool + Sync + 'a>,
    velocity: Box<dyn Fn(f64) -> [f32; 3] + Sync + 'a>,
    material: Box<dyn Fn(f64) -> LiquidMaterial + Sync + 'a>,
    attributes: Option<Edit<'a>>,
    opening: &'a Opening,
}

impl<'a> Timed<'a> {
    /// All of them in a step of that many seconds.
    pub(super) fn all(openings: &'a [Opening], seconds: f64) -> Vec<Self> {
        openings.iter().map(|opening| Self::new(opening, seconds)).collect()
    }

    fn new(opening: &'a Opening, seconds: f64) -> Self {
        let share = move |time: f64| time / seconds;
        Self {
            distance: Box::new(move |time, point| opening.shape.distance(share(time) as f32, point)),
            rate: Box::new(move |from, to| opening.volume(share(from), share(to), seconds)),
            active: Box::new(move |time| opening.is_active(share(time))),
            velocity: Box::new(move |time| opening.velocity(share(time))),
            material: Box::new(move |time| opening.material(share(time))),
            attributes: opening.attributes.as_ref().map(|mesh| {
                let write: Edit<'a> = Box::new(move |place, row| mesh.write(place, row));
                write
            }),
            opening,
        }
    }

    fn shape(&self) -> SourceShape<'_> {
        SourceShape { distance: &*self.distance, bounds: self.opening.bounds }
    }

    pub(super) fn source(&self) -> LiquidSource<'_> {
        LiquidSource {
            shape: self.shape(),
            rate: if self.opening.has_rate() { Some(&*self.rate) } else { None },
            velocity: if self.opening.velocities.is_some() { Some(&*self.velocity) } else { None },
            material: &*self.material,
            attributes: self.attributes.as_deref(),
            active: &*self.active,
        }
    }

    pub(super) fn sink(&self) -> LiquidSink<'_> {
        let rate: Option<&(dyn Fn(f64, f64) -> f64 + Sync)> =
            if self.opening.has_rate() { Some(&*self.rate) } else { None };
        LiquidSink { shape: self.shape(), rate, active: &*self.active }
    }
}
