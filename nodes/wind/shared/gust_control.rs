//! How a Gust_Control is passed along a wire: as its outline's points, with attributes for everything else.
//!
//! A control is a run of points. Its first four are its centre and the ends of its own x, y and z axis, so whatever
//! moves the points moves the control: a Transform rotates, stretches and shears it, a Merge puts several on one wire.
//! Each point of a run has `gust_points` (number of points in the run), `gust_shape` (0 sphere, 1 cubes), `gust_outer`
//! (outer ÷ inner) and `gust_strength`; if its outer box has a size or place of its own, `gust_outer_below` and
//! `gust_outer_above` (its distances from the centre along the axes ÷ their lengths; 0 if not); `gust_ramp` holds the ramp's keys, one per point from the first of the run:
//! x, y, and the interpolation (0 linear, 1 smooth, 2 constant). Points beyond the last key repeat it.

use curves::gusts::{AXIS_ROWS, Control, ControlShape};
use engine::prelude::*;
use numerics::ramp::{Interpolation, Ramp};
use numerics::vector::to_f64;

pub(crate) const POINTS: Attr<i32> = Attr::point("gust_points");
pub(crate) const SHAPE: Attr<i32> = Attr::point("gust_shape");
pub(crate) const OUTER: Attr<f32> = Attr::point("gust_outer");
pub(crate) const OUTER_BELOW: Attr<[f32; 3]> = Attr::point("gust_outer_below");
pub(crate) const OUTER_ABOVE: Attr<[f32; 3]> = Attr::point("gust_outer_above");
pub(crate) const STRENGTH: Attr<f32> = Attr::point("gust_strength");
pub(crate) const RAMP: Attr<[f32; 3]> = Attr::point("gust_ramp");

const SHAPES: [ControlShape; 2] = [ControlShape::Sphere, ControlShape::Cubes];
const INTERPOLATIONS: [Interpolation; 3] = [Interpolation::Linear, Interpolation::Smooth, Interpolation::Constant];

/// The points of one control: its outline, with at least one point per key of the ramp, and its attributes.
///
/// # Errors
/// If there are more points than an i32 can count.
pub(crate) fn component(
    outline: Vec<[f32; 3]>,
    shape: ControlShape,
    outer: f32,
    strength: f32,
    ramp: &Ramp,
) -> Result<Component> {
    let count = outline.len();
    let run = i32::try_from(count).map_err(|_| Error::refused(format!("its outline has {count} points")))?;
    let shape = SHAPES.iter().position(|known| *known == shape).unwrap_or(0) as i32;
    let joined = INTERPOLATIONS.iter().position(|known| *known == ramp.interpolation()).unwrap_or(0) as f32;
    let keys = ramp.keys();
    let key = |row: usize| {
        let [x, y] = keys[row.min(keys.len() - 1)];
        [x, y, joined]
    };
    let mut points = Component::points(outline);
    points.set(POINTS, vec![run; count])?;
    points.set(SHAPE, vec![shape; count])?;
    points.set(OUTER, vec![outer; count])?;
    points.set(STRENGTH, vec![strength; count])?;
    points.set(RAMP, (0..count).map(key).collect())?;
    Ok(points)
}

/// Gives a control an outer box of its own: see [`Control::within_box`].
///
/// # Errors
/// None that a user causes.
pub(crate) fn set_box(points: &mut Component, [below, above]: [[f64; 3]; 2]) -> Result<()> {
    let count = points.point_count();
    points.set(OUTER_BELOW, vec![below.map(|x| x as f32); count])?;
    points.set(OUTER_ABOVE, vec![above.map(|x| x as f32); count])?;
    Ok(())
}

/// The controls among the points of wire `wire`, in order.
///
/// # Errors
/// If any of the points does not belong to a control.
pub(crate) fn controls(points: &Component, wire: usize) -> Result<Vec<Control>> {
    let foreign =
        |fact: String| Error::refused(fact).hint("wire the output of a Gust_Control; it may be transformed and merged");
    let columns = (points.get(POINTS), points.get(SHAPE), points.get(OUTER), points.get(STRENGTH), points.get(RAMP));
    let (Some(runs), Some(shapes), Some(outers), Some(strengths), Some(keys)) = columns else {
        let lacks = [POINTS.name, SHAPE.name, OUTER.name, STRENGTH.name, RAMP.name]
            .into_iter()
            .find(|name| points.table(Owner::Point).column(name).is_none());
        let fact = match lacks {
            Some(name) => format!("wire {wire} of `controls` is not a Gust_Control: its points have no `{name}`"),
            None => {
                format!("wire {wire} of `controls` is not a Gust_Control: its `gust_…` attributes have other types")
            }
        };
        return Err(foreign(fact));
    };
    let at = points.positions();
    let mut controls = Vec::new();
    let mut first = 0;
    while first < at.len() {
        let count = usize::try_from(runs[first]).unwrap_or(0);
        if count < AXIS_ROWS
            || count > at.len() - first
            || runs[first..first + count].iter().any(|run| *run != runs[first])
        {
            return Err(foreign(format!(
                "point {first} of wire {wire} of `controls` does not belong to a complete Gust_Control"
            )));
        }
        let shape = usize::try_from(shapes[first]).ok().and_then(|shape| SHAPES.get(shape).copied());
        let shape = shape.ok_or_else(|| {
            foreign(format!(
                "`gust_shape` of point {first} of wire {wire} of `controls` is {}, expected 0 or 1",
                shapes[first]
            ))
        })?;
        let ramp = ramp(&keys[first..first + count]).map_err(|error| {
            foreign(format!("`gust_ramp` from point {first} of wire {wire} of `controls` is not a ramp: {error}"))
        })?;
        let centre = to_f64(at[first]);
        let axes = [1, 2, 3].map(|axis| (to_f64(at[first + axis]) - centre).into());
        let control = Control::new(shape, centre.into(), axes, f64::from(outers[first]), ramp, strengths[first]);
        let sides = |of: Attr<[f32; 3]>| points.get(of).map_or([0.0; 3], |rows| rows[first]);
        let [below, above] = [OUTER_BELOW, OUTER_ABOVE].map(sides);
        let has_box = below.iter().chain(&above).all(|side| *side > 0.0);
        controls.push(if has_box { control.within_box(below.map(f64::from), above.map(f64::from)) } else { control });
        first += count;
    }
    Ok(controls)
}

/// The ramp whose keys are on a run of points.
fn ramp(rows: &[[f32; 3]]) -> std::result::Result<Ramp, numerics::ramp::RampError> {
    let padding = rows.windows(2).position(|pair| pair[0] == pair[1]).map_or(rows.len(), |row| row + 1);
    let joined = INTERPOLATIONS.get(rows[0][2] as usize).copied().unwrap_or_default();
    Ramp::new(rows[..padding].iter().map(|[x, y, _]| [*x, *y]).collect(), joined)
}
