//! convect's json format: it stores everything of a geometry and is easy to read by scripts and tests.
//!
//! ```json
//! {"frame": 1, "time": 0.041666666666666664,
//!  "curves": {"counts": [2], "points": [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
//!   "point_attributes": {"envelope": [1.0, 1.0]}, "element_attributes": {"shielded": [0.5]}, "attributes": {}}}
//! ```
//!
//! Absent components are omitted. Every table is a list of rows: a number, or three or four in a list; `attributes`
//! has one row. A number with a `.` or an `e` is an f32 and any other an i32, so types survive; f32 are in their
//! shortest form and read back bit for bit. A column is f32 if one of its numbers is, or if its name is
//! well known as float (`"envelope": [1, 1]`). A column without rows has the type of its well-known name, else float.
//! `frame` and `time` may be missing. Any other key is a fault, and so is a duplicate key.
//!
//! A volume is written as the dense arrays of its box, x fastest, then y, then z. If its velocity has another grid,
//! that is `velocity_origin`, `velocity_cell` and `velocity_size`; those of the level set are used for missing ones.
//! `background` is φ where nothing is stored; if it is missing, it is the largest value of `level_set`, at least half a
//! cell. More than 2³¹ − 1 numbers in one array are refused when reading and writing.

mod numbers;
mod part;
mod read;
#[cfg(test)]
mod tests;
mod write;

use engine::geometry::{Kind, Owner};

pub(crate) use read::read;
pub(crate) use write::write;

/// The key of an owner's table; `None` if components of that kind have none.
fn table_key(kind: Kind, owner: Owner) -> Option<&'static str> {
    match owner {
        Owner::Point => (kind != Kind::Volume).then_some("point_attributes"),
        Owner::Element => (!matches!(kind, Kind::Points | Kind::Volume)).then_some("element_attributes"),
        Owner::Once => Some("attributes"),
    }
}
