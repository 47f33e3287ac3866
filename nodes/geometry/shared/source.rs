//! Common to file sources: one component from a file, or written into the graph itself.

use engine::files::File;
use engine::geometry::GeometryError;
use engine::prelude::*;
use formats::{Format, FormatError};
use std::sync::Arc;

/// How many components the file has, of which the node gives one or some.
pub(crate) const COMPONENTS: Metric = Metric::new(
    "components",
    Unit::None,
    "Number of components in the file: curves, mesh, points, tets. A note names each file with components that no node \
        reads.",
);

/// Which file of a numbered sequence is read.
pub(crate) const FRAME: Param<i64> = Param::int(
    "frame",
    0,
    "The number of the file to read, if `file` names a numbered sequence. Fractions are rounded down. Between whole frames of \
     the scene points move in straight lines from one file to the next, if it has the same points. A file that is missing is \
     an error, also before the first: `{\"expr\": \"max(frame, 1)\"}` holds file 1 before frame 1.",
)
.unit(Unit::Frame)
.default_current_frame();

/// The unit of what is read.
pub(crate) const SCALE: Param<f64> = Param::double(
    "scale",
    1.0,
    "Multiplies positions, velocities and widths. 0.01 converts a file in centimetres to metres.",
)
.soft(0.001, 1000.0);

/// The component of `kind` in a file; other geometry is ignored, but counted.
///
/// # Errors
/// If the file cannot be read in the format of its extension, or has no such component.
pub(crate) fn from_file(cx: &Cx, file: &File, kind: Kind) -> Result<Component> {
    let path = file.path().display();
    let refused = |error: FormatError| {
        let fact = Error::file(format!("`{path}`: {error}"));
        match error.hint() {
            Some(hint) => fact.hint(hint),
            None => fact,
        }
    };
    let format = Format::of_path(file.path()).map_err(refused)?;
    let geometry = formats::read(format, &file.bytes()?).map_err(refused)?;
    cx.publish(COMPONENTS, geometry.kinds().count() as f64);
    geometry.part(kind).cloned().ok_or_else(|| {
        let there: Vec<&str> = geometry.kinds().map(Kind::name).collect();
        let there = if there.is_empty() { "nothing".to_owned() } else { there.join(", ") };
        Error::file(format!("`{path}` has no {kind}; it has {there}"))
    })
}

/// Attributes written into the graph, of points and of elements.
pub(crate) struct Inline {
    pub(crate) points: Arc<Vec<(Name, Column)>>,
    pub(crate) elements: Arc<Vec<(Name, Column)>>,
}

impl Inline {
    /// Adds the attributes to a component.
    ///
    /// # Errors
    /// If one has the wrong type or number of rows.
    pub(crate) fn add_to(self, component: &mut Component) -> Result<()> {
        let lists =
            [(Owner::Point, &self.points, "attributes"), (Owner::Element, &self.elements, "element_attributes")];
        for (owner, columns, param) in lists {
            for (name, column) in columns.iter() {
                let set = component.set_column(owner, name.clone(), column.clone());
                set.map_err(|error| Error::from(error).of(param))?;
            }
        }
        Ok(())
    }
}

/// Integers written into the graph.
///
/// # Errors
/// If one of them is below `least`.
pub(crate) fn wholes(param: Param<Arc<Vec<i32>>>, numbers: &[i32], least: i32) -> Result<Vec<u32>> {
    if let Some(place) = numbers.iter().position(|number| *number < least) {
        let fact = format!("`{}` has {} at index {place}, counted from 0", param.name(), numbers[place]);
        return Err(Error::refused(fact).hint(format!("expected at least {least}")).of(param.name()));
    }
    Ok(numbers.iter().map(|number| number.unsigned_abs()).collect())
}

/// An error of geometry written into the graph, in terms of its params; `indices` is the param with the elements'
/// points.
pub(crate) fn explained(error: GeometryError, indices: &'static str) -> Error {
    match error {
        GeometryError::Counts { sum, points } => {
            Error::refused(format!("`counts` adds up to {sum} CVs, but `points` has {points}")).of("counts")
        }
        GeometryError::Corners { sum, corners } => {
            Error::refused(format!("`counts` adds up to {sum} corners, but `indices` has {corners}")).of("counts")
        }
        GeometryError::Index { corner, index, points } => {
            let fact = format!("`{indices}` has {index} at index {corner}, but there are {points} `points`");
            Error::refused(fact).hint("points and indices are counted from 0").of(indices)
        }
        other => other.into(),
    }
}

/// Checks that exactly one of `file` and inline points is given.
///
/// # Errors
/// If both or neither are.
pub(crate) fn file_or_inline(file: Option<&File>, has_inline: bool) -> Result<()> {
    match (file, has_inline) {
        (Some(_), true) => Err(Error::refused("it has both a `file` and `points`").hint("remove one of them")),
        (None, false) => {
            Err(Error::refused("it has neither a `file` nor `points`").hint("name a file, or write `points`"))
        }
        _ => Ok(()),
    }
}

/// A numbered sequence of files in a temporary folder, for tests: `text` gives the contents of each of the first
/// frames.
#[cfg(test)]
pub(crate) fn numbered_files(
    extension: &str,
    text: impl Fn(i64) -> String,
) -> (tempfile::TempDir, engine::param::Source) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for frame in 0..64 {
        let path = folder.path().join(format!("in.{frame:04}.{extension}"));
        std::fs::write(path, text(frame)).expect("a file in a temporary folder");
    }
    let path = folder.path().join(format!("in.####.{extension}")).into();
    (folder, engine::param::Source::File { path, numbered: true })
}
