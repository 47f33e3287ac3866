//! The component that a node writes, with everything else of its input passed through.

use std::ops::{Deref, DerefMut};
use std::sync::Arc;

use super::{Cx, Input, One};
use crate::geometry::{Component, Geometry};

/// An input's component for writing; arrays are copied only when they are written. Becomes the whole geometry again:
/// `Ok(OUT.with(curves))`.
#[derive(Clone, Debug)]
pub struct Edited {
    /// The input without the component.
    rest: Geometry,
    part: Arc<Component>,
}

impl Cx<'_> {
    /// The component that an input needs, for writing; see [`Edited`].
    ///
    /// # Panics
    /// Where the input takes any kind of component.
    pub fn edit(&self, input: Input<One>) -> Edited {
        let (mut rest, part) = (self.input(input).clone(), Arc::new(self.part(input).clone()));
        rest.remove(part.kind());
        Edited { rest, part }
    }
}

impl Deref for Edited {
    type Target = Component;
    fn deref(&self) -> &Component {
        &self.part
    }
}

impl DerefMut for Edited {
    fn deref_mut(&mut self) -> &mut Component {
        Arc::make_mut(&mut self.part)
    }
}

impl From<Edited> for Geometry {
    fn from(edited: Edited) -> Self {
        edited.rest.with(edited.part)
    }
}

impl From<Edited> for Arc<Geometry> {
    fn from(edited: Edited) -> Self {
        Arc::new(edited.into())
    }
}
