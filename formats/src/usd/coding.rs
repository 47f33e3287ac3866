//! The two encodings of a crate file: `chunk` for the bytes of a section, `ints` for 32-bit integers.
//!
//! Readers expect LZ4 in a chunk, but a valid LZ4 block may be one run of literals, so no compressor is needed: a chunk
//! is a little longer than its bytes, and `ints` is compact if neighbours differ by small or equal steps.

/// `bytes` as one chunk: a zero byte, then an LZ4 block of literals only.
pub(super) fn chunk(bytes: &[u8]) -> Vec<u8> {
    let mut out = Vec::with_capacity(bytes.len() + bytes.len() / 255 + 3);
    out.push(0);
    match u8::try_from(bytes.len()) {
        Ok(short @ 0..15) => out.push(short << 4),
        _ => {
            out.push(0xf0);
            let beyond = bytes.len() - 15;
            out.resize(out.len() + beyond / 255, 0xff);
            out.push((beyond % 255) as u8);
        }
    }
    out.extend_from_slice(bytes);
    out
}

/// Encodes `values`: the length of the chunk that follows (u64), then a chunk of steps from each value to the next. The
/// number of values is not stored. `values` must not be empty.
pub(super) fn ints(values: impl Iterator<Item = i32> + Clone) -> Vec<u8> {
    let chunk = chunk(&steps(values));
    let mut out = Vec::with_capacity(8 + chunk.len());
    out.extend_from_slice(&(chunk.len() as u64).to_le_bytes());
    out.extend_from_slice(&chunk);
    out
}

/// The most common step (i32); for each value two bits for the encoding of its step, four to a byte from the low end;
/// then all other steps, each in the smallest of 1, 2 and 4 bytes.
fn steps(values: impl Iterator<Item = i32> + Clone) -> Vec<u8> {
    let differences = || {
        values.clone().scan(0_i32, |before, value| {
            let step = value.wrapping_sub(*before);
            *before = value;
            Some(step)
        })
    };
    let common = commonest(differences().take(SAMPLED).collect());
    let (mut classes, mut tail) = (Vec::new(), Vec::new());
    for (i, step) in differences().enumerate() {
        let class = if step == common {
            0
        } else if let Ok(byte) = i8::try_from(step) {
            tail.extend_from_slice(&byte.to_le_bytes());
            1
        } else if let Ok(short) = i16::try_from(step) {
            tail.extend_from_slice(&short.to_le_bytes());
            2
        } else {
            tail.extend_from_slice(&step.to_le_bytes());
            3
        };
        match classes.last_mut() {
            Some(byte) if i % 4 != 0 => *byte |= class << (2 * (i % 4)),
            _ => classes.push(class),
        }
    }
    [&common.to_le_bytes()[..], &classes, &tail].concat()
}

/// The number of steps examined to find the most common one. Any choice is valid, so a long array need not be sorted as
/// a whole.
const SAMPLED: usize = 1 << 16;

/// The number that occurs most often, the smallest of equals; 0 for an empty list.
fn commonest(mut numbers: Vec<i32>) -> i32 {
    numbers.sort_unstable();
    let runs = numbers.chunk_by(|a, b| a == b).map(|run| (run.len(), std::cmp::Reverse(run[0])));
    runs.max().map_or(0, |(_, number)| number.0)
}

#[cfg(test)]
pub(super) mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Reads a chunk whose block is any LZ4 sequence of literals.
    pub(in super::super) fn unchunk(bytes: &[u8]) -> Vec<u8> {
        assert_eq!(bytes[0], 0, "one chunk");
        let (mut at, mut length) = (2, usize::from(bytes[1] >> 4));
        if length == 15 {
            loop {
                length += usize::from(bytes[at]);
                at += 1;
                if bytes[at - 1] < 255 {
                    break;
                }
            }
        }
        assert_eq!(bytes.len(), at + length, "literals fill the block");
        bytes[at..].to_vec()
    }

    /// Decodes `count` integers; returns them and the number of bytes read.
    pub(in super::super) fn unints(bytes: &[u8], count: usize) -> (Vec<i32>, usize) {
        let length = u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
        let codes = unchunk(&bytes[8..8 + length]);
        let common = i32::from_le_bytes(codes[..4].try_into().unwrap());
        let mut tail = &codes[4 + count.div_ceil(4)..];
        let mut value = 0_i32;
        let mut values = Vec::new();
        for i in 0..count {
            let width = [0, 1, 2, 4][usize::from(codes[4 + i / 4] >> (2 * (i % 4)) & 3)];
            let (step, rest) = tail.split_at(width);
            tail = rest;
            value = value.wrapping_add(match width {
                0 => common,
                1 => i32::from(i8::from_le_bytes(step.try_into().unwrap())),
                2 => i32::from(i16::from_le_bytes(step.try_into().unwrap())),
                _ => i32::from_le_bytes(step.try_into().unwrap()),
            });
            values.push(value);
        }
        assert!(tail.is_empty(), "every byte is read");
        (values, 8 + length)
    }

    #[test]
    fn a_chunk_is_literals_with_their_count() {
        assert_eq!(chunk(b"abc"), [0x00, 0x30, 0x61, 0x62, 0x63]);
        assert_eq!(chunk(&[b'x'; 300])[..4], [0x00, 0xf0, 0xff, 0x1e]);
        for length in [0, 1, 14, 15, 16, 269, 270, 271, 525, 70_000] {
            let bytes: Vec<u8> = (0..length).map(|i| (i * 7) as u8).collect();
            assert_eq!(unchunk(&chunk(&bytes)), bytes, "{length}");
        }
    }

    #[test]
    fn steps_are_encoded_as_computed_by_hand() {
        let values = [123, 124, 125, 100_125, 100_125, 100_126, 100_126];
        let expected = [1, 0, 0, 0, 0xc1, 0x11, 0x7b, 0xa0, 0x86, 0x01, 0, 0, 0];
        assert_eq!(steps(values.into_iter()), expected);
        assert_eq!(ints(values.into_iter())[..10], [15, 0, 0, 0, 0, 0, 0, 0, 0x00, 0xd0]);
    }

    #[test]
    fn equal_counts_take_two_bits_each() {
        assert!(ints(std::iter::repeat_n(5, 10_000)).len() < 10_000 / 4 + 40);
    }

    fn lengths() -> impl Strategy<Value = usize> {
        prop_oneof![1..6_usize, 15..18_usize, Just(63), 255..272_usize]
    }

    proptest! {
        #[test]
        fn arbitrary_integers_round_trip(values in lengths().prop_flat_map(|n| prop::collection::vec(any::<i32>(), n))) {
            let coded = ints(values.iter().copied());
            prop_assert_eq!(unints(&coded, values.len()), (values, coded.len()));
        }

        #[test]
        fn steps_of_every_width_round_trip(
            steps in prop::collection::vec(prop_oneof![Just(3), -200..200, -70_000..70_000, any::<i32>()], 1..300)
        ) {
            let sum = |total: &mut i32, step: i32| { *total = total.wrapping_add(step); Some(*total) };
            let values: Vec<i32> = steps.into_iter().scan(0, sum).collect();
            let coded = ints(values.iter().copied());
            prop_assert_eq!(unints(&coded, values.len()), (values, coded.len()));
        }
    }

    #[test]
    fn the_ends_of_the_range_and_a_long_array_round_trip() {
        let ends = vec![i32::MIN, i32::MAX, i32::MIN, 0, -1, i32::MAX, 127, -128, 128, 32_767, -32_768, 32_768];
        let long: Vec<i32> =
            (0..70_000_u32).map(|i| i.wrapping_mul(i).wrapping_mul(2_654_435_761).cast_signed()).collect();
        for values in [ends, long] {
            let coded = ints(values.iter().copied());
            assert_eq!(unints(&coded, values.len()), (values, coded.len()));
        }
    }
}
