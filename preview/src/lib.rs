//! Previews.
