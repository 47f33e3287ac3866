//! The types of `.usda` by name.

/// What a row is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    /// Known only from how it is written.
    Unknown,
    Half,
    Float,
    Double,
    Int,
    Quaternion,
    Matrix,
    Text,
    Dictionary,
    /// Not read.
    Other,
}

/// A type: what a row is made of, how many numbers it has, and whether there are many.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct TextType {
    pub(super) scalar: Scalar,
    pub(super) width: u8,
    pub(super) is_array: bool,
}

impl TextType {
    pub(super) const UNKNOWN: Self = Self { scalar: Scalar::Unknown, width: 1, is_array: false };

    /// The type of that name, without `[]`.
    pub(super) fn named(name: &str, is_array: bool) -> Self {
        let (scalar, width) = scalar(name);
        Self { scalar, width, is_array }
    }

    /// As a number below 256.
    pub(super) fn code(self) -> u8 {
        (self.scalar as u8) << 4 | self.width.min(4) << 1 & 0b1110 | u8::from(self.is_array)
    }

    /// The type of a code.
    pub(super) fn of(code: u8) -> Self {
        const SCALARS: [Scalar; 10] = [
            Scalar::Unknown,
            Scalar::Half,
            Scalar::Float,
            Scalar::Double,
            Scalar::Int,
            Scalar::Quaternion,
            Scalar::Matrix,
            Scalar::Text,
            Scalar::Dictionary,
            Scalar::Other,
        ];
        let scalar = SCALARS.get(usize::from(code >> 4)).copied().unwrap_or(Scalar::Other);
        Self { scalar, width: code >> 1 & 0b111, is_array: code & 1 == 1 }
    }
}

fn scalar(name: &str) -> (Scalar, u8) {
    match name {
        "bool" | "uchar" | "int" | "uint" | "int64" | "uint64" => return (Scalar::Int, 1),
        "half" => return (Scalar::Half, 1),
        "float" => return (Scalar::Float, 1),
        "double" | "timecode" => return (Scalar::Double, 1),
        "string" | "token" | "asset" | "pathExpression" => return (Scalar::Text, 1),
        "dictionary" => return (Scalar::Dictionary, 1),
        "quath" | "quatf" | "quatd" => return (Scalar::Quaternion, 4),
        "matrix2d" => return (Scalar::Matrix, 2),
        "matrix3d" => return (Scalar::Matrix, 3),
        "matrix4d" | "frame4d" => return (Scalar::Matrix, 4),
        _ => {}
    }
    const ROLES: [&str; 5] = ["point", "vector", "normal", "color", "texCoord"];
    let role = ROLES.iter().find_map(|role| name.strip_prefix(role));
    let (base, digits) = match role {
        Some(rest) => match rest.as_bytes() {
            [digit, b'h'] => (Scalar::Half, *digit),
            [digit, b'f'] => (Scalar::Float, *digit),
            [digit, b'd'] => (Scalar::Double, *digit),
            _ => return (Scalar::Other, 1),
        },
        None => {
            let last = name.bytes().last().unwrap_or_default();
            match name.strip_suffix(char::from(last)) {
                Some("half") => (Scalar::Half, last),
                Some("float") => (Scalar::Float, last),
                Some("double") => (Scalar::Double, last),
                Some("int") => (Scalar::Int, last),
                _ => return (Scalar::Other, 1),
            }
        }
    };
    match digits {
        b'2'..=b'4' => (base, digits - b'0'),
        _ => (Scalar::Other, 1),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn types_have_scalar_and_width() {
        for (name, scalar, width) in [
            ("point3f", Scalar::Float, 3),
            ("texCoord2h", Scalar::Half, 2),
            ("normal3d", Scalar::Double, 3),
            ("double2", Scalar::Double, 2),
            ("int4", Scalar::Int, 4),
            ("quatf", Scalar::Quaternion, 4),
            ("matrix4d", Scalar::Matrix, 4),
            ("opaque", Scalar::Other, 1),
            ("point3x", Scalar::Other, 1),
            ("float9", Scalar::Other, 1),
            ("größe", Scalar::Other, 1),
        ] {
            for is_array in [false, true] {
                let found = TextType::named(name, is_array);
                assert_eq!(found, TextType { scalar, width, is_array }, "{name}");
                assert_eq!(TextType::of(found.code()), found, "{name}");
            }
        }
        assert_eq!(TextType::of(TextType::UNKNOWN.code()), TextType::UNKNOWN);
    }
}
