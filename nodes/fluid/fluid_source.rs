//! Fluid_Source: a shape that liquid comes from.
//!
//! R2 directs liquid by "sources and sinks". The shape is the input's mesh; rate, velocity and material become attributes
//! of it, so that they may be animated and several sources merged into one list. FluidSolve does the rest.

use engine::prelude::*;

use crate::shared::attributes::{SOURCE_ACTIVE, SOURCE_DENSITY, SOURCE_RATE, SOURCE_VELOCITY, SOURCE_VISCOSITY};

inputs! { INPUTS:
    SHAPE: Input = Input::one("shape", Kind::Mesh, "A closed mesh. It may move, but is not swept: space that a fast \
        source passes between two substeps gets no liquid. It may also give the shape of the liquid at the start: wire \
        this node to `liquid` of FluidSolve then.");
}

params! { PARAMS:
    RATE: Param<f32> = Param::float("rate", 0.0,
        "Volume of liquid added per second, from the first frame on. 0 keeps the shape full, and `sourced` counts what that adds, also where \
         an animated rate falls to 0; to stop a source, animate `active`. A rate below cross-section · `velocity` leaves the middle of the shape as a thinner \
         stream of that velocity; a higher rate also pushes liquid out around the shape. Where liquid has nowhere to go, as in a sealed \
         box, the source gives less, and a note says so.")
        .unit(Unit::CubicMetresPerSecond).at_least(0.0).soft(0.0, 0.01);
    VELOCITY: Param<Option<[f32; 3]>> = Param::optional_vec3("velocity",
        "Velocity of the liquid inside the shape, as in a nozzle, in m/s. If it is not given, liquid leaves the shape as \
         gravity and pressure move it. Where `rate` at this velocity would give a stream thinner than two cells, the \
         velocity is reduced so that the stream does not break into drops.")
        .unit(Unit::MetresPerSecond);
    VISCOSITY: Param<Option<f32>> = Param::optional_float("viscosity",
        "Dynamic viscosity, in Pa·s, of the liquid from this source, or of the liquid at the start. By default \
            FluidSolve's `viscosity`. Liquids of different viscosity do not mix.")
        .unit(Unit::PascalSeconds).at_least(0.0).soft(0.0, 1e3);
    DENSITY: Param<Option<f32>> = Param::optional_float("density",
        "Mass per volume, in kg/m³, of the liquid from this source, or of the liquid at the start. By default \
            FluidSolve's `density`.")
        .unit(Unit::KilogramsPerCubicMetre).above(0.0).soft(100.0, 3000.0);
    ACTIVE: Param<bool> = Param::bool("active", true, "Whether the source adds liquid. Animate this to start and stop a \
        pour.");
}

const SOURCE: Output = Output::like("source", &SHAPE, "The shape, with the attributes of a source.");

pub(crate) static NODE: Node = Node::new(
    "Fluid_Source",
    1,
    "Turns a closed mesh into a source of liquid for FluidSolve. It adds liquid at a rate, or keeps its shape full; a nozzle \
     also sets the liquid's velocity.",
    Cook::Pure(cook),
)
.inputs(INPUTS)
.params(PARAMS)
.outputs(&[&SOURCE])
.writes(&[&SOURCE_RATE, &SOURCE_ACTIVE, &SOURCE_VELOCITY, &SOURCE_VISCOSITY, &SOURCE_DENSITY]);

fn cook(cx: &Cx) -> Result<Outputs> {
    let mut source = cx.edit(SHAPE);
    source.set(SOURCE_RATE, vec![cx.get(RATE)])?;
    source.set(SOURCE_ACTIVE, vec![i32::from(cx.get(ACTIVE))])?;
    match cx.get(VELOCITY) {
        Some(velocity) => source.set(SOURCE_VELOCITY, vec![velocity])?,
        None => drop(source.remove(SOURCE_VELOCITY.owner, SOURCE_VELOCITY.name)),
    }
    for (attribute, param) in [(SOURCE_VISCOSITY, VISCOSITY), (SOURCE_DENSITY, DENSITY)] {
        match cx.get(param) {
            Some(value) => source.set(attribute, vec![value])?,
            None => drop(source.remove(attribute.owner, attribute.name)),
        }
    }
    Ok(SOURCE.with(source))
}

#[cfg(test)]
mod tests {
    use super::*;
    use conformance::{bench, conforms};

    fn shape() -> Component {
        Component::mesh(vec![3], vec![0, 1, 2], vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]).unwrap()
    }

    #[test]
    fn what_is_not_given_is_left_to_the_solver() {
        let out = bench(&NODE).input(SHAPE, shape()).set(RATE, 0.25).cook();
        let source = out.mesh();
        assert_eq!(source.get(SOURCE_RATE), Some(&[0.25][..]));
        assert_eq!(source.get(SOURCE_ACTIVE), Some(&[1][..]));
        assert_eq!(source.get(SOURCE_VELOCITY), None);
        assert_eq!((source.get(SOURCE_VISCOSITY), source.get(SOURCE_DENSITY)), (None, None));
    }

    #[test]
    fn what_is_given_is_an_attribute_of_the_mesh() {
        let out = bench(&NODE)
            .input(SHAPE, shape())
            .set(VELOCITY, Some([0.0, -1.0, 0.0]))
            .set(VISCOSITY, Some(12.5))
            .set(DENSITY, Some(1400.0))
            .set(ACTIVE, false)
            .cook();
        let source = out.mesh();
        assert_eq!(source.get(SOURCE_VELOCITY), Some(&[[0.0, -1.0, 0.0]][..]));
        assert_eq!(source.get(SOURCE_VISCOSITY), Some(&[12.5][..]));
        assert_eq!(source.get(SOURCE_DENSITY), Some(&[1400.0][..]));
        assert_eq!(source.get(SOURCE_ACTIVE), Some(&[0][..]));
    }

    #[test]
    fn a_source_made_of_a_source_forgets_what_is_no_longer_given() {
        let first = bench(&NODE).input(SHAPE, shape()).set(VISCOSITY, Some(12.5)).cook();
        let out = bench(&NODE).input(SHAPE, first.mesh().clone()).cook();
        assert_eq!(out.mesh().get(SOURCE_VISCOSITY), None);
    }

    #[test]
    fn it_conforms() {
        conforms(&NODE);
    }
}
