//! The liquid at the start, from meshes.

use engine::prelude::*;
use liquid::carried::LiquidMaterial;
use liquid::level_set::LevelSet;
use liquid::marked::MarkedSurface;
use liquid::rows::CellRows;
use liquid::shape::{MeshShape, ShapeSettings};
use liquid::step::{Domain, Surface};
use liquid::volumes::StartPart;
use numerics::vector::scale;

use super::LIQUID;
use super::carried::{CarriedColumns, MeshAttributes};
use super::domain::resolution;
use super::openings::material_of;
use super::shapes::{Colliders, cells_inside, check_size, enclosed, in_cells, topology};
use crate::shared::attributes::{SOURCE_DENSITY, SOURCE_VISCOSITY};
use crate::shared::volume::Lattice;

/// Seed of the places of markers: they mark the same surface whatever it is.
const SEED: u64 = 0x0066_6c75_6964;

/// Cells that a mesh must have, about, for it to matter that the grid shows nothing of it.
const LEAST_SHOWN: f64 = 1e-6;

/// Share by which the cells that a mesh covers may differ from what its triangles enclose.
const MISCOUNTED: f64 = 0.05;

/// Distance from a surface, in cells, at which the middle of a cell is outside: rounding must not decide it where a face
/// goes through the middles of a whole row.
const OFF_MIDDLE: f32 = 1e-4;

/// Bytes that a cell of liquid takes while it moves.
const CELL_BYTES: f64 = 400.0;

/// Bytes that the points in a cell take besides, where liquids are of several materials: eight, while they are sorted anew.
const MATERIAL_BYTES: f64 = 8.0 * 2.0 * 20.0;

/// The liquid at the start.
pub(super) struct StartLiquid {
    /// The surface of all meshes together.
    pub(super) surface: MarkedSurface,
    /// The attributes of the markers.
    pub(super) columns: CarriedColumns,
    /// Surface cells along the side of a solver cell.
    by: u32,
    meshes: Vec<(MeshShape, LiquidMaterial)>,
    /// What is known of the meshes, in their order.
    found: Vec<StartMesh>,
}

/// A mesh of liquid at the start, in surface cells.
struct StartMesh {
    /// The corners of the box around it.
    low: [f32; 3],
    high: [f32; 3],
    /// What its triangles enclose, where all of them enclose something.
    volume: Option<f64>,
}

impl StartMesh {
    fn new(points: &[[f32; 3]], volume: Option<f64>) -> Self {
        let along = |beyond: fn(f32, f32) -> f32, start| {
            [0, 1, 2].map(|k| points.iter().fold(start, |most, p| beyond(most, p[k])))
        };
        Self { low: along(f32::min, f32::INFINITY), high: along(f32::max, f32::NEG_INFINITY), volume }
    }

    fn is_in(&self, [low, high]: [[i32; 3]; 2]) -> bool {
        (0..3).all(|k| low[k] as f32 <= self.low[k] && self.high[k] <= high[k] as f32)
    }

    /// Whether it lies outside wholly; a mesh without points does not.
    fn misses(&self, [low, high]: [[i32; 3]; 2]) -> bool {
        self.low[0] <= self.high[0] && (0..3).any(|k| self.high[k] <= low[k] as f32 || high[k] as f32 <= self.low[k])
    }

    fn overlaps(&self, other: &Self) -> bool {
        (0..3).all(|k| self.low[k] < other.high[k] && other.low[k] < self.high[k])
    }
}

impl StartLiquid {
    /// Whether a mesh has a material of its own.
    pub(super) fn has_materials(&self) -> bool {
        self.meshes.iter().any(|(_, material)| material.is_own())
    }

    /// Number of liquids that do not mix.
    pub(super) fn phases(&self) -> u32 {
        self.meshes.len().max(1) as u32
    }

    /// The volume of a surface cell, m³; `cell`: the side of a solver cell, m.
    fn cell_volume(&self, cell: f64) -> f64 {
        let side = cell / f64::from(self.by);
        side * side * side
    }

    /// What of the meshes lies where there is no liquid. `cell`: the side of a solver cell, m.
    pub(super) fn known(&self, domain: &Domain, colliders: &Colliders, cell: f64) -> StartLosses {
        let by = self.by as f32;
        let bounds = [domain.low, domain.high].map(|corner| corner.map(|x| x * self.by as i32));
        let mut losses = StartLosses { outside: 0.0, in_colliders: 0.0, shown: 0.0 };
        for ((shape, _), found) in self.meshes.iter().zip(&self.found) {
            let seen = covered(shape, |_| 1.0);
            let open = |cell: [i32; 3]| {
                let distance = colliders.distance(1.0, cell.map(|x| (x as f32 + 0.5) / by));
                (0.5 + by * distance).clamp(0.0, 1.0)
            };
            let free = if colliders.is_empty() { seen } else { covered(shape, open) };
            let is_in = found.is_in(bounds);
            let share = |part: f64, whole: f64| if whole > 0.0 { 1.0 - part / whole } else { 0.0 };
            let whole = found.volume.filter(|_| !is_in).unwrap_or(seen);
            let outside = if found.misses(bounds) { 1.0 } else { share(seen, whole) };
            losses.outside = losses.outside.max(outside);
            losses.in_colliders = losses.in_colliders.max(share(free, seen));
            // Where walls and colliders take nothing, what the triangles enclose.
            let is_whole = is_in && free == seen;
            losses.shown += found.volume.filter(|_| is_whole).unwrap_or(free);
        }
        let overlap = |n: usize| (0..n).any(|other| self.found[n].overlaps(&self.found[other]));
        if (0..self.found.len()).any(overlap) {
            losses.shown = 0.0;
        }
        losses.shown *= self.cell_volume(cell);
        losses
    }

    /// The meshes as parts of the liquid, with the volume of those that are whole: inside the box, off colliders and other
    /// liquid. `cell`: the side of a solver cell, m.
    pub(super) fn parts(&self, domain: &Domain, colliders: &Colliders, cell: f64) -> Vec<StartPart> {
        let by = self.by as i32;
        let bounds = [domain.low, domain.high].map(|corner| corner.map(|x| x * by));
        let unit = self.cell_volume(cell);
        let part = |n: usize| {
            let (shape, found) = (&self.meshes[n].0, &self.found[n]);
            let is_apart = || (0..self.found.len()).all(|other| other == n || !found.overlaps(&self.found[other]));
            let is_off = || {
                let at = |cell: [i32; 3]| cell.map(|x| (x as f32 + 0.5) / by as f32);
                let mut near = shape.rows().iter().zip(shape.distance()).filter(|(_, distance)| **distance < 0.5);
                colliders.is_empty() || near.all(|(cell, _)| colliders.distance(1.0, at(cell)) > 1.0)
            };
            // Of two shells that overlap, what both enclose counts twice.
            let is_simple = |volume: &f64| (covered(shape, |_| 1.0) / volume - 1.0).abs() < MISCOUNTED;
            let volume =
                found.volume.filter(|_| found.is_in(bounds) && is_apart()).filter(is_simple).filter(|_| is_off());
            let inside = shape.rows().filtered(|_, at| shape.distance()[at] < 0.0);
            StartPart { inside, volume: volume.map(|volume| volume * unit) }
        };
        (0..self.meshes.len()).map(part).collect()
    }

    /// What the liquid at a place in solver cells is made of.
    pub(super) fn material(&self, place: [f32; 3]) -> LiquidMaterial {
        let mesh = mesh_at(&self.meshes, scale(place, self.by as f32));
        mesh.map(|n| self.meshes[n].1).unwrap_or_default()
    }
}

/// What of the liquid at the start lies where there is none.
pub(super) struct StartLosses {
    /// Largest share of a mesh that is outside the box.
    pub(super) outside: f64,
    /// Of what is in the box, the largest share of a mesh that is inside colliders.
    pub(super) in_colliders: f64,
    /// What the surface should enclose, m³; 0 where meshes overlap, so that it is not known.
    shown: f64,
}

impl StartLosses {
    /// The share of it that the surface does not enclose, where it encloses `volume`, m³.
    pub(super) fn unseen(&self, volume: f64) -> f64 {
        if self.shown > 0.0 { (1.0 - volume / self.shown).max(0.0) } else { 0.0 }
    }
}

/// Number of cells that a shape covers, as far as `open` says of each; those that its surface passes in part.
fn covered(shape: &MeshShape, open: impl Fn([i32; 3]) -> f32) -> f64 {
    let cells = shape.rows().iter().zip(shape.distance());
    cells.fold(0.0, |sum, (cell, distance)| sum + f64::from((0.5 - distance).clamp(0.0, 1.0) * open(cell)))
}

/// The last mesh that a place in surface cells is in; where it is in none, the closest.
fn mesh_at(meshes: &[(MeshShape, LiquidMaterial)], place: [f32; 3]) -> Option<usize> {
    let cell = place.map(|x| x.floor() as i32);
    let mut best: Option<(usize, f32)> = None;
    for (n, (shape, _)) in meshes.iter().enumerate() {
        let Some(distance) = shape.rows().find(cell).map(|at| shape.distance()[at]) else { continue };
        if best.is_none_or(|(_, least)| distance < least.max(0.0)) {
            best = Some((n, distance));
        }
    }
    best.map(|(n, _)| n)
}

/// All meshes of the liquid at the start.
///
/// # Errors
/// Where a mesh has no inside, or the liquid takes more memory than there is.
pub(super) fn liquid_at_start(cx: &Cx, domain: &Domain, lattice: Lattice) -> Result<StartLiquid> {
    let by = resolution(cx);
    let fine = lattice.refined(by);
    let [low, high] = [domain.low, domain.high].map(|corner| corner.map(|x| x * by as i32));
    let settings = ShapeSettings::new(low, high);
    let has_material = |mesh: &Component| mesh.get(SOURCE_VISCOSITY).is_some() || mesh.get(SOURCE_DENSITY).is_some();
    let is_split = cx.at_start(LIQUID).iter().filter_map(|geometry| geometry.mesh()).any(has_material);
    let bytes = fine_cell_bytes(by, is_split);
    let (mut shapes, mut parts, mut found) = (Vec::new(), Vec::new(), Vec::new());
    for (wire, mesh) in cx.at_start(LIQUID).iter().filter_map(|geometry| geometry.mesh()).enumerate() {
        let what = format!("`liquid` {wire} (counted from 0)");
        let topology = topology(mesh, fine, &what)?;
        let material = LiquidMaterial { phase: wire as u32, ..material_of(mesh, &what)? };
        let points = in_cells(mesh, fine);
        let least = cells_inside(mesh, &points, [low, high]);
        check_size(least, &what)?;
        cx.reserve(least * bytes, "use larger cells, or less liquid")?;
        let shape = MeshShape::new(&topology, &points, &settings);
        if least > LEAST_SHOWN && is_unseen(&shape, [low, high], &points) {
            let fact = format!("{what} is thinner everywhere than the surface's cells, so none of it is seen");
            return Err(Error::refused(fact).hint("use smaller cells, raise `resolution`, or remove the mesh"));
        }
        let volume = (topology.open_triangles() == 0).then(|| enclosed(mesh, &points));
        found.push(StartMesh::new(&points, volume));
        shapes.push((shape, material));
        parts.push(mesh);
    }
    let mut rows = CellRows::default();
    for (shape, _) in &shapes {
        rows = rows.union(shape.rows());
    }
    let mut phi = vec![settings.band; rows.len()];
    for (shape, _) in &shapes {
        rows.for_each_shared(shape.rows(), |to, from, len| {
            let closer = phi[to..to + len].iter_mut().zip(&shape.distance()[from..from + len]);
            closer.for_each(|(phi, distance)| *phi = phi.min(off_middle(*distance)));
        });
    }
    let mut set = LevelSet::new(&rows, &phi, low, high);
    set.fill();
    let mut surface = MarkedSurface::of_level_set(set, by, 0, SEED).within(domain);
    let mut columns = CarriedColumns::default();
    let attributes: Vec<Option<MeshAttributes>> =
        parts.iter().map(|mesh| columns.add_mesh(mesh, lattice, &mut surface)).collect();
    surface.edit_attributes(&|place, row| {
        let mesh = mesh_at(&shapes, scale(place, by as f32));
        if let Some(attributes) = mesh.and_then(|n| attributes[n].as_ref()) {
            attributes.write(place, row);
        }
    });
    Ok(StartLiquid { surface, columns, by, meshes: shapes, found })
}

/// Bytes that a cell of the surface in the liquid takes while it moves, where there are `by` along the side of a solver cell;
/// more where liquids are of several materials.
fn fine_cell_bytes(by: u32, is_split: bool) -> f64 {
    let faces = f64::from(by.pow(2));
    CELL_BYTES / faces + if is_split { MATERIAL_BYTES / (faces * f64::from(by)) } else { 0.0 }
}

/// Refuses liquid that grows, to so many solver cells, beyond the memory that there is.
///
/// # Errors
/// Where it takes more.
pub(super) fn check_grown(cx: &Cx, liquid_cells: f64, is_split: bool) -> Result<()> {
    let by = resolution(cx);
    let cells = liquid_cells * f64::from(by.pow(3));
    cx.reserve(cells * fine_cell_bytes(by, is_split), "use larger cells, a smaller box, or less from `sources`")
}

/// A distance that is not 0.
fn off_middle(distance: f32) -> f32 {
    if distance.abs() < OFF_MIDDLE { OFF_MIDDLE } else { distance }
}

/// Whether a mesh that reaches into the box has no cell with its middle inside.
fn is_unseen(shape: &MeshShape, [low, high]: [[i32; 3]; 2], points: &[[f32; 3]]) -> bool {
    let reaches_in = (0..3).all(|k| {
        let along = |beyond: fn(f32, f32) -> f32, start| points.iter().fold(start, |most, p| beyond(most, p[k]));
        along(f32::min, f32::INFINITY) < high[k] as f32 && along(f32::max, f32::NEG_INFINITY) > low[k] as f32
    });
    reaches_in && shape.distance().iter().all(|distance| *distance >= 0.0)
}
