//! Params whose value is one of a few words.

/// One option of a choice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChoiceOption {
    /// The word in graph files.
    pub word: &'static str,
    /// What it does.
    pub help: &'static str,
}

/// The words of a param and the values that they stand for; implemented by [`crate::choice!`].
pub trait Choice: 'static {
    /// The type that a node gets: an enum of the node, or one of its kernel.
    type Value: Copy + PartialEq + Send + Sync + 'static;
    /// Its options, in order.
    const OPTIONS: &'static [ChoiceOption];
    /// The value of each option.
    const VALUES: &'static [Self::Value];
}

/// Declares the words of a choice.
///
/// * An enum of the node's own: `choice! { /// Doc. pub enum Part { Mesh = "mesh": "the mesh", … } }`
/// * Values that a kernel already has: `choice! { /// Doc. pub Basis for lattice::Basis { lattice::Basis::Bernstein =>
///   "bernstein": "smooth", … } }`; `Basis` is the type of the handle, and `cx.get` gives the kernel's value.
#[macro_export]
macro_rules! choice {
    ($(#[$meta:meta])* $vis:vis enum $name:ident { $($option:ident = $word:literal : $help:literal),* $(,)? }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        $vis enum $name { $(#[doc = $help] $option),* }

        $crate::choice!(@words $name, $name, $($name::$option, $word, $help;)*);
    };
    ($(#[$meta:meta])* $vis:vis $name:ident for $value:ty { $($option:expr => $word:literal : $help:literal),* $(,)? }) => {
        $(#[$meta])*
        $vis enum $name {}

        $crate::choice!(@words $name, $value, $($option, $word, $help;)*);
    };
    (@words $name:ident, $value:ty, $($option:expr, $word:literal, $help:literal;)*) => {
        impl $crate::param::Choice for $name {
            type Value = $value;
            const OPTIONS: &'static [$crate::param::ChoiceOption] =
                &[$($crate::param::ChoiceOption { word: $word, help: $help }),*];
            const VALUES: &'static [$value] = &[$($option),*];
        }
    };
}
