//! How much memory a cook may take: every size is known before anything of that size is made.

/// A ceiling that is refused, not exceeded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ceiling {
    /// Bytes that a result may take together with what it is made from.
    pub bytes: usize,
    /// What sets it, as the subject of messages: ``--memory allows``.
    pub set_by: &'static str,
}

impl Ceiling {
    /// Sizes up to this are always allowed: the engine itself takes more.
    pub const LEAST: usize = 16 << 20;

    /// No ceiling.
    pub const NONE: Self = Self { bytes: usize::MAX, set_by: "the system allows" };

    /// Whether it allows that many bytes.
    pub fn allows(&self, bytes: usize) -> bool {
        bytes <= self.bytes.max(Self::LEAST)
    }

    /// What it allows: `--memory allows 4.0 GiB`.
    pub fn describe(&self) -> String {
        format!("{} {}", self.set_by, size_text(self.bytes.max(Self::LEAST)))
    }
}

/// A size as messages show it: `12.4 GiB`.
pub fn size_text(bytes: usize) -> String {
    const UNITS: [&str; 5] = ["KiB", "MiB", "GiB", "TiB", "PiB"];
    if bytes < 1024 {
        return format!("{bytes} bytes");
    }
    let (mut size, mut unit) = (bytes as f64 / 1024.0, 0);
    while size >= 1023.95 && unit + 1 < UNITS.len() {
        size /= 1024.0;
        unit += 1;
    }
    format!("{size:.1} {}", UNITS[unit])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_shown_in_the_largest_unit_that_fits() {
        let sizes = [0, 1023, 1024, 1 << 20, 13_314_398_618, usize::MAX];
        let texts = ["0 bytes", "1023 bytes", "1.0 KiB", "1.0 MiB", "12.4 GiB", "16384.0 PiB"];
        assert_eq!(sizes.map(size_text), texts);
    }

    #[test]
    fn a_ceiling_allows_what_is_not_larger() {
        let ceiling = Ceiling { bytes: 4 << 30, set_by: "--memory allows" };
        assert!(ceiling.allows(4 << 30) && !ceiling.allows((4 << 30) + 1));
        assert_eq!(ceiling.describe(), "--memory allows 4.0 GiB");
        assert!(Ceiling { bytes: 0, ..ceiling }.allows(Ceiling::LEAST));
    }
}
