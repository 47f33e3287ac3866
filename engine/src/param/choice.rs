//! Params that are one of a few words.

/// One option of a choice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChoiceOption {
    /// The word in graph files.
    pub word: &'static str,
    /// What it does.
    pub help: &'static str,
}

/// An enum that a param can be; made by [`crate::choice!`].
pub trait Choice: Copy + Send + Sync + 'static {
    /// Its options, in order.
    const OPTIONS: &'static [ChoiceOption];
    /// Place of this option.
    fn place(self) -> usize;
    /// The option at `place`.
    fn at(place: usize) -> Option<Self>;
}

/// Declares an enum and its words: `choice! { /// Doc. pub enum Mode { Paper = "paper": "as the paper says", … } }`.
#[macro_export]
macro_rules! choice {
    ($(#[$meta:meta])* $vis:vis enum $name:ident { $($option:ident = $word:literal : $help:literal),* $(,)? }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        $vis enum $name { $(#[doc = $help] $option),* }

        impl $crate::param::Choice for $name {
            const OPTIONS: &'static [$crate::param::ChoiceOption] =
                &[$($crate::param::ChoiceOption { word: $word, help: $help }),*];
            fn place(self) -> usize { self as usize }
            fn at(place: usize) -> Option<Self> { [$(Self::$option),*].get(place).copied() }
        }
    };
}
