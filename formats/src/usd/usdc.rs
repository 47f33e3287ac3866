//! `.usdc`: USD as a crate file, version 0.8.0.
//!
//! Header, values, sections, table of contents. Values are written as they arrive and referred to by 8-byte reps; the
//! sections, which describe the tree of prims and attributes, follow at the end, and the header is written last. Until
//! then no reader accepts the file. Version 0.8.0 is what USD itself writes and what all its versions read without a
//! warning.

use std::io::{self, Seek, SeekFrom, Write};

use engine::geometry::Column;

use super::coding::ints;
use super::stage::{Attribute, Encoder, Handle, Numbers, Prim, PrimGroup, Stage, UsdType, Values, numbers};
use super::structure::{Spec, SpecType, Structure};

/// Bytes before the first value.
const HEADER: usize = 88;

const ARRAY: u64 = 1 << 63;
const INLINED: u64 = 1 << 62;
const COMPRESSED: u64 = 1 << 61;

/// Value types by their number in a rep.
mod id {
    pub(super) const BOOL: u64 = 1;
    pub(super) const INT: u64 = 3;
    pub(super) const INT64: u64 = 5;
    pub(super) const FLOAT: u64 = 8;
    pub(super) const DOUBLE: u64 = 9;
    pub(super) const STRING: u64 = 10;
    pub(super) const TOKEN: u64 = 11;
    pub(super) const QUATF: u64 = 17;
    pub(super) const DOUBLE3: u64 = 23;
    pub(super) const FLOAT2: u64 = 20;
    pub(super) const FLOAT3: u64 = 24;
    pub(super) const INT3: u64 = 26;
    pub(super) const FLOAT4: u64 = 28;
    pub(super) const INT4: u64 = 30;
    pub(super) const TOKEN_VECTOR: u64 = 41;
    pub(super) const SPECIFIER: u64 = 42;
    pub(super) const VARIABILITY: u64 = 44;
    pub(super) const TIME_SAMPLES: u64 = 46;
    pub(super) const DOUBLE_VECTOR: u64 = 48;
    pub(super) const VALUE_BLOCK: u64 = 51;
}

/// Int arrays of at least this length are encoded; readers treat shorter ones as raw regardless of their rep.
const CODED_FROM: usize = 16;

/// Int arrays above this length are not encoded, because a chunk holds less than 2 GB.
const CODED_TO: usize = 1 << 28;

/// Size in bytes of a block of numbers that is converted at once.
const BLOCK: usize = 1 << 16;

/// Writes a crate file to `W`.
pub(super) struct Writer<W> {
    file: W,
    at: u64,
    block: Vec<u8>,
    structure: Structure,
}

impl<W: Write> Writer<W> {
    /// A writer to `file`, which is empty.
    pub(super) fn new(mut file: W) -> io::Result<Self> {
        file.write_all(&[0; HEADER])?;
        Ok(Self { file, at: HEADER as u64, block: Vec::with_capacity(BLOCK), structure: Structure::default() })
    }

    fn put(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.at += bytes.len() as u64;
        self.file.write_all(bytes)
    }

    /// Pads to a multiple of 8, so that readers can use an array without copying it, and returns the offset.
    fn align(&mut self) -> io::Result<u64> {
        let gap = self.at.next_multiple_of(8) - self.at;
        self.put(&[0; 8][..gap as usize])?;
        Ok(self.at)
    }

    fn put_numbers<T: Copy, const N: usize>(&mut self, numbers: &[T], bytes: impl Fn(T) -> [u8; N]) -> io::Result<()> {
        let mut block = std::mem::take(&mut self.block);
        for numbers in numbers.chunks(BLOCK / N) {
            block.resize(numbers.len() * N, 0);
            for (slot, x) in block.as_chunks_mut().0.iter_mut().zip(numbers) {
                *slot = bytes(*x);
            }
            self.put(&block)?;
        }
        self.block = block;
        Ok(())
    }

    fn double(&mut self, x: f64) -> io::Result<u64> {
        let single = x as f32;
        if f64::from(single).to_bits() == x.to_bits() {
            return Ok(rep(id::DOUBLE) | INLINED | u64::from(single.to_bits()));
        }
        let at = self.at;
        self.put(&x.to_le_bytes())?;
        Ok(rep(id::DOUBLE) | at)
    }

    fn double3(&mut self, xs: [f64; 3]) -> io::Result<u64> {
        let at = self.at;
        self.put_numbers(&xs, f64::to_le_bytes)?;
        Ok(rep(id::DOUBLE3) | at)
    }

    fn token(&mut self, text: &str) -> u64 {
        rep(id::TOKEN) | INLINED | u64::from(self.structure.token(text))
    }

    fn string(&mut self, text: &str) -> u64 {
        rep(id::STRING) | INLINED | u64::from(self.structure.string(text))
    }

    fn tokens(&mut self, kind: u64, texts: &[&str]) -> io::Result<u64> {
        let indices: Vec<u32> = texts.iter().map(|text| self.structure.token(text)).collect();
        let at = self.at;
        self.put(&(indices.len() as u64).to_le_bytes())?;
        self.put_numbers(&indices, u32::to_le_bytes)?;
        Ok(kind | at)
    }

    fn times(&mut self, times: &[f64]) -> io::Result<u64> {
        let at = self.at;
        self.put(&(times.len() as u64).to_le_bytes())?;
        self.put_numbers(times, f64::to_le_bytes)?;
        Ok(rep(id::DOUBLE_VECTOR) | at)
    }

    /// Each 8 is an offset from its own start: the rep of the times, and the number of values, follow directly after it.
    fn samples(&mut self, times: u64, values: &[Handle]) -> io::Result<u64> {
        let at = self.at;
        self.put_numbers(&[8, times, 8, values.len() as u64], u64::to_le_bytes)?;
        let value = |handle: Handle| if handle == Handle::BLOCK { rep(id::VALUE_BLOCK) } else { handle.0 };
        self.put_numbers(values, |handle| value(handle).to_le_bytes())?;
        Ok(rep(id::TIME_SAMPLES) | at)
    }

    fn array(&mut self, kind: UsdType, rows: &Column) -> io::Result<u64> {
        let array = rep(array_id(kind)) | ARRAY;
        if rows.is_empty() {
            return Ok(array);
        }
        let count = (rows.len() as u64).to_le_bytes();
        match numbers(rows) {
            Numbers::Ints(values) if kind == UsdType::Int && (CODED_FROM..=CODED_TO).contains(&values.len()) => {
                let coded = ints(values.iter().copied());
                if coded.len() < values.len() * 4 {
                    let at = self.align()?;
                    self.put(&count)?;
                    self.put(&coded)?;
                    return Ok(array | COMPRESSED | at);
                }
            }
            _ => {}
        }
        let at = self.align()?;
        self.put(&count)?;
        match numbers(rows) {
            Numbers::Ints(values) if kind == UsdType::Int64 => {
                self.put_numbers(values, |x| i64::from(x).to_le_bytes())?;
            }
            Numbers::Ints(values) => self.put_numbers(values, i32::to_le_bytes)?,
            Numbers::Floats(values) if kind == UsdType::TexCoord2 => {
                let (rows, _) = values.as_chunks::<3>();
                self.put_numbers(rows, |[s, t, _]| {
                    let mut bytes = [0; 8];
                    bytes[..4].copy_from_slice(&s.to_le_bytes());
                    bytes[4..].copy_from_slice(&t.to_le_bytes());
                    bytes
                })?;
            }
            Numbers::Floats(values) => self.put_numbers(values, f32::to_le_bytes)?,
        }
        Ok(array | at)
    }
}

impl<W: Write + Seek + Send> Encoder<W> for Writer<W> {
    /// The handle is the value's rep.
    fn store(&mut self, kind: UsdType, rows: &Column) -> io::Result<Handle> {
        self.array(kind, rows).map(Handle)
    }

    fn finish(mut self: Box<Self>, stage: &Stage) -> io::Result<W> {
        let root = self.stage(stage)?;
        self.close(&root)?;
        Ok(self.file)
    }
}

impl<W: Write + Seek> Writer<W> {
    fn stage(&mut self, stage: &Stage) -> io::Result<Spec> {
        let times = self.times(&stage.times)?;
        let mut xform = self.prim(&stage.name, "Xform");
        if let Some(name) = &stage.display_name {
            xform.field("displayName", self.string(name));
        }
        if stage.is_moved() {
            let translate = self.double3(stage.origin)?;
            xform.children.push(self.attribute("xformOp:translate", "double3", false, translate));
            let order = self.tokens(rep(id::TOKEN) | ARRAY, &["xformOp:translate"])?;
            xform.children.push(self.attribute("xformOpOrder", "token[]", true, order));
        }
        for PrimGroup { name, prims } in &stage.groups {
            let specs = prims.iter().map(|prim| self.geometry(prim, times)).collect::<io::Result<Vec<Spec>>>()?;
            match name {
                Some((name, own)) => {
                    let mut group = self.prim(name, "Xform");
                    if let Some(own) = own {
                        group.field("displayName", self.string(own));
                    }
                    group.children = specs;
                    xform.children.push(group);
                }
                None => xform.children.extend(specs),
            }
        }
        let mut root = Spec::new("", SpecType::PseudoRoot);
        root.field("defaultPrim", self.token(&stage.name));
        root.field("upAxis", self.token("Y"));
        for (name, value) in stage.numbers() {
            root.field(name, self.double(value)?);
        }
        root.children.push(xform);
        self.list_children(&mut root)?;
        Ok(root)
    }

    fn geometry(&mut self, prim: &Prim, times: u64) -> io::Result<Spec> {
        let mut spec = self.prim(prim.name, prim.schema);
        for (name, value) in prim.tokens {
            let value = self.token(value);
            spec.children.push(self.attribute(name, "token", true, value));
        }
        for attribute in &prim.attributes {
            let attribute = self.array_attribute(attribute, times)?;
            spec.children.push(attribute);
        }
        Ok(spec)
    }

    fn prim(&mut self, name: &str, schema: &str) -> Spec {
        let mut prim = Spec::new(name, SpecType::Prim);
        prim.field("specifier", rep(id::SPECIFIER) | INLINED);
        prim.field("typeName", self.token(schema));
        prim
    }

    fn attribute(&mut self, name: &str, kind: &str, uniform: bool, value: u64) -> Spec {
        let mut attribute = self.declaration(name, kind, uniform);
        attribute.field("default", value);
        attribute
    }

    fn declaration(&mut self, name: &str, kind: &str, uniform: bool) -> Spec {
        let mut attribute = Spec::new(name, SpecType::Attribute);
        attribute.field("custom", rep(id::BOOL) | INLINED);
        attribute.field("typeName", self.token(kind));
        attribute.field("variability", rep(id::VARIABILITY) | INLINED | u64::from(uniform));
        attribute
    }

    fn array_attribute(&mut self, attribute: &Attribute, times: u64) -> io::Result<Spec> {
        let Attribute { name, display_name, kind, interpolation, values } = attribute;
        let mut spec = self.declaration(name, kind.name(), false);
        if let Some(name) = display_name {
            spec.field("displayName", self.string(name));
        }
        if let Some(interpolation) = interpolation {
            // This must be a token: as a string it would print the same but not be found.
            spec.field("interpolation", self.token(interpolation.token()));
        }
        match values {
            Values::Default(handle) => spec.field("default", handle.0),
            Values::Samples(handles) => spec.field("timeSamples", self.samples(times, handles)?),
        }
        Ok(spec)
    }

    /// Adds the fields by which readers list a spec's properties and prims.
    fn list_children(&mut self, spec: &mut Spec) -> io::Result<()> {
        for child in &mut spec.children {
            self.list_children(child)?;
        }
        let named = |kind: SpecType| -> Vec<&str> {
            spec.children.iter().filter(|child| child.kind == kind).map(|child| &*child.name).collect()
        };
        let (properties, prims) = (named(SpecType::Attribute), named(SpecType::Prim));
        if !properties.is_empty() {
            let list = self.tokens(rep(id::TOKEN_VECTOR), &properties)?;
            spec.fields.push(("properties", list));
        }
        if !prims.is_empty() {
            let list = self.tokens(rep(id::TOKEN_VECTOR), &prims)?;
            spec.fields.push(("primChildren", list));
        }
        Ok(())
    }

    /// Sections, table of contents, header.
    fn close(&mut self, root: &Spec) -> io::Result<()> {
        let mut table = Vec::new();
        for (name, bytes) in std::mem::take(&mut self.structure).sections(root) {
            let start = self.at;
            self.put(&bytes)?;
            let mut entry = [0; 32];
            entry[..name.len()].copy_from_slice(name.as_bytes());
            entry[16..24].copy_from_slice(&start.to_le_bytes());
            entry[24..].copy_from_slice(&(bytes.len() as u64).to_le_bytes());
            table.push(entry);
        }
        let contents = self.at;
        self.put(&(table.len() as u64).to_le_bytes())?;
        self.put(table.as_flattened())?;
        self.file.seek(SeekFrom::Start(0))?;
        self.file.write_all(b"PXR-USDC\0\x08\0\0\0\0\0\0")?;
        self.file.write_all(&contents.to_le_bytes())?;
        self.file.flush()
    }
}

/// A rep of type `id`, all else 0.
fn rep(id: u64) -> u64 {
    id << 48
}

fn array_id(kind: UsdType) -> u64 {
    match kind {
        UsdType::Float => id::FLOAT,
        UsdType::Float3 | UsdType::Point3 | UsdType::Vector3 | UsdType::Normal3 | UsdType::Color3 => id::FLOAT3,
        UsdType::TexCoord2 => id::FLOAT2,
        UsdType::Color4 => id::FLOAT4,
        UsdType::Quat => id::QUATF,
        UsdType::Int => id::INT,
        UsdType::Int3 => id::INT3,
        UsdType::Int4 => id::INT4,
        UsdType::Int64 => id::INT64,
    }
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;
    use crate::usd::coding::tests::unints;

    fn writer() -> Writer<Cursor<Vec<u8>>> {
        Writer::new(Cursor::new(Vec::new())).unwrap()
    }

    fn stored(kind: UsdType, rows: Column) -> (u64, Vec<u8>) {
        let mut writer = writer();
        let rep = writer.array(kind, &rows).unwrap();
        (rep, writer.file.into_inner()[HEADER..].to_vec())
    }

    fn u64_at(bytes: &[u8], at: usize) -> u64 {
        u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap())
    }

    #[test]
    fn a_value_rep_encodes_type_form_and_offset() {
        let (rep, bytes) = stored(UsdType::Point3, Column::new(vec![[1.0, -0.0, 2.0_f32]]));
        assert_eq!(rep, 0x8018_0000_0000_0058);
        assert_eq!(bytes, [1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0x80, 0x3f, 0, 0, 0, 0x80, 0, 0, 0, 0x40]);
        let (rep, bytes) = stored(UsdType::Int64, Column::new(vec![-2]));
        assert_eq!(rep, 0x8005_0000_0000_0058);
        assert_eq!(bytes[8..], [0xfe, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff]);
        let (rep, bytes) = stored(UsdType::TexCoord2, Column::new(vec![[1.0, 2.0, 9.0_f32], [-0.0, 0.0, 9.0]]));
        assert_eq!((rep, bytes[0], bytes.len()), (0x8014_0000_0000_0058, 2, 24));
        assert_eq!(bytes[8..], [0, 0, 0x80, 0x3f, 0, 0, 0, 0x40, 0, 0, 0, 0x80, 0, 0, 0, 0]);
        let (rep, bytes) = stored(UsdType::Quat, Column::new(Vec::<[f32; 4]>::new()));
        assert_eq!((rep, bytes.len()), (0x8011_0000_0000_0000, 0), "an empty array has no offset");
    }

    #[test]
    fn sixteen_or_more_integers_are_encoded_if_that_is_shorter() {
        let (rep, bytes) = stored(UsdType::Int, Column::new(vec![5; 16]));
        assert_eq!(rep & COMPRESSED, COMPRESSED);
        assert_eq!((u64_at(&bytes, 0), unints(&bytes[8..], 16).0), (16, vec![5; 16]));
        let (rep, bytes) = stored(UsdType::Int, Column::new(vec![5; 15]));
        assert_eq!((rep & COMPRESSED, bytes.len()), (0, 8 + 60));
        let jumps: Vec<i32> = (0..100_u32).map(|i| (i * i).wrapping_mul(2_654_435_761).cast_signed()).collect();
        let (rep, bytes) = stored(UsdType::Int, Column::new(jumps));
        assert_eq!((rep & COMPRESSED, bytes.len()), (0, 8 + 400));
    }

    #[test]
    fn doubles_are_inlined_if_a_float_is_exact() {
        let mut writer = writer();
        assert_eq!(writer.double(24.0).unwrap(), 0x4009_0000_41c0_0000);
        assert_eq!(writer.double(-0.0).unwrap(), 0x4009_0000_8000_0000);
        assert_eq!(writer.double(0.1).unwrap(), 0x0009_0000_0000_0058);
        assert_eq!(writer.file.into_inner()[HEADER..], 0.1_f64.to_le_bytes());
    }

    /// The file computed by hand: `/a` (Xform) with `float x = 1.5` and `float y` sampled at 1 and 2, `/a/b` and `/c`
    /// (Scope).
    #[test]
    fn a_small_file_has_the_expected_length() {
        let mut writer = writer();
        let times = writer.times(&[1.0, 2.0]).unwrap();
        let float = |x: f32| rep(id::FLOAT) | INLINED | u64::from(x.to_bits());
        let x = writer.attribute("x", "float", false, float(1.5));
        let mut y = writer.declaration("y", "float", false);
        let samples = writer.samples(times, &[Handle(float(1.0)), Handle(float(2.0))]).unwrap();
        y.field("timeSamples", samples);
        let mut a = writer.prim("a", "Xform");
        a.children = vec![x, y, writer.prim("b", "Scope")];
        let mut root = Spec::new("", SpecType::PseudoRoot);
        root.field("defaultPrim", writer.token("a"));
        root.children = vec![a, writer.prim("c", "Scope")];
        writer.list_children(&mut root).unwrap();
        writer.close(&root).unwrap();
        let bytes = writer.file.into_inner();
        // One less than the 880 of the reference file, because tokens are numbered in another order.
        assert_eq!(bytes.len(), 879);
        assert_eq!(bytes[..16], *b"PXR-USDC\0\x08\0\0\0\0\0\0");
        let contents = u64_at(&bytes, 16) as usize;
        assert_eq!((u64_at(&bytes, contents), contents + 8 + 6 * 32), (6, bytes.len()));
        let mut end = None;
        for entry in bytes[contents + 8..].as_chunks::<32>().0 {
            let (start, size) = (u64_at(entry, 16), u64_at(entry, 24));
            assert_eq!(start, *end.get_or_insert(start), "sections follow each other");
            end = Some(start + size);
        }
        assert_eq!(end, Some(contents as u64));
    }
}
