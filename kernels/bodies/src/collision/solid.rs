//! Surfaces of skins and obstacles at one time, and which of them may overlap.

use super::obstacle::narrow;
use super::surface::TriangleSurface;
use super::{CollisionScene, OverlapPartner};
use numerics::swept;
use numerics::tree::{Cuboid, TriangleTree};
use std::borrow::Cow;

/// A skin or an obstacle at one time.
#[derive(Clone)]
pub(super) struct Solid<'a> {
    pub(super) is: OverlapPartner,
    pub(super) surface: &'a TriangleSurface,
    pub(super) points: Cow<'a, [[f64; 3]]>,
    /// Boxes of the points.
    pub(super) boxes: Cow<'a, [Cuboid]>,
    /// Those of its points that may be inside others, and their bounds.
    pub(super) candidates: &'a [u32],
    pub(super) bounds: Cuboid,
    /// Distance to keep from it, metres.
    pub(super) gap: f64,
}

impl Solid<'_> {
    /// The distance of each of `points` from its surface, metres; `None` where there is none.
    pub(super) fn distances(&self, points: &[[f64; 3]]) -> Vec<Option<f64>> {
        if points.is_empty() {
            return Vec::new();
        }
        let tree = TriangleTree::build(&narrow(&self.points), &self.surface.triangles);
        let closest = tree.closest_each(&narrow(points), f32::INFINITY);
        closest.into_iter().map(|closest| Some(f64::from(closest?.distance))).collect()
    }
}

/// Skins, and obstacles.
pub(super) type Solids<'a> = [Vec<Solid<'a>>; 2];

impl CollisionScene<'_> {
    /// Skins with contact points at `x`, which have these `boxes`, and obstacles at `time`, a fraction of the frame.
    pub(super) fn solids<'a>(&'a self, x: &'a [[f64; 3]], boxes: &'a [Cuboid], time: f64) -> Solids<'a> {
        let skins = self.skins.iter().enumerate().map(|(index, skin)| Solid {
            is: OverlapPartner::Skin(index),
            surface: &skin.surface,
            points: x.into(),
            boxes: boxes.into(),
            candidates: &skin.touching,
            bounds: swept::bounds_of_finite(&skin.touching, boxes),
            gap: self.body_contact.map_or(0.0, |contact| contact.thickness),
        });
        let obstacles = self.obstacles.iter().enumerate().map(|(index, obstacle)| {
            let points = obstacle.at(time);
            let boxes = swept::swept_boxes(&[&points]);
            Solid {
                is: OverlapPartner::Obstacle(index),
                surface: &obstacle.surface,
                points: points.into(),
                candidates: &obstacle.surface.vertices,
                bounds: swept::bounds_of_finite(&obstacle.surface.vertices, &boxes),
                boxes: boxes.into(),
                gap: obstacle.thickness,
            }
        });
        [skins.collect(), obstacles.collect()]
    }

    /// What a skin may overlap: obstacles, and where bodies are in contact the skins after it, if they are near.
    pub(super) fn partners<'a>(&self, solids: &'a Solids<'a>, skin: usize) -> impl Iterator<Item = &'a Solid<'a>> {
        let [skins, obstacles] = solids;
        let later = if self.body_contact.is_some() { &skins[skin + 1..] } else { &[] };
        obstacles.iter().chain(later).filter(move |other| swept::overlap(&skins[skin].bounds, &other.bounds))
    }
}
