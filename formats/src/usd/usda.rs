//! `.usda`: USD as text.
//!
//! The samples of an attribute are contiguous in the file but arrive frame by frame. Their text is stored in a
//! temporary spool file and copied at the end, so that memory is limited to the buffers. Every number is the shortest
//! text that reads back as the same bits; only a NaN loses its payload.

use std::io::{self, BufWriter, Read, Seek, SeekFrom, Write};

use engine::geometry::Column;

use super::stage::{Attribute, Encoder, Handle, Numbers, Prim, PrimGroup, Stage, UsdType, Values, numbers};

/// Size in bytes of the buffers of the file and the spool.
const BUFFER: usize = 1 << 18;

/// Text is written on in pieces of about this size in bytes.
const BLOCK: usize = 1 << 15;

/// Writes text to `W`; `S` is the spool.
pub(super) struct Writer<W: Write, S: Write> {
    file: BufWriter<W>,
    spool: BufWriter<S>,
    /// Where each array's text ends in the spool.
    ends: Vec<u64>,
}

impl<W: Write, S: Write> Writer<W, S> {
    /// A writer to `file` with an empty `spool`.
    pub(super) fn new(file: W, spool: S) -> Self {
        let buffered = BufWriter::with_capacity(BUFFER, spool);
        Self { file: BufWriter::with_capacity(BUFFER, file), spool: buffered, ends: Vec::new() }
    }
}

impl<W: Write + Send, S: Read + Write + Seek + Send> Encoder<W> for Writer<W, S> {
    /// The handle is the number of the array.
    fn store(&mut self, kind: UsdType, rows: &Column) -> io::Result<Handle> {
        let start = self.ends.last().copied().unwrap_or(0);
        self.ends.push(start + put_array(&mut self.spool, kind, rows)?);
        Ok(Handle(self.ends.len() as u64 - 1))
    }

    fn finish(self: Box<Self>, stage: &Stage) -> io::Result<W> {
        let Self { mut file, spool, ends } = *self;
        let mut spool = Spool { file: spool.into_inner().map_err(io::IntoInnerError::into_error)?, ends };
        put_header(&mut file, stage)?;
        writeln!(file, "\ndef Xform \"{}\"{}\n{{", stage.name, display_name(0, stage.display_name.as_ref()))?;
        if stage.is_moved() {
            let [x, y, z] = stage.origin.map(decimal);
            writeln!(file, "    double3 xformOp:translate = ({x}, {y}, {z})")?;
            writeln!(file, "    uniform token[] xformOpOrder = [\"xformOp:translate\"]")?;
        }
        let mut is_first = !stage.is_moved();
        for PrimGroup { name, prims } in &stage.groups {
            if let Some((name, own)) = name {
                let gap = if std::mem::take(&mut is_first) { "" } else { "\n" };
                writeln!(file, "{gap}    def Xform \"{name}\"{}\n    {{", display_name(1, own.as_ref()))?;
                is_first = true;
            }
            let depth = if name.is_some() { 2 } else { 1 };
            for prim in prims {
                if !std::mem::take(&mut is_first) {
                    writeln!(file)?;
                }
                put_prim(&mut file, &mut spool, prim, &stage.times, depth)?;
            }
            if name.is_some() {
                writeln!(file, "    }}")?;
                is_first = false;
            }
        }
        writeln!(file, "}}")?;
        file.into_inner().map_err(io::IntoInnerError::into_error)
    }
}

/// The text of arrays, one after another.
struct Spool<S> {
    file: S,
    ends: Vec<u64>,
}

impl<S: Read + Seek> Spool<S> {
    fn copy_to(&mut self, out: &mut impl Write, handle: Handle) -> io::Result<()> {
        if handle == Handle::BLOCK {
            return out.write_all(b"None");
        }
        let array = handle.0 as usize;
        let start = if array == 0 { 0 } else { self.ends[array - 1] };
        let length = self.ends[array] - start;
        self.file.seek(SeekFrom::Start(start))?;
        match io::copy(&mut (&mut self.file).take(length), out)? {
            copied if copied == length => Ok(()),
            _ => Err(io::ErrorKind::UnexpectedEof.into()),
        }
    }
}

fn put_header(file: &mut impl Write, stage: &Stage) -> io::Result<()> {
    writeln!(file, "#usda 1.0\n(\n    defaultPrim = \"{}\"", stage.name)?;
    for (name, value) in stage.numbers() {
        writeln!(file, "    {name} = {}", decimal(value))?;
    }
    writeln!(file, "    upAxis = \"Y\"\n)")
}

/// Writes a prim, indented by `depth`.
fn put_prim(
    file: &mut impl Write,
    spool: &mut Spool<impl Read + Seek>,
    prim: &Prim,
    times: &[f64],
    depth: usize,
) -> io::Result<()> {
    let indent = "    ".repeat(depth);
    writeln!(file, "{indent}def {} \"{}\"\n{indent}{{", prim.schema, prim.name)?;
    for (name, value) in prim.tokens {
        writeln!(file, "{indent}    uniform token {name} = \"{value}\"")?;
    }
    for attribute in &prim.attributes {
        put_attribute(file, spool, attribute, times, depth + 1)?;
    }
    writeln!(file, "{indent}}}")
}

/// A sampled attribute has its metadata in a separate declaration.
fn put_attribute(
    file: &mut impl Write,
    spool: &mut Spool<impl Read + Seek>,
    attribute: &Attribute,
    times: &[f64],
    depth: usize,
) -> io::Result<()> {
    let Attribute { name, display_name, kind, interpolation, values } = attribute;
    let indent = "    ".repeat(depth);
    let display_name = display_name.iter().map(|name| format!("displayName = {}", quoted(name)));
    let interpolation = interpolation.iter().map(|one| format!("interpolation = \"{}\"", one.token()));
    let lines: Vec<String> = display_name.chain(interpolation).collect();
    let declared = format!("{indent}{} {name}", kind.name());
    match values {
        Values::Default(handle) => {
            write!(file, "{declared} = ")?;
            spool.copy_to(file, *handle)?;
            writeln!(file, "{}", metadata(depth, lines))
        }
        Values::Samples(handles) => {
            if !lines.is_empty() {
                writeln!(file, "{declared}{}", metadata(depth, lines))?;
            }
            writeln!(file, "{declared}.timeSamples = {{")?;
            for (time, handle) in times.iter().zip(handles) {
                write!(file, "{indent}    {}: ", decimal(*time))?;
                spool.copy_to(file, *handle)?;
                writeln!(file, ",")?;
            }
            writeln!(file, "{indent}}}")
        }
    }
}

/// The metadata of a prim that is called otherwise than by its identifier.
fn display_name(depth: usize, name: Option<&String>) -> String {
    metadata(depth, name.iter().map(|name| format!("displayName = {}", quoted(name))).collect())
}

/// ` (…)` with one line each, indented by `depth`; empty without lines.
fn metadata(depth: usize, lines: Vec<String>) -> String {
    let indent = "    ".repeat(depth);
    let body: String = lines.iter().map(|line| format!("{indent}    {line}\n")).collect();
    if lines.is_empty() { body } else { format!(" (\n{body}{indent})") }
}

/// A string literal on one line.
pub(super) fn quoted(text: &str) -> String {
    let mut quoted = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => quoted.extend(['\\', c]),
            '\n' => quoted.push_str("\\n"),
            '\r' => quoted.push_str("\\r"),
            '\t' => quoted.push_str("\\t"),
            c if c.is_ascii_control() => quoted.push_str(&format!("\\x{:02x}", c as u32)),
            c => quoted.push(c),
        }
    }
    quoted.push('"');
    quoted
}

/// Writes an array and returns the length of its text.
fn put_array(out: &mut impl Write, kind: UsdType, rows: &Column) -> io::Result<u64> {
    let width = rows.kind().width();
    match numbers(rows) {
        Numbers::Floats(floats) if kind == UsdType::Quat => {
            // In text the real part comes first.
            put_rows(out, floats.as_chunks().0.iter().map(|&[x, y, z, w]| [w, x, y, z]), put_float)
        }
        Numbers::Floats(floats) if kind == UsdType::TexCoord2 => {
            put_rows(out, floats.as_chunks().0.iter().map(|&[s, t, _]| [s, t]), put_float)
        }
        Numbers::Floats(floats) => put_rows(out, floats.chunks_exact(width), put_float),
        Numbers::Ints(ints) => {
            let mut buffer = itoa::Buffer::new();
            let put = |text: &mut Vec<u8>, x| text.extend_from_slice(buffer.format(x).as_bytes());
            put_rows(out, ints.chunks_exact(width), put)
        }
    }
}

fn put_rows<T: Copy, R: AsRef<[T]>>(
    out: &mut impl Write,
    rows: impl Iterator<Item = R>,
    mut put: impl FnMut(&mut Vec<u8>, T),
) -> io::Result<u64> {
    let mut text = vec![b'['];
    let mut written = 0;
    for (i, row) in rows.enumerate() {
        let row = row.as_ref();
        let (open, close): (&[u8], &[u8]) = if row.len() > 1 { (b"(", b")") } else { (b"", b"") };
        text.extend_from_slice(if i == 0 { b"" } else { b", " });
        text.extend_from_slice(open);
        for (k, x) in row.iter().enumerate() {
            text.extend_from_slice(if k == 0 { b"" } else { b", " });
            put(&mut text, *x);
        }
        text.extend_from_slice(close);
        if text.len() > BLOCK {
            out.write_all(&text)?;
            written += text.len() as u64;
            text.clear();
        }
    }
    text.push(b']');
    out.write_all(&text)?;
    Ok(written + text.len() as u64)
}

fn put_float(text: &mut Vec<u8>, x: f32) {
    text.extend_from_slice(usd_spelling(zmij::Buffer::new().format(x)).as_bytes());
}

pub(super) fn decimal(x: f64) -> String {
    usd_spelling(zmij::Buffer::new().format(x)).to_owned()
}

/// USD writes NaN as `nan` and needs no `.0`.
fn usd_spelling(number: &str) -> &str {
    if number == "NaN" { "nan" } else { number.strip_suffix(".0").unwrap_or(number) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(kind: UsdType, rows: Column) -> String {
        let mut text = Vec::new();
        let length = put_array(&mut text, kind, &rows).unwrap();
        assert_eq!(length, text.len() as u64);
        String::from_utf8(text).unwrap()
    }

    #[test]
    fn numbers_are_the_shortest_text_of_their_bits() {
        let odd = vec![0.0, -0.0, 1.0, 0.1, -2.5, 1e-42, f32::MAX, 1e16, f32::INFINITY, f32::NEG_INFINITY, f32::NAN];
        let expected = "[0, -0, 1, 0.1, -2.5, 1e-42, 3.4028235e+38, 1e+16, inf, -inf, nan]";
        assert_eq!(text(UsdType::Float, Column::new(odd)), expected);
        assert_eq!(decimal(1001.5), "1001.5");
        assert_eq!(decimal(-3.0), "-3");
    }

    #[test]
    fn arbitrary_floats_read_back_bit_for_bit() {
        let mut bits = 1_u32;
        for _ in 0..200_000 {
            bits = bits.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let x = f32::from_bits(bits);
            let mut text = Vec::new();
            put_float(&mut text, x);
            // Via f64, as USD reads it.
            let read = std::str::from_utf8(&text).unwrap().parse::<f64>().unwrap() as f32;
            assert!(read.to_bits() == bits || (read.is_nan() && x.is_nan()), "{x:e}");
        }
    }

    #[test]
    fn rows_are_in_brackets_and_a_quaternion_starts_with_its_real_part() {
        assert_eq!(text(UsdType::Int, Column::new(vec![3, -1])), "[3, -1]");
        assert_eq!(text(UsdType::Int64, Column::new(vec![i32::MIN])), "[-2147483648]");
        assert_eq!(
            text(UsdType::Point3, Column::new(vec![[0.0, 1.5, 2.0], [3.0, 4.0, 5.0_f32]])),
            "[(0, 1.5, 2), (3, 4, 5)]"
        );
        assert_eq!(text(UsdType::Quat, Column::new(vec![[1.0, 2.0, 3.0, 4.0_f32]])), "[(4, 1, 2, 3)]");
        assert_eq!(text(UsdType::Color4, Column::new(vec![[1.0, 2.0, 3.0, 4.0_f32]])), "[(1, 2, 3, 4)]");
        assert_eq!(text(UsdType::Float3, Column::new(Vec::<[f32; 3]>::new())), "[]");
    }

    #[test]
    fn an_array_longer_than_the_buffers_is_written_whole() {
        let rows: Vec<i32> = (0..100_000).collect();
        let expected = format!("{rows:?}");
        assert_eq!(text(UsdType::Int, Column::new(rows)), expected);
    }

    #[test]
    fn a_string_is_written_on_one_line() {
        assert_eq!(quoted("a\"b\\c\nö\u{1}"), r#""a\"b\\c\nö\x01""#);
    }
}
