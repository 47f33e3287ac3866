//! Fluid_Sink: a shape that liquid drains into (R2: "sources and sinks").

use engine::prelude::*;

use crate::shared::attributes::{SINK_ACTIVE, SINK_RATE};

inputs! { INPUTS:
    SHAPE: Input = Input::one("shape", Kind::Mesh, "A closed mesh. It may move.");
}

params! { PARAMS:
    RATE: Param<f32> = Param::float("rate", 0.0,
        "Volume of liquid removed per second, while there is liquid in the shape. 0 removes all that enters, also \
         where an animated rate falls to 0; to stop a sink, animate `active`.")
        .unit(Unit::CubicMetresPerSecond).at_least(0.0).soft(0.0, 0.01);
    ACTIVE: Param<bool> = Param::bool("active", true, "Whether the sink removes liquid.");
}

const SINK: Output = Output::like("sink", &SHAPE, "The shape, with the attributes of a sink.");

pub(crate) static NODE: Node = Node::new(
    "Fluid_Sink",
    1,
    "Turns a closed mesh into a sink for FluidSolve. The sink removes liquid at a rate, or removes all that enters it.",
    Cook::Pure(cook),
)
.inputs(INPUTS)
.params(PARAMS)
.outputs(&[&SINK])
.writes(&[&SINK_RATE, &SINK_ACTIVE]);

fn cook(cx: &Cx) -> Result<Outputs> {
    let mut sink = cx.edit(SHAPE);
    sink.set(SINK_RATE, vec![cx.get(RATE)])?;
    sink.set(SINK_ACTIVE, vec![i32::from(cx.get(ACTIVE))])?;
    Ok(SINK.with(sink))
}

#[cfg(test)]
mod tests {
    use super::*;
    use conformance::{bench, conforms};

    #[test]
    fn rate_and_activity_are_attributes_of_the_mesh() {
        let shape = Component::mesh(vec![3], vec![0, 1, 2], vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]).unwrap();
        let out = bench(&NODE).input(SHAPE, shape).set(RATE, 2e-3).set(ACTIVE, false).cook();
        assert_eq!(out.mesh().get(SINK_RATE), Some(&[2e-3][..]));
        assert_eq!(out.mesh().get(SINK_ACTIVE), Some(&[0][..]));
    }

    #[test]
    fn it_conforms() {
        conforms(&NODE);
    }
}
