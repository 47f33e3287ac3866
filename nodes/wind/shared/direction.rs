//! Directions as artists write them: vectors of any length.

use engine::prelude::*;
use numerics::vector::direction;
use std::sync::OnceLock;

/// What gusts add to a wind of length 1 at a CV.
pub(crate) const GUST_DIR: Attr<[f32; 3]> = Attr::point("gust_dir");

/// `v`, not zero, scaled to length 1.
pub(crate) fn unit_direction(v: [f64; 3]) -> [f64; 3] {
    direction(v.into()).unwrap_or_default().into()
}

/// A `gust_dir` of 0.
#[derive(Default)]
struct NoGustDir(OnceLock<Column>);

/// A `gust_dir` of 0: frames whose curves do not move share one array, kept with them.
pub(crate) fn no_gust_dir(curves: &Component) -> Column {
    let kept = curves.derived(|_| NoGustDir::default());
    if let Some(none) = kept.0.get() {
        return none.clone();
    }
    let none = Column::new(vec![[0.0_f32; 3]; curves.point_count()]);
    // Where another thread was first, its array is kept.
    let _ = kept.0.set(none.clone());
    kept.0.get().cloned().unwrap_or(none)
}

/// What gusts add at each CV; `None` where that is missing or 0 everywhere.
pub(crate) fn gust_dir(curves: &Component) -> Option<&[[f32; 3]]> {
    let kept = curves.derived(|_| NoGustDir::default());
    let column = curves.table(Owner::Point).column(GUST_DIR.name)?;
    // The array that is known to be 0 need not be read.
    if kept.0.get().is_some_and(|none| none.same(column)) {
        return None;
    }
    curves.get(GUST_DIR).filter(|rows| !are_zero(rows))
}

/// Whether all numbers are 0. Many are compared at once, which `any` does not do.
fn are_zero(rows: &[[f32; 3]]) -> bool {
    let without_sign = |x: &f32| x.to_bits() << 1;
    rows.as_flattened().chunks(1024).all(|chunk| chunk.iter().fold(0, |bits, x| bits | without_sign(x)) == 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gust_dir_is_left_out_only_where_all_of_it_is_zero() {
        let mut rows = vec![[0.0, -0.0, 0.0]; 1000];
        assert!(are_zero(&rows) && are_zero(&[]));
        for value in [1e-45, f32::NAN, -1.0] {
            rows[999] = [0.0, 0.0, value];
            assert!(!are_zero(&rows), "{value}");
        }
    }

    #[test]
    fn a_gust_dir_of_zero_is_shared_and_another_is_read() {
        let mut curves = Component::curves(vec![2], vec![[0.0; 3], [0.0, 1.0, 0.0]]).unwrap();
        assert_eq!(gust_dir(&curves), None);
        let none = no_gust_dir(&curves);
        assert!(none.same(&no_gust_dir(&curves)));
        curves.set_column(Owner::Point, GUST_DIR.name, none).unwrap();
        assert_eq!(gust_dir(&curves), None);
        let sides = vec![[0.0; 3], [0.0, 0.0, 0.5]];
        curves.set(GUST_DIR, sides.clone()).unwrap();
        assert_eq!(gust_dir(&curves), Some(&sides[..]));
        curves.set(GUST_DIR, vec![[0.0; 3]; 2]).unwrap();
        assert_eq!(gust_dir(&curves), None);
    }
}
