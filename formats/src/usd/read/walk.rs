//! Goes through the prims of a stage, with the place of each.

use std::collections::BTreeSet;

use engine::geometry::Kind;

use super::layer::Value;
use super::matrix::Matrix;
use super::stage::{Prim, UsdStage, refused};
use super::xform::to_ours;
use crate::Result;

/// Prims nested deeper are refused.
const DEEPEST: usize = 512;

/// Before all samples.
const FIRST: f64 = f64::MIN;

/// A prim with geometry, and where it is.
pub(super) struct Placed {
    pub(super) prim: Prim,
    pub(super) kind: Kind,
    pub(super) schema: String,
    /// From the prim's coordinates to ours.
    pub(super) matrix: Matrix,
    /// The same before anything moves: where rest positions are.
    pub(super) rest: Matrix,
}

/// The component that a schema becomes.
fn kind_of(schema: &str) -> Option<Kind> {
    match schema {
        "BasisCurves" | "NurbsCurves" => Some(Kind::Curves),
        "Mesh" => Some(Kind::Mesh),
        "Points" => Some(Kind::Points),
        "TetMesh" => Some(Kind::Tets),
        _ => None,
    }
}

/// Geometry that has no component here.
const NOT_READ: [&str; 12] = [
    "PointInstancer",
    "Sphere",
    "Cube",
    "Cylinder",
    "Cylinder_1",
    "Cone",
    "Capsule",
    "Capsule_1",
    "Plane",
    "NurbsPatch",
    "HermiteCurves",
    "Volume",
];

/// When a prim is not seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Hidden {
    Always,
    /// At this time, and perhaps not at others.
    Now,
}

/// A prim whose children are to be visited.
struct Open {
    prim: Prim,
    matrix: Matrix,
    rest: Matrix,
    depth: usize,
}

impl UsdStage {
    /// The prims with geometry at and under the prim at `path`, at a time, in the order of the stage, and whether some are
    /// invisible only at times. What is left out is said in `notes`.
    pub(super) fn placed_prims(&self, path: &str, time: f64, notes: &mut Vec<String>) -> Result<(Vec<Placed>, bool)> {
        let top = to_ours(self.root())?;
        let mut found = Vec::new();
        let mut open = Vec::new();
        let (mut matrix, mut rest) = (top, top);
        let line = self.prim(path)?;
        let last = line.len() - 1;
        for (depth, prim) in line.into_iter().enumerate() {
            if depth > 0 && !self.is_defined(&prim)? {
                return Ok((found, false));
            }
            if let Some(hidden) = (depth > 0).then(|| self.hidden(&prim, time, notes)).transpose()?.flatten() {
                return Ok((found, hidden == Hidden::Now));
            }
            if depth > 0 {
                matrix = self.placed(&prim, &matrix, &top, time)?;
                rest = self.placed(&prim, &rest, &top, FIRST)?;
            }
            if depth == last {
                open.push(Open { prim, matrix, rest, depth });
            }
        }
        let mut hides_some = false;
        while let Some(Open { prim, matrix, rest, depth }) = open.pop() {
            if depth > DEEPEST {
                return Err(refused(
                    &prim.path,
                    format!("lies under more than {DEEPEST} others"),
                    super::stage::FLATTEN,
                ));
            }
            if depth > 0 {
                let schema = self.schema(&prim)?;
                if let Some(kind) = kind_of(&schema) {
                    found.push(Placed { prim: prim.clone(), kind, schema, matrix, rest });
                } else if NOT_READ.contains(&&*schema) {
                    notes.push(format!("`{}` is a {schema}, which is not read", prim.path));
                    continue;
                }
            }
            for child in self.children(&prim)?.into_iter().rev() {
                if !self.is_defined(&child)? {
                    continue;
                }
                if let Some(hidden) = self.hidden(&child, time, notes)? {
                    hides_some |= hidden == Hidden::Now;
                    continue;
                }
                let matrix = self.placed(&child, &matrix, &top, time)?;
                let rest = self.placed(&child, &rest, &top, FIRST)?;
                open.push(Open { prim: child, matrix, rest, depth: depth + 1 });
            }
        }
        Ok((found, hides_some))
    }

    /// Whether and when renderers do not see a prim and what is under it; `None` if they see it.
    fn hidden(&self, prim: &Prim, time: f64, notes: &mut Vec<String>) -> Result<Option<Hidden>> {
        let text = |name: &str| -> Result<Option<String>> {
            let value = self.sampled(prim, name, time)?.value()?;
            Ok(value.as_ref().and_then(Value::text).map(str::to_owned))
        };
        if text("visibility")?.as_deref() == Some("invisible") {
            if self.has_samples(prim, "visibility") {
                notes.push(format!("`{}` is invisible at this time, so it is not read here", prim.path));
                return Ok(Some(Hidden::Now));
            }
            notes.push(format!("`{}` is invisible, so it is not read", prim.path));
            return Ok(Some(Hidden::Always));
        }
        match text("purpose")?.as_deref() {
            Some(purpose @ ("proxy" | "guide")) => {
                notes.push(format!("`{}` is a {purpose}, so it is not read", prim.path));
                Ok(Some(Hidden::Always))
            }
            _ => Ok(None),
        }
    }

    /// Whether an attribute of a prim has time samples, or may have some in clips.
    fn has_samples(&self, prim: &Prim, name: &str) -> bool {
        let of_site = |site: &super::stage::Site| {
            let layer = &self.layers[site.layer].1;
            layer.property(site.node, name).is_some_and(|property| layer.field(property, "timeSamples").is_some())
        };
        prim.clips.is_some() || prim.sites.iter().any(of_site)
    }

    /// Calls `seen` for the samples of each attribute at and under the prim at `path`, and of transforms above it.
    fn each_samples(&self, path: &str, seen: &mut dyn FnMut(&[f64], &[u64])) -> Result<()> {
        let line = self.prim(path)?;
        let last = line.len() - 1;
        let mut open: Vec<(Prim, bool)> = line.into_iter().enumerate().map(|(i, prim)| (prim, i == last)).collect();
        while let Some((prim, is_inside)) = open.pop() {
            for site in &prim.sites {
                let layer = &self.layers[site.layer].1;
                for property in layer.properties(site.node) {
                    let name = layer.name(property);
                    if !is_inside && !name.starts_with("xformOp") && name != "visibility" || name == "extent" {
                        continue;
                    }
                    if let Some(Value::Samples(samples)) = layer.value_of(property, "timeSamples")? {
                        let times: Vec<f64> =
                            samples.times.iter().map(|time| site.offset + site.scale * time).collect();
                        seen(&times, &samples.values);
                    }
                }
            }
            if is_inside {
                for child in self.children(&prim)? {
                    if self.is_defined(&child)? {
                        open.push((child, true));
                    }
                }
            }
        }
        Ok(())
    }

    /// Whether what is read at `prim` may differ from time to time.
    ///
    /// # Errors
    /// If there is no such prim, or the file is damaged.
    pub fn moves(&self, prim: &str) -> Result<bool> {
        if self.has_clips() {
            return Ok(true);
        }
        let mut moves = false;
        self.each_samples(prim, &mut |_, values| moves |= values.windows(2).any(|pair| pair[0] != pair[1]))?;
        Ok(moves)
    }

    /// The first and the last time at which anything at `prim` has a sample; `None` without any. Of clips it is what the stage
    /// says, because only the clip of a time is read.
    ///
    /// # Errors
    /// If there is no such prim, or the file is damaged.
    pub fn span(&self, prim: &str) -> Result<Option<[f64; 2]>> {
        let mut span: Option<[f64; 2]> = None;
        let mut widen = |first: f64, last: f64| {
            span = Some(span.map_or([first, last], |[a, b]| [a.min(first), b.max(last)]));
        };
        self.each_samples(prim, &mut |times, _| {
            // Scaled by less than 0 they descend.
            times.iter().for_each(|time| widen(*time, *time));
        })?;
        self.clip_sets().iter().filter_map(|clips| clips.span()).for_each(|[first, last]| widen(first, last));
        Ok(span)
    }

    /// The times at which anything at `prim` has a sample, ascending.
    ///
    /// # Errors
    /// If there is no such prim, or a file is damaged or missing.
    pub fn times(&self, prim: &str) -> Result<Vec<f64>> {
        let mut bits: BTreeSet<u64> = BTreeSet::new();
        // In this form the order of the bits is that of the numbers.
        let ordered = |time: f64| {
            let bits = (time + 0.0).to_bits();
            if bits >> 63 == 1 { !bits } else { bits | 1 << 63 }
        };
        self.each_samples(prim, &mut |times, _| bits.extend(times.iter().copied().map(ordered)))?;
        for file in self.clip_sets().iter().flat_map(|clips| clips.files()) {
            let layer = self.clip(file)?;
            for node in 0..layer.nodes.len() as u32 {
                if let Some(Value::Samples(samples)) = layer.value_of(node, "timeSamples")? {
                    bits.extend(samples.times.iter().copied().map(ordered));
                }
            }
        }
        let number = |bits: u64| f64::from_bits(if bits >> 63 == 1 { bits & !(1 << 63) } else { !bits });
        Ok(bits.into_iter().map(number).collect())
    }
}
