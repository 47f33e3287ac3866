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

/// A prim whose children are to be visited.
struct Open {
    prim: Prim,
    matrix: Matrix,
    rest: Matrix,
    depth: usize,
}

impl UsdStage {
    /// The prims with geometry at and under the prim at `path`, at a time, in the order of the stage. What is left out is
    /// said in `notes`.
    pub(super) fn placed_prims(&self, path: &str, time: f64, notes: &mut Vec<String>) -> Result<Vec<Placed>> {
        let top = to_ours(self.root())?;
        let mut found = Vec::new();
        let mut open = Vec::new();
        let (mut matrix, mut rest) = (top, top);
        let line = self.prim(path)?;
        let last = line.len() - 1;
        for (depth, prim) in line.into_iter().enumerate() {
            if depth > 0 && (!self.is_defined(&prim)? || self.is_hidden(&prim, time, notes)?) {
                return Ok(found);
            }
            if depth > 0 {
                matrix = self.placed(&prim, &matrix, &top, time)?;
                rest = self.placed(&prim, &rest, &top, FIRST)?;
            }
            if depth == last {
                open.push(Open { prim, matrix, rest, depth });
            }
        }
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
                if self.is_defined(&child)? && !self.is_hidden(&child, time, notes)? {
                    let matrix = self.placed(&child, &matrix, &top, time)?;
                    let rest = self.placed(&child, &rest, &top, FIRST)?;
                    open.push(Open { prim: child, matrix, rest, depth: depth + 1 });
                }
            }
        }
        Ok(found)
    }

    /// Whether renderers do not see a prim and what is under it.
    fn is_hidden(&self, prim: &Prim, time: f64, notes: &mut Vec<String>) -> Result<bool> {
        let text = |name: &str| -> Result<Option<String>> {
            let value = self.sampled(prim, name, time)?.value()?;
            Ok(value.as_ref().and_then(Value::text).map(str::to_owned))
        };
        if text("visibility")?.as_deref() == Some("invisible") {
            notes.push(format!("`{}` is invisible, so it is not read", prim.path));
            return Ok(true);
        }
        match text("purpose")?.as_deref() {
            Some(purpose @ ("proxy" | "guide")) => {
                notes.push(format!("`{}` is a {purpose}, so it is not read", prim.path));
                Ok(true)
            }
            _ => Ok(false),
        }
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
