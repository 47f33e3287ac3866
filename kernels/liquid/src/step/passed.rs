//! Liquid that a solid passed over: it was before the solid at the start of a substep and is behind it at the end.

use numerics::vector::{add, dot, length, scale};

use crate::level_set::{PhiView, outward};
use crate::rows::Cell;
use crate::step::domain::{Domain, Solid};
use crate::step::{Motion, Moving};
use crate::velocity::Site;

/// Cells that the surface of a solid moves in a substep up to which nothing is passed over: it is then seen from where it comes to.
const SEEN: f32 = 2.0;

/// Height above a solid, in cells, below which a way comes to it. A thin one that moves hardly has an inside.
const NEAR: f32 = 0.5;

/// Cosine between the ways out of the solid before and after from which it was passed, not grazed.
const OPPOSITE: f32 = -0.3;

/// Cells past the liquid to which its velocity goes on.
const LAYERS: i32 = 4;

/// Distance between the places of a way that are looked at, in cells, and how many at most.
const STRIDE: f32 = 0.5;
const MOST_STEPS: f32 = 256.0;

/// Whether a solid moves too far in a substep for the liquid before it to be pushed.
pub(super) fn is_passing(flow: &Moving<'_>) -> bool {
    flow.solid_way() > SEEN
}

/// The volume, ÷ cell³, of what is liquid at the end of a substep between `times` and whose way there went through a solid. The
/// solid is where it is at each of several times on the way, whatever the surface made of it.
pub(super) fn passed_over(
    view: &PhiView<'_>,
    motion: &Motion,
    domain: &Domain,
    flow: &Moving<'_>,
    (solid, times): (Solid<'_>, [f64; 2]),
) -> f64 {
    if !is_passing(flow) {
        return 0.0;
    }
    let solid_way = flow.solid_way();
    // Where the solid is in the substep's middle, the flow that moves the surface is the solid's own.
    let velocity = motion.velocity_past_liquid(domain, LAYERS);
    let flow = Moving { velocity: &velocity, ..*flow };
    let [passed] = view.rows.tabulate_with(
        || flow.centre_reader(),
        |way_at, cell: Cell, at| {
            let filled = (0.5 - view.phi[at]).clamp(0.0, 1.0);
            let is_in = (0..3).all(|axis| view.low[axis] <= cell[axis] && cell[axis] < view.high[axis]);
            if filled == 0.0 || !is_in {
                return [0.0];
            }
            let (end, way) = (Site::Centre.of(cell), way_at(cell));
            let steps = ((solid_way + length(way)) / STRIDE).ceil().min(MOST_STEPS);
            // From the end, at 0, back to the start, at `last`.
            let last = steps as u32;
            let time = |n: u32| times[1] - f64::from(n as f32 / steps) * (times[1] - times[0]);
            let place = |n: u32| flow.periods.home_point(add(end, scale(way, -(n as f32) / steps)));
            let height = |n: u32| (solid.distance)(time(n), place(n));
            let normal = |n: u32| outward(&|point| (solid.distance)(time(n), point), place(n));
            let is_near = |n: &u32| height(*n) < NEAR;
            let (Some(after), Some(before)) = ((1..last).find(is_near), (1..last).rev().find(is_near)) else {
                return [0.0];
            };
            let is_passed = height(0) >= 0.0
                && height(last) >= 0.0
                && normal(after - 1)
                    .zip(normal(before + 1))
                    .is_some_and(|(after, before)| dot(after, before) < OPPOSITE);
            [if is_passed { filled } else { 0.0 }]
        },
    );
    passed.iter().fold(0.0, |sum, filled| sum + f64::from(*filled))
}
