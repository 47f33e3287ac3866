//! Tets of what is inside of a closed surface.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::closed::Closed;
use super::fault::Fault;
use super::interior::{Inner, POINTS_A_CUBE, SIDE_BY_EDGE, interior};
use super::lattice::Place;
use super::quality::{Measure, measure};
use super::winding::{Tally, Winding};
use super::{Delaunay, delaunay};

/// How to fill a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fill {
    /// Mean length of edges between interior points, metres; 0 for the surface's own.
    pub spacing: f64,
    /// Whether there are interior points.
    pub interior: bool,
}

/// On which kind of shell a point is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// None: inside a body.
    Interior,
    /// The outside of a body.
    Outer,
    /// The wall of a cavity.
    Inner,
}

/// Bodies of tets.
#[derive(Clone, Debug)]
pub struct Solid {
    /// The surface's points, in their order, then the interior ones. Metres.
    pub points: Vec<[f32; 3]>,
    /// Where each point is.
    pub sides: Vec<Side>,
    /// Points of each tet, so that its face across from a corner, seen from outside, runs the way its neighbour's does
    /// not: (b−a)×(c−a)·(d−a) > 0, but for slivers, which rounding to f32 may have turned over.
    pub tets: Vec<[u32; 4]>,
    /// Body of each tet.
    pub bodies: Vec<u32>,
    /// Whether each tet is too flat to say anything of volume: quality below [`SLIVER`].
    pub slivers: Vec<bool>,
    /// What was measured.
    pub measured: Measured,
}

/// What was measured of a solid.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measured {
    /// Smallest angle between two faces of a tet that is no sliver, radians; 0 without tets.
    pub min_dihedral: f64,
    /// Median quality of all tets: 3 × inner radius ÷ outer radius, 1 for regular ones; 0 without tets.
    pub quality_median: f64,
    /// How much the tets' volume differs from the surface's, as a share of the latter.
    pub volume_error: f64,
    /// Faces of the surface that are not faces of tets.
    pub missing_faces: usize,
    /// Edges of the surface that are no edge of a tet.
    pub missing_edges: usize,
    /// Points of the surface that no tet has.
    pub bare_points: usize,
    /// Tets that are slivers.
    pub slivers: usize,
}

/// Tets of lower quality are slivers.
pub const SLIVER: f64 = 0.02;

/// Interior points there may be: some 25 million tets, 2 gigabytes while they are made.
const MOST_POINTS: f64 = (1 << 22) as f64;

/// Lattice points that may be looked at for it.
const MOST_TRIED: f64 = (1 << 27) as f64;

/// The tet is in no body.
const OUTSIDE: u32 = u32::MAX;

impl Closed {
    /// The surface's inside as tets, Delaunay in its points and, where asked for, points inside.
    ///
    /// # Errors
    /// Where the spacing would make more points than memory is for, or two shells overlap.
    pub fn fill(&self, fill: &Fill) -> Result<Solid, Fault> {
        let winding = Winding::new(&self.places, &self.shells.triangles, &self.shells.shell_of);
        let inner = if fill.interior { interior(self, &winding, self.spacing(fill.spacing)?) } else { Vec::new() };
        let mut places = self.places.clone();
        places.extend(inner.iter().map(|inner| inner.place));
        let Delaunay { tets, doubled, .. } = delaunay(&places);
        let carved = Carved { closed: self, winding: &winding, inner: &inner, places: &places };
        let mut bodies = carved.bodies(&tets)?;
        let mut tets: Vec<[u32; 4]> = keep(tets, &bodies);
        bodies.retain(|body| *body != OUTSIDE);
        carved.part(&mut tets, &mut bodies, &doubled);
        Ok(self.solid(&inner, tets, bodies))
    }

    /// The spacing in steps of the lattice.
    fn spacing(&self, asked: f64) -> Result<f64, Fault> {
        let spacing = if asked > 0.0 { asked } else { self.mean_edge() };
        let side = SIDE_BY_EDGE * spacing;
        let cubes = |volume: f64| POINTS_A_CUBE * volume / (side * side * side);
        let extent = |k: usize| {
            let (low, high) = self.places.iter().fold((i32::MAX, 0), |(low, high), p| (low.min(p[k]), high.max(p[k])));
            f64::from(high - low.min(high)) * self.lattice.step()
        };
        let (points, tried) = (cubes(self.volume()), cubes(extent(0) * extent(1) * extent(2)));
        match points > MOST_POINTS || tried > MOST_TRIED {
            true => Err(Fault::TooMany { spacing, points, most: MOST_POINTS }),
            false => Ok(spacing / self.lattice.step()),
        }
    }

    /// The body around a point, given how shells wind around it. `None` outside and in cavities.
    pub(super) fn body(&self, tally: &Tally) -> Option<u32> {
        let depth = |shell: &u32| self.shells.all[*shell as usize].depth;
        let deepest = tally.iter().map(|(shell, _)| *shell).max_by_key(depth)?;
        (depth(&deepest) % 2 == 0).then(|| self.shells.all[deepest as usize].body)
    }

    fn solid(&self, inner: &[Inner], tets: Vec<[u32; 4]>, bodies: Vec<u32>) -> Solid {
        let mut points = self.points.clone();
        let outward = |shell: &u32| match self.shells.all[*shell as usize].depth % 2 {
            0 => Side::Outer,
            _ => Side::Inner,
        };
        let mut sides: Vec<Side> = self.shell_of.iter().map(outward).collect();
        points.extend(inner.iter().map(|inner| self.lattice.point(inner.place.map(f64::from)).map(|x| x as f32)));
        sides.resize(points.len(), Side::Interior);
        // In steps, so that no square of a length is too large or too small.
        let step = self.lattice.step();
        let steps = |corner: &u32| points[*corner as usize].map(|x| f64::from(x) / step);
        let measures: Vec<Measure> =
            tets.par_iter().map(|[a, b, c, d]| measure(&[a, b, c, d].map(steps))).collect();
        let slivers: Vec<bool> = measures.iter().map(|tet| !(tet.volume > 0.0 && tet.quality >= SLIVER)).collect();
        let volume = measures.iter().map(|tet| tet.volume).sum::<f64>() * step * step * step;
        let sharpest = measures.iter().zip(&slivers).filter(|(_, sliver)| !**sliver);
        let sharpest = sharpest.map(|(tet, _)| tet.sharpest).fold(-1.0, f64::max);
        let all = self.volume();
        let mut measured = Measured {
            min_dihedral: if sharpest > -1.0 { libm::acos(sharpest) } else { 0.0 },
            quality_median: median(measures.iter().map(|tet| tet.quality).collect()),
            volume_error: if all > 0.0 { (volume - all).abs() / all } else { 0.0 },
            slivers: slivers.iter().filter(|sliver| **sliver).count(),
            ..Measured::default()
        };
        self.compare(&tets, &mut measured);
        Solid { points, sides, tets, bodies, slivers, measured }
    }

    /// Counts what tets lack of the surface.
    fn compare(&self, tets: &[[u32; 4]], measured: &mut Measured) {
        let around = Around::new(self.points.len(), tets);
        let has = |points: &[u32]| around.of(points[0]).iter().any(|tet| {
            points.iter().all(|point| tets[*tet as usize].contains(point))
        });
        measured.missing_edges = self.edges().par_iter().filter(|edge| !has(*edge)).count();
        measured.bare_points = (0..self.points.len() as u32).filter(|point| around.of(*point).is_empty()).count();
        let mut first = 0;
        let runs: Vec<std::ops::Range<usize>> = self
            .shells
            .polygons
            .chunk_by(|a, b| a == b)
            .map(|run| {
                first += run.len();
                first - run.len()..first
            })
            .collect();
        let covered = |run: &std::ops::Range<usize>| {
            let cut = run.clone().all(|triangle| has(&self.shells.triangles[triangle]));
            // A quad may be cut along its other diagonal.
            let other = || match *self.face(self.shells.polygons[run.start] as usize) {
                [a, b, c, d] => [[a, b, c], [c, d, a], [b, c, d], [d, a, b]].map(|triangle| has(&triangle)),
                _ => [false; 4],
            };
            cut || matches!(other(), [true, true, ..] | [.., true, true])
        };
        measured.missing_faces = runs.par_iter().filter(|run| !covered(run)).count();
    }
}

/// The tets around each of the first points.
struct Around {
    starts: Vec<u32>,
    tets: Vec<u32>,
}

impl Around {
    fn new(points: usize, tets: &[[u32; 4]]) -> Self {
        let mut starts = vec![0_u32; points + 1];
        let corners = || {
            let numbered = tets.iter().enumerate();
            numbered.flat_map(|(tet, corners)| corners.map(|corner| (tet as u32, corner as usize)))
        };
        let corners = || corners().filter(|(_, corner)| *corner < points);
        corners().for_each(|(_, corner)| starts[corner + 1] += 1);
        (0..points).for_each(|point| starts[point + 1] += starts[point]);
        let mut next = starts.clone();
        let mut around = vec![0; starts[points] as usize];
        for (tet, corner) in corners() {
            around[next[corner] as usize] = tet;
            next[corner] += 1;
        }
        Self { starts, tets: around }
    }

    fn of(&self, point: u32) -> &[u32] {
        &self.tets[self.starts[point as usize] as usize..self.starts[point as usize + 1] as usize]
    }
}

/// What carving a body out of its convex hull needs to know.
struct Carved<'a> {
    closed: &'a Closed,
    winding: &'a Winding<'a>,
    inner: &'a [Inner],
    /// Of the surface's points, then of those inside.
    places: &'a [Place],
}

impl Carved<'_> {
    /// The body of each tet, by where its middle is.
    fn bodies(&self, tets: &[[u32; 4]]) -> Result<Vec<u32>, Fault> {
        let overlap = |middle: [i64; 3]| {
            let at = self.closed.lattice.point(middle.map(|x| 0.25 * x as f64)).map(|x| x as f32);
            Fault::Overlap { at }
        };
        let classified = tets.par_iter().map_init(Vec::new, |tally, tet| {
            let corners = tet.map(|corner| self.places[corner as usize].map(i64::from));
            let middle = [0, 1, 2].map(|k| corners[0][k] + corners[1][k] + corners[2][k] + corners[3][k]);
            // No surface is between an interior point and what is nearer to it than the surface.
            for (corner, at) in tet.iter().zip(corners) {
                let Some(inner) = (*corner as usize).checked_sub(self.closed.points.len()) else { continue };
                let inner = &self.inner[inner];
                let away = [0, 1, 2].map(|k| (middle[k] - 4 * at[k]) as f64);
                let clear = 4.0 * f64::from(inner.clear) * CLEAR_FOR_SURE;
                if away[0] * away[0] + away[1] * away[1] + away[2] * away[2] < clear * clear {
                    return Ok(inner.body);
                }
            }
            self.winding.around(middle, 4, tally);
            match tally.iter().map(|(_, times)| times).sum() {
                0 => Ok(OUTSIDE),
                1 => Ok(self.closed.body(tally).unwrap_or(OUTSIDE)),
                _ => Err(overlap(middle)),
            }
        });
        classified.collect::<Vec<_>>().into_iter().collect()
    }

    /// Gives each body its own of the points at one place, and takes tets out that would join two bodies.
    fn part(&self, tets: &mut Vec<[u32; 4]>, bodies: &mut Vec<u32>, doubled: &[[u32; 2]]) {
        let mut twins: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for [twin, of] in doubled {
            twins.entry(*of).or_default().push(*twin);
        }
        let body_of = |point: u32| match self.closed.shell_of.get(point as usize) {
            Some(shell) => self.closed.shells.all[*shell as usize].body,
            None => self.inner[point as usize - self.closed.points.len()].body,
        };
        let mut kept = Vec::with_capacity(tets.len());
        for (tet, body) in tets.iter_mut().zip(bodies.iter()) {
            let mut own = true;
            for corner in tet.iter_mut().filter(|corner| body_of(**corner) != *body) {
                let others = twins.get(corner).into_iter().flatten();
                match others.copied().find(|twin| body_of(*twin) == *body) {
                    Some(twin) => *corner = twin,
                    None => own = false,
                }
            }
            kept.push(if own { *body } else { OUTSIDE });
        }
        *tets = keep(std::mem::take(tets), &kept);
        kept.retain(|body| *body != OUTSIDE);
        *bodies = kept;
    }
}

/// A clearance is rounded to f32: this share of it is sure.
const CLEAR_FOR_SURE: f64 = 0.999;

/// The tets that are in a body.
fn keep(tets: Vec<[u32; 4]>, bodies: &[u32]) -> Vec<[u32; 4]> {
    tets.into_iter().zip(bodies).filter(|(_, body)| **body != OUTSIDE).map(|(tet, _)| tet).collect()
}

fn median(mut values: Vec<f64>) -> f64 {
    let middle = values.len() / 2;
    if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(middle, f64::total_cmp).1 }
}
