//! Attributes of a prim as rows of ours: which name they get, what owns a row, and what cannot be kept.

use engine::geometry::{Column, Kind, Owner};

use super::super::layout::means_another;
use super::layer::{Array, Value};
use super::sample::Sampled;
use super::stage::{Prim, UsdStage};
use crate::Result;
use crate::usd::names::identifier;

/// How many rows each owner has in a component.
pub(super) struct RowCounts<'a> {
    pub(super) kind: Kind,
    pub(super) points: usize,
    pub(super) elements: usize,
    /// The point of each corner of a mesh.
    pub(super) corners: &'a [u32],
    /// Where values stand that vary along cubic curves.
    pub(super) varying: Option<Varying<'a>>,
}

/// Cubic curves: values that vary stand at the ends of segments.
pub(super) struct Varying<'a> {
    /// CVs of each curve.
    pub(super) counts: &'a [u32],
    /// CVs from one segment to the next: 3 for Bézier curves, 1 for others.
    pub(super) step: usize,
    /// CVs before the start of the first segment.
    pub(super) before: usize,
}

impl Varying<'_> {
    /// Values of a curve of `count` CVs.
    fn values(&self, count: usize) -> usize {
        let last = count.saturating_sub(1 + 2 * self.before);
        last / self.step + 1
    }

    /// For each CV the values that it lies between, and how far.
    fn places(&self) -> Vec<(usize, usize, f64)> {
        let mut places = Vec::new();
        let mut start = 0;
        for count in self.counts.iter().map(|count| *count as usize) {
            let values = self.values(count);
            for cv in 0..count {
                let along = cv.saturating_sub(self.before);
                let lower = (along / self.step).min(values - 1);
                let upper = (lower + 1).min(values - 1);
                let share = if upper > lower { (along % self.step) as f64 / self.step as f64 } else { 0.0 };
                places.push((start + lower, start + upper, share));
            }
            start += values;
        }
        places
    }

    fn total(&self) -> usize {
        self.counts.iter().map(|count| self.values(*count as usize)).sum()
    }
}

/// Picks rows of an array.
pub(super) fn picked(array: &Array, rows: impl Iterator<Item = usize>) -> Array {
    match array {
        Array::F1(from) => Array::F1(rows.map(|row| from[row]).collect()),
        Array::F2(from) => Array::F2(rows.map(|row| from[row]).collect()),
        Array::F3(from) => Array::F3(rows.map(|row| from[row]).collect()),
        Array::F4(from) => Array::F4(rows.map(|row| from[row]).collect()),
        Array::Quaternions(from) => Array::Quaternions(rows.map(|row| from[row]).collect()),
        Array::I1(from) => Array::I1(rows.map(|row| from[row]).collect()),
        Array::I2(from) => Array::I2(rows.map(|row| from[row]).collect()),
        Array::I3(from) => Array::I3(rows.map(|row| from[row]).collect()),
        Array::I4(from) => Array::I4(rows.map(|row| from[row]).collect()),
        Array::Long(from) => Array::Long(rows.map(|row| from[row]).collect()),
        Array::Texts(from) => Array::Texts(rows.map(|row| from[row].clone()).collect()),
        Array::Doubles(from, width) => {
            let row = |row: usize| from[row * width..(row + 1) * width].iter().copied();
            Array::Doubles(rows.flat_map(row).collect(), *width)
        }
        Array::Other => Array::Other,
    }
}

/// Whether two rows have the same bits.
fn same_rows(array: &Array, a: usize, b: usize) -> bool {
    fn bits<const N: usize>(rows: &[[f32; N]], a: usize, b: usize) -> bool {
        rows[a].map(f32::to_bits) == rows[b].map(f32::to_bits)
    }
    match array {
        Array::F1(rows) => rows[a].to_bits() == rows[b].to_bits(),
        Array::F2(rows) => bits(rows, a, b),
        Array::F3(rows) => bits(rows, a, b),
        Array::F4(rows) | Array::Quaternions(rows) => bits(rows, a, b),
        Array::I1(rows) => rows[a] == rows[b],
        Array::I2(rows) => rows[a] == rows[b],
        Array::I3(rows) => rows[a] == rows[b],
        Array::I4(rows) => rows[a] == rows[b],
        Array::Long(rows) => rows[a] == rows[b],
        Array::Doubles(numbers, width) => {
            (0..*width).all(|k| numbers[a * width + k].to_bits() == numbers[b * width + k].to_bits())
        }
        Array::Texts(_) | Array::Other => true,
    }
}

/// The array with the owner of its rows; an error says why it is left out.
pub(super) fn owned(array: Array, interpolation: &str, counts: &RowCounts<'_>) -> Result<(Owner, Array), String> {
    let rows = array.len();
    let of = |owner: Owner, expected: usize, what: &str| match rows == expected {
        true => Ok((owner, array.clone())),
        false => Err(format!("has {rows} rows, expected {expected}: one for each {what}")),
    };
    let noun = |owner: Owner| counts.kind.rows_text(owner, engine::geometry::ColumnType::F1);
    let noun = |owner: Owner| noun(owner).rsplit(' ').next().unwrap_or_default().to_owned();
    match interpolation {
        "constant" => match rows {
            1 => Ok((Owner::Once, array)),
            _ => Err(format!("has {rows} rows for the whole prim, of which one can be kept")),
        },
        "uniform" if counts.kind != Kind::Points && rows == 1 && counts.elements == 1 => Ok((Owner::Element, array)),
        // Widths and normals of a whole prim are often written without saying so.
        _ if rows == 1 && counts.points != 1 => Ok((Owner::Once, array)),
        "uniform" if counts.kind != Kind::Points => of(Owner::Element, counts.elements, &noun(Owner::Element)),
        "faceVarying" if counts.kind == Kind::Mesh => at_points(array, counts),
        "varying" if let Some(varying) = &counts.varying => match rows == varying.total() {
            true => Ok((Owner::Point, along(array, varying))),
            false => Err(format!("has {rows} rows, expected {}: one for each end of a segment", varying.total())),
        },
        _ => of(Owner::Point, counts.points, &noun(Owner::Point)),
    }
}

/// Values at the ends of segments, for each CV.
fn along(array: Array, varying: &Varying<'_>) -> Array {
    let places = varying.places();
    let lower = picked(&array, places.iter().map(|(lower, ..)| *lower));
    let upper = picked(&array, places.iter().map(|(_, upper, _)| *upper));
    match (lower, upper) {
        (Array::F1(mut a), Array::F1(b)) => {
            for ((a, b), (_, _, share)) in a.iter_mut().zip(b).zip(places) {
                *a += ((b - *a) as f64 * share) as f32;
            }
            Array::F1(a)
        }
        (Array::F3(mut a), Array::F3(b)) => {
            for ((a, b), (_, _, share)) in a.iter_mut().zip(b).zip(places) {
                *a = std::array::from_fn(|k| a[k] + (f64::from(b[k] - a[k]) * share) as f32);
            }
            Array::F3(a)
        }
        (lower, _) => lower,
    }
}

/// Values of corners at points, where all corners of a point agree.
fn at_points(array: Array, counts: &RowCounts<'_>) -> Result<(Owner, Array), String> {
    let (rows, corners) = (array.len(), counts.corners.len());
    if rows != corners {
        return Err(format!("has {rows} rows, expected {corners}: one for each corner"));
    }
    let mut first: Vec<usize> = vec![usize::MAX; counts.points];
    let mut seams = 0_usize;
    for (corner, point) in counts.corners.iter().enumerate() {
        let known = &mut first[*point as usize];
        if *known == usize::MAX {
            *known = corner;
        } else if !same_rows(&array, *known, corner) {
            seams += 1;
        }
    }
    if seams > 0 {
        return Err(format!(
            "differs between corners of a point at {seams} of {corners} corners, and points have one value"
        ));
    }
    if first.contains(&usize::MAX) {
        return Err("has no value at points without a face".into());
    }
    Ok((Owner::Point, picked(&array, first.into_iter())))
}

/// The column of an array; an error says why there is none.
pub(super) fn column(array: Array) -> Result<Column, String> {
    Ok(match array {
        Array::F1(rows) => Column::new(rows),
        Array::F2(rows) => Column::new(rows.into_iter().map(|[x, y]| [x, y, 0.0]).collect()),
        Array::F3(rows) => Column::new(rows),
        Array::F4(rows) | Array::Quaternions(rows) => Column::new(rows),
        Array::I1(rows) => Column::new(rows),
        Array::I3(rows) => Column::new(rows),
        Array::I4(rows) => Column::new(rows),
        Array::Doubles(numbers, width) => {
            let single = |x: f64| x as f32;
            match width {
                1 => Column::new(numbers.into_iter().map(single).collect()),
                2 => Column::new(numbers.as_chunks().0.iter().map(|[x, y]| [single(*x), single(*y), 0.0]).collect()),
                3 => Column::new(numbers.as_chunks().0.iter().map(|row: &[f64; 3]| row.map(single)).collect()),
                _ => Column::new(numbers.as_chunks().0.iter().map(|row: &[f64; 4]| row.map(single)).collect()),
            }
        }
        Array::Long(_) => return Err("has whole numbers beyond 32 bits".into()),
        Array::I2(_) => return Err("has pairs of whole numbers".into()),
        Array::Texts(_) => return Err("has texts".into()),
        Array::Other => return Err("has a type that has no meaning here".into()),
    })
}

/// An attribute that is read.
pub(super) struct Found {
    /// Its name in the file.
    pub(super) attribute: String,
    /// Its name here.
    pub(super) name: String,
    /// The role of its numbers.
    pub(super) role: Role,
    /// Whether convect wrote it under another name: then it has the owner that it had.
    pub(super) is_ours: bool,
}

/// How numbers follow the place of the prim.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    Point,
    Vector,
    Normal,
    Length,
    None,
}

impl UsdStage {
    /// The attributes of a prim that become ours, besides points and topology; sorted by name in the file.
    pub(super) fn attributes(&self, prim: &Prim, kind: Kind) -> Result<Vec<Found>> {
        let mut names: Vec<&str> = Vec::new();
        for site in &prim.sites {
            let layer = &self.layers[site.layer].1;
            names.extend(layer.properties(site.node).map(|property| layer.name(property)));
        }
        names.sort_unstable();
        names.dedup();
        let has = |name: &str| names.binary_search(&name).is_ok();
        let is_literal =
            |name: &str| -> Result<bool> { Ok(self.own_name(prim, name)?.as_deref().is_some_and(means_another)) };
        let mut found = Vec::new();
        for attribute in &names {
            let own = self.own_name(prim, attribute)?;
            let is_ours = own.is_some();
            let (name, role) = match *attribute {
                // An attribute of that very name, not what others mean by it.
                other if is_literal(other)? => {
                    let name = own.unwrap_or_default();
                    let role = self.role(prim, other, &name)?;
                    (name, role)
                }
                "velocities" => ("v".to_owned(), Role::Vector),
                "normals" if has("primvars:normals") && !is_literal("primvars:normals")? => continue,
                "normals" | "primvars:normals" => ("N".to_owned(), Role::Normal),
                "widths" if kind == Kind::Curves || kind == Kind::Points => ("width".to_owned(), Role::Length),
                "ids" if kind == Kind::Points => ("id".to_owned(), Role::None),
                "primvars:displayColor" if is_ours || !has("primvars:Cd") => ("Cd".to_owned(), Role::None),
                "primvars:st" if !has("primvars:uvw") => ("uvw".to_owned(), Role::None),
                "primvars:st" | "primvars:displayColor" => continue,
                other => match other.strip_prefix("primvars:") {
                    Some(rest) if !rest.ends_with(":indices") => {
                        let name = own.unwrap_or_else(|| rest.to_owned());
                        if name == "P" && self.varies_over_points(prim, other)? {
                            // Positions are `points`.
                            continue;
                        }
                        let role = self.role(prim, other, &name)?;
                        (name, role)
                    }
                    _ => continue,
                },
            };
            found.push(Found { attribute: (*attribute).to_owned(), name, role, is_ours });
        }
        Ok(found)
    }

    /// Whether a primvar has more than one value for all of the prim.
    fn varies_over_points(&self, prim: &Prim, primvar: &str) -> Result<bool> {
        let interpolation = self.metadata(prim, primvar, "interpolation")?;
        Ok(interpolation.as_ref().and_then(Value::text).is_some_and(|how| how != "constant"))
    }

    /// The name of an attribute of convect: it writes what is no identifier, or has another name in USD, as `displayName`.
    /// Others write labels there.
    fn own_name(&self, prim: &Prim, attribute: &str) -> Result<Option<String>> {
        let Some(rest) = attribute.strip_prefix("primvars:") else { return Ok(None) };
        let own = self.metadata(prim, attribute, "displayName")?;
        let is_ours = |name: &&str| {
            let alias = match *name {
                "id" => "curve_id",
                "Cd" => "displayColor",
                _ => "",
            };
            let made = identifier(name);
            let stems = [&*made, alias].into_iter().filter(|stem| !stem.is_empty());
            stems.into_iter().filter_map(|stem| rest.strip_prefix(stem)).any(|after| {
                after.is_empty() || after.strip_prefix('_').is_some_and(|number| number.parse::<u64>().is_ok())
            })
        };
        Ok(own.as_ref().and_then(Value::text).filter(is_ours).map(str::to_owned))
    }

    /// The role of a primvar.
    fn role(&self, prim: &Prim, attribute: &str, name: &str) -> Result<Role> {
        let kind = self.metadata(prim, attribute, "typeName")?;
        Ok(match kind.as_ref().and_then(Value::text).unwrap_or_default() {
            kind if kind.starts_with("point3") => Role::Point,
            kind if kind.starts_with("vector3") => Role::Vector,
            kind if kind.starts_with("normal3") => Role::Normal,
            _ if name == "width" || name == "thickness" => Role::Length,
            _ => Role::None,
        })
    }

    /// The rows of an attribute at a time, its indices resolved, and its interpolation; an inner error says why it is
    /// left out. `None` without a value.
    pub(super) fn rows(
        &self,
        prim: &Prim,
        attribute: &str,
        (values, indices): (&Sampled, &Sampled),
    ) -> Result<Option<Result<(Array, String), String>>> {
        let Some(array) = values.array()? else { return Ok(None) };
        let interpolation = self.metadata(prim, attribute, "interpolation")?;
        let default = if attribute.starts_with("primvars:") { "constant" } else { "vertex" };
        let interpolation = interpolation.as_ref().and_then(Value::text).unwrap_or(default).to_owned();
        if self.metadata(prim, attribute, "elementSize")?.and_then(|size| size.number()).is_some_and(|size| size != 1.0)
        {
            return Ok(Some(Err("has several values a row".into())));
        }
        let array = match array {
            // A single value.
            Array::Other => match values.value()?.map(|value| self.single(prim, attribute, value)).transpose()? {
                Some(Some(single)) => single,
                _ => return Ok(Some(Err("has a type that has no meaning here".into()))),
            },
            array => array,
        };
        let array = match indices.array()? {
            Some(Array::I1(indices)) => {
                let rows = array.len();
                let row = |index: &i32| usize::try_from(*index).ok().filter(|row| *row < rows);
                match indices.iter().map(row).collect::<Option<Vec<usize>>>() {
                    Some(indices) => picked(&array, indices.into_iter()),
                    None => return Ok(Some(Err(format!("has indices beyond its {rows} rows")))),
                }
            }
            _ => array,
        };
        Ok(Some(Ok((array, interpolation))))
    }

    /// A single value as an array of one row.
    fn single(&self, prim: &Prim, attribute: &str, value: Value) -> Result<Option<Array>> {
        let numbers = match value {
            Value::Double(x) => return Ok(Some(Array::F1(vec![x as f32]))),
            Value::Int(i) => {
                return Ok(Some(i32::try_from(i).map_or_else(|_| Array::Long(vec![i]), |i| Array::I1(vec![i]))));
            }
            Value::Quaternion(q) => return Ok(Some(Array::Quaternions(vec![q.map(|x| x as f32)]))),
            Value::Numbers(numbers) => numbers,
            _ => return Ok(None),
        };
        let kind = self.metadata(prim, attribute, "typeName")?;
        let is_whole = kind.as_ref().and_then(Value::text).is_some_and(|name| name.starts_with("int"));
        Ok(match (is_whole, &numbers[..]) {
            (true, [a, b]) => Some(Array::I2(vec![[*a as i32, *b as i32]])),
            (true, [a, b, c]) => Some(Array::I3(vec![[*a as i32, *b as i32, *c as i32]])),
            (true, [a, b, c, d]) => Some(Array::I4(vec![[*a as i32, *b as i32, *c as i32, *d as i32]])),
            (false, [_, _] | [_, _, _] | [_, _, _, _]) => {
                let width = numbers.len();
                Some(Array::Doubles(numbers, width))
            }
            _ => None,
        })
    }
}
