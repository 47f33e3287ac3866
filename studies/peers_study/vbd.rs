//! Vertex block descent (Chen et al. 2024): minimises the objective of implicit Euler one particle at a time, with a
//! 3×3 block each, colour by colour.
//!
//! Springs are made positive semi-definite as in our solver, regions are linearised by their gradient only, friction
//! as resistance at the current slip. Particles of one colour may share a region; on a single thread that does not
//! matter, and each sees the region's current volume. The initial guess is the adaptive one of the paper; Chebyshev
//! acceleration is disabled for particles in contact.

use crate::model::{Model, Region, Spring};
use crate::scene::{FRAME, GRAVITY};
use numerics::vector::{DMat3, DVec3};

/// A spring as seen from one end.
#[derive(Clone, Copy)]
struct Link {
    other: u32,
    k: f64,
    c: f64,
    rest: f64,
}

/// The faces of a region around a particle: their other two corners.
struct Fan {
    region: u32,
    sides: std::ops::Range<usize>,
}

/// Incident elements of each particle, and where they start.
struct IncidentElements {
    link_starts: Vec<usize>,
    links: Vec<Link>,
    fan_starts: Vec<usize>,
    fans: Vec<Fan>,
    sides: Vec<[u32; 2]>,
    is_skin: Vec<bool>,
    /// Particles by colour.
    order: Vec<u32>,
}

/// A simulated body with all buffers.
pub(crate) struct Vbd {
    model: Model,
    around: IncidentElements,
    substeps: u32,
    iterations: u32,
    /// Chebyshev's ρ; 0: no acceleration.
    radius: f64,
    x: Vec<DVec3>,
    v: Vec<DVec3>,
    before: Vec<DVec3>,
    inertial: Vec<DVec3>,
    /// Acceleration in the last step, m/s².
    trend: Vec<DVec3>,
    /// Positions two sweeps ago and one sweep ago.
    earlier: [Vec<DVec3>; 2],
    touched: Vec<bool>,
    /// Gradients of the regions around the current particle, m².
    gradients: Vec<DVec3>,
    /// Current volumes of regions, and those at the start of the step, m³.
    volumes: Vec<f64>,
    volumes_before: Vec<f64>,
}

impl Vbd {
    pub(crate) fn new(model: Model, points: &[DVec3], substeps: u32, iterations: u32, radius: f64) -> Self {
        let still = || vec![DVec3::zeros(); points.len()];
        let around = IncidentElements::new(&model);
        let most = around.fan_starts.windows(2).map(|ends| ends[1] - ends[0]).max().unwrap_or(0);
        Self {
            around,
            gradients: vec![DVec3::zeros(); most],
            substeps,
            iterations,
            radius,
            x: points.to_vec(),
            v: still(),
            before: points.to_vec(),
            inertial: still(),
            trend: still(),
            earlier: [still(), still()],
            touched: vec![false; points.len()],
            volumes: vec![0.0; model.regions.len()],
            volumes_before: vec![0.0; model.regions.len()],
            model,
        }
    }

    pub(crate) fn positions(&self) -> &[DVec3] {
        &self.x
    }

    /// Steps through a frame; returns the number of evaluations of all springs.
    pub(crate) fn frame(&mut self, frame: u32) -> f64 {
        let h = FRAME / f64::from(self.substeps);
        for step in 0..self.substeps {
            let end = FRAME * (f64::from(frame) + f64::from(step + 1) / f64::from(self.substeps));
            self.begin(h);
            let mut omega = 1.0;
            for sweep in 0..self.iterations {
                for at in 0..self.around.order.len() {
                    self.descend(self.around.order[at] as usize, h, end);
                }
                if self.radius > 0.0 {
                    omega = match sweep {
                        0 => 1.0,
                        1 => 2.0 / (2.0 - self.radius * self.radius),
                        _ => 4.0 / (4.0 - self.radius * self.radius * omega),
                    };
                    self.accelerate(sweep, omega);
                }
            }
            for particle in 0..self.x.len() {
                let v = (self.x[particle] - self.before[particle]) / h;
                self.trend[particle] = (v - self.v[particle]) / h;
                self.v[particle] = v;
            }
        }
        f64::from(self.substeps * self.iterations)
    }

    /// Inertial positions, and the initial guess: gravity counts as far as it acted in the last step.
    fn begin(&mut self, h: f64) {
        self.before.copy_from_slice(&self.x);
        measure(&self.model.regions, &self.x, &mut self.volumes_before);
        for particle in 0..self.x.len() {
            if self.model.inverse[particle] > 0.0 {
                let share = self.trend[particle].dot(&GRAVITY) / GRAVITY.norm_squared();
                let on = self.x[particle] + self.v[particle] * h;
                self.inertial[particle] = on + GRAVITY * (h * h);
                self.x[particle] = on + GRAVITY * (h * h * share.clamp(0.0, 1.0));
            }
        }
        measure(&self.model.regions, &self.x, &mut self.volumes);
    }

    /// Minimises over one particle.
    #[inline(always)]
    fn descend(&mut self, particle: usize, h: f64, time: f64) {
        if self.model.inverse[particle] == 0.0 {
            return;
        }
        let (mine, around) = (self.x[particle], &self.around);
        let moved = mine - self.before[particle];
        let inertia = self.model.mass[particle] / (h * h);
        let mut force = (self.inertial[particle] - mine) * inertia;
        let mut block = DMat3::from_diagonal_element(inertia);
        for link in &around.links[around.link_starts[particle]..around.link_starts[particle + 1]] {
            let other = link.other as usize;
            let offset = mine - self.x[other];
            let length = offset.norm();
            if length < 1e-12 {
                continue;
            }
            let normal = offset / length;
            let rate = normal.dot(&(moved - self.x[other] + self.before[other])) / h;
            force -= normal * (link.k * (length - link.rest) + link.c * rate);
            let alpha = link.k * (1.0 - link.rest / length).max(0.0);
            add_square(&mut block, normal, link.k + link.c / h - alpha);
            block.m11 += alpha;
            block.m22 += alpha;
            block.m33 += alpha;
        }
        let fans = around.fan_starts[particle]..around.fan_starts[particle + 1];
        for (fan, kept) in around.fans[fans.clone()].iter().zip(&mut self.gradients) {
            let (region, gradient) = (&self.model.regions[fan.region as usize], around.gradient(fan, mine, &self.x));
            *kept = gradient;
            let volume = self.volumes[fan.region as usize];
            let own = region.pressure(volume);
            let rate = (volume - self.volumes_before[fan.region as usize]) / h;
            force -= gradient * (own.force + region.c * rate);
            add_square(&mut block, gradient, own.slope + region.c / h);
        }
        let mut touched = false;
        if around.is_skin[particle] {
            for surface in self.model.tools.around(mine, time).into_iter().flatten() {
                let push = self.model.push(particle, &surface);
                if push.force <= 0.0 {
                    continue;
                }
                touched = true;
                let slip = moved / h - surface.velocity;
                let slip = slip - surface.normal * surface.normal.dot(&slip);
                let grip = Model::friction(push.force) / slip.norm().max(self.model.creep);
                force += surface.normal * push.force - slip * grip;
                add_square(&mut block, surface.normal, push.slope - grip / h);
                block += DMat3::from_diagonal_element(grip / h);
            }
        }
        self.touched[particle] = touched;
        let Some(step) = block.cholesky().map(|root| root.solve(&force)) else { return };
        self.x[particle] = mine + step;
        for (fan, gradient) in around.fans[fans].iter().zip(&self.gradients) {
            // A volume is linear in a single particle, so its gradient does not depend on that particle's position.
            self.volumes[fan.region as usize] += gradient.dot(&step);
        }
    }

    fn accelerate(&mut self, sweep: u32, omega: f64) {
        let [two, one] = &mut self.earlier;
        if sweep >= 2 {
            let free =
                self.model.inverse.iter().zip(&self.touched).map(|(inverse, touched)| *inverse > 0.0 && !touched);
            for ((x, two), _) in self.x.iter_mut().zip(&*two).zip(free).filter(|each| each.1) {
                *x = (*x - two) * omega + two;
            }
            measure(&self.model.regions, &self.x, &mut self.volumes);
        }
        std::mem::swap(two, one);
        one.copy_from_slice(&self.x);
    }
}

impl IncidentElements {
    fn new(model: &Model) -> Self {
        let count = model.mass.len();
        let mut links: Vec<Vec<Link>> = vec![Vec::new(); count];
        for Spring { ends: [a, b], k, c, rest } in model.springs.iter().copied() {
            links[a as usize].push(Link { other: b, k, c, rest });
            links[b as usize].push(Link { other: a, k, c, rest });
        }
        let mut corners: Vec<Vec<(u32, [u32; 2])>> = vec![Vec::new(); count];
        for (region, index) in model.regions.iter().zip(0..) {
            for [a, b, c] in region.triangles() {
                for (corner, sides) in [(a, [b, c]), (b, [c, a]), (c, [a, b])] {
                    corners[corner as usize].push((index, sides));
                }
            }
        }
        let (mut fans, mut sides, mut fan_starts) = (Vec::new(), Vec::new(), vec![0]);
        for mine in &corners {
            for fan in mine.chunk_by(|a, b| a.0 == b.0) {
                let first = sides.len();
                sides.extend(fan.iter().map(|corner| corner.1));
                fans.push(Fan { region: fan[0].0, sides: first..sides.len() });
            }
            fan_starts.push(fans.len());
        }
        let mut is_skin = vec![false; count];
        model.skin.iter().for_each(|particle| is_skin[*particle as usize] = true);
        let order = colours(&links);
        let (mut link_starts, mut flat) = (vec![0], Vec::new());
        for mine in links {
            flat.extend(mine);
            link_starts.push(flat.len());
        }
        Self { link_starts, links: flat, fan_starts, fans, sides, is_skin, order }
    }

    /// Gradient of a region's volume with respect to a particle at `mine`, m².
    #[inline(always)]
    fn gradient(&self, fan: &Fan, mine: DVec3, x: &[DVec3]) -> DVec3 {
        let side = |[b, c]: &[u32; 2]| (x[*b as usize] - mine).cross(&(x[*c as usize] - mine));
        self.sides[fan.sides.clone()].iter().map(side).sum::<DVec3>() * (1.0 / 6.0)
    }
}

/// Particles by colour, so that no neighbours have the same: greedy colouring in order.
fn colours(links: &[Vec<Link>]) -> Vec<u32> {
    let mut colour: Vec<u32> = vec![u32::MAX; links.len()];
    for particle in 0..links.len() {
        let taken = |wanted: u32| links[particle].iter().any(|link| colour[link.other as usize] == wanted);
        colour[particle] = (0..).find(|wanted| !taken(*wanted)).unwrap_or(0);
    }
    let mut order: Vec<u32> = (0..links.len() as u32).collect();
    order.sort_by_key(|particle| (colour[*particle as usize], *particle));
    order
}

fn measure(regions: &[Region], x: &[DVec3], volumes: &mut [f64]) {
    regions.iter().zip(volumes).for_each(|(region, volume)| *volume = region.volume(x));
}

#[inline(always)]
fn add_square(block: &mut DMat3, offset: DVec3, weight: f64) {
    let scaled = offset * weight;
    block.m11 += scaled.x * offset.x;
    block.m21 += scaled.y * offset.x;
    block.m31 += scaled.z * offset.x;
    block.m22 += scaled.y * offset.y;
    block.m32 += scaled.z * offset.y;
    block.m33 += scaled.z * offset.z;
    block.m12 = block.m21;
    block.m13 = block.m31;
    block.m23 = block.m32;
}
