//! Why a surface cannot be filled: what, where, and what to do about it. Points and faces are those that came in.

/// What is wrong with a surface. Where one thing is wrong in several places, it names the first.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SurfaceFault {
    /// A coordinate is no number, or infinite.
    #[error("point {point} is not finite")]
    NotFinite {
        /// Which.
        point: u32,
    },
    /// Points at one place, in a surface that is to stay as it is.
    #[error("points {} and {} are at one place{}", points[0], points[1], of(*count, "such point"))]
    DuplicatePoint {
        /// The first two.
        points: [u32; 2],
        /// Points that are where an earlier one is.
        count: usize,
    },
    /// A face that has a point twice, in a surface that is to stay as it is.
    #[error("face {face} has a corner twice{}", of(*count, "such face"))]
    Degenerate {
        /// The first.
        face: u32,
        /// How many.
        count: usize,
    },
    /// Two faces on the same points, in a surface that is to stay as it is.
    #[error("faces {} and {} have the same points{}", faces[0], faces[1], of(*count, "such pair"))]
    DuplicateFace {
        /// The first two.
        faces: [u32; 2],
        /// Faces that are on an earlier one.
        count: usize,
    },
    /// A point without a face, in a surface that is to stay as it is.
    #[error("point {point} has no face{}", of(*count, "such point"))]
    UnusedPoint {
        /// The first.
        point: u32,
        /// How many.
        count: usize,
    },
    /// A hole.
    #[error(
        "the surface is open: the edge of face {face} between points {} and {} has no other face{}", points[0],
        points[1], of(*count, "such edge")
    )]
    OpenEdge {
        /// The first edge's ends.
        points: [u32; 2],
        /// Its face.
        face: u32,
        /// Edges with one face.
        count: usize,
    },
    /// An edge with more than two faces.
    #[error(
        "the edge between points {} and {} has {faces} faces, expected 2{}", points[0], points[1],
        of(*count, "such edge")
    )]
    NonManifoldEdge {
        /// The first edge's ends.
        points: [u32; 2],
        /// Its faces.
        faces: usize,
        /// Edges with more than two faces.
        count: usize,
    },
    /// Neighbours that look opposite ways, in a surface that is to stay as it is.
    #[error("faces {} and {} look opposite ways{}", faces[0], faces[1], of(*count, "such pair"))]
    InconsistentOrientation {
        /// The first two.
        faces: [u32; 2],
        /// Edges between such faces.
        count: usize,
    },
    /// A surface like Klein's bottle.
    #[error("the shell with face {face} has one side only, so it has no inside")]
    NonOrientable {
        /// A face of it.
        face: u32,
    },
    /// A shell without an inside.
    #[error("the shell with face {face} encloses no volume")]
    NoVolume {
        /// Its first face.
        face: u32,
    },
    /// A shell that looks the wrong way, in a surface that is to stay as it is.
    #[error(
        "the shell with face {face} looks {}{}", if *cavity { "away from the cavity in it" } else { "inwards" },
        of(*count, "such shell")
    )]
    InsideOut {
        /// Its first face.
        face: u32,
        /// Whether it is the wall of a cavity.
        cavity: bool,
        /// How many.
        count: usize,
    },
    /// Faces that pass through each other.
    #[error("faces {} and {} cross near {at:?}{}", faces[0], faces[1], of(*count, "such pair"))]
    SelfIntersection {
        /// The first two.
        faces: [u32; 2],
        /// A point of one of them near the crossing, metres.
        at: [f32; 3],
        /// Pairs of triangles that cross.
        count: usize,
    },
    /// A part of space that the surface is around more than once, where its faces cross in edges alone.
    #[error("the surface overlaps itself near {at:?}")]
    SelfOverlap {
        /// A point of that part, metres.
        at: [f32; 3],
    },
    /// More interior points than memory is for.
    #[error("a spacing of {spacing} m would make about {points:.2e} points, expected at most {most:.2e}")]
    TooManyPoints {
        /// Metres.
        spacing: f64,
        /// How many it would make.
        points: f64,
        /// How many may be.
        most: f64,
    },
}

/// How many in all, where there is more than one.
fn of(count: usize, what: &str) -> String {
    if count > 1 { format!(" ({count} {what}s in all)") } else { String::new() }
}

impl SurfaceFault {
    /// What to do about it.
    pub fn hint(&self) -> &'static str {
        match self {
            Self::NotFinite { .. } => "look at what made it",
            Self::DuplicatePoint { .. }
            | Self::Degenerate { .. }
            | Self::DuplicateFace { .. }
            | Self::UnusedPoint { .. } => "`repair` \"safe\" takes them out",
            Self::InconsistentOrientation { .. } | Self::InsideOut { .. } => "`repair` \"safe\" turns them",
            Self::OpenEdge { .. } => {
                "only closed surfaces can be filled: close the hole, or give a thin wall a thickness"
            }
            Self::NonManifoldEdge { .. } => {
                "take the faces inside the body out, or part the bodies that share the edge"
            }
            Self::NonOrientable { .. } | Self::NoVolume { .. } => "only a surface around a volume can be filled",
            Self::SelfIntersection { .. } | Self::SelfOverlap { .. } => "part them, or make them one surface first",
            Self::TooManyPoints { .. } => "make `spacing` larger",
        }
    }
}
