//! Settings of the whole graph: frames, frame rate, seed, origin.

use crate::graph::Scene;
use crate::graph::fault::{Fault, code};
use crate::graph::json::{Json, keep, refuse_unknown};
use crate::time::Frame;

/// Reads `scene`; [`Scene::default`] provides what is missing or has a fault.
pub(super) fn read(json: Option<&Json<'_>>, faults: &mut Vec<Fault>) -> Scene {
    let mut scene = Scene::default();
    let Some(members) = json.map(|json| json.members("an object {\"frames\": [1, 48], \"fps\": 24}", faults)) else {
        return scene;
    };
    let Some(entries) = keep(members, faults) else { return scene };
    refuse_unknown(&entries, &["frames", "fps", "seed", "origin"], "keys of a scene", faults);
    for entry in &entries {
        let json = &entry.json;
        match entry.name {
            "frames" => {
                if let Some([first, last]) = frames(json, faults) {
                    (scene.first, scene.last) = (first, last);
                }
            }
            "fps" => scene.fps = keep(fps(json), faults).unwrap_or(scene.fps),
            "seed" => scene.seed = keep(json.whole("a whole number"), faults).unwrap_or(scene.seed),
            "origin" => scene.origin = origin(json, faults).unwrap_or(scene.origin),
            _ => {}
        }
    }
    scene
}

fn frames(json: &Json<'_>, faults: &mut Vec<Fault>) -> Option<[i64; 2]> {
    const EXPECTED: &str = "two whole frame numbers [first, last]";
    let Some([first, last]) = json.elements() else {
        faults.push(json.unexpected(EXPECTED));
        return None;
    };
    let mut frame = |value, index| {
        let json = json.item(value, index);
        let frame = keep(json.whole("a whole frame number"), faults)?;
        if frame.unsigned_abs() > Frame::LIMIT.unsigned_abs() {
            let fault = json.fault(code::SCENE, format!("frame {frame} is out of range"));
            faults.push(fault.hint(format!("expected a frame within ±{}", Frame::LIMIT)));
            return None;
        }
        Some(frame)
    };
    let (first, last) = (frame(first, 0), frame(last, 1));
    let (first, last) = (first?, last?);
    if first > last {
        let fault = json.fault(code::SCENE, format!("the first frame, {first}, is after the last, {last}"));
        faults.push(fault.hint(format!("write [{last}, {first}]")));
        return None;
    }
    Some([first, last])
}

fn fps(json: &Json<'_>) -> Result<f64, Fault> {
    let fps = json.number("a number of frames per second")?;
    // Outside these limits the duration of a frame overflows.
    const LEAST: f64 = 1e-6;
    const MOST: f64 = 1e6;
    match (LEAST..=MOST).contains(&fps) {
        true => Ok(fps),
        false => {
            let fault = json.fault(code::SCENE, format!("`fps` is {fps}"));
            Err(fault.hint(format!("expected {LEAST}…{MOST} frames per second, such as 24")))
        }
    }
}

fn origin(json: &Json<'_>, faults: &mut Vec<Fault>) -> Option<[f64; 3]> {
    let Some(values @ [_, _, _]) = json.elements() else {
        faults.push(json.unexpected("a vector [x, y, z]"));
        return None;
    };
    let mut origin = [0.0; 3];
    for (index, value) in values.iter().enumerate() {
        origin[index] = keep(json.item(value, index).number("a number"), faults)?;
    }
    Some(origin)
}
