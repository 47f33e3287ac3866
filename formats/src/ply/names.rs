//! Attribute names as PLY properties.
//!
//! A property name has no white space, `name.0` is the first component of a vector attribute, and some names have a
//! special meaning. Names that conflict with these rules are written with `%` and two hexadecimal digits for a byte, as
//! in a URL, and are decoded when read.

/// Property names that are read as something other than a scalar attribute of that name.
const TAKEN: [&str; 21] = [
    "x",
    "y",
    "z",
    "nx",
    "ny",
    "nz",
    "red",
    "green",
    "blue",
    "s",
    "t",
    "u",
    "v",
    "texture_u",
    "texture_v",
    "vertex1",
    "vertex2",
    "vertex_index",
    "vertex_indices",
    "count",
    super::COMPONENT,
];

/// The property for number `part` of an attribute `width` wide.
pub(super) fn property(attribute: &str, part: usize, width: usize) -> String {
    let name = encoded(attribute, width);
    if width > 1 { format!("{name}.{part}") } else { name }
}

/// The attribute name of a property of that width, without its number; unchanged if convect cannot have written it.
pub(super) fn attribute(property: &str, width: usize) -> String {
    // Only names in the form that convect writes are decoded, so two properties never become the same attribute.
    decoded(property).filter(|name| encoded(name, width) == property).unwrap_or_else(|| property.to_owned())
}

fn encoded(attribute: &str, width: usize) -> String {
    if attribute.is_empty() {
        return "%".to_owned();
    }
    let is_taken = width == 1 && TAKEN.contains(&attribute);
    let mut name = String::with_capacity(attribute.len() + 2);
    for (k, byte) in attribute.bytes().enumerate() {
        let is_plain = byte.is_ascii_graphic() && byte != b'%' && byte != b'.';
        if is_plain && !(is_taken && k == 0) {
            name.push(char::from(byte));
        } else {
            name.push_str(&format!("%{byte:02X}"));
        }
    }
    name
}

fn decoded(property: &str) -> Option<String> {
    if property == "%" {
        return Some(String::new());
    }
    let mut bytes = Vec::with_capacity(property.len());
    let mut rest = property.as_bytes();
    while let Some((first, tail)) = rest.split_first() {
        if *first == b'%' {
            let ([high, low], tail) = tail.split_first_chunk::<2>()?;
            let digit = |byte: &u8| char::from(*byte).to_digit(16).and_then(|digit| u8::try_from(digit).ok());
            bytes.push(digit(high)? * 16 + digit(low)?);
            rest = tail;
        } else {
            bytes.push(*first);
            rest = tail;
        }
    }
    String::from_utf8(bytes).ok()
}

/// The name and number of a property such as `Pref.2`.
pub(super) fn numbered(property: &str) -> Option<(&str, usize)> {
    let (name, part) = property.rsplit_once('.')?;
    let part = ["0", "1", "2", "3"].iter().position(|digit| *digit == part)?;
    Some((name, part))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_round_trip() {
        for name in ["mask", "x", "v", "", "a b", "wind.0", "50%", "größe", "\n", "primvars:mask", "%41", "%"] {
            let scalar = property(name, 0, 1);
            assert_eq!(attribute(&scalar, 1), name);
            assert!(!TAKEN.contains(&scalar.as_str()) && numbered(&scalar).is_none(), "{scalar}");
            assert!(scalar.bytes().all(|byte| byte.is_ascii_graphic()) && !scalar.is_empty());
            let wide = property(name, 2, 3);
            assert_eq!(numbered(&wide).map(|(name, part)| (attribute(name, 3), part)), Some((name.to_owned(), 2)));
        }
        assert_eq!(property("x", 0, 1), "%78");
        assert_eq!(property("v", 1, 3), "v.1");
        for foreign in ["100%", "%41", "%2e", "%GG"] {
            assert_eq!(attribute(foreign, 1), foreign, "not written by convect");
        }
    }
}
