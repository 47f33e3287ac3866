//! Damaged files and files of other types: an error with the reason, never a panic.

#![allow(clippy::unwrap_used, reason = "a missing value fails the test")]

use formats::{Format, FrameStamp, read, write};
use proptest::prelude::*;

const READ: [Format; 3] = [Format::Obj, Format::Ply, Format::Json];

const OBJ: &str = "\
# a curve, a face, a point
v 0 0.5 -1e-3 1 0 0
v 1 0 0 0 1 0
v 1 1 \\
0 0 0 1
vt 0 0
vn 0 0 1
l 1/1 2/1
f -3/1/1 2//1 3
p 3
";

const PLY: &str = "\
ply
format ascii 1.0
comment x
element vertex 4
property float x
property double y
property float z
property uchar red
property uchar green
property uchar blue
property list uchar short l
element face 1
property list uchar int vertex_indices
property int part.0
property int part.1
property int part.2
element edge 2
property int vertex1
property int vertex2
end_header
0 0 0 1 2 3 0
1 0 0 1 2 3 1 9
1 1 0 1 2 3 2 9 9
0 1 0.5 1 2 3 0
3 0 1 2 7 8 9
2 3
3 0
";

const JSON: &str = r#"{"frame": 1, "time": 0.5,
 "curves": {"counts": [2], "points": [[0.0, 0.5, -1e-3], [1, 1, 1]],
  "point_attributes": {"envelope": [1.0, 0.5]}, "element_attributes": {"a": [[1, 2, 3, 4]]}, "attributes": {}},
 "volume": {"origin": [0, 0, 0], "cell": 1, "size": [1, 0, 0], "level_set": [], "velocity_x": [], "velocity_y": [],
  "velocity_z": []}}
"#;

/// A small file of each format, and the binary file that convect writes from it.
fn samples() -> Vec<(Format, Vec<u8>)> {
    let mut samples: Vec<(Format, Vec<u8>)> = READ.into_iter().zip([OBJ, PLY, JSON].map(Vec::from)).collect();
    let geometry = read(Format::Obj, OBJ.as_bytes()).unwrap();
    let mut binary = Vec::new();
    write(Format::Ply, &geometry, &FrameStamp { frame: 1.0, seconds: 0.0 }, &mut binary).unwrap();
    samples.push((Format::Ply, binary));
    samples
}

fn fault(format: Format, bytes: &[u8]) -> (String, Option<String>) {
    let error = read(format, bytes).unwrap_err();
    (error.to_string(), error.hint())
}

#[test]
fn the_undamaged_samples_load() {
    for (format, bytes) in samples() {
        assert!(read(format, &bytes).is_ok(), "{format}");
    }
}

#[test]
fn a_truncated_file_loads_or_is_refused() {
    for (format, bytes) in samples() {
        let refused = (0..bytes.len()).filter(|length| read(format, &bytes[..*length]).is_err()).count();
        // Text that ends between two numbers or lines may be indistinguishable from a shorter file.
        let most = if format == Format::Obj { bytes.len() / 4 } else { bytes.len() * 9 / 10 };
        assert!(refused >= most, "{format}: {refused} of {}", bytes.len());
    }
}

#[test]
fn files_of_other_types_are_recognised() {
    let utf_16 =
        |text: &str, mark: &[u8]| [mark, &text.encode_utf16().flat_map(u16::to_le_bytes).collect::<Vec<_>>()].concat();
    for format in READ {
        let expected = |what: &str| format!("this is {what}, expected {format}");
        let text = Some("save it as UTF-8".to_owned());
        assert_eq!(fault(format, &utf_16("v 0 0 0", b"\xff\xfe")), (expected("UTF-16 text"), text.clone()));
        assert_eq!(fault(format, &utf_16("v 0 0 0", b"")), (expected("UTF-16 text"), text.clone()));
        let big: Vec<u8> = "ply\n".encode_utf16().flat_map(u16::to_be_bytes).collect();
        assert_eq!(fault(format, &big), (expected("UTF-16 text"), text.clone()));
        assert_eq!(fault(format, &[b"\xfe\xff", big.as_slice()].concat()), (expected("UTF-16 text"), text));
        let decompress = Some("decompress it first".to_owned());
        assert_eq!(fault(format, b"\x1f\x8b\x08\x00"), (expected("gzip data"), decompress.clone()));
        assert_eq!(fault(format, b"PK\x03\x04"), (expected("a zip archive"), decompress));
        let convert = Some("convert it to obj, ply or json first".to_owned());
        assert_eq!(fault(format, b"PXR-USDC\0"), (expected("a USD file"), convert.clone()));
        assert_eq!(fault(format, b"#usda 1.0\n"), (expected("a USD file"), convert));
        assert_eq!(fault(format, b"<!DOCTYPE html>").0, expected("a web page"));
        assert_eq!(fault(format, b"").0, "the file is empty");
    }
    assert_eq!(fault(Format::Obj, b"ply\nformat ascii 1.0\n").0, "this is a ply file, expected obj");
    assert_eq!(fault(Format::Ply, b"{\"frame\": 1}").0, "this is a json file, expected ply");
    let (fact, hint) = fault(Format::Usda, b"#usda 1.0\n");
    assert_eq!(fact, "it is USD, whose prims and times this does not select");
    assert_eq!(hint.unwrap(), "read it by the node Usd_In");
}

#[test]
fn bytes_that_are_not_text_are_refused() {
    for format in READ {
        for bytes in [vec![0; 64], vec![0xff; 64], (0..=255).collect::<Vec<u8>>()] {
            assert!(read(format, &bytes).is_err(), "{format}: {bytes:?}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, cases: 2000, ..ProptestConfig::default() })]

    #[test]
    fn changed_bytes_never_panic(
        sample in 0..4_usize,
        changes in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0..3_u8), 1..8),
    ) {
        let (format, mut bytes) = samples().swap_remove(sample);
        for (index, byte, kind) in changes {
            let index = index.index(bytes.len());
            match kind {
                0 => bytes[index] = byte,
                1 => bytes[index] ^= 1 << (byte % 8),
                _ => bytes.insert(index, byte),
            }
        }
        // Any error is accepted; what loads can be written again.
        if let Ok(geometry) = read(format, &bytes) {
            let stamp = FrameStamp { frame: 1.0, seconds: 0.0 };
            prop_assert!(write(Format::Json, &geometry, &stamp, &mut Vec::new()).is_ok());
        }
    }

    #[test]
    fn changed_digits_and_words_never_panic(
        sample in 0..3_usize,
        index in any::<prop::sample::Index>(),
        word in prop::sample::select(vec![
            "-1", "4294967295", "18446744073709551616", "1e400", "nan", "", "\\", "#", "element face 9\n", "[", "/",
        ]),
    ) {
        let (format, bytes) = samples().swap_remove(sample);
        let text = String::from_utf8(bytes).unwrap();
        let mut words: Vec<&str> = text.split_inclusive([' ', '\n', ',']).collect();
        let index = index.index(words.len());
        let changed = format!("{word}{}", words[index].chars().next_back().unwrap_or(' '));
        words[index] = &changed;
        let _ = read(format, words.concat().as_bytes());
    }
}
