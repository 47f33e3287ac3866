//! The file formats of convect, by name and by extension, and what each can hold.

use std::path::Path;
use std::str::FromStr;

use engine::geometry::Kind;

use crate::FormatError;

/// A file format for geometry. Its name is also the file's extension.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Format {
    /// USD, binary: all frames in one file; written only.
    Usdc,
    /// USD, text: all frames in one file; written only.
    Usda,
    /// Wavefront OBJ, one file per frame.
    Obj,
    /// PLY, one file per frame; read in all three encodings, written binary little endian.
    Ply,
    /// convect's own format, one file per frame: holds any geometry.
    Json,
}

impl Format {
    /// All formats, in the order messages list them.
    pub const ALL: [Self; 5] = [Self::Usdc, Self::Usda, Self::Obj, Self::Ply, Self::Json];

    /// The name on the command line, and the extension of its files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Usdc => "usdc",
            Self::Usda => "usda",
            Self::Obj => "obj",
            Self::Ply => "ply",
            Self::Json => "json",
        }
    }

    /// The format of a file, by its extension in any case; `.usd` means usdc.
    ///
    /// # Errors
    /// If the extension is missing or unknown.
    pub fn of_path(path: &Path) -> Result<Self, FormatError> {
        let ending = path.extension().unwrap_or(path.as_os_str()).to_string_lossy().to_lowercase();
        if ending == "usd" { Ok(Self::Usdc) } else { ending.parse() }
    }

    /// Whether a file of this format can hold that component.
    pub fn holds(self, kind: Kind) -> bool {
        match kind {
            Kind::Curves | Kind::Mesh | Kind::Points => true,
            Kind::Tets => matches!(self, Self::Usdc | Self::Usda | Self::Json),
            Kind::Volume => self == Self::Json,
        }
    }

    /// The formats that can hold all of these components.
    pub fn holding(kinds: impl IntoIterator<Item = Kind>) -> Vec<Self> {
        let kinds: Vec<Kind> = kinds.into_iter().collect();
        Self::ALL.into_iter().filter(|format| kinds.iter().all(|kind| format.holds(*kind))).collect()
    }

    /// Whether one file holds all frames; otherwise each frame has a file.
    pub fn is_sequence(self) -> bool {
        matches!(self, Self::Usdc | Self::Usda)
    }

    /// Whether [`read`](crate::read) can read it.
    pub fn is_read(self) -> bool {
        !self.is_sequence()
    }
}

impl std::fmt::Display for Format {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Format {
    type Err = FormatError;

    fn from_str(name: &str) -> Result<Self, FormatError> {
        let found = Self::ALL.into_iter().find(|format| format.name() == name);
        found.ok_or_else(|| FormatError::Unknown { name: name.to_owned() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_extension_names_its_format_in_any_case() {
        let of = |path: &str| Format::of_path(Path::new(path));
        assert_eq!(of("fur.0001.obj").unwrap(), Format::Obj);
        assert_eq!(of("a/FUR.PLY").unwrap(), Format::Ply);
        assert_eq!(of("fur.usd").unwrap(), Format::Usdc);
        for (path, name) in [("fur.abc", "abc"), ("fur", "fur"), ("fur.usdz", "usdz")] {
            let fact = format!("`{name}` is not a geometry format, expected one of usdc, usda, obj, ply, json");
            assert_eq!(of(path).unwrap_err().to_string(), fact);
        }
    }

    #[test]
    fn the_formats_that_hold_a_component_are_listed() {
        use Format::{Json, Obj, Ply, Usda, Usdc};
        assert_eq!(Format::holding([Kind::Curves, Kind::Mesh, Kind::Points]), [Usdc, Usda, Obj, Ply, Json]);
        assert_eq!(Format::holding([Kind::Points, Kind::Tets]), [Usdc, Usda, Json]);
        assert_eq!(Format::holding([Kind::Volume]), [Json]);
        let error = FormatError::CannotHold { format: Obj, kind: Kind::Tets };
        assert_eq!(error.to_string(), "obj cannot hold tets");
        assert_eq!(error.hint().unwrap(), "formats that can: usdc, usda, json");
    }
}
