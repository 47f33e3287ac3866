//! Content keys: the hash of a recipe, never of a result. Equal keys mean equal results.

/// 128 bits of a blake3 hash.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct ContentKey(pub [u8; 16]);

impl std::fmt::Display for ContentKey {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl ContentKey {
    /// The inverse of its text.
    pub fn parse(text: &str) -> Option<Self> {
        let (pairs, rest) = text.as_bytes().as_chunks::<2>();
        let digit = |byte: u8| match byte {
            b'0'..=b'9' => Some(byte - b'0'),
            b'a'..=b'f' => Some(byte - b'a' + 10),
            _ => None,
        };
        let mut key = Self::default();
        for (byte, [high, low]) in key.0.iter_mut().zip(pairs) {
            *byte = digit(*high)? << 4 | digit(*low)?;
        }
        (pairs.len() == key.0.len() && rest.is_empty()).then_some(key)
    }

    /// The key of some bytes.
    pub fn of(bytes: &[u8]) -> Self {
        let mut hasher = Hasher::default();
        hasher.bytes(bytes);
        hasher.finish()
    }
}

/// Builds a key piece by piece. Every piece of variable length is preceded by its length, so no two recipes run together.
#[derive(Default)]
pub struct Hasher(Vec<u8>);

impl Hasher {
    /// A mark that says which kind of piece follows.
    pub fn tag(&mut self, tag: u8) -> &mut Self {
        self.0.push(tag);
        self
    }

    /// Bytes of a length that the recipe fixes.
    pub fn bytes(&mut self, bytes: &[u8]) -> &mut Self {
        self.0.extend_from_slice(bytes);
        self
    }

    /// A whole number.
    pub fn i64(&mut self, number: i64) -> &mut Self {
        self.bytes(&number.to_le_bytes())
    }

    /// A number, by its bits; −0 counts as 0, which it equals.
    pub fn f64(&mut self, number: f64) -> &mut Self {
        self.bytes(&(number + 0.0).to_bits().to_le_bytes())
    }

    /// A text.
    pub fn text(&mut self, text: &str) -> &mut Self {
        self.i64(text.len() as i64).bytes(text.as_bytes())
    }

    /// Another key.
    pub fn key(&mut self, key: ContentKey) -> &mut Self {
        self.bytes(&key.0)
    }

    /// The key of all pieces; the hasher is empty afterwards and keeps its memory.
    pub fn finish(&mut self) -> ContentKey {
        let mut key = ContentKey::default();
        key.0.copy_from_slice(&blake3::hash(&self.0).as_bytes()[..16]);
        self.0.clear();
        key
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbouring_texts_do_not_run_together() {
        let key = |a: &str, b: &str| Hasher::default().text(a).text(b).finish();
        assert_ne!(key("ab", "c"), key("a", "bc"));
        assert_eq!(key("ab", "c"), key("ab", "c"));
    }

    #[test]
    fn a_key_is_read_back_from_its_text() {
        let key = ContentKey::of(b"a");
        assert_eq!(ContentKey::parse(&key.to_string()), Some(key));
        let text = key.to_string();
        for wrong in ["", &text[1..], &format!("{text}0"), &text.to_uppercase().replace('0', "G"), "é"] {
            assert_eq!(ContentKey::parse(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn minus_zero_is_zero() {
        assert_eq!(Hasher::default().f64(-0.0).finish(), Hasher::default().f64(0.0).finish());
    }
}
