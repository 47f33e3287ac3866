//! Pins: the particles bound to them at the start, and the springs and constraints of a step.

use std::sync::Arc;

use bodies::mass_spring::{GoalSpring, Pin};
use engine::prelude::*;
use numerics::vector::{DVec3, to_f64};

use crate::shared::attributes::{PIN_RADIUS, PIN_RELEASE, PIN_STRENGTH};

/// A particle bound to a pin.
pub(super) struct PinBinding {
    particle: u32,
    wire: usize,
    point: usize,
    /// From the pin to the particle at the start, metres.
    offset: DVec3,
}

/// The pins at the start.
#[derive(Default)]
pub(super) struct BoundPins {
    pub(super) bindings: Vec<PinBinding>,
    /// Wire and point of each pin with no particle within its radius.
    pub(super) idle: Vec<[usize; 2]>,
}

/// Binds each particle to the nearest pin within whose radius it lies at the start.
pub(super) fn bind_pins(wires: &[Arc<Geometry>], rest: &[[f64; 3]]) -> Result<BoundPins> {
    let mut nearest: Vec<Option<(f64, PinBinding)>> = rest.iter().map(|_| None).collect();
    let mut idle = Vec::new();
    for (wire, geometry) in wires.iter().enumerate() {
        let pins = geometry.require(Kind::Points)?;
        let radii = needed(pins, wire, PIN_RADIUS)?;
        for (point, (pin, radius)) in pins.positions().iter().zip(radii).enumerate() {
            let mut reaches = false;
            for (particle, at) in rest.iter().enumerate() {
                let offset = DVec3::from(*at) - to_f64(*pin);
                let distance = offset.norm();
                if distance > f64::from(*radius) {
                    continue;
                }
                reaches = true;
                if nearest[particle].as_ref().is_none_or(|(least, _)| distance < *least) {
                    nearest[particle] = Some((distance, PinBinding { particle: particle as u32, wire, point, offset }));
                }
            }
            if !reaches {
                idle.push([wire, point]);
            }
        }
    }
    Ok(BoundPins { bindings: nearest.into_iter().flatten().map(|(_, binding)| binding).collect(), idle })
}

/// Adds the constraints and springs of a step from the frame `before` to `now`.
pub(super) fn pull(
    bindings: &[PinBinding],
    [before, now]: [&[Arc<Geometry>]; 2],
    frame: Frame,
    pins: &mut Vec<Pin>,
    goals: &mut Vec<GoalSpring>,
) -> Result<()> {
    let of = |wires: &[Arc<Geometry>]| -> Result<Vec<[Vec<f32>; 2]>> {
        let each = wires.iter().enumerate().map(|(wire, geometry)| {
            let points = geometry.require(Kind::Points)?;
            Ok([needed(points, wire, PIN_STRENGTH)?.to_vec(), needed(points, wire, PIN_RELEASE)?.to_vec()])
        });
        each.collect()
    };
    let settings = of(now)?;
    for binding in bindings {
        let place = |wires: &[Arc<Geometry>]| -> Result<[f64; 3]> {
            let points = wires.get(binding.wire).and_then(|wire| wire.points());
            let at = points.and_then(|points| points.positions().get(binding.point)).ok_or_else(|| {
                Error::refused(format!("`pins` {} no longer has the point {}", binding.wire, binding.point))
                    .hint("pins need as many points, in the same order, at every frame")
            })?;
            Ok((to_f64(*at) + binding.offset).into())
        };
        let between = [place(before)?, place(now)?];
        let [strengths, releases] = &settings[binding.wire];
        if frame.number() >= f64::from(releases[binding.point]) {
            continue;
        }
        let strength = f64::from(strengths[binding.point]);
        if strength > 0.0 {
            let damping = super::goals::damping(strength);
            goals.push(GoalSpring { particle: binding.particle, between, strength, damping });
        } else {
            pins.push(Pin { particle: binding.particle, between });
        }
    }
    Ok(())
}

fn needed(points: &Component, wire: usize, attribute: Attr<f32>) -> Result<&[f32]> {
    points.get(attribute).ok_or_else(|| {
        let name = attribute.name;
        let has = points.describe(name).map_or("which it does not have".into(), |found| format!("which is {found}"));
        Error::refused(format!("`pins` {wire} needs `{name}`, {has}")).hint("make pins from points with Softbody_Pin")
    })
}
