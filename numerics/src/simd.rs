//! Which vector instructions kernels use: chosen once at run time, without any effect on results.
//!
//! `kernel!` compiles a function from the same source for several paths; the widest that the CPU has is run. Multiplications
//! and additions are never fused and kernels work lane by lane, so every path gives the same bits. Limit: architectures other
//! than x86-64 only have the baseline path (NEON on aarch64).

use std::sync::LazyLock;
use std::{env, error, fmt};

/// The environment variable that forces a path: `baseline`, `avx2` or `widest`.
pub const VARIABLE: &str = "CONVECT_SIMD";

/// A path that this CPU can run; no other can be constructed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Path(Level);

/// The compiled copy of a kernel that a path runs, narrowest first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// What every CPU of the build's target has: SSE2, or NEON.
    Baseline,
    /// Eight lanes: AVX2.
    Avx2,
    /// Sixteen lanes: AVX-512 F, BW, CD, DQ and VL.
    Avx512,
}

/// `CONVECT_SIMD` has a value that names no path.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnknownPath(String);

impl fmt::Display for UnknownPath {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "`{VARIABLE}` is `{}`; expected `baseline`, `avx2` or `widest`", self.0)
    }
}

impl error::Error for UnknownPath {}

impl Path {
    /// The path that every CPU has.
    pub const BASELINE: Self = Self(Level::Baseline);

    /// The widest path of this CPU.
    pub fn widest() -> Self {
        Self(widest_level())
    }

    /// All paths of this CPU, narrowest first.
    pub fn all() -> Vec<Self> {
        let levels = [Level::Baseline, Level::Avx2, Level::Avx512];
        levels.into_iter().filter(|level| *level <= widest_level()).map(Self).collect()
    }

    /// The path that `word` names, or the widest below it that this CPU has; `None` is the widest.
    pub fn asked(word: Option<&str>) -> Result<Self, UnknownPath> {
        let level = match word {
            None | Some("" | "widest") => Level::Avx512,
            Some("avx2") => Level::Avx2,
            Some("baseline") => Level::Baseline,
            Some(other) => return Err(UnknownPath(other.to_owned())),
        };
        Ok(Self(level.min(widest_level())))
    }

    /// The path that the environment names; the program calls this once at its start, to report a word that names
    /// none.
    pub fn from_environment() -> Result<Self, UnknownPath> {
        let word = env::var_os(VARIABLE).map(|word| word.to_string_lossy().into_owned());
        Self::asked(word.as_deref())
    }

    /// The path that kernels run where the caller names none: the environment's, read once; the widest where that names
    /// no path.
    pub fn chosen() -> Self {
        static CHOSEN: LazyLock<Path> = LazyLock::new(|| Path::from_environment().unwrap_or_else(|_| Path::widest()));
        *CHOSEN
    }

    /// `baseline`, `avx2` or `avx512`.
    pub fn name(self) -> &'static str {
        match self.0 {
            Level::Baseline => "baseline",
            Level::Avx2 => "avx2",
            Level::Avx512 => "avx512",
        }
    }

    /// The copy of a kernel that it runs.
    pub fn level(self) -> Level {
        self.0
    }
}

/// What the CPU has. `kernel!` is sound because every `Path` is at most this.
fn widest_level() -> Level {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::is_x86_feature_detected as has;
        if has!("avx512f")
            && has!("avx512bw")
            && has!("avx512cd")
            && has!("avx512dq")
            && has!("avx512vl")
            && has!("avx2")
        {
            return Level::Avx512;
        }
        if has!("avx2") {
            return Level::Avx2;
        }
    }
    Level::Baseline
}

/// A function that runs `body`, an `#[inline(always)]` function of the same arguments, compiled for the path that is its
/// first argument: `kernel! { pub fn settle(hairs: &[Hair]) -> Reached = settle_body; }`
///
/// Compiled for the baseline and AVX2. `kernel! { avx512 pub fn … }` compiles a copy for AVX-512 as well: for kernels that
/// were measured to run faster so. Most do not, for where lanes are gathered and scattered, sixteen at once take longer
/// than eight twice, and each copy is compiled in every build. A function may have one const generic: `kernel! { fn
/// gains<const F: usize>(…) … }`.
#[macro_export]
macro_rules! kernel {
    (avx512 $(#[$meta:meta])* $vis:vis fn $name:ident $(<$life:lifetime>)? ($($arg:ident: $type:ty),* $(,)?)
     $(-> $out:ty)? = $body:path;) => {
        $(#[$meta])*
        #[allow(unsafe_code)]
        $vis fn $name $(<$life>)? (path: $crate::simd::Path, $($arg: $type),*) $(-> $out)? {
            $crate::kernel! { fn narrower $(<$life>)? ($($arg: $type),*) $(-> $out)? = $body; }
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2,avx512f,avx512bw,avx512cd,avx512dq,avx512vl")]
                fn avx512 $(<$life>)? ($($arg: $type),*) $(-> $out)? {
                    $body($($arg),*)
                }
                if path.level() == $crate::simd::Level::Avx512 {
                    // SAFETY: a `Path` of this level exists only on a CPU with these features.
                    return unsafe { avx512($($arg),*) };
                }
            }
            narrower(path, $($arg),*)
        }
    };
    ($(#[$meta:meta])* $vis:vis fn $name:ident $(<$life:lifetime>)? ($($arg:ident: $type:ty),* $(,)?)
     $(-> $out:ty)? = $body:path;) => {
        $(#[$meta])*
        #[allow(unsafe_code)]
        $vis fn $name $(<$life>)? (path: $crate::simd::Path, $($arg: $type),*) $(-> $out)? {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2")]
                fn avx2 $(<$life>)? ($($arg: $type),*) $(-> $out)? {
                    $body($($arg),*)
                }
                if path.level() >= $crate::simd::Level::Avx2 {
                    // SAFETY: a `Path` of this level or above exists only on a CPU with AVX2.
                    return unsafe { avx2($($arg),*) };
                }
            }
            let _ = path;
            $body($($arg),*)
        }
    };
    ($(#[$meta:meta])* $vis:vis fn $name:ident <const $n:ident: $number:ty> ($($arg:ident: $type:ty),* $(,)?)
     $(-> $out:ty)? = $body:path;) => {
        $(#[$meta])*
        #[allow(unsafe_code)]
        $vis fn $name<const $n: $number>(path: $crate::simd::Path, $($arg: $type),*) $(-> $out)? {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2")]
                fn avx2<const $n: $number>($($arg: $type),*) $(-> $out)? {
                    $body($($arg),*)
                }
                if path.level() >= $crate::simd::Level::Avx2 {
                    // SAFETY: a `Path` of this level or above exists only on a CPU with AVX2.
                    return unsafe { avx2($($arg),*) };
                }
            }
            let _ = path;
            $body($($arg),*)
        }
    };
}
pub use kernel;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_word_names_a_path_or_falls_back_to_a_narrower_one() {
        assert_eq!(Path::asked(None), Ok(Path::widest()));
        assert_eq!(Path::asked(Some("widest")), Ok(Path::widest()));
        assert_eq!(Path::asked(Some("baseline")), Ok(Path::BASELINE));
        assert!(Path::asked(Some("avx2")).unwrap().level() <= Level::Avx2);
        assert_eq!(
            Path::asked(Some("AVX9")).unwrap_err().to_string(),
            "`CONVECT_SIMD` is `AVX9`; expected `baseline`, `avx2` or `widest`"
        );
    }

    #[test]
    fn paths_run_from_baseline_to_widest() {
        let all = Path::all();
        assert_eq!((all[0], all[all.len() - 1]), (Path::BASELINE, Path::widest()));
    }
}
