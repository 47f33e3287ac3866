//! Files that convect wrote for pieces of time, as pieces of one stage: what they declare, and the stage of clips that
//! joins them.

use std::fmt::Write as _;

use super::layer::{Array, NodeKind, Value};
use super::matrix::Matrix;
use super::stage::{FLATTEN, Prim, UsdStage, rate, refused};
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
    /// The names of the outputs that the file holds, in order, if convect wrote it with several: each has a prim under the
    /// default prim. None if it holds a single one, or is by another program.
    ///
    /// # Errors
    /// If the file is damaged.
    pub fn members(&self) -> Result<Vec<String>> {
        let text = |prim: &Prim, field: &str| -> Result<Option<String>> {
            Ok(self.field(prim, field)?.as_ref().and_then(Value::text).map(str::to_owned))
        };
        let mut names = Vec::new();
        for prim in self.member_prims()? {
            let has_own =
                prim.sites.iter().any(|site| self.layers[site.layer].1.properties(site.node).next().is_some());
            let holds_else = self.children(&prim)?.iter().any(|child| !KINDS.contains(&last_name(child)));
            if has_own || holds_else || self.schema(&prim)? != "Xform" {
                return Ok(Vec::new());
            }
            names.push(text(&prim, "displayName")?.unwrap_or_else(|| last_name(&prim).to_owned()));
        }
        Ok(names)
    }

    /// The prims under the default prim.
    fn member_prims(&self) -> Result<Vec<Prim>> {
        let first = self.children(&self.top())?.into_iter().next();
        first.map_or_else(|| Ok(Vec::new()), |prim| self.children(&prim))
    }

    /// The path of the prim of an output, by its position in [`UsdStage::members`].
    ///
    /// # Errors
    /// If there is none, or the file is damaged.
    pub fn member_path(&self, member: usize) -> Result<String> {
        let prim = self.member_prims()?.into_iter().nth(member);
        let missing = || FormatError::at(FilePosition::File, format!("it holds at most {member} outputs"));
        prim.map(|prim| prim.path).ok_or_else(missing)
    }

    /// Reads like [`UsdStage::read`], but leaves positions as they are written: without transforms, unit and axes. `member`
    /// is a position in [`UsdStage::members`]; `None` reads all.
    ///
    /// # Errors
    /// If there is no such output, or the file is damaged.
    pub fn read_member(&self, member: Option<usize>, time: f64) -> Result<UsdReading> {
        let path = member.map_or_else(|| Ok(String::new()), |member| self.member_path(member))?;
        let mut notes = Vec::new();
        let (placed, hides_some) = self.placed_prims(&path, time, &mut notes)?;
        let placed =
            placed.into_iter().map(|placed| Placed { matrix: Matrix::IDENTITY, rest: Matrix::IDENTITY, ..placed });
        let mut parts = Vec::new();
        for placed in placed {
            parts.extend(self.part(&placed, time, &|_| true, &mut notes)?);
        }
        Ok(UsdReading { geometry: join::joined(parts, &mut notes)?, notes, hides_some })
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

/// The last name of a prim's path.
fn last_name(prim: &Prim) -> &str {
    prim.path.rsplit('/').next().unwrap_or_default()
}
