//! Masks that are not stored as one float for each point: converted for a call, and kept until it ends.

use std::sync::OnceLock;

use crate::geometry::{Component, Kind, Owner};

/// Converted masks. The list only grows, so that what it lends stays where it is.
#[derive(Default)]
pub(crate) struct ConvertedMasks(OnceLock<Box<Converted>>);

struct Converted {
    rows: Vec<f32>,
    next: ConvertedMasks,
}

impl ConvertedMasks {
    /// Keeps a mask.
    #[expect(clippy::disallowed_methods, reason = "only moves what is there")]
    pub(super) fn keep(&self, rows: Vec<f32>) -> &[f32] {
        let mut rows = Some(rows);
        let mut list = self;
        loop {
            let first = || Box::new(Converted { rows: rows.take().unwrap_or_default(), next: Self::default() });
            let converted = list.0.get_or_init(first);
            if rows.is_none() {
                return &converted.rows;
            }
            list = &converted.next;
        }
    }
}

/// The mask as one float for each point, if it is one integer for each point, or one number for each curve.
pub(super) fn converted(part: &Component, attribute: &str) -> Option<Vec<f32>> {
    let float = |rows: &[i32]| rows.iter().map(|row| *row as f32).collect::<Vec<f32>>();
    if let Some(rows) = part.table(Owner::Point).get::<i32>(attribute) {
        return Some(float(rows));
    }
    if part.kind() != Kind::Curves {
        return None;
    }
    let elements = part.table(Owner::Element);
    let of_curves = match elements.get::<f32>(attribute) {
        Some(rows) => rows.to_vec(),
        None => float(elements.get::<i32>(attribute)?),
    };
    let cvs = part.runs().counts().zip(of_curves);
    Some(cvs.flat_map(|(count, factor)| std::iter::repeat_n(factor, count as usize)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Attr;

    #[test]
    fn integers_and_numbers_of_curves_become_floats_of_points() {
        let mut curves = Component::curves(vec![2, 1], vec![[0.0; 3]; 3]).unwrap();
        curves.set(Attr::<i32>::point("whole"), vec![0, 1, -2]).unwrap();
        curves.set(Attr::<f32>::element("curve"), vec![0.5, 2.0]).unwrap();
        curves.set(Attr::<i32>::element("chosen"), vec![1, 0]).unwrap();
        curves.set(Attr::<[f32; 3]>::element("vector"), vec![[0.0; 3]; 2]).unwrap();
        assert_eq!(converted(&curves, "whole"), Some(vec![0.0, 1.0, -2.0]));
        assert_eq!(converted(&curves, "curve"), Some(vec![0.5, 0.5, 2.0]));
        assert_eq!(converted(&curves, "chosen"), Some(vec![1.0, 1.0, 0.0]));
        assert_eq!((converted(&curves, "vector"), converted(&curves, "none")), (None, None));
    }

    #[test]
    fn what_is_kept_stays() {
        let masks = ConvertedMasks::default();
        let kept: Vec<&[f32]> = (0..5).map(|k| masks.keep(vec![k as f32])).collect();
        assert_eq!(kept.concat(), [0.0, 1.0, 2.0, 3.0, 4.0]);
    }
}
