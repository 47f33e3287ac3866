//! A prim as a component: topology, positions and attributes at a time. What did not change since the prim was read last
//! is shared with what was read then.

use std::collections::BTreeMap;
use std::sync::{Arc, PoisonError};

use engine::geometry::{Column, Component, Kind, Owner, P};

use super::layer::{Array, Value};
use super::matrix::Matrix;
use super::primvars::{Found, Role, RowCounts, Varying, column, owned};
use super::sample::Sampled;
use super::stage::{FLATTEN, UsdStage, refused};
use super::walk::Placed;
use crate::{FormatError, Result};

/// What was read last, by the path of the prim.
pub(super) type Kept = BTreeMap<String, Arc<KeptPrim>>;

/// A prim as it was read.
#[derive(Debug)]
pub(super) struct KeptPrim {
    topology: TopologySource,
    matrix: Matrix,
    rest: Matrix,
    positions: [Sampled; 2],
    component: Component,
    attributes: BTreeMap<String, KeptAttribute>,
}

/// An attribute of a kept prim: its source, and why it was left out if it was.
#[derive(Clone, Debug)]
struct KeptAttribute {
    source: [Sampled; 2],
    name: String,
    /// What owns its rows; `None` if it was left out.
    owner: Option<Owner>,
    note: Option<String>,
}

/// All that a topology is made from.
#[derive(Clone, Debug, PartialEq)]
struct TopologySource {
    arrays: [Sampled; 2],
    /// Whether faces are turned over.
    flips: bool,
}

/// Why a prim has no component.
enum NoPart {
    /// It has no points at this time.
    Empty,
    Fault(FormatError),
}

impl From<FormatError> for NoPart {
    fn from(error: FormatError) -> Self {
        Self::Fault(error)
    }
}

/// A topology: counts of curves or faces, and indices of faces or tets.
struct TopologyRows {
    counts: Vec<u32>,
    corners: Vec<u32>,
}

/// What reads a prim at a time.
struct PartReader<'s> {
    stage: &'s UsdStage,
    placed: &'s Placed,
    time: f64,
    wants: &'s dyn Fn(&str) -> bool,
}

impl UsdStage {
    /// The component of a prim; `None` if it has no points at this time.
    pub(super) fn part(
        &self,
        placed: &Placed,
        time: f64,
        wants: &dyn Fn(&str) -> bool,
        notes: &mut Vec<String>,
    ) -> Result<Option<Component>> {
        let reader = PartReader { stage: self, placed, time, wants };
        match reader.read(notes) {
            Ok(component) => Ok(Some(component)),
            Err(NoPart::Empty) => Ok(None),
            Err(NoPart::Fault(error)) => Err(error),
        }
    }
}

impl PartReader<'_> {
    fn sampled(&self, name: &str) -> Result<Sampled> {
        self.stage.sampled(&self.placed.prim, name, self.time)
    }

    fn token(&self, name: &str) -> Result<Option<String>> {
        let value = self.sampled(name)?.value()?;
        Ok(value.as_ref().and_then(Value::text).map(str::to_owned))
    }

    fn read(&self, notes: &mut Vec<String>) -> Result<Component, NoPart> {
        let Placed { prim, kind, matrix, rest, .. } = self.placed;
        let path = &prim.path;
        let names = match kind {
            Kind::Curves => ["curveVertexCounts", ""],
            Kind::Mesh => ["faceVertexCounts", "faceVertexIndices"],
            Kind::Tets => ["tetVertexIndices", ""],
            Kind::Points | Kind::Volume => ["", ""],
        };
        let arrays = [self.sampled(names[0])?, self.sampled(names[1])?];
        let changes = arrays.iter().map(topology_changes).collect::<Result<Vec<bool>>>()?.contains(&true);
        let points = self.sampled("points")?;
        if points == Sampled::Nothing {
            return Err(NoPart::Empty);
        }
        // Between frames of different topology points cannot be interpolated: they move along their velocities.
        let held = changes || rows_change(&points)?;
        let along = if held { self.sampled("velocities")? } else { Sampled::Nothing };
        let flips = *kind == Kind::Mesh
            && (self.token("orientation")?.as_deref() == Some("leftHanded")) != (matrix.determinant() < 0.0);
        let source = TopologySource { arrays: arrays.map(|array| array.held()), flips };

        let kept = self.stage.kept.lock().unwrap_or_else(PoisonError::into_inner).get(path).cloned();
        let positions = [if held { points.held() } else { points.clone() }, along.held()];
        let same_place = |kept: &KeptPrim| kept.matrix == *matrix && kept.rest == *rest;
        let moves_along = held && points != positions[0];
        let mut topology = None;
        let mut component = match &kept {
            Some(kept)
                if kept.topology == source && kept.positions == positions && same_place(kept) && !moves_along =>
            {
                kept.component.clone()
            }
            kept => {
                let rows = self.positions(&positions, matrix, if moves_along { Some(&points) } else { None })?;
                match kept {
                    Some(kept) if kept.topology == source && kept.component.point_count() == rows.len() => {
                        let mut component = kept.component.clone();
                        component.set(P, rows).map_err(FormatError::from)?;
                        component
                    }
                    _ => {
                        let read = self.topology(&source)?;
                        let made = component_of(*kind, &read, flips, rows);
                        let component = made.map_err(|error| {
                            refused(
                                path,
                                format!("at {}: {error}", self.time),
                                "write the file again with valid geometry",
                            )
                        })?;
                        topology = Some(read);
                        component
                    }
                }
            }
        };
        let known = kept.as_ref().filter(|_| topology.is_none());
        let mut attributes = BTreeMap::new();
        let cubic = self.cubic()?;
        for found in self.stage.attributes(prim, *kind)? {
            let read = self.attribute(&found, held)?;
            if !(self.wants)(&found.name) || read.source[0] == Sampled::Nothing {
                continue;
            }
            let before = known.and_then(|kept| {
                let before = kept.attributes.get(&found.attribute)?;
                Some((before, found.role == Role::None || same_place(kept)))
            });
            let (owner, note) = match before {
                Some((before, true)) if before.source == read.source && before.name == read.name => {
                    (before.owner, before.note.clone())
                }
                _ => {
                    let topology = match &mut topology {
                        Some(topology) => topology,
                        empty => empty.insert(self.topology(&source)?),
                    };
                    let counts = RowCounts {
                        kind: *kind,
                        points: component.point_count(),
                        elements: component.element_count(),
                        corners: &topology.corners,
                        varying: cubic.map(|[step, before]| Varying { counts: &topology.counts, step, before }),
                    };
                    let old = before.and_then(|(before, _)| before.owner);
                    old.and_then(|owner| component.remove(owner, &found.name));
                    match set_attribute(self.stage, self.placed, &found, &read, &counts, &mut component)? {
                        Ok(owner) => (owner, None),
                        Err(why) => (None, Some(format!("`{}` of `{path}` {why}, so it is not read", found.attribute))),
                    }
                }
            };
            notes.extend(note.clone());
            attributes.insert(found.attribute, KeptAttribute { owner, note, ..read });
        }
        let stays = |owner: Owner, name: &str| {
            let is_it = |kept: &KeptAttribute| kept.owner == Some(owner) && kept.name == name;
            (owner == P.owner && name == P.name) || attributes.values().any(is_it)
        };
        let gone: Vec<(Owner, String)> = component
            .columns()
            .filter(|(owner, name, _)| !stays(*owner, name))
            .map(|(owner, name, _)| (owner, name.to_string()))
            .collect();
        for (owner, name) in gone {
            component.remove(owner, &name);
        }
        self.note_curves(notes)?;
        if !moves_along {
            let kept = KeptPrim {
                topology: source,
                matrix: *matrix,
                rest: *rest,
                positions,
                component: component.clone(),
                attributes,
            };
            self.stage.kept.lock().unwrap_or_else(PoisonError::into_inner).insert(path.clone(), Arc::new(kept));
        }
        Ok(component)
    }

    fn attribute(&self, found: &Found, held: bool) -> Result<KeptAttribute> {
        let values = self.sampled(&found.attribute)?;
        let indices = match found.attribute.starts_with("primvars:") {
            true => self.sampled(&format!("{}:indices", found.attribute))?.held(),
            false => Sampled::Nothing,
        };
        let values = if held || found.name == "id" { values.held() } else { values };
        Ok(KeptAttribute { source: [values, indices], name: found.name.clone(), owner: None, note: None })
    }

    fn positions(
        &self,
        [points, velocities]: &[Sampled; 2],
        matrix: &Matrix,
        moved: Option<&Sampled>,
    ) -> Result<Vec<[f32; 3]>, NoPart> {
        let path = &self.placed.prim.path;
        let wrong = || refused(path, "has points that are not three numbers each", FLATTEN);
        let mut points = points.array()?.ok_or(NoPart::Empty)?;
        if let (Some(Sampled::Between { share, .. }), Some(Array::F3(velocities))) = (moved, velocities.array()?) {
            let seconds = share.elapsed / self.stage.fps()?;
            if let Array::F3(points) = &mut points
                && points.len() == velocities.len()
            {
                for (p, v) in points.iter_mut().zip(velocities) {
                    *p = std::array::from_fn(|k| (f64::from(p[k]) + f64::from(v[k]) * seconds) as f32);
                }
            }
        }
        match points {
            Array::F3(rows) if *matrix == Matrix::IDENTITY => Ok(rows),
            Array::F3(mut rows) => {
                rows.iter_mut().for_each(|row| *row = matrix.point(row.map(f64::from)).map(|x| x as f32));
                Ok(rows)
            }
            Array::Doubles(numbers, 3) => {
                Ok(numbers.as_chunks().0.iter().map(|row| matrix.point(*row).map(|x| x as f32)).collect())
            }
            empty if empty.len() == 0 => Ok(Vec::new()),
            _ => Err(wrong().into()),
        }
    }

    fn topology(&self, source: &TopologySource) -> Result<TopologyRows> {
        let path = &self.placed.prim.path;
        let wrong = |what: &str| {
            refused(path, format!("has {what} below 0, or none"), "write the file again with valid geometry")
        };
        let whole = |array: &Sampled, what: &str| -> Result<Vec<u32>> {
            let rows = match array.array()? {
                Some(Array::I1(rows)) => rows,
                Some(Array::I4(rows)) => rows.into_flattened(),
                None | Some(Array::Other) => Vec::new(),
                Some(_) => return Err(wrong(what)),
            };
            if rows.iter().any(|row| *row < 0) {
                return Err(wrong(what));
            }
            Ok(rows.into_iter().map(i32::cast_unsigned).collect())
        };
        let [first, second] = &source.arrays;
        Ok(match self.placed.kind {
            Kind::Tets => TopologyRows { counts: Vec::new(), corners: whole(first, "indices")? },
            _ => TopologyRows { counts: whole(first, "counts")?, corners: whole(second, "indices")? },
        })
    }

    /// CVs from one segment of cubic curves to the next, and before the first; `None` for others.
    fn cubic(&self) -> Result<Option<[usize; 2]>> {
        if self.placed.schema != "BasisCurves" || self.token("type")?.as_deref() == Some("linear") {
            return Ok(None);
        }
        let is_bezier = self.token("basis")?.is_none_or(|basis| basis == "bezier");
        let is_pinned = self.token("wrap")?.as_deref() == Some("pinned");
        Ok(Some(match (is_bezier, is_pinned) {
            (true, _) => [3, 0],
            (false, true) => [1, 0],
            (false, false) => [1, 1],
        }))
    }

    fn note_curves(&self, notes: &mut Vec<String>) -> Result<()> {
        if self.placed.kind != Kind::Curves {
            return Ok(());
        }
        let path = &self.placed.prim.path;
        if self.placed.schema != "BasisCurves" || self.token("type")?.as_deref() != Some("linear") {
            notes.push(format!("`{path}` has cubic curves, which enter by their control points"));
        }
        if self.token("wrap")?.as_deref() == Some("periodic") {
            notes.push(format!("`{path}` has closed curves, which enter open"));
        }
        Ok(())
    }
}

fn component_of(
    kind: Kind,
    rows: &TopologyRows,
    flips: bool,
    positions: Vec<[f32; 3]>,
) -> Result<Component, engine::geometry::GeometryError> {
    let TopologyRows { counts, corners } = rows;
    match kind {
        Kind::Curves => Component::curves(counts.clone(), positions),
        Kind::Mesh => {
            let mut corners = corners.clone();
            let mut rest = corners.as_mut_slice();
            for count in counts.iter().filter(|_| flips) {
                let Some((face, after)) = rest.split_at_mut_checked(*count as usize) else { break };
                // The first corner stays the first.
                face.get_mut(1..).into_iter().for_each(<[u32]>::reverse);
                rest = after;
            }
            Component::mesh(counts.clone(), corners, positions)
        }
        Kind::Tets => Component::tets(corners.as_chunks().0.to_vec(), positions),
        Kind::Points | Kind::Volume => Ok(Component::points(positions)),
    }
}

/// Whether an array of topology is about to become another one.
fn topology_changes(array: &Sampled) -> Result<bool> {
    match array {
        Sampled::Between { lower, upper, .. } => Ok(lower.array()? != upper.array()?),
        _ => Ok(false),
    }
}

/// Whether an array is about to have another number of rows.
fn rows_change(array: &Sampled) -> Result<bool> {
    match array {
        Sampled::Between { lower, upper, .. } => Ok(lower.array()?.len() != upper.array()?.len()),
        _ => Ok(false),
    }
}

/// Attributes of the schema that have a row a point here, also where one value is written for all.
const OF_POINTS: [&str; 6] =
    ["widths", "normals", "primvars:normals", "velocities", "primvars:displayColor", "primvars:st"];

/// Reads an attribute into the component; its owner, if it has a value. The inner error says why it is left out.
fn set_attribute(
    stage: &UsdStage,
    placed: &Placed,
    found: &Found,
    read: &KeptAttribute,
    counts: &RowCounts<'_>,
    component: &mut Component,
) -> Result<Result<Option<Owner>, String>> {
    let [values, indices] = &read.source;
    let Some(rows) = stage.rows(&placed.prim, &found.attribute, (values, indices))? else { return Ok(Ok(None)) };
    let matrix = if found.role == Role::Point { &placed.rest } else { &placed.matrix };
    let made = rows.and_then(|(array, interpolation)| owned(array, &interpolation, counts));
    let made = made.and_then(|(owner, array)| Ok((owner, column(in_place(array, found.role, matrix))?)));
    let (owner, column) = match made {
        Ok(made) => made,
        Err(why) => return Ok(Err(why)),
    };
    let spreads = owner == Owner::Once && !found.is_ours && OF_POINTS.contains(&&*found.attribute);
    let (owner, column) =
        if spreads { (Owner::Point, repeated(&column, component.point_count())) } else { (owner, column) };
    let set = component.set_column(owner, found.name.as_str(), column);
    Ok(set.map(|()| Some(owner)).map_err(|error| format!("does not fit: {error}")))
}

/// The one row of a column, `rows` times.
pub(super) fn repeated(column: &Column, rows: usize) -> Column {
    match column {
        Column::F1(row) => Column::new(vec![row[0]; rows]),
        Column::F3(row) => Column::new(vec![row[0]; rows]),
        Column::F4(row) => Column::new(vec![row[0]; rows]),
        Column::I1(row) => Column::new(vec![row[0]; rows]),
        Column::I3(row) => Column::new(vec![row[0]; rows]),
        Column::I4(row) => Column::new(vec![row[0]; rows]),
    }
}

/// Rows in our coordinates.
fn in_place(array: Array, role: Role, matrix: &Matrix) -> Array {
    if *matrix == Matrix::IDENTITY || role == Role::None {
        return array;
    }
    let normals = matrix.of_normals();
    let size = matrix.size();
    let moved = |row: [f64; 3]| match role {
        Role::Point => matrix.point(row),
        Role::Vector => matrix.vector(row),
        _ => {
            let row_length = |v: [f64; 3]| v.iter().fold(0.0, |sum, x| sum + x * x).sqrt();
            let turned = normals.vector(row);
            // A normal keeps the length that it has.
            let factor = row_length(row) / row_length(turned);
            if factor.is_finite() { turned.map(|x| x * factor) } else { row }
        }
    };
    match array {
        Array::F1(rows) if role == Role::Length => {
            Array::F1(rows.into_iter().map(|x| (f64::from(x) * size) as f32).collect())
        }
        Array::F3(rows) if role != Role::Length => {
            Array::F3(rows.into_iter().map(|row| moved(row.map(f64::from)).map(|x| x as f32)).collect())
        }
        Array::Doubles(numbers, 3) if role != Role::Length => {
            let rows: Vec<[f64; 3]> = numbers.as_chunks().0.iter().map(|row| moved(*row)).collect();
            Array::Doubles(rows.into_flattened(), 3)
        }
        other => other,
    }
}
