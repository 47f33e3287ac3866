//! OBJ text to geometry.

use engine::geometry::{Column, Component, Geometry, GeometryError, N, Owner, UVW};

use super::CD;
use crate::text::{Fields, Lines, counted, float, line_end, shown};
use crate::{FilePosition, FormatError};

/// An omitted reference.
const NONE: u32 = u32::MAX;

/// Statements that are ignored: they define no curves, faces or points.
const IGNORED: [&[u8]; 34] = [
    b"g",
    b"s",
    b"o",
    b"mg",
    b"usemtl",
    b"mtllib",
    b"usemap",
    b"maplib",
    b"vp",
    b"cstype",
    b"deg",
    b"bmat",
    b"step",
    b"curv",
    b"curv2",
    b"surf",
    b"parm",
    b"trim",
    b"hole",
    b"scrv",
    b"sp",
    b"end",
    b"con",
    b"bevel",
    b"c_interp",
    b"d_interp",
    b"lod",
    b"shadow_obj",
    b"trace_obj",
    b"ctech",
    b"stech",
    b"call",
    b"csh",
    b"bzp",
];

/// The geometry of an OBJ file.
///
/// # Errors
/// With the line: if a statement is incomplete, is not finite, or references a vertex that does not exist.
pub(crate) fn read(bytes: &[u8]) -> Result<Geometry, FormatError> {
    let mut statements = Statements::default();
    let mut lines = Lines::new(bytes, 1, line_end(bytes));
    let mut joined = Vec::new();
    while let Some(line) = lines.next() {
        statements.line = lines.number();
        let line = continued(line, &mut lines, &mut joined);
        statements.take(line).map_err(|fact| FormatError::at(FilePosition::Line(statements.line), fact))?;
    }
    statements.geometry()
}

/// `line` joined with its continuation lines.
fn continued<'a>(line: &'a [u8], lines: &mut Lines, joined: &'a mut Vec<u8>) -> &'a [u8] {
    let Some(start) = open_end(line) else { return line };
    joined.clear();
    joined.extend_from_slice(start);
    for next in lines {
        joined.push(b' ');
        match open_end(next) {
            Some(part) => joined.extend_from_slice(part),
            None => {
                joined.extend_from_slice(next);
                break;
            }
        }
    }
    joined
}

/// The line without the `\` at its end, if there is one. Comments are not continued, because they may contain Windows
/// paths.
fn open_end(line: &[u8]) -> Option<&[u8]> {
    let open = line.trim_ascii_end().strip_suffix(b"\\")?;
    (!line.trim_ascii_start().starts_with(b"#")).then_some(open)
}

/// The contents of the lines read so far.
#[derive(Default)]
struct Statements {
    line: usize,
    positions: Vec<[f32; 3]>,
    /// Not longer than `positions`; NaN for vertices without a colour, or missing at the end.
    colours: Vec<[f32; 3]>,
    textures: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    curves: Elements,
    faces: Elements,
    points: Elements,
    /// The largest index of `v`, `vt` and `vn`, with its line. It can be checked only at the end, because vertices may
    /// follow their references.
    highest: [(u32, usize); 3],
    /// The first unknown statement.
    unknown: Option<(usize, String)>,
}

/// The references of one kind of element.
#[derive(Default)]
struct Elements {
    counts: Vec<u32>,
    vertices: Vec<u32>,
    /// Not longer than `vertices`; [`NONE`] for vertices without one, or missing at the end.
    textures: Vec<u32>,
    normals: Vec<u32>,
}

impl Elements {
    fn push(&mut self, [vertex, texture, normal]: [u32; 3]) {
        let before = self.vertices.len();
        self.vertices.push(vertex);
        for (list, reference) in [(&mut self.textures, texture), (&mut self.normals, normal)] {
            if reference != NONE {
                list.resize(before, NONE);
                list.push(reference);
            }
        }
    }

    fn is_empty(&self) -> bool {
        self.counts.is_empty()
    }
}

impl Statements {
    fn take(&mut self, line: &[u8]) -> Result<(), String> {
        let mut fields = Fields(line).take_while(|field| field[0] != b'#');
        match fields.next() {
            Some(b"v") => self.vertex(fields),
            Some(b"vt") => {
                // One number for a 1D texture, usually two.
                let [u, v, w] = row(fields, "vt", 1)?;
                self.textures.push([u, v, w]);
                Ok(())
            }
            Some(b"vn") => {
                self.normals.push(row(fields, "vn", 3)?);
                Ok(())
            }
            Some(b"f") => self.element(fields, |file| &mut file.faces, "corner", 3),
            Some(b"l") => self.element(fields, |file| &mut file.curves, "CV", 1),
            Some(b"p") => self.element(fields, |file| &mut file.points, "point", 1),
            Some(word) if word.contains(&0) => Err("a NUL byte, expected text: the file is damaged or binary".into()),
            Some(word) if !IGNORED.contains(&word) => {
                self.unknown.get_or_insert_with(|| (self.line, shown(word)));
                Ok(())
            }
            _ => Ok(()),
        }
    }

    fn vertex<'a>(&mut self, fields: impl Iterator<Item = &'a [u8]>) -> Result<(), String> {
        let mut numbers = [0.0; 7];
        let mut count = 0;
        for field in fields {
            let number = number(field)?;
            if !number.is_finite() {
                return Err(format!("{} is not a finite number", shown(field)));
            }
            // Superfluous numbers are counted but not stored.
            if let Some(slot) = numbers.get_mut(count) {
                *slot = number;
            }
            count += 1;
        }
        // The seventh is alpha.
        let [x, y, z, a, b, c, _] = numbers;
        let colour = match count {
            3 | 4 => None,
            6 | 7 => Some([a, b, c]),
            _ => return Err(format!("`v` has {}, expected 3, 4, 6 or 7", counted(count, "number"))),
        };
        if let Some(colour) = colour {
            self.colours.resize(self.positions.len(), [f32::NAN; 3]);
            self.colours.push(colour);
        }
        self.positions.push([x, y, z]);
        Ok(())
    }

    fn element<'a>(
        &mut self,
        fields: impl Iterator<Item = &'a [u8]>,
        elements: impl Fn(&mut Self) -> &mut Elements,
        what: &str,
        least: u32,
    ) -> Result<(), String> {
        let mut count = 0;
        for field in fields {
            let reference = self.reference(field)?;
            elements(self).push(reference);
            count += 1;
        }
        if count < least {
            return Err(format!("{}, expected at least {least}", counted(count as usize, what)));
        }
        elements(self).counts.push(count);
        Ok(())
    }

    /// The rows that `v`, `v/vt`, `v//vn` or `v/vt/vn` references, from 0; [`NONE`] for omitted parts.
    fn reference(&mut self, field: &[u8]) -> Result<[u32; 3], String> {
        let counts = [self.positions.len(), self.textures.len(), self.normals.len()];
        let mut rows = [NONE; 3];
        for (k, part) in field.split(|byte| *byte == b'/').enumerate() {
            if k == 3 {
                return Err(format!("{} has {} parts, expected `v/vt/vn` at most", shown(field), k + 1));
            }
            if part.is_empty() && k > 0 {
                continue;
            }
            let index = std::str::from_utf8(part).ok().and_then(|text| text.parse::<i64>().ok());
            let index = index.ok_or_else(|| format!("{} is not a vertex index", shown(field)))?;
            let row = match index {
                0 => return Err(format!("{} has the index 0, but indices start at 1", shown(field))),
                1.. => index - 1,
                // Saturates at values that are refused anyway.
                _ => index.saturating_add(i64::try_from(counts[k]).unwrap_or(i64::MAX)),
            };
            rows[k] =
                u32::try_from(row).ok().filter(|row| *row != NONE).ok_or_else(|| out_of_range(k, index, counts[k]))?;
            if rows[k] >= self.highest[k].0 {
                self.highest[k] = (rows[k], self.line);
            }
        }
        Ok(rows)
    }

    fn geometry(self) -> Result<Geometry, FormatError> {
        let counts = [self.positions.len(), self.textures.len(), self.normals.len()];
        for (k, (row, line)) in self.highest.into_iter().enumerate() {
            if line > 0 && row as usize >= counts[k] {
                let fact = out_of_range(k, i64::from(row) + 1, counts[k]);
                return Err(FormatError::at(FilePosition::Line(line), fact));
            }
        }
        let vertices = u32::try_from(self.positions.len()).map_err(|_| GeometryError::TooMany)?;
        if let (0, Some((line, word))) = (vertices, &self.unknown) {
            let fact = format!("{word} is not an obj statement, and the file has no vertex");
            return Err(FormatError::at(FilePosition::Line(*line), fact));
        }
        let kinds =
            [&self.curves, &self.faces, &self.points].into_iter().filter(|elements| !elements.is_empty()).count();
        let picked = |elements: &Elements| match kinds {
            0 | 1 => (0..vertices).collect(),
            _ => self.named(elements),
        };
        let mut geometry = Geometry::default();
        if !self.curves.is_empty() {
            geometry.put(self.curve_component()?);
        }
        if !self.faces.is_empty() {
            let picked = picked(&self.faces);
            let corners = renumbered(&self.faces.vertices, &picked, vertices);
            let mesh = Component::mesh(self.faces.counts.clone(), corners, self.positions_of(&picked))?;
            geometry.put(self.with_attributes(mesh, &self.faces, &picked)?);
        }
        if !self.points.is_empty() || (kinds == 0 && vertices > 0) {
            let picked = picked(&self.points);
            let points = Component::points(self.positions_of(&picked));
            geometry.put(self.with_attributes(points, &self.points, &picked)?);
        }
        Ok(geometry)
    }

    /// The CVs of curves are in the order of the `l` lines; a vertex in two lines becomes two CVs.
    fn curve_component(&self) -> Result<Component, FormatError> {
        let Elements { counts, vertices, textures, .. } = &self.curves;
        let curves = Component::curves(counts.clone(), self.positions_of(vertices))?;
        let mut curves = self.with_attributes(curves, &self.curves, vertices)?;
        // A vertex in two lines may have different texture coordinates in each.
        if textures.len() == vertices.len()
            && let Some(rows) = textures.iter().map(|row| self.textures.get(*row as usize).copied()).collect()
        {
            set_if_finite(&mut curves, UVW.name, rows)?;
        }
        Ok(curves)
    }

    fn positions_of(&self, picked: &[u32]) -> Vec<[f32; 3]> {
        picked.iter().map(|vertex| self.positions[*vertex as usize]).collect()
    }

    /// The vertices that `elements` reference, in file order.
    fn named(&self, elements: &Elements) -> Vec<u32> {
        let mut named = vec![false; self.positions.len()];
        for vertex in &elements.vertices {
            named[*vertex as usize] = true;
        }
        (0_u32..).zip(named).filter_map(|(vertex, named)| named.then_some(vertex)).collect()
    }

    fn with_attributes(
        &self,
        mut component: Component,
        elements: &Elements,
        picked: &[u32],
    ) -> Result<Component, FormatError> {
        let carried = [
            (N.name, self.one_each(elements, &elements.normals, &self.normals, picked)),
            (UVW.name, self.one_each(elements, &elements.textures, &self.textures, picked)),
            (CD, picked.iter().map(|vertex| self.colours.get(*vertex as usize).copied()).collect()),
        ];
        for (name, rows) in carried {
            if let Some(rows) = rows {
                set_if_finite(&mut component, name, rows)?;
            }
        }
        Ok(component)
    }

    /// The value of each picked vertex, if each has exactly one: there are as many values as vertices and all
    /// references have equal indices, or all references of a vertex are to the same value.
    fn one_each(
        &self,
        elements: &Elements,
        references: &[u32],
        values: &[[f32; 3]],
        picked: &[u32],
    ) -> Option<Vec<[f32; 3]>> {
        if values.is_empty() {
            return None;
        }
        let mut row_of = vec![NONE; self.positions.len()];
        let mut in_step = values.len() == self.positions.len();
        let mut one_value = true;
        for (vertex, row) in elements.vertices.iter().zip(references).filter(|(_, row)| **row != NONE) {
            in_step &= vertex == row;
            let found = &mut row_of[*vertex as usize];
            if *found == NONE {
                *found = *row;
            } else if *found != *row {
                one_value &= values[*found as usize].map(f32::to_bits) == values[*row as usize].map(f32::to_bits);
            }
        }
        if in_step {
            return Some(picked.iter().map(|vertex| values[*vertex as usize]).collect());
        }
        let value = |vertex: &u32| values.get(row_of[*vertex as usize] as usize).copied();
        if one_value { picked.iter().map(value).collect() } else { None }
    }
}

/// Sets an attribute, or drops it if it is not finite: some files have NaN normals for faces without area.
fn set_if_finite(component: &mut Component, name: &'static str, rows: Vec<[f32; 3]>) -> Result<(), GeometryError> {
    let column = Column::new(rows);
    if column.first_not_finite().is_none() { component.set_column(Owner::Point, name, column) } else { Ok(()) }
}

/// `indices` into the vertices as indices into `picked`, which holds all of them.
fn renumbered(indices: &[u32], picked: &[u32], vertices: u32) -> Vec<u32> {
    let mut new_index = vec![NONE; vertices as usize];
    for (new, old) in (0_u32..).zip(picked) {
        new_index[*old as usize] = new;
    }
    indices.iter().map(|index| new_index[*index as usize]).collect()
}

fn number(field: &[u8]) -> Result<f32, String> {
    float(field).ok_or_else(|| format!("{} is not a number", shown(field)))
}

/// Three numbers. The first `least` are required, other missing ones are 0, and superfluous ones are ignored.
fn row<'a>(fields: impl Iterator<Item = &'a [u8]>, what: &str, least: usize) -> Result<[f32; 3], String> {
    let mut row = [0.0; 3];
    let mut count = 0;
    for (slot, field) in row.iter_mut().zip(fields) {
        *slot = number(field)?;
        count += 1;
    }
    if count < least {
        return Err(format!("`{what}` has {}, expected {least}", counted(count, "number")));
    }
    Ok(row)
}

fn out_of_range(k: usize, index: i64, count: usize) -> String {
    let name = ["v", "vt", "vn"][k];
    let range = if count == 0 { "there are none".into() } else { format!("expected 1 to {count}, or -{count} to -1") };
    format!("`{name}` index {index} is out of range: {range}")
}
