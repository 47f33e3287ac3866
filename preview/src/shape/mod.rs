//! Shapes: polygons, tets and level sets turned into the triangles that are drawn.

pub(crate) mod boundary;
pub(crate) mod level_set;
pub(crate) mod smooth;
