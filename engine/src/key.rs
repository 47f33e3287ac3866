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
pub struct Hasher {
    /// Pieces not yet hashed.
    pieces: Vec<u8>,
    /// Those before them, of a long recipe: the history of a param may span a billion frames.
    hashed: Option<Box<blake3::Hasher>>,
}

/// Bytes of pieces that are kept before they are hashed.
const MOST_KEPT: usize = 1 << 16;

impl Hasher {
    /// A mark that says which kind of piece follows.
    pub fn tag(&mut self, tag: u8) -> &mut Self {
        self.bytes(&[tag])
    }

    /// Bytes of a length that the recipe fixes.
    pub fn bytes(&mut self, bytes: &[u8]) -> &mut Self {
        self.pieces.extend_from_slice(bytes);
        if self.pieces.len() >= MOST_KEPT {
            self.hashed.get_or_insert_default().update(&self.pieces);
            self.pieces.clear();
        }
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
        let hash = match self.hashed.take() {
            None => blake3::hash(&self.pieces),
            Some(mut hashed) => hashed.update(&self.pieces).finalize(),
        };
        key.0.copy_from_slice(&hash.as_bytes()[..16]);
        self.pieces.clear();
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
    fn a_long_recipe_is_hashed_on_the_way_and_leaves_nothing_behind() {
        let mut hasher = Hasher::default();
        let mut whole = Vec::new();
        for number in 0..50_000_i64 {
            hasher.tag(7).i64(number);
            whole.push(7);
            whole.extend(number.to_le_bytes());
            assert!(hasher.pieces.len() < MOST_KEPT);
        }
        assert_eq!(hasher.finish().0[..], blake3::hash(&whole).as_bytes()[..16]);
        assert_eq!(hasher.tag(1).finish(), Hasher::default().tag(1).finish());
    }

    #[test]
    fn minus_zero_is_zero() {
        assert_eq!(Hasher::default().f64(-0.0).finish(), Hasher::default().f64(0.0).finish());
    }
}
