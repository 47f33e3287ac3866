//! Positions of roots.

/// The first point of each curve, in metres. Compared by bits, so that it can be a cache key of bindings.
#[derive(Clone, Debug)]
pub struct RootPositions(Vec<[f32; 3]>);

impl RootPositions {
    /// The roots of curves `points[starts[i]..starts[i + 1]]`. A curve without points has no root and counts as rooted
    /// at the origin.
    ///
    /// # Panics
    /// If `starts` falls or ends beyond the points.
    pub fn of(starts: &[u32], points: &[[f32; 3]]) -> Self {
        let first = |ends: &[u32]| points[ends[0] as usize..ends[1] as usize].first().copied().unwrap_or_default();
        Self(starts.windows(2).map(first).collect())
    }

    /// One position for each curve.
    pub fn as_slice(&self) -> &[[f32; 3]] {
        &self.0
    }
}

impl PartialEq for RootPositions {
    fn eq(&self, other: &Self) -> bool {
        let same = |(a, b): (&f32, &f32)| a.to_bits() == b.to_bits();
        self.0.len() == other.0.len() && self.0.as_flattened().iter().zip(other.0.as_flattened()).all(same)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roots_are_compared_by_bits() {
        let at = |x: f32| RootPositions::of(&[0, 1], &[[x; 3]]);
        assert!(at(f32::NAN) == at(f32::NAN) && at(1.0) == at(1.0));
        assert!(at(0.0) != at(-0.0) && at(1.0) != RootPositions::of(&[0], &[]));
    }

    #[test]
    fn the_root_of_a_curve_is_its_first_point() {
        let roots = RootPositions::of(&[0, 2, 2, 3], &[[1.0; 3], [2.0; 3], [3.0; 3]]);
        assert_eq!(roots.as_slice(), [[1.0; 3], [0.0; 3], [3.0; 3]]);
    }
}
