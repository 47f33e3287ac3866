//! Meshes as the solver sees them, and colliders in motion.

use std::sync::Arc;

use engine::prelude::*;
use liquid::level_set::Distance;
use liquid::rows::Cell;
use liquid::shape::{MovingShape, ShapeSettings, ShapeTopology};
use liquid::step::Domain;

use super::COLLIDERS;
use crate::shared::volume::Lattice;

/// Distance from colliders where there are none, cells.
const FAR: f32 = 5.0;

/// Most cells of liquid at the start; they are counted in 32 bits.
const MOST_CELLS: f64 = 1e9;

/// Refuses a shape of more cells than are counted.
///
/// # Errors
/// Where it has.
pub(super) fn check_size(cells: f64, what: &str) -> Result<()> {
    if cells <= MOST_CELLS {
        return Ok(());
    }
    let fact = format!("{what} is about {cells:.1e} cells, more than {MOST_CELLS:.0e}");
    Err(Error::refused(fact).hint("use larger cells, or a smaller mesh or box"))
}

/// Number of cells inside a mesh, about: its volume, but no more than its box has in `bounds`.
pub(super) fn cells_inside(mesh: &Component, points: &[[f32; 3]], bounds: [[i32; 3]; 2]) -> f64 {
    let volume = enclosed(mesh, points);
    let mut most = 1.0;
    for k in 0..3 {
        let along = || points.iter().map(|p| f64::from(p[k]).clamp(f64::from(bounds[0][k]), f64::from(bounds[1][k])));
        most *= along().fold(f64::NEG_INFINITY, f64::max) - along().fold(f64::INFINITY, f64::min) + 2.0;
    }
    if volume < most { volume } else { most }
}

/// What the triangles of a mesh with these points enclose.
pub(super) fn enclosed(mesh: &Component, points: &[[f32; 3]]) -> f64 {
    let origin = points.first().copied().unwrap_or_default();
    let corners = &mesh.triangles().corners;
    let six = corners.iter().map(|corners| {
        let [a, b, c] = corners.map(|corner| points[corner as usize]);
        numerics::volume::six_volumes([origin, a, b, c])
    });
    six.fold(0.0, |sum, x| sum + x).abs() / 6.0
}

/// A mesh's points in cells.
pub(super) fn in_cells(mesh: &Component, lattice: Lattice) -> Vec<[f32; 3]> {
    mesh.positions().iter().map(|point| lattice.in_cells(*point)).collect()
}

/// Which triangles of a mesh enclose volume.
///
/// # Errors
/// Where none does.
pub(super) fn topology(mesh: &Component, lattice: Lattice, what: &str) -> Result<ShapeTopology> {
    let triangles = &mesh.triangles().corners;
    let topology = ShapeTopology::new(&in_cells(mesh, lattice), triangles);
    if topology.open_triangles() == triangles.len() && !triangles.is_empty() {
        let fact = format!("{what} is not closed, so it has no inside");
        return Err(Error::refused(fact).hint("close its holes, or give it thickness"));
    }
    Ok(topology)
}

/// One collider over a step.
struct Collider {
    topology: Arc<ShapeTopology>,
    shape: MovingShape,
    /// The mesh at the end of the step.
    end: Component,
}

impl Collider {
    /// A collider that moves from one mesh to the next. What `last`, the same collider in the step before, ended with is
    /// not computed again.
    fn moving(
        last: Option<Self>,
        [before, after]: [&Component; 2],
        settings: &ShapeSettings,
        lattice: Lattice,
    ) -> Self {
        let place = |mesh: &Component| mesh.table(Owner::Point).column("P").map(Column::address);
        let topology = topology_of(before, lattice);
        let goes_on = |last: &Self| place(&last.end) == place(before) && last.topology == topology;
        let to = in_cells(after, lattice);
        let shape = match last.filter(goes_on) {
            Some(last) => last.shape.next_frame(&topology, &to),
            None => MovingShape::new(&topology, &in_cells(before, lattice), &to, settings),
        };
        Self { topology, shape, end: after.clone() }
    }
}

/// The colliders of a step.
#[derive(Default)]
pub(super) struct Colliders(Vec<Collider>);

impl Colliders {
    /// The colliders where they are at the start.
    ///
    /// # Errors
    /// Where one is too large.
    pub(super) fn at_start(cx: &Cx, domain: &Domain, lattice: Lattice) -> Result<Self> {
        let meshes = || cx.at_start(COLLIDERS).iter().filter_map(|geometry| geometry.mesh());
        for (wire, mesh) in meshes().enumerate() {
            check_collider(wire, mesh, domain, lattice)?;
        }
        Ok(Self::still(meshes(), domain, lattice))
    }

    /// The colliders where they are at the frame that is cooked.
    pub(super) fn now(cx: &Cx, domain: &Domain, lattice: Lattice) -> Self {
        Self::still(cx.part(COLLIDERS).into_iter(), domain, lattice)
    }

    /// Colliders that stay where they are.
    pub(super) fn still<'a>(meshes: impl Iterator<Item = &'a Component>, domain: &Domain, lattice: Lattice) -> Self {
        Self(meshes.map(|mesh| Collider::moving(None, [mesh; 2], &settings(domain), lattice)).collect())
    }

    /// The colliders in motion over a step; `last` are those of the step before, where they are known.
    ///
    /// # Errors
    /// Where a collider changes its faces within it, or is too large.
    pub(super) fn within_step(cx: &StepCx, last: Option<Self>, domain: &Domain, lattice: Lattice) -> Result<Self> {
        let [(_, before), .., (_, after)] = cx.samples(COLLIDERS) else { return Ok(Self(Vec::new())) };
        let mut last = last.map(|colliders| colliders.0.into_iter()).into_iter().flatten();
        let mut colliders = Vec::with_capacity(before.len());
        for (wire, (before, after)) in before.iter().zip(after).enumerate() {
            let (Some(before), Some(after)) = (before.mesh(), after.mesh()) else { continue };
            let same = before.topology().same(after.topology()) || before.topology() == after.topology();
            if !same {
                let count =
                    |mesh: &Component| format!("{} faces of {} points", mesh.element_count(), mesh.point_count());
                let fact = format!("`colliders` {wire} changes from {} to {}", count(before), count(after));
                return Err(Error::refused(fact).hint("a collider needs the same faces and points at every frame"));
            }
            check_collider(wire, after, domain, lattice)?;
            colliders.push(Collider::moving(last.next(), [before, after], &settings(domain), lattice));
        }
        Ok(Self(colliders))
    }

    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// How many move farther in the step than their shapes follow accurately.
    pub(super) fn fast(&self) -> usize {
        self.0.iter().filter(|collider| collider.shape.is_capped()).count()
    }

    /// Cells that the surface of the fastest of those that come near these cells moves along its normal in the step.
    pub(super) fn sweep_near(&self, cells: Option<(Cell, Cell)>) -> f64 {
        let Some((low, high)) = cells else { return 0.0 };
        let sweeps = self.0.iter().map(|collider| collider.shape.sweep_near([low, high]));
        f64::from(sweeps.fold(0.0, f32::max))
    }

    /// `distance`, where there are colliders.
    pub(super) fn solid<'a>(&self, distance: &'a Distance<'a>) -> Option<&'a Distance<'a>> {
        if self.is_empty() { None } else { Some(distance) }
    }

    /// The distance from the closest, in cells, at a share of the step.
    pub(super) fn distance(&self, share: f32, point: [f32; 3]) -> f32 {
        self.closest(share, point).map_or(FAR, |(_, distance)| distance)
    }

    /// The velocity of the closest, cells a step.
    pub(super) fn velocity(&self, share: f32, point: [f32; 3]) -> [f32; 3] {
        self.closest(share, point).map_or([0.0; 3], |(shape, _)| shape.velocity(share, point))
    }

    fn closest(&self, share: f32, point: [f32; 3]) -> Option<(&MovingShape, f32)> {
        let all = self.0.iter().map(|collider| (&collider.shape, collider.shape.distance(share, point)));
        all.reduce(|best, next| if next.1 < best.1 { next } else { best })
    }
}

/// Refuses a collider of more cells than are counted.
fn check_collider(wire: usize, mesh: &Component, domain: &Domain, lattice: Lattice) -> Result<()> {
    let cells = cells_inside(mesh, &in_cells(mesh, lattice), [domain.low, domain.high]);
    check_size(cells, &format!("`colliders` {wire} (counted from 0)"))
}

fn settings(domain: &Domain) -> ShapeSettings {
    ShapeSettings { thicken: true, ..ShapeSettings::new(domain.low, domain.high) }
}

/// The topology of a mesh, found once for meshes that stay as they are.
fn topology_of(mesh: &Component, lattice: Lattice) -> Arc<ShapeTopology> {
    mesh.derived(|mesh| ShapeTopology::new(&in_cells(mesh, lattice), &mesh.triangles().corners))
}
