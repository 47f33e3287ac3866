//! `extent`: the box around a prim as USD computes it.
//!
//! Bitwise equal to `ComputeExtentFromPlugins` of usd-core 26.11, also without points and with NaN. This determines the
//! order of comparisons and the padding: curves are padded on all sides by half their largest width, each point by half
//! its own.

use engine::geometry::Kind;

/// The box of no points, which is inverted.
pub(super) const EMPTY: [[f32; 3]; 2] = [[f32::MAX; 3], [f32::MIN; 3]];

/// The lowest and highest corner of `points` (metres), padded by `widths` (one per point) if `kind` has them.
pub(super) fn extent(kind: Kind, points: &[[f32; 3]], widths: Option<&[f32]>) -> [[f32; 3]; 2] {
    match (kind, widths) {
        (Kind::Points, Some(widths)) => points.iter().zip(widths).fold(EMPTY, |bounds, (point, width)| {
            let half = width / 2.0;
            grown(grown(bounds, point.map(|x| x + half)), point.map(|x| x - half))
        }),
        (Kind::Curves, widths) => {
            let greatest = widths.and_then(|w| w.iter().copied().reduce(|a, b| if a < b { b } else { a }));
            let half = greatest.unwrap_or(0.0) / 2.0;
            // Also without widths: it turns a maximum of −0.0 into 0.0, as USD does.
            let [low, high] = points.iter().copied().fold(EMPTY, grown);
            [low.map(|x| x - half), high.map(|x| x + half)]
        }
        _ => points.iter().copied().fold(EMPTY, grown),
    }
}

/// `bounds` extended to contain `point`; a NaN coordinate changes nothing.
fn grown([low, high]: [[f32; 3]; 2], point: [f32; 3]) -> [[f32; 3]; 2] {
    let least = |k: usize| if point[k] < low[k] { point[k] } else { low[k] };
    let greatest = |k: usize| if point[k] > high[k] { point[k] } else { high[k] };
    [[0, 1, 2].map(least), [0, 1, 2].map(greatest)]
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROW: [[f32; 3]; 2] = [[0.0; 3], [10.0, 0.0, 0.0]];

    fn bits(bounds: [[f32; 3]; 2]) -> [[u32; 3]; 2] {
        bounds.map(|corner| corner.map(f32::to_bits))
    }

    #[test]
    fn curves_are_padded_by_half_their_largest_width_and_points_by_half_their_own() {
        assert_eq!(extent(Kind::Mesh, &ROW, None), [[0.0; 3], [10.0, 0.0, 0.0]]);
        let widths = Some(&[5.0, 1.0][..]);
        assert_eq!(extent(Kind::Curves, &ROW, widths), [[-2.5; 3], [12.5, 2.5, 2.5]]);
        assert_eq!(extent(Kind::Points, &ROW, widths), [[-2.5; 3], [10.5, 2.5, 2.5]]);
        assert_eq!(extent(Kind::Tets, &ROW, widths), [[0.0; 3], [10.0, 0.0, 0.0]]);
    }

    /// Expected values: results of usd-core 26.11.
    #[test]
    fn special_values_give_the_same_as_usd() {
        let zeros = [[-0.0, 0.0, 0.0], [0.0, -0.0, 0.0]];
        let minus = (-0.0_f32).to_bits();
        assert_eq!(bits(extent(Kind::Mesh, &zeros, None)), [[minus, 0, 0], [minus, 0, 0]]);
        assert_eq!(bits(extent(Kind::Curves, &zeros, None)), [[minus, 0, 0], [0, 0, 0]]);
        let nans = [[f32::NAN, 1.0, 2.0], [f32::NAN, 5.0, f32::INFINITY]];
        let expected = [[f32::MAX, 1.0, 2.0], [f32::MIN, 5.0, f32::INFINITY]];
        assert_eq!(extent(Kind::Mesh, &nans, None), expected);
        assert_eq!(extent(Kind::Points, &ROW, Some(&[-5.0, -3.0])), [[-2.5; 3], [11.5, 2.5, 2.5]]);
        assert_eq!(extent(Kind::Curves, &ROW, Some(&[1.0, f32::NAN])), [[-0.5; 3], [10.5, 0.5, 0.5]]);
        assert_eq!(extent(Kind::Points, &ROW, Some(&[f32::NAN, 1.0])), [[9.5, -0.5, -0.5], [10.5, 0.5, 0.5]]);
        for kind in [Kind::Curves, Kind::Mesh, Kind::Points, Kind::Tets] {
            assert_eq!(extent(kind, &[], Some(&[])), EMPTY);
        }
    }
}
