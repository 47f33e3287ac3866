//! A component: points, their topology and their attributes.

use std::sync::Arc;

use super::attribute::{Attr, Owner, P, fixed_type};
use super::column::{Column, Item, Name, Table};
use super::derived::Derived;
use super::topology::{Faces, Runs, Topology};
use super::{GeometryError, Kind};

/// Curves, a mesh, points or tets: a topology and three tables. Every component has positions `P`, one row per point.
#[derive(Clone, Debug, PartialEq)]
pub struct Component {
    topology: Topology,
    points: Table,
    elements: Table,
    once: Table,
    derived: Derived,
}

impl Component {
    /// Polylines with `counts` CVs each; `positions` from root to tip, curve by curve.
    ///
    /// # Errors
    /// If the counts do not add up to the positions, or a curve has no CV.
    pub fn curves(counts: Vec<u32>, positions: Vec<[f32; 3]>) -> Result<Self, GeometryError> {
        if let Some(curve) = counts.iter().position(|count| *count == 0) {
            return Err(GeometryError::EmptyCurve { curve });
        }
        let runs = Runs::from_counts(counts)?;
        if runs.total() != positions.len() {
            return Err(GeometryError::Counts { sum: runs.total(), points: positions.len() });
        }
        Ok(Self::with(Topology::Curves(Arc::new(runs)), positions))
    }

    /// Polygons with `counts` corners each; `corners` are rows of `positions`, counter-clockwise from outside.
    ///
    /// # Errors
    /// If the counts do not add up to the corners, a face has fewer than 3, or a corner is out of range.
    pub fn mesh(counts: Vec<u32>, corners: Vec<u32>, positions: Vec<[f32; 3]>) -> Result<Self, GeometryError> {
        if let Some(face) = counts.iter().position(|count| *count < 3) {
            return Err(GeometryError::SmallFace { face, corners: counts[face] });
        }
        let runs = Runs::from_counts(counts)?;
        if runs.total() != corners.len() {
            return Err(GeometryError::Corners { sum: runs.total(), corners: corners.len() });
        }
        check_indices(&corners, positions.len())?;
        Ok(Self::with(Topology::Mesh(Arc::new(Faces { runs, corners })), positions))
    }

    /// Unconnected points.
    pub fn points(positions: Vec<[f32; 3]>) -> Self {
        Self::with(Topology::Points, positions)
    }

    /// Tets of four rows of `positions` each.
    ///
    /// # Errors
    /// If an index is out of range.
    pub fn tets(tets: Vec<[u32; 4]>, positions: Vec<[f32; 3]>) -> Result<Self, GeometryError> {
        check_indices(tets.as_flattened(), positions.len())?;
        Ok(Self::with(Topology::Tets(Arc::new(tets)), positions))
    }

    fn with(topology: Topology, positions: Vec<[f32; 3]>) -> Self {
        let elements = Table::new(topology.elements());
        let mut points = Table::new(positions.len());
        points.set(P.name, Column::new(positions)).expect("the table was made with this many rows");
        Self { topology, points, elements, once: Table::new(1), derived: Derived::default() }
    }

    /// A component of a topology and its tables, as read from a cache.
    ///
    /// # Errors
    /// If the tables' rows do not fit the topology, or the points lack `P`.
    pub fn from_tables(topology: Topology, tables: [Table; 3]) -> Result<Self, GeometryError> {
        let [points, elements, once] = tables;
        let rows = points.rows();
        let fits = match &topology {
            Topology::Curves(runs) => runs.total() == rows,
            Topology::Mesh(faces) => faces.corners.iter().all(|corner| (*corner as usize) < rows),
            Topology::Points => true,
            Topology::Tets(tets) => tets.as_flattened().iter().all(|corner| (*corner as usize) < rows),
        };
        if !fits
            || elements.rows() != topology.elements()
            || once.rows() != 1
            || points.get::<[f32; 3]>(P.name).is_none()
        {
            return Err(GeometryError::Tables);
        }
        Ok(Self { topology, points, elements, once, derived: Derived::default() })
    }

    /// Which component this is.
    pub fn kind(&self) -> Kind {
        match self.topology {
            Topology::Curves(_) => Kind::Curves,
            Topology::Mesh(_) => Kind::Mesh,
            Topology::Points => Kind::Points,
            Topology::Tets(_) => Kind::Tets,
        }
    }

    /// The topology.
    pub fn topology(&self) -> &Topology {
        &self.topology
    }

    /// CVs of each curve; empty for other components.
    pub fn runs(&self) -> &Runs {
        static NONE: std::sync::LazyLock<Runs> = std::sync::LazyLock::new(|| Runs::from_counts([]).expect("no rows"));
        match &self.topology {
            Topology::Curves(runs) => runs,
            _ => &NONE,
        }
    }

    /// Faces of a mesh; `None` for other components.
    pub fn faces(&self) -> Option<&Faces> {
        match &self.topology {
            Topology::Mesh(faces) => Some(faces),
            _ => None,
        }
    }

    /// Corners of each tet; empty for other components.
    pub fn tet_corners(&self) -> &[[u32; 4]] {
        match &self.topology {
            Topology::Tets(tets) => tets,
            _ => &[],
        }
    }

    /// Number of points.
    pub fn point_count(&self) -> usize {
        self.points.rows()
    }

    /// Number of curves, faces or tets.
    pub fn element_count(&self) -> usize {
        self.elements.rows()
    }

    /// Positions, metres, one row per point.
    pub fn positions(&self) -> &[[f32; 3]] {
        self.points.get(P.name).expect("constructors add `P` and `remove` keeps it")
    }

    /// The table of `owner`.
    pub fn table(&self, owner: Owner) -> &Table {
        match owner {
            Owner::Point => &self.points,
            Owner::Element => &self.elements,
            Owner::Once => &self.once,
        }
    }

    fn table_mut(&mut self, owner: Owner) -> &mut Table {
        match owner {
            Owner::Point => &mut self.points,
            Owner::Element => &mut self.elements,
            Owner::Once => &mut self.once,
        }
    }

    /// The type and owner of an attribute in words: `one float for each curve`.
    pub fn describe(&self, name: &str) -> Option<String> {
        let found = self.columns().find(|(_, column, _)| ***column == *name);
        found.map(|(owner, _, column)| self.kind().rows_text(owner, column.kind()))
    }

    /// The rows of an attribute; `None` if it is absent or has another type.
    pub fn get<T: Item>(&self, attr: Attr<T>) -> Option<&[T]> {
        self.table(attr.owner).get(attr.name)
    }

    /// Replaces an attribute's rows, or adds it.
    ///
    /// # Errors
    /// If the number of rows is not the owner's.
    pub fn set<T: Item>(&mut self, attr: Attr<T>, rows: Vec<T>) -> Result<(), GeometryError> {
        self.set_column(attr.owner, attr.name, Column::new(rows))
    }

    /// Replaces a column, or adds it.
    ///
    /// # Errors
    /// If the number of rows is not the owner's, or a well-known name gets another type than its own.
    pub fn set_column(&mut self, owner: Owner, name: impl Into<Name>, column: Column) -> Result<(), GeometryError> {
        let name = name.into();
        if let Some(expected) = fixed_type(&name).filter(|expected| *expected != column.kind()) {
            return Err(GeometryError::Type { name, found: column.kind(), expected });
        }
        self.forget_derived(owner, &name);
        self.table_mut(owner).set(name, column)
    }

    /// An attribute's rows for writing; copied first if shared.
    pub fn edit<T: Item>(&mut self, attr: Attr<T>) -> Option<&mut [T]> {
        self.forget_derived(attr.owner, attr.name);
        self.table_mut(attr.owner).edit(attr.name)
    }

    /// A value computed from topology and positions and cached with them: the tree of a static mesh is built once for
    /// all frames and nodes. Two threads that call this at the same time may both compute it.
    pub fn derived<T: Send + Sync + 'static>(&self, compute: impl FnOnce(&Self) -> T) -> Arc<T> {
        self.derived.get_or(|| compute(self))
    }

    /// Takes topology and arrays that `other` has with the same bits from there, with what is derived of them: what is
    /// known by address, such as trees, is then known for both.
    pub fn share_with(&mut self, other: &Self) {
        if !self.topology.same(&other.topology) && self.topology == other.topology {
            self.topology = other.topology.clone();
        }
        for owner in Owner::ALL {
            self.table_mut(owner).share_with(other.table(owner));
        }
        let positions = |of: &Self| of.points.column(P.name).map(Column::address);
        if self.topology.same(&other.topology) && positions(self) == positions(other) {
            self.derived = other.derived.clone();
        }
    }

    /// Clears derived values, because positions are about to change.
    fn forget_derived(&mut self, owner: Owner, name: &str) {
        if owner == P.owner && name == P.name {
            self.derived = Derived::default();
        }
    }

    /// Removes an attribute; `P` cannot be removed.
    pub fn remove(&mut self, owner: Owner, name: &str) -> Option<Column> {
        if owner == Owner::Point && name == P.name {
            return None;
        }
        self.table_mut(owner).remove(name)
    }

    /// All attributes as owner, name and column; those of points first, sorted by name.
    pub fn columns(&self) -> impl Iterator<Item = (Owner, &Name, &Column)> {
        Owner::ALL
            .into_iter()
            .flat_map(|owner| self.table(owner).iter().map(move |(name, column)| (owner, name, column)))
    }

    /// The points and elements of both components, those of `self` first.
    ///
    /// # Errors
    /// If the kinds differ or there are too many rows.
    pub fn concat(&self, other: &Self) -> Result<Self, GeometryError> {
        let offset = u32::try_from(self.point_count()).map_err(|_| GeometryError::TooMany)?;
        let shift = |index: &u32| index.checked_add(offset).ok_or(GeometryError::TooMany);
        let topology = match (&self.topology, &other.topology) {
            (Topology::Curves(a), Topology::Curves(b)) => Topology::Curves(Arc::new(a.concat(b)?)),
            (Topology::Mesh(a), Topology::Mesh(b)) => {
                let mut corners = a.corners.clone();
                for corner in &b.corners {
                    corners.push(shift(corner)?);
                }
                Topology::Mesh(Arc::new(Faces { runs: a.runs.concat(&b.runs)?, corners }))
            }
            (Topology::Points, Topology::Points) => Topology::Points,
            (Topology::Tets(a), Topology::Tets(b)) => {
                let mut tets = a.to_vec();
                for [p, q, r, s] in b.iter() {
                    tets.push([shift(p)?, shift(q)?, shift(r)?, shift(s)?]);
                }
                Topology::Tets(Arc::new(tets))
            }
            _ => return Err(GeometryError::Kinds { a: self.kind(), b: other.kind() }),
        };
        // Attributes of the whole component: those of `self` take precedence.
        let mut once = self.once.clone();
        for (name, column) in other.once.iter().filter(|(name, _)| self.once.column(name).is_none()) {
            once.set(name.clone(), column.clone())?;
        }
        Ok(Self {
            topology,
            points: self.points.concat(&other.points),
            elements: self.elements.concat(&other.elements),
            once,
            derived: Derived::default(),
        })
    }

    /// The smallest and largest coordinates; `None` without points.
    pub fn bounds(&self) -> Option<[[f32; 3]; 2]> {
        let (first, rest) = self.positions().split_first()?;
        Some(rest.iter().fold([*first; 2], |[low, high], p| {
            [[0, 1, 2].map(|k| low[k].min(p[k])), [0, 1, 2].map(|k| high[k].max(p[k]))]
        }))
    }
}

fn check_indices(indices: &[u32], points: usize) -> Result<(), GeometryError> {
    match indices.iter().position(|index| *index as usize >= points) {
        Some(corner) => Err(GeometryError::Index { corner, index: indices[corner], points }),
        None => Ok(()),
    }
}
