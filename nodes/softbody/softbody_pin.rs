//! Softbody_Pin: animated points that hold the particles near them.
//!
//! R1: "we had to constrain the egg white at several points and animate the constraints to encourage the natural
//! draping behaviour". The points are the input's; radius, strength and release frame become attributes on them, so
//! that different pins can be merged. Softbody does the rest: at its start frame each point is assigned the particles
//! within `pin_radius`, which move with it from then on.

use engine::prelude::*;

use crate::shared::attributes::{PIN_RADIUS, PIN_RELEASE, PIN_STRENGTH};

/// Later than any scene ends; f32 holds it exactly.
const NEVER: f32 = 1e9;

inputs! { INPUTS:
    TARGETS: Input = Input::one("targets", Kind::Points, "Animated points. Their number and order must not change.");
}

params! { PARAMS:
    RADIUS: Param<f32> = Param::float("radius", 0.01,
        "Distance from a point within which particles are held, measured when the simulation starts.")
        .unit(Unit::Metres).at_least(0.0).soft(0.0, 0.1);
    STRENGTH: Param<f32> = Param::float("strength", 0.0,
        "How strongly particles are pulled to their positions: acceleration per distance. 0 holds them exactly, \
         against any force.").unit(Unit::PerSecondSquared).at_least(0.0).soft(0.0, 10_000.0);
    RELEASE: Param<f32> = Param::float("release", NEVER,
        "The frame from which particles are released. The default is never reached.").unit(Unit::Frame);
}

const PINS: Output = Output::like("pins", &TARGETS, "The points, with the attributes of pins.");

pub(crate) static NODE: Node = Node::new(
    "Softbody_Pin",
    1,
    "Turns animated points into pins: the particles near one when a simulation starts move with it. Different pins, \
     rigid and soft ones, can be merged.",
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
    fn every_point_is_a_pin_and_stays_where_it_is() {
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
    fn pins_hold_exactly_and_for_ever_unless_told() {
        let out = bench(&NODE).input(TARGETS, Component::points(vec![[0.0; 3]])).cook();
        let pins = out.part(Kind::Points);
        assert_eq!(pins.get(PIN_STRENGTH), Some(&[0.0][..]));
        assert_eq!(pins.get(PIN_RELEASE), Some(&[1_000_000_000.0][..]));
    }

    #[test]
    fn what_comes_along_goes_through() {
        let mesh = Component::mesh(vec![3], vec![0, 1, 2], vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]).unwrap();
        let out = bench(&NODE).input(TARGETS, Geometry::from(Component::points(vec![])).with(mesh)).cook();
        assert_eq!((out.part(Kind::Points).point_count(), out.mesh().point_count()), (0, 3));
    }

    #[test]
    fn it_conforms() {
        conforms(&NODE);
    }
}
