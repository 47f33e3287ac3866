//! How much memory a cook may take: `--memory`, or half of the machine's, but never more than the process is allowed.

use std::fs;
use std::path::{Path, PathBuf};

use engine::memory::Ceiling;

use crate::args::Size;

/// The ceiling for `--memory asked`, or without it.
pub fn ceiling(asked: Option<Size>) -> Ceiling {
    let bytes = |bytes: u64| usize::try_from(bytes).unwrap_or(usize::MAX);
    let wanted = match asked {
        Some(Size(size)) => Ceiling { bytes: bytes(size), set_by: "--memory allows" },
        None => Ceiling { bytes: bytes(half_of_memory()), set_by: "half of the machine's memory is" },
    };
    let limits = [
        (address_space_left(), "the limit on the process's address space leaves"),
        (group_limit(), "the memory limit of the process's control group is"),
    ];
    let limits = limits.into_iter().filter_map(|(limit, set_by)| Some(Ceiling { bytes: bytes(limit?), set_by }));
    limits.fold(wanted, |least, limit| if limit.bytes < least.bytes { limit } else { least })
}

/// Half of the machine's memory, or 1 GiB if that is unknown.
fn half_of_memory() -> u64 {
    let total = kilobytes(&fs::read_to_string("/proc/meminfo").unwrap_or_default(), "MemTotal:");
    total.map_or(1 << 30, |total| total / 2)
}

/// The bytes of a line such as `MemTotal:  16318480 kB`.
fn kilobytes(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    Some(line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()? * 1024)
}

/// What RLIMIT_AS leaves the process.
fn address_space_left() -> Option<u64> {
    let limit = soft_limit(&fs::read_to_string("/proc/self/limits").ok()?, "Max address space")?;
    let taken = kilobytes(&fs::read_to_string("/proc/self/status").ok()?, "VmSize:").unwrap_or(0);
    Some(limit.saturating_sub(taken))
}

/// The soft limit of a line of `/proc/self/limits`; `None` where it is unlimited.
fn soft_limit(text: &str, name: &str) -> Option<u64> {
    text.lines().find_map(|line| line.strip_prefix(name))?.split_whitespace().next()?.parse().ok()
}

/// The smallest memory limit of the process's control groups, of version 1 or 2.
fn group_limit() -> Option<u64> {
    let groups = fs::read_to_string("/proc/self/cgroup").ok()?;
    groups.lines().filter_map(|line| limit_of(Path::new("/sys/fs/cgroup"), line)).min()
}

/// The smallest limit of a group and its parents; `line` is that of `/proc/self/cgroup`.
fn limit_of(root: &Path, line: &str) -> Option<u64> {
    let mut parts = line.splitn(3, ':').skip(1);
    let (controllers, path) = (parts.next()?, parts.next()?);
    let (root, file) = match controllers {
        "" => (root.to_owned(), "memory.max"),
        _ if controllers.split(',').any(|name| name == "memory") => (root.join("memory"), "memory.limit_in_bytes"),
        _ => return None,
    };
    let group: PathBuf = root.join(path.trim_start_matches('/'));
    let limits = group.ancestors().take_while(|group| group.starts_with(&root));
    limits.filter_map(|group| fs::read_to_string(group.join(file)).ok()?.trim().parse().ok()).min()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_read_as_the_system_writes_them() {
        let text = "Limit                     Soft Limit           Hard Limit           Units\n\
                    Max address space         4294967296           unlimited            bytes\n\
                    Max file size             unlimited            unlimited            bytes\n";
        assert_eq!(soft_limit(text, "Max address space"), Some(4 << 30));
        assert_eq!(soft_limit(text, "Max file size"), None);
        assert_eq!(kilobytes("MemFree: 1 kB\nMemTotal:   2048 kB\n", "MemTotal:"), Some(2 << 20));
    }

    #[test]
    fn the_smallest_limit_of_a_group_and_its_parents_counts() {
        let root = tempfile::tempdir().unwrap();
        let write = |path: &str, text: &str| {
            let path = root.path().join(path);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        };
        write("user/memory.max", "1000000\n");
        write("user/job/memory.max", "max\n");
        write("memory/old/memory.limit_in_bytes", "77\n");
        assert_eq!(limit_of(root.path(), "0::/user/job"), Some(1_000_000));
        assert_eq!(limit_of(root.path(), "4:cpu,memory:/old"), Some(77));
        assert_eq!(limit_of(root.path(), "4:cpu:/old"), None);
        assert_eq!(limit_of(root.path(), "0::/"), None);
    }
}
