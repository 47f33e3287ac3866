//! Keyframes: `[[frame, value], …]` and their interpolation. The values are read elsewhere.

use jsonc_parser::common::Ranged;
use numerics::ramp::Interpolation;

use crate::graph::fault::{Fault, code};
use crate::graph::json::{Entry, Json, keep, word};
use crate::time::Frame;

/// Keys as in the file, frames strictly increasing.
pub(super) struct Keys<'a> {
    pub(super) keys: Vec<(f64, Json<'a>)>,
    pub(super) interpolation: Interpolation,
}

/// The interpolation of keyframes or of a ramp.
pub(super) fn interpolation(entry: Option<&Entry<'_>>, faults: &mut Vec<Fault>) -> Option<Interpolation> {
    let Some(entry) = entry else { return Some(Interpolation::Linear) };
    let index = keep(word(&entry.json, "interpolation", &["linear", "smooth", "constant"]), faults)?;
    Some([Interpolation::Linear, Interpolation::Smooth, Interpolation::Constant][index])
}

/// Reads the list of keys; `None` after a fault.
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
    let mut valid = true;
    for (index, item) in items.iter().enumerate() {
        let key = json.item(item, index);
        match key_of(&key).and_then(|(frame, value)| check_order(frame, &key, &keys).map(|()| (frame, value))) {
            Ok(key) => keys.push(key),
            Err(fault) => {
                faults.push(fault);
                valid = false;
            }
        }
    }
    Some(Keys { keys, interpolation: interpolation? }).filter(|_| valid)
}

/// Frame and value of a key.
fn key_of<'a>(key: &Json<'a>) -> Result<(f64, Json<'a>), Fault> {
    let Some([frame, value]) = key.elements() else { return Err(key.unexpected("a key [frame, value]")) };
    let at = key.item(frame, 0);
    let frame = at.number("a frame number")?;
    if frame.abs() > Frame::LIMIT as f64 {
        let fault = at.fault(code::NUMBER_SIZE, format!("frame {frame} is out of range"));
        return Err(fault.hint(format!("expected a frame within ±{}", Frame::LIMIT)));
    }
    Ok((frame, key.item(value, 1)))
}

/// Refuses a frame that is not after that of the key before.
fn check_order(frame: f64, key: &Json<'_>, before: &[(f64, Json<'_>)]) -> Result<(), Fault> {
    match before.last() {
        Some((last, value)) if frame == *last => {
            let line = value.text.position(value.value.start()).line;
            let fault = key.fault(code::KEYFRAMES_DOUBLED, format!("there are two keys at frame {frame}"));
            Err(fault.hint(format!("the first is on line {line}; remove one of them")))
        }
        Some((last, _)) if frame < *last => {
            let fact = format!("the key at frame {frame} comes after the key at frame {last}");
            Err(key.fault(code::KEYFRAMES_UNORDERED, fact).hint("order the keys by frame"))
        }
        _ => Ok(()),
    }
}
