//! Value clips: files that each hold the samples of a stretch of time. Read are those that name their files, at the
//! stage's own times, as convect writes them.

use std::sync::Arc;

use super::layer::{Array, Handle, Layer, Value};
use super::sample::{Sampled, Share, Source};
use super::stage::{FLATTEN, Prim, UsdStage, refused};
use crate::Result;

/// Clips of a prim and of all under it.
#[derive(Clone, Debug)]
pub(super) struct Clips {
    /// The prim of the root layer that has them.
    pub(super) node: u32,
    /// Its path in the stage, and the path of the same prim in the clips.
    anchor: String,
    prim: String,
    files: Vec<String>,
    /// From which time on which file is read; times increase.
    active: Vec<(f64, usize)>,
    /// The last time, if the stage says it.
    last: Option<f64>,
}

/// The clips of a prim that has them.
///
/// # Errors
/// If they are of another form.
pub(super) fn of(layer: &Layer, node: u32) -> Result<Clips> {
    let path = format!("…/{}", layer.name(node));
    let other = |fact: &str| refused(&path, fact, FLATTEN);
    let sets = match layer.value_of(node, "clips")? {
        Some(Value::Dictionary(sets)) => sets,
        _ => return Err(other("has value clips that are no dictionary")),
    };
    let [(_, set)] = &sets[..] else { return Err(other("has several sets of value clips, which are not read")) };
    let Value::Dictionary(entries) = layer.value(*set)? else {
        return Err(other("has value clips that are no dictionary"));
    };
    let entry = |name: &str| entries.iter().find(|(key, _)| key == name).map(|(_, handle)| *handle);
    if entry("templateAssetPath").is_some() {
        let hint = "name the files instead: usdstitchclips --out out.usda --clipPath PATH clip.*.usdc";
        return Err(refused(&path, "has value clips by a template, which are not read", hint));
    }
    let files = entry("assetPaths").map(|files| layer.value(files)).transpose()?;
    let prim = entry("primPath").map(|prim| layer.value(prim)).transpose()?;
    let (Some(Value::Texts(files)), Some(Value::Text(prim))) = (files, prim) else {
        return Err(other("has value clips without `assetPaths` or `primPath`"));
    };
    let active = pairs(layer, entry("active"))?;
    let in_order = active.windows(2).all(|pair| pair[0].0 < pair[1].0);
    let of_file = |(time, place): &(f64, f64)| {
        let file = *place as usize;
        (*place >= 0.0 && file < files.len() && time.is_finite()).then_some((*time, file))
    };
    let active: Option<Vec<(f64, usize)>> = active.iter().map(of_file).collect();
    let active = active.filter(|active| in_order && !active.is_empty());
    let active =
        active.ok_or_else(|| other("has value clips whose `active` names no files, or is not in the order of time"))?;
    let times = pairs(layer, entry("times"))?;
    if times.iter().any(|(stage, clip)| stage != clip) {
        return Err(other("has value clips at other times than the stage's, which are not read"));
    }
    let files = files.iter().map(|file| file.to_string()).collect();
    Ok(Clips {
        node,
        anchor: String::new(),
        prim: prim.trim_end_matches('/').to_owned(),
        files,
        active,
        last: times.last().map(|(time, _)| *time),
    })
}

fn pairs(layer: &Layer, handle: Option<Handle>) -> Result<Vec<(f64, f64)>> {
    let Some(handle) = handle else { return Ok(Vec::new()) };
    Ok(match layer.array(handle)? {
        Array::Doubles(numbers, 2) => numbers.as_chunks().0.iter().map(|[a, b]| (*a, *b)).collect(),
        _ => Vec::new(),
    })
}

impl Clips {
    /// The same for the prim at that path of the stage.
    pub(super) fn anchored(&self, path: &str) -> Self {
        Self { anchor: path.to_owned(), ..self.clone() }
    }

    /// The first and the last time, if the stage says it.
    pub(super) fn span(&self) -> Option<[f64; 2]> {
        Some([self.active.first()?.0, self.last?])
    }

    /// Which entry of `active` holds at a time.
    fn place(&self, time: f64) -> usize {
        self.active.partition_point(|(start, _)| *start <= time).saturating_sub(1)
    }

    /// The files of the clips around a time.
    pub(super) fn files_at(&self, time: f64) -> Vec<String> {
        let places = self.active.iter().skip(self.place(time)).take(2);
        places.map(|(_, file)| self.files[*file].clone()).collect()
    }

    /// All files, in the order of time.
    pub(super) fn files(&self) -> impl Iterator<Item = &str> {
        self.active.iter().map(|(_, file)| &*self.files[*file])
    }

    /// Where a prim is in the clips.
    fn path_of(&self, prim: &Prim) -> String {
        format!("{}{}", self.prim, prim.path.strip_prefix(&self.anchor).unwrap_or_default())
    }
}

impl UsdStage {
    /// What clips say of an attribute; `None` if they say nothing.
    pub(super) fn clip_sample(&self, prim: &Prim, name: &str, time: f64) -> Result<Option<Sampled>> {
        let Some(clips) = &prim.clips else { return Ok(None) };
        let path = clips.path_of(prim);
        let in_clip = |place: usize| -> Result<Option<(Arc<Layer>, super::layer::Samples)>> {
            let layer = self.clip(&clips.files[clips.active[place].1])?;
            let attribute = layer.prim_at(&path).and_then(|node| layer.property(node, name));
            let samples = attribute.map(|node| layer.value_of(node, "timeSamples")).transpose()?.flatten();
            Ok(match samples {
                Some(Value::Samples(samples)) if !samples.times.is_empty() => Some((layer, samples)),
                _ => None,
            })
        };
        let place = clips.place(time);
        let Some((layer, samples)) = in_clip(place)? else { return Ok(None) };
        let last = samples.times.len() - 1;
        let next = clips.active.get(place + 1).map(|(start, _)| *start);
        if let Some(start) = next.filter(|start| *start > samples.times[last])
            && time > samples.times[last]
            && let Some((after, later)) = in_clip(place + 1)?
        {
            // Between the last sample of one clip and the start of the next.
            let at = later.times.partition_point(|sample| *sample <= start).saturating_sub(1);
            let lower = Source::new(layer, samples.values[last])?;
            let upper = Source::new(after, later.values[at])?;
            let elapsed = time - samples.times[last];
            let share = Share { share: elapsed / (start - samples.times[last]), elapsed };
            return Ok(Some(Sampled::between(lower, upper, share)));
        }
        Sampled::of(&layer, &samples, time, 1.0).map(Some)
    }
}
