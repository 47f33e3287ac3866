//! The equations of motion of a scene as the peers read them: the same springs, dashpots, pressures and contacts as
//! `bodies::mass_spring` has, so that all methods tend to one motion as their steps get short.
//!
//! The constants of pressures and contacts are those of `mass_spring::volume` and `mass_spring::contact`; where one is changed there and
//! not here, the fine limits in the table part. What is not here: the push against tetrahedra that turn over.

use crate::scene::{FRAME, FRICTION, GAP, Scene, Surface, Tools};
use numerics::vector::DVec3;

/// κ ÷ what a particle puts up against being moved.
const FIRM: f64 = 30.0;
/// Share of the gap from where on a push grows straight on.
const STRAIGHT: f64 = 0.95;
/// Body lengths a second at which friction is all of μN.
const CREEP: f64 = 2e-5;
/// Bulk modulus of a region ÷ E, all lost volume fought.
const BULK: f64 = 2.0 / 3.0 / 0.1;
/// Shares of a region's volume that are fought twice as hard as small ones, and where hardness grows no more.
const SLIGHT: f64 = 0.012;
const MUCH: f64 = 0.04;

/// A spring and the dashpot beside it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spring {
    pub(crate) ends: [u32; 2],
    /// N/m and N·s/m.
    pub(crate) k: f64,
    pub(crate) c: f64,
    /// Length at rest, metres.
    pub(crate) rest: f64,
}

/// A region whose volume is kept.
#[derive(Clone, Debug)]
pub(crate) struct Region {
    /// On its boundary, rising.
    pub(crate) particles: Vec<u32>,
    /// Outwards, corners among `particles`.
    faces: Vec<[u16; 3]>,
    /// Volume at rest, m³.
    pub(crate) rest: f64,
    /// κ ÷ that, and the dashpot, Pa/m³ and Pa·s/m³.
    k: f64,
    pub(crate) c: f64,
}

/// A force and how it grows with what it fights.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Law {
    pub(crate) force: f64,
    pub(crate) slope: f64,
}

/// Everything that a step reads.
pub(crate) struct Model {
    /// Kilograms.
    pub(crate) mass: Vec<f64>,
    /// 1 ÷ mass; 0 where held.
    pub(crate) inverse: Vec<f64>,
    pub(crate) springs: Vec<Spring>,
    pub(crate) regions: Vec<Region>,
    pub(crate) skin: Vec<u32>,
    /// κ of each particle's contacts, N/m.
    pub(crate) firm: Vec<f64>,
    pub(crate) tools: Tools,
    /// Slip at which friction is all of μN, m/s.
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
        let mut firm: Vec<f64> = mass.iter().map(|mass| 4.0 * mass / (FRAME * FRAME)).collect();
        for spring in &springs {
            spring.ends.iter().for_each(|end| firm[*end as usize] += spring.k / 3.0);
        }
        firm.iter_mut().for_each(|firm| *firm *= FIRM);
        let regions = body.regions().iter().map(|faces| Region::new(scene, faces)).collect();
        let creep = CREEP * body.size();
        Self { mass, inverse, springs, regions, skin: scene.skin.clone(), firm, tools: scene.tools, creep }
    }

    /// The push of a surface on a particle, newtons, along its normal.
    #[inline(always)]
    pub(crate) fn push(&self, particle: usize, surface: &Surface) -> Law {
        let depth = GAP - surface.distance;
        if depth <= 0.0 {
            return Law { force: 0.0, slope: 0.0 };
        }
        let firm = self.firm[particle];
        let edge = depth.min(STRAIGHT * GAP);
        let left = 1.0 - edge / GAP;
        let slope = firm / (left * left);
        Law { force: firm * edge / left + slope * (depth - edge), slope }
    }

    /// Coulomb's bound on what sticks.
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

    /// Its triangles, by particle.
    pub(crate) fn triangles(&self) -> impl Iterator<Item = [u32; 3]> {
        self.faces.iter().map(|face| face.map(|corner| self.particles[usize::from(corner)]))
    }

    /// m³.
    pub(crate) fn volume(&self, x: &[DVec3]) -> f64 {
        let origin = x[self.particles[0] as usize];
        let six = |face: [u32; 3]| {
            let [a, b, c] = face.map(|corner| x[corner as usize] - origin);
            a.dot(&b.cross(&c))
        };
        self.triangles().map(six).sum::<f64>() / 6.0
    }

    /// That, and how it changes with each of its particles, m².
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

    /// Its pressure at a volume, Pa, inwards, without the dashpot's.
    #[inline(always)]
    pub(crate) fn pressure(&self, volume: f64) -> Law {
        let lost = volume - self.rest;
        let soft = 1.0 / (SLIGHT * self.rest * SLIGHT * self.rest);
        let edge = lost.clamp(-MUCH * self.rest, MUCH * self.rest);
        let slope = 1.0 + 3.0 * edge * edge * soft;
        let force = edge * (1.0 + edge * edge * soft) + slope * (lost - edge);
        Law { force: self.k * force, slope: self.k * slope }
    }
}
