//! Softbody_Goal: a target shape of a soft body, interior included.
//!
//! R1: "we only directed the internal particles of the dough to match the 'internal' goal shapes. This made the surface
//! move freely … and respond to collisions". R does not say where internal goal shapes come from. Here an artist shapes
//! the surface, and the interior follows as the static equilibrium of an elastic body with that surface
//! ([`bodies::goals`]): the cotangent Laplacian of the tets, which reproduces affine deformations of the surface
//! exactly. The network of springs would not.
//!
//! The shape has the points of the body's surface, in their order: the surface mesh from Tetrahedralize, deformed by
//! Lattice_Deform or by hand. If the body comes with its surface mesh, faces are compared too, otherwise the number of
//! points.

use bodies::goals::{GoalLimits, GoalShape, HeldBody, goal_shape};
use engine::prelude::*;

use crate::shared::attributes::{ALWAYS, GOAL_FRAME, GOAL_HOLD, GOAL_SHARE, GOAL_START, GOAL_STRENGTH, SURFACE_POINT};

inputs! { INPUTS:
    BODY: Input = Input::one("body", Kind::Tets,
        "The body at rest, from Tetrahedralize. Its `surface_point` says which points are on the surface.");
    SHAPE: Input = Input::one("shape", Kind::Mesh,
        "The target shape of the surface: the surface mesh from Tetrahedralize with other positions and the same \
         faces.");
}

params! { PARAMS:
    FRAME: Param<f32> = Param::float("frame", 1.0,
        "The frame at which the body reaches the shape. Between two goals it moves gradually from one to the next.")
        .unit(Unit::Frame).fixed();
    START_FRAME: Param<f32> = Param::float("start_frame", ALWAYS,
        "The frame at which the goal starts to pull. Until then the body is free; from then on it moves gradually to \
         the shape from wherever it is, to reach it at `frame`. By default a goal pulls from the start of the \
         simulation, or once the hold of the goal before it is over.")
        .unit(Unit::Frame).fixed();
    STRENGTH: Param<Maskable> = Param::maskable("strength", 100.0,
        "How strongly the body is pulled towards the shape: acceleration per distance. 0 does not pull. About 200 · \
         stiffness ÷ (density · size²) brings the body to within 1 % of its size: 4e4 for dough of 5e3 Pa that is 0.16 \
         m across, 1e3 if it is 1 m across. A mask on the points of `body` directs a part of it: where it is 0, \
         particles are free.")
        .unit(Unit::PerSecondSquared).at_least(0.0).soft(0.0, 1e5);
    HOLD: Param<f32> = Param::float("hold", 0.0,
        "How long the body is held in the shape before it moves on to the next goal or is released.")
        .unit(Unit::Frames).at_least(0.0).soft(0.0, 48.0);
}

const GOAL: Output =
    Output::new("goal", &[Kind::Tets], "The body in the target shape, with the attributes of the goal.");

metrics! { METRICS:
    INVERTED = Metric::new("inverted_tets", Unit::None,
        "Tets that are flat or inside out in the goal, because its surface crosses itself or bends too sharply.")
        .warn_above(0.0, "The shape cannot be reached without turning parts of the body inside out. Look for places \
            where its surface crosses itself or bends sharply, and smooth them.");
    VOLUME_RATIO = Metric::new("volume_ratio", Unit::None, "Volume of the body in the shape, relative to its own.");
    IDLE = Metric::new("idle", Unit::None, "1 where `strength` is 0 everywhere, so that the goal does not pull; 0 elsewhere.")
        .warn_always_above(0.0, "With a `strength` of 0 the body is not pulled towards this shape. Raise `strength`, or \
            remove the goal.");
    LATE = Metric::new("late_start", Unit::None, "1 where `start_frame` is not before `frame`; 0 elsewhere.")
        .warn_above(0.0, "The goal starts to pull only when the body should already have its shape, so the body is \
            pulled there at once, or not at all where `hold` is over by then. Set `start_frame` before `frame`.");
    CG = Metric::new("cg", Unit::None, "Iterations of conjugate gradients in the solve for the interior.");
    RESIDUAL = Metric::new("residual", Unit::None,
        "Force left on inner points after the solve, relative to the force exerted by the surface.");
    LOOSE = Metric::new("loose_points", Unit::None,
        "Points that are not connected to the surface: they keep their positions.")
        .warn_above(0.0, "These points are not connected to the surface by tets, so the shape cannot move them. Remove \
            them, or connect them.");
}

pub(crate) static NODE: Node = Node::new(
    "Softbody_Goal",
    2,
    "Turns a target shape of a body's surface into a goal for the whole body: the interior follows as if it were \
     elastic. Wire it into `goals` of Softbody, and the body reaches the shape at the frame set here. The shape must \
     have the points and faces of the body's surface.",
    Cook::Pure(cook),
)
.inputs(INPUTS)
.params(PARAMS)
.outputs(&[&GOAL])
.reads(&[&P, &SURFACE_POINT])
.writes(&[&P, &GOAL_FRAME, &GOAL_START, &GOAL_STRENGTH, &GOAL_SHARE, &GOAL_HOLD])
.metrics(METRICS);

fn cook(cx: &Cx) -> Result<Outputs> {
    let (body, shape) = (cx.part(BODY), cx.part(SHAPE));
    let strength = cx.mask(STRENGTH, body)?;
    let rows = surface(body, cx.input(BODY).mesh(), shape)?;
    cx.check_cancelled()?;
    let held = HeldBody { points: body.positions(), tets: body.tet_corners(), rows, shape: shape.positions() };
    // Cached, as keyed strengths cook every frame.
    let found = body.kept(Asked::of(body, shape), || Ok(goal_shape(&held, GoalLimits::default())))?;
    publish(cx, &found);
    let pulls = strength.value > 0.0 && strength.mask.is_none_or(|mask| mask.iter().any(|share| *share > 0.0));
    cx.publish(IDLE, if pulls { 0.0 } else { 1.0 });
    cx.publish(LATE, if cx.get(START_FRAME) < cx.get(FRAME) { 0.0 } else { 1.0 });
    let mut out = body.clone();
    out.set(P, found.points.clone())?;
    out.set(GOAL_FRAME, vec![cx.get(FRAME)])?;
    out.set(GOAL_START, vec![cx.get(START_FRAME)])?;
    out.set(GOAL_STRENGTH, vec![strength.value])?;
    if let Some(mask) = strength.mask {
        out.set(GOAL_SHARE, mask.to_vec())?;
    }
    out.set(GOAL_HOLD, vec![cx.get(HOLD)])?;
    Ok(GOAL.with(Geometry::from(out)))
}

/// The row of `shape` to which each point of the body belongs; below 0 inside.
///
/// # Errors
/// If the body does not say, or `shape` is not its surface.
fn surface<'a>(body: &'a Component, along: Option<&Component>, shape: &Component) -> Result<&'a [i32]> {
    let name = SURFACE_POINT.name;
    let Some(rows) = body.get(SURFACE_POINT) else {
        let has = body.describe(name).map_or("which it does not have".into(), |found| format!("which is {found}"));
        return Err(Error::refused(format!("`body` needs `{name}`, {has}"))
            .hint("use the tets from Tetrahedralize, whose `surface_point` says which points are on the surface"));
    };
    let held = rows.iter().max().and_then(|row| usize::try_from(*row).ok()).map_or(0, |row| row + 1);
    let counted = |mesh: &Component| format!("{} faces and {} points", mesh.element_count(), mesh.point_count());
    let fact = match along {
        Some(along) if along.topology() != shape.topology() || along.point_count() != shape.point_count() => {
            let (shape, own) = (counted(shape), counted(along));
            format!("`shape` has {shape}, the surface of `body` {own}, or their topology differs")
        }
        Some(along) if held > along.point_count() => {
            format!("`{name}` of `body` goes up to {}, but its surface has {} points", held - 1, along.point_count())
        }
        None if held != shape.point_count() => {
            format!("`shape` has {} points, the surface of `body` {held}", shape.point_count())
        }
        _ if held == 0 && body.point_count() > 0 => {
            let fact = format!("`{name}` of `body` is below 0 everywhere: no point of its surface is one of its own");
            return Err(Error::refused(fact).hint(
                "goals need a body whose surface is its own: from Tetrahedralize with `method` \"delaunay\" and nothing wired \
                 into `carry`",
            ));
        }
        _ => return Ok(rows),
    };
    Err(Error::refused(fact).hint(
        "deform the surface mesh in the output of Tetrahedralize: after repairs it differs from the input, and \
         mirroring reverses its faces",
    ))
}

/// What a goal's points depend on besides the body's positions and tets. Columns are compared by address; they are kept
/// alive, so that no address is reused.
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
