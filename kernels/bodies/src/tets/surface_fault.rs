//! Why a surface cannot be filled: what is wrong, where, and what to do about it. Indices are those of the input.

/// What is wrong with a surface; if in several places, the first of them.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SurfaceFault {
    /// A coordinate is NaN or infinite.
    #[error("point {point} is not finite")]
    NotFinite {
        /// The point.
        point: u32,
    },
    /// Points at the same position, where repairs are not allowed.
    #[error("points {} and {} have the same position{}", points[0], points[1], of(*count, "such point"))]
    DuplicatePoint {
        /// The first two.
        points: [u32; 2],
        /// Number of points at the position of an earlier one.
        count: usize,
    },
    /// A face that uses a point twice, where repairs are not allowed.
    #[error("face {face} uses a point twice{}", of(*count, "such face"))]
    Degenerate {
        /// The first face.
        face: u32,
        /// Number of such faces.
        count: usize,
    },
    /// Two faces with the same points, where repairs are not allowed.
    #[error("faces {} and {} have the same points{}", faces[0], faces[1], of(*count, "such pair"))]
    DuplicateFace {
        /// The first two.
        faces: [u32; 2],
        /// Number of faces that duplicate an earlier one.
        count: usize,
    },
    /// A point without a face, where repairs are not allowed.
    #[error("point {point} has no face{}", of(*count, "such point"))]
    UnusedPoint {
        /// The first point.
        point: u32,
        /// Number of such points.
        count: usize,
    },
    /// A hole.
    #[error(
        "the surface is open: the edge of face {face} between points {} and {} has no other face{}", points[0],
        points[1], of(*count, "such edge")
    )]
    OpenEdge {
        /// Ends of the first open edge.
        points: [u32; 2],
        /// Its face.
        face: u32,
        /// Number of edges with one face.
        count: usize,
    },
    /// An edge with more than two faces.
    #[error(
        "the edge between points {} and {} has {faces} faces, expected 2{}", points[0], points[1],
        of(*count, "such edge")
    )]
    NonManifoldEdge {
        /// Ends of the first such edge.
        points: [u32; 2],
        /// Number of its faces.
        faces: usize,
        /// Number of edges with more than two faces.
        count: usize,
    },
    /// Neighbouring faces with opposite orientation, where repairs are not allowed.
    #[error("faces {} and {} have opposite orientations{}", faces[0], faces[1], of(*count, "such pair"))]
    InconsistentOrientation {
        /// The first two.
        faces: [u32; 2],
        /// Number of edges between such faces.
        count: usize,
    },
    /// A non-orientable surface, such as a Klein bottle.
    #[error("the shell with face {face} is not orientable, so it has no inside")]
    NonOrientable {
        /// One of its faces.
        face: u32,
    },
    /// A shell that encloses no volume.
    #[error("the shell with face {face} encloses no volume")]
    NoVolume {
        /// Its first face.
        face: u32,
    },
    /// A shell with the wrong orientation, where repairs are not allowed.
    #[error(
        "the shell with face {face} faces {}{}", if *cavity { "away from the cavity it bounds" } else { "inwards" },
        of(*count, "such shell")
    )]
    InsideOut {
        /// Its first face.
        face: u32,
        /// Whether it is the wall of a cavity.
        cavity: bool,
        /// Number of such shells.
        count: usize,
    },
    /// Faces that intersect.
    #[error("faces {} and {} intersect near {at:?}{}", faces[0], faces[1], of(*count, "such pair"))]
    SelfIntersection {
        /// The first two.
        faces: [u32; 2],
        /// A point of one of them near the intersection, metres.
        at: [f32; 3],
        /// Number of intersecting pairs of triangles.
        count: usize,
    },
    /// Shells that overlap without intersecting faces, so that some space is enclosed more than once.
    #[error("the surface overlaps itself near {at:?}")]
    SelfOverlap {
        /// A point in the overlap, metres.
        at: [f32; 3],
    },
    /// Too many interior points.
    #[error("a spacing of {spacing} m would make about {points:.2e} points, expected at most {most:.2e}")]
    TooManyPoints {
        /// The requested spacing, metres.
        spacing: f64,
        /// Number of points it would give.
        points: f64,
        /// Largest allowed number.
        most: f64,
    },
}

/// The total count, if it is more than one.
fn of(count: usize, what: &str) -> String {
    if count > 1 { format!(" ({count} {what}s in all)") } else { String::new() }
}

impl SurfaceFault {
    /// What to do about it.
    pub fn hint(&self) -> &'static str {
        match self {
            Self::NotFinite { .. } => "check the node or file that made the surface",
            Self::DuplicatePoint { .. }
            | Self::Degenerate { .. }
            | Self::DuplicateFace { .. }
            | Self::UnusedPoint { .. } => "`repair` \"safe\" removes them",
            Self::InconsistentOrientation { .. } | Self::InsideOut { .. } => "`repair` \"safe\" flips them",
            Self::OpenEdge { .. } => {
                "close the hole, or give a thin wall a thickness; or set `method` to \"cage\", which takes open surfaces"
            }
            Self::NonManifoldEdge { .. } => {
                "remove the faces inside the body, or separate the bodies that share the edge; or set `method` to \
                 \"cage\", which takes any surface"
            }
            Self::NonOrientable { .. } | Self::NoVolume { .. } => {
                "only a surface around a volume can be filled; set `method` to \"cage\", which also takes sheets"
            }
            Self::SelfIntersection { .. } | Self::SelfOverlap { .. } => {
                "separate them, or merge them into one surface first; or set `method` to \"cage\", which takes surfaces \
                 that cross"
            }
            Self::TooManyPoints { .. } => "make `spacing` larger",
        }
    }
}
