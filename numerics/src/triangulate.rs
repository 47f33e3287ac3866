//! Triangulation of polygons by ear clipping, concave ones included.
//!
//! Promise: a polygon of n corners gives exactly n − 2 triangles with its winding, whatever its shape; a simple flat
//! polygon is covered exactly once. At most `TESTS_PER_PAIR`·n² point-in-triangle tests, and polygons of more than
//! `MOST_CORNERS` corners become fans, so the time is bounded. Limit: the triangulation of a polygon that crosses itself
//! or is not flat is arbitrary; holes need a bridge: two pairs of coincident corners.

/// Above this a polygon becomes a fan about its first corner: n² tests for one face would take too long.
const MOST_CORNERS: usize = 4096;
/// Most point-in-triangle tests per pair of corners. A star needs about 1, a spiral about 2.
const TESTS_PER_PAIR: usize = 8;

/// Triangles of the polygon with these corners, as triples of rows of `corners`; none below three corners.
pub fn triangulate(corners: &[[f32; 3]]) -> Vec<[u32; 3]> {
    let count = corners.len();
    match count {
        0..3 => Vec::new(),
        3 => vec![[0, 1, 2]],
        _ if count > MOST_CORNERS => fan(count),
        _ => flatten(corners).map_or_else(|| fan(count), |flat| clip_ears(&flat)),
    }
}

fn fan(count: usize) -> Vec<[u32; 3]> {
    (1..count as u32 - 1).map(|k| [0, k, k + 1]).collect()
}

/// The polygon along the axis its normal (Newell's) is nearest to, counter-clockwise; `None` where it has no area.
fn flatten(corners: &[[f32; 3]]) -> Option<Vec<[f64; 2]>> {
    let first = corners[0].map(f64::from);
    let local: Vec<[f64; 3]> = corners.iter().map(|p| std::array::from_fn(|k| f64::from(p[k]) - first[k])).collect();
    let mut normal = [0.0_f64; 3];
    for (k, a) in local.iter().enumerate() {
        let b = local[(k + 1) % local.len()];
        for (axis, sum) in normal.iter_mut().enumerate() {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            *sum += (a[u] - b[u]) * (a[v] + b[v]);
        }
    }
    let axis = (0..3).fold(0, |best, k| if normal[k].abs() > normal[best].abs() { k } else { best });
    if !(normal[axis].abs() > 0.0 && normal[axis].is_finite()) {
        return None;
    }
    // Newell's sum is positive for a polygon that is counter-clockwise in (axis + 1, axis + 2).
    let (u, v) = if normal[axis] > 0.0 { ((axis + 1) % 3, (axis + 2) % 3) } else { ((axis + 2) % 3, (axis + 1) % 3) };
    Some(local.iter().map(|p| [p[u], p[v]]).collect())
}

/// Twice the signed area of a, b, c: positive where they turn left.
fn turn(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

fn clip_ears(flat: &[[f64; 2]]) -> Vec<[u32; 3]> {
    let count = flat.len();
    let mut next: Vec<usize> = (1..=count).map(|k| k % count).collect();
    let mut previous: Vec<usize> = (0..count).map(|k| (k + count - 1) % count).collect();
    let mut budget = TESTS_PER_PAIR * count * count;
    let mut triangles = Vec::with_capacity(count - 2);
    let (mut at, mut left, mut refused) = (0, count, 0);
    while left > 3 {
        let [a, b, c] = [previous[at], at, next[at]];
        // A corner is clipped where it is an ear; also where a whole round found none, or the budget of tests is spent.
        if refused >= left || budget == 0 || is_ear(flat, [a, b, c], &next, &mut budget) {
            triangles.push([a as u32, b as u32, c as u32]);
            next[a] = c;
            previous[c] = a;
            left -= 1;
            refused = 0;
            // Skipping a corner between two ears avoids one thin fan of triangles.
            at = next[c];
        } else {
            refused += 1;
            at = c;
        }
    }
    triangles.push([previous[at] as u32, at as u32, next[at] as u32]);
    triangles
}

/// Whether the triangle at corner b turns left and contains no other corner of the remaining polygon.
fn is_ear(flat: &[[f64; 2]], [a, b, c]: [usize; 3], next: &[usize], budget: &mut usize) -> bool {
    let [pa, pb, pc] = [flat[a], flat[b], flat[c]];
    let area = turn(pa, pb, pc);
    if area <= 0.0 {
        // A corner on the line between its neighbours: clipping it changes no area. One where the polygon doubles back
        // stays, as that line may be part of the boundary.
        let between = (pb[0] - pa[0]) * (pc[0] - pb[0]) + (pb[1] - pa[1]) * (pc[1] - pb[1]) >= 0.0;
        return area == 0.0 && between;
    }
    let mut k = next[c];
    while k != a {
        *budget = budget.saturating_sub(1);
        let p = flat[k];
        let apart = p != pa && p != pb && p != pc;
        if apart && turn(pa, pb, p) >= 0.0 && turn(pb, pc, p) >= 0.0 && turn(pc, pa, p) >= 0.0 {
            return false;
        }
        k = next[k];
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flat(points: &[[f32; 2]]) -> Vec<[f32; 3]> {
        points.iter().map(|[x, y]| [*x, 0.5, *y]).collect()
    }

    fn areas(corners: &[[f32; 3]]) -> Vec<f64> {
        let at = |k: u32| [f64::from(corners[k as usize][0]), f64::from(corners[k as usize][2])];
        triangulate(corners).iter().map(|[a, b, c]| turn(at(*a), at(*b), at(*c)) / 2.0).collect()
    }

    fn shoelace(points: &[[f32; 2]]) -> f64 {
        let at = |k: usize| points[k % points.len()].map(f64::from);
        (0..points.len()).map(|k| at(k)[0] * at(k + 1)[1] - at(k)[1] * at(k + 1)[0]).sum::<f64>() / 2.0
    }

    /// Triangles that all turn one way and add up to the polygon's area cover it exactly once.
    fn covers_once(points: &[[f32; 2]]) {
        let areas = areas(&flat(points));
        let area = shoelace(points);
        assert_eq!(areas.len(), points.len() - 2);
        assert!(areas.iter().all(|part| part * area >= 0.0), "{areas:?}");
        assert!((areas.iter().sum::<f64>() - area).abs() < 1e-9 * area.abs(), "{areas:?} of {area}");
    }

    #[test]
    fn a_quad_is_two_triangles() {
        assert_eq!(triangulate(&flat(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])).len(), 2);
    }

    #[test]
    fn concave_polygons_are_covered_once() {
        let arrow = [[0.0, 0.0], [2.0, 1.0], [0.0, 2.0], [1.0, 1.0]];
        let comb = [
            [0.0, 0.0],
            [7.0, 0.0],
            [7.0, 3.0],
            [6.0, 3.0],
            [6.0, 1.0],
            [5.0, 1.0],
            [5.0, 3.0],
            [4.0, 3.0],
            [4.0, 1.0],
            [3.0, 1.0],
            [3.0, 3.0],
            [2.0, 3.0],
            [2.0, 1.0],
            [1.0, 1.0],
            [1.0, 3.0],
            [0.0, 3.0],
        ];
        for polygon in [&arrow[..], &comb] {
            covers_once(polygon);
            let reversed: Vec<_> = polygon.iter().rev().copied().collect();
            covers_once(&reversed);
            for scale in [1e-3, 1e3] {
                covers_once(&polygon.iter().map(|p| p.map(|x| x * scale)).collect::<Vec<_>>());
            }
        }
    }

    #[test]
    fn a_spiral_is_covered_once() {
        // Two walls of a corridor that winds inwards, as squares.
        let (mut outer, mut inner) = (Vec::new(), Vec::new());
        for k in 0..40 {
            let (r, turn) = (50.0 - k as f32, [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]][k % 4]);
            outer.push(turn.map(|x| x * r));
            inner.push(turn.map(|x| x * (r - 0.4)));
        }
        outer.extend(inner.into_iter().rev());
        covers_once(&outer);
    }

    #[test]
    fn a_hole_with_a_bridge_stays_open() {
        covers_once(&[
            [0.0, 0.0],
            [4.0, 0.0],
            [4.0, 4.0],
            [0.0, 4.0],
            [0.0, 0.0],
            [1.0, 1.0],
            [1.0, 3.0],
            [3.0, 3.0],
            [3.0, 1.0],
            [1.0, 1.0],
        ]);
    }

    #[test]
    fn degenerate_polygons_give_n_minus_2_triangles_too() {
        let nan = vec![[f32::NAN; 3]; 9];
        let same = vec![[1.0; 3]; 9];
        let line: Vec<_> = (0..9).map(|k| [k as f32, 0.0, 0.0]).collect();
        let bow = flat(&[[0.0, 0.0], [2.0, 2.0], [2.0, 0.0], [0.0, 1.0]]);
        // A star that crosses itself at every edge, of a size where quadratic time matters.
        let cross: Vec<_> = (0..4000).map(|k| [(k * 1237 % 4000) as f32, 0.0, (k * 2791 % 3989) as f32]).collect();
        for polygon in [nan, same, line, bow, cross] {
            assert_eq!(triangulate(&polygon).len(), polygon.len() - 2);
        }
        assert_eq!(triangulate(&vec![[0.0; 3]; MOST_CORNERS + 1]).len(), MOST_CORNERS - 1);
        assert!(triangulate(&[[0.0; 3]; 2]).is_empty());
    }
}
