//! Attributes that liquid, sources and tracers bring along, on the points of `particles`.

use std::ops::Range;

use engine::prelude::*;
use liquid::marked::MarkedSurface;
use numerics::tree::TriangleTree;
use serde::{Deserialize, Serialize};

use super::shapes::in_cells;
use crate::shared::attributes::{
    PARTICLE_DENSITY, PARTICLE_KIND, PARTICLE_VISCOSITY, PARTICLE_VOLUME, absent, flat, rows_of,
};
use crate::shared::volume::Lattice;

/// Names that `particles` has values of its own for.
const OWN: [&str; 9] = [
    P.name,
    N.name,
    V.name,
    ID.name,
    THICKNESS.name,
    PARTICLE_KIND.name,
    PARTICLE_VOLUME.name,
    PARTICLE_VISCOSITY.name,
    PARTICLE_DENSITY.name,
];

/// The attributes of points, of 1, 3 or 4 floats, that came in.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct CarriedColumns {
    all: Vec<CarriedColumn>,
    /// The names that some came with another number of floats by: what they are there is left out.
    clashes: Vec<String>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct CarriedColumn {
    name: String,
    /// Numbers a row.
    width: usize,
    /// The first of its lists among those of the markers, where a mesh has it.
    first: Option<usize>,
    /// Its rows at the tracers' start, one after the other, where a tracer has it.
    tracers: Vec<f32>,
}

impl CarriedColumn {
    /// What a point has that came without it.
    fn absent(&self) -> &'static [f32] {
        absent(&self.name, self.width)
    }
}

/// The attributes of points with 1, 3 or 4 floats, besides those that `particles` has of its own.
fn brought(part: &Component) -> impl Iterator<Item = (&str, &Column)> {
    let is_meant = |name: &str, column: &Column| column.kind().is_float() && !OWN.contains(&name);
    part.table(Owner::Point)
        .iter()
        .map(|(name, column)| (&**name, column))
        .filter(move |(name, column)| is_meant(name, column))
}

impl CarriedColumns {
    /// Number of names that came with several numbers of floats.
    pub(super) fn clashes(&self) -> usize {
        self.clashes.len()
    }

    /// The number of lists that markers have.
    fn lists(&self) -> usize {
        self.all.iter().filter_map(|column| Some(column.first? + column.width)).max().unwrap_or(0)
    }

    /// The place of a column, and whether it has that many floats: the first that came with a name says how many it has.
    fn column(&mut self, name: &str, width: usize) -> Option<&mut CarriedColumn> {
        let place = self.all.iter().position(|column| column.name == name).unwrap_or_else(|| {
            self.all.push(CarriedColumn { name: name.to_owned(), width, first: None, tracers: Vec::new() });
            self.all.len() - 1
        });
        if self.all[place].width != width {
            if !self.clashes.iter().any(|clash| clash == name) {
                self.clashes.push(name.to_owned());
            }
            return None;
        }
        Some(&mut self.all[place])
    }

    /// Makes place on the markers for the attributes of a mesh; says what it has.
    pub(super) fn add_mesh(
        &mut self,
        mesh: &Component,
        lattice: Lattice,
        surface: &mut MarkedSurface,
    ) -> Option<MeshAttributes> {
        let mut columns = Vec::new();
        // Quaternions are no numbers that may be mixed one by one.
        for (name, column) in brought(mesh).filter(|(name, _)| *name != ORIENT.name) {
            let (lists, width) = (self.lists(), column.kind().width());
            let Some(own) = self.column(name, width) else { continue };
            let first = match own.first {
                Some(first) => first,
                None => {
                    own.first = Some(lists);
                    surface.add_attributes(own.absent());
                    lists
                }
            };
            columns.push((first..first + width, flat(column).to_vec()));
        }
        if columns.is_empty() {
            return None;
        }
        let corners = mesh.triangles().corners.clone();
        Some(MeshAttributes { tree: TriangleTree::build(&in_cells(mesh, lattice), &corners), corners, columns })
    }

    /// Takes over the attributes of tracers.
    pub(super) fn add_tracers(&mut self, wires: &[&Component]) {
        let count: usize = wires.iter().map(|part| part.point_count()).sum();
        let mut first = 0;
        for part in wires {
            for (name, column) in brought(part) {
                let width = column.kind().width();
                let Some(own) = self.column(name, width) else { continue };
                if own.tracers.is_empty() {
                    own.tracers = own.absent().repeat(count);
                }
                let rows = flat(column);
                own.tracers[first * width..][..rows.len()].copy_from_slice(rows);
            }
            first += part.point_count();
        }
    }

    /// Sets the attributes of points: first those on the surface, then so many without, then the tracers of these numbers.
    ///
    /// # Errors
    /// None: each attribute has one row a point.
    pub(super) fn set(
        &self,
        cx: &Cx,
        particles: &mut Component,
        surface: &MarkedSurface,
        without: usize,
        tracers: &[u32],
    ) -> Result<()> {
        let markers = surface.markers();
        for column in self.all.iter().filter(|column| cx.wants_named(&column.name)) {
            let (width, absent) = (column.width, column.absent());
            let mut rows = Vec::with_capacity(width * particles.point_count());
            match column.first {
                Some(first) => {
                    let lists = &markers.attributes[first..first + width];
                    rows.extend((0..markers.ids.len()).flat_map(|n| lists.iter().map(move |list| list[n])));
                }
                None => rows.extend(absent.repeat(markers.ids.len())),
            }
            rows.extend(absent.repeat(without));
            for number in tracers {
                let at = *number as usize * width;
                rows.extend(column.tracers.get(at..at + width).unwrap_or(absent));
            }
            particles.set_column(Owner::Point, column.name.as_str(), rows_of(width, rows))?;
        }
        Ok(())
    }
}

/// The attributes of a mesh at the points of its surface.
pub(super) struct MeshAttributes {
    tree: TriangleTree,
    corners: Vec<[u32; 3]>,
    /// Which lists of a marker, and the rows of the points.
    columns: Vec<(Range<usize>, Vec<f32>)>,
}

impl MeshAttributes {
    /// Sets the lists of a marker to what the mesh has at the closest point, a place in the cells of the mesh.
    pub(super) fn write(&self, place: [f32; 3], row: &mut [f32]) {
        let Some(closest) = self.tree.closest(place, f32::MAX) else { return };
        let corners = self.corners[closest.triangle as usize];
        for (lists, rows) in &self.columns {
            let Some(out) = row.get_mut(lists.clone()) else { continue };
            for (n, out) in out.iter_mut().enumerate() {
                let value = |corner: usize| rows[corners[corner] as usize * lists.len() + n];
                *out = (0..3).fold(0.0, |sum, corner| sum + closest.weights[corner] * value(corner));
            }
        }
    }
}
