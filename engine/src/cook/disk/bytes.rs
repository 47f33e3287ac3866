//! A finished frame as bytes, and back.

use std::sync::Arc;

use super::KeptMetric;
use crate::cook::store::Cooked;
use crate::geometry::{Geometry, Reader};
use crate::key::ContentKey;

/// A geometry and the metrics of what went into it as bytes, every bit of them.
pub(super) fn encode(geometry: &Geometry, metrics: &[KeptMetric]) -> Vec<u8> {
    let mut out = (metrics.len() as u64).to_le_bytes().to_vec();
    for (key, name, value) in metrics {
        out.extend(key.0);
        out.extend((name.len() as u64).to_le_bytes());
        out.extend(name.as_bytes());
        out.extend(value.to_le_bytes());
    }
    out.extend(geometry.to_bytes());
    out
}

/// A result of a node, one geometry per output, and metrics.
pub(super) fn encode_result(cooked: &[Arc<Geometry>], metrics: &[KeptMetric]) -> Vec<u8> {
    let mut out = encode(&Geometry::default(), metrics);
    for geometry in cooked {
        let bytes = geometry.to_bytes();
        out.extend((bytes.len() as u64).to_le_bytes());
        out.extend(bytes);
    }
    out
}

/// What [`encode_result`] has written; `None` where it is anything else.
pub(super) fn decode_result(bytes: &[u8]) -> Option<(Cooked, Vec<KeptMetric>)> {
    let mut reader = Reader(bytes);
    let metrics = metrics(&mut reader)?;
    let mut cooked = Vec::new();
    while !reader.0.is_empty() {
        cooked.push(Arc::new(Geometry::from_bytes(reader.piece()?)?));
    }
    Some((cooked.into(), metrics))
}

/// What [`encode`] has written; `None` where it is anything else.
pub(super) fn decode(bytes: &[u8]) -> Option<(Geometry, Vec<KeptMetric>)> {
    let mut reader = Reader(bytes);
    let metrics = metrics(&mut reader)?;
    Some((Geometry::from_bytes(reader.0)?, metrics))
}

fn metrics(reader: &mut Reader<'_>) -> Option<Vec<KeptMetric>> {
    let mut metrics = Vec::new();
    for _ in 0..reader.count()? {
        let key = ContentKey(reader.take(16)?.try_into().ok()?);
        let name = std::str::from_utf8(reader.piece()?).ok()?.to_owned();
        metrics.push((key, name, f64::from_le_bytes(reader.take(8)?.try_into().ok()?)));
    }
    Some(metrics)
}
