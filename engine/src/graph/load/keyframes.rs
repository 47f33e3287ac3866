//! Keys at frames: `[[frame, value], …]` and how a value runs between them. What the values are is read elsewhere.

use jsonc_parser::common::Ranged;
use numerics::ramp::Interpolation;

use crate::graph::fault::{Fault, code};
use crate::graph::json::{Entry, Json, keep, word};
use crate::time::Frame;

/// Keys as they stand in the file, frames strictly increasing.
pub(super) struct Keys<'a> {
    pub(super) keys: Vec<(f64, Json<'a>)>,
    pub(super) interpolation: Interpolation,
}

/// The word for how values run between keys, of keyframes and ramps.
pub(super) fn interpolation(entry: Option<&Entry<'_>>, faults: &mut Vec<Fault>) -> Option<Interpolation> {
    let Some(entry) = entry else { return Some(Interpolation::Linear) };
    let place = keep(word(&entry.json, "interpolation", &["linear", "smooth", "constant"]), faults)?;
    Some([Interpolation::Linear, Interpolation::Smooth, Interpolation::Constant][place])
}

/// Reads the list of keys; `None` where it has a fault.
pub(super) fn keys<'a>(json: &Json<'a>, between: Option<&Entry<'a>>, faults: &mut Vec<Fault>) -> Option<Keys<'a>> {
    let interpolation = interpolation(between, faults);
    let Some(items) = json.elements() else {
        faults.push(json.unexpected("keys [[frame, value], …]"));
        return None;
    };
    if items.is_empty() {
        let fault = json.fault(code::KEYFRAMES_EMPTY, "there are no keyframes");
        faults.push(fault.hint("write at least one [frame, value]"));
        return None;
    }
    let mut keys: Vec<(f64, Json<'a>)> = Vec::with_capacity(items.len());
    let mut sound = true;
    for (place, item) in items.iter().enumerate() {
        let key = json.item(item, place);
        match key_of(&key).and_then(|(frame, value)| follows(frame, &key, &keys).map(|()| (frame, value))) {
            Ok(key) => keys.push(key),
            Err(fault) => {
                faults.push(fault);
                sound = false;
            }
        }
    }
    Some(Keys { keys, interpolation: interpolation? }).filter(|_| sound)
}

/// Frame and value of a key.
fn key_of<'a>(key: &Json<'a>) -> Result<(f64, Json<'a>), Fault> {
    let Some([frame, value]) = key.elements() else { return Err(key.unexpected("a key [frame, value]")) };
    let at = key.item(frame, 0);
    let frame = at.number("a frame")?;
    if frame.abs() > Frame::LIMIT as f64 {
        let fault = at.fault(code::NUMBER_SIZE, format!("frame {frame} is beyond what convect counts"));
        return Err(fault.hint(format!("expected a frame within ±{}", Frame::LIMIT)));
    }
    Ok((frame, key.item(value, 1)))
}

/// Refuses a frame that is not after those of the keys before.
fn follows(frame: f64, key: &Json<'_>, before: &[(f64, Json<'_>)]) -> Result<(), Fault> {
    match before.last() {
        Some((last, value)) if frame == *last => {
            let line = value.text.place(value.value.start()).line;
            let fault = key.fault(code::KEYFRAMES_DOUBLED, format!("there are two keys at frame {frame}"));
            Err(fault.hint(format!("the first is on line {line}; keep one of them")))
        }
        Some((last, _)) if frame < *last => {
            let fact = format!("the key at frame {frame} stands after the key at frame {last}");
            Err(key.fault(code::KEYFRAMES_UNORDERED, fact).hint("order the keys by frame"))
        }
        _ => Ok(()),
    }
}
