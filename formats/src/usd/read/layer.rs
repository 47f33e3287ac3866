//! A layer: the tree of prims and properties of one file, with the fields of each. Values are decoded when they are
//! read; until then a field is a number that the file knows.

use std::sync::Arc;

use super::crate_values::CrateData;
use super::text::TextData;
use crate::Result;

/// No node.
pub(super) const NONE: u32 = u32::MAX;

/// The kind of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum NodeKind {
    Root,
    Prim,
    Attribute,
    /// A relationship, variant or connection: none has geometry.
    Other,
}

/// A prim or property.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    /// Index of its name among the tokens.
    pub(super) name: u32,
    pub(super) kind: NodeKind,
    /// First prim under it.
    pub(super) child: u32,
    /// First property.
    pub(super) property: u32,
    /// Next node of the same parent, among prims or among properties.
    pub(super) next: u32,
    /// Where its fields start in [`Layer::sets`].
    pub(super) set: u32,
}

impl Node {
    pub(super) fn new(name: u32, kind: NodeKind, set: u32) -> Self {
        Self { name, kind, child: NONE, property: NONE, next: NONE, set }
    }
}

/// Names, one after the other.
#[derive(Debug, Default)]
pub(super) struct Tokens {
    pub(super) text: Vec<u8>,
    /// Where each ends.
    pub(super) ends: Vec<usize>,
}

impl Tokens {
    /// The token of that index; empty if there is none.
    pub(super) fn get(&self, index: u32) -> &str {
        let index = index as usize;
        let start = index.checked_sub(1).map_or(Some(0), |before| self.ends.get(before).map(|end| end + 1));
        let bytes = start.zip(self.ends.get(index)).and_then(|(start, end)| self.text.get(start..*end));
        bytes.and_then(|bytes| std::str::from_utf8(bytes).ok()).unwrap_or_default()
    }

    pub(super) fn push(&mut self, text: &str) -> u32 {
        self.text.extend_from_slice(text.as_bytes());
        self.ends.push(self.text.len());
        self.text.push(0);
        self.ends.len() as u32 - 1
    }
}

/// What decodes a layer's values.
#[derive(Debug)]
pub(super) enum Data {
    Crate(CrateData),
    Text(TextData),
}

/// A file's prims and properties.
#[derive(Debug)]
pub(super) struct Layer {
    pub(super) tokens: Tokens,
    /// The first is the root above all prims.
    pub(super) nodes: Vec<Node>,
    /// Field sets: indices into `fields`, each set ended by [`NONE`].
    pub(super) sets: Vec<u32>,
    /// Name and handle of each field.
    pub(super) fields: Vec<(u32, u64)>,
    pub(super) data: Data,
}

/// Identifies a value of a layer; equal handles are equal values.
pub(super) type Handle = u64;

impl Layer {
    /// The name of a node.
    pub(super) fn name(&self, node: u32) -> &str {
        self.tokens.get(self.nodes[node as usize].name)
    }

    /// The nodes under `node`, prims or properties.
    fn list(&self, first: u32) -> impl Iterator<Item = u32> + '_ {
        let next = |node: u32| (node != NONE).then_some(node);
        std::iter::successors(next(first), move |node| next(self.nodes[*node as usize].next))
    }

    /// The prims under a node, in the file's order.
    pub(super) fn children(&self, node: u32) -> impl Iterator<Item = u32> + '_ {
        self.list(self.nodes[node as usize].child)
    }

    /// Its properties.
    pub(super) fn properties(&self, node: u32) -> impl Iterator<Item = u32> + '_ {
        self.list(self.nodes[node as usize].property)
    }

    /// The prim of that name under a node.
    pub(super) fn child(&self, node: u32, name: &str) -> Option<u32> {
        self.children(node).find(|child| self.name(*child) == name)
    }

    /// The property of that name.
    pub(super) fn property(&self, node: u32, name: &str) -> Option<u32> {
        self.properties(node).find(|property| self.name(*property) == name)
    }

    /// The prim at a path such as `/a/b`.
    pub(super) fn prim_at(&self, path: &str) -> Option<u32> {
        path.split('/').filter(|name| !name.is_empty()).try_fold(0, |node, name| self.child(node, name))
    }

    /// The handle of a field.
    pub(super) fn field(&self, node: u32, name: &str) -> Option<Handle> {
        let set = self.sets.get(self.nodes[node as usize].set as usize..)?;
        let fields =
            set.iter().take_while(|index| **index != NONE).filter_map(|index| self.fields.get(*index as usize));
        fields.into_iter().find(|(field, _)| self.tokens.get(*field) == name).map(|(_, handle)| *handle)
    }

    /// The value of a field.
    ///
    /// # Errors
    /// If the file is damaged there.
    pub(super) fn value_of(&self, node: u32, name: &str) -> Result<Option<Value>> {
        self.field(node, name).map(|handle| self.value(handle)).transpose()
    }

    /// The value of a handle; arrays stay where they are.
    ///
    /// # Errors
    /// If the file is damaged there.
    pub(super) fn value(&self, handle: Handle) -> Result<Value> {
        match &self.data {
            Data::Crate(data) => data.value(handle, &self.tokens),
            Data::Text(data) => Ok(data.value(handle)),
        }
    }

    /// The numbers of an array.
    ///
    /// # Errors
    /// If the file is damaged there.
    pub(super) fn array(&self, handle: Handle) -> Result<Array> {
        match &self.data {
            Data::Crate(data) => data.array(handle, &self.tokens),
            Data::Text(data) => data.array(handle),
        }
    }

    /// Whether the numbers of a value are halves.
    pub(super) fn is_half(&self, handle: Handle) -> bool {
        match &self.data {
            Data::Crate(_) => super::crate_values::is_half(handle),
            Data::Text(_) => super::text::is_half(handle),
        }
    }
}

/// A reference to another file, to another prim of this file, or to another prim of another file.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Reference {
    /// The file; empty for this one.
    pub(super) asset: String,
    /// The prim; empty for the file's default prim.
    pub(super) prim: String,
    /// Time here = offset + scale × time there.
    pub(super) offset: f64,
    pub(super) scale: f64,
}

/// A value, or what leads to it.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value {
    /// Explicitly none.
    Block,
    /// A whole number, a boolean or an enumeration.
    Int(i64),
    Double(f64),
    /// A token, string or asset path.
    Text(Arc<str>),
    /// Two, three or four numbers, or a matrix row by row.
    Numbers(Vec<f64>),
    /// x, y, z, w.
    Quaternion([f64; 4]),
    /// Tokens, strings or asset paths.
    Texts(Vec<Arc<str>>),
    /// An array of numbers, read by [`Layer::array`].
    Array,
    Samples(Samples),
    Dictionary(Vec<(String, Handle)>),
    References(Vec<Reference>),
    /// A type that has no meaning for geometry.
    Other,
}

impl Value {
    pub(super) fn text(&self) -> Option<&str> {
        if let Self::Text(text) = self { Some(text) } else { None }
    }

    pub(super) fn number(&self) -> Option<f64> {
        match self {
            Self::Double(x) => Some(*x),
            Self::Int(i) => Some(*i as f64),
            _ => None,
        }
    }
}

/// The values of an attribute at times, which increase.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Samples {
    pub(super) times: Arc<[f64]>,
    pub(super) values: Arc<[Handle]>,
}

/// The rows of an array.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Array {
    F1(Vec<f32>),
    F2(Vec<[f32; 2]>),
    F3(Vec<[f32; 3]>),
    F4(Vec<[f32; 4]>),
    /// x, y, z, w.
    Quaternions(Vec<[f32; 4]>),
    I1(Vec<i32>),
    I2(Vec<[i32; 2]>),
    I3(Vec<[i32; 3]>),
    I4(Vec<[i32; 4]>),
    /// Whole numbers, at least one of which does not fit in an i32.
    Long(Vec<i64>),
    Texts(Vec<Arc<str>>),
    /// Doubles of 1, 2, 3 or 4 a row; kept apart because points are transformed before they are rounded.
    Doubles(Vec<f64>, usize),
    /// Rows of another type, such as matrices.
    Other,
}

impl Array {
    /// Its rows.
    pub(super) fn len(&self) -> usize {
        match self {
            Self::F1(rows) => rows.len(),
            Self::F2(rows) => rows.len(),
            Self::F3(rows) => rows.len(),
            Self::F4(rows) | Self::Quaternions(rows) => rows.len(),
            Self::I1(rows) => rows.len(),
            Self::I2(rows) => rows.len(),
            Self::I3(rows) => rows.len(),
            Self::I4(rows) => rows.len(),
            Self::Long(rows) => rows.len(),
            Self::Texts(rows) => rows.len(),
            Self::Doubles(numbers, width) => numbers.len() / width,
            Self::Other => 0,
        }
    }
}
