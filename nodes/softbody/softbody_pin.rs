//! Softbody_Pin: animated points that hold the particles near them.
//!
//! R1: "we had to constrain the egg white at several points and animate the constraints to encourage the natural
//! draping behaviour". The points are the input's; radius, strength and release frame become attributes on them, so
//! that different pins can be merged. Softbody does the rest: at its start frame each point is assigned the particles
//! within `pin_radius`, which move with it from then on.

use engine::prelude::*;

use crate::shared::attributes::{PIN_RADIUS, PIN_RELEASE, PIN_STRENGTH};

/// Later than the end of any scene, and exact in f32.
const NEVER: f32 = 1e9;

inputs! { INPUTS:
    TARGETS: Input = Input::one("targets", Kind::Points, "Animated points. Their number and order must not change.");
}

params! { PARAMS:
    RADIUS: Param<f32> = Param::float("radius", 0.01,
        "Particles within this distance of a point when the simulation starts are held by it.")
        .unit(Unit::Metres).at_least(0.0).soft(0.0, 0.1);
    STRENGTH: Param<f32> = Param::float("strength", 0.0,
        "How strongly particles are pulled to their positions relative to the pin: acceleration per distance; higher \
         values follow more closely. 0 holds them exactly, against any force.")
        .unit(Unit::PerSecondSquared).at_least(0.0).soft(0.0, 10_000.0);
    RELEASE: Param<f32> = Param::float("release", NEVER,
        "The frame from which on particles are free. By default they are never released.").unit(Unit::Frame);
}

const PINS: Output = Output::like("pins", &TARGETS, "The points, with the attributes of pins.");

pub(crate) static NODE: Node = Node::new(
    "Softbody_Pin",
    1,
    "Turns animated points into pins: particles that are near a pin when the simulation starts move with it. Pins with \
     different settings, such as rigid and soft ones, can be merged.",
    Cook::Pure(cook),
)
.inputs(INPUTS)
.params(PARAMS)
.outputs(&[&PINS])
.writes(&[&PIN_RADIUS, &PIN_STRENGTH, &PIN_RELEASE]);

fn cook(cx: &Cx) -> Result<Outputs> {
    let mut pins = cx.edit(TARGETS);
    for (attribute, param) in [(PIN_RADIUS, RADIUS), (PIN_STRENGTH, STRENGTH), (PIN_RELEASE, RELEASE)] {
        let everywhere = vec![cx.get(param); pins.point_count()];
        pins.set(attribute, everywhere)?;
    }
    Ok(PINS.with(pins))
}

#[cfg(test)]
mod tests {
    use super::*;
    use conformance::{bench, conforms};

    #[test]
    fn every_point_becomes_a_pin_at_its_position() {
        let points = Component::points(vec![[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
        let out = bench(&NODE).input(TARGETS, points.clone()).set(RADIUS, 0.25).set(RELEASE, 24.0).cook();
        let pins = out.part(Kind::Points);
        assert_eq!(pins.get(PIN_RADIUS), Some(&[0.25; 2][..]));
        assert_eq!(pins.get(PIN_STRENGTH), Some(&[0.0; 2][..]));
        assert_eq!(pins.get(PIN_RELEASE), Some(&[24.0; 2][..]));
        let places = |part: &Component| part.table(Owner::Point).column("P").unwrap().address();
        assert_eq!(places(pins), places(&points), "places are shared");
    }

    #[test]
    fn by_default_pins_hold_exactly_and_for_ever() {
        let out = bench(&NODE).input(TARGETS, Component::points(vec![[0.0; 3]])).cook();
        let pins = out.part(Kind::Points);
        assert_eq!(pins.get(PIN_STRENGTH), Some(&[0.0][..]));
        assert_eq!(pins.get(PIN_RELEASE), Some(&[1_000_000_000.0][..]));
    }

    #[test]
    fn other_components_pass_through() {
        let mesh = Component::mesh(vec![3], vec![0, 1, 2], vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]).unwrap();
        let out = bench(&NODE).input(TARGETS, Geometry::from(Component::points(vec![])).with(mesh)).cook();
        assert_eq!((out.part(Kind::Points).point_count(), out.mesh().point_count()), (0, 3));
    }

    #[test]
    fn it_conforms() {
        conforms(&NODE);
    }
}
