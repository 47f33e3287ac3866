//! The prim and attribute of each array of a geometry, for both file formats.
//!
//! | attribute of a component | in USD |
//! |---|---|
//! | `P`, `v`, `N` per point | `points`, `velocities` (m/s), `normals` |
//! | `width` per point | `widths` on curves and points; curves without it get [`DEFAULT_WIDTH`] |
//! | `id` per point | `ids` (int64) on points |
//! | `id` of curves | `primvars:curve_id`: curves have no `ids`, and Blender drops a primvar called `id` there |
//! | `Cd` of three floats | `primvars:displayColor`, a `color3f[]`, which viewers show |
//! | `uvw` per point | `primvars:uvw`, and its first two floats as `primvars:st`, a `texCoord2f[]`, which renderers look for |
//! | any other NAME | `primvars:NAME`; `vertex` per point, `uniform` per element, `constant` once |
//! | topology | counts and indices; for tets also their surface |
//!
//! Types are chosen for the programs that read them. `uvw` is a plain `float3[]`, because Blender reduces
//! `texCoord3f[]` to two components on curves and ignores it on meshes. `orient` is a `quatf[]`: Blender and Houdini
//! read it, and USD interpolates it as a rotation. Any other four floats are a `color4f[]`, which Blender reads, while
//! it warns about `float4[]`. `Pref` is a `point3f[]`.

use engine::geometry::{
    Column, ColumnType, Component, ID, Kind, N, Name, ORIENT, Owner, P, PREF, Topology, UVW, V, WIDTH,
};

use super::extent::{EMPTY, extent};
use super::stage::{Interpolation, UsdType};
use super::surface::surface;

/// Width of curves that have none, metres. USD has no default, and readers take 1 m.
pub const DEFAULT_WIDTH: f32 = 0.001;

/// Colour, three floats.
const CD: &str = "Cd";

/// The primvar in which renderers look for texture coordinates.
const TEX_COORDS: &str = "st";

/// Whether a primvar of this name is read as an attribute of another: as `uvw`, `Cd` or `N`.
pub(super) fn means_another(primvar: &str) -> bool {
    [TEX_COORDS, "displayColor", "normals"].contains(&primvar)
}

/// The source of an attribute's values. The order of the variants is that in files.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Source {
    /// Counts or indices.
    Topology(TopologyArray),
    /// The box around the points.
    Extent,
    /// The first two floats of `uvw` per point. It comes before attributes, so that its name is not taken.
    TexCoords,
    /// An attribute of the geometry.
    Attribute(Owner, Name),
    /// [`DEFAULT_WIDTH`], if no frame has widths.
    DefaultWidth,
}

/// Arrays of topology.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum TopologyArray {
    CurveCounts,
    FaceCounts,
    FaceIndices,
    TetIndices,
    SurfaceIndices,
}

/// The name that an attribute should get.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum TargetName<'a> {
    /// A name of the schema, used as it is.
    Schema(&'static str),
    /// The name of a primvar without the prefix, to be made a unique identifier; `own` is the name of the attribute.
    Primvar { name: &'a str, own: &'a str },
}

/// How a source is declared in USD.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Declaration<'a> {
    pub(super) target: TargetName<'a>,
    pub(super) kind: UsdType,
    pub(super) interpolation: Option<Interpolation>,
}

/// Prim schema and its uniform tokens for a component.
pub(super) fn prim(kind: Kind) -> (&'static str, &'static [(&'static str, &'static str)]) {
    match kind {
        Kind::Curves => ("BasisCurves", &[("type", "linear"), ("wrap", "nonperiodic")]),
        // Otherwise readers subdivide the mesh and drop its normals.
        Kind::Mesh => ("Mesh", &[("subdivisionScheme", "none")]),
        Kind::Points => ("Points", &[]),
        Kind::Tets => ("TetMesh", &[]),
        // Refused by the recorder.
        Kind::Volume => ("Volume", &[]),
    }
}

/// How `source` of a component of kind `kind`, with rows of type `rows`, is declared.
pub(super) fn declare(kind: Kind, source: &Source, rows: ColumnType) -> Declaration<'_> {
    let schema = |name, kind| Declaration { target: TargetName::Schema(name), kind, interpolation: None };
    let (owner, name) = match source {
        Source::Topology(TopologyArray::CurveCounts) => return schema("curveVertexCounts", UsdType::Int),
        Source::Topology(TopologyArray::FaceCounts) => return schema("faceVertexCounts", UsdType::Int),
        Source::Topology(TopologyArray::FaceIndices) => return schema("faceVertexIndices", UsdType::Int),
        Source::Topology(TopologyArray::TetIndices) => return schema("tetVertexIndices", UsdType::Int4),
        Source::Topology(TopologyArray::SurfaceIndices) => return schema("surfaceFaceVertexIndices", UsdType::Int3),
        Source::Extent => return schema("extent", UsdType::Float3),
        Source::DefaultWidth => {
            let interpolation = Some(Interpolation::Constant);
            return Declaration { interpolation, ..schema("widths", UsdType::Float) };
        }
        Source::TexCoords => {
            let target = TargetName::Primvar { name: TEX_COORDS, own: TEX_COORDS };
            return Declaration { target, kind: UsdType::TexCoord2, interpolation: Some(Interpolation::Vertex) };
        }
        Source::Attribute(owner, name) => (*owner, &**name),
    };
    let interpolation = Some(match owner {
        Owner::Point => Interpolation::Vertex,
        Owner::Element => Interpolation::Uniform,
        Owner::Once => Interpolation::Constant,
    });
    if owner == Owner::Point {
        match kind {
            _ if name == P.name => return schema("points", UsdType::Point3),
            _ if name == V.name => return schema("velocities", UsdType::Vector3),
            _ if name == N.name => {
                return Declaration { interpolation, ..schema("normals", UsdType::Normal3) };
            }
            Kind::Curves | Kind::Points if name == WIDTH.name => {
                return Declaration { interpolation, ..schema("widths", UsdType::Float) };
            }
            Kind::Points if name == ID.name => return schema("ids", UsdType::Int64),
            _ => {}
        }
    }
    let named = match name {
        CD if rows == ColumnType::F3 => "displayColor",
        name if kind == Kind::Curves && name == ID.name => "curve_id",
        name => name,
    };
    let target = TargetName::Primvar { name: named, own: name };
    Declaration { target, kind: primvar_type(name, rows), interpolation }
}

fn primvar_type(name: &str, rows: ColumnType) -> UsdType {
    match rows {
        ColumnType::F1 => UsdType::Float,
        ColumnType::F3 if name == P.name || name == PREF.name => UsdType::Point3,
        ColumnType::F3 if name == V.name => UsdType::Vector3,
        ColumnType::F3 if name == N.name => UsdType::Normal3,
        ColumnType::F3 if name == CD => UsdType::Color3,
        ColumnType::F3 => UsdType::Float3,
        ColumnType::F4 if name == ORIENT.name => UsdType::Quat,
        ColumnType::F4 => UsdType::Color4,
        ColumnType::I1 => UsdType::Int,
        ColumnType::I3 => UsdType::Int3,
        ColumnType::I4 => UsdType::Int4,
    }
}

/// Whether `source` is one of points and velocities, which must have the same sample times: otherwise USD does not move
/// points along velocities.
pub(super) fn is_motion(source: &Source) -> bool {
    matches!(source, Source::Attribute(Owner::Point, name) if **name == *P.name || **name == *V.name)
}

/// The value of `source` in a frame that does not have it, where the component has `points` points, or does not exist
/// (`None`). Without the component it has no rows, or an inverted box; widths of curves have a default. `None` if it
/// has no value then: an attribute of a component without it, and one of a whole component, which always has a row.
pub(super) fn absent(kind: Kind, source: &Source, rows: ColumnType, points: Option<u32>) -> Option<Column> {
    match (source, points) {
        (Source::Attribute(Owner::Point, name), Some(points)) if kind == Kind::Curves && **name == *WIDTH.name => {
            Some(Column::new(vec![DEFAULT_WIDTH; points as usize]))
        }
        (Source::Attribute(Owner::Once, _) | Source::DefaultWidth, _) | (_, Some(_)) => None,
        (Source::Extent, None) => Some(Column::new(EMPTY.to_vec())),
        (Source::Topology(_) | Source::Attribute(..) | Source::TexCoords, None) => Some(Column::zeros(rows, 0)),
    }
}

/// Arrays derived from a component, cached as long as their source is shared.
#[derive(Debug, Default)]
pub(super) struct Derived {
    topology: Option<(Topology, Vec<(Source, Column)>)>,
    extent: Option<(Column, Option<Column>, Column)>,
}

impl Derived {
    /// All arrays to write for `component`.
    pub(super) fn arrays(&mut self, component: &Component) -> Vec<(Source, Column)> {
        let mut arrays = self.topology(component.topology()).to_vec();
        arrays.push((Source::Extent, self.extent(component)));
        let owned = component.columns().map(|(owner, name, column)| (attribute(owner, name), column.clone()));
        arrays.extend(owned);
        let coordinates = component.table(Owner::Point).column(UVW.name);
        arrays.extend(coordinates.map(|column| (Source::TexCoords, column.clone())));
        arrays
    }

    fn topology(&mut self, topology: &Topology) -> &[(Source, Column)] {
        if self.topology.as_ref().is_some_and(|(known, _)| !known.same(topology)) {
            self.topology = None;
        }
        let (_, arrays) = self.topology.get_or_insert_with(|| (topology.clone(), topology_arrays(topology)));
        arrays
    }

    fn extent(&mut self, component: &Component) -> Column {
        let points = component.table(Owner::Point);
        let widths = points.column(WIDTH.name);
        let Some(positions) = points.column(P.name) else { return Column::new(EMPTY.to_vec()) };
        if let Some((known, known_widths, extent)) = &self.extent
            && known.same(positions)
            && match (known_widths, widths) {
                (Some(known), Some(widths)) => known.same(widths),
                (known, widths) => known.is_none() && widths.is_none(),
            }
        {
            return extent.clone();
        }
        let default = (component.kind() == Kind::Curves).then_some(&[DEFAULT_WIDTH][..]);
        let bounds = extent(component.kind(), component.positions(), component.get(WIDTH).or(default));
        let column = Column::new(bounds.to_vec());
        self.extent = Some((positions.clone(), widths.cloned(), column.clone()));
        column
    }
}

fn attribute(owner: Owner, name: &Name) -> Source {
    Source::Attribute(owner, name.clone())
}

fn topology_arrays(topology: &Topology) -> Vec<(Source, Column)> {
    // Below 2³¹, as the recorder has checked.
    let ints = |numbers: &mut dyn Iterator<Item = u32>| Column::new(numbers.map(u32::cast_signed).collect());
    let arrays = match topology {
        Topology::Curves(runs) => vec![(TopologyArray::CurveCounts, ints(&mut runs.counts()))],
        Topology::Mesh(faces) => vec![
            (TopologyArray::FaceCounts, ints(&mut faces.runs.counts())),
            (TopologyArray::FaceIndices, ints(&mut faces.corners.iter().copied())),
        ],
        Topology::Points => vec![],
        Topology::Tets(tets) => vec![
            (TopologyArray::TetIndices, Column::new(tets.iter().map(|tet| tet.map(u32::cast_signed)).collect())),
            (
                TopologyArray::SurfaceIndices,
                Column::new(surface(tets).into_iter().map(|face| face.map(u32::cast_signed)).collect()),
            ),
        ],
    };
    arrays.into_iter().map(|(array, column)| (Source::Topology(array), column)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn declared(kind: Kind, owner: Owner, name: &str, rows: ColumnType) -> String {
        let source = attribute(owner, &name.into());
        let Declaration { target, kind, interpolation } = declare(kind, &source, rows);
        let name = match target {
            TargetName::Schema(name) => name.to_owned(),
            TargetName::Primvar { name, .. } => format!("primvars:{name}"),
        };
        format!("{} {name} {}", kind.name(), interpolation.map_or("-", Interpolation::token))
    }

    #[test]
    fn a_schema_has_its_own_names() {
        use ColumnType::{F1, F3, I1};
        for (kind, name, rows, expected) in [
            (Kind::Curves, "P", F3, "point3f[] points -"),
            (Kind::Tets, "v", F3, "vector3f[] velocities -"),
            (Kind::Mesh, "N", F3, "normal3f[] normals vertex"),
            (Kind::Curves, "width", F1, "float[] widths vertex"),
            (Kind::Points, "width", F1, "float[] widths vertex"),
            (Kind::Mesh, "width", F1, "float[] primvars:width vertex"),
            (Kind::Points, "id", I1, "int64[] ids -"),
            (Kind::Curves, "id", I1, "int[] primvars:curve_id vertex"),
            (Kind::Mesh, "id", I1, "int[] primvars:id vertex"),
        ] {
            assert_eq!(declared(kind, Owner::Point, name, rows), expected);
        }
    }

    #[test]
    fn other_attributes_are_primvars_with_the_interpolation_of_their_owner() {
        use ColumnType::{F1, F3, F4, I1, I3, I4};
        for (owner, name, rows, expected) in [
            (Owner::Element, "shielded", F1, "float[] primvars:shielded uniform"),
            (Owner::Once, "mass", F1, "float[] primvars:mass constant"),
            (Owner::Element, "id", I1, "int[] primvars:curve_id uniform"),
            (Owner::Element, "N", F3, "normal3f[] primvars:N uniform"),
            (Owner::Once, "width", F1, "float[] primvars:width constant"),
            (Owner::Point, "uvw", F3, "float3[] primvars:uvw vertex"),
            (Owner::Point, "Pref", F3, "point3f[] primvars:Pref vertex"),
            (Owner::Point, "orient", F4, "quatf[] primvars:orient vertex"),
            (Owner::Point, "Cd", F3, "color3f[] primvars:displayColor vertex"),
            (Owner::Element, "Cd", F3, "color3f[] primvars:displayColor uniform"),
            (Owner::Point, "Cd", F4, "color4f[] primvars:Cd vertex"),
            (Owner::Point, "tint", F4, "color4f[] primvars:tint vertex"),
            (Owner::Point, "face", I3, "int3[] primvars:face vertex"),
            (Owner::Point, "tet", I4, "int4[] primvars:tet vertex"),
        ] {
            assert_eq!(declared(Kind::Curves, owner, name, rows), expected);
        }
    }

    #[test]
    fn derived_arrays_are_cached_while_their_sources_are_shared() {
        let first = Component::curves(vec![2, 1], vec![[0.0; 3]; 3]).unwrap();
        let mut moved = first.clone();
        moved.edit(P).unwrap()[2] = [1.0, 2.0, 3.0];
        let mut derived = Derived::default();
        let mut find = |component: &Component, wanted: Source| {
            let arrays = derived.arrays(component);
            arrays.into_iter().find(|(source, _)| *source == wanted).unwrap().1
        };
        let counts = || Source::Topology(TopologyArray::CurveCounts);
        let first_counts = find(&first, counts());
        assert_eq!(first_counts, Column::new(vec![2, 1]));
        let box_of_first = find(&first, Source::Extent);
        assert!(find(&first, Source::Extent).same(&box_of_first));
        assert!(find(&moved, counts()).same(&first_counts));
        assert_eq!(find(&moved, Source::Extent), Column::new(vec![[-5e-4; 3], [1.0005, 2.0005, 3.0005]]));
    }
}
