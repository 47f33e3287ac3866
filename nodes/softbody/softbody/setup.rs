//! What is computed once from the inputs at the start: particles, surfaces, coupling springs, pins and the output
//! components.

use bodies::collision::BodySkin;
use bodies::embedding::{EmbeddedPoint, embed, with_riding};
use bodies::mass_spring::{BodyError, BodySpring, Material, Mesh, SoftBody};
use bodies::tets::{boundary, edges, missing_edges};
use engine::prelude::*;
use numerics::masked::Masked;

use super::joints::{Couple, couple};
use super::pins::{BoundPins, bind_pins};
use super::{BODIES, COUPLING_RADIUS, COUPLING_STIFFNESS, DAMPING, DENSITY, PINS, STIFFNESS};
use crate::shared::attributes::{BODY_NUMBER, FILL, SLIVER, SURFACE_POINT};
use numerics::pieces::pieces;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// The inputs at the start. A chain reads them once, so checkpoints contain them.
#[derive(Serialize, Deserialize)]
pub(super) struct StartInputs {
    pub(super) bodies: Vec<Arc<Geometry>>,
    pub(super) pins: Vec<Arc<Geometry>>,
}

impl StartInputs {
    pub(super) fn at(cx: &FrameCx) -> Self {
        Self { bodies: cx.at_start(BODIES).to_vec(), pins: cx.at_start(PINS).to_vec() }
    }
}

/// All bodies together, with their particles in the order of the wires.
pub(super) struct SimulationSetup {
    /// Particles at the start, metres.
    pub(super) rest: Vec<[f64; 3]>,
    pub(super) tets: Vec<[u32; 4]>,
    slivers: Vec<bool>,
    /// The filled share of each tet.
    fill: Vec<f32>,
    missing: Vec<[u32; 2]>,
    joints: Vec<BodySpring>,
    /// The particles of each wire.
    pub(super) wires: Vec<std::ops::Range<usize>>,
    /// Which particles are on a surface.
    pub(super) outer: Vec<bool>,
    /// The surface of each connected body, for contacts: that of the mesh that rides along where there is one.
    pub(super) skins: Vec<BodySkin>,
    /// The points of meshes that ride along: contact points after the particles.
    riding: Vec<EmbeddedPoint>,
    pub(super) pins: BoundPins,
    /// The output components, except for their positions.
    pub(super) surface: Component,
    pub(super) body: Component,
    /// The embedding of each point of the surface in the tets.
    pub(super) carriers: Vec<EmbeddedPoint>,
}

/// One wire's surface: triangles of its particles, and its output mesh with the embedding of its points.
struct Surface {
    triangles: Vec<[u32; 3]>,
    missing: Vec<[u32; 2]>,
    mesh: Component,
    carriers: Vec<EmbeddedPoint>,
    /// Whether these ride along, rather than being particles.
    rides: bool,
}

/// A masked param over the particles of all bodies, which may come through several wires.
pub(super) struct ParticleNumber {
    pub(super) value: f32,
    pub(super) mask: Option<Vec<f32>>,
}

impl ParticleNumber {
    /// A masked param over the particles of all bodies.
    ///
    /// # Errors
    /// If a body lacks the attribute.
    pub(super) fn of(cx: &Cx, inputs: &StartInputs, param: Param<Maskable>) -> Result<Self> {
        let mut mask = None;
        for geometry in &inputs.bodies {
            if let Some(own) = cx.mask(param, geometry.require(Kind::Tets)?)?.mask {
                mask.get_or_insert_with(Vec::new).extend_from_slice(own);
            }
        }
        Ok(Self { value: cx.get(param).value, mask })
    }

    /// That of a particle.
    fn at(&self, particle: usize) -> f64 {
        f64::from(self.value) * self.mask.as_ref().map_or(1.0, |mask| f64::from(mask[particle]))
    }

    fn masked(&self) -> Masked<'_, f64> {
        Masked { value: f64::from(self.value), mask: self.mask.as_deref() }
    }
}

/// Material params of all particles at a frame.
pub(super) struct MaterialFields {
    density: ParticleNumber,
    stiffness: ParticleNumber,
    damping: ParticleNumber,
    /// The numbers without their masks, which do not change.
    values: [f32; 3],
    /// Number of particles that are not as stiff as asked for.
    pub(super) limited: usize,
}

/// Largest stiffness ÷ density, m²/s²: sound travels at 10 km/s. Beyond that solves end in noise, whose elastic energy exceeds the
/// energy of the motion by far, and beyond 1e17 doubles do not hold the inertia beside the stiffness.
const STIFFEST: f64 = 1e8;

impl MaterialFields {
    pub(super) fn at(cx: &Cx, inputs: &StartInputs) -> Result<Self> {
        let of = |param| ParticleNumber::of(cx, inputs, param);
        let (density, mut stiffness, damping) = (of(DENSITY)?, of(STIFFNESS)?, of(DAMPING)?);
        let values = [density.value, stiffness.value, damping.value];
        let counts = inputs.bodies.iter().map(|body| body.require(Kind::Tets).map(Component::point_count));
        let particles = counts.sum::<Result<usize>>()?;
        let most = |particle: usize| (STIFFEST * density.at(particle)) as f32;
        let asked = |particle: usize| stiffness.at(particle) as f32;
        let is_limited = |particle: &usize| asked(*particle) > most(*particle) && most(*particle) > 0.0;
        let limited = (0..particles).filter(is_limited).count();
        if limited > 0 {
            let held = |particle| if is_limited(&particle) { most(particle) } else { asked(particle) };
            let mask = (0..particles).map(held).collect();
            stiffness = ParticleNumber { value: 1.0, mask: Some(mask) };
        }
        Ok(Self { density, stiffness, damping, values, limited })
    }

    /// The numbers without their masks, which do not change.
    pub(super) fn values(&self) -> [f32; 3] {
        self.values
    }

    pub(super) fn material(&self) -> Material<'_> {
        Material { density: self.density.masked(), stiffness: self.stiffness.masked(), damping: self.damping.masked() }
    }
}

impl SimulationSetup {
    pub(super) fn of(cx: &Cx, inputs: &StartInputs) -> Result<Self> {
        let (mut surface, mut body): (Option<Component>, Option<Component>) = (None, None);
        let (mut rest, mut all, mut slivers, mut missing) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let mut fill = Vec::new();
        let (mut wires, mut triangles, mut carriers) = (Vec::new(), Vec::new(), Vec::new());
        let (mut outer, mut riding, mut riding_triangles) = (Vec::new(), Vec::new(), Vec::new());
        let mut rows = Vec::new();
        for (wire, geometry) in inputs.bodies.iter().enumerate() {
            let own = geometry.require(Kind::Tets)?;
            let first = rest.len() as u32;
            let found = Surface::of(wire, own, geometry.mesh())?;
            rest.extend(own.positions().iter().map(|p| p.map(f64::from)));
            all.extend(own.tet_corners().iter().map(|tet| tet.map(|corner| corner + first)));
            match own.get(SLIVER) {
                Some(flat) => slivers.extend(flat.iter().map(|flat| *flat != 0)),
                None => slivers.resize(all.len(), false),
            }
            match own.get(FILL) {
                Some(shares) => fill.extend_from_slice(shares),
                None => fill.resize(all.len(), 1.0),
            }
            missing.extend(found.missing.iter().map(|edge| edge.map(|end| end + first)));
            triangles.extend(found.triangles.iter().map(|corners| corners.map(|corner| corner + first)));
            rows.resize(rest.len(), -1);
            let points = (carriers.len() as i32..).zip(&found.carriers).filter(|_| !found.rides);
            points.for_each(|(row, carrier)| rows[first as usize + carrier.particles[0] as usize] = row);
            let carried = found.carriers.iter().map(|carrier| EmbeddedPoint {
                particles: carrier.particles.map(|particle| particle + first),
                ..*carrier
            });
            carriers.extend(carried.clone());
            if found.rides {
                let before = riding.len() as u32;
                riding_triangles.extend(found.mesh.triangles().corners.iter().map(|face| face.map(|c| c + before)));
                riding.extend(carried);
            }
            let surface_points = own.get(SURFACE_POINT);
            outer.extend((0..own.point_count()).map(|point| surface_points.is_some_and(|rows| rows[point] >= 0)));
            wires.push(first as usize..rest.len());
            body = Some(joined(body, own)?);
            surface = Some(joined(surface, &found.mesh)?);
        }
        if let Some(body) = body.as_mut().filter(|_| cx.wants(BODY_NUMBER)) {
            body.set(BODY_NUMBER, body_numbers(inputs)?)?;
        }
        if let Some(body) = body.as_mut().filter(|body| cx.wants(SURFACE_POINT) && body.get(SURFACE_POINT).is_some()) {
            body.set(SURFACE_POINT, rows)?;
        }
        triangles.iter().flatten().for_each(|corner: &u32| outer[*corner as usize] = true);
        let links = all.iter().flat_map(|[first, others @ ..]: &[u32; 4]| others.map(|other| [*first, other]));
        let parts = pieces(rest.len(), links);
        let material = MaterialFields::at(cx, inputs)?;
        let joints = couple(&Couple {
            points: &rest,
            triangles: &triangles,
            parts: &parts,
            radius: cx.get(COUPLING_RADIUS),
            stiffness: cx.get(COUPLING_STIFFNESS),
            damping: f64::from(cx.get(DAMPING).value),
        });
        let mut setup = Self {
            outer,
            skins: Vec::new(),
            pins: bind_pins(&inputs.pins, &rest)?,
            surface: surface.map_or_else(|| Component::mesh(Vec::new(), Vec::new(), Vec::new()), Ok)?,
            body: body.map_or_else(|| Component::tets(Vec::new(), Vec::new()), Ok)?,
            carriers,
            riding,
            rest,
            tets: all,
            slivers,
            fill,
            missing,
            joints,
            wires,
        };
        let links = setup.body(&material)?.springs();
        setup.skins = setup.skins(triangles, riding_triangles, &parts, &links)?;
        Ok(setup)
    }

    /// The surface of each connected body: of the triangles over points that ride along, or where there are none, those
    /// over particles.
    fn skins(
        &self,
        mut triangles: Vec<[u32; 3]>,
        mut riding: Vec<[u32; 3]>,
        parts: &[u32],
        links: &[[u32; 2]],
    ) -> Result<Vec<BodySkin>> {
        let count = self.rest.len() as u32;
        let part = |corners: &[u32; 3]| {
            let first = corners[0].checked_sub(count).and_then(|point| self.riding[point as usize].sides().next());
            parts[first.map_or(corners[0], |side| side.0) as usize]
        };
        riding.iter_mut().flatten().for_each(|corner| *corner += count);
        let mut with_riding: Vec<u32> = riding.iter().map(part).collect();
        with_riding.sort_unstable();
        triangles.retain(|corners| with_riding.binary_search(&part(corners)).is_err());
        triangles.extend(riding);
        triangles.sort_by_key(part);
        let surfaces: Vec<&[[u32; 3]]> = triangles.chunk_by(|a, b| part(a) == part(b)).collect();
        let skins = BodySkin::several(&self.rest, &self.riding, &surfaces, links);
        skins.map_err(|error| Error::refused(format!("`bodies`: {error}")))
    }

    /// The contact points with particles at `positions`.
    pub(super) fn contact_points(&self, positions: &[[f64; 3]]) -> Vec<[f64; 3]> {
        with_riding(positions.to_vec(), &self.riding)
    }

    /// The number at each contact point of one that is given for particles.
    pub(super) fn at_contact_points(&self, mut numbers: Vec<f32>) -> Vec<f32> {
        let of =
            |point: &EmbeddedPoint| point.sides().map(|(of, weight)| f64::from(numbers[of as usize]) * weight).sum();
        let riding: Vec<f64> = self.riding.iter().map(of).collect();
        numbers.extend(riding.into_iter().map(|number| number.max(0.0) as f32));
        numbers
    }

    /// The number of points of the surface that are farther outside the tets than a tet is large.
    pub(super) fn carried_outside(&self) -> usize {
        let is_outside = |carrier: &&EmbeddedPoint| carrier.weights.iter().any(|weight| *weight < -1.0);
        self.carriers.iter().filter(is_outside).count()
    }

    /// The wire that the particles of a skin came through.
    pub(super) fn wire_of(&self, skin: usize) -> Option<usize> {
        let first = *self.skins[skin].points().first()? as usize;
        let carrier = first.checked_sub(self.rest.len()).map(|point| &self.riding[point]);
        let first = carrier.and_then(|carrier| carrier.sides().next()).map_or(first, |side| side.0 as usize);
        self.wire_of_particle(first)
    }

    /// The wire that a particle came through.
    pub(super) fn wire_of_particle(&self, particle: usize) -> Option<usize> {
        self.wires.iter().position(|wire| wire.contains(&particle))
    }

    /// The body that the solver works on.
    pub(super) fn body(&self, material: &MaterialFields) -> Result<SoftBody> {
        let mesh = Mesh {
            points: &self.rest,
            tets: &self.tets,
            slivers: &self.slivers,
            fill: &self.fill,
            missing: &self.missing,
            riding: &self.riding,
        };
        SoftBody::new(&mesh, &material.material(), &self.joints).map_err(refusal)
    }

    /// Number of edges of the skins that colliders release with contact points at `x`.
    pub(super) fn let_go(&self, x: &[[f64; 3]]) -> usize {
        self.skins.iter().map(|skin| skin.released_edges(x)).sum()
    }

    /// Springs between bodies.
    pub(super) fn joints(&self) -> usize {
        self.joints.len()
    }
}

/// Why the solver refuses a body.
pub(super) fn refusal(error: BodyError) -> Error {
    let hint = match error {
        BodyError::Point(_) => "points of `bodies` need finite positions",
        BodyError::NoMass => "raise `density` where tets have a volume, or replace the flat tets",
        BodyError::Particles { .. } => "a tet needs four different points",
        BodyError::Number { .. } => "`density`, `stiffness`, `damping` and their masks need finite numbers",
    };
    Error::refused(format!("`bodies`: {error}")).hint(hint)
}

/// The body that each tet belongs to: `body` of each wire, counted on from the wires before it. A wire without it is one
/// body.
fn body_numbers(inputs: &StartInputs) -> Result<Vec<i32>> {
    let mut numbers: Vec<i32> = Vec::new();
    let mut first = 0_i32;
    for geometry in &inputs.bodies {
        let tets = geometry.require(Kind::Tets)?;
        let own = tets.get(BODY_NUMBER);
        let number = |tet: usize| first.saturating_add(own.map_or(0, |own| own[tet]));
        let of_wire: Vec<i32> = (0..tets.element_count()).map(number).collect();
        first = of_wire.iter().fold(first, |first, number| first.max(number.saturating_add(1)));
        numbers.extend(of_wire);
    }
    Ok(numbers)
}

fn joined(before: Option<Component>, next: &Component) -> Result<Component> {
    Ok(match before {
        Some(before) => before.concat(next)?,
        None => next.clone(),
    })
}

impl Surface {
    fn of(wire: usize, tets: &Component, mesh: Option<&Component>) -> Result<Self> {
        match mesh.and_then(|mesh| Some((mesh, rows(tets, mesh)?))) {
            Some((mesh, rows)) => Ok(Self::own(tets, mesh, &rows)),
            None => Self::around(wire, tets, mesh),
        }
    }

    /// A surface mesh whose points are points of the tets.
    fn own(tets: &Component, mesh: &Component, rows: &[u32]) -> Self {
        let particles = |corners: &[u32; 3]| corners.map(|corner| rows[corner as usize]);
        let faces = mesh.faces().expect("a mesh has faces");
        let edges: Vec<[u32; 2]> =
            edges(faces.runs.starts(), &faces.corners).iter().map(|edge| edge.map(|end| rows[end as usize])).collect();
        Self {
            triangles: mesh.triangles().corners.iter().map(particles).collect(),
            missing: missing_edges(&edges, tets.tet_corners()),
            mesh: mesh.clone(),
            carriers: rows.iter().map(|row| EmbeddedPoint::at_particle(*row)).collect(),
            rides: false,
        }
    }

    /// The boundary of the tets; a mesh that comes with them is embedded.
    fn around(wire: usize, tets: &Component, mesh: Option<&Component>) -> Result<Self> {
        let (points, corners) = (tets.positions(), tets.tet_corners());
        let triangles: Vec<[u32; 3]> = boundary(corners, points).iter().map(|face| face.corners).collect();
        let rides = mesh.is_some();
        let (mesh, carriers) = match mesh {
            Some(mesh) => {
                let carriers = embed(points, corners, mesh.positions());
                let carriers = carriers.or_else(|| (mesh.point_count() == 0).then(Vec::new)).ok_or_else(|| {
                    Error::refused(format!(
                        "no tet of `bodies` {wire} has a volume, so none can carry the mesh that comes with them"
                    ))
                    .hint("remove the mesh, or use the tets that Tetrahedralize makes from it")
                })?;
                (mesh.clone(), carriers)
            }
            None => {
                let mut used: Vec<u32> = triangles.as_flattened().to_vec();
                used.sort_unstable();
                used.dedup();
                let row = |corner: &u32| used.partition_point(|point| point < corner) as u32;
                let places = used.iter().map(|point| points[*point as usize]).collect();
                let flat = triangles.as_flattened().iter().map(row).collect();
                let mesh = Component::mesh(vec![3; triangles.len()], flat, places)?;
                (mesh, used.iter().map(|point| EmbeddedPoint::at_particle(*point)).collect())
            }
        };
        Ok(Self { triangles, missing: Vec::new(), mesh, carriers, rides })
    }
}

/// The tets' point for each point of the mesh, if `surface_point` gives one for all.
fn rows(tets: &Component, mesh: &Component) -> Option<Vec<u32>> {
    let mut rows = vec![u32::MAX; mesh.point_count()];
    for (point, row) in tets.get(SURFACE_POINT)?.iter().enumerate().filter(|(_, row)| **row >= 0) {
        *rows.get_mut(*row as usize)? = point as u32;
    }
    (!rows.is_empty() && !rows.contains(&u32::MAX)).then_some(rows)
}
