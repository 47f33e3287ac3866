//! The sections of a crate file: a tree of specs as tables that refer to each other by number.
//!
//! Tokens are names, fields are (name, value) pairs, field sets belong to specs; equal ones are stored once. The tree
//! itself is a list of paths, depth first, with jumps. The limit: one tree per file, written when it is complete.

use std::collections::BTreeMap;

use super::coding::{chunk, ints};

/// The type of a spec, with its number in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SpecType {
    Attribute = 1,
    Prim = 6,
    PseudoRoot = 7,
}

/// A prim, attribute or the root above all prims.
#[derive(Debug)]
pub(super) struct Spec {
    /// Its own name, not its path.
    pub(super) name: String,
    pub(super) kind: SpecType,
    /// Names and value reps.
    pub(super) fields: Vec<(&'static str, u64)>,
    /// Attributes first, then prims.
    pub(super) children: Vec<Spec>,
}

impl Spec {
    /// A spec with no field and no child.
    pub(super) fn new(name: &str, kind: SpecType) -> Self {
        Self { name: name.to_owned(), kind, fields: Vec::new(), children: Vec::new() }
    }

    /// Adds a field.
    pub(super) fn field(&mut self, name: &'static str, value: u64) {
        self.fields.push((name, value));
    }

    /// The number of paths in this subtree, itself included.
    fn paths(&self) -> usize {
        1 + self.children.iter().map(Self::paths).sum::<usize>()
    }
}

/// The tables under construction.
#[derive(Debug)]
pub(super) struct Structure {
    tokens: Numbered<String>,
    /// Indices of the tokens that are used as strings.
    strings: Numbered<u32>,
    fields: Numbered<(u32, u64)>,
    sets: BTreeMap<Vec<u32>, u32>,
    /// All field sets, concatenated, each followed by [`END`].
    set_list: Vec<u32>,
    paths: Vec<Path>,
}

/// After each field set.
const END: u32 = u32::MAX;

#[derive(Debug)]
struct Path {
    element: i32,
    jump: i32,
    set: u32,
    kind: SpecType,
}

impl Default for Structure {
    fn default() -> Self {
        let mut tokens = Numbered::default();
        // Properties are distinguished from prims by the sign of their token, so token 0 must not be used as a name.
        tokens.number(String::new());
        Self {
            tokens,
            strings: Numbered::default(),
            fields: Numbered::default(),
            sets: BTreeMap::new(),
            set_list: Vec::new(),
            paths: Vec::new(),
        }
    }
}

impl Structure {
    /// The index of a token.
    pub(super) fn token(&mut self, text: &str) -> u32 {
        self.tokens.number(text.to_owned())
    }

    /// The index of a string.
    pub(super) fn string(&mut self, text: &str) -> u32 {
        let token = self.token(text);
        self.strings.number(token)
    }

    /// The name and bytes of each section, in file order.
    pub(super) fn sections(mut self, root: &Spec) -> [(&'static str, Vec<u8>); 6] {
        self.add(root, false);
        let Self { tokens, strings, fields, set_list, paths, .. } = self;
        let indices = || 0..paths.len() as i32;
        let text: Vec<u8> = tokens.list.iter().flat_map(|token| token.bytes().chain([0])).collect();
        let values: Vec<u8> = fields.list.iter().flat_map(|(_, value)| value.to_le_bytes()).collect();
        let names = fields.list.iter().map(|(name, _)| name.cast_signed());
        let string_tokens = strings.list.iter().flat_map(|token| token.to_le_bytes());
        [
            ("TOKENS", [&count(tokens.list.len())[..], &count(text.len()), &sized(&chunk(&text))].concat()),
            ("STRINGS", count(strings.list.len()).into_iter().chain(string_tokens).collect()),
            ("FIELDS", [&count(fields.list.len())[..], &ints(names), &sized(&chunk(&values))].concat()),
            ("FIELDSETS", [&count(set_list.len())[..], &ints(set_list.iter().map(|n| n.cast_signed()))].concat()),
            (
                "PATHS",
                [
                    &count(paths.len())[..],
                    &count(paths.len()),
                    &ints(indices()),
                    &ints(paths.iter().map(|path| path.element)),
                    &ints(paths.iter().map(|path| path.jump)),
                ]
                .concat(),
            ),
            (
                "SPECS",
                [
                    &count(paths.len())[..],
                    &ints(indices()),
                    &ints(paths.iter().map(|path| path.set.cast_signed())),
                    &ints(paths.iter().map(|path| path.kind as i32)),
                ]
                .concat(),
            ),
        ]
    }

    /// Adds a spec and its children; `sibling` is whether another child of the same parent follows.
    fn add(&mut self, spec: &Spec, sibling: bool) {
        let token = self.token(&spec.name).cast_signed();
        let element = if spec.kind == SpecType::Attribute { -token } else { token };
        let jump = match (spec.children.is_empty(), sibling) {
            (true, false) => -2,
            (false, false) => -1,
            (true, true) => 0,
            (false, true) => spec.paths() as i32,
        };
        let set = self.field_set(&spec.fields);
        self.paths.push(Path { element, jump, set, kind: spec.kind });
        for (i, child) in spec.children.iter().enumerate() {
            self.add(child, i + 1 < spec.children.len());
        }
    }

    fn field_set(&mut self, fields: &[(&'static str, u64)]) -> u32 {
        let set: Vec<u32> = fields
            .iter()
            .map(|(name, value)| {
                let name = self.token(name);
                self.fields.number((name, *value))
            })
            .collect();
        let start = self.set_list.len() as u32;
        let list = &mut self.set_list;
        *self.sets.entry(set).or_insert_with_key(|set| {
            list.extend_from_slice(set);
            list.push(END);
            start
        })
    }
}

/// Distinct values in the order of their first occurrence.
#[derive(Debug)]
struct Numbered<T> {
    list: Vec<T>,
    numbers: BTreeMap<T, u32>,
}

impl<T> Default for Numbered<T> {
    fn default() -> Self {
        Self { list: Vec::new(), numbers: BTreeMap::new() }
    }
}

impl<T: Ord + Clone> Numbered<T> {
    fn number(&mut self, value: T) -> u32 {
        let next = self.list.len() as u32;
        let list = &mut self.list;
        *self.numbers.entry(value).or_insert_with_key(|value| {
            list.push(value.clone());
            next
        })
    }
}

fn count(n: usize) -> [u8; 8] {
    (n as u64).to_le_bytes()
}

/// Bytes preceded by their length.
fn sized(bytes: &[u8]) -> Vec<u8> {
    [&count(bytes.len())[..], bytes].concat()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::usd::coding::tests::{unchunk, unints};

    fn spec(name: &str, kind: SpecType, children: Vec<Spec>) -> Spec {
        Spec { name: name.into(), kind, fields: vec![("specifier", 7)], children }
    }

    /// Reads a section's coded integer lists, after `counts` plain u64.
    fn lists(bytes: &[u8], counts: usize, lists: usize) -> Vec<Vec<i32>> {
        let count = u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
        let mut at = counts * 8;
        let read = (0..lists).map(|_| {
            let (values, length) = unints(&bytes[at..], count);
            at += length;
            values
        });
        let read = read.collect();
        assert_eq!(at, bytes.len());
        read
    }

    fn tokens(section: &[u8]) -> Vec<String> {
        let [count, length, _] =
            [0, 8, 16].map(|at| u64::from_le_bytes(section[at..at + 8].try_into().unwrap()) as usize);
        let text = String::from_utf8(unchunk(&section[24..])).unwrap();
        assert_eq!(text.len(), length);
        let tokens: Vec<String> = text.split_terminator('\0').map(str::to_owned).collect();
        assert_eq!(tokens.len(), count);
        tokens
    }

    #[test]
    fn paths_are_as_computed_by_hand() {
        let attribute = |name| spec(name, SpecType::Attribute, vec![]);
        let b = spec("b", SpecType::Prim, vec![]);
        let a = spec("a", SpecType::Prim, vec![attribute("x"), attribute("y"), b]);
        let root = spec("", SpecType::PseudoRoot, vec![a, spec("c", SpecType::Prim, vec![])]);
        let mut structure = Structure::default();
        let [a, x, y, b, c] = ["a", "x", "y", "b", "c"].map(|name| structure.token(name).cast_signed());
        let sections = structure.sections(&root);
        assert_eq!(
            sections.each_ref().map(|(name, _)| *name),
            ["TOKENS", "STRINGS", "FIELDS", "FIELDSETS", "PATHS", "SPECS"]
        );
        assert_eq!(tokens(&sections[0].1)[0], "", "token 0 is the name of the root only");
        let paths = lists(&sections[4].1, 2, 3);
        assert_eq!(paths[0], [0, 1, 2, 3, 4, 5]);
        assert_eq!(paths[1], [0, a, -x, -y, b, c]);
        assert_eq!(paths[2], [-1, 4, 0, 0, -2, -2]);
        let specs = lists(&sections[5].1, 1, 3);
        assert_eq!(specs[1], [0; 6], "equal field sets are one");
        assert_eq!(specs[2], [7, 6, 1, 1, 6, 6]);
    }

    #[test]
    fn strings_and_tokens_are_numbered_separately() {
        let mut structure = Structure::default();
        assert_eq!(structure.token("x"), 1);
        assert_eq!((structure.string("a-b"), structure.string("x"), structure.string("a-b")), (0, 1, 0));
        let sections = structure.sections(&spec("", SpecType::PseudoRoot, vec![]));
        assert_eq!(sections[1].1, [2, 0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 0, 1, 0, 0, 0]);
    }

    /// Rebuilds all paths from the jumps, as a reader does.
    fn rebuilt(tokens: &[String], elements: &[i32], jumps: &[i32]) -> Vec<String> {
        fn walk(mut at: usize, parent: &str, file: (&[String], &[i32], &[i32]), paths: &mut Vec<String>) {
            let (tokens, elements, jumps) = file;
            loop {
                let name = &tokens[elements[at].unsigned_abs() as usize];
                let path = format!("{parent}{}{name}", if elements[at] < 0 { "." } else { "/" });
                paths.push(path.clone());
                let jump = jumps[at];
                if jump > 0 || jump == -1 {
                    walk(at + 1, &path, file, paths);
                }
                match jump {
                    0 => at += 1,
                    jump if jump > 0 => at += jump as usize,
                    _ => return,
                }
            }
        }
        let mut paths = Vec::new();
        walk(0, "", (tokens, elements, jumps), &mut paths);
        paths
    }

    fn depth_first(spec: &Spec, parent: &str, paths: &mut Vec<String>) {
        let path = format!("{parent}{}{}", if spec.kind == SpecType::Attribute { "." } else { "/" }, spec.name);
        paths.push(path.clone());
        spec.children.iter().for_each(|child| depth_first(child, &path, paths));
    }

    fn trees() -> impl Strategy<Value = Spec> {
        let attributes = |n: usize| (0..n).map(|i| spec(&format!("x{i}"), SpecType::Attribute, vec![]));
        let leaf = (0..4_usize).prop_map(move |n| attributes(n).collect::<Vec<_>>());
        let below = leaf.prop_recursive(5, 60, 5, move |inner| {
            (0..4_usize, prop::collection::vec(inner, 0..5)).prop_map(move |(n, prims)| {
                let named = (0..).zip(prims).map(|(i, children)| spec(&format!("p{i}"), SpecType::Prim, children));
                attributes(n).chain(named).collect()
            })
        });
        below.prop_map(|children| spec("", SpecType::PseudoRoot, children))
    }

    proptest! {
        #[test]
        fn arbitrary_trees_are_rebuilt_from_their_jumps(tree in trees()) {
            let sections = Structure::default().sections(&tree);
            let paths = lists(&sections[4].1, 2, 3);
            let mut expected = Vec::new();
            depth_first(&tree, "", &mut expected);
            prop_assert_eq!(rebuilt(&tokens(&sections[0].1), &paths[1], &paths[2]), expected);
        }
    }
}
