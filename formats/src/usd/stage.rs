//! The input of both encoders: arrays as frames arrive, and at the end the structure that refers to them.
//!
//! An [`Encoder`] stores an array and returns a [`Handle`]; a [`Stage`] assigns each handle to a prim, attribute and
//! time. This module does not depend on geometry, nor on a file format except for USD's type names.

use std::io;

use engine::geometry::Column;

/// Encodes arrays and structure as a file written to `W`.
pub(super) trait Encoder<W>: Send {
    /// Stores an array as a value of type `kind`. The rows have the width and number type of `kind`; for
    /// [`UsdType::Int64`] they are i32.
    fn store(&mut self, kind: UsdType, rows: &Column) -> io::Result<Handle>;

    /// Writes the structure and returns the file, complete but not yet synced.
    fn finish(self: Box<Self>, stage: &Stage) -> io::Result<W>;
}

/// Identifies a stored array for its encoder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Handle(pub(super) u64);

impl Handle {
    /// No value: a frame that lacks the attribute.
    pub(super) const BLOCK: Self = Self(u64::MAX);
}

/// The whole file's structure.
#[derive(Debug)]
pub(super) struct Stage {
    /// Name of the one root prim, an identifier.
    pub(super) name: String,
    /// The original name, if it differs.
    pub(super) display_name: Option<String>,
    /// Frames and time codes per second.
    pub(super) fps: f64,
    /// Position of the root prim, metres.
    pub(super) origin: [f64; 3],
    /// Time codes, ascending.
    pub(super) times: Vec<f64>,
    /// Prims with geometry under the root, or under named prims of it.
    pub(super) groups: Vec<PrimGroup>,
}

/// Prims with geometry that belong together.
#[derive(Debug)]
pub(super) struct PrimGroup {
    /// The prim between them and the root: its name, an identifier, and the original name if it differs. `None`: there is
    /// no such prim.
    pub(super) name: Option<(String, Option<String>)>,
    pub(super) prims: Vec<Prim>,
}

impl Stage {
    /// Numeric stage metadata, including first and last time code if there are frames.
    pub(super) fn numbers(&self) -> Vec<(&'static str, f64)> {
        let span = self.times.first().zip(self.times.last());
        let mut numbers = vec![("metersPerUnit", 1.0), ("timeCodesPerSecond", self.fps), ("framesPerSecond", self.fps)];
        numbers.extend(span.into_iter().flat_map(|(first, last)| [("startTimeCode", *first), ("endTimeCode", *last)]));
        numbers
    }

    /// Whether the root prim is translated.
    pub(super) fn is_moved(&self) -> bool {
        self.origin != [0.0; 3]
    }
}

/// A prim with geometry.
#[derive(Debug)]
pub(super) struct Prim {
    /// Its name.
    pub(super) name: &'static str,
    /// Its schema.
    pub(super) schema: &'static str,
    /// Uniform token attributes and their values.
    pub(super) tokens: &'static [(&'static str, &'static str)],
    /// All other attributes.
    pub(super) attributes: Vec<Attribute>,
}

/// An array attribute.
#[derive(Debug)]
pub(super) struct Attribute {
    /// Its name, `primvars:` included.
    pub(super) name: String,
    /// The original name, if it differs.
    pub(super) display_name: Option<String>,
    /// Its type.
    pub(super) kind: UsdType,
    /// What a row belongs to, if the schema does not define it.
    pub(super) interpolation: Option<Interpolation>,
    /// Its values.
    pub(super) values: Values,
}

/// One value for all times, or one per time code.
#[derive(Debug, PartialEq)]
pub(super) enum Values {
    /// One constant value.
    Default(Handle),
    /// One per time code of the stage.
    Samples(Vec<Handle>),
}

/// What a row of a primvar belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Interpolation {
    /// A point.
    Vertex,
    /// A curve, face or tet.
    Uniform,
    /// The whole.
    Constant,
}

impl Interpolation {
    /// USD's token.
    pub(super) fn token(self) -> &'static str {
        match self {
            Self::Vertex => "vertex",
            Self::Uniform => "uniform",
            Self::Constant => "constant",
        }
    }
}

/// Array types, distinguished by role.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum UsdType {
    Float,
    Float3,
    Point3,
    Vector3,
    Normal3,
    Color3,
    Color4,
    /// Of rows of three floats the first two.
    TexCoord2,
    /// Imaginary part first in memory, as in our rows; real part first in text.
    Quat,
    Int,
    Int3,
    Int4,
    Int64,
}

impl UsdType {
    /// The type name of the array.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Float => "float[]",
            Self::Float3 => "float3[]",
            Self::Point3 => "point3f[]",
            Self::Vector3 => "vector3f[]",
            Self::Normal3 => "normal3f[]",
            Self::Color3 => "color3f[]",
            Self::Color4 => "color4f[]",
            Self::TexCoord2 => "texCoord2f[]",
            Self::Quat => "quatf[]",
            Self::Int => "int[]",
            Self::Int3 => "int3[]",
            Self::Int4 => "int4[]",
            Self::Int64 => "int64[]",
        }
    }
}

/// The numbers of a column, row by row.
pub(super) enum Numbers<'a> {
    Floats(&'a [f32]),
    Ints(&'a [i32]),
}

/// The numbers of `column`, row by row.
pub(super) fn numbers(column: &Column) -> Numbers<'_> {
    match column {
        Column::F1(rows) => Numbers::Floats(rows),
        Column::F3(rows) => Numbers::Floats(rows.as_flattened()),
        Column::F4(rows) => Numbers::Floats(rows.as_flattened()),
        Column::I1(rows) => Numbers::Ints(rows),
        Column::I3(rows) => Numbers::Ints(rows.as_flattened()),
        Column::I4(rows) => Numbers::Ints(rows.as_flattened()),
    }
}

/// Whether two columns hold the same bits: −0.0 is not 0.0, and a NaN is itself.
pub(super) fn same_bits(a: &Column, b: &Column) -> bool {
    if a.same(b) {
        return true;
    }
    if a.kind() != b.kind() || a.len() != b.len() {
        return false;
    }
    match (numbers(a), numbers(b)) {
        (Numbers::Floats(a), Numbers::Floats(b)) => {
            // In blocks without branches, which are vectorised; stops at the first block that differs.
            let differ = |(a, b): (&[f32], &[f32])| {
                a.iter().zip(b).fold(0, |bits, (x, y)| bits | (x.to_bits() ^ y.to_bits())) != 0
            };
            !a.chunks(COMPARED).zip(b.chunks(COMPARED)).any(differ)
        }
        (Numbers::Ints(a), Numbers::Ints(b)) => a == b,
        _ => false,
    }
}

/// Numbers compared per block.
const COMPARED: usize = 256;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_compared_by_bits() {
        let floats = |x: f32| Column::new(vec![[0.0, x, 0.0]; 200]);
        assert!(same_bits(&floats(1.0), &floats(1.0)));
        assert!(!same_bits(&floats(0.0), &floats(-0.0)));
        assert!(same_bits(&floats(f32::NAN), &floats(f32::NAN)));
        assert!(!same_bits(&Column::new(vec![1.0_f32]), &Column::new(vec![1_i32])));
        assert!(!same_bits(&Column::new(vec![1_i32]), &Column::new(vec![1_i32, 1])));
        let mut last_differs = vec![[0.0_f32, 1.0, 0.0]; 200];
        last_differs[199][2] = 1e-45;
        assert!(!same_bits(&floats(1.0), &Column::new(last_differs)));
    }
}
