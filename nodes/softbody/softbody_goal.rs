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
//! points. Where a mesh rides along in the tets, as in a cage, it is that mesh, and the tets take the shape that brings it
//! nearest to the target.

use bodies::embedding::{EmbeddedPoint, embed};
use bodies::goals::{GoalLimits, GoalShape, HeldBody, HeldBy, goal_shape};
use bodies::tets::bounds;
use engine::prelude::*;
use numerics::vector::DVec3;

use crate::shared::attributes::{ALWAYS, GOAL_FRAME, GOAL_HOLD, GOAL_SHARE, GOAL_START, GOAL_STRENGTH, SURFACE_POINT};

inputs! { INPUTS:
    BODY: Input = Input::one("body", Kind::Tets,
        "The body at rest, from Tetrahedralize. Its `surface_point` says which points are on the surface.");
    SHAPE: Input = Input::one("shape", Kind::Mesh,
        "The target shape: the mesh from Tetrahedralize, which is the surface of the tets or rides along in them, with \
         other positions and the same faces.");
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
         stiffness ÷ (density · size²) brings the body within 1 % of its size from the shape: 4e4 for dough of 5e3 Pa \
         that is 0.16 m across, 1e3 if it is 1 m across. A mask on the points of `body` directs a part of it: where it \
         is 0, particles are free.")
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
        .warn_always_above(0.0, "`strength` is 0, or its mask is 0 everywhere, so the body is not pulled towards this \
            shape. Raise `strength`, paint its mask, or remove the goal.");
    FREE = Metric::new("free_points", Unit::None, "Points of the body that the goal does not pull: those with a `strength` of 0.");
    LATE = Metric::new("late_start", Unit::None, "1 where `start_frame` is not before `frame`; 0 elsewhere.")
        .warn_above(0.0, "The goal starts to pull only when the body should already have its shape, so the body is \
            pulled there at once, or not at all where `hold` is over by then. Set `start_frame` before `frame`.");
    SHAPE_ERROR = Metric::new("shape_error", Unit::None,
        "The largest distance of the mesh that rides along from the shape, relative to the size of the shape. 0 without \
         such a mesh: the surface of the tets takes the shape exactly.")
        .warn_above(0.02, "The mesh that rides along does not reach the shape, because the tets that carry it are too \
            coarse. Lower `spacing` of Tetrahedralize.");
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
    3,
    "Turns a target shape of a body's surface into a goal for the whole body: the interior follows as if it were \
     elastic. Wire it into `goals` of Softbody, and the body reaches the shape at the frame set here. The shape must \
     have the points and faces of the mesh that comes with the body: its surface, or a mesh that rides along in the \
     tets, as in a cage. The tets bring a mesh that rides along as close to the shape as they can; `shape_error` gives \
     the distance that remains.",
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
    let mesh = cx.input(BODY).mesh();
    let held = held(body, mesh, shape)?;
    cx.check_cancelled()?;
    // Cached, as keyed strengths cook every frame.
    let found = body.kept(Asked::of(body, mesh, shape), || goal(body, &held, shape))?;
    publish(cx, &found, shape);
    let pulled = match strength.mask {
        _ if strength.value <= 0.0 => 0,
        Some(mask) => mask.iter().filter(|share| **share > 0.0).count(),
        None => body.point_count(),
    };
    cx.publish(IDLE, if pulled == 0 && body.point_count() > 0 { 1.0 } else { 0.0 });
    cx.publish(FREE, (body.point_count() - pulled) as f64);
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

/// What of the body the shape is a shape of.
enum Held<'a> {
    /// Its surface: the row of `shape` to which each point of the body belongs; below 0 inside.
    Surface(&'a [i32]),
    /// A mesh that rides along.
    Riding(&'a Component),
}

/// What of the body `shape` is a shape of: its surface, if all points of the mesh that comes with it are its own.
///
/// # Errors
/// If the body does not say, or `shape` is another surface's.
fn held<'a>(body: &'a Component, mesh: Option<&'a Component>, shape: &Component) -> Result<Held<'a>> {
    let name = SURFACE_POINT.name;
    let Some(rows) = body.get(SURFACE_POINT) else {
        let has = body.describe(name).map_or("which it does not have".into(), |found| format!("which is {found}"));
        return Err(Error::refused(format!("`body` needs `{name}`, {has}"))
            .hint("use the tets from Tetrahedralize, whose `surface_point` says which points are on the surface"));
    };
    let points = rows.iter().max().and_then(|row| usize::try_from(*row).ok()).map_or(0, |row| row + 1);
    let counted = |mesh: &Component| format!("{} faces and {} points", mesh.element_count(), mesh.point_count());
    let rides = |mesh: &Component| {
        let mut owned = vec![false; mesh.point_count()];
        rows.iter().filter(|row| **row >= 0).for_each(|row| owned[*row as usize] = true);
        owned.contains(&false)
    };
    let fact = match mesh {
        Some(mesh) if counted(mesh) != counted(shape) => {
            format!("`shape` has {}, but the mesh that comes with `body` has {}", counted(shape), counted(mesh))
        }
        Some(mesh) if mesh.topology() != shape.topology() => {
            format!(
                "the faces of `shape` join its {} points otherwise than those of the mesh that comes with `body`",
                mesh.point_count()
            )
        }
        Some(mesh) if points > mesh.point_count() => {
            format!("`{name}` of `body` goes up to {}, but its surface has {} points", points - 1, mesh.point_count())
        }
        Some(mesh) if rides(mesh) => return Ok(Held::Riding(mesh)),
        None if points == 0 && body.point_count() > 0 => {
            let fact = format!(
                "`{name}` of `body` is below 0 everywhere, and no mesh comes with it: it has no surface to shape"
            );
            return Err(Error::refused(fact).hint(
                "wire the output of Tetrahedralize here: its tets come with their surface, or with the mesh that rides along \
                 in them",
            ));
        }
        None if points != shape.point_count() => {
            format!("`shape` has {} points, but the surface of `body` has {points}", shape.point_count())
        }
        _ => return Ok(Held::Surface(rows)),
    };
    Err(Error::refused(fact).hint(
        "deform the mesh in the output of Tetrahedralize: after repairs it differs from the input, and mirroring reverses \
         its faces",
    ))
}

/// The goal of a body.
///
/// # Errors
/// If a mesh rides along in tets without a volume.
fn goal(body: &Component, held: &Held<'_>, shape: &Component) -> Result<GoalShape> {
    let (points, tets, shape) = (body.positions(), body.tet_corners(), shape.positions());
    let carriers: Vec<EmbeddedPoint>;
    let by = match held {
        Held::Surface(rows) => HeldBy::Points { rows, shape },
        Held::Riding(mesh) => {
            carriers = embed(points, tets, mesh.positions()).ok_or_else(|| {
                Error::refused("no tet of `body` has a volume, so none can carry the mesh that comes with them")
                    .hint("use the tets that Tetrahedralize makes from the mesh")
            })?;
            HeldBy::Riding { carriers: &carriers, rest: mesh.positions(), shape }
        }
    };
    Ok(goal_shape(&HeldBody { points, tets, by }, GoalLimits::default()))
}

/// What a goal's points depend on besides the body's positions and tets. Columns are compared by address; they are kept
/// alive, so that no address is reused.
struct Asked {
    rows: Option<Column>,
    mesh: Option<Column>,
    shape: Option<Column>,
}

impl Asked {
    fn of(body: &Component, mesh: Option<&Component>, shape: &Component) -> Self {
        let column = |part: &Component, name| part.table(Owner::Point).column(name).cloned();
        let mesh = mesh.and_then(|mesh| column(mesh, P.name));
        Self { rows: column(body, SURFACE_POINT.name), mesh, shape: column(shape, P.name) }
    }
}

impl PartialEq for Asked {
    fn eq(&self, other: &Self) -> bool {
        let same = |a: &Option<Column>, b: &Option<Column>| a.as_ref().zip(b.as_ref()).is_some_and(|(a, b)| a.same(b));
        let mesh = same(&self.mesh, &other.mesh) || (self.mesh.is_none() && other.mesh.is_none());
        mesh && same(&self.rows, &other.rows) && same(&self.shape, &other.shape)
    }
}

fn publish(cx: &Cx, found: &GoalShape, shape: &Component) {
    let [low, high] = bounds(shape.positions().iter().map(|p| p.map(f64::from)));
    let size = (DVec3::from(high) - DVec3::from(low)).norm();
    cx.publish(SHAPE_ERROR, if found.missed > 0.0 && size > 0.0 { found.missed / size } else { 0.0 });
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
