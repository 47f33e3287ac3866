//! Scenes: a body, what holds it, what it touches.
//!
//! Ground and pin are analytic shapes instead of meshes, and the same for every method, so that contact detection
//! costs nothing and facets play no role.

use bodies::mass_spring::{Contact, ContactFinder, ContactQuery, Material, Mesh, Pin, SoftBody};
use bodies::tets::{boundary, cubes};
use numerics::masked::Masked;
use numerics::vector::DVec3;

pub(crate) const FRAME: f64 = 1.0 / 24.0;
pub(crate) const GRAVITY: DVec3 = DVec3::new(0.0, -9.81, 0.0);
/// Distance to keep from ground and pin, metres.
pub(crate) const GAP: f64 = 1e-3;
/// Coulomb's friction coefficient of both.
pub(crate) const FRICTION: f64 = 0.5;

/// A body and its surroundings.
pub(crate) struct Scene {
    pub(crate) title: &'static str,
    pub(crate) frames: u32,
    pub(crate) points: Vec<DVec3>,
    pub(crate) tets: Vec<[u32; 4]>,
    /// Surface particles, ascending.
    pub(crate) skin: Vec<u32>,
    pub(crate) body: SoftBody,
    /// Young's modulus E, Pa.
    pub(crate) modulus: f64,
    /// β = c ÷ k, seconds.
    pub(crate) damping: f64,
    pub(crate) pins: Vec<Pin>,
    pub(crate) tools: Tools,
}

/// Surfaces that can be touched.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Tools {
    /// The half-space below y = 0.
    pub(crate) ground: bool,
    pub(crate) roller: Option<Roller>,
}

/// An infinitely long pin along z that rolls along x.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Roller {
    /// Its axis at the start, metres.
    start: DVec3,
    /// Velocity of the axis, m/s.
    velocity_of_axis: DVec3,
    radius: f64,
}

/// A surface as seen from a point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surface {
    /// Unit normal towards the free side.
    pub(crate) normal: DVec3,
    /// Distance of the point, metres.
    pub(crate) distance: f64,
    /// Velocity of the surface at the closest point, m/s.
    pub(crate) velocity: DVec3,
}

impl Tools {
    /// Largest number of surfaces.
    pub(crate) const MOST: usize = 2;

    /// The surfaces as seen from `x`, at a time in seconds.
    #[inline(always)]
    pub(crate) fn around(&self, x: DVec3, time: f64) -> [Option<Surface>; Self::MOST] {
        let ground = self.ground.then_some(Surface {
            normal: DVec3::new(0.0, 1.0, 0.0),
            distance: x.y,
            velocity: DVec3::zeros(),
        });
        let roller = self.roller.map(|roller| {
            let arm = x - (roller.start + roller.velocity_of_axis * time);
            let reach = (arm.x * arm.x + arm.y * arm.y).sqrt();
            let normal = DVec3::new(arm.x / reach, arm.y / reach, 0.0);
            // It rotates by −pace ÷ radius about z, so it rests where it touches a floor.
            let turn = DVec3::new(normal.y, -normal.x, 0.0) * roller.velocity_of_axis.x;
            Surface { normal, distance: reach - roller.radius, velocity: roller.velocity_of_axis + turn }
        });
        [ground, roller]
    }
}

/// The tools in one frame, as our solver asks for them.
pub(crate) struct SceneContacts<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) frame: u32,
}

impl ContactFinder for SceneContacts<'_> {
    fn find(&self, query: &ContactQuery<'_>, out: &mut Vec<Contact>) {
        let times = query.times.map(|share| (f64::from(self.frame) + share) * FRAME);
        for particle in &self.scene.skin {
            let [from, to] = [query.from, query.to].map(|x| DVec3::from(x[*particle as usize]));
            let before = self.scene.tools.around(from, times[0]);
            let after = self.scene.tools.around(to, times[1]);
            for (before, after) in before.into_iter().zip(after).filter_map(|(before, after)| before.zip(after)) {
                if before.distance.min(after.distance) < 2.0 * GAP {
                    // The side it comes from, if it would pass through the axis.
                    let passed = before.normal.dot(&after.normal) <= 0.0;
                    let normal = if passed { before.normal } else { after.normal };
                    let offset = normal.dot(&(to - after.normal * after.distance));
                    out.push(Contact {
                        points: [*particle, 0, 0, 0],
                        weights: [1.0, 0.0, 0.0, 0.0],
                        normal: normal.into(),
                        offset,
                        gap: GAP,
                        velocity: after.velocity.into(),
                        friction: FRICTION,
                        jammed: false,
                        open: false,
                    });
                }
            }
        }
    }
}

impl Scene {
    /// The scene with the name `free`, `drop`, `roll` or `stiff`.
    pub(crate) fn new(name: &'static str) -> Self {
        const DOUGH: [f64; 3] = [0.24, 0.06, 0.12];
        const CELLS: [u32; 3] = [26, 7, 12];
        let ground = Tools { ground: true, roller: None };
        // Ten thicknesses a frame, 1 cm deep in the dough.
        let roller = Roller {
            start: DVec3::new(-0.08, 0.1, 0.06),
            velocity_of_axis: DVec3::new(10.0 * GAP / FRAME, 0.0, 0.0),
            radius: 0.05,
        };
        let above = |height: f64| [0.0, GAP + height, 0.0];
        let made = |title, frames, tools, (size, cells, at), modulus, damping| {
            Self::block(title, frames, tools, (size, cells, at), modulus, damping)
        };
        match name {
            "free" => {
                let beam = ([2.0, 0.5, 0.5], [32, 8, 8], [0.0; 3]);
                let mut scene = made("free: cantilever, no contact", 16, Tools::default(), beam, 3.04e6, 1e-3);
                scene.pins = scene.clamped();
                scene
            }
            "drop" => made("drop: dough falls 2 cm and rests", 22, ground, (DOUGH, CELLS, above(0.02)), 5e3, 0.01),
            "stiff" => made("stiff: the drop, E times 100", 22, ground, (DOUGH, CELLS, above(0.02)), 5e5, 1e-4),
            "roll" => {
                let tools = Tools { roller: Some(roller), ..ground };
                made("roll: a pin rolls over dough", 24, tools, (DOUGH, CELLS, above(0.0)), 5e3, 0.01)
            }
            _ => panic!("`{name}`; expected free, drop, roll or stiff"),
        }
    }

    /// A block of cells of six tetrahedra, its lowest corner at `at`.
    fn block(
        title: &'static str,
        frames: u32,
        tools: Tools,
        (size, cells, at): ([f64; 3], [u32; 3], [f64; 3]),
        modulus: f64,
        damping: f64,
    ) -> Self {
        let (places, tets) = cubes(cells.map(|n| n as usize), at, size);
        let points: Vec<DVec3> = places.iter().map(|p| DVec3::from(*p)).collect();
        let narrow: Vec<[f32; 3]> = places.iter().map(|p| p.map(|x| x as f32)).collect();
        let mut skin: Vec<u32> = boundary(&tets, &narrow).iter().flat_map(|face| face.corners).collect();
        skin.sort_unstable();
        skin.dedup();
        let plain = |value| Masked::uniform(value);
        let material = Material { density: plain(1000.0), stiffness: plain(modulus), damping: plain(damping) };
        let mesh = Mesh { points: &places, tets: &tets, ..Mesh::default() };
        let body = SoftBody::new(&mesh, &material, &[]).expect("a block");
        Self { title, frames, points, tets, skin, body, modulus, damping, pins: Vec::new(), tools }
    }

    /// Pins for all particles at x = 0.
    fn clamped(&self) -> Vec<Pin> {
        let held = (0u32..).zip(&self.points).filter(|(_, p)| p.x == 0.0);
        held.map(|(particle, p)| Pin { particle, between: [(*p).into(); 2] }).collect()
    }

    /// Largest depth below the gap at a time in seconds, relative to the gap: 1 touches, more is inside.
    pub(crate) fn overlap(&self, x: &[DVec3], time: f64) -> f64 {
        let distances = self.skin.iter().flat_map(|particle| self.tools.around(x[*particle as usize], time));
        distances.flatten().map(|surface| 1.0 - surface.distance / GAP).fold(0.0, f64::max)
    }

    /// Volume ÷ rest volume, and the smallest such ratio of a tetrahedron.
    pub(crate) fn volume(&self, x: &[DVec3]) -> (f64, f64) {
        let six = |x: &[DVec3], tet: &[u32; 4]| {
            let [a, b, c, d] = tet.map(|corner| x[corner as usize]);
            (b - a).dot(&(c - a).cross(&(d - a)))
        };
        let (mut now, mut rest, mut least) = (0.0, 0.0, f64::INFINITY);
        for tet in &self.tets {
            let (after, before) = (six(x, tet), six(&self.points, tet));
            (now, rest, least) = (now + after, rest + before, least.min(after / before));
        }
        (now / rest, least)
    }
}
