//! Softbody_Pin: animated points that hold what is near them at the start.
//!
//! R1: "we had to constrain the egg white at several points and animate the constraints to encourage the natural draping
//! behaviour". The points are those that come in; how far, how hard and how long they hold is written on them, so that
//! pins of several kinds can be merged. Softbody does the holding: at its start frame each point takes the particles within
//! `pin_radius`, and from then on they move as it does.

use engine::prelude::*;

use crate::shared::attributes::{PIN_RADIUS, PIN_RELEASE, PIN_STRENGTH};

/// Later than any scene ends; f32 holds it exactly.
const NEVER: f32 = 1e9;

inputs! { INPUTS:
    TARGETS: Input = Input::one("targets", Kind::Points, "Animated points. They must stay as many, in the same order.");
}

params! { PARAMS:
    RADIUS: Param<f32> = Param::float("radius", 0.01,
        "How far around a point particles are held, where it is when the simulation starts.")
        .unit(Unit::Metres).at_least(0.0).soft(0.0, 0.1);
    STRENGTH: Param<f32> = Param::float("strength", 0.0,
        "How hard particles are pulled to their places: acceleration by distance. 0 holds them there exactly, whatever \
         pulls the other way.").unit(Unit::PerSecondSquared).at_least(0.0).soft(0.0, 10_000.0);
    RELEASE: Param<f32> = Param::float("release", NEVER,
        "The frame from which they are let go. By default that never comes.").unit(Unit::Frame);
}

const PINS: Output = Output::like("pins", &TARGETS, "The same points, with what they hold.");

/// See the module.
pub static NODE: Node = Node::new(
    "Softbody_Pin",
    1,
    "Makes pins of animated points: what is near one when a soft body starts goes where it goes. Several pins, firm and \
     soft ones, can be merged.",
    Cook::Pure(cook),
)
.inputs(INPUTS)
.params(PARAMS)
.outputs(&[&PINS])
.writes(&[&PIN_RADIUS, &PIN_STRENGTH, &PIN_RELEASE]);

fn cook(cx: &Cx) -> Result<Outputs> {
    let mut pins = cx.part(TARGETS).clone();
    for (attribute, param) in [(PIN_RADIUS, RADIUS), (PIN_STRENGTH, STRENGTH), (PIN_RELEASE, RELEASE)] {
        let everywhere = vec![cx.get(param); pins.point_count()];
        pins.set(attribute, everywhere)?;
    }
    let mut geometry = cx.input(TARGETS).clone();
    geometry.put(pins);
    Ok(PINS.with(geometry))
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
