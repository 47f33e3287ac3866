//! One file of the cache, written and read so that nothing that lies in its place can stop a cook.
//!
//! An entry is a header and the bytes. The header holds their length and checksum and a checksum of itself, so that
//! no memory is asked for on the word of a damaged file.

use std::fs::{self, File};
use std::io::{self, Read as _, Write as _};
use std::path::{Path, PathBuf};

use crate::host;
use crate::key::ContentKey;

const MAGIC: &[u8; 8] = b"convect\n";

/// Magic, length, checksum of the bytes, checksum of the header.
const HEADER: usize = 8 + 8 + 32 + 16;

/// The bytes of the entry at `path`; `None` if there is none.
///
/// # Errors
/// Why what is there cannot be used.
pub(super) fn read(path: &Path, key: ContentKey) -> Result<Option<Vec<u8>>, String> {
    let mut file = match open(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        opened => opened.map_err(reason)?,
    };
    let about = file.metadata().map_err(reason)?;
    if !about.is_file() {
        return Err("it is not a file".into());
    }
    let damaged = || "it is damaged".to_owned();
    let mut header = [0; HEADER];
    file.read_exact(&mut header).map_err(|_| damaged())?;
    let (length, sum) = parse(&header, key).ok_or_else(damaged)?;
    if about.len() != length.saturating_add(HEADER as u64) {
        return Err(damaged());
    }
    let mut bytes = Vec::new();
    let length = usize::try_from(length).map_err(|_| damaged())?;
    bytes.try_reserve_exact(length).map_err(|_| format!("it has {length} bytes, more than there is memory"))?;
    file.take(length as u64).read_to_end(&mut bytes).map_err(reason)?;
    match checksum(key, &bytes).as_bytes() == sum {
        true => Ok(Some(bytes)),
        false => Err(damaged()),
    }
}

/// Opens without waiting for the other end of a pipe, and without following a link.
fn open(path: &Path) -> io::Result<File> {
    let mut options = File::options();
    options.read(true);
    #[cfg(unix)]
    {
        use std::os::unix::fs::OpenOptionsExt as _;
        let flags = rustix::fs::OFlags::NONBLOCK | rustix::fs::OFlags::NOFOLLOW;
        options.custom_flags(flags.bits().cast_signed());
    }
    let about = fs::symlink_metadata(path)?;
    if !about.is_file() {
        return Err(io::Error::other("it is not a file"));
    }
    options.open(path)
}

/// Writes an entry beside its name and renames it: killed at any moment, the name holds nothing or all.
///
/// # Errors
/// If it cannot be written, or something that is not a file has its name.
pub(super) fn write(path: &Path, key: ContentKey, bytes: &[u8]) -> io::Result<()> {
    if fs::symlink_metadata(path).is_ok_and(|there| !there.is_file()) {
        return Err(io::ErrorKind::AlreadyExists.into());
    }
    let part = temporary(path);
    let mut file = File::options().write(true).create_new(true).open(&part)?;
    let written = file.write_all(&header(key, bytes)).and_then(|()| file.write_all(bytes));
    drop(file);
    written.and_then(|()| fs::rename(&part, path)).inspect_err(|_| drop(fs::remove_file(&part)))
}

/// `.NAME.HOST-PID-RANDOM.part`.
fn temporary(path: &Path) -> PathBuf {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!(".{name}.{}-{}-{:016x}.part", host::tag(), std::process::id(), host::unguessable()))
}

/// The size of an entry with that many bytes.
pub(super) fn size(bytes: usize) -> u64 {
    (bytes + HEADER) as u64
}

fn header(key: ContentKey, bytes: &[u8]) -> Vec<u8> {
    let mut header = MAGIC.to_vec();
    header.extend((bytes.len() as u64).to_le_bytes());
    header.extend(checksum(key, bytes).as_bytes());
    let own = checksum(key, &header);
    header.extend(&own.as_bytes()[..16]);
    header
}

/// Length and checksum of the bytes that follow a header.
fn parse(header: &[u8; HEADER], key: ContentKey) -> Option<(u64, &[u8])> {
    let (front, own) = header.split_at(HEADER - 16);
    let fits = front.starts_with(MAGIC) && checksum(key, front).as_bytes().starts_with(own);
    let length = u64::from_le_bytes(*front[8..].first_chunk()?);
    fits.then_some((length, &front[16..]))
}

fn checksum(key: ContentKey, bytes: &[u8]) -> blake3::Hash {
    blake3::Hasher::new().update(&key.0).update(bytes).finalize()
}

fn reason(error: io::Error) -> String {
    match error.kind() {
        io::ErrorKind::PermissionDenied => "no permission to read it".into(),
        io::ErrorKind::Other => error.to_string(),
        _ => format!("it could not be read: {error}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Nobody can lay a link in the place of a temporary, as nobody can know its name, and none is followed.
    #[test]
    fn temporaries_have_names_that_cannot_be_foreseen() {
        let folder = tempfile::tempdir().unwrap();
        let (key, path) = (ContentKey::of(b"a"), folder.path().join("a.frame"));
        let names: Vec<PathBuf> = (0..2).map(|_| temporary(&path)).collect();
        assert_ne!(names[0], names[1]);
        write(&path, key, b"bytes").unwrap();
        assert_eq!(read(&path, key), Ok(Some(b"bytes".to_vec())));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary stays");
    }
}
