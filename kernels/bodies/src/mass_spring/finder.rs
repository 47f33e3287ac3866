//! Contact detection as the solver asks for it.

use super::contact::Contact;

/// A motion for which potential contacts are wanted: contact points move linearly from `from` to `to`. Contact points are
/// the particles, by the caller's indices, and after them the points that ride along ([`super::Mesh::riding`]).
#[derive(Clone, Copy, Debug)]
pub struct ContactQuery<'a> {
    /// Positions at the first of `times`, metres.
    pub from: &'a [[f64; 3]],
    /// Expected positions at the second; contact planes hold for that time.
    pub to: &'a [[f64; 3]],
    /// Start and end, as fractions of the frame.
    pub times: [f64; 2],
}

/// Contact detection as the solver needs it.
pub trait ContactFinder: Sync {
    /// Adds all potential contacts to `out`, in a fixed order: pairs that touch, and pairs that come closer than
    /// twice the gap during the motion.
    fn find(&self, query: &ContactQuery<'_>, out: &mut Vec<Contact>);

    /// The number of equal steps that a motion needs at least, since obstacles near it turn: a contact is a plane.
    fn least_steps(&self, _query: &ContactQuery<'_>) -> u32 {
        1
    }
}
