//! Whether a curve crosses the skin at rest: every triangle near it, one after the other.

use crate::scene::{Groom, Sample};
use numerics::lanes::get;
use numerics::vector::{DVec3, Vec3, to_f32, to_f64};

/// Whether a curve crosses nothing in its rest shape, displaced as collision has displaced its root in `out`.
pub(crate) fn is_free_at_rest(groom: &Groom, sample: &Sample, out: &[Vec3], curve: usize) -> bool {
    let cvs = groom.starts[curve] as usize..groom.starts[curve + 1] as usize;
    let shift = to_f64(out[cvs.start]) - to_f64(sample.goal[cvs.start]);
    let rest: Vec<DVec3> = sample.rest[cvs].iter().map(|p| to_f64(to_f32(to_f64(*p) + shift))).collect();
    !rest.windows(2).any(|ends| crosses(sample, &ends[0], &ends[1]))
}

fn crosses(sample: &Sample, a: &DVec3, b: &DVec3) -> bool {
    let mut found = false;
    sample.tree.visit_box(to_f32(a.inf(b)), to_f32(a.sup(b)), |block, lanes| {
        for lane in (0..16).filter(|lane| lanes >> lane & 1 == 1) {
            found |= passes(a, b, block.corners.each_ref().map(|corner| to_f64(get(corner, lane))));
        }
    });
    found
}

/// Whether the segment from `a` to `b` passes through a triangle; touching counts.
fn passes(a: &DVec3, b: &DVec3, [p, q, r]: [DVec3; 3]) -> bool {
    let normal = (q - p).cross(&(r - p));
    let (start, end) = (normal.dot(&(a - p)), normal.dot(&(b - p)));
    if start * end > 0.0 || start == end {
        return false;
    }
    let at = a + (b - a) * (start / (start - end));
    let side = |from: DVec3, to: DVec3| (to - from).cross(&(at - from)).dot(&normal);
    let sides = [side(p, q), side(q, r), side(r, p)];
    let most = sides.iter().fold(0.0_f64, |most, side| most.max(side.abs()));
    // On an edge up to rounding, too: what touches at rest is not free.
    sides.iter().all(|side| *side >= -1e-9 * most)
}
