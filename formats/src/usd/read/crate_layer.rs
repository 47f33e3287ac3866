//! The structure of a crate file, versions 0.4 to 0.12: sections, tokens, fields, paths and specs.

use super::bytes::{Bytes, Cursor, DAMAGED};
use super::coding::{ints, unchunk};
use super::crate_values::CrateData;
use super::layer::{Data, Layer, NONE, Node, NodeKind, Tokens};
use crate::error::FilePosition;
use crate::{FormatError, Result};

/// The first bytes of a crate file.
pub(super) const MAGIC: &[u8] = b"PXR-USDC";

/// What a file that is not read can be turned into.
pub(super) const CONVERT: &str = "convert it first: usdcat -o out.usdc in.usd";

fn damaged(at: usize, fact: impl Into<String>) -> FormatError {
    FormatError::with_hint(FilePosition::Byte(at), fact, DAMAGED)
}

/// The layer of a crate file.
///
/// # Errors
/// If it is damaged, or of a version that is not read.
pub(super) fn layer(bytes: Bytes) -> Result<Layer> {
    let all = bytes.get();
    let mut header = Cursor::at(all, MAGIC.len() as u64);
    let version = [header.u8()?, header.u8()?, header.u8()?];
    if !([0, 4, 0]..=[0, 12, u8::MAX]).contains(&version) {
        let [major, minor, patch] = version;
        let fact = format!("crate {major}.{minor}.{patch} is not read; 0.4 to 0.12 are");
        return Err(FormatError::with_hint(FilePosition::File, fact, CONVERT));
    }
    let contents = Cursor::at(all, 16).u64()?;
    let sections = Sections { all, contents: table(all, contents)? };

    let tokens = tokens(sections.cursor("TOKENS")?)?;
    let mut section = sections.cursor("STRINGS")?;
    let strings = (0..section.count(4)?).map(|_| section.u32()).collect::<Result<Vec<u32>>>()?;
    let fields = fields(sections.cursor("FIELDS")?)?;
    let mut section = sections.cursor("FIELDSETS")?;
    let sets = unsigned(&mut section)?;

    let mut tree = Tree::read(sections.cursor("PATHS")?, &tokens)?;
    tree.add_specs(sections.cursor("SPECS")?, sets.len())?;
    let Tree { nodes, of_path, parents } = tree;
    let data = CrateData { bytes: bytes.clone(), version, strings, of_path, parents, names: Vec::new() };
    let mut layer = Layer { tokens, nodes, sets, fields, data: Data::Crate(data) };
    let names = layer.nodes.iter().map(|node| node.name).collect();
    if let Data::Crate(data) = &mut layer.data {
        data.names = names;
    }
    super::order::sort_children(&mut layer)?;
    Ok(layer)
}

/// Names, starts and sizes of the sections.
struct Sections<'a> {
    all: &'a [u8],
    contents: Vec<([u8; 16], u64, u64)>,
}

fn table(all: &[u8], at: u64) -> Result<Vec<([u8; 16], u64, u64)>> {
    let mut cursor = Cursor::at(all, at);
    let count = cursor.count(32)?;
    let mut table = Vec::with_capacity(count);
    for _ in 0..count {
        let mut name = [0; 16];
        name.copy_from_slice(cursor.take(16)?);
        table.push((name, cursor.u64()?, cursor.u64()?));
    }
    Ok(table)
}

impl<'a> Sections<'a> {
    /// A cursor that ends with the section.
    fn cursor(&self, name: &str) -> Result<Cursor<'a>> {
        let is_it = |found: &[u8; 16]| found.split(|byte| *byte == 0).next() == Some(name.as_bytes());
        let found = self.contents.iter().find(|(found, ..)| is_it(found));
        let end = found.and_then(|(_, start, size)| start.checked_add(*size).map(|end| (*start, end)));
        let section = end.and_then(|(start, end)| Some((start, self.all.get(..usize::try_from(end).ok()?)?)));
        let (start, up_to_end) =
            section.ok_or_else(|| damaged(0, format!("the section {name} is missing or cut off")))?;
        Ok(Cursor::at(up_to_end, start))
    }
}

/// A count and as many integers.
fn unsigned(cursor: &mut Cursor<'_>) -> Result<Vec<u32>> {
    let count = counted(cursor)?;
    Ok(ints::<i32>(cursor, count)?.into_iter().map(i32::cast_unsigned).collect())
}

/// A count of things that are coded as integers.
fn counted(cursor: &mut Cursor<'_>) -> Result<usize> {
    let at = cursor.position();
    let count = cursor.u64()?;
    // The coding takes at least a quarter of a byte for each, compressed at most 255 times.
    cursor.checked(at, count / 1024, 1)?;
    usize::try_from(count).map_err(|_| damaged(at, format!("it has {count} entries")))
}

fn tokens(mut cursor: Cursor<'_>) -> Result<Tokens> {
    let at = cursor.position();
    let (count, size, compressed) = (cursor.u64()?, cursor.u64()?, cursor.u64()?);
    let compressed = cursor.checked(at, compressed, 1)?;
    let text = unchunk(cursor.take(compressed)?, at, usize::try_from(size).unwrap_or(usize::MAX))?;
    let ends: Vec<usize> = text.iter().enumerate().filter(|(_, byte)| **byte == 0).map(|(at, _)| at).collect();
    if ends.len() as u64 != count {
        return Err(damaged(at, format!("it has {} tokens, expected {count}", ends.len())));
    }
    Ok(Tokens { text, ends })
}

fn fields(mut cursor: Cursor<'_>) -> Result<Vec<(u32, u64)>> {
    let names = unsigned(&mut cursor)?;
    let at = cursor.position();
    let compressed = cursor.count(1)?;
    let reps = unchunk(cursor.take(compressed)?, at, names.len().saturating_mul(8))?;
    let reps = reps.as_chunks().0;
    if reps.len() != names.len() {
        return Err(damaged(at, format!("it has {} values of {} fields", reps.len(), names.len())));
    }
    Ok(names.into_iter().zip(reps.iter().map(|rep| u64::from_le_bytes(*rep))).collect())
}

/// Paths and specs as nodes.
struct Tree {
    nodes: Vec<Node>,
    /// The node of each path.
    of_path: Vec<u32>,
    /// The node above each node.
    parents: Vec<u32>,
}

impl Tree {
    /// Rebuilds the tree from jumps, with a stack of its own. Each entry is visited once, or the file is damaged.
    fn read(mut cursor: Cursor<'_>, tokens: &Tokens) -> Result<Self> {
        let at = cursor.position();
        let paths = counted(&mut cursor)?;
        let count = counted(&mut cursor)?;
        let wrong = |what: &str| damaged(at, format!("the tree of paths {what}"));
        if count == 0 || count > paths {
            return Err(wrong("has no root, or more entries than paths"));
        }
        let places = ints::<i32>(&mut cursor, count)?;
        let elements = ints::<i32>(&mut cursor, count)?;
        let jumps = ints::<i32>(&mut cursor, count)?;
        // As many as there are entries: a path that no entry has cannot be referred to.
        let mut of_path = vec![NONE; count];
        let (mut nodes, mut parents): (Vec<Node>, Vec<u32>) = (Vec::with_capacity(count), Vec::with_capacity(count));
        // The last prim and the last property of each node.
        let mut last = vec![[NONE; 2]; count];
        let mut siblings: Vec<(usize, u32)> = Vec::new();
        let (mut entry, mut parent) = (0_usize, NONE);
        loop {
            if nodes.len() == count || entry >= count {
                return Err(wrong("goes round, or beyond its end"));
            }
            let node = nodes.len() as u32;
            let path = usize::try_from(places[entry]).ok().filter(|path| *path < paths);
            let path = path.ok_or_else(|| wrong("has a path that does not exist"))?;
            if path >= of_path.len() {
                of_path.resize(path + 1, NONE);
            }
            of_path[path] = node;
            let element = elements[entry];
            let is_property = element < 0;
            let name = element.unsigned_abs();
            if name as usize >= tokens.ends.len() {
                return Err(wrong("has a name that does not exist"));
            }
            nodes.push(Node::new(name, if parent == NONE { NodeKind::Root } else { NodeKind::Other }, NONE));
            parents.push(parent);
            if let Some(above) = nodes.get_mut(parent as usize).filter(|_| parent != NONE) {
                let before = std::mem::replace(&mut last[parent as usize][usize::from(is_property)], node);
                match (before, is_property) {
                    (NONE, false) => above.child = node,
                    (NONE, true) => above.property = node,
                    (before, _) => nodes[before as usize].next = node,
                }
            }
            match jumps[entry] {
                0 => entry += 1,
                jump if jump > 0 => {
                    siblings.push((entry + jump.unsigned_abs() as usize, parent));
                    (entry, parent) = (entry + 1, node);
                }
                -1 => (entry, parent) = (entry + 1, node),
                _ => match siblings.pop() {
                    Some(next) => (entry, parent) = next,
                    None => break,
                },
            }
        }
        Ok(Self { nodes, of_path, parents })
    }

    fn add_specs(&mut self, mut cursor: Cursor<'_>, sets: usize) -> Result<()> {
        let at = cursor.position();
        let count = counted(&mut cursor)?;
        let paths = ints::<i32>(&mut cursor, count)?;
        let starts = ints::<i32>(&mut cursor, count)?;
        let kinds = ints::<i32>(&mut cursor, count)?;
        for ((path, start), kind) in paths.into_iter().zip(starts).zip(kinds) {
            let node = usize::try_from(path).ok().and_then(|path| self.of_path.get(path).copied());
            let node = node.and_then(|node| self.nodes.get_mut(node as usize));
            let start = u32::try_from(start).ok().filter(|start| (*start as usize) < sets);
            let (Some(node), Some(start)) = (node, start) else {
                return Err(damaged(at, "a spec has a path or fields that do not exist"));
            };
            node.set = start;
            node.kind = match kind {
                1 => NodeKind::Attribute,
                6 => NodeKind::Prim,
                7 => NodeKind::Root,
                _ => NodeKind::Other,
            };
        }
        Ok(())
    }
}
