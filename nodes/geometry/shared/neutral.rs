//! Well-known attributes where nobody has written them: what their absence means.

use engine::prelude::*;

/// A well-known attribute of `part` with the value that changes nothing, a row an `owner`; `None` where absence means
/// no value.
pub(crate) fn column(part: &Component, owner: Owner, name: &str) -> Option<Column> {
    let rows = part.table(owner).rows();
    match name {
        "envelope" => Some(Column::new(vec![1.0_f32; rows])),
        "width" | "thickness" | "shielded" => Some(Column::new(vec![0.0_f32; rows])),
        "v" => Some(Column::new(vec![[0.0_f32; 3]; rows])),
        "orient" => Some(Column::new(vec![[0.0_f32, 0.0, 0.0, 1.0]; rows])),
        "Pref" if owner == Owner::Point => part.table(owner).column(P.name).cloned(),
        _ => None,
    }
}
