//! Continuous collision detection for soft bodies against animated meshes, the ground, other bodies and themselves.
//! [`CollisionScene`] is a [`ContactFinder`].
//!
//! All tests are continuous in time, with both sides in motion: a vertex that crosses a triangle, or an edge that
//! crosses an edge, is kept on the side it came from, however thin the sheet. Candidates come from bounding boxes of
//! the whole motion, sixteen at a time in f32 and rounded outwards; decisions are made in f64 from the roots of the
//! coplanarity cubic (Bridson et al. 2002).
//!
//! Guarantees: no crossing of a vertex or an edge is missed while points move linearly between poses, and a rotating
//! obstacle is sampled so densely that it deviates by at most a quarter of its thickness; only locally closest
//! features count, so flat areas give one contact a vertex whatever their triangulation; the same bits for any number
//! of threads. Limits: a contact is a plane; sides are known only from the start of a step, so whatever is beyond an
//! open sheet then is taken to belong there; edges that come close during the motion, but neither at its ends nor by
//! crossing, are not reported; positions beyond the range of f32 are not found.

mod body_skin;
mod caught;
mod closeness;
mod edge;
mod motion;
mod obstacle;
mod overlap;
mod pair;
mod piercing;
mod solid;
mod surface;
mod vertex;

use crate::mass_spring::{Contact, ContactFinder, ContactQuery, Weighted};
pub use body_skin::BodySkin;
use body_skin::{ReleasedElements, has};
pub use caught::CaughtParticle;
pub use closeness::Closeness;
use closeness::Yielding;
pub use motion::ObstaclePose;
use numerics::closest_point::ClosestPoint;
use numerics::parallel;
use numerics::swept::{self, SweptBoxTree};
use numerics::tree::{Cuboid, TriangleTree};
use numerics::vector::{DVec3, to_f32};
pub use obstacle::{Ground, Obstacle};
pub use overlap::{Overlap, OverlapPartner, Penetration, Separation};
pub use pair::ContactParams;
use std::sync::Mutex;
use surface::Positions;
use vertex::{ContactRules, MovingSurface};

/// Vertices or edges in a parallel task: about 20 µs of work.
const TASK: usize = 64;
/// Points in a parallel task.
const POINTS: usize = 1024;
/// Distance, in gaps, within which potential contacts are reported.
const REACH: f64 = 2.0;
/// Largest deviation of a rotating obstacle from linear motion between sampled poses, as a fraction of the gap.
const SAG: f64 = 0.25;
/// Angle by which an obstacle near a body may turn in a step, radians: what it has met is beyond its plane after half a turn.
const FARTHEST_TURN: f64 = std::f64::consts::FRAC_PI_3;

/// Distance along its normal, in gaps, by which an obstacle has to be raised above the ground to leave no room.
const JAMMED: f64 = 0.5;

/// Why contact detection could not be set up.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CollisionError {
    /// An obstacle without a pose.
    #[error("an obstacle has no pose; expected one at least")]
    NoPose,
    /// A pose with another number of points than the first.
    #[error("pose {0} has {1} points; expected {2}, like the first")]
    Points(usize, usize, usize),
    /// Times of poses do not increase.
    #[error("`share` of pose {0} is {1}; expected a finite number above the one before")]
    Share(usize, f64),
    /// A coordinate is NaN or infinite.
    #[error("point {0} is not finite")]
    Point(usize),
    /// A triangle has a corner out of range.
    #[error("triangle {0} has corners {1:?}; expected indices below {2}")]
    Triangle(usize, [u32; 3], usize),
    /// A link has an end out of range.
    #[error("link {0} joins {1:?}; expected indices below {2}")]
    Link(usize, [u32; 2], usize),
    /// A parameter is negative or not finite.
    #[error("`{0}` is {1}; expected a finite number, 0 or more")]
    Number(&'static str, f64),
}

/// What is done with the contacts of a skin and a partner.
type ActOnPair<'a> = dyn FnMut(usize, Option<OverlapPartner>, Vec<Contact>) + 'a;

/// Everything that may be in contact.
#[derive(Clone, Copy, Debug, Default)]
pub struct CollisionScene<'a> {
    /// Skins of the bodies.
    pub skins: &'a [BodySkin],
    /// Factor on the friction of each contact point; 1 without.
    pub friction: Option<&'a [f32]>,
    /// The ground; it takes precedence over obstacles.
    pub ground: Option<Ground>,
    /// Animated meshes.
    pub obstacles: &'a [Obstacle],
    /// Contact between different skins; `None`: ignored.
    pub body_contact: Option<ContactParams>,
    /// Contact of skins with themselves; `None`: ignored.
    pub self_contact: Option<ContactParams>,
    /// What is being pushed apart because it overlapped at the start.
    pub separation: Option<Separation<'a>>,
    /// Particles on the wrong side of obstacles: those of the first obstacle by particle, then those of the next.
    pub caught: &'a [CaughtParticle],
}

impl ContactFinder for CollisionScene<'_> {
    fn find(&self, query: &ContactQuery<'_>, out: &mut Vec<Contact>) {
        self.each_pair(query, &mut |_, _, contacts| out.extend(contacts));
    }

    fn least_steps(&self, query: &ContactQuery<'_>) -> u32 {
        let steps = |obstacle: &Obstacle| (obstacle.motion.turn(query.times) / FARTHEST_TURN).ceil() as u32;
        let is_near = |obstacle: &&Obstacle| {
            let poses = obstacle.motion.times(query.times, SAG * obstacle.thickness);
            let poses: Vec<Vec<[f64; 3]>> = poses.iter().map(|time| obstacle.at(*time)).collect();
            let passed = swept::swept_boxes(&poses.iter().map(Vec::as_slice).collect::<Vec<_>>());
            let passed = swept::bounds_of_finite(&obstacle.surface.vertices, &passed);
            let boxes = swept::swept_boxes(&[query.from, query.to]);
            self.skins.iter().any(|skin| swept::overlap(&swept::bounds_of_finite(&skin.touching, &boxes), &passed))
        };
        let turning = self.obstacles.iter().filter(|obstacle| steps(obstacle) > 1);
        turning.filter(is_near).map(steps).max().unwrap_or(1)
    }
}

impl CollisionScene<'_> {
    /// Calls `act` with the contacts of each skin, by index, with each partner; `None`: with itself.
    ///
    /// The order is: ground contacts by particle; those of what is being pushed apart; those of each obstacle by
    /// particle, then by its own points, then by edges; then pairs of bodies; then self-contacts. An obstacle that a body is
    /// pushed out of keeps out the particles that are not in it, so that it can go on pressing.
    fn each_pair(&self, query: &ContactQuery<'_>, act: &mut ActOnPair<'_>) {
        self.on_ground(query, act);
        let pushed = self.separate(query, act);
        let boxes = swept::swept_boxes(&[query.from, query.to]);
        if !self.obstacles.is_empty() {
            for (index, skin) in self.skins.iter().enumerate() {
                let faces = skin.surface.swept.sweep(&boxes, 0.0);
                let released = skin.released(query.from);
                for obstacle in 0..self.obstacles.len() {
                    let pushed = pushed.get(&(index, obstacle));
                    let usual = || skin.releasing(&released, self.caught_by(obstacle));
                    let released = pushed.cloned().unwrap_or_else(usual);
                    self.against_obstacle(query, index, &boxes, obstacle, &mut |meeting, tree| {
                        let mut contacts = Vec::new();
                        meeting.particles(tree, &released, &mut contacts);
                        if pushed.is_none() {
                            meeting.points(&faces, &released, &mut contacts);
                            meeting.edges(&released, &mut contacts);
                        }
                        act(index, Some(OverlapPartner::Obstacle(obstacle)), contacts);
                    });
                }
            }
        }
        self.pairs(query, &boxes, act);
    }

    fn on_ground(&self, query: &ContactQuery<'_>, act: &mut ActOnPair<'_>) {
        let Some(ground) = self.ground else { return };
        let up = DVec3::from(ground.up);
        for (index, skin) in self.skins.iter().enumerate() {
            let rising = self.separating(index, OverlapPartner::Ground);
            let yielding = self.yielding(index, Some(OverlapPartner::Ground), query.times);
            let contact = |particle: &u32| {
                let height = |x: &[[f64; 3]]| up.dot(&DVec3::from(x[*particle as usize])) - ground.height;
                let before = height(query.from);
                if before.min(height(query.to)) > REACH * ground.thickness {
                    return None;
                }
                let depth = (ground.thickness - before).max(0.0);
                let rising = rising.map_or(Yielding::default(), |overlap| self.allowed(overlap, depth, query.times));
                let contact = Contact::between([(&[*particle], &[1.0]), (&[], &[])], up, ground.thickness);
                let friction = ground.friction * self.friction_scale(&contact);
                let contact = yielding.of(rising.of(Contact { offset: ground.height, friction, ..contact }));
                // Contacts yield as they do with what has an inside.
                Some(Contact { open: true, ..contact })
            };
            act(index, Some(OverlapPartner::Ground), skin.touching.iter().filter_map(contact).collect());
        }
    }

    /// Factor on the friction of a contact.
    fn friction_scale(&self, contact: &Contact) -> f64 {
        let Some(mask) = self.friction else { return 1.0 };
        let of = |point: &u32| mask.get(*point as usize).map_or(1.0, |scale| f64::from(*scale));
        let (mut sum, mut whole) = (0.0, 0.0);
        for (point, weight) in contact.points.iter().zip(contact.weights).filter(|side| side.1 != 0.0) {
            sum += of(point) * weight.abs();
            whole += weight.abs();
        }
        if whole > 0.0 { sum / whole } else { 1.0 }
    }

    /// Calls `act` with a skin and an obstacle, by index, unless they stay apart, and with the swept boxes of the obstacle's
    /// triangles. `boxes` are those of the particles.
    fn against_obstacle(
        &self,
        query: &ContactQuery<'_>,
        skin_index: usize,
        boxes: &[Cuboid],
        index: usize,
        act: &mut dyn FnMut(&SkinObstaclePair<'_>, &SweptBoxTree<'_>),
    ) {
        let (skin, obstacle) = (&self.skins[skin_index], &self.obstacles[index]);
        let rules = ContactRules { gap: obstacle.thickness, reach: REACH * obstacle.thickness, push: true };
        let times = obstacle.motion.times(query.times, SAG * obstacle.thickness);
        let obstacle_poses: Vec<Vec<[f64; 3]>> = times.iter().map(|time| obstacle.at(*time)).collect();
        let obstacle_poses: Vec<Positions<'_>> = obstacle_poses.iter().map(Vec::as_slice).collect();
        let still_boxes = swept::swept_boxes(&obstacle_poses);
        let tree = obstacle.surface.swept.sweep(&still_boxes, rules.reach);
        let caught = self.caught_by(index);
        if caught.is_empty() && !swept::overlap(&swept::bounds_of_finite(&skin.touching, boxes), &tree.bounds) {
            return;
        }
        let between = poses_between(query, &times);
        let mut body_poses: Vec<Positions<'_>> = vec![query.from];
        body_poses.extend(between.iter().map(Vec::as_slice));
        body_poses.push(query.to);
        let meeting = SkinObstaclePair {
            scene: self,
            query,
            skin,
            obstacle,
            caught,
            boxes: [boxes, &still_boxes],
            body: MovingSurface { surface: &skin.surface, poses: &body_poses },
            still: MovingSurface { surface: &obstacle.surface, poses: &obstacle_poses },
            rules,
            yielding: self.yielding(skin_index, Some(OverlapPartner::Obstacle(index)), query.times),
        };
        act(&meeting, &tree);
    }
}

/// Positions of particles between the first and the last of `times`.
fn poses_between(query: &ContactQuery<'_>, times: &[f64]) -> Vec<Vec<[f64; 3]>> {
    let whole = query.times[1] - query.times[0];
    let at = |time: &f64| {
        let share = if whole > 0.0 { (time - query.times[0]) / whole } else { 1.0 };
        let point = |n: usize| DVec3::from(query.from[n]).lerp(&DVec3::from(query.to[n]), share).into();
        parallel::tabulate(query.from.len(), POINTS, point)
    };
    times[1..times.len() - 1].iter().map(at).collect()
}

/// A moving skin and a moving obstacle.
struct SkinObstaclePair<'a> {
    scene: &'a CollisionScene<'a>,
    query: &'a ContactQuery<'a>,
    skin: &'a BodySkin,
    obstacle: &'a Obstacle,
    caught: &'a [CaughtParticle],
    /// Swept boxes of the particles and of the obstacle's points.
    boxes: [&'a [Cuboid]; 2],
    body: MovingSurface<'a>,
    still: MovingSurface<'a>,
    rules: ContactRules,
    yielding: Yielding,
}

/// What an element may meet, and marks on points: buffers, which another task may have used before.
type Buffers = (Vec<u32>, Vec<u32>);

/// Collects the contacts that `find` adds for each of `things` in their order, for any number of threads.
fn collect_in_order(
    things: &[u32],
    out: &mut Vec<Contact>,
    find: impl Fn(u32, &mut Buffers, &mut Vec<Contact>) + Sync,
) {
    let unused: Mutex<Vec<Buffers>> = Mutex::default();
    let lock = || unused.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    let parts = parallel::map(things.chunks(TASK), |_, things| {
        let (mut buffers, mut seen) = (lock().pop().unwrap_or_default(), Vec::new());
        things.iter().for_each(|thing| find(*thing, &mut buffers, &mut seen));
        lock().push(buffers);
        seen
    });
    out.extend(parts.into_iter().flatten());
}

impl SkinObstaclePair<'_> {
    /// Particles of the skin against triangles of the obstacle.
    fn particles(&self, tree: &SweptBoxTree<'_>, released: &ReleasedElements, out: &mut Vec<Contact>) {
        let bounds = tree.bounds;
        // Made before the loop: a thread of the pool that waits for another's tree could wait forever.
        let solid = self.solid_at_start(released, &bounds);
        collect_in_order(&self.skin.touching, out, |particle, (faces, _), out| {
            if has(&released.particles, particle) {
                return;
            }
            let (own, entry) = (&self.boxes[0][particle as usize], self.entry(particle));
            tree.overlapping(own, faces);
            if faces.is_empty() && entry.is_none() && !(solid.is_some() && swept::overlap(own, &bounds)) {
                return;
            }
            let path = self.body.path(particle);
            let closest_at_start = || self.closest_at_start(solid.as_ref()?, &bounds, path[0]);
            for hit in vertex::hits(&path, &self.still, (faces, entry), &closest_at_start, &self.rules) {
                let corners = &self.obstacle.surface.triangles[hit.face as usize];
                let sides = [(&[particle][..], &[1.0][..]), (corners, &hit.weights)];
                out.push(self.contact(sides, hit.normal, hit.shift));
            }
        });
    }

    /// The obstacle's triangles at the start of the motion, where it has an inside and a particle may be in it: within
    /// its `bounds`.
    fn solid_at_start(&self, released: &ReleasedElements, bounds: &Cuboid) -> Option<TriangleTree> {
        let may_be_inside = |particle: &u32| {
            !has(&released.particles, *particle) && swept::overlap(&self.boxes[0][*particle as usize], bounds)
        };
        let needed = self.obstacle.surface.closed && self.skin.touching.iter().any(may_be_inside);
        needed.then(|| self.obstacle.solid.moved(&obstacle::narrow(self.still.poses[0])))
    }

    /// The triangle of `solid` closest to the `start` of a motion, for a particle within the `bounds` of the obstacle.
    fn closest_at_start(&self, solid: &TriangleTree, bounds: &Cuboid, start: DVec3) -> Option<ClosestPoint> {
        let p = to_f32(start);
        if !swept::overlap(&Cuboid { low: p, high: p }, bounds) {
            return None;
        }
        let face = solid.closest(p, f32::INFINITY)?.triangle;
        Some(ClosestPoint::on(face, start, self.obstacle.surface.corners(&self.still.start(), face)))
    }

    /// Sharp points of the obstacle against triangles of the skin.
    fn points(&self, tree: &SweptBoxTree<'_>, released: &ReleasedElements, out: &mut Vec<Contact>) {
        collect_in_order(&self.obstacle.sharp_points, out, |point, (faces, _), out| {
            tree.overlapping(&swept::inflated(&self.boxes[1][point as usize], self.rules.reach), faces);
            faces.retain(|face| !has(&released.faces, *face));
            if faces.is_empty() {
                return;
            }
            let path = self.still.path(point);
            for hit in vertex::hits(&path, &self.body, (faces, None), &|| None, &self.rules) {
                let corners = &self.skin.surface.triangles[hit.face as usize];
                let sides = [(&corners[..], &hit.weights[..]), (&[point], &[1.0])];
                out.push(self.contact(sides, -hit.normal, hit.shift));
            }
        });
    }

    /// Edges of the skin against sharp edges of the obstacle.
    fn edges(&self, released: &ReleasedElements, out: &mut Vec<Contact>) {
        let tree = self.obstacle.edges.sweep(self.boxes[1], self.rules.reach);
        let indices: Vec<u32> = (0..self.skin.surface.edges.len() as u32).collect();
        collect_in_order(&indices, out, |index, (others, _), out| {
            if has(&released.edges, index) {
                return;
            }
            let edge = &self.skin.surface.edges[index as usize];
            tree.overlapping(&swept::bounds_of(&edge.ends, self.boxes[0]), others);
            for other in others {
                let other = &self.obstacle.surface.edges[self.obstacle.sharp_edges[*other as usize] as usize];
                if let Some(hit) = edge::hit([&self.body, &self.still], [edge, other], &self.rules) {
                    let sides = [(&edge.ends[..], &hit.weights[0][..]), (&other.ends, &hit.weights[1])];
                    out.push(self.contact(sides, hit.normal, 0.0));
                }
            }
        });
    }

    /// A contact of points of the body with points of the obstacle, which counts as stopped above the ground.
    fn contact(&self, [own, (points, shares)]: [Weighted<'_>; 2], normal: DVec3, shift: f64) -> Contact {
        let (gap, times) = (self.rules.gap, self.query.times);
        let touched = [self.still.start(), self.still.end()].map(|at| at.weighted(points, shares));
        let [raised, raised_end] = touched.map(|touched| self.scene.raised(touched, normal, gap));
        let seconds = self.obstacle.seconds * (times[1] - times[0]);
        let stopping = if seconds > 0.0 { (raised_end - raised) / seconds } else { DVec3::zeros() };
        let contact = Contact::between([own, (&[], &[])], normal, gap);
        self.yielding.of(Contact {
            offset: normal.dot(&(touched[1] + raised_end)) - shift,
            velocity: (self.obstacle.velocity_of(times[1], points, shares) + stopping).into(),
            friction: self.obstacle.friction * self.scene.friction_scale(&contact),
            jammed: -normal.dot(&raised_end) > JAMMED * gap,
            open: !self.obstacle.surface.closed,
            ..contact
        })
    }
}

impl CollisionScene<'_> {
    /// How far an obstacle has to be raised at `point` so that it does not push along `normal` below the ground.
    fn raised(&self, point: DVec3, normal: DVec3, gap: f64) -> DVec3 {
        let Some(ground) = self.ground else { return DVec3::zeros() };
        let up = DVec3::from(ground.up);
        let pushed = (point + normal * gap).dot(&up) - ground.height;
        if normal.dot(&up) < 0.0 { up * (ground.thickness - pushed).max(0.0) } else { DVec3::zeros() }
    }
}

#[cfg(test)]
mod tests;
