//! Everything that a command writes, checked before anything is written: no target may be a file that the command reads,
//! or another of its targets, under whatever name.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs;
use std::path::{Component, Path, PathBuf};

use engine::frames::FrameSet;
use engine::time::Frame;

use crate::failure::{Exit, Failure};

/// Links in a path that are followed, as many as Linux does.
const MOST_LINKS: usize = 40;

/// What a command reads and writes.
#[derive(Default)]
pub struct Targets {
    read: Vec<(PathBuf, &'static str)>,
    written: Vec<Target>,
}

/// A file to write, or one per frame.
struct Target {
    /// What names it: an option, or the part of the command that does.
    option: &'static str,
    exit: Exit,
    /// As it was given; of several files their folder.
    path: PathBuf,
    /// The folder, without links and `..`.
    folder: PathBuf,
    names: Names,
}

/// The names of a target's files.
enum Names {
    One(String),
    /// `STEM.FRAME.ENDING`.
    PerFrame {
        stem: String,
        ending: String,
        frames: FrameSet,
    },
}

impl Names {
    /// Whether `name` is one of them; letters are the same in both cases if `folded`.
    fn contain(&self, name: &str, folded: bool) -> bool {
        let fold = |text: &str| if folded { text.to_lowercase() } else { text.to_owned() };
        match self {
            Self::One(own) => fold(own) == fold(name),
            Self::PerFrame { stem, ending, frames } => {
                let name = fold(name);
                let label = name.strip_prefix(&fold(stem)).and_then(|rest| rest.strip_suffix(&fold(ending)));
                let label = label.and_then(|rest| rest.strip_prefix('.')?.strip_suffix('.'));
                let frame = label.and_then(Frame::of_file_label);
                frame.is_some_and(|frame| frames.contains(frame))
            }
        }
    }

    /// A name that is one of both.
    fn common(&self, other: &Self, folded: bool) -> Option<String> {
        match (self, other) {
            (Self::One(name), names) | (names, Self::One(name)) => names.contain(name, folded).then(|| name.clone()),
            (Self::PerFrame { stem, ending, frames }, Self::PerFrame { stem: other, ending: of, frames: its }) => {
                let same = |a: &str, b: &str| if folded { a.to_lowercase() == b.to_lowercase() } else { a == b };
                let common =
                    (same(stem, other) && same(ending, of)).then(|| frames.iter().find(|at| its.contains(*at)));
                common.flatten().map(|frame| format!("{stem}.{}.{ending}", frame.file_label()))
            }
        }
    }

    /// The same text for names that may be the same.
    fn group(&self) -> String {
        match self {
            Self::One(name) => name.to_lowercase(),
            Self::PerFrame { stem, ending, .. } => format!("{stem}/{ending}").to_lowercase(),
        }
    }
}

impl Targets {
    /// Adds a file that the command reads; `why` completes "it would be overwritten, but".
    pub fn reads(&mut self, path: impl Into<PathBuf>, why: &'static str) {
        self.read.push((path.into(), why));
    }

    /// Adds a file to write, named by `option`.
    pub fn writes(&mut self, option: &'static str, exit: Exit, path: &Path) {
        let (folder, name) = place(path);
        self.written.push(Target { option, exit, path: path.to_owned(), folder, names: Names::One(name) });
    }

    /// Adds a file per frame, `STEM.FRAME.ENDING` in `folder`; frames ascend.
    pub fn writes_frames(&mut self, option: &'static str, folder: &Path, stem: &str, ending: &str, frames: &FrameSet) {
        let names = Names::PerFrame { stem: stem.into(), ending: ending.into(), frames: frames.clone() };
        let path = folder.to_owned();
        self.written.push(Target { option, exit: Exit::File, path, folder: resolved(folder), names });
    }

    /// Refuses a target that is read, or that is another target too.
    ///
    /// # Errors
    /// If there is such a target.
    pub fn check(&self) -> Result<(), Failure> {
        self.differ()?;
        if let Some(target) = self.written.iter().find(|target| target.is_stream()) {
            let hint = if target.option == "--report" { "; write - for stdout, or the path of a file" } else { "" };
            return Err(Failure::file(format!(
                "`{}` is a stream or a device, not a file{hint}",
                target.path.display()
            )));
        }
        let read: BTreeMap<Identity, &'static str> =
            self.read.iter().filter_map(|(path, why)| Some((identity(path)?, *why))).collect();
        let mut written: BTreeMap<Identity, &Target> = BTreeMap::new();
        for target in &self.written {
            for path in target.existing() {
                let Some(identity) = identity(&path) else { continue };
                if let Some(why) = read.get(&identity) {
                    let fact = format!("`{}` would be overwritten, but {why}", target.as_given(&path).display());
                    // Only a path that was given itself is a wrong command line; the others lie in --out.
                    let option = if target.exit == Exit::File { "--out" } else { target.option };
                    return Err(Failure::new(target.exit, format!("{fact}; choose another {option}")));
                }
                // Equal frames of one option may be links to one file: each is replaced, none is written through.
                match written.insert(identity, target) {
                    Some(other) if other.option != target.option => {
                        return Err(target.refused(other, &target.as_given(&path)));
                    }
                    _ => {}
                }
            }
        }
        Ok(())
    }

    /// Refuses two targets with one name.
    fn differ(&self) -> Result<(), Failure> {
        let mut groups: BTreeMap<(&Path, String), &Target> = BTreeMap::new();
        for target in &self.written {
            let same = groups.insert((&target.folder, target.names.group()), target);
            // A single file may also be one of those per frame.
            let is_one = |target: &Target| matches!(target.names, Names::One(_));
            let others = self.written.iter().filter(|other| is_one(target) && !is_one(other));
            for other in same.into_iter().chain(others).filter(|other| other.folder == target.folder) {
                let common = target.names.common(&other.names, false);
                let folded = || target.names.common(&other.names, true).filter(|_| ignores_case(&target.folder));
                if let Some(name) = common.or_else(folded) {
                    return Err(target.refused(other, &target.folder_as_given().join(name)));
                }
            }
        }
        Ok(())
    }

    /// Removes the temporaries that killed commands left beside the targets.
    pub fn sweep(&self) {
        let mut folders: Vec<&Path> = self.written.iter().map(|target| target.folder.as_path()).collect();
        folders.sort_unstable();
        folders.dedup();
        for folder in folders {
            // What cannot be removed now is left to a later sweep; a folder that is missing has none.
            let _ = formats::atomic::sweep(folder);
        }
    }
}

impl Target {
    fn refused(&self, other: &Self, path: &Path) -> Failure {
        let (option, exit) = (self.option, self.exit.max(other.exit));
        let fact = match option == other.option {
            true => format!("{option} would write `{}` twice", path.display()),
            false => format!("{option} and {} would both write `{}`", other.option, path.display()),
        };
        Failure::new(exit, format!("{fact}; choose another name"))
    }

    /// Whether it is a name of the system, such as `/dev/stdout`: a link to whatever stdout is, which must not be replaced
    /// even where that is a file.
    fn is_stream(&self) -> bool {
        let folder = self.path.parent().and_then(|folder| folder.canonicalize().ok());
        let is_system = |folder: PathBuf| folder == Path::new("/dev") || folder.starts_with("/proc");
        matches!(self.names, Names::One(_)) && folder.is_some_and(is_system)
    }

    /// One of its files as a user knows it.
    fn as_given(&self, path: &Path) -> PathBuf {
        match self.names {
            Names::One(_) => self.path.clone(),
            Names::PerFrame { .. } => self.path.join(path.file_name().unwrap_or_default()),
        }
    }

    fn folder_as_given(&self) -> &Path {
        match &self.names {
            Names::One(_) => self.path.parent().unwrap_or(&self.folder),
            Names::PerFrame { .. } => &self.path,
        }
    }

    /// Those of its files that exist.
    fn existing(&self) -> Vec<PathBuf> {
        match &self.names {
            Names::One(name) => vec![self.folder.join(name)],
            names @ Names::PerFrame { .. } => {
                let entries = fs::read_dir(&self.folder).into_iter().flatten().flatten();
                let names = entries.filter(|entry| entry.file_name().to_str().is_some_and(|n| names.contain(n, true)));
                names.map(|entry| entry.path()).collect()
            }
        }
    }
}

/// What tells whether two paths are one file, through links too.
#[cfg(unix)]
type Identity = (u64, u64);
#[cfg(not(unix))]
type Identity = PathBuf;

#[cfg(unix)]
fn identity(path: &Path) -> Option<Identity> {
    use std::os::unix::fs::MetadataExt as _;
    let about = fs::metadata(path).ok()?;
    Some((about.dev(), about.ino()))
}

#[cfg(not(unix))]
fn identity(path: &Path) -> Option<Identity> {
    path.canonicalize().ok()
}

/// The folder, without links and `..`, and the name of a file.
fn place(path: &Path) -> (PathBuf, String) {
    let path = resolved(path);
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    (path.parent().unwrap_or(Path::new("/")).to_owned(), name)
}

/// The absolute path without links and `..`, also of what does not exist yet.
fn resolved(path: &Path) -> PathBuf {
    let mut done = if path.is_absolute() { PathBuf::new() } else { Path::new(".").canonicalize().unwrap_or_default() };
    let parts = |path: &Path| -> Vec<OsString> {
        path.components().rev().map(|part: Component<'_>| part.as_os_str().to_owned()).collect()
    };
    let mut rest = parts(path);
    let mut links = 0;
    while let Some(part) = rest.pop() {
        match part.to_str() {
            Some(".") => {}
            Some("..") => _ = done.pop(),
            _ => {
                done.push(part);
                if let Ok(to) = fs::read_link(&done)
                    && links < MOST_LINKS
                {
                    links += 1;
                    done.pop();
                    rest.extend(parts(&to));
                }
            }
        }
    }
    done
}

/// Whether names that differ only by case are one file there; `false` where nothing tells.
fn ignores_case(folder: &Path) -> bool {
    let swapped = |name: &str| -> String {
        name.chars()
            .map(|c| if c.is_ascii_lowercase() { c.to_ascii_uppercase() } else { c.to_ascii_lowercase() })
            .collect()
    };
    let existing = folder.ancestors().find(|folder| folder.is_dir()).unwrap_or(folder);
    let names =
        fs::read_dir(existing).into_iter().flatten().flatten().filter_map(|entry| entry.file_name().into_string().ok());
    let known = names.take(1000).find(|name| name.bytes().any(|byte| byte.is_ascii_alphabetic()));
    let (folder, name) = match known {
        Some(name) => (existing.to_owned(), name),
        // An empty folder: its own name tells, unless a file system starts there.
        None => place(existing),
    };
    let found = identity(&folder.join(&name));
    found.is_some() && found == identity(&folder.join(swapped(&name)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frames(numbers: &[i64]) -> FrameSet {
        numbers.iter().fold(FrameSet::default(), |set, frame| set.union(&FrameSet::whole(*frame, *frame)))
    }

    #[test]
    fn paths_are_compared_without_links_and_dots() {
        let folder = tempfile::tempdir().unwrap();
        let real = folder.path().canonicalize().unwrap();
        fs::create_dir(real.join("a")).unwrap();
        assert_eq!(resolved(&real.join("a/../b/./c/../d")), real.join("b/d"), "what does not exist yet too");
        if cfg!(unix) {
            #[cfg(unix)]
            {
                std::os::unix::fs::symlink("a", real.join("link")).unwrap();
                std::os::unix::fs::symlink("link/none", real.join("dangling")).unwrap();
                std::os::unix::fs::symlink("round", real.join("round")).unwrap();
            }
            assert_eq!(resolved(&real.join("link/../x")), real.join("x"));
            assert_eq!(resolved(&real.join("dangling")), real.join("a/none"));
            assert!(resolved(&real.join("round")).starts_with(&real), "a circle ends");
        }
    }

    #[test]
    fn names_per_frame_are_those_of_the_frames() {
        let names = Names::PerFrame { stem: "hair".into(), ending: "obj".into(), frames: frames(&[-3, 1, 12345]) };
        for name in ["hair.0001.obj", "hair.-0003.obj", "hair.12345.obj"] {
            assert!(names.contain(name, false), "{name}");
        }
        for name in ["hair.0002.obj", "hair.1.obj", "hair.obj", "hair..obj", "hair0001.obj", "Hair.0001.obj"] {
            assert!(!names.contain(name, false), "{name}");
        }
        assert!(names.contain("Hair.0001.OBJ", true));
        let other = Names::PerFrame { stem: "HAIR".into(), ending: "obj".into(), frames: frames(&[2, 12345]) };
        assert_eq!(names.common(&other, false), None);
        assert_eq!(names.common(&other, true), Some("hair.12345.obj".into()));
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_name_of_the_system_is_not_replaced_by_a_file() {
        for path in ["/dev/stdout", "/dev/../dev/stderr", "/dev/fd/1", "/proc/self/fd/1", "/dev/null"] {
            let mut targets = Targets::default();
            targets.writes("--report", Exit::CommandLine, Path::new(path));
            let refused = targets.check().unwrap_err();
            assert_eq!(refused.exit, Exit::File);
            let said =
                format!("`{path}` is a stream or a device, not a file; write - for stdout, or the path of a file");
            assert_eq!(refused.lines, [said]);
        }
    }

    #[test]
    fn case_is_told_by_what_is_there() {
        let folder = tempfile::tempdir().unwrap();
        let probe = folder.path().join("probe");
        fs::write(&probe, "").unwrap();
        let ignores = folder.path().join("PROBE").exists();
        assert_eq!(ignores_case(folder.path()), ignores);
        assert_eq!(ignores_case(&folder.path().join("not/there")), ignores);
        let mut targets = Targets::default();
        for name in ["d", "D"] {
            targets.writes("--out", Exit::File, &folder.path().join(name));
        }
        assert_eq!(targets.check().is_err(), ignores);
    }
}
