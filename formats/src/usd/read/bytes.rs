//! The bytes of a file, or of a file inside an archive, read without ever going past their end.

use std::ops::Range;
use std::sync::Arc;

use crate::error::FilePosition;
use crate::{FormatError, Result};

/// What to do about a file that ends too early or refers to bytes that it does not have.
pub(super) const DAMAGED: &str = "the file is damaged or incomplete; write it again";

/// Bytes shared with whoever holds the file.
#[derive(Clone, Debug)]
pub(super) struct Bytes {
    all: Arc<[u8]>,
    range: Range<usize>,
}

impl Bytes {
    /// All of `all`.
    pub(super) fn new(all: Arc<[u8]>) -> Self {
        let range = 0..all.len();
        Self { all, range }
    }

    /// The bytes of `range`, which must lie inside.
    pub(super) fn part(&self, range: Range<usize>) -> Option<Self> {
        self.get().get(range.clone())?;
        let range = self.range.start + range.start..self.range.start + range.end;
        Some(Self { all: self.all.clone(), range })
    }

    /// The bytes.
    pub(super) fn get(&self) -> &[u8] {
        &self.all[self.range.clone()]
    }
}

/// Reads little-endian numbers one after the other.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Cursor<'a> {
    /// A cursor at byte `at`.
    pub(super) fn at(bytes: &'a [u8], at: u64) -> Self {
        // Beyond the end, the first read fails.
        Self { bytes, at: usize::try_from(at).unwrap_or(usize::MAX) }
    }

    /// Where the next read starts.
    pub(super) fn position(&self) -> usize {
        self.at
    }

    /// The bytes that are left.
    pub(super) fn left(&self) -> usize {
        self.bytes.len().saturating_sub(self.at)
    }

    /// The next `count` bytes.
    pub(super) fn take(&mut self, count: usize) -> Result<&'a [u8]> {
        let taken = self.bytes.get(self.at..).and_then(|rest| rest.get(..count));
        let taken = taken.ok_or_else(|| self.beyond())?;
        self.at += count;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N]> {
        let taken = self.take(N)?;
        taken.try_into().map_err(|_| self.beyond())
    }

    fn beyond(&self) -> FormatError {
        let fact = format!("it goes on past the end of the file, which has {} bytes", self.bytes.len());
        FormatError::with_hint(FilePosition::Byte(self.at.min(self.bytes.len())), fact, DAMAGED)
    }

    pub(super) fn u8(&mut self) -> Result<u8> {
        Ok(self.array::<1>()?[0])
    }

    pub(super) fn u32(&mut self) -> Result<u32> {
        Ok(u32::from_le_bytes(self.array()?))
    }

    pub(super) fn u64(&mut self) -> Result<u64> {
        Ok(u64::from_le_bytes(self.array()?))
    }

    pub(super) fn i64(&mut self) -> Result<i64> {
        Ok(i64::from_le_bytes(self.array()?))
    }

    pub(super) fn f64(&mut self) -> Result<f64> {
        Ok(f64::from_le_bytes(self.array()?))
    }

    /// A count of things of at least `least` bytes each, all of which follow.
    pub(super) fn count(&mut self, least: usize) -> Result<usize> {
        let at = self.at;
        let count = self.u64()?;
        self.checked(at, count, least)
    }

    /// `count`, read at `at`, as a count of things of at least `least` bytes each, all of which follow.
    pub(super) fn checked(&self, at: usize, count: u64, least: usize) -> Result<usize> {
        let fits = usize::try_from(count).ok().filter(|count| count.saturating_mul(least) <= self.left());
        fits.ok_or_else(|| {
            let fact = format!("it has {count} entries, for which the file is too short");
            FormatError::with_hint(FilePosition::Byte(at), fact, DAMAGED)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_read_past_the_end() {
        let bytes = [1, 0, 0, 0, 2];
        let mut cursor = Cursor::at(&bytes, 0);
        assert_eq!(cursor.u32().unwrap(), 1);
        assert_eq!(
            cursor.u32().unwrap_err().to_string(),
            "byte 4: it goes on past the end of the file, which has 5 bytes"
        );
        assert_eq!(cursor.u8().unwrap(), 2);
        assert!(Cursor::at(&bytes, u64::MAX).u8().is_err());
        assert!(Cursor::at(&bytes, 4).take(usize::MAX).is_err());
    }

    #[test]
    fn a_count_that_the_file_cannot_hold_is_refused() {
        let mut bytes = vec![0_u8; 24];
        bytes[0] = 2;
        assert_eq!(Cursor::at(&bytes, 0).count(8).unwrap(), 2);
        bytes[0] = 3;
        assert_eq!(
            Cursor::at(&bytes, 0).count(8).unwrap_err().to_string(),
            "byte 0: it has 3 entries, for which the file is too short"
        );
    }

    #[test]
    fn a_part_of_a_part_is_counted_from_its_own_start() {
        let all = Bytes::new(Arc::from(&b"abcdef"[..]));
        let part = all.part(1..5).unwrap();
        assert_eq!((part.get(), part.part(1..3).unwrap().get()), (&b"bcde"[..], &b"cd"[..]));
        assert!(part.part(2..5).is_none());
    }
}
