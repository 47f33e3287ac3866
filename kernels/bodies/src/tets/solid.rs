//! Filling the inside of a closed surface with tets.

use numerics::parallel;
use numerics::vector::{DVec3, to_f64};
use std::ops::Range;

use super::closed::ClosedSurface;
use super::delaunay;
use super::edges::TetsAround;
use super::grid::GridPoint;
use super::improve::{Improver, Unchanged};
use super::interior::{InteriorPoint, POINTS_A_CUBE, SIDE_BY_EDGE, interior};
use super::quality::{Measure, measure};
use super::surface_fault::SurfaceFault;
use super::winding::{Winding, WindingCounts};

/// Parameters of filling.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FillSettings {
    /// Mean edge length between interior points, metres; 0: that of the surface.
    pub spacing: f64,
    /// Whether to add interior points.
    pub interior: bool,
}

/// Kind of shell that a point is on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShellSide {
    /// None: an interior point.
    Interior,
    /// The outer boundary of a body.
    Outer,
    /// The wall of a cavity.
    Inner,
}

/// Bodies filled with tets.
#[derive(Clone, Debug)]
pub struct TetMesh {
    /// The surface's points in their order, then interior ones, metres.
    pub points: Vec<[f32; 3]>,
    /// Kind of shell of each point.
    pub sides: Vec<ShellSide>,
    /// Points of each tet, with (b−a)×(c−a)·(d−a) > 0 except for slivers that rounding to f32 inverted.
    pub tets: Vec<[u32; 4]>,
    /// Body of each tet.
    pub bodies: Vec<u32>,
    /// Whether each tet is too flat for its volume to be meaningful: quality below [`SLIVER`].
    pub slivers: Vec<bool>,
    /// Quality measures.
    pub measured: FillQuality,
}

/// Quality measures of a filled surface.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FillQuality {
    /// Smallest dihedral angle of a tet that is not a sliver, radians; 0 without tets.
    pub min_dihedral: f64,
    /// Median quality of all tets, 3 × inradius ÷ circumradius: 1 for regular ones; 0 without tets.
    pub quality_median: f64,
    /// Difference of the tets' volume from that of the surface, relative to the latter.
    pub volume_error: f64,
    /// Faces of the surface that are not faces of tets.
    pub missing_faces: usize,
    /// Edges of the surface that are not edges of tets.
    pub missing_edges: usize,
    /// Points of the surface in no tet.
    pub bare_points: usize,
    /// Number of slivers.
    pub slivers: usize,
}

/// Tets of lower quality are slivers.
pub const SLIVER: f64 = 0.04;

/// Tets, edges or faces that a thread takes at a time.
pub(super) const TASK: usize = 256;

/// Largest number of interior points: about 25 million tets, which take 2 gigabytes to build.
const MOST_POINTS: f64 = (1 << 22) as f64;

/// Largest number of lattice points to test.
const MOST_TRIED: f64 = (1 << 27) as f64;

impl ClosedSurface {
    /// Fills the inside with Delaunay tets of the surface's points and, if requested, interior points.
    ///
    /// # Errors
    /// If the spacing would make too many points, or shells overlap.
    pub fn fill(&self, fill: &FillSettings) -> Result<TetMesh, SurfaceFault> {
        self.filled(fill, |tets| tets.run())
    }

    /// The carved Delaunay tets, as `finish` leaves them.
    pub(super) fn filled(
        &self,
        fill: &FillSettings,
        finish: impl FnOnce(Improver<'_>) -> (Vec<[u32; 4]>, Vec<u32>),
    ) -> Result<TetMesh, SurfaceFault> {
        let winding = Winding::new(&self.grid_points, &self.shells.triangles, &self.shells.shell_of);
        let inner = if fill.interior { interior(self, &winding, self.spacing(fill.spacing)?) } else { Vec::new() };
        let carved = Carving { closed: self, winding: &winding, inner: &inner };
        let bodies = parallel::map(carved.members(), |body, points| carved.body(body as u32, &points));
        let bodies: Vec<Vec<[u32; 4]>> = bodies.into_iter().collect::<Result<_, _>>()?;
        let of = bodies.iter().enumerate().flat_map(|(body, tets)| std::iter::repeat_n(body as u32, tets.len()));
        let place = |inner: &InteriorPoint| self.grid.point(inner.grid_point.map(f64::from)).map(|x| x as f32);
        let mut points = self.points.clone();
        points.extend(inner.iter().map(place));
        let edges = self.edges();
        let surface = Unchanged { points: self.points.len(), edges: &edges, triangles: &self.shells.triangles };
        let improver = Improver::new(surface, self.grid.step(), &mut points, bodies.concat(), of.collect());
        let (tets, bodies) = finish(improver);
        Ok(self.solid(points, tets, bodies))
    }

    /// About how many bytes [`fill`](Self::fill) takes.
    ///
    /// # Errors
    /// If the spacing would make too many points.
    pub fn fill_bytes(&self, fill: &FillSettings) -> Result<f64, SurfaceFault> {
        /// Of a point, its tets, and what finds them.
        const BYTES: f64 = 500.0;
        let inner = if fill.interior { self.interior_points(fill.spacing)?.0 } else { 0.0 };
        Ok(BYTES * (inner + self.points.len() as f64))
    }

    /// The spacing in grid steps.
    fn spacing(&self, asked: f64) -> Result<f64, SurfaceFault> {
        Ok(self.interior_points(asked)?.1 / self.grid.step())
    }

    /// About how many interior points there will be, and their spacing.
    fn interior_points(&self, asked: f64) -> Result<(f64, f64), SurfaceFault> {
        let spacing = if asked > 0.0 { asked } else { self.mean_edge() };
        let side = SIDE_BY_EDGE * spacing;
        let cubes = |volume: f64| POINTS_A_CUBE * volume / (side * side * side);
        let extent = |k: usize| {
            let (low, high) =
                self.grid_points.iter().fold((i32::MAX, 0), |(low, high), p| (low.min(p[k]), high.max(p[k])));
            f64::from(high - low.min(high)) * self.grid.step()
        };
        let (points, tried) = (cubes(self.volume()), cubes(extent(0) * extent(1) * extent(2)));
        match points > MOST_POINTS || tried > MOST_TRIED {
            true => Err(SurfaceFault::TooManyPoints { spacing, points, most: MOST_POINTS }),
            false => Ok((points, spacing)),
        }
    }

    /// The body at a point with these winding numbers; `None` outside and in cavities.
    pub(super) fn body(&self, tally: &WindingCounts) -> Option<u32> {
        let depth = |shell: &u32| self.shells.all[*shell as usize].depth;
        let deepest = tally.iter().map(|(shell, _)| *shell).max_by_key(depth)?;
        (depth(&deepest) % 2 == 0).then(|| self.shells.all[deepest as usize].body)
    }

    fn solid(&self, points: Vec<[f32; 3]>, tets: Vec<[u32; 4]>, bodies: Vec<u32>) -> TetMesh {
        let outward = |shell: &u32| match self.shells.all[*shell as usize].depth % 2 {
            0 => ShellSide::Outer,
            _ => ShellSide::Inner,
        };
        let mut sides: Vec<ShellSide> = self.shell_of.iter().map(outward).collect();
        sides.resize(points.len(), ShellSide::Interior);
        // In grid steps, so that no squared length over- or underflows.
        let step = self.grid.step();
        let steps = |corner: u32| to_f64(points[corner as usize]) / step;
        let mut measures = vec![Measure::default(); tets.len()];
        parallel::fill(&mut measures, TASK, |tet| measure(&tets[tet].map(steps)));
        let slivers: Vec<bool> = measures.iter().map(|tet| !(tet.volume > 0.0 && tet.quality >= SLIVER)).collect();
        let volume = measures.iter().map(|tet| tet.volume).sum::<f64>() * step * step * step;
        let sharpest = measures.iter().zip(&slivers).filter(|(_, sliver)| !**sliver);
        let sharpest = sharpest.map(|(tet, _)| tet.sharpest).fold(-1.0, f64::max);
        let all = self.volume();
        let mut measured = FillQuality {
            min_dihedral: if sharpest > -1.0 { libm::acos(sharpest) } else { 0.0 },
            quality_median: median(measures.iter().map(|tet| tet.quality).collect()),
            volume_error: if all > 0.0 { (volume - all).abs() / all } else { 0.0 },
            slivers: slivers.iter().filter(|sliver| **sliver).count(),
            ..FillQuality::default()
        };
        self.compare(&tets, &mut measured);
        TetMesh { points, sides, tets, bodies, slivers, measured }
    }

    /// Counts the surface elements that are missing in the tets.
    fn compare(&self, tets: &[[u32; 4]], measured: &mut FillQuality) {
        let around = TetsAround::new(self.points.len(), tets);
        measured.missing_edges = count(&self.edges(), |edge| !around.has(edge));
        measured.bare_points = (0..self.points.len() as u32).filter(|point| around.of(*point).is_empty()).count();
        let mut first = 0;
        let runs = self.shells.polygons.chunk_by(|a, b| a == b).map(|run| {
            first += run.len();
            first - run.len()..first
        });
        let runs: Vec<Range<usize>> = runs.collect();
        let cut_as_here = |run: &Range<usize>| run.clone().all(|triangle| around.has(&self.shells.triangles[triangle]));
        // A quad may be split along either diagonal.
        let cut_otherwise = |run: &Range<usize>| match *self.face(self.shells.polygons[run.start] as usize) {
            [a, b, c, d] => {
                let both = |faces: [[u32; 3]; 2]| faces.iter().all(|face| around.has(face));
                both([[a, b, c], [c, d, a]]) || both([[b, c, d], [d, a, b]])
            }
            _ => false,
        };
        measured.missing_faces = count(&runs, |run| !cut_as_here(run) && !cut_otherwise(run));
    }
}

/// Input for selecting the tets inside a body from its convex hull.
struct Carving<'a> {
    closed: &'a ClosedSurface,
    winding: &'a Winding<'a>,
    inner: &'a [InteriorPoint],
}

impl Carving<'_> {
    /// The points of each body, ascending.
    fn members(&self) -> Vec<Vec<u32>> {
        let mut members = vec![Vec::new(); self.closed.bodies];
        let on_surface = self.closed.shell_of.iter().map(|shell| self.closed.shells.all[*shell as usize].body);
        for (point, body) in on_surface.chain(self.inner.iter().map(|inner| inner.body)).enumerate() {
            members[body as usize].push(point as u32);
        }
        members
    }

    /// The tets of a body: Delaunay tets of its own points only, which makes it independent of other bodies, selected
    /// by their centroids.
    fn body(&self, body: u32, points: &[u32]) -> Result<Vec<[u32; 4]>, SurfaceFault> {
        let inner = |point: u32| (point as usize).checked_sub(self.closed.points.len()).map(|k| &self.inner[k]);
        let grid_point = |point: &u32| {
            inner(*point).map_or_else(|| self.closed.grid_points[*point as usize], |inner| inner.grid_point)
        };
        let grid_points: Vec<GridPoint> = points.iter().map(grid_point).collect();
        let mut tets = delaunay(&grid_points).tets;
        let is_inside = |tally: &mut WindingCounts, tet: &[u32; 4]| {
            let corners = tet.map(|corner| grid_points[corner as usize].map(i64::from));
            let middle = [0, 1, 2].map(|k| corners.iter().map(|corner| corner[k]).sum::<i64>());
            // The surface does not come between an interior point and anything closer than its clearance.
            let near = |(corner, at): (&u32, &[i64; 3])| {
                inner(points[*corner as usize]).is_some_and(|inner| {
                    let away = DVec3::from([0, 1, 2].map(|k| (middle[k] - 4 * at[k]) as f64));
                    let clear = 4.0 * f64::from(inner.clear) * CLEAR_FOR_SURE;
                    away.norm_squared() < clear * clear
                })
            };
            if tet.iter().zip(&corners).any(near) {
                return Ok(true);
            }
            self.winding.around(middle, 4, tally);
            match tally.iter().map(|(_, times)| times).sum() {
                0 => Ok(false),
                1 => Ok(self.closed.body(tally) == Some(body)),
                _ => {
                    let at = self.closed.grid.point(middle.map(|x| 0.25 * x as f64));
                    Err(SurfaceFault::SelfOverlap { at: at.map(|x| x as f32) })
                }
            }
        };
        let inside = parallel::map(tets.chunks(TASK), |_, tets| {
            let mut tally = Vec::new();
            tets.iter().map(|tet| is_inside(&mut tally, tet)).collect::<Result<Vec<bool>, _>>()
        });
        let inside: Vec<Vec<bool>> = inside.into_iter().collect::<Result<_, _>>()?;
        let mut next = inside.iter().flatten();
        tets.retain(|_| *next.next().expect("one answer a tet"));
        tets.iter_mut().for_each(|tet| *tet = tet.map(|corner| points[corner as usize]));
        Ok(tets)
    }
}

/// Safety factor for clearances rounded to f32.
const CLEAR_FOR_SURE: f64 = 0.999;

/// How many `things` are so, over all threads.
fn count<T: Sync>(things: &[T], is_so: impl Fn(&T) -> bool + Sync) -> usize {
    parallel::map(things.chunks(TASK), |_, things| things.iter().filter(|thing| is_so(thing)).count()).iter().sum()
}

pub(super) fn median(mut values: Vec<f64>) -> f64 {
    let middle = values.len() / 2;
    if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(middle, f64::total_cmp).1 }
}
