//! Well-known attributes: names with a fixed type and owner. Any other name may have any type.

use std::marker::PhantomData;

use super::column::{ColumnType, Item};

/// What a row of an attribute belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Owner {
    /// A CV, vertex, particle or tet point.
    Point,
    /// A curve, face or tet.
    Element,
    /// The whole component.
    Once,
}

impl Owner {
    /// All owners, in the order files list them.
    pub const ALL: [Self; 3] = [Self::Point, Self::Element, Self::Once];
}

impl std::fmt::Display for Owner {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Point => "point",
            Self::Element => "element",
            Self::Once => "component",
        })
    }
}

/// A typed handle of an attribute: its name, what owns a row, the row's type.
#[derive(Clone, Copy, Debug)]
pub struct Attr<T> {
    /// The name in tables and files.
    pub name: &'static str,
    /// What a row belongs to.
    pub owner: Owner,
    row: PhantomData<T>,
}

impl<T: Item> Attr<T> {
    /// A handle of an attribute with one row per point.
    pub const fn point(name: &'static str) -> Self {
        Self { name, owner: Owner::Point, row: PhantomData }
    }

    /// A handle of an attribute with one row per element.
    pub const fn element(name: &'static str) -> Self {
        Self { name, owner: Owner::Element, row: PhantomData }
    }

    /// A handle of an attribute with one row per component.
    pub const fn once(name: &'static str) -> Self {
        Self { name, owner: Owner::Once, row: PhantomData }
    }
}

/// Positions, metres. Every component except a volume has them.
pub const P: Attr<[f32; 3]> = Attr::point("P");
/// Velocity, m/s.
pub const V: Attr<[f32; 3]> = Attr::point("v");
/// Fraction of the wind that a CV receives, 0…1; 1 if the attribute is missing.
pub const ENVELOPE: Attr<f32> = Attr::point("envelope");
/// Fraction of a curve's CVs in the lee of a collider, 0…1.
pub const SHIELDED: Attr<f32> = Attr::element("shielded");
/// Width of a curve or particle, metres.
pub const WIDTH: Attr<f32> = Attr::point("width");
/// Texture coordinates.
pub const UVW: Attr<[f32; 3]> = Attr::point("uvw");
/// Rest position, metres.
pub const PREF: Attr<[f32; 3]> = Attr::point("Pref");
/// Thickness of a liquid's sheet, metres.
pub const THICKNESS: Attr<f32> = Attr::point("thickness");
/// Unit normal.
pub const N: Attr<[f32; 3]> = Attr::point("N");
/// Orientation, a unit quaternion x, y, z, w.
pub const ORIENT: Attr<[f32; 4]> = Attr::point("orient");
/// Identity of a point over time.
pub const ID: Attr<i32> = Attr::point("id");

/// Identity of a curve over time.
pub const CURVE_ID: Attr<i32> = Attr::element("curve_id");

/// The type that a well-known name must have; `None` for other names.
pub fn fixed_type(name: &str) -> Option<ColumnType> {
    match name {
        "P" | "v" | "uvw" | "Pref" | "N" => Some(ColumnType::F3),
        "envelope" | "shielded" | "width" | "thickness" => Some(ColumnType::F1),
        "orient" => Some(ColumnType::F4),
        "id" => Some(ColumnType::I1),
        _ => None,
    }
}
