//! Mutations of texts and files as bytes: what transfers, editors and other programs do to them.

use super::dice::Dice;

/// Numbers that readers and nodes must survive.
pub(crate) const NUMBERS: [&str; 32] = [
    "0",
    "-0.0",
    "1",
    "-1",
    "2",
    "3",
    "0.5",
    "-0.5",
    "1e-9",
    "1e-30",
    "-1e-30",
    "1e-45",
    "1e9",
    "-1e9",
    "1e30",
    "-1e30",
    "1e37",
    "3.5e38",
    "1e39",
    "1e308",
    "1e999",
    "2147483647",
    "2147483648",
    "-2147483648",
    "4294967296",
    "9223372036854775807",
    "18446744073709551616",
    "1e6",
    "65536",
    "nan",
    "inf",
    "0x10",
];

/// Changes `bytes` in one to four ways; half of the time only numbers, so that readers accept more.
pub(crate) fn mutate(bytes: &mut Vec<u8>, dice: &mut Dice) {
    if dice.one_in(2) {
        for _ in 0..1 + dice.below(6) {
            let at = dice.below(bytes.len());
            number(bytes, at, dice);
        }
        return;
    }
    for _ in 0..1 + dice.below(4) {
        mutate_once(bytes, dice);
    }
}

fn mutate_once(bytes: &mut Vec<u8>, dice: &mut Dice) {
    let Some(at) = dice.index(bytes.len()) else {
        bytes.extend(b"v 1 2 3\n");
        return;
    };
    match dice.below(9) {
        0 => bytes.truncate(at),
        1 => bytes[at] ^= 1 << dice.below(8),
        2 => bytes[at] = dice.below(256) as u8,
        3 => _ = bytes.remove(at),
        4 => {
            let end = (at + 1 + dice.below(200)).min(bytes.len());
            let piece: Vec<u8> = bytes[at..end].repeat(1 + dice.below(4));
            let to = dice.below(bytes.len());
            bytes.splice(to..to, piece);
        }
        5 => {
            let end = (at + 1 + dice.below(200)).min(bytes.len());
            bytes.drain(at..end);
        }
        6 => {
            const PIECES: [&[u8]; 8] = [b"\r\n", b"\0", b"\xef\xbb\xbf", b"\\\n", b"#", b"\t ", b"\xff\xfe", b"\n\n"];
            let piece = PIECES[dice.below(PIECES.len())];
            bytes.splice(at..at, piece.iter().copied());
        }
        _ => number(bytes, at, dice),
    }
}

/// Replaces the number at or after `at`, if there is one.
fn number(bytes: &mut Vec<u8>, at: usize, dice: &mut Dice) {
    let is_digit = |byte: &u8| byte.is_ascii_digit() || matches!(byte, b'-' | b'.');
    let Some(start) = bytes.get(at..).unwrap_or_default().iter().position(is_digit).map(|after| at + after) else {
        return;
    };
    let len = bytes[start..].iter().take_while(|byte| is_digit(byte) || matches!(byte, b'e' | b'+')).count();
    bytes.splice(start..start + len, NUMBERS[dice.below(NUMBERS.len())].bytes());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_bytes_are_changed_and_most_results_differ() {
        let original = b"v 0 1.5 -2e3\nv 1 1 1\nl 1 2\n".to_vec();
        let changed = (0..200).filter(|seed| {
            let mut bytes = original.clone();
            mutate(&mut bytes, &mut Dice::new(*seed));
            bytes != original
        });
        assert!(changed.count() > 170);
        let mut empty = Vec::new();
        mutate_once(&mut empty, &mut Dice::new(1));
        assert!(!empty.is_empty());
    }

    #[test]
    fn a_number_is_replaced_as_a_whole() {
        let mut bytes = b"v 12.5e+3 x".to_vec();
        number(&mut bytes, 0, &mut Dice::new(5));
        let text = String::from_utf8(bytes).unwrap();
        assert!(text.starts_with("v ") && text.ends_with(" x"));
        assert!(NUMBERS.contains(&&text[2..text.len() - 2]), "{text}");
    }
}
