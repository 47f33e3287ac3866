//! Guides as segments: as many for each as a hair has.

use crate::attach::vectors::{Vec3, add, length, scale, sub, wide};
use rayon::prelude::*;

/// Guides cut into as many segments as a hair has. A guide with as many CVs keeps its own; another is cut evenly along
/// its length.
#[derive(Clone, Debug, PartialEq)]
pub struct Shapes {
    segments: usize,
    pieces: Vec<Piece>,
    places: Vec<Place>,
}

/// A segment of a guide.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Piece {
    /// From end to end.
    pub(super) chord: Vec3,
    /// Along the guide.
    pub(super) length: f64,
}

/// Where on a guide's CVs a hair's CV is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    /// The CV before, as a row of the guides' points.
    pub(super) before: u32,
    /// The CV after, and the share of the way to it.
    pub(super) after: u32,
    pub(super) share: f32,
}

impl Shapes {
    /// Cuts guides `points[starts[i]..starts[i + 1]]` to `cvs` (1 or more) CVs.
    ///
    /// # Panics
    /// Where `starts` does not run from 0 to the number of points.
    pub fn new(starts: &[u32], points: &[[f32; 3]], cvs: usize) -> Self {
        let segments = cvs.saturating_sub(1);
        let guides = starts.len().saturating_sub(1);
        let mut places = vec![Place { before: 0, after: 0, share: 0.0 }; guides * cvs];
        let mut pieces = vec![Piece { chord: [0.0; 3], length: 0.0 }; guides * segments];
        places.par_chunks_mut(cvs).enumerate().for_each(|(guide, places)| {
            cut(starts[guide], &points[starts[guide] as usize..starts[guide + 1] as usize], places);
        });
        if segments > 0 {
            let both = pieces.par_chunks_mut(segments).zip(places.par_chunks(cvs));
            both.for_each(|(pieces, places)| measure(points, places, pieces));
        }
        Self { segments, pieces, places }
    }

    /// Segments of a hair.
    pub fn segments(&self) -> usize {
        self.segments
    }

    pub(super) fn pieces(&self, guide: usize) -> &[Piece] {
        &self.pieces[guide * self.segments..(guide + 1) * self.segments]
    }

    pub(super) fn places(&self, guide: usize) -> &[Place] {
        &self.places[guide * (self.segments + 1)..(guide + 1) * (self.segments + 1)]
    }

    /// Turns each guide's segments.
    pub(super) fn turned(mut self, turn: impl Fn(usize, Vec3) -> Vec3 + Sync) -> Self {
        if self.segments > 0 {
            self.pieces.par_chunks_mut(self.segments).enumerate().for_each(|(guide, pieces)| {
                pieces.iter_mut().for_each(|piece| piece.chord = turn(guide, piece.chord));
            });
        }
        self
    }
}

/// Where the CVs of a hair are on a guide whose first CV is row `start`.
fn cut(start: u32, points: &[[f32; 3]], places: &mut [Place]) {
    let last = points.len() - 1;
    if points.len() == places.len() {
        for (k, place) in places.iter_mut().enumerate() {
            *place = Place { before: start + k as u32, after: start + k as u32, share: 0.0 };
        }
        return;
    }
    let segment = |k: usize| length(sub(wide(points[k + 1]), wide(points[k])));
    let whole: f64 = (0..last).map(segment).sum();
    let steps = (places.len() - 1).max(1) as f64;
    let (mut k, mut passed) = (0, 0.0);
    let mut here = if last > 0 { segment(0) } else { 0.0 };
    for (step, place) in places.iter_mut().enumerate() {
        let target = whole * (step as f64 / steps);
        while k + 1 < last && passed + here < target {
            passed += here;
            k += 1;
            here = segment(k);
        }
        let share = if here > 0.0 { ((target - passed) / here).clamp(0.0, 1.0) } else { 0.0 };
        let after = (k + 1).min(last) as u32;
        *place = Place { before: start + k as u32, after: start + after, share: share as f32 };
    }
    // The tip is the tip, whatever the sum has lost.
    if let [_, .., tip] = places {
        *tip = Place { before: start + last as u32, after: start + last as u32, share: 0.0 };
    }
}

/// The segments between `places`; where a guide is cut, its length along it is shared out evenly.
fn measure(points: &[[f32; 3]], places: &[Place], pieces: &mut [Piece]) {
    let at = |place: &Place| {
        let (before, after) = (wide(points[place.before as usize]), wide(points[place.after as usize]));
        add(before, scale(sub(after, before), f64::from(place.share)))
    };
    for (piece, ends) in pieces.iter_mut().zip(places.windows(2)) {
        piece.chord = sub(at(&ends[1]), at(&ends[0]));
        piece.length = along(points, &ends[0], &ends[1], &at);
    }
}

/// Length along a guide from one place to another.
fn along(points: &[[f32; 3]], from: &Place, to: &Place, at: &impl Fn(&Place) -> Vec3) -> f64 {
    let between = from.before + 1..=to.before;
    let mut here = at(from);
    let mut sum = 0.0;
    for cv in between {
        let next = wide(points[cv as usize]);
        sum += length(sub(next, here));
        here = next;
    }
    sum + length(sub(at(to), here))
}
