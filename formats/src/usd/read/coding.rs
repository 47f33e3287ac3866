//! Decodes the two codings of a crate file: LZ4 chunks, and integers as steps from each to the next.
//!
//! No buffer is made before its size is known from the compressed bytes themselves: the sequences of an LZ4 block are
//! walked first, which needs no memory, so that a count that is wrong costs nothing.

use super::bytes::{Cursor, DAMAGED};
use crate::error::FilePosition;
use crate::{FormatError, Result};

/// The decompressed bytes of a chunk that was read at `at`; they must be at most `most`.
pub(super) fn unchunk(chunk: &[u8], at: usize, most: usize) -> Result<Vec<u8>> {
    let damaged = || FormatError::with_hint(FilePosition::Byte(at), "compressed data cannot be decompressed", DAMAGED);
    let mut cursor = Cursor::at(chunk, 0);
    let blocks: Vec<&[u8]> = match cursor.u8()? {
        0 => vec![cursor.take(cursor.left())?],
        count => (0..count)
            .map(|_| {
                let size = cursor.u32()?;
                cursor.take(size as usize)
            })
            .collect::<Result<_>>()?,
    };
    let sizes = blocks.iter().map(|block| block_size(block)).collect::<Option<Vec<usize>>>().ok_or_else(damaged)?;
    let total = sizes.iter().try_fold(0_usize, |sum, size| sum.checked_add(*size));
    let total = total.filter(|total| *total <= most).ok_or_else(damaged)?;
    let mut out = vec![0; total];
    let mut rest = out.as_mut_slice();
    for (block, size) in blocks.into_iter().zip(sizes) {
        let (here, after) = rest.split_at_mut(size);
        // An empty block cannot be decompressed.
        if size > 0 && lz4_flex::block::decompress_into(block, here).ok() != Some(size) {
            return Err(damaged());
        }
        rest = after;
    }
    Ok(out)
}

/// The decompressed size of an LZ4 block; `None` if its sequences do not end where it ends.
fn block_size(block: &[u8]) -> Option<usize> {
    let (mut at, mut size) = (0_usize, 0_usize);
    let long = |at: &mut usize, nibble: usize| -> Option<usize> {
        let mut length = nibble;
        if nibble == 15 {
            loop {
                let byte = *block.get(*at)?;
                *at += 1;
                length = length.checked_add(usize::from(byte))?;
                if byte < 255 {
                    break;
                }
            }
        }
        Some(length)
    };
    loop {
        let token = usize::from(*block.get(at)?);
        at += 1;
        let literals = long(&mut at, token >> 4)?;
        at = at.checked_add(literals).filter(|at| *at <= block.len())?;
        size = size.checked_add(literals)?;
        if at == block.len() {
            return Some(size);
        }
        at += 2;
        let matched = long(&mut at, token & 15)?;
        size = size.checked_add(matched.checked_add(4)?)?;
    }
}

/// An integer that is coded by its steps.
pub(super) trait Stepped: Copy {
    /// Bytes of a step of each class but 0: small, middle, full.
    const WIDTHS: [usize; 3];
    /// The value before the first.
    const ZERO: Self;
    /// A step of one of these widths, sign-extended.
    fn step(bytes: &[u8]) -> Option<Self>;
    /// The value after a step.
    fn after(self, step: Self) -> Self;
}

impl Stepped for i32 {
    const WIDTHS: [usize; 3] = [1, 2, 4];
    const ZERO: Self = 0;

    fn step(bytes: &[u8]) -> Option<Self> {
        match *bytes {
            [a] => Some(Self::from(a.cast_signed())),
            [a, b] => Some(Self::from(i16::from_le_bytes([a, b]))),
            _ => Some(Self::from_le_bytes(bytes.try_into().ok()?)),
        }
    }

    fn after(self, step: Self) -> Self {
        self.wrapping_add(step)
    }
}

impl Stepped for i64 {
    const WIDTHS: [usize; 3] = [2, 4, 8];
    const ZERO: Self = 0;

    fn step(bytes: &[u8]) -> Option<Self> {
        match *bytes {
            [a, b] => Some(Self::from(i16::from_le_bytes([a, b]))),
            [a, b, c, d] => Some(Self::from(i32::from_le_bytes([a, b, c, d]))),
            _ => Some(Self::from_le_bytes(bytes.try_into().ok()?)),
        }
    }

    fn after(self, step: Self) -> Self {
        self.wrapping_add(step)
    }
}

/// Reads `count` coded integers: the length of a chunk, then the chunk.
pub(super) fn ints<T: Stepped>(cursor: &mut Cursor<'_>, count: usize) -> Result<Vec<T>> {
    if count == 0 {
        return Ok(Vec::new());
    }
    let at = cursor.position();
    let length = cursor.u64()?;
    let length = cursor.checked(at, length, 1)?;
    let chunk = cursor.take(length)?;
    let full = T::WIDTHS[2];
    let classes = count.div_ceil(4);
    let most = count.checked_mul(full).and_then(|steps| steps.checked_add(full + classes)).unwrap_or(usize::MAX);
    let codes = unchunk(chunk, at, most)?;
    decode(&codes, count).ok_or_else(|| {
        let fact = format!("{count} integers are not coded in {} bytes", codes.len());
        FormatError::with_hint(FilePosition::Byte(at), fact, DAMAGED)
    })
}

/// The most common step; two bits for the class of each step, four to a byte from the low end; then the steps of the
/// other classes.
fn decode<T: Stepped>(codes: &[u8], count: usize) -> Option<Vec<T>> {
    let (common, rest) = codes.split_at_checked(T::WIDTHS[2])?;
    let (classes, mut steps) = rest.split_at_checked(count.div_ceil(4))?;
    let common = T::step(common)?;
    let mut value = T::ZERO;
    let mut values = Vec::with_capacity(count);
    for i in 0..count {
        let step = match classes[i / 4] >> (2 * (i % 4)) & 3 {
            0 => common,
            class => {
                let (step, after) = steps.split_at_checked(T::WIDTHS[usize::from(class) - 1])?;
                steps = after;
                T::step(step)?
            }
        };
        value = value.after(step);
        values.push(value);
    }
    Some(values)
}

#[cfg(test)]
mod tests {
    use super::super::super::coding;
    use super::*;

    #[test]
    fn what_the_writer_codes_is_decoded() {
        for count in [1, 2, 5, 15, 16, 17, 255, 271, 70_000_u32] {
            let jumpy = |i: u32| {
                if i.is_multiple_of(3) { i.cast_signed() } else { i.wrapping_mul(2_654_435_761).cast_signed() }
            };
            let values: Vec<i32> = (0..count).map(jumpy).collect();
            let coded = coding::ints(values.iter().copied());
            let mut cursor = Cursor::at(&coded, 0);
            assert_eq!(ints::<i32>(&mut cursor, values.len()).unwrap(), values, "{count}");
            assert_eq!(cursor.left(), 0);
        }
    }

    #[test]
    fn steps_are_decoded_as_computed_by_hand() {
        let codes = [1, 0, 0, 0, 0xc1, 0x11, 0x7b, 0xa0, 0x86, 0x01, 0, 0, 0];
        let expected = [123, 124, 125, 100_125, 100_125, 100_126, 100_126];
        assert_eq!(decode::<i32>(&codes, 7).unwrap(), expected);
        // The common step 1; classes 0, 1 (two bytes, −2), 3 (eight bytes, 2⁴⁰).
        let mut codes = 1_i64.to_le_bytes().to_vec();
        codes.push(0b11_01_00);
        codes.extend((-2_i16).to_le_bytes());
        codes.extend((1_i64 << 40).to_le_bytes());
        assert_eq!(decode::<i64>(&codes, 3).unwrap(), [1, -1, (1 << 40) - 1]);
        assert_eq!(decode::<i64>(&codes[..18], 3), None, "a step is missing");
    }

    #[test]
    fn matches_and_several_blocks_are_decompressed() {
        // `ab`, then 8 bytes from 2 back, then the literal `c`.
        let block = [0x24, b'a', b'b', 2, 0, 0x10, b'c'];
        let chunk = [&[0][..], &block].concat();
        assert_eq!(unchunk(&chunk, 0, 100).unwrap(), b"ababababab".iter().chain(b"c").copied().collect::<Vec<u8>>());
        let size = (block.len() as u32).to_le_bytes();
        let two = [&[2][..], &size, &block, &size, &block].concat();
        assert_eq!(unchunk(&two, 0, 100).unwrap().len(), 22);
        assert!(unchunk(&two, 0, 21).is_err(), "more than expected");
    }

    #[test]
    fn damaged_blocks_are_refused_before_anything_is_allocated() {
        for block in
            [&[][..], &[0x20, b'a'], &[0xf0], &[0xf0, 0xff], &[0x14, b'a', 9, 0], &[0x14, b'a', 9, 0, 0x10, b'c']]
        {
            let chunk = [&[0][..], block].concat();
            let error = unchunk(&chunk, 7, 1 << 40).unwrap_err();
            assert_eq!(error.to_string(), "byte 7: compressed data cannot be decompressed", "{block:?}");
        }
    }
}
