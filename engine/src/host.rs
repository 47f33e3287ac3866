//! Names for temporary files that no other process uses, on this machine or on another that shares the folder.

use std::hash::{BuildHasher, Hasher};

/// Eight hexadecimal digits that differ from machine to machine: a process number says whether its process lives only
/// on the machine that it belongs to.
pub fn tag() -> String {
    format!("{:08x}", u32::from_le_bytes(*blake3::hash(&name()).as_bytes().first_chunk().unwrap_or(&[0; 4])))
}

#[cfg(unix)]
fn name() -> Vec<u8> {
    rustix::system::uname().nodename().to_bytes().to_vec()
}

#[cfg(not(unix))]
fn name() -> Vec<u8> {
    std::env::var("COMPUTERNAME").unwrap_or_default().into_bytes()
}

/// A number that cannot be guessed and differs from call to call.
pub fn unguessable() -> u64 {
    // The standard library's keys come from the system's random numbers.
    std::hash::RandomState::new().build_hasher().finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_machine_has_one_tag_and_numbers_do_not_repeat() {
        assert_eq!(tag(), tag());
        assert_eq!(tag().len(), 8);
        let mut numbers: Vec<u64> = (0..1000).map(|_| unguessable()).collect();
        numbers.sort_unstable();
        numbers.dedup();
        assert_eq!(numbers.len(), 1000);
    }
}
