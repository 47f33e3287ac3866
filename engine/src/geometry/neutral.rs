//! Neutral values of well-known attributes: the values that they have by definition if they are absent.

use super::{Column, Component, Owner, P};

impl Component {
    /// The neutral column of a well-known attribute, one row per `owner`; `None` if it has no neutral value.
    pub fn neutral(&self, owner: Owner, name: &str) -> Option<Column> {
        let rows = self.table(owner).rows();
        match name {
            "envelope" => Some(Column::new(vec![1.0_f32; rows])),
            "width" | "thickness" | "shielded" => Some(Column::new(vec![0.0_f32; rows])),
            "v" => Some(Column::new(vec![[0.0_f32; 3]; rows])),
            "orient" => Some(Column::new(vec![[0.0_f32, 0.0, 0.0, 1.0]; rows])),
            "Pref" if owner == Owner::Point => self.table(owner).column(P.name).cloned(),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn absent_attributes_have_neutral_values() {
        let points = Component::points(vec![[1.0, 2.0, 3.0]]);
        let neutral = |name: &str| points.neutral(Owner::Point, name);
        assert_eq!(neutral("envelope"), Some(Column::new(vec![1.0_f32])));
        assert!(neutral("Pref").is_some_and(|rest| rest.same(points.table(Owner::Point).column("P").unwrap())));
        assert_eq!(points.neutral(Owner::Once, "Pref"), None);
        assert_eq!(neutral("mask"), None);
    }
}
