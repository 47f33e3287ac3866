//! Forces, residual and linear system of a stage at some positions.

use super::contact::Mode;
use super::parts::{Parts, Several};
use super::rows::Rows;
use super::springs::{self, Sums};
use super::stage::{Setting, Stage, Work};
use super::system::{halfway, smoother};
use numerics::vector::DVec3;

/// Times as much as they resist one particle that regions count in its own block: what is moved by its own block alone moves
/// with some of the region's others, and a tenth fewer iterations are needed.
const OVERLAP: f64 = 3.0;

impl Work {
    /// Begins a stage of `a` whose springs' lengths and regions' volumes come from those `before`.
    pub(super) fn come_from(
        &mut self,
        on: &Setting<'_>,
        a: f64,
        before: impl Fn(usize, usize) -> f64 + Sync,
        volumes: Vec<f64>,
    ) {
        springs::links(on.body, &on.rest, a, before, &mut self.links);
        self.volumes.begin(a, volumes);
        self.measured = false;
    }

    /// The force on each particle at `x` and `v`.
    pub(super) fn forces(&mut self, on: &Setting<'_>, stage: &Stage<'_>, x: &[DVec3], v: &[DVec3]) -> Vec<DVec3> {
        self.loose_forces(on, stage, x, v);
        let mut out = vec![DVec3::zeros(); x.len()];
        let (body, work) = (on.body, &*self);
        body.order.clusters.each(&mut out[..], |cluster, out: &mut [DVec3]| {
            let places = body.order.clusters.range(cluster);
            for place in places.clone() {
                springs::pull(body.hanging.of(place, &work.links), x, place, places.start, out);
                out[place - places.start] += work.own_force(on, stage.time, place, x, v);
            }
        });
        out
    }

    /// Volumes, thin tetrahedra, contacts at `x` and `v`, and the forces of the last two.
    fn loose_forces(&mut self, on: &Setting<'_>, stage: &Stage<'_>, x: &[DVec3], v: &[DVec3]) {
        let body = on.body;
        if !std::mem::take(&mut self.measured) {
            self.volumes.measure(body, x);
        }
        self.thin = self.volumes.thin(body, x, on.volumes, &self.inventory.watched);
        self.touches.clear();
        self.touches.extend(stage.contacts.iter().map(|contact| contact.at(x, v, stage.early, body.size)));
        self.extra.clear();
        if !self.thin.is_empty() || !self.touches.is_empty() {
            self.extra.resize(x.len(), DVec3::zeros());
            for thin in &self.thin {
                for (corner, gradient) in thin.corners.iter().zip(&thin.gradient) {
                    self.extra[*corner as usize] += gradient * thin.pressure;
                }
            }
            for (contact, touch) in stage.contacts.iter().zip(&self.touches).filter(|pair| pair.1.mode != Mode::Apart) {
                for (place, weight) in contact.sides() {
                    self.extra[place] += touch.force * weight;
                }
            }
        }
    }

    /// All but springs.
    #[inline(always)]
    fn own_force(&self, on: &Setting<'_>, time: f64, place: usize, x: &[DVec3], v: &[DVec3]) -> DVec3 {
        let mut sum = on.drive.force(place, on.body.mass[place], time, x[place], v[place]);
        if !self.system.regions.is_empty() {
            sum -= self.system.regions.gather(place, &self.volumes.pressures, &self.volumes.gradients);
        }
        if let Some(extra) = self.extra.get(place) {
            sum += extra;
        }
        sum
    }

    /// The residual at `x`, and where `linear` the system there.
    pub(super) fn assemble(&mut self, on: &Setting<'_>, stage: &Stage<'_>, x: &[DVec3], linear: bool) {
        let (body, a) = (on.body, stage.a);
        let clusters = &body.order.clusters;
        let mut v = std::mem::take(&mut self.v);
        velocities(clusters, x, stage, &mut v);
        self.loose_forces(on, stage, x, &v);
        let mut r = std::mem::take(&mut self.r);
        if linear {
            self.expect(stage);
            self.set_rows(on, stage);
            let mut system = std::mem::take(&mut self.system);
            let (held, blocks, regions, loose) = (&system.held, &system.blocks, &system.regions, &system.loose);
            let parts = (
                &mut r[..],
                &mut system.inertia[..],
                &mut system.smoother[..],
                Several::new(&body.hanging.starts, &mut system.records),
            );
            // `own_force` reads the regions' entries, which have moved out of `self` with the system.
            let work = &*self;
            clusters.each(parts, |cluster, (r, inertia, smooth, mut records)| {
                let places = clusters.range(cluster);
                let first = places.start;
                r.fill(DVec3::zeros());
                let mut sums = Sums { forces: r, blocks: &mut vec![[0.0; 6]; places.len()] };
                for (((place, inertia), smooth), records) in places.zip(inertia).zip(smooth).zip(records.iter_mut()) {
                    let links = body.hanging.of(place, &work.links);
                    springs::linearise(links, records, x, a, place, first, &mut sums);
                    let (pull, mut block) = (sums.forces[place - first], sums.blocks[place - first]);
                    let mass = body.mass[place];
                    let mut own = on.drive.force(place, mass, stage.time, x[place], v[place]);
                    if !regions.is_empty() {
                        own -= regions.gather(place, &work.volumes.pressures, &work.volumes.gradients);
                        regions.add_block(place, OVERLAP, &mut block);
                    }
                    own += work.extra.get(place).copied().unwrap_or_default();
                    if !loose.is_empty() {
                        loose.add_block(place, 1.0, &mut block);
                    }
                    if let Some(extra) = blocks.get(place) {
                        block.iter_mut().zip(extra).for_each(|(sum, extra)| *sum += extra);
                    }
                    *inertia = mass + on.drive.inertia(place, mass, a);
                    [0, 3, 5].iter().for_each(|diagonal| block[*diagonal] += *inertia);
                    sums.forces[place - first] = if held[place] {
                        DVec3::zeros()
                    } else {
                        (own + pull) * (a * a) - (x[place] - stage.y[place]) * mass
                    };
                    *smooth = if held[place] { [0.0; 6] } else { smoother(&block) };
                }
            });
            self.system = system;
        } else {
            let work = &*self;
            clusters.each(&mut r[..], |cluster, r: &mut [DVec3]| {
                let places = clusters.range(cluster);
                r.fill(DVec3::zeros());
                for place in places.clone() {
                    springs::pull(body.hanging.of(place, &work.links), x, place, places.start, r);
                    let r = &mut r[place - places.start];
                    *r = if work.system.held[place] {
                        DVec3::zeros()
                    } else {
                        let force = *r + work.own_force(on, stage.time, place, x, &v);
                        force * (a * a) - (x[place] - stage.y[place]) * body.mass[place]
                    };
                }
            });
        }
        self.r = r;
        self.v = v;
    }

    /// Makes pushes linear where they are expected.
    fn expect(&mut self, stage: &Stage<'_>) {
        self.unlike.clear();
        for (index, ((contact, touch), push)) in
            stage.contacts.iter().zip(&mut self.touches).zip(&self.pushes).enumerate()
        {
            let before = touch.push;
            contact.expect(touch, *push);
            if touch.push != before {
                self.unlike.push((index, touch.push - before));
            }
        }
    }

    /// Takes what pushes are linear from instead of what they are: the residual that a direction is to answer.
    pub(super) fn foresee(&mut self, stage: &Stage<'_>) {
        for (index, more) in &self.unlike {
            let contact = &stage.contacts[*index];
            for (place, weight) in contact.sides().filter(|side| !self.system.held[side.0]) {
                self.r[place] += contact.normal * (more * weight * stage.a * stage.a);
            }
        }
    }

    /// What volumes, thin tetrahedra and contacts resist.
    fn set_rows(&mut self, on: &Setting<'_>, stage: &Stage<'_>) {
        let (body, a) = (on.body, stage.a);
        let clusters = &body.order.clusters;
        if !self.volumes.is_off() {
            let weights = self.volumes.weights(a);
            self.system.regions.set(&weights, &self.volumes.gradients, clusters);
        }
        self.system.blocks.clear();
        let (mut starts, mut places, mut along) = (vec![0u32], Vec::new(), Vec::new());
        for thin in &self.thin {
            let root = (a * a * thin.stiffness).sqrt();
            places.extend(thin.corners);
            along.extend(thin.gradient.iter().map(|g| g * root));
            starts.push(places.len() as u32);
        }
        let known = stage.contacts.iter().zip(&self.touches).zip(&self.drags);
        for ((contact, touch), drag) in known.filter(|known| known.0.1.mode != Mode::Apart) {
            let resisted = contact.resisted(touch, a, drag);
            if let Some((place, weight)) = contact.alone() {
                if self.system.blocks.is_empty() {
                    self.system.blocks.resize(body.len(), [0.0; 6]);
                }
                contact.add_block(&resisted, weight, &mut self.system.blocks[place]);
                continue;
            }
            let (directions, count) = resisted;
            for direction in &directions[..count] {
                for (place, weight) in contact.sides() {
                    places.push(place as u32);
                    along.push(direction * weight);
                }
                starts.push(places.len() as u32);
            }
        }
        let parts = Parts::even(starts.len() - 1, 512, 1);
        let loose: &mut Rows = &mut self.system.loose;
        loose.set_topology(body.len(), &starts, &places, parts);
        loose.set(&vec![1.0; starts.len() - 1], &along, clusters);
    }

    /// The residual's square in the norm of the particles' own blocks.
    pub(super) fn square(&self, clusters: &Parts) -> f64 {
        clusters.sum((), |cluster, ()| {
            let places = clusters.range(cluster);
            places.map(|place| halfway(&self.system.smoother[place], self.r[place]).norm_squared()).sum()
        })
    }

    /// That of its difference to another.
    pub(super) fn distance(&self, clusters: &Parts, other: &[DVec3]) -> f64 {
        let own = |place: usize| halfway(&self.system.smoother[place], self.r[place] - other[place]).norm_squared();
        clusters.sum((), |cluster, ()| clusters.range(cluster).map(own).sum())
    }
}

/// (x − z)/a.
pub(super) fn velocities(clusters: &Parts, x: &[DVec3], stage: &Stage<'_>, v: &mut Vec<DVec3>) {
    v.resize(x.len(), DVec3::zeros());
    clusters.each(&mut v[..], |cluster, v: &mut [DVec3]| {
        for (place, v) in clusters.range(cluster).zip(v) {
            *v = (x[place] - stage.z[place]) / stage.a;
        }
    });
}
