//! What pins hold: particles near them at the start, where their points go.

use std::sync::Arc;

use bodies::mass_spring::{GoalSpring, Pin};
use engine::prelude::*;

use crate::shared::attributes::{PIN_RADIUS, PIN_RELEASE, PIN_STRENGTH};

/// A particle and the pin that has it.
pub(super) struct Hold {
    particle: u32,
    wire: usize,
    point: usize,
    /// From the pin to the particle at the start, metres.
    offset: [f64; 3],
}

/// What pins hold at the start: each particle goes to the nearest whose radius it is within.
pub(super) fn holds(wires: &[Arc<Geometry>], rest: &[[f64; 3]]) -> Result<Vec<Hold>> {
    let mut nearest: Vec<Option<(f64, Hold)>> = rest.iter().map(|_| None).collect();
    for (wire, geometry) in wires.iter().enumerate() {
        let pins = points(geometry);
        let radii = needed(pins, wire, PIN_RADIUS)?;
        for (point, (place, radius)) in pins.positions().iter().zip(radii).enumerate() {
            for (particle, at) in rest.iter().enumerate() {
                let offset: [f64; 3] = std::array::from_fn(|k| at[k] - f64::from(place[k]));
                let far = offset.iter().map(|x| x * x).sum::<f64>().sqrt();
                if far <= f64::from(*radius) && nearest[particle].as_ref().is_none_or(|(least, _)| far < *least) {
                    nearest[particle] = Some((far, Hold { particle: particle as u32, wire, point, offset }));
                }
            }
        }
    }
    Ok(nearest.into_iter().flatten().map(|(_, hold)| hold).collect())
}

/// Adds what the pins do in a step from the frame `before` to `now`.
pub(super) fn pull(
    held: &[Hold],
    [before, now]: [&[Arc<Geometry>]; 2],
    frame: Frame,
    pins: &mut Vec<Pin>,
    goals: &mut Vec<GoalSpring>,
) -> Result<()> {
    let of = |wires: &[Arc<Geometry>]| -> Result<Vec<[Vec<f32>; 2]>> {
        let each = wires.iter().enumerate().map(|(wire, geometry)| {
            let points = points(geometry);
            Ok([needed(points, wire, PIN_STRENGTH)?.to_vec(), needed(points, wire, PIN_RELEASE)?.to_vec()])
        });
        each.collect()
    };
    let said = of(now)?;
    for hold in held {
        let place = |wires: &[Arc<Geometry>]| -> Result<[f64; 3]> {
            let at =
                wires.get(hold.wire).and_then(|wire| points(wire).positions().get(hold.point)).ok_or_else(|| {
                    Error::refused(format!("`pins` {} no longer has the point {}", hold.wire, hold.point))
                        .hint("pins need as many points, in the same order, at every frame")
                })?;
            Ok(std::array::from_fn(|k| f64::from(at[k]) + hold.offset[k]))
        };
        let between = [place(before)?, place(now)?];
        let [strengths, releases] = &said[hold.wire];
        if frame.number() >= f64::from(releases[hold.point]) {
            continue;
        }
        let strength = f64::from(strengths[hold.point]);
        if strength > 0.0 {
            let damping = super::goals::damping(strength);
            goals.push(GoalSpring { particle: hold.particle, between, strength, damping });
        } else {
            pins.push(Pin { particle: hold.particle, between });
        }
    }
    Ok(())
}

fn points(geometry: &Geometry) -> &Component {
    geometry.points().expect("the engine refuses a wire without points")
}

fn needed(points: &Component, wire: usize, attribute: Attr<f32>) -> Result<&[f32]> {
    points.get(attribute).ok_or_else(|| {
        let name = attribute.name;
        let has = points.describe(name).map_or("which it does not have".into(), |found| format!("which is {found}"));
        Error::refused(format!("`pins` {wire} needs `{name}`, {has}")).hint("make pins of points by Softbody_Pin")
    })
}
