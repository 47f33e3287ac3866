//! XPBD (Macklin et al. 2016) in small steps (Macklin et al. 2019): Gauss–Seidel over springs, then regions, then
//! contacts, in a fixed order.
//!
//! The impulse of a constraint is λ = −h²·F(C, Ċ) with its force law F, linearised at the current state. For springs
//! that is exactly the compliance and damping of XPBD, and it extends to stiffening laws. Friction constrains the
//! slip of a step, bounded by μ times the normal impulse (Müller et al. 2020).

use crate::model::{Law, Model, Spring};
use crate::scene::{FRAME, GRAVITY, Tools};
use numerics::vector::DVec3;

/// A simulated body with all buffers.
pub(crate) struct Xpbd {
    model: Model,
    substeps: u32,
    iterations: u32,
    x: Vec<DVec3>,
    v: Vec<DVec3>,
    before: Vec<DVec3>,
    /// Impulses × h of springs, of regions, and of each surface on each surface particle: normal and tangential.
    of_springs: Vec<f64>,
    of_regions: Vec<f64>,
    of_surfaces: Vec<[(f64, DVec3); Tools::MOST]>,
    gradient: Vec<DVec3>,
}

impl Xpbd {
    pub(crate) fn new(model: Model, points: &[DVec3], substeps: u32, iterations: u32) -> Self {
        let widest = model.regions.iter().map(|region| region.particles.len()).max().unwrap_or(0);
        Self {
            substeps,
            iterations,
            x: points.to_vec(),
            v: vec![DVec3::zeros(); points.len()],
            before: points.to_vec(),
            of_springs: vec![0.0; model.springs.len()],
            of_regions: vec![0.0; model.regions.len()],
            of_surfaces: vec![[(0.0, DVec3::zeros()); Tools::MOST]; model.skin.len()],
            gradient: vec![DVec3::zeros(); widest],
            model,
        }
    }

    pub(crate) fn positions(&self) -> &[DVec3] {
        &self.x
    }

    /// Steps through a frame; returns the number of evaluations of all springs.
    pub(crate) fn frame(&mut self, frame: u32) -> f64 {
        let h = FRAME / f64::from(self.substeps);
        for step in 0..self.substeps {
            let end = FRAME * (f64::from(frame) + f64::from(step + 1) / f64::from(self.substeps));
            self.before.copy_from_slice(&self.x);
            for ((x, v), inverse) in self.x.iter_mut().zip(&mut self.v).zip(&self.model.inverse) {
                if *inverse > 0.0 {
                    *v += GRAVITY * h;
                    *x += *v * h;
                }
            }
            self.of_springs.fill(0.0);
            self.of_regions.fill(0.0);
            self.of_surfaces.fill([(0.0, DVec3::zeros()); Tools::MOST]);
            for _ in 0..self.iterations {
                self.springs(h);
                self.regions(h);
                self.contacts(h, end);
            }
            for ((v, x), before) in self.v.iter_mut().zip(&self.x).zip(&self.before) {
                *v = (x - before) / h;
            }
        }
        f64::from(self.substeps * self.iterations)
    }

    fn springs(&mut self, h: f64) {
        let inverse = &self.model.inverse;
        for (Spring { ends, k, c, rest }, lambda) in self.model.springs.iter().zip(&mut self.of_springs) {
            let [a, b] = ends.map(|end| end as usize);
            let offset = self.x[a] - self.x[b];
            let length = offset.norm();
            let weight = inverse[a] + inverse[b];
            if length < 1e-12 || weight == 0.0 {
                continue;
            }
            let normal = offset / length;
            let moved = normal.dot(&(self.x[a] - self.before[a] - self.x[b] + self.before[b]));
            let law = Law { force: k * (length - rest) + c * moved / h, slope: k + c / h };
            let change = impulse(law, h, weight, lambda);
            self.x[a] += normal * (change * inverse[a]);
            self.x[b] -= normal * (change * inverse[b]);
        }
    }

    fn regions(&mut self, h: f64) {
        let inverse = &self.model.inverse;
        for (region, lambda) in self.model.regions.iter().zip(&mut self.of_regions) {
            let gradient = &mut self.gradient[..region.particles.len()];
            let volume = region.measure(&self.x, gradient);
            let (mut weight, mut moved) = (0.0, 0.0);
            for (g, particle) in gradient.iter().zip(&region.particles) {
                let particle = *particle as usize;
                weight += inverse[particle] * g.norm_squared();
                moved += g.dot(&(self.x[particle] - self.before[particle]));
            }
            let own = region.pressure(volume);
            let law = Law { force: own.force + region.c * moved / h, slope: own.slope + region.c / h };
            let change = impulse(law, h, weight, lambda);
            for (g, particle) in gradient.iter().zip(&region.particles) {
                self.x[*particle as usize] += g * (change * inverse[*particle as usize]);
            }
        }
    }

    fn contacts(&mut self, h: f64, time: f64) {
        for (particle, impulses) in self.model.skin.iter().zip(&mut self.of_surfaces) {
            let particle = *particle as usize;
            let weight = self.model.inverse[particle];
            for (which, (along, across)) in impulses.iter_mut().enumerate() {
                let Some(surface) = self.model.tools.around(self.x[particle], time)[which] else { continue };
                let push = self.model.push(particle, &surface);
                // A normal force reduces the depth, as the tension of a spring reduces its length.
                let mut pull = -*along;
                self.x[particle] -= surface.normal * (impulse(push, h, weight, &mut pull) * weight);
                *along = (-pull).max(0.0);
                if *along > 0.0 || *across != DVec3::zeros() {
                    let slip = self.x[particle] - self.before[particle] - surface.velocity * h;
                    let slip = slip - surface.normal * surface.normal.dot(&slip);
                    let wanted = *across - slip / weight;
                    let (most, length) = (Model::friction(*along), wanted.norm());
                    let held = if length > most { wanted * (most / length) } else { wanted };
                    self.x[particle] += (held - *across) * weight;
                    *across = held;
                }
            }
        }
    }
}

/// Change of the impulse `lambda` of a constraint towards −h² of its law, if a unit impulse moves its particles by
/// `weight`.
#[inline(always)]
fn impulse(law: Law, h: f64, weight: f64, lambda: &mut f64) -> f64 {
    let change = (-h * h * law.force - *lambda) / (1.0 + weight * h * h * law.slope);
    *lambda += change;
    change
}
