//! What is closer than it should keep, but not inside: at the start, and when the distance to keep grows.
//!
//! Contacts resist as springs that hold the whole missing distance would throw bodies apart. They therefore yield by that
//! distance at first, and by less and less of it until it is there, at the same speed for all points of a pair. At an open
//! obstacle, which is entered from either side, contacts keep a smaller distance instead, so that nothing goes through.

use super::{CollisionScene, Overlap, OverlapPartner, Separation};
use crate::mass_spring::{Contact, ContactQuery};
use numerics::vector::DVec3;
use serde::{Deserialize, Serialize};

/// Missing distance, in gaps, below which bodies count as touching.
const TOUCHING: f64 = 1e-3;
/// Largest missing distance, in gaps: what is deeper is inside.
const MOST: f64 = 2.0;
/// Smallest distance that contacts with open obstacles keep, in gaps: what they push off something that lies on the surface
/// then is as little as what moves it off.
const LEAST: f64 = 0.005;

/// A body and what it is too close to.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Closeness {
    /// Index of the body's skin; with another skin the lower one.
    pub skin: usize,
    /// What it is close to.
    pub partner: OverlapPartner,
    /// The distance to keep − the smallest distance, metres.
    pub missing: f64,
}

/// By how much contacts yield at the end of a query, metres, and how fast that falls, m/s.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Yielding {
    by: f64,
    speed: f64,
}

impl Yielding {
    /// By distances at the start and the end of a query of `seconds`.
    pub(super) fn falling([start, end]: [f64; 2], seconds: f64) -> Self {
        Self { by: end, speed: if seconds > 0.0 { (start - end) / seconds } else { 0.0 } }
    }

    /// A contact that lets surfaces be closer by that, unless there is no room for it. Open obstacles must not be passed: there
    /// the distance to keep is smaller.
    pub(super) fn of(self, contact: Contact) -> Contact {
        if contact.jammed || (self.by == 0.0 && self.speed == 0.0) {
            return contact;
        }
        let velocity = (DVec3::from(contact.velocity) + DVec3::from(contact.normal) * self.speed).into();
        if contact.open {
            return Contact { gap: (contact.gap - self.by).max(LEAST * contact.gap), velocity, ..contact };
        }
        Contact { offset: contact.offset - self.by, velocity, ..contact }
    }
}

impl Separation<'_> {
    /// By how much contacts of a pair with this distance `missing` at the start yield.
    fn yielding(&self, missing: f64, times: [f64; 2]) -> Yielding {
        let left = |time: f64| {
            let over = (f64::from(self.over) + time) / f64::from(self.frames);
            let [start, end] = self.grown;
            missing * (1.0 - over).max(0.0) + start + (end - start) * time
        };
        Yielding::falling(times.map(left), self.seconds * (times[1] - times[0]))
    }
}

impl CollisionScene<'_> {
    /// By how much contacts of a skin with a partner yield; `None`: with itself.
    pub(super) fn yielding(&self, skin: usize, partner: Option<OverlapPartner>, times: [f64; 2]) -> Yielding {
        let Some(separation) = self.separation else { return Yielding::default() };
        let known = partner
            .and_then(|partner| separation.close.iter().find(|close| close.skin == skin && close.partner == partner));
        separation.yielding(known.map_or(0.0, |close| close.missing), times)
    }

    /// The largest distance by which contacts yield at the end of the frame, metres.
    pub fn yields(&self) -> f64 {
        let Some(separation) = self.separation else { return 0.0 };
        let missing = separation.close.iter().map(|close| close.missing).fold(0.0, f64::max);
        separation.yielding(missing, [1.0; 2]).by
    }

    /// The pairs that are too close at the start of the frame, with contact points at `x`, apart from those of `overlaps`.
    pub fn too_close(&self, x: &[[f64; 3]], overlaps: &[Overlap]) -> Vec<Closeness> {
        let bare = CollisionScene { skins: self.skins, ..CollisionScene::default() };
        // Obstacles as if there were no ground, which they do not push below.
        let (obstacles, body_contact) = (self.obstacles, self.body_contact);
        let mut found = Vec::new();
        for scene in [Self { ground: self.ground, ..bare }, Self { obstacles, body_contact, ..bare }] {
            scene.each_pair(&ContactQuery { from: x, to: x, times: [0.0; 2] }, &mut |skin, partner, contacts| {
                let overlapping =
                    |partner| overlaps.iter().any(|overlap| (overlap.skin, overlap.partner) == (skin, partner));
                let Some(partner) = partner.filter(|partner| !overlapping(*partner)) else { return };
                let missing = contacts.iter().map(|contact| (contact.depth(x), contact.gap));
                let missing = missing.filter(|(missing, gap)| missing.is_finite() && *missing > TOUCHING * gap);
                let most = missing.map(|(missing, gap)| missing.min(MOST * gap)).reduce(f64::max);
                found.extend(most.map(|missing| Closeness { skin, partner, missing }));
            });
        }
        found
    }
}
