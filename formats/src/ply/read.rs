//! PLY to geometry.

use engine::geometry::{Component, Geometry, GeometryError, Item, Kind, Name, Owner, P};

use super::attributes::{Columns, TRIPLES, columns};
use super::body::{Body, Cells, Keep};
use super::header::{self, Element, Property, Shape};
use super::{COMPONENT, chains};
use crate::{FilePosition, FormatError};

/// The geometry of a PLY file.
///
/// # Errors
/// With line or byte: if the header is invalid, the data ends early, an index is out of range, or a number is not
/// finite.
pub(crate) fn read(bytes: &[u8]) -> Result<Geometry, FormatError> {
    let header = header::read(bytes)?;
    let vertices = header.elements.iter().find(|element| element.name == "vertex").map_or(0, |element| element.rows);
    let mut body = Body::new(&header, bytes);
    let mut file = Elements::default();
    for element in &header.elements {
        file.take(element, vertices, &mut body)?;
    }
    file.geometry(vertices)
}

/// The contents of the elements.
#[derive(Default)]
struct Elements {
    points: Columns,
    /// The component of each vertex, if the file has it: the number of a [`Kind`].
    owners: Option<Vec<i32>>,
    face_counts: Vec<u32>,
    corners: Vec<u32>,
    faces: Columns,
    edges: Vec<[u32; 2]>,
    /// CVs of each curve, if the file has them.
    curve_counts: Option<Vec<u32>>,
    curves: Columns,
}

impl Elements {
    fn take(&mut self, element: &Element, vertices: usize, body: &mut Body) -> Result<(), FormatError> {
        let lacks = |property: &str| {
            let fact = format!("element `{}` has no property `{property}`", element.name);
            Err(FormatError::at(FilePosition::Line(element.line), fact))
        };
        let has = |name: &str| element.properties.iter().any(|property| property.name == name);
        let indices = Keep::Indices { rows: vertices };
        match element.name.as_str() {
            "vertex" => {
                let (_, [x, y, z]) = TRIPLES[0];
                if let Some(missing) = [x, y, z].into_iter().find(|name| element.rows > 0 && !has(name)) {
                    return lacks(missing);
                }
                let mut cells = body.element(element, |_| Keep::Values)?;
                if let Some(Cells::Wholes(owners)) =
                    take_cells(&mut cells, element, |property| property.name == COMPONENT)
                {
                    self.owners = Some(owners);
                }
                self.points = columns(&element.properties, cells);
            }
            "face" => {
                let is_corners = |property: &Property| {
                    matches!(property.shape, Shape::List { .. })
                        && matches!(property.name.as_str(), "vertex_indices" | "vertex_index")
                };
                if element.rows > 0 && !element.properties.iter().any(is_corners) {
                    return lacks("vertex_indices");
                }
                let keep = |property: &Property| if is_corners(property) { indices } else { Keep::Values };
                let mut cells = body.element(element, keep)?;
                let corners = take_cells(&mut cells, element, is_corners);
                if let Some(Cells::Indices { counts, items, .. }) = corners {
                    (self.face_counts, self.corners) = (counts, items);
                }
                self.faces = columns(&element.properties, cells);
            }
            "edge" => {
                if let Some(missing) = ["vertex1", "vertex2"].into_iter().find(|name| element.rows > 0 && !has(name)) {
                    return lacks(missing);
                }
                let is_end = |name: &str| name == "vertex1" || name == "vertex2";
                let keep = |property: &Property| if is_end(&property.name) { indices } else { Keep::Nothing };
                let mut cells = body.element(element, keep)?;
                let ends =
                    ["vertex1", "vertex2"].map(|end| take_cells(&mut cells, element, |property| property.name == end));
                if let [Some(Cells::Indices { items: a, .. }), Some(Cells::Indices { items: b, .. })] = ends {
                    self.edges = a.into_iter().zip(b).map(|(a, b)| [a, b]).collect();
                }
            }
            "curve" => {
                let mut cells = body.element(element, |_| Keep::Values)?;
                if let Some(Cells::Wholes(counts)) =
                    take_cells(&mut cells, element, |property| property.name == "count")
                {
                    self.curve_counts = Some(counts.into_iter().map(i32::cast_unsigned).collect());
                    self.curves = columns(&element.properties, cells);
                }
            }
            _ => {
                body.element(element, |_| Keep::Nothing)?;
            }
        }
        Ok(())
    }

    fn geometry(self, vertices: usize) -> Result<Geometry, FormatError> {
        u32::try_from(vertices.max(self.edges.len())).map_err(|_| GeometryError::TooMany)?;
        match &self.owners {
            Some(owners) => self.owned(owners),
            None => self.inferred(vertices),
        }
    }

    /// Components as marked by [`super::write`].
    fn owned(&self, owners: &[i32]) -> Result<Geometry, FormatError> {
        let mut vertices = [const { Vec::new() }; 3];
        for (vertex, owner) in (0_u32..).zip(owners) {
            let list = usize::try_from(*owner).ok().and_then(|owner| vertices.get_mut(owner)).ok_or_else(|| {
                FormatError::at(
                    FilePosition::File,
                    format!("`vertex` {vertex}: `{COMPONENT}` is {owner}, expected 0, 1 or 2"),
                )
            })?;
            list.push(vertex);
        }
        let mut geometry = Geometry::default();
        let of = |kind: Kind| Some(&vertices[kind as usize]).filter(|vertices| !vertices.is_empty());
        if let Some(vertices) = of(Kind::Curves) {
            let counts = self.curve_counts.clone().unwrap_or_default();
            geometry.put(self.component(vertices, &self.curves, |p| Component::curves(counts, p))?);
        }
        if of(Kind::Mesh).is_some() || !self.corners.is_empty() {
            geometry.put(self.mesh(&vertices[Kind::Mesh as usize], owners.len())?);
        }
        if let Some(vertices) = of(Kind::Points) {
            geometry.put(self.component(vertices, &Columns::new(), |p| Ok(Component::points(p)))?);
        }
        Ok(geometry)
    }

    /// Components of a file that another program wrote.
    fn inferred(&self, vertices: usize) -> Result<Geometry, FormatError> {
        let all = || (0_u32..).take(vertices).collect::<Vec<u32>>();
        let has_faces = !self.face_counts.is_empty();
        let mut geometry = Geometry::default();
        let (counts, cvs, attributes) = match &self.curve_counts {
            Some(counts) if !has_faces => (counts.clone(), all(), &self.curves),
            _ => {
                let (counts, cvs) = chains::join(&self.edges, vertices);
                (counts, cvs, &Columns::new())
            }
        };
        let has_curves = !counts.is_empty();
        if has_curves {
            geometry.put(self.component(&cvs, attributes, |p| Component::curves(counts, p))?);
        }
        if has_faces {
            let named = || {
                let mut named = vec![false; vertices];
                self.corners.iter().for_each(|corner| named[*corner as usize] = true);
                (0_u32..).zip(named).filter_map(|(vertex, named)| named.then_some(vertex)).collect()
            };
            let picked: Vec<u32> = if has_curves { named() } else { all() };
            geometry.put(self.mesh(&picked, vertices)?);
        }
        if !has_curves && !has_faces && vertices > 0 {
            geometry.put(self.component(&all(), &Columns::new(), |p| Ok(Component::points(p)))?);
        }
        Ok(geometry)
    }

    fn mesh(&self, picked: &[u32], vertices: usize) -> Result<Component, FormatError> {
        let mut new_index = vec![u32::MAX; vertices];
        for (new, old) in (0_u32..).zip(picked) {
            new_index[*old as usize] = new;
        }
        let index = |corner: &u32| Some(new_index[*corner as usize]).filter(|index| *index != u32::MAX);
        let corners = self.corners.iter().map(index).collect::<Option<Vec<u32>>>().ok_or_else(|| {
            FormatError::at(
                FilePosition::File,
                format!("a face uses a vertex that `{COMPONENT}` assigns to another component"),
            )
        })?;
        self.component(picked, &self.faces, |p| Component::mesh(self.face_counts.clone(), corners, p))
    }

    fn component(
        &self,
        picked: &[u32],
        elements: &Columns,
        make: impl FnOnce(Vec<[f32; 3]>) -> Result<Component, GeometryError>,
    ) -> Result<Component, FormatError> {
        let positions = self.points.get(P.name).and_then(<[f32; 3]>::array);
        let at = |vertex: &u32| positions.and_then(|rows| rows.get(*vertex as usize)).copied().unwrap_or_default();
        let mut component = make(picked.iter().map(at).collect())?;
        let is_other = |(name, _): &(&Name, _)| &***name != P.name;
        for (name, column) in self.points.iter().filter(is_other) {
            component.set_column(Owner::Point, name.clone(), column.gather(picked))?;
        }
        for (name, column) in elements {
            component.set_column(Owner::Element, name.clone(), column.clone())?;
        }
        Ok(component)
    }
}

/// Removes and returns the cells of the first such property.
fn take_cells(cells: &mut [Cells], element: &Element, is: impl Fn(&Property) -> bool) -> Option<Cells> {
    let k = element.properties.iter().position(is)?;
    cells.get_mut(k).map(|cells| std::mem::replace(cells, Cells::Nothing))
}
