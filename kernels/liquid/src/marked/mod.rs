//! The surface of a liquid that is solved for: a level set with markers, on cells as large as the solver's or smaller.
//!
//! It is all that the next step depends on, and any format that keeps numbers keeps it exactly: a liquid resumed from it
//! has the same bits.

mod outside;
#[cfg(test)]
mod tests;

use numerics::parallel;
use numerics::vector::{Vec3, dot, scale};
use serde::{Deserialize, Serialize};

use crate::extract::{Placement, QuadMesh, extract_with};
use crate::level_set::{BAND, Distance, Flow, Held, LevelSet, PhiChange, PhiView, Sides};
use crate::markers::{FARTHEST, Marker, Markers};
use crate::rows::{Cell, CellRows, Periods};
use crate::step::{Domain, Moving, Owed, Shares, Solid, Surface, Swelling, WHOLE, Wall};

/// Images beyond a periodic side, besides those that move in, so that φ in the band is that of a surface without an end.
const IMAGES: i32 = 8;

/// Depth in a solid, in surface cells, from which a marker is dropped: nearer, its plane is the surface outside, too.
const INSIDE: f32 = 1.0;

/// Cosine between the normals of a marker and of a thin solid from which it faces a side.
const FACING: f32 = 0.5;

/// |φ|, in solver cells, up to which it swells.
const SWELLING: f32 = 3.0;

/// Points that one thread moves at a time.
const CHUNK: usize = 512;

/// A level set and its markers, moved together.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct MarkedSurface {
    set: LevelSet,
    markers: Markers,
    /// Surface cells along the side of a solver cell.
    resolution: i32,
    /// φ of the solver's cells, in solver cells; empty where it is that of the surface.
    rows: CellRows,
    phi: Vec<f32>,
    /// After how many surface cells it repeats.
    periods: Periods,
}

impl MarkedSurface {
    /// A surface with `resolution` ≥ 1 cells along the side of a cell of `domain`, from a distance at places in the
    /// domain's cells. `attributes` and `seed` are those of [`Markers::new`].
    pub fn new(
        domain: Domain,
        resolution: u32,
        distance: impl Fn(Vec3) -> f32 + Sync,
        attributes: usize,
        seed: u64,
    ) -> Self {
        let set = Self::set_of(&domain, resolution.max(1) as i32, &distance);
        Self::of_level_set(set, resolution, attributes, seed).within(&domain)
    }

    fn set_of(domain: &Domain, resolution: i32, distance: &Distance<'_>) -> LevelSet {
        let size = resolution as f32;
        let [low, high] = [domain.low, domain.high].map(|corner| corner.map(|x| x * resolution));
        let near = CellRows::cuboid(domain.low, domain.high);
        let phi = |cell: Cell| size * distance(cell.map(|x| (x as f32 + 0.5) / size));
        let cells = near.refined(resolution).filtered(|cell, _| phi(cell) < BAND + 1.0);
        let mut set = LevelSet::new(&cells, &cells.tabulate(phi), low, high);
        set.fill();
        set
    }

    /// The surface of a level set whose cells are `resolution` ≥ 1 times as small as the solver's.
    pub fn of_level_set(set: LevelSet, resolution: u32, attributes: usize, seed: u64) -> Self {
        let markers = Markers::new(&set, attributes, seed);
        let resolution = resolution.max(1) as i32;
        let mut surface =
            Self { set, markers, resolution, rows: CellRows::default(), phi: Vec::new(), periods: Periods::NONE };
        surface.restrict();
        surface
    }

    /// The same between the walls of a domain: where they are periodic, the surface repeats, and a shape that one of them
    /// cuts has a surface there; where they are open, air comes in as liquid moves away.
    #[must_use]
    pub fn within(self, domain: &Domain) -> Self {
        let periods = domain.periods().refined(self.resolution);
        let mut surface = Self { periods, set: self.set.open_at(domain.open_sides()), ..self };
        if periods.any() {
            surface.among_images(0.0, |markers, set| {
                let sides = (0..3).flat_map(|axis| [(axis, 0), (axis, periods.0[axis])]);
                sides.filter(|(axis, _)| periods.0[*axis] > 0).for_each(|(axis, side)| set.part_at(axis, side));
                set.fill();
                markers.upkeep(set);
            });
            surface.restrict();
        }
        surface
    }

    /// The level set, in surface cells.
    pub fn level_set(&self) -> &LevelSet {
        &self.set
    }

    /// The markers, in surface cells.
    pub fn markers(&self) -> &Markers {
        &self.markers
    }

    /// Gives the markers attributes more, with one of these values each.
    pub fn add_attributes(&mut self, values: &[f32]) {
        let markers = &mut self.markers;
        markers.attributes.extend(values.iter().map(|value| vec![*value; markers.ids.len()]));
    }

    /// Surface cells along the side of a solver cell.
    pub fn resolution(&self) -> u32 {
        self.resolution as u32
    }

    /// The surface where it is not in a solid, as a mesh in surface cells: what [`MarkedSurface::phi_outside`] has in a solid
    /// lies on it.
    pub fn mesh(&self, solid: Option<&Distance<'_>>) -> QuadMesh {
        let clipped = solid.map(|solid| self.phi_outside(solid));
        self.meshed(self.view_of(clipped.as_deref()), solid, |_, _| ()).0
    }

    /// The mesh of one of its views, what is in a solid moved onto that, and what `of` makes of the cells inside and outside that
    /// each quad separates.
    pub(crate) fn meshed<T: Send>(
        &self,
        view: PhiView<'_>,
        solid: Option<&Distance<'_>>,
        of: impl Fn(Cell, Cell) -> T + Sync,
    ) -> (QuadMesh, Vec<T>) {
        let (mut mesh, made) = extract_with(view, Placement::Projected, of);
        if let Some(solid) = solid {
            self.put_outside(&mut mesh, solid);
        }
        mesh.bulge(&view);
        (mesh, made)
    }

    /// The surface cells with another φ, where there is one.
    pub(crate) fn view_of<'a>(&'a self, phi: Option<&'a [f32]>) -> PhiView<'a> {
        let view = self.set.view();
        PhiView { phi: phi.unwrap_or(view.phi), ..view }
    }

    /// The markers, to say which pieces they are on.
    pub(crate) fn markers_mut(&mut self) -> &mut Markers {
        &mut self.markers
    }

    /// Moves the surface outward: by how many surface cells at each stored cell and at each marker.
    pub(crate) fn shift(&mut self, cells: &[f32], markers: &[f32]) {
        self.set.lower(cells);
        self.markers.shift(markers);
        self.among_images(0.0, |_, set| set.fill());
        self.restrict();
    }

    /// Takes out surface cells, whole pieces of the liquid, and their markers. Returns what the solver's cells no longer hold outside
    /// the solid.
    pub(crate) fn take_out(
        &mut self,
        cells: &CellRows,
        solid: Option<&Distance<'_>>,
        is_taken: impl Fn(u32) -> bool,
    ) -> Vec<Owed> {
        let domain = self.domain();
        let around = coarsened(&cells.dilated(BAND as i32 + 1), self.resolution);
        let around = domain.periods().gathered(around).clipped(domain.low, domain.high);
        let before = self.shares(&around, solid);
        let pieces = self.markers.pieces().to_vec();
        self.markers.retain(|n| !is_taken(pieces[n]));
        let cells = self.periods.with_images(cells.clone(), IMAGES);
        self.among_images(0.0, |_, set| set.take_out(&cells));
        self.restrict();
        let taken = before.iter().zip(self.shares(&around, solid)).map(|(before, now)| before - now);
        let of_cells = around.iter().zip(taken).filter(|(_, taken)| *taken != 0.0);
        of_cells.map(|(cell, taken)| (cell.map(|x| x as f32 + 0.5), taken)).collect()
    }

    /// How much liquid all solver cells hold outside the solid, ÷ the volume of one.
    pub(crate) fn held(&self, solid: Option<&Distance<'_>>) -> f64 {
        let (view, domain) = (self.view(), self.domain());
        let is_full = |phi: f32| phi < -WHOLE && solid.is_none();
        let full =
            view.rows.iter().zip(view.phi).filter(|(cell, phi)| is_full(**phi) && domain.contains(*cell)).count();
        let others = view.rows.filtered(|_, at| view.phi[at] < WHOLE && !is_full(view.phi[at]));
        self.shares(&others, solid).iter().fold(full as f64, |sum, share| sum + f64::from(*share))
    }

    /// How much of each of some solver cells is liquid outside the solid.
    pub(crate) fn shares(&self, cells: &CellRows, solid: Option<&Distance<'_>>) -> Vec<f32> {
        let domain = self.domain();
        let distance = |_: f64, place: Vec3| solid.map_or(f32::INFINITY, |solid| solid(place));
        let still = Solid::still(&distance);
        let shares = Shares::of(self, &domain, solid.map(|_| still.at(0.0)));
        let [shares] = cells.tabulate_with(|| shares.reader(), |share, cell, _| share(cell, [0.0]).0);
        shares
    }

    /// Calls `f` with the surface and its images, `reach` cells and those that its distances need beyond the sides, and
    /// keeps what is inside the domain.
    fn among_images(&mut self, reach: f32, f: impl FnOnce(&mut Markers, &mut LevelSet)) {
        let periods = self.periods;
        if !periods.any() {
            return f(&mut self.markers, &mut self.set);
        }
        let margin = reach.ceil() as i32 + IMAGES;
        let (low, high) = self.set.domain();
        let mut outer = [low, high];
        for axis in (0..3).filter(|axis| periods.0[*axis] > 0) {
            outer[0][axis] -= margin;
            outer[1][axis] += margin;
        }
        let own = self.set.rows().clipped(low, high);
        let rows = periods.with_images(own.clone(), margin);
        let mut phi = rows.resampled(self.set.rows(), self.set.phi(), BAND);
        periods.images(&rows).fill(&mut phi);
        let open = self.set.open_sides();
        let mut set = LevelSet::new(&rows, &phi, outer[0], outer[1]).open_at(open);
        self.markers.repeat(periods, outer);
        f(&mut self.markers, &mut set);
        self.markers.retain_homes(periods);
        self.set = LevelSet::new(set.rows(), set.phi(), low, high).open_at(open);
    }

    /// After how many surface cells it repeats.
    pub(crate) fn periods(&self) -> Periods {
        self.periods
    }

    /// The domain, in which walls are either periodic or closed.
    fn domain(&self) -> Domain {
        let (low, high) = self.solver_domain();
        let wall = |period: i32| if period > 0 { Wall::Periodic } else { Wall::Closed };
        Domain { low, high, walls: self.periods.0.map(|period| [wall(period); 2]) }
    }

    /// The domain's corners, in solver cells.
    fn solver_domain(&self) -> (Cell, Cell) {
        let (low, high) = self.set.domain();
        (low.map(|x| x / self.resolution), high.map(|x| x / self.resolution))
    }

    /// Makes φ of the solver's cells the mean of that of the surface cells in each.
    fn restrict(&mut self) {
        if self.resolution == 1 {
            return;
        }
        let (fine, r) = (self.set.view(), self.resolution);
        let (low, high) = self.solver_domain();
        let rows = coarsened(fine.rows, r).clipped(low, high);
        let share = 1.0 / (r * r * r * r) as f32;
        self.phi = rows.tabulate(|[x, y, z]| {
            let mut sum = 0.0;
            for (y, z) in (0..r * r).map(|n| (r * y + n % r, r * z + n / r)) {
                for x in r * x..r * x + r {
                    sum += fine.rows.find([x, y, z]).map_or(fine.outside, |at| fine.phi[at]);
                }
            }
            sum * share
        });
        self.rows = rows;
    }
}

impl Surface for MarkedSurface {
    fn view(&self) -> PhiView<'_> {
        if self.resolution == 1 {
            return self.set.view();
        }
        let (low, high) = self.solver_domain();
        PhiView { rows: &self.rows, phi: &self.phi, outside: BAND / self.resolution as f32, low, high }
    }

    fn finest_view(&self) -> (PhiView<'_>, i32) {
        (self.set.view(), self.resolution)
    }

    fn advance(&mut self, flow: &Moving<'_>, reach: f32) {
        let size = self.resolution as f32;
        let flow = Scaled { flow, size };
        self.among_images(reach * size, |markers, set| markers.step(set, &flow, reach * size));
        self.restrict();
    }

    fn swell(&mut self, swelling: &Swelling<'_>) {
        let (size, unit) = (self.resolution as f32, 1.0 / self.resolution as f32);
        let start = || swelling.reader();
        let phi = self.set.phi();
        let [cells] = self.set.rows().tabulate_with(start, |by, cell, at| {
            let is_near = phi[at].abs() < SWELLING * size;
            [if is_near { size * by(scale(cell.map(|x| x as f32 + 0.5), unit)) } else { 0.0 }]
        });
        let points = &self.markers.markers;
        let markers =
            parallel::tabulate_with(points.len(), CHUNK, start, |by, n| size * by(scale(points[n].point, unit)));
        self.set.lower(&cells);
        self.markers.shift(&markers);
        self.restrict();
    }

    fn meet(&mut self, solid: &Distance<'_>) {
        let (size, unit) = (self.resolution as f32, 1.0 / self.resolution as f32);
        let scaled = |point: Vec3| size * solid(scale(point, unit));
        self.set.meet(&scaled, size);
        // Those in its inside mark nothing that is seen, or what is seen on the wrong side of a thin one; those that face a
        // side of a thin one are where liquid from one side ends in it.
        let is_seen = |marker: &Marker| {
            let depth = -scaled(marker.point);
            let seen_from = |sides: Sides| {
                let is_across = sides.behind < f32::INFINITY && dot(marker.normal, sides.normal).abs() > FACING;
                sides.depth < INSIDE && sides.behind > FARTHEST && !is_across
            };
            depth <= 0.0 || depth < INSIDE && Sides::of(&scaled, marker.point, depth).is_none_or(seen_from)
        };
        let markers = &self.markers.markers;
        let seen = parallel::tabulate(markers.len(), CHUNK, |n| is_seen(&markers[n]));
        if seen.contains(&false) {
            self.markers.retain(|n| seen[n]);
        }
        self.restrict();
    }

    fn change(&mut self, low: Cell, high: Cell, change: &PhiChange<'_>) {
        let [low, high] = [low, high].map(|corner| corner.map(|x| x.saturating_mul(self.resolution)));
        let (size, unit) = (self.resolution as f32, 1.0 / self.resolution as f32);
        let scaled = |point: Vec3, phi: f32| size * change(scale(point, unit), phi * unit);
        self.among_images(0.0, |markers, set| markers.change(set, low, high, &scaled));
        self.restrict();
    }

    fn volume(&self, low: Cell, high: Cell, solid: Option<&Distance<'_>>) -> f64 {
        let [low, high] = [low, high].map(|corner| corner.map(|x| x.saturating_mul(self.resolution)));
        self.volume_within(low, high, solid) / f64::from(self.resolution.pow(3))
    }

    fn edit_attributes(&mut self, edit: &(dyn Fn(Vec3, &mut [f32]) + Sync)) {
        let unit = 1.0 / self.resolution as f32;
        self.markers.edit_attributes(|point, row| edit(scale(point, unit), row));
    }
}

/// A flow in surface cells.
struct Scaled<'a> {
    flow: &'a Moving<'a>,
    size: f32,
}

impl Flow for Scaled<'_> {
    fn reader(&self) -> impl FnMut(Vec3) -> Vec3 {
        let (mut way, size) = (self.flow.reader(), self.size);
        move |point| scale(way(scale(point, 1.0 / size)), size)
    }

    fn centre_reader(&self) -> impl FnMut(Cell) -> Vec3 {
        let (mut way, mut way_at) = (self.reader(), self.flow.centre_reader());
        let is_same = self.size == 1.0;
        move |cell| if is_same { way_at(cell) } else { way(cell.map(|x| x as f32 + 0.5)) }
    }

    fn held(&self, from: Vec3, way: Vec3, direction: f32) -> Option<Held> {
        let unit = 1.0 / self.size;
        let held = self.flow.held(scale(from, unit), scale(way, unit), direction)?;
        Some(Held { way: scale(held.way, self.size), ..held })
    }

    fn solid_way(&self) -> f32 {
        self.flow.solid_way() * self.size
    }
}

/// The cells `by` times larger that hold one of `rows`.
fn coarsened(rows: &CellRows, by: i32) -> CellRows {
    let Some((low, high)) = rows.bounds() else { return CellRows::default() };
    let first = [low[1], low[2]].map(|x| x.div_euclid(by));
    let end = [high[1], high[2]].map(|x| (x - 1).div_euclid(by) + 1);
    CellRows::from_ranges(first, [end[0] - first[0], end[1] - first[1]], |y, z, out| {
        for (y, z) in (0..by * by).map(|n| (by * y + n % by, by * z + n / by)) {
            out.extend(rows.row(y, z).iter().map(|span| span.start.div_euclid(by)..(span.end - 1).div_euclid(by) + 1));
        }
    })
}
