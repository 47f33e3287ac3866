//! Files that convect wrote for pieces of time, as pieces of one stage: what they declare, and the stage of clips that
//! joins them.

use std::fmt::Write as _;

use super::layer::{Array, NodeKind, Value};
use super::matrix::Matrix;
use super::stage::{FLATTEN, UsdStage, rate, refused};
use super::walk::Placed;
use super::{UsdReading, join};
use crate::usd::usda::{decimal, quoted};
use crate::{FilePosition, FormatError, Result};

/// Prims of such files are nested no deeper.
const DEEPEST: usize = 8;

/// The names of prims with geometry in files that convect writes.
const KINDS: [&str; 4] = ["curves", "mesh", "points", "tets"];

/// A piece of a sequence: its file as the stage names it, and the time from which on it is read.
#[derive(Clone, Debug, PartialEq)]
pub struct ClipPiece {
    /// The file.
    pub file: String,
    /// Its first time code.
    pub start: f64,
}

/// An attribute of a piece.
#[derive(Clone, Debug, PartialEq)]
struct Declared {
    /// The prim's path.
    prim: String,
    name: String,
    kind: String,
    interpolation: Option<String>,
    /// Its value if it is the same at all times.
    default: Option<Array>,
}

impl UsdStage {
    /// The prims under the default prim that hold an output each, in order and by the names of their outputs, if that is
    /// how the file was written; none if it holds a single output, or is by another program.
    ///
    /// # Errors
    /// If the file is damaged.
    pub fn members(&self) -> Result<Vec<String>> {
        let layer = self.root();
        let text = |prim: u32, field: &str| -> Result<Option<String>> {
            let value = layer.value_of(prim, field)?;
            Ok(value.as_ref().and_then(Value::text).map(str::to_owned))
        };
        let mut names = Vec::new();
        for prim in self.member_prims() {
            let holds_geometry = layer.children(prim).all(|child| KINDS.contains(&layer.name(child)));
            if text(prim, "typeName")?.as_deref() != Some("Xform")
                || !holds_geometry
                || layer.properties(prim).next().is_some()
            {
                return Ok(Vec::new());
            }
            names.push(text(prim, "displayName")?.unwrap_or_else(|| layer.name(prim).to_owned()));
        }
        Ok(names)
    }

    /// The prims under the default prim, in the root layer.
    fn member_prims(&self) -> Vec<u32> {
        let layer = self.root();
        layer.children(0).next().map_or_else(Vec::new, |prim| layer.children(prim).collect())
    }

    /// Reads like [`UsdStage::read`], but leaves positions as they are written: without transforms, unit and axes. `member`
    /// is a position in [`UsdStage::members`]; `None` reads all.
    ///
    /// # Errors
    /// If the file is damaged.
    pub fn read_member(&self, member: Option<usize>, time: f64) -> Result<UsdReading> {
        let layer = self.root();
        let prims = self.member_prims();
        let path = match (layer.children(0).next(), member.map(|place| prims.get(place))) {
            (_, None) => String::new(),
            (Some(top), Some(Some(prim))) => format!("/{}/{}", layer.name(top), layer.name(*prim)),
            _ => return Err(FormatError::at(FilePosition::File, "it holds fewer outputs than that")),
        };
        let mut notes = Vec::new();
        let placed = self.placed_prims(&path, time, &mut notes)?.into_iter();
        let placed = placed.map(|placed| Placed { matrix: Matrix::IDENTITY, rest: Matrix::IDENTITY, ..placed });
        let mut parts = Vec::new();
        for placed in placed {
            parts.extend(self.part(&placed, time, &|_| true, &mut notes)?);
        }
        Ok(UsdReading { geometry: join::joined(parts, &mut notes)?, notes })
    }

    /// Where the default prim is translated to: the scene's origin in a file that convect wrote.
    ///
    /// # Errors
    /// If the file is damaged.
    pub fn origin(&self) -> Result<[f64; 3]> {
        let root = self.root();
        let prim = root.children(0).next().and_then(|prim| root.property(prim, "xformOp:translate"));
        let value = prim.map(|property| root.value_of(property, "default")).transpose()?.flatten();
        Ok(match value {
            Some(Value::Numbers(numbers)) => <[f64; 3]>::try_from(numbers).unwrap_or_default(),
            _ => [0.0; 3],
        })
    }

    /// All attributes, by prim and name.
    fn declared(&self) -> Result<Vec<Declared>> {
        let layer = self.root();
        let mut all = Vec::new();
        let mut open: Vec<(u32, String)> = vec![(0, String::new())];
        while let Some((node, path)) = open.pop() {
            for property in
                layer.properties(node).filter(|property| layer.nodes[*property as usize].kind == NodeKind::Attribute)
            {
                let text = |name: &str| -> Result<Option<String>> {
                    let value = layer.value_of(property, name)?;
                    Ok(value.as_ref().and_then(Value::text).map(str::to_owned))
                };
                let is_sampled = layer.field(property, "timeSamples").is_some();
                let default = layer.field(property, "default").filter(|_| !is_sampled);
                all.push(Declared {
                    prim: path.clone(),
                    name: layer.name(property).to_owned(),
                    kind: text("typeName")?.unwrap_or_default(),
                    interpolation: text("interpolation")?,
                    default: default.map(|handle| layer.array(handle)).transpose()?,
                });
            }
            if path.matches('/').count() > DEEPEST {
                return Err(refused(&path, "is nested deeper than in files that convect writes", FLATTEN));
            }
            open.extend(layer.children(node).map(|child| (child, format!("{path}/{}", layer.name(child)))));
        }
        all.sort_by(|a, b| (&a.prim, &a.name).cmp(&(&b.prim, &b.name)));
        Ok(all)
    }

    /// Refuses two pieces of one sequence that do not say the same of each attribute: which there are, of which type, and
    /// whether they have samples; and if they have none, their value.
    ///
    /// # Errors
    /// With the first attribute that differs.
    pub fn matches(&self, other: &Self) -> Result<()> {
        let [ours, theirs] = [self.declared()?, other.declared()?];
        let of = |one: &Declared| format!("`{}` of `{}`", one.name, one.prim);
        let differ = |fact: String| {
            let hint = "cook the parts again, all by the same graph and with `--part`";
            FormatError::with_hint(FilePosition::File, fact, hint)
        };
        for (a, b) in ours.iter().zip(&theirs) {
            if (&a.prim, &a.name) != (&b.prim, &b.name) {
                return Err(differ(format!("{} or {} is only in one of them", of(a), of(b))));
            }
            if (&a.kind, &a.interpolation) != (&b.kind, &b.interpolation) {
                return Err(differ(format!("{} has different types", of(a))));
            }
            if a.default.is_some() != b.default.is_some() {
                return Err(differ(format!("{} has samples in only one of them", of(a))));
            }
            if a.default != b.default {
                return Err(differ(format!("{} has no samples and different values", of(a))));
            }
        }
        match ours.len() == theirs.len() {
            true => Ok(()),
            false => Err(differ(format!("one has {} attributes, the other {}", ours.len(), theirs.len()))),
        }
    }

    /// The text of the stage that joins `pieces` by value clips, of which this is the first, and of its manifest, which the
    /// stage calls `manifest`: what has samples. `last` is the last time code.
    ///
    /// # Errors
    /// If the file is damaged.
    pub fn clip_stage(&self, pieces: &[ClipPiece], last: f64, manifest: &str) -> Result<[String; 2]> {
        let layer = self.root();
        let prim = layer.children(0).next();
        let name = prim.map(|prim| layer.name(prim).to_owned()).unwrap_or_default();
        let (first, fps) = (pieces.first().map_or(0.0, |piece| piece.start), decimal(rate(layer)?));
        let header = format!(
            "#usda 1.0\n(\n    defaultPrim = \"{name}\"\n    metersPerUnit = 1\n    timeCodesPerSecond = {fps}\n    \
             framesPerSecond = {fps}\n    startTimeCode = {}\n    endTimeCode = {}\n    upAxis = \"Y\"\n)\n\n",
            decimal(first),
            decimal(last)
        );
        let files: Vec<String> = pieces.iter().map(|piece| format!("@{}@", piece.file)).collect();
        let active = pieces.iter().enumerate().map(|(place, piece)| format!("({}, {place})", decimal(piece.start)));
        let stage = format!(
            "{header}def Xform \"{name}\" (\n    prepend references = {}\n    clips = {{\n        dictionary default = {{\n            \
             asset[] assetPaths = [{}]\n            double2[] active = [{}]\n            double2[] times = [({first}, {first}), \
             ({last}, {last})]\n            asset manifestAssetPath = @{manifest}@\n            string primPath = \"/{name}\"\n        \
             }}\n    }}\n)\n{{\n}}\n",
            files.first().map_or("None", |file| file),
            files.join(", "),
            active.collect::<Vec<String>>().join(", "),
            first = decimal(first),
            last = decimal(last),
        );
        let mut declared = header;
        let prims = prim.map_or_else(Vec::new, |prim| vec![prim]);
        self.declare(&prims, &self.declared()?, "", &mut declared)?;
        Ok([stage, declared])
    }

    /// Prims with the declarations of what has samples.
    fn declare(&self, prims: &[u32], all: &[Declared], above: &str, text: &mut String) -> Result<()> {
        let layer = self.root();
        for prim in prims {
            let path = format!("{above}/{}", layer.name(*prim));
            let indent = "    ".repeat(path.matches('/').count() - 1);
            let schema = layer.value_of(*prim, "typeName")?;
            let schema = schema.as_ref().and_then(Value::text).unwrap_or_default();
            let _ = writeln!(text, "{indent}def {schema} \"{}\"\n{indent}{{", layer.name(*prim));
            for one in all.iter().filter(|one| one.prim == path && one.default.is_none()) {
                let interpolation = one.interpolation.as_ref();
                let metadata = interpolation
                    .map(|word| format!(" (\n{indent}        interpolation = {}\n{indent}    )", quoted(word)));
                let _ = writeln!(text, "{indent}    {} {}{}", one.kind, one.name, metadata.unwrap_or_default());
            }
            // No deeper than `declared` allows.
            let children: Vec<u32> = layer.children(*prim).collect();
            self.declare(&children, all, &path, text)?;
            let _ = writeln!(text, "{indent}}}");
        }
        Ok(())
    }
}
