//! The value of an attribute at a time: a sample, or two and how far the time is between them.

use std::sync::Arc;

use super::layer::{Array, Handle, Layer, Samples, Value};
use super::stage::{Prim, UsdStage, refused};
use crate::Result;

/// A value of a layer, which is not a block.
#[derive(Clone, Debug)]
pub(super) struct Source {
    layer: Arc<Layer>,
    handle: Handle,
}

impl PartialEq for Source {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.layer, &other.layer) && self.handle == other.handle
    }
}

impl Source {
    /// `None` if the value is a block.
    pub(super) fn new(layer: Arc<Layer>, handle: Handle) -> Result<Option<Self>> {
        let is_block = layer.value(handle)? == Value::Block;
        Ok((!is_block).then_some(Self { layer, handle }))
    }

    pub(super) fn value(&self) -> Result<Value> {
        self.layer.value(self.handle)
    }

    pub(super) fn array(&self) -> Result<Array> {
        self.layer.array(self.handle)
    }
}

/// What an attribute is at a time.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Sampled {
    Nothing,
    At(Source),
    Between { lower: Source, upper: Source, share: Share },
}

/// How far a time is between two samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Share {
    /// Of the way from one to the other: above 0 and below 1.
    pub(super) share: f64,
    /// Time codes of the stage since the first.
    pub(super) elapsed: f64,
}

impl Sampled {
    /// `share` of the way from one value to another. A value before a block is held, and a block before a value too.
    pub(super) fn between(lower: Option<Source>, upper: Option<Source>, share: Share) -> Self {
        match (lower, upper) {
            (None, _) => Self::Nothing,
            (Some(lower), Some(upper)) if share.share > 0.0 && lower != upper => Self::Between { lower, upper, share },
            (Some(lower), _) => Self::At(lower),
        }
    }

    /// The value at a time of the layer, whose time codes are `scale` of the stage's. Before the first sample it is the
    /// first, after the last the last.
    pub(super) fn of(layer: &Arc<Layer>, samples: &Samples, time: f64, scale: f64) -> Result<Self> {
        let Samples { times, values } = samples;
        let after = times.partition_point(|sample| *sample <= time);
        let source = |place: usize| Source::new(layer.clone(), values[place]);
        if after == 0 || after == times.len() {
            return Ok(source(after.saturating_sub(1))?.map_or(Self::Nothing, Self::At));
        }
        let since = time - times[after - 1];
        let share = Share { share: since / (times[after] - times[after - 1]), elapsed: since * scale };
        Ok(Self::between(source(after - 1)?, source(after)?, share))
    }

    /// The value held from the sample before.
    pub(super) fn held(&self) -> Self {
        match self {
            Self::Between { lower, .. } => Self::At(lower.clone()),
            other => other.clone(),
        }
    }

    /// A single value, interpolated.
    pub(super) fn value(&self) -> Result<Option<Value>> {
        match self {
            Self::Nothing => Ok(None),
            Self::At(source) => source.value().map(Some),
            Self::Between { lower, upper, share } => {
                Ok(Some(super::lerp::values(lower.value()?, &upper.value()?, share.share)))
            }
        }
    }

    /// The rows of an array, interpolated.
    pub(super) fn array(&self) -> Result<Option<Array>> {
        match self {
            Self::Nothing => Ok(None),
            Self::At(source) => source.array().map(Some),
            Self::Between { lower, upper, share } => {
                let are_halves = lower.layer.is_half(lower.handle);
                let lower = lower.array()?;
                Ok(Some(match lower {
                    // These are held.
                    Array::I1(_) | Array::I2(_) | Array::I3(_) | Array::I4(_) | Array::Long(_) | Array::Texts(_) => {
                        lower
                    }
                    _ => super::lerp::arrays(lower, &upper.array()?, share.share, are_halves),
                }))
            }
        }
    }
}

impl UsdStage {
    /// What an attribute is at a time. Values of the stage itself come before those of clips, and these before those of
    /// references.
    pub(super) fn sampled(&self, prim: &Prim, name: &str, time: f64) -> Result<Sampled> {
        let mut asked_clips = false;
        for site in &prim.sites {
            if site.is_referenced && !asked_clips {
                asked_clips = true;
                if let Some(found) = self.clip_sample(prim, name, time)? {
                    return Ok(found);
                }
            }
            let layer = &self.layers[site.layer].1;
            let Some(node) = layer.property(site.node, name) else { continue };
            if let Some(Value::Samples(samples)) = layer.value_of(node, "timeSamples")?
                && !samples.times.is_empty()
            {
                return Sampled::of(layer, &samples, (time - site.offset) / site.scale, site.scale);
            }
            if layer.field(node, "spline").is_some() {
                let hint = "bake it to time samples in the program that made it";
                return Err(refused(&prim.path, format!("has a spline for `{name}`, which is not read"), hint));
            }
            if let Some(handle) = layer.field(node, "default") {
                return Ok(Source::new(layer.clone(), handle)?.map_or(Sampled::Nothing, Sampled::At));
            }
        }
        let in_clips = if asked_clips { None } else { self.clip_sample(prim, name, time)? };
        Ok(in_clips.unwrap_or(Sampled::Nothing))
    }

    /// Metadata of an attribute, such as its interpolation.
    pub(super) fn metadata(&self, prim: &Prim, attribute: &str, name: &str) -> Result<Option<Value>> {
        for site in &prim.sites {
            let layer = &self.layers[site.layer].1;
            let Some(node) = layer.property(site.node, attribute) else { continue };
            if let Some(found) = layer.value_of(node, name)? {
                return Ok(Some(found));
            }
        }
        Ok(None)
    }
}
