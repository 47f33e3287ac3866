//! The equations of motion of a scene for the peers: the same springs, dashpots, pressures and contacts as in
//! `bodies::mass_spring`, so that all methods converge to the same motion in short steps.
//!
//! The constants of pressures and contacts are those of `mass_spring::volume` and `mass_spring::contact`. If they
//! differ, the references in the table disagree. Not included: the barrier against inversion of tetrahedra.

use crate::scene::{FRAME, FRICTION, GAP, Scene, Surface, Tools};
use numerics::vector::DVec3;

/// κ ÷ effective stiffness of a particle.
const PENALTY_RATIO: f64 = 30.0;
/// Fraction of the gap beyond which the contact force continues linearly.
const LINEAR_FROM: f64 = 0.95;
/// Slip, in body lengths a second, above which friction is μN.
const CREEP: f64 = 2e-5;
/// Bulk modulus of a region ÷ E, at full strength.
const BULK: f64 = 2.0 / 3.0 / 0.1;
/// Relative volume change at which resistance has doubled, and at which it stops growing.
const STIFFENING: f64 = 0.012;
const STIFFENING_END: f64 = 0.04;

/// A spring with its dashpot.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spring {
    pub(crate) ends: [u32; 2],
    /// Stiffness, N/m, and damping, N·s/m.
    pub(crate) k: f64,
    pub(crate) c: f64,
    /// Rest length, metres.
    pub(crate) rest: f64,
}

/// A region whose volume is preserved.
#[derive(Clone, Debug)]
pub(crate) struct Region {
    /// Particles on its boundary, ascending.
    pub(crate) particles: Vec<u32>,
    /// Boundary faces, outwards, as indices into `particles`.
    faces: Vec<[u16; 3]>,
    /// Rest volume, m³.
    pub(crate) rest: f64,
    /// κ ÷ rest volume, Pa/m³, and its damping, Pa·s/m³.
    k: f64,
    pub(crate) c: f64,
}

/// A force and its derivative.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Law {
    pub(crate) force: f64,
    pub(crate) slope: f64,
}

/// All parameters of a step.
pub(crate) struct Model {
    /// Masses, kilograms.
    pub(crate) mass: Vec<f64>,
    /// 1 ÷ mass; 0 for pinned particles.
    pub(crate) inverse: Vec<f64>,
    pub(crate) springs: Vec<Spring>,
    pub(crate) regions: Vec<Region>,
    pub(crate) skin: Vec<u32>,
    /// Penalty stiffness κ of each particle's contacts, N/m.
    pub(crate) penalty_stiffness: Vec<f64>,
    pub(crate) tools: Tools,
    /// Slip velocity above which friction is μN, m/s.
    pub(crate) creep: f64,
}

impl Model {
    pub(crate) fn new(scene: &Scene) -> Self {
        let body = &scene.body;
        let mass = body.masses();
        let mut inverse: Vec<f64> = mass.iter().map(|mass| 1.0 / mass).collect();
        scene.pins.iter().for_each(|pin| inverse[pin.particle as usize] = 0.0);
        let known = body.springs().into_iter().zip(body.stiffnesses()).zip(body.lengths());
        let springs: Vec<Spring> =
            known.map(|((ends, k), rest)| Spring { ends, k: *k, c: scene.damping * k, rest: *rest }).collect();
        let mut penalty_stiffness: Vec<f64> = mass.iter().map(|mass| 4.0 * mass / (FRAME * FRAME)).collect();
        for spring in &springs {
            spring.ends.iter().for_each(|end| penalty_stiffness[*end as usize] += spring.k / 3.0);
        }
        penalty_stiffness.iter_mut().for_each(|penalty_stiffness| *penalty_stiffness *= PENALTY_RATIO);
        let regions = body.regions().iter().map(|faces| Region::new(scene, faces)).collect();
        let creep = CREEP * body.size();
        Self { mass, inverse, springs, regions, skin: scene.skin.clone(), penalty_stiffness, tools: scene.tools, creep }
    }

    /// Normal force of a surface on a particle, newtons.
    #[inline(always)]
    pub(crate) fn push(&self, particle: usize, surface: &Surface) -> Law {
        let depth = GAP - surface.distance;
        if depth <= 0.0 {
            return Law { force: 0.0, slope: 0.0 };
        }
        let penalty_stiffness = self.penalty_stiffness[particle];
        let edge = depth.min(LINEAR_FROM * GAP);
        let left = 1.0 - edge / GAP;
        let slope = penalty_stiffness / (left * left);
        Law { force: penalty_stiffness * edge / left + slope * (depth - edge), slope }
    }

    /// Largest friction force.
    #[inline(always)]
    pub(crate) fn friction(push: f64) -> f64 {
        FRICTION * push
    }
}

impl Region {
    fn new(scene: &Scene, triangles: &[[u32; 3]]) -> Self {
        let mut particles: Vec<u32> = triangles.iter().flatten().copied().collect();
        particles.sort_unstable();
        particles.dedup();
        let local = |corner: u32| particles.partition_point(|known| *known < corner) as u16;
        let faces = triangles.iter().map(|face| face.map(local)).collect();
        let mut region = Self { particles, faces, rest: 0.0, k: 0.0, c: 0.0 };
        region.rest = region.volume(&scene.points);
        region.k = BULK * scene.modulus / region.rest;
        region.c = region.k * scene.damping;
        region
    }

    /// Its boundary triangles, by particle.
    pub(crate) fn triangles(&self) -> impl Iterator<Item = [u32; 3]> {
        self.faces.iter().map(|face| face.map(|corner| self.particles[usize::from(corner)]))
    }

    /// Volume, m³.
    pub(crate) fn volume(&self, x: &[DVec3]) -> f64 {
        let origin = x[self.particles[0] as usize];
        let six = |face: [u32; 3]| {
            let [a, b, c] = face.map(|corner| x[corner as usize] - origin);
            a.dot(&b.cross(&c))
        };
        self.triangles().map(six).sum::<f64>() / 6.0
    }

    /// Volume and its gradient with respect to each particle, m².
    #[inline(always)]
    pub(crate) fn measure(&self, x: &[DVec3], gradient: &mut [DVec3]) -> f64 {
        gradient.fill(DVec3::zeros());
        let origin = x[self.particles[0] as usize];
        let mut six = 0.0;
        for face in &self.faces {
            let [a, b, c] = face.map(|corner| x[self.particles[usize::from(corner)] as usize] - origin);
            let bc = b.cross(&c);
            six += a.dot(&bc);
            gradient[usize::from(face[0])] += bc;
            gradient[usize::from(face[1])] += c.cross(&a);
            gradient[usize::from(face[2])] += a.cross(&b);
        }
        gradient.iter_mut().for_each(|g| *g *= 1.0 / 6.0);
        six / 6.0
    }

    /// Pressure at a volume, Pa, inwards, without damping.
    #[inline(always)]
    pub(crate) fn pressure(&self, volume: f64) -> Law {
        let lost = volume - self.rest;
        let soft = 1.0 / (STIFFENING * self.rest * STIFFENING * self.rest);
        let edge = lost.clamp(-STIFFENING_END * self.rest, STIFFENING_END * self.rest);
        let slope = 1.0 + 3.0 * edge * edge * soft;
        let force = edge * (1.0 + edge * edge * soft) + slope * (lost - edge);
        Law { force: self.k * force, slope: self.k * slope }
    }
}
