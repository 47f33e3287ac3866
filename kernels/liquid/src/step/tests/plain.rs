//! A level set carried to first order and made a distance again, and a surface that stays: enough to test what moves them.

use liquid::level_set::{Distance, PhiChange, PhiView};
use liquid::rows::{Cell, CellRows, Finder};
use liquid::stencil::{Run, Stencil};
use liquid::step::{Domain, Moving, Surface};
use liquid::velocity::{Sampler, Site};
use numerics::vector::{Vec3, scale, sub};

/// Distance to which φ is known, cells.
const BAND: f32 = 5.0;

/// φ of the cells inside and near the surface.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PlainLevelSet {
    rows: CellRows,
    phi: Vec<f32>,
    domain: Domain,
}

impl PlainLevelSet {
    /// From a distance at places in cells.
    pub(crate) fn new(domain: Domain, distance: impl Fn(Vec3) -> f32 + Sync) -> Self {
        Self::of(domain, &distance)
    }

    fn of(domain: Domain, distance: &Distance<'_>) -> Self {
        let rows = CellRows::cuboid(domain.low, domain.high);
        let rows = rows.filtered(|cell, _| distance(Site::Centre.of(cell)) < BAND);
        let phi = rows.tabulate(|cell| distance(Site::Centre.of(cell)).clamp(-BAND, BAND));
        Self { rows, phi, domain }
    }
}

impl Surface for PlainLevelSet {
    fn view(&self) -> PhiView<'_> {
        let (low, high) = (self.domain.low, self.domain.high);
        PhiView { rows: &self.rows, phi: &self.phi, outside: BAND, low, high }
    }

    fn advance(&mut self, flow: &Moving<'_>, reach: f32) {
        let near = self.rows.filtered(|_, at| self.phi[at] < 2.0);
        let rows = near.dilated(reach.ceil() as i32 + 2).clipped(self.domain.low, self.domain.high);
        let (low, high) = (self.domain.low.map(|x| x as f32 + 0.5), self.domain.high.map(|x| x as f32 - 0.5001));
        let start = || (flow.reader(), Sampler::new(&self.rows));
        let [phi] = rows.tabulate_with(start, |(flow, sampler), cell, _| {
            let centre = Site::Centre.of(cell);
            let middle = sub(centre, scale(flow(centre), 0.5));
            let from = sub(centre, flow(middle));
            let within = |axis: usize| from[axis].min(high[axis]).max(low[axis]);
            [sampler.value(&self.phi, Site::Centre, [within(0), within(1), within(2)])]
        });
        self.phi = distances(&rows, &phi);
        self.rows = rows;
    }

    fn change(&mut self, low: Cell, high: Cell, change: &PhiChange<'_>) {
        let domain = self.domain;
        let part = CellRows::cuboid(low, high).clipped(domain.low, domain.high);
        let rows = self.rows.union(&part);
        let old = rows.resampled(&self.rows, &self.phi, BAND);
        let [phi] = rows.tabulate_with(
            || Finder::new(&part),
            |part, cell, at| {
                let is_in = part.find(cell).is_some();
                [if is_in { change(Site::Centre.of(cell), old[at]) } else { old[at] }]
            },
        );
        self.phi = distances(&rows, &phi);
        self.rows = rows;
    }

    fn volume(&self, low: Cell, high: Cell, solid: Option<&Distance<'_>>) -> f64 {
        let rows = self.rows.clipped(low, high);
        let phi = rows.resampled(&self.rows, &self.phi, BAND);
        let open = |cell: Cell| solid.map_or(1.0, |solid| (0.5 + solid(Site::Centre.of(cell))).clamp(0.0, 1.0));
        rows.iter().zip(phi).fold(0.0, |sum, (cell, phi)| sum + f64::from((0.5 - phi).clamp(0.0, 1.0) * open(cell)))
    }
}

/// A surface that stays where it is.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Still(PlainLevelSet);

impl Still {
    /// From a distance at places in cells.
    pub(crate) fn new(domain: Domain, distance: impl Fn(Vec3) -> f32 + Sync) -> Self {
        Self(PlainLevelSet::new(domain, distance))
    }
}

impl Surface for Still {
    fn view(&self) -> PhiView<'_> {
        self.0.view()
    }

    fn advance(&mut self, _: &Moving<'_>, _: f32) {}

    fn change(&mut self, low: Cell, high: Cell, change: &PhiChange<'_>) {
        self.0.change(low, high, change);
    }

    fn volume(&self, low: Cell, high: Cell, solid: Option<&Distance<'_>>) -> f64 {
        self.0.volume(low, high, solid)
    }
}

/// |∇φ| = 1, with φ kept next to the surface, at most 1 there.
fn distances(rows: &CellRows, phi: &[f32]) -> Vec<f32> {
    let stencil = Stencil::around(rows.clone(), 1);
    let signed = stencil.rows().resampled(rows, phi, f32::NAN);
    let neighbours = |run: &Run, n: usize| {
        let (_, below, above) = run.neighbours(n);
        [0, 1, 2].map(|axis| [below[axis], above[axis]])
    };
    let mut distance = vec![BAND; signed.len()];
    let mut kept = vec![0_u8; signed.len()];
    for run in stencil.runs() {
        for (n, at) in run.range().enumerate() {
            // NaN, where nothing is stored, compares false.
            if neighbours(run, n).as_flattened().iter().any(|near| signed[*near] * signed[at] <= 0.0) {
                (distance[at], kept[at]) = (signed[at].abs().min(1.0), 1);
            }
        }
    }
    for _ in 0..8 {
        let mut next = distance.clone();
        stencil.update([&mut next], |runs, first, [next]| {
            for run in runs {
                for (n, at) in run.range().enumerate().filter(|(_, at)| kept[*at] == 0) {
                    let least = neighbours(run, n).map(|[below, above]| distance[below].min(distance[above]));
                    next[at - first] = distance[at].min(eikonal(least));
                }
            }
        });
        distance = next;
    }
    let all: Vec<f32> = distance.iter().zip(&signed).map(|(distance, phi)| distance.copysign(*phi)).collect();
    rows.resampled(stencil.rows(), &all, BAND)
}

/// The distance of a cell whose nearest neighbours along the axes have these.
fn eikonal(mut near: [f32; 3]) -> f32 {
    near.sort_by(f32::total_cmp);
    let [a, b, c] = near;
    let mut distance = a + 1.0;
    if distance > b {
        distance = 0.5 * (a + b + (2.0 - (a - b) * (a - b)).max(0.0).sqrt());
    }
    if distance > c {
        let (sum, squares) = (a + b + c, near.map(|x| x * x).iter().sum::<f32>());
        distance = (sum + (sum * sum - 3.0 * (squares - 1.0)).max(0.0).sqrt()) / 3.0;
    }
    distance
}
