//! Notes: what a user should know about a graph or a cook although it is no error.

use std::fmt;

use serde_json::{Value, json};

use crate::geometry::Name;
use crate::time::Frame;

/// Kinds of notes that are not about a metric; a note about a metric has the metric's name as its kind.
pub mod kind {
    /// The disk cache could not be used, or not fully.
    pub const CACHE: &str = "cache";
    /// A node that no output needs.
    pub const UNUSED_NODE: &str = "unused_node";
    /// Outputs whose names differ only in case.
    pub const SIMILAR_NAMES: &str = "similar_names";
    /// `pi` in a param of degrees.
    pub const PI_IN_DEGREES: &str = "pi_in_degrees";
    /// Frames outside those of the scene.
    pub const OUTSIDE_SCENE: &str = "outside_scene";
    /// An output without any point or cell at all frames.
    pub const EMPTY_OUTPUT: &str = "empty_output";
    /// Positions so far from the origin that single precision rounds shapes visibly.
    pub const COARSE_POSITIONS: &str = "coarse_positions";
    /// A mask that is 0 everywhere, at all frames.
    pub const ZERO_MASK: &str = "zero_mask";
    /// A mask that takes a param out of its range.
    pub const MASK_OUTSIDE_RANGE: &str = "mask_outside_range";
    /// An attribute that an output requests and never has.
    pub const MISSING_ATTRIBUTE: &str = "missing_attribute";
    /// An attribute that a node does not read, because its owner or type differs.
    pub const MISREAD_ATTRIBUTE: &str = "misread_attribute";
    /// Data that the file format cannot hold.
    pub const NOT_WRITTEN: &str = "not_written";
    /// Components of a file that no node reads.
    pub const UNREAD_COMPONENTS: &str = "unread_components";
    /// Curves without a width, which got one in the file.
    pub const NO_WIDTH: &str = "no_width";
}

/// What a user should know although it is no error.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Note {
    /// What it is about: one of [`kind`], or the name of a metric.
    pub kind: &'static str,
    /// The node that it is about, if it is about one.
    pub node: Option<Name>,
    /// The frames at which it holds, ascending; empty if it does not depend on the frame.
    pub frames: Vec<Frame>,
    /// What was found.
    pub text: String,
    /// What it means, and what to do about it; whole sentences.
    pub hint: Option<String>,
}

impl Note {
    /// A note that is about no node and no frame.
    pub fn new(kind: &'static str, text: impl Into<String>) -> Self {
        Self { kind, node: None, frames: Vec::new(), text: text.into(), hint: None }
    }

    /// Names the node that it is about.
    #[must_use]
    pub fn of_node(mut self, node: &Name) -> Self {
        self.node = Some(node.clone());
        self
    }

    /// Sets the frames at which it holds, ascending.
    #[must_use]
    pub fn at(mut self, frames: Vec<Frame>) -> Self {
        self.frames = frames;
        self
    }

    /// Adds what it means and what to do about it; whole sentences.
    #[must_use]
    pub fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = Some(hint.into());
        self
    }

    /// The object in a report's list `notes`.
    pub fn to_json(&self) -> Value {
        let frames: Vec<Value> = self.frames.iter().map(|frame| frame.to_json()).collect();
        json!({
            "kind": self.kind, "node": self.node.as_deref(), "frames": frames,
            "text": self.text, "hint": self.hint,
        })
    }
}

/// The note as a terminal shows it: text, frames, hint.
impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)?;
        if self.frames.len() > 1 {
            write!(f, " (frames {})", FrameRanges(&self.frames))?;
        }
        self.hint.as_ref().map_or(Ok(()), |hint| write!(f, ". {hint}"))
    }
}

/// Ascending frames as a person reads them: `1-3, 7, 9-12`. Long lists are cut.
pub struct FrameRanges<'a>(pub &'a [Frame]);

impl fmt::Display for FrameRanges<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        /// Ranges shown before a list is cut.
        const SHOWN: usize = 6;
        let follows = |a: &Frame, b: &Frame| b.ticks() - a.ticks() == Frame::TICKS;
        for (place, range) in self.0.chunk_by(follows).enumerate() {
            if place == SHOWN {
                return write!(f, ", … {}", self.0[self.0.len() - 1]);
            }
            if place > 0 {
                f.write_str(", ")?;
            }
            match range {
                [only] => write!(f, "{only}")?,
                [first, .., last] => write!(f, "{first}-{last}")?,
                [] => {}
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frames(numbers: &[i64]) -> Vec<Frame> {
        numbers.iter().map(|number| Frame::whole(*number)).collect()
    }

    #[test]
    fn frames_are_shown_as_ranges() {
        let shown = |numbers: &[i64]| FrameRanges(&frames(numbers)).to_string();
        assert_eq!(shown(&[1, 2, 3, 7, 9, 10]), "1-3, 7, 9-10");
        assert_eq!(shown(&[5]), "5");
        let every_second: Vec<i64> = (0..20).map(|k| 2 * k).collect();
        assert_eq!(shown(&every_second), "0, 2, 4, 6, 8, 10, … 38");
        let half = [Frame::exactly(1.0).unwrap(), Frame::exactly(1.5).unwrap()];
        assert_eq!(FrameRanges(&half).to_string(), "1, 1.5");
    }

    #[test]
    fn a_note_shows_text_frames_and_hint() {
        let note = Note::new(kind::EMPTY_OUTPUT, "output `a` is empty").at(frames(&[1, 2])).hint("Look at its input.");
        assert_eq!(note.to_string(), "output `a` is empty (frames 1-2). Look at its input.");
        assert_eq!(Note::new(kind::CACHE, "no cache").at(frames(&[1])).to_string(), "no cache");
    }

    #[test]
    fn a_note_in_a_report_has_every_key() {
        let note = Note::new(kind::UNUSED_NODE, "text").of_node(&"fur".into()).at(vec![Frame::exactly(1.5).unwrap()]);
        let expected = json!({"kind": "unused_node", "node": "fur", "frames": [1.5], "text": "text", "hint": null});
        assert_eq!(note.to_json(), expected);
    }
}
