//! `.usdz`: a zip archive whose files are stored as they are. Its first file is the stage.

use super::bytes::{Bytes, Cursor, DAMAGED};
use crate::error::FilePosition;
use crate::{FormatError, Result};

/// The first bytes of an archive.
pub(super) const MAGIC: &[u8] = b"PK\x03\x04";

/// Signature and size of the record at the end, before its comment.
const END: &[u8] = b"PK\x05\x06";
const END_SIZE: usize = 22;

/// The files of an archive, in order.
#[derive(Debug)]
pub(super) struct Archive {
    files: Vec<(String, Bytes)>,
}

fn damaged(at: usize, fact: &str) -> FormatError {
    FormatError::with_hint(FilePosition::Byte(at), fact, DAMAGED)
}

fn u16_of(cursor: &mut Cursor<'_>) -> Result<u16> {
    Ok(u16::from(cursor.u8()?) | u16::from(cursor.u8()?) << 8)
}

impl Archive {
    /// The files of the archive `bytes`.
    ///
    /// # Errors
    /// If it is damaged, or a file in it is compressed.
    pub(super) fn open(bytes: &Bytes) -> Result<Self> {
        let all = bytes.get();
        let last = all.len().saturating_sub(END_SIZE);
        let first = last.saturating_sub(usize::from(u16::MAX));
        let end = (first..=last).rev().find(|at| all[*at..].starts_with(END));
        let end = end.ok_or_else(|| damaged(all.len(), "the archive has no list of its files"))?;
        let mut cursor = Cursor::at(all, end as u64 + 10);
        let count = u16_of(&mut cursor)?;
        cursor.u32()?;
        let mut cursor = Cursor::at(all, cursor.u32()?.into());
        let mut files = Vec::new();
        for _ in 0..count {
            files.push(Self::file(bytes, &mut cursor)?);
        }
        Ok(Self { files })
    }

    /// An entry of the list of files.
    fn file(bytes: &Bytes, cursor: &mut Cursor<'_>) -> Result<(String, Bytes)> {
        let at = cursor.position();
        if cursor.take(4)? != b"PK\x01\x02" {
            return Err(damaged(at, "the archive's list of files is damaged"));
        }
        cursor.take(4)?;
        let flags = u16_of(cursor)?;
        let method = u16_of(cursor)?;
        cursor.take(8)?;
        let size = cursor.u32()? as usize;
        cursor.take(4)?;
        let lengths = [u16_of(cursor)?, u16_of(cursor)?, u16_of(cursor)?];
        cursor.take(8)?;
        let start = cursor.u32()?;
        let [name, extra, comment] = lengths.map(usize::from);
        let name = String::from_utf8_lossy(cursor.take(name)?).into_owned();
        cursor.take(extra + comment)?;
        if method != 0 || flags & 1 != 0 {
            let fact = format!("`{name}` in the archive is compressed or encrypted, which USD does not allow");
            return Err(FormatError::with_hint(FilePosition::Byte(at), fact, "pack it again: usdzip out.usdz in.usdc"));
        }
        // Its own header may have other lengths.
        let mut header = Cursor::at(bytes.get(), start.into());
        header.take(26)?;
        let [name_length, extra] = [u16_of(&mut header)?, u16_of(&mut header)?].map(usize::from);
        header.take(name_length + extra)?;
        let start = header.position();
        let file = start.checked_add(size).and_then(|end| bytes.part(start..end));
        Ok((name, file.ok_or_else(|| damaged(at, "a file of the archive is cut off"))?))
    }

    /// The stage.
    pub(super) fn first(&self) -> Option<&Bytes> {
        self.files.first().map(|(_, file)| file)
    }

    /// The file of that name; a leading `./` does not count.
    pub(super) fn get(&self, name: &str) -> Option<&Bytes> {
        let name = name.strip_prefix("./").unwrap_or(name);
        self.files.iter().find(|(known, _)| known == name).map(|(_, file)| file)
    }
}
