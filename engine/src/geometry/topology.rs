//! Topology: how points are connected to curves, faces and tets. Shared between frames; never edited in place.

use std::sync::Arc;

use super::GeometryError;

/// Rows grouped into consecutive runs: the CVs of each curve, the corners of each face.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Runs {
    starts: Vec<u32>,
}

impl Runs {
    /// Runs of the given lengths.
    ///
    /// # Errors
    /// If the lengths add up to more than `u32::MAX` rows.
    pub fn from_counts(counts: impl IntoIterator<Item = u32>) -> Result<Self, GeometryError> {
        let mut starts = vec![0_u32];
        let mut end = 0_u32;
        for count in counts {
            end = end.checked_add(count).ok_or(GeometryError::TooMany)?;
            starts.push(end);
        }
        Ok(Self { starts })
    }

    /// Number of runs.
    pub fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// Whether there is no run.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Rows in all runs together.
    pub fn total(&self) -> usize {
        self.starts[self.len()] as usize
    }

    /// First row of each run, and the total at the end: `len() + 1` numbers.
    pub fn starts(&self) -> &[u32] {
        &self.starts
    }

    /// The rows of run `i`.
    pub fn range(&self, i: usize) -> std::ops::Range<usize> {
        self.starts[i] as usize..self.starts[i + 1] as usize
    }

    /// The rows of each run.
    pub fn ranges(&self) -> impl ExactSizeIterator<Item = std::ops::Range<usize>> + '_ {
        (0..self.len()).map(|i| self.range(i))
    }

    /// Length of each run.
    pub fn counts(&self) -> impl ExactSizeIterator<Item = u32> + '_ {
        self.starts.windows(2).map(|pair| pair[1] - pair[0])
    }

    /// These runs, then those of `other`.
    ///
    /// # Errors
    /// If the lengths add up to more than `u32::MAX` rows.
    pub fn concat(&self, other: &Self) -> Result<Self, GeometryError> {
        Self::from_counts(self.counts().chain(other.counts()))
    }
}

/// Polygons: the corners of each face as rows of the point table, counter-clockwise seen from outside.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Faces {
    /// The corners of each face.
    pub runs: Runs,
    /// The point of each corner.
    pub corners: Vec<u32>,
}

impl Faces {
    /// Points of face `i`, in order.
    pub fn face(&self, i: usize) -> &[u32] {
        &self.corners[self.runs.range(i)]
    }

    /// Points of each face, in order.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &[u32]> + '_ {
        (0..self.runs.len()).map(|i| self.face(i))
    }

    /// Whether these are the faces of `other` inside out: the same corners with the opposite winding, from the same
    /// first ones, as Transform makes them where it mirrors.
    pub fn is_inside_out(&self, other: &Self) -> bool {
        let reversed = |(own, other): (&[u32], &[u32])| match (own, other) {
            ([first, own @ ..], [same, other @ ..]) => first == same && own.iter().eq(other.iter().rev()),
            _ => own == other,
        };
        !self.runs.is_empty() && self.runs == other.runs && self.iter().zip(other.iter()).all(reversed)
    }
}

/// How a component's points are connected.
#[derive(Clone, Debug, PartialEq)]
pub enum Topology {
    /// Polylines: the CVs of each curve, one after the other, root first.
    Curves(Arc<Runs>),
    /// Polygons.
    Mesh(Arc<Faces>),
    /// No connections.
    Points,
    /// Four points per tet, positively oriented: (b−a)×(c−a)·(d−a) > 0.
    Tets(Arc<Vec<[u32; 4]>>),
}

impl Topology {
    /// Number of curves, faces or tets; 0 for points.
    pub fn elements(&self) -> usize {
        match self {
            Self::Curves(runs) => runs.len(),
            Self::Mesh(faces) => faces.runs.len(),
            Self::Points => 0,
            Self::Tets(tets) => tets.len(),
        }
    }

    /// Whether both are the same arrays in memory.
    pub fn same(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Curves(a), Self::Curves(b)) => Arc::ptr_eq(a, b),
            (Self::Mesh(a), Self::Mesh(b)) => Arc::ptr_eq(a, b),
            (Self::Tets(a), Self::Tets(b)) => Arc::ptr_eq(a, b),
            (Self::Points, Self::Points) => true,
            _ => false,
        }
    }

    /// Bytes of the arrays.
    pub fn bytes(&self) -> usize {
        match self {
            Self::Curves(runs) => runs.starts.len() * 4,
            Self::Mesh(faces) => (faces.runs.starts.len() + faces.corners.len()) * 4,
            Self::Points => 0,
            Self::Tets(tets) => tets.len() * 16,
        }
    }

    /// The arrays' address: equal addresses mean shared arrays.
    pub fn address(&self) -> usize {
        match self {
            Self::Curves(runs) => Arc::as_ptr(runs) as usize,
            Self::Mesh(faces) => Arc::as_ptr(faces) as usize,
            Self::Points => 0,
            Self::Tets(tets) => Arc::as_ptr(tets) as usize,
        }
    }
}
