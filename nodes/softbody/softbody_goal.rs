//! Softbody_Goal: a shape that a body shall take, its inside included.
//!
//! R1: "we only directed the internal particles of the dough to match the 'internal' goal shapes. This made the surface
//! move freely … and respond to collisions". R does not say where internal goal shapes come from. Here an artist shapes
//! the surface, and its inside follows as the static equilibrium of an elastic body whose surface is held there
//! ([`bodies::goals`]): the cotangent Laplacian of the tets, which turns, stretches and shears the inside exactly as an
//! affine change of the surface does. Springs would leave a grain of their own in it.
//!
//! The shape has the points of the body's surface, in their order: the surface that comes out of Tetrahedralize, moved by
//! Lattice_Deform or modelled. Where a body brings its surface along, faces are compared too; else points are counted.

use bodies::goals::{GoalLimits, GoalShape, HeldBody, goal_shape};
use engine::prelude::*;

use crate::shared::attributes::{GOAL_FRAME, GOAL_HOLD, GOAL_STRENGTH, SURFACE_POINT};

inputs! { INPUTS:
    BODY: Input = Input::one("body", Kind::Tets,
        "The body at rest, as Tetrahedralize makes it; its `surface_point` tells which points are on the surface.");
    SHAPE: Input = Input::one("shape", Kind::Mesh,
        "Where the surface belongs: the mesh that came out of Tetrahedralize beside the tets, with other places and the \
         same faces.");
}

params! { PARAMS:
    FRAME: Param<f32> = Param::float("frame", 1.0,
        "The frame at which the body shall have the shape. Between the goals of a body it heads from one to the next.")
        .unit(Unit::Frame).fixed();
    STRENGTH: Param<f32> = Param::float("strength", 100.0,
        "How hard the body is pulled there: acceleration by distance. 0 does not pull; some 200 times stiffness ÷ (density · \
         size²) brings it within a hundredth of its size: 4e4 for dough of 5e3 Pa and 0.16 m, 1e3 for a metre of it.")
        .unit(Unit::PerSecondSquared).at_least(0.0).soft(0.0, 1e5);
    HOLD: Param<f32> = Param::float("hold", 0.0,
        "How long the body is held there before it heads for the next goal, or is let go.")
        .unit(Unit::Frames).at_least(0.0).soft(0.0, 48.0);
}

const GOAL: Output = Output::new("goal", &[Kind::Tets], "The body in the shape, with what the goal asks for.");

const INVERTED: Metric = Metric::new(
    "inverted_tets",
    Unit::None,
    "Tets that the shape turns inside out or presses flat: the surface crosses itself, or bends too sharply.",
);
const VOLUME_RATIO: Metric =
    Metric::new("volume_ratio", Unit::None, "Volume of the body in the shape, as a share of its own.");
const CG: Metric = Metric::new("cg", Unit::None, "Steps of conjugate gradients that found the inside.");
const RESIDUAL: Metric =
    Metric::new("residual", Unit::None, "Force that is left on points inside, as a share of what the surface exerts.");
const LOOSE: Metric = Metric::new(
    "loose_points",
    Unit::None,
    "Points that no surface holds, themselves or through tets: they stay where they are.",
);

/// See the module.
pub static NODE: Node = Node::new(
    "Softbody_Goal",
    1,
    "Makes a goal of a shape for the surface of a soft body: the inside is brought along as if it were elastic. Give it to \
     Softbody to be in that shape at a frame. The body and the shape need the same points and faces.",
    Cook::Pure(cook),
)
.inputs(INPUTS)
.params(PARAMS)
.outputs(&[&GOAL])
.reads(&[&P, &SURFACE_POINT])
.writes(&[&P, &GOAL_FRAME, &GOAL_STRENGTH, &GOAL_HOLD])
.metrics(&[&INVERTED, &VOLUME_RATIO, &CG, &RESIDUAL, &LOOSE]);

fn cook(cx: &Cx) -> Result<Outputs> {
    let (body, shape) = (cx.part(BODY), cx.part(SHAPE));
    let rows = surface(body, cx.input(BODY).mesh(), shape)?;
    cx.check_cancelled()?;
    let held = HeldBody { points: body.positions(), tets: body.tet_corners(), rows, shape: shape.positions() };
    // Keyed strengths ask again every frame.
    let found = body.kept(Asked::of(body, shape), || Ok(goal_shape(&held, GoalLimits::default())))?;
    publish(cx, &found);
    let mut out = body.clone();
    out.set(P, found.points.clone())?;
    out.set(GOAL_FRAME, vec![cx.get(FRAME)])?;
    out.set(GOAL_STRENGTH, vec![cx.get(STRENGTH)])?;
    out.set(GOAL_HOLD, vec![cx.get(HOLD)])?;
    Ok(GOAL.with(Geometry::from(out)))
}

/// The row of `shape` that each point of the body is brought to; below 0 inside.
///
/// # Errors
/// Where the body does not say, or `shape` is not its surface.
fn surface<'a>(body: &'a Component, along: Option<&Component>, shape: &Component) -> Result<&'a [i32]> {
    let name = SURFACE_POINT.name;
    let Some(rows) = body.get(SURFACE_POINT) else {
        let has = body.describe(name).map_or("which it does not have".into(), |found| format!("which is {found}"));
        return Err(Error::refused(format!("`body` needs `{name}`, {has}"))
            .hint("take the tets that come out of Tetrahedralize: they know which points are on the surface"));
    };
    let held = rows.iter().max().and_then(|row| usize::try_from(*row).ok()).map_or(0, |row| row + 1);
    let counted = |mesh: &Component| format!("{} faces and {} points", mesh.element_count(), mesh.point_count());
    let fact = match along {
        Some(along) if along.topology() != shape.topology() || along.point_count() != shape.point_count() => {
            let (shape, own) = (counted(shape), counted(along));
            format!("`shape` has {shape}, the surface of `body` {own}, or they are joined otherwise")
        }
        Some(along) if held > along.point_count() => {
            format!("`{name}` of `body` goes up to {}, and its surface has {} points", held - 1, along.point_count())
        }
        None if held != shape.point_count() => {
            format!("`shape` has {} points, the surface of `body` {held}", shape.point_count())
        }
        _ if held == 0 && body.point_count() > 0 => {
            format!("`{name}` of `body` is below 0 everywhere: it has no surface")
        }
        _ => return Ok(rows),
    };
    Err(Error::refused(fact).hint(
        "move the points of the mesh that comes out of Tetrahedralize beside the tets: where the surface was repaired, \
         it is not the one that went in, and one that was mirrored has its faces turned round",
    ))
}

/// What a goal's points hang on besides the body's places and tets. Columns are the very same arrays, which it keeps
/// alive: no other can come to lie at their address.
struct Asked {
    rows: Option<Column>,
    shape: Option<Column>,
}

impl Asked {
    fn of(body: &Component, shape: &Component) -> Self {
        let column = |part: &Component, name| part.table(Owner::Point).column(name).cloned();
        Self { rows: column(body, SURFACE_POINT.name), shape: column(shape, P.name) }
    }
}

impl PartialEq for Asked {
    fn eq(&self, other: &Self) -> bool {
        let same = |a: &Option<Column>, b: &Option<Column>| a.as_ref().zip(b.as_ref()).is_some_and(|(a, b)| a.same(b));
        same(&self.rows, &other.rows) && same(&self.shape, &other.shape)
    }
}

fn publish(cx: &Cx, found: &GoalShape) {
    cx.publish(INVERTED, found.inverted as f64);
    cx.publish(CG, found.steps as f64);
    cx.publish(RESIDUAL, found.residual);
    cx.publish(LOOSE, found.loose as f64);
    if let Some(ratio) = found.volume_ratio.filter(|ratio| ratio.is_finite()) {
        cx.publish(VOLUME_RATIO, ratio);
    }
}

#[cfg(test)]
mod tests;
