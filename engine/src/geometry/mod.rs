//! Geometry: the data that flows along a graph's wires.
//!
//! Five optional components. All arrays are shared copy-on-write: a node that changes positions shares everything else
//! with its input, which tests check by comparing addresses. Positions are metres relative to the scene's origin, Y up,
//! right-handed.

mod attribute;
mod bytes;
mod column;
mod component;
mod derived;
mod kept;
mod lengths;
mod neutral;
mod topology;
mod triangles;
mod volume;

use std::sync::Arc;

pub use attribute::{
    Attr, CURVE_ID, ENVELOPE, ID, N, ORIENT, Owner, P, PREF, SHIELDED, THICKNESS, UVW, V, WIDTH, fixed_type,
};
pub(crate) use bytes::Reader;
pub use column::{Column, ColumnType, Item, Name, Table};
pub use component::Component;
pub use numerics::sparse_field::{BLOCK_EDGE, FieldCursor, SparseField, SparseFieldError, dense_len};
pub use topology::{Faces, Runs, Topology};
pub use triangles::Triangles;
pub use volume::{Grid, VOLUME_FIELDS, Volume, VolumeSampler};

/// The kind of a component.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Kind {
    /// Polylines.
    Curves,
    /// Polygons.
    Mesh,
    /// Unconnected points.
    Points,
    /// Tets.
    Tets,
    /// Level set and velocity on a grid.
    Volume,
}

impl Kind {
    /// All kinds, in the order files list them.
    pub const ALL: [Self; 5] = [Self::Curves, Self::Mesh, Self::Points, Self::Tets, Self::Volume];

    /// The name in files and messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Curves => "curves",
            Self::Mesh => "mesh",
            Self::Points => "points",
            Self::Tets => "tets",
            Self::Volume => "volume",
        }
    }

    /// The name with its article, for sentences.
    pub fn phrase(self) -> &'static str {
        match self {
            Self::Mesh => "a mesh",
            Self::Volume => "a volume",
            Self::Curves | Self::Points | Self::Tets => self.name(),
        }
    }

    /// An attribute of a component of this kind in words: `one float for each curve`, `one int3 for all`.
    pub fn rows_text(self, owner: Owner, rows: ColumnType) -> String {
        let row = match (owner, self) {
            (Owner::Once, _) => return format!("one {rows} for all"),
            (Owner::Point, Self::Curves) => "CV",
            (Owner::Point, Self::Mesh) => "vertex",
            (Owner::Point, Self::Points | Self::Tets | Self::Volume) => "point",
            (Owner::Element, Self::Curves) => "curve",
            (Owner::Element, Self::Mesh) => "face",
            (Owner::Element, Self::Tets) => "tet",
            (Owner::Element, Self::Points | Self::Volume) => "element",
        };
        format!("one {rows} for each {row}")
    }
}

impl std::fmt::Display for Kind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

/// Up to one component of each kind. A clone shares everything.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Geometry {
    parts: [Option<Arc<Component>>; 4],
    volume: Option<Arc<Volume>>,
}

impl Geometry {
    /// The component of that kind; `None` if it is absent, and for [`Kind::Volume`] (see [`Geometry::volume`]).
    pub fn part(&self, kind: Kind) -> Option<&Component> {
        self.parts.get(kind as usize)?.as_deref()
    }

    /// The component of that kind, which must be present.
    ///
    /// # Errors
    /// If it is absent. The engine refuses such a wire before it calls the node, so the node may just return the error.
    pub fn require(&self, kind: Kind) -> crate::Result<&Component> {
        self.part(kind)
            .ok_or_else(|| crate::Error::contract(format!("the input needs {kind}, but the geometry has none")))
    }

    /// The component of that kind for writing; tables that are shared are copied when they are written.
    pub fn part_mut(&mut self, kind: Kind) -> Option<&mut Component> {
        self.parts.get_mut(kind as usize)?.as_mut().map(Arc::make_mut)
    }

    /// The curves.
    pub fn curves(&self) -> Option<&Component> {
        self.part(Kind::Curves)
    }

    /// The mesh.
    pub fn mesh(&self) -> Option<&Component> {
        self.part(Kind::Mesh)
    }

    /// The points.
    pub fn points(&self) -> Option<&Component> {
        self.part(Kind::Points)
    }

    /// The tets.
    pub fn tets(&self) -> Option<&Component> {
        self.part(Kind::Tets)
    }

    /// The volume.
    pub fn volume(&self) -> Option<&Volume> {
        self.volume.as_deref()
    }

    /// Sets a component, replacing one of the same kind.
    pub fn put(&mut self, component: impl Into<Arc<Component>>) {
        let component = component.into();
        let index = component.kind() as usize;
        self.parts[index] = Some(component);
    }

    /// Sets the volume, replacing the previous one.
    pub fn put_volume(&mut self, volume: impl Into<Arc<Volume>>) {
        self.volume = Some(volume.into());
    }

    /// This geometry with the component set.
    #[must_use]
    pub fn with(mut self, component: impl Into<Arc<Component>>) -> Self {
        self.put(component);
        self
    }

    /// Removes a component.
    pub fn remove(&mut self, kind: Kind) {
        match self.parts.get_mut(kind as usize) {
            Some(part) => *part = None,
            None => self.volume = None,
        }
    }

    /// The components that are present, without the volume.
    pub fn parts(&self) -> impl Iterator<Item = &Component> {
        self.parts.iter().filter_map(|part| part.as_deref())
    }

    /// The kinds that are present, the volume included.
    pub fn kinds(&self) -> impl Iterator<Item = Kind> + '_ {
        Kind::ALL.into_iter().filter(|kind| match kind {
            Kind::Volume => self.volume.is_some(),
            _ => self.part(*kind).is_some(),
        })
    }

    /// Each array with its address and bytes; arrays that several geometries share have one address.
    pub fn arrays(&self) -> Vec<(usize, usize)> {
        let mut arrays = Vec::new();
        for part in self.parts() {
            arrays.push((part.topology().address(), part.topology().bytes()));
            arrays.extend(part.columns().map(|(_, _, column)| (column.address(), column.bytes())));
        }
        if let Some(volume) = self.volume() {
            arrays.extend(volume.fields().into_iter().flat_map(|(_, field)| field.arrays()));
        }
        arrays
    }

    /// Bytes of all arrays, shared ones included.
    pub fn bytes(&self) -> usize {
        self.arrays().iter().map(|(_, bytes)| bytes).sum()
    }
}

impl From<Component> for Geometry {
    fn from(component: Component) -> Self {
        Self::default().with(component)
    }
}

/// Why a geometry is invalid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GeometryError {
    /// A column of another length than its table.
    #[error("`{name}` has {rows} row{s}, expected {expected}", s = if *rows == 1 { "" } else { "s" })]
    Rows {
        /// Attribute.
        name: Name,
        /// Rows it has.
        rows: usize,
        /// Rows it should have.
        expected: usize,
    },
    /// A well-known attribute of the wrong type.
    #[error("`{name}` is {found}, expected {expected}")]
    Type {
        /// Attribute.
        name: Name,
        /// Type it has.
        found: ColumnType,
        /// Type it should have.
        expected: ColumnType,
    },
    /// A curve without a CV.
    #[error("curve {curve} has no CV, expected at least 1")]
    EmptyCurve {
        /// Which curve, from 0.
        curve: usize,
    },
    /// A face with fewer than three corners.
    #[error("face {face} has {corners} corners, expected at least 3")]
    SmallFace {
        /// Which face, from 0.
        face: usize,
        /// Corners it has.
        corners: u32,
    },
    /// CV counts that do not add up.
    #[error("the counts add up to {sum} CVs, but there are {points} points")]
    Counts {
        /// Sum of the counts.
        sum: usize,
        /// Points there are.
        points: usize,
    },
    /// Face sizes that do not add up.
    #[error("the counts add up to {sum} corners, but there are {corners} indices")]
    Corners {
        /// Sum of the counts.
        sum: usize,
        /// Indices there are.
        corners: usize,
    },
    /// An index beyond the points.
    #[error("index {index} (corner {corner}) is out of range: there are {points} points, counted from 0")]
    Index {
        /// Which corner, from 0.
        corner: usize,
        /// The index.
        index: u32,
        /// Points there are.
        points: usize,
    },
    /// 2³² rows or more.
    #[error("more than 4,294,967,295 rows")]
    TooMany,
    /// Two components that cannot be joined.
    #[error("{a} and {b} cannot be joined into one component")]
    Kinds {
        /// The first.
        a: Kind,
        /// The second.
        b: Kind,
    },
    /// Tables that do not fit a topology.
    #[error("the tables' rows do not fit the topology")]
    Tables,
    /// A grid with an invalid cell size or origin.
    #[error("the grid has cells of {cell:?} m and origin {origin:?}, expected finite numbers and a cell size above 0")]
    Grid {
        /// Lowest corner.
        origin: [f32; 3],
        /// Edge of a cell.
        cell: f32,
    },
    /// A field of a volume that cannot be built.
    #[error("`{name}`: {error}")]
    Field {
        /// Which field.
        name: &'static str,
        /// Why.
        error: SparseFieldError,
    },
    /// A field of a volume that does not fit its grid.
    #[error("`{name}` has {size:?} numbers along x, y and z, expected {expected:?}")]
    FieldSize {
        /// Which field.
        name: &'static str,
        /// Nodes it has along each axis.
        size: [u32; 3],
        /// Nodes its grid has.
        expected: [u32; 3],
    },
    /// A level set whose background is not outside, or a velocity whose background is not zero.
    #[error("the background of `{name}` is {background:?}, expected {}", if *name == VOLUME_FIELDS[0] { "a distance above 0" } else { "0" })]
    Background {
        /// Which field.
        name: &'static str,
        /// Its value where nothing is stored.
        background: f32,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve() -> Geometry {
        Component::curves(vec![2], vec![[0.0; 3], [0.0, 1.0, 0.0]]).unwrap().into()
    }

    #[test]
    fn writing_positions_shares_everything_else() {
        let mut a = curve();
        a.part_mut(Kind::Curves).unwrap().set(ENVELOPE, vec![1.0, 0.5]).unwrap();
        let mut b = a.clone();
        b.part_mut(Kind::Curves).unwrap().edit(P).unwrap()[1] = [1.0, 0.0, 0.0];
        let (a, b) = (a.curves().unwrap(), b.curves().unwrap());
        assert_eq!(a.positions()[1], [0.0, 1.0, 0.0]);
        assert_eq!(b.positions()[1], [1.0, 0.0, 0.0]);
        assert!(a.topology().same(b.topology()));
        let column = |c: &Component| c.table(Owner::Point).column("envelope").unwrap().address();
        assert_eq!(column(a), column(b));
    }

    #[test]
    fn invalid_topology_is_refused_with_its_index() {
        let text = |e: GeometryError| e.to_string();
        assert_eq!(
            text(Component::curves(vec![2, 0], vec![[0.0; 3]; 2]).unwrap_err()),
            "curve 1 has no CV, expected at least 1"
        );
        assert_eq!(
            text(Component::curves(vec![3], vec![[0.0; 3]; 2]).unwrap_err()),
            "the counts add up to 3 CVs, but there are 2 points"
        );
        assert_eq!(
            text(Component::mesh(vec![3], vec![0, 1, 2], vec![[0.0; 3]; 2]).unwrap_err()),
            "index 2 (corner 2) is out of range: there are 2 points, counted from 0"
        );
        assert_eq!(
            text(Component::mesh(vec![2], vec![0, 1], vec![[0.0; 3]; 2]).unwrap_err()),
            "face 0 has 2 corners, expected at least 3"
        );
    }

    #[test]
    fn a_well_known_name_must_have_its_type() {
        let mut c = curve();
        let error =
            c.part_mut(Kind::Curves).unwrap().set_column(Owner::Point, "N", Column::new(vec![1.0_f32; 2])).unwrap_err();
        assert_eq!(error.to_string(), "`N` is float, expected float3");
    }

    #[test]
    fn joined_meshes_keep_their_faces() {
        let tri = |x: f32| {
            Component::mesh(vec![3], vec![0, 1, 2], vec![[x, 0.0, 0.0], [x + 1.0, 0.0, 0.0], [x, 1.0, 0.0]]).unwrap()
        };
        let both = tri(0.0).concat(&tri(5.0)).unwrap();
        assert_eq!(both.faces().unwrap().face(1), [3, 4, 5]);
        assert_eq!(both.positions()[3], [5.0, 0.0, 0.0]);
    }
}
