//! A stage: the prims of a file with what one level of references adds, and what value clips say over time.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, PoisonError};

use super::bytes::Bytes;
use super::clips::{self, Clips};
use super::crate_layer::{self, CONVERT};
use super::layer::{Layer, NodeKind, Reference, Value};
use super::zip::{self, Archive};
use super::{UsdAssets, text};
use crate::error::FilePosition;
use crate::{FormatError, Result};

/// What a stage that is composed otherwise can be turned into.
pub(super) const FLATTEN: &str = "flatten it first: usdcat --flatten -o out.usdc in.usd";

/// Value clips that stay open.
const OPEN_CLIPS: usize = 8;

/// A USD file whose prims can be read at any time.
pub struct UsdStage {
    /// The file's own, and those that it references.
    pub(super) layers: Vec<(String, Arc<Layer>)>,
    assets: Box<dyn UsdAssets>,
    archive: Option<Archive>,
    /// Files of clips, the last used last.
    open: Mutex<Vec<(String, Arc<Layer>)>>,
    clip_sets: Vec<Arc<Clips>>,
    /// What was read last of each prim.
    pub(super) kept: Mutex<super::parts::Kept>,
}

impl std::fmt::Debug for UsdStage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "UsdStage({} layers)", self.layers.len())
    }
}

/// What a layer says of a prim.
#[derive(Clone, Copy, Debug)]
pub(super) struct Site {
    pub(super) layer: usize,
    pub(super) node: u32,
    pub(super) is_referenced: bool,
    /// Time of the stage = offset + scale × time of the layer.
    pub(super) offset: f64,
    pub(super) scale: f64,
}

/// A prim, with what each layer says of it, the strongest first.
#[derive(Clone, Debug)]
pub(super) struct Prim {
    pub(super) path: String,
    pub(super) sites: Vec<Site>,
    pub(super) clips: Option<Arc<Clips>>,
}

/// An error about a prim.
pub(super) fn refused(path: &str, fact: impl std::fmt::Display, hint: &'static str) -> FormatError {
    FormatError::with_hint(FilePosition::File, format!("`{path}` {fact}"), hint)
}

fn layer_of(bytes: Bytes) -> Result<Layer> {
    let start = bytes.get();
    if start.starts_with(crate_layer::MAGIC) {
        crate_layer::layer(bytes)
    } else if start.starts_with(text::MAGIC) {
        text::layer(bytes)
    } else {
        let fact = "it is no USD: it starts neither with `PXR-USDC` nor with `#usda`";
        Err(FormatError::with_hint(FilePosition::Byte(0), fact, CONVERT))
    }
}

impl UsdStage {
    /// The stage of a usdc, usda or usdz file; which, its bytes say. Files that it references are opened at once, those
    /// of its clips when they are read.
    ///
    /// # Errors
    /// If it is damaged, or composed in a way that is not read: by sublayers, or by references of references.
    pub fn open(bytes: Arc<[u8]>, assets: impl UsdAssets + 'static) -> Result<Self> {
        let bytes = Bytes::new(bytes);
        let (root, archive) = match bytes.get().starts_with(zip::MAGIC) {
            true => {
                let archive = Archive::open(&bytes)?;
                let first = archive.first().cloned();
                let empty = || FormatError::at(FilePosition::File, "the archive holds no file");
                (first.ok_or_else(empty)?, Some(archive))
            }
            false => (bytes, None),
        };
        let root = layer_of(root)?;
        if let Some(Value::Texts(layers)) = root.value_of(0, "subLayers")?
            && let Some(first) = layers.first()
        {
            let fact = format!("it has sublayers, which are not read, such as `{first}`");
            return Err(FormatError::with_hint(FilePosition::File, fact, FLATTEN));
        }
        let mut stage = Self {
            layers: vec![(String::new(), Arc::new(root))],
            assets: Box::new(assets),
            archive,
            open: Mutex::default(),
            clip_sets: Vec::new(),
            kept: Mutex::default(),
        };
        for name in stage.referenced()? {
            let layer = Arc::new(stage.asset(&name)?);
            stage.layers.push((name, layer));
        }
        stage.clip_sets = stage.all_clips()?;
        Ok(stage)
    }

    pub(super) fn root(&self) -> &Arc<Layer> {
        &self.layers[0].1
    }

    fn asset(&self, name: &str) -> Result<Layer> {
        let within = |error: FormatError| match error {
            FormatError::Content { position, fact, hint } => FormatError::Content {
                position: FilePosition::File,
                fact: format!("in `{name}`: {position}{fact}"),
                hint,
            },
            other => other,
        };
        let bytes = match &self.archive {
            Some(archive) => archive.get(name).cloned().ok_or_else(|| {
                FormatError::at(FilePosition::File, format!("it references `{name}`, which is not in the archive"))
            })?,
            None => Bytes::new(self.assets.open(name)?),
        };
        layer_of(bytes).map_err(within)
    }

    /// The prims of the root layer that have a field of that name.
    fn with_field<'s>(&'s self, name: &'s str) -> impl Iterator<Item = u32> + 's {
        let root = self.root();
        let is_token = (0..root.tokens.ends.len() as u32).any(|token| root.tokens.get(token) == name);
        let nodes = if is_token { root.nodes.len() as u32 } else { 0 };
        (0..nodes)
            .filter(move |node| root.nodes[*node as usize].kind == NodeKind::Prim && root.field(*node, name).is_some())
    }

    /// The files that the root layer references.
    fn referenced(&self) -> Result<BTreeSet<String>> {
        let mut names = BTreeSet::new();
        for field in ["references", "payload"] {
            for node in self.with_field(field) {
                names.extend(references(self.root(), node, field)?.into_iter().map(|reference| reference.asset));
            }
        }
        names.remove("");
        Ok(names)
    }

    fn all_clips(&self) -> Result<Vec<Arc<Clips>>> {
        let with_clips = self.with_field("clips").collect::<Vec<u32>>().into_iter();
        with_clips.map(|node| clips::of(self.root(), node).map(Arc::new)).collect()
    }

    /// The files besides its own that a value at `time` depends on, by their names in the stage.
    pub fn files_at(&self, time: f64) -> Vec<String> {
        if self.archive.is_some() {
            return Vec::new();
        }
        let mut names: Vec<String> = self.layers[1..].iter().map(|(name, _)| name.clone()).collect();
        names.extend(self.clip_sets.iter().flat_map(|clips| clips.files_at(time)));
        names.sort_unstable();
        names.dedup();
        names
    }

    /// Whether values come from clips, of which only those of a time are opened.
    pub(super) fn has_clips(&self) -> bool {
        !self.clip_sets.is_empty()
    }

    pub(super) fn clip_sets(&self) -> &[Arc<Clips>] {
        &self.clip_sets
    }

    /// The layer of a clip.
    pub(super) fn clip(&self, name: &str) -> Result<Arc<Layer>> {
        let lock = || self.open.lock().unwrap_or_else(PoisonError::into_inner);
        {
            let mut open = lock();
            if let Some(place) = open.iter().position(|(known, _)| known == name) {
                let found = open.remove(place);
                let layer = found.1.clone();
                open.push(found);
                return Ok(layer);
            }
        }
        let layer = Arc::new(self.asset(name)?);
        let mut open = lock();
        if open.len() >= OPEN_CLIPS {
            open.remove(0);
        }
        open.push((name.to_owned(), layer.clone()));
        Ok(layer)
    }

    /// The root above all prims.
    pub(super) fn top(&self) -> Prim {
        let site = Site { layer: 0, node: 0, is_referenced: false, offset: 0.0, scale: 1.0 };
        Prim { path: String::new(), sites: vec![site], clips: None }
    }

    /// The prims under a prim: first those of references.
    pub(super) fn children(&self, prim: &Prim) -> Result<Vec<Prim>> {
        if let [site] = prim.sites[..] {
            let children = self.layers[site.layer].1.children(site.node);
            let own = children.map(|node| self.composed(prim, vec![Site { node, ..site }]));
            return own.collect();
        }
        let mut names: Vec<&str> = Vec::new();
        let mut known = BTreeSet::new();
        for site in prim.sites.iter().rev() {
            let layer = &self.layers[site.layer].1;
            names.extend(layer.children(site.node).map(|child| layer.name(child)).filter(|name| known.insert(*name)));
        }
        names.into_iter().filter_map(|name| self.child(prim, name).transpose()).collect()
    }

    /// The prim of that name under a prim.
    pub(super) fn child(&self, prim: &Prim, name: &str) -> Result<Option<Prim>> {
        let own = |site: &Site| Some(Site { node: self.layers[site.layer].1.child(site.node, name)?, ..*site });
        let sites: Vec<Site> = prim.sites.iter().filter_map(own).collect();
        if sites.is_empty() { Ok(None) } else { self.composed(prim, sites).map(Some) }
    }

    /// A prim under `above`, with what its references add.
    fn composed(&self, above: &Prim, mut sites: Vec<Site>) -> Result<Prim> {
        let name = self.layers[sites[0].layer].1.name(sites[0].node);
        let path = format!("{}/{name}", above.path);
        let mut clips = above.clips.clone();
        let mut place = 0;
        // Those that references add come after their own.
        while let Some(site) = sites.get(place).copied() {
            place += 1;
            let layer = &self.layers[site.layer].1;
            for (field, what) in [
                ("variantSetNames", "variants"),
                ("inheritPaths", "inherited classes"),
                ("inherits", "inherited classes"),
                ("specializes", "specialized classes"),
            ] {
                if layer.field(site.node, field).is_some() {
                    return Err(refused(&path, format!("has {what}, which are not read"), FLATTEN));
                }
            }
            for field in ["references", "payload"] {
                for reference in references(layer, site.node, field)? {
                    if site.is_referenced {
                        return Err(refused(
                            &path,
                            "is referenced and has references itself, which are not read",
                            FLATTEN,
                        ));
                    }
                    sites.push(self.target(&path, &reference)?);
                }
            }
            if layer.field(site.node, "clips").is_some() {
                if site.is_referenced {
                    return Err(refused(&path, "is referenced and has value clips, which are not read", FLATTEN));
                }
                clips =
                    self.clip_sets.iter().find(|set| set.node == site.node).map(|set| Arc::new(set.anchored(&path)));
            }
        }
        Ok(Prim { path, sites, clips })
    }

    /// What a reference leads to.
    fn target(&self, path: &str, reference: &Reference) -> Result<Site> {
        let Reference { asset, prim, offset, scale } = reference;
        let layer = self.layers.iter().position(|(name, _)| name == asset).unwrap_or(0);
        let there = &self.layers[layer].1;
        let prim = match &**prim {
            "" => there.value_of(0, "defaultPrim")?.and_then(|name| name.text().map(str::to_owned)).unwrap_or_default(),
            prim => prim.to_owned(),
        };
        let node = there.prim_at(&prim).filter(|node| *node != 0);
        let Some(node) = node else {
            let fact = format!("references the prim `{prim}` of `{asset}`, which does not exist");
            return Err(refused(path, fact, "name a prim of the file, or set its defaultPrim"));
        };
        if !(scale.is_finite() && offset.is_finite() && *scale != 0.0) {
            return Err(refused(path, "has a reference with an invalid offset or scale of time", FLATTEN));
        }
        // Layers of another rate are scaled to that of the stage.
        let scale = scale * rate(self.root())? / rate(there)?;
        Ok(Site { layer, node, is_referenced: true, offset: *offset, scale })
    }

    /// The prim at a path; an empty path is the whole stage.
    ///
    /// # Errors
    /// If there is none.
    pub(super) fn prim(&self, path: &str) -> Result<Vec<Prim>> {
        let mut line = vec![self.top()];
        for name in path.split('/').filter(|name| !name.is_empty()) {
            let above = &line[line.len() - 1];
            let Some(child) = self.child(above, name)? else {
                let there = self.children(above)?;
                let there: Vec<String> = there.iter().take(8).map(|prim| format!("`{}`", prim.path)).collect();
                let there = if there.is_empty() { "nothing".into() } else { there.join(", ") };
                let above = if above.path.is_empty() { "/" } else { &above.path };
                let fact = format!("it has no prim `{path}`; under `{above}` there is {there}");
                return Err(FormatError::at(FilePosition::File, fact));
            };
            line.push(child);
        }
        Ok(line)
    }

    /// The strongest value of a field.
    pub(super) fn field(&self, prim: &Prim, name: &str) -> Result<Option<Value>> {
        let found = prim.sites.iter().find_map(|site| {
            let layer = &self.layers[site.layer].1;
            layer.field(site.node, name).map(|handle| layer.value(handle))
        });
        found.transpose()
    }

    /// Whether a prim is defined, and not switched off.
    pub(super) fn is_defined(&self, prim: &Prim) -> Result<bool> {
        let mut is_defined = false;
        for site in &prim.sites {
            match self.layers[site.layer].1.value_of(site.node, "specifier")? {
                None | Some(Value::Int(0)) => is_defined = true,
                Some(Value::Int(2)) if !site.is_referenced => return Ok(false),
                Some(Value::Text(word)) if &*word == "class" && !site.is_referenced => return Ok(false),
                // What is referenced may be a class.
                Some(Value::Int(2)) => is_defined = true,
                Some(Value::Text(word)) if &*word == "class" => is_defined = true,
                Some(_) => {}
            }
        }
        Ok(is_defined && !matches!(self.field(prim, "active")?, Some(Value::Int(0))))
    }

    /// The name of its schema.
    pub(super) fn schema(&self, prim: &Prim) -> Result<String> {
        let name = self.field(prim, "typeName")?;
        Ok(name.as_ref().and_then(Value::text).unwrap_or_default().to_owned())
    }
}

/// Time codes a second of a layer.
pub(super) fn rate(layer: &Layer) -> Result<f64> {
    for name in ["timeCodesPerSecond", "framesPerSecond"] {
        let rate = layer.value_of(0, name)?.and_then(|rate| rate.number());
        if let Some(rate) = rate.filter(|rate| rate.is_finite() && *rate > 0.0) {
            return Ok(rate);
        }
    }
    Ok(24.0)
}

fn references(layer: &Layer, node: u32, field: &str) -> Result<Vec<Reference>> {
    match layer.value_of(node, field)? {
        Some(Value::References(all)) => Ok(all),
        _ => Ok(Vec::new()),
    }
}
