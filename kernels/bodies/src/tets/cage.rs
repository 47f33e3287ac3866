//! A cage of tets around any polygons: open, crossing themselves, or with several faces at an edge.
//!
//! The tets are those of a body-centred cubic lattice that a face touches, and those inside by the winding number
//! ([`super::solid_angle`]). Every point that a face uses lies in one of them, so a mesh can ride along, bound by
//! barycentric weights ([`crate::embedding`]). All tets are congruent, with dihedral angles of 60° and 90°.
//!
//! Limits: the cage reaches up to a tet beyond the surface, so parts closer together than two tets may be joined, as they
//! are where tets on both sides of a gap share a point. So that a body keeps its mass and stiffness nevertheless,
//! [`Cage::fill`] says how much of each tet is inside.

use numerics::parallel;
use numerics::tree::TriangleTree;
use numerics::vector::{DVec3, Vec3, to_f32, to_f64};

use super::boundary::boundary;
use super::interior::SIDE_BY_EDGE;
use super::lattice::Lattice;
use super::quality::measure;
use super::repair::{PolygonSurface, SignedUnionFind};
use super::solid::{FillQuality, SLIVER, ShellSide, TetMesh, median};
use super::solid_angle::SolidAngles;
use super::soup::Soup;
use super::surface_fault::SurfaceFault;

/// Triangles or lattice points that a thread takes at a time.
const TASK: usize = 64;

/// Largest number of cubes of the lattice; each has 12 tets and 2 points.
const MOST_CUBES: f64 = (1 << 24) as f64;

/// Least share of a tet that counts as filled, so that walls without a thickness have a mass.
const LEAST_FILL: f32 = 1.0 / 16.0;

/// Tets around a surface.
#[derive(Clone, Debug)]
pub struct Cage {
    /// The tets. No point is one of the surface's.
    pub tets: TetMesh,
    /// The share of each tet that is inside the surface, at least 1⁄16.
    pub fill: Vec<f32>,
    /// Number of connected bodies.
    pub bodies: usize,
}

/// A surface in a lattice.
pub struct CagedSurface<'a> {
    surface: PolygonSurface<'a>,
    soup: Soup,
    lattice: Lattice,
}

impl<'a> CagedSurface<'a> {
    /// Of polygons, with edges of `spacing` metres in the mean; 0: as long as the polygons'. If `orient`, faces are
    /// oriented alike and outwards first.
    ///
    /// # Errors
    /// If a point is not finite, or the lattice would be too large.
    ///
    /// # Panics
    /// If a corner is out of range.
    pub fn of(surface: PolygonSurface<'a>, spacing: f64, orient: bool) -> Result<Self, SurfaceFault> {
        if let Some(point) = surface.points.iter().position(|point| !point.iter().all(|x| x.is_finite())) {
            return Err(SurfaceFault::NotFinite { point: point as u32 });
        }
        let soup = Soup::of(&surface, orient);
        let used = || soup.triangles.iter().flatten().map(|corner| to_f64(surface.points[*corner as usize]));
        let low = used().fold(DVec3::repeat(f64::INFINITY), |low, p| low.inf(&p));
        let high = used().fold(DVec3::repeat(f64::NEG_INFINITY), |high, p| high.sup(&p));
        let spacing = if spacing > 0.0 { spacing } else { mean_edge(&surface, &soup) };
        let lattice = match soup.triangles.is_empty() {
            true => Lattice::around(DVec3::zeros(), DVec3::zeros(), 1.0),
            false => Lattice::around(low, high, SIDE_BY_EDGE * spacing),
        };
        if lattice.cubes() > MOST_CUBES {
            let points = 2.0 * lattice.cubes();
            return Err(SurfaceFault::TooManyPoints { spacing, points, most: 2.0 * MOST_CUBES });
        }
        Ok(Self { surface, soup, lattice })
    }

    /// About how many bytes [`fill`](Self::fill) takes.
    pub fn fill_bytes(&self) -> f64 {
        /// Of a cube: flags of its tets, connections of its points.
        const BYTES: f64 = 64.0;
        /// Of a triangle: the tets that it touches, and its place in the hierarchy of dipoles.
        const BYTES_A_TRIANGLE: f64 = 500.0;
        BYTES * self.lattice.cubes() + BYTES_A_TRIANGLE * self.soup.triangles.len() as f64
    }

    /// Makes the cage.
    pub fn fill(&self) -> Cage {
        let touched = self.touched();
        let angles = SolidAngles::new(self.surface.points, &self.soup.triangles);
        let groups = self.groups(&touched);
        let windings = self.group_windings(&groups, &angles);
        let is_inside = |tet: &[u32; 4]| {
            tet.iter().filter(|point| inside(windings[groups[**point as usize] as usize])).count() >= 2
        };
        let existing = (0..self.lattice.tets()).filter(|tet| self.lattice.exists(*tet));
        let kept: Vec<(u32, bool)> = existing
            .map(|tet| (tet, touched[tet as usize]))
            .filter(|(tet, cut)| *cut || is_inside(&self.lattice.corners(*tet)))
            .collect();
        let shares = self.shares(&kept, &angles);
        let (least, most) = windings.iter().fold((0.0_f32, 0.0_f32), |(least, most), x| (least.min(*x), most.max(*x)));
        // Space around which the surface runs twice, or once in each direction, has no simple volume.
        let simple = self.soup.closed && most - least < 1.5;
        self.assemble(&kept, &shares, if simple { self.enclosed().abs() } else { 0.0 })
    }

    /// Which tets a triangle touches, or rounding apart may touch.
    fn touched(&self) -> Vec<bool> {
        let lattice = &self.lattice;
        let chunks = self.soup.triangles.chunks(TASK);
        let found = parallel::map(chunks, |_, triangles| {
            let mut found = Vec::new();
            for triangle in triangles {
                let corners = triangle.map(|corner| lattice.coordinates(to_f64(self.surface.points[corner as usize])));
                lattice.touched(&corners, &mut found);
                found.extend(corners.map(|corner| lattice.tet_at(corner)));
            }
            found.sort_unstable();
            found.dedup();
            found
        });
        let mut touched = vec![false; lattice.tets() as usize];
        found.iter().flatten().for_each(|tet| touched[*tet as usize] = true);
        touched
    }

    /// For each lattice point, the lowest one on the same side of the surface, connected along tets that no triangle
    /// touches. Where the surface is open, sides are not separated, so each point stands for itself.
    fn groups(&self, touched: &[bool]) -> Vec<u32> {
        let mut parent: Vec<u32> = (0..self.lattice.points()).collect();
        if !self.soup.closed {
            return parent;
        }
        fn root(parent: &mut [u32], mut at: u32) -> u32 {
            while parent[at as usize] != at {
                parent[at as usize] = parent[parent[at as usize] as usize];
                at = parent[at as usize];
            }
            at
        }
        for tet in (0..self.lattice.tets()).filter(|tet| self.lattice.exists(*tet) && !touched[*tet as usize]) {
            let [first, others @ ..] = self.lattice.corners(tet);
            for other in others {
                let [a, b] = [first, other].map(|point| root(&mut parent, point));
                parent[a.max(b) as usize] = a.min(b);
            }
        }
        (0..self.lattice.points()).map(|point| root(&mut parent, point)).collect()
    }

    /// The winding number of each group, by its lowest point; 0 for other points.
    fn group_windings(&self, groups: &[u32], angles: &SolidAngles) -> Vec<f32> {
        parallel::tabulate(groups.len(), TASK, |point| {
            let own = groups[point] == point as u32 && self.lattice.is_near(point as u32);
            if own { angles.winding(self.lattice.position(point as u32)) as f32 } else { 0.0 }
        })
    }

    /// The share of each of the kept tets that is inside: 1 unless a triangle touches it, else where the signed distance
    /// from the triangles is below 0, linear between the tet's corners.
    fn shares(&self, kept: &[(u32, bool)], angles: &SolidAngles) -> Vec<f32> {
        /// Least distance, in half sides, so that no edge has both ends on the surface.
        const APART: f64 = 1e-9;
        let cut = || kept.iter().filter(|(_, cut)| *cut).map(|(tet, _)| *tet);
        let mut corners: Vec<u32> = cut().flat_map(|tet| self.lattice.corners(tet)).collect();
        corners.sort_unstable();
        corners.dedup();
        let coordinates = |p: DVec3| to_f32(self.lattice.coordinates(p));
        let points: Vec<Vec3> = self.surface.points.iter().map(|p| coordinates(to_f64(*p))).collect();
        let tree = TriangleTree::build(&points, &self.soup.triangles);
        let distances = parallel::tabulate(corners.len(), TASK, |k| {
            let at = self.lattice.position(corners[k]);
            let found = tree.closest(coordinates(at), f32::INFINITY);
            let distance = found.map_or(f64::INFINITY, |found| f64::from(found.distance)).max(APART);
            if inside(angles.winding(at) as f32) { -distance } else { distance }
        });
        let row = |point: u32| corners.partition_point(|corner| *corner < point);
        let share = |(tet, cut): &(u32, bool)| {
            if *cut {
                negative_share(self.lattice.corners(*tet).map(|point| distances[row(point)])) as f32
            } else {
                1.0
            }
        };
        kept.iter().map(share).collect()
    }

    /// The cage of the kept tets.
    fn assemble(&self, kept: &[(u32, bool)], shares: &[f32], around: f64) -> Cage {
        let lattice = &self.lattice;
        let mut used: Vec<u32> = kept.iter().flat_map(|(tet, _)| lattice.corners(*tet)).collect();
        used.sort_unstable();
        used.dedup();
        let row = |point: u32| used.partition_point(|other| *other < point) as u32;
        let tets: Vec<[u32; 4]> = kept.iter().map(|(tet, _)| lattice.corners(*tet).map(row)).collect();
        let points: Vec<[f32; 3]> = used
            .iter()
            .map(|point| {
                let p = lattice.position(*point);
                [p.x as f32, p.y as f32, p.z as f32]
            })
            .collect();
        let (bodies, count) = connected(points.len(), &tets);
        let unit = lattice.half_side();
        let at = |corner: u32| to_f64(points[corner as usize]) / unit;
        let measures = parallel::tabulate(tets.len(), TASK, |tet| measure(&tets[tet].map(at)));
        let slivers: Vec<bool> = measures.iter().map(|tet| !(tet.volume > 0.0 && tet.quality >= SLIVER)).collect();
        let volume = measures.iter().zip(shares).map(|(tet, share)| tet.volume * f64::from(*share)).sum::<f64>();
        let sharpest = measures.iter().zip(&slivers).filter(|(_, sliver)| !**sliver);
        let sharpest = sharpest.map(|(tet, _)| tet.sharpest).fold(-1.0, f64::max);
        let measured = FillQuality {
            min_dihedral: if sharpest > -1.0 { libm::acos(sharpest) } else { 0.0 },
            quality_median: median(measures.iter().map(|tet| tet.quality).collect()),
            volume_error: if around > 0.0 { (volume - around).abs() / around } else { 0.0 },
            slivers: slivers.iter().filter(|sliver| **sliver).count(),
            ..FillQuality::default()
        };
        let sides = shell_sides(&tets, &points);
        let fill = shares.iter().map(|share| share.max(LEAST_FILL)).collect();
        Cage { tets: TetMesh { points, sides, tets, bodies, slivers, measured }, fill, bodies: count }
    }

    /// The volume around which the faces of a closed surface run, in cubed half sides, counted as often as they do.
    fn enclosed(&self) -> f64 {
        let Some([first, ..]) = self.soup.triangles.first() else { return 0.0 };
        let unit = self.lattice.half_side();
        let origin = to_f64(self.surface.points[*first as usize]);
        let six = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|corner| (to_f64(self.surface.points[corner as usize]) - origin) / unit);
            a.dot(&b.cross(&c))
        };
        self.soup.triangles.iter().map(six).sum::<f64>() / 6.0
    }
}

/// Whether a winding number is that of a point inside. Pieces may face either way.
fn inside(winding: f32) -> bool {
    winding.abs() >= 0.5
}

/// The share of a tet in which a linear function is negative, from its values at the corners, none of which is 0.
fn negative_share(mut values: [f64; 4]) -> f64 {
    values.sort_by(f64::total_cmp);
    let [a, b, c, d] = values;
    // Where the function is 0 along the edge between two corners, from the first.
    let zero = |from: f64, to: f64| from / (from - to);
    match values.iter().filter(|value| **value < 0.0).count() {
        0 => 0.0,
        1 => zero(a, b) * zero(a, c) * zero(a, d),
        2 => {
            // Three tets of the wedge between the edges from a and b that cross 0.
            let [ac, ad, bc, bd] = [zero(a, c), zero(a, d), zero(b, c), zero(b, d)];
            ac * ad * (1.0 - bd) + ac * bd * (1.0 - bc) + bc * bd
        }
        3 => 1.0 - zero(d, a) * zero(d, b) * zero(d, c),
        _ => 1.0,
    }
}

/// Mean length of the triangles' sides, metres.
fn mean_edge(surface: &PolygonSurface, soup: &Soup) -> f64 {
    let at = |corner: u32| to_f64(surface.points[corner as usize]);
    let sides = |[a, b, c]: &[u32; 3]| (at(*a) - at(*b)).norm() + (at(*b) - at(*c)).norm() + (at(*c) - at(*a)).norm();
    soup.triangles.iter().map(sides).sum::<f64>() / (3 * soup.triangles.len().max(1)) as f64
}

/// The connected body of each tet, numbered by first tets, and their number.
fn connected(points: usize, tets: &[[u32; 4]]) -> (Vec<u32>, usize) {
    let mut pieces = SignedUnionFind::new(points);
    for [first, others @ ..] in tets {
        others.iter().for_each(|other| pieces.join(*first, *other, false).unwrap_or(()));
    }
    let (mut number, mut count) = (vec![u32::MAX; points], 0);
    let bodies = tets.iter().map(|tet| {
        let number = &mut number[pieces.root(tet[0]).0 as usize];
        if *number == u32::MAX {
            *number = count;
            count += 1;
        }
        *number
    });
    (bodies.collect(), count as usize)
}

/// The kind of shell that each point is on: connected pieces of the boundary that surround a negative volume are walls
/// of cavities.
fn shell_sides(tets: &[[u32; 4]], points: &[[f32; 3]]) -> Vec<ShellSide> {
    let faces = boundary(tets, points);
    let mut pieces = SignedUnionFind::new(points.len());
    for face in &faces {
        let [a, b, c] = face.corners;
        [b, c].iter().for_each(|other| pieces.join(a, *other, false).unwrap_or(()));
    }
    let mut volumes = vec![0.0; points.len()];
    for face in &faces {
        let root = pieces.root(face.corners[0]).0;
        let origin = to_f64(points[root as usize]);
        let [a, b, c] = face.corners.map(|corner| to_f64(points[corner as usize]) - origin);
        volumes[root as usize] += a.dot(&b.cross(&c));
    }
    let mut sides = vec![ShellSide::Interior; points.len()];
    for corner in faces.iter().flat_map(|face| face.corners) {
        let inner = volumes[pieces.root(corner).0 as usize] < 0.0;
        sides[corner as usize] = if inner { ShellSide::Inner } else { ShellSide::Outer };
    }
    sides
}

#[cfg(test)]
mod tests {
    use super::negative_share;

    #[test]
    fn a_linear_function_is_negative_in_the_share_that_a_plane_cuts_off() {
        assert_eq!(negative_share([1.0, 2.0, 3.0, 0.5]), 0.0);
        assert_eq!(negative_share([-1.0, -2.0, -3.0, -0.5]), 1.0);
        assert_eq!(negative_share([1.0, -1.0, 1.0, 1.0]), 0.125, "a corner of half the size");
        assert_eq!(negative_share([-1.0, -1.0, 3.0, -1.0]), 1.0 - 0.75 * 0.75 * 0.75);
        assert_eq!(negative_share([-1.0, 1.0, 1.0, -1.0]), 0.5, "halfway between two edges");
        // x < 0.3 in the tet of the origin and the unit vectors: 1 − 0.7³; y + z < 0.5: 3·0.5² − 2·0.5³.
        assert!((negative_share([-0.3, 0.7, -0.3, -0.3]) - (1.0 - 0.343)).abs() < 1e-15);
        assert!((negative_share([-0.5, -0.5, 0.5, 0.5]) - 0.5).abs() < 1e-15);
        assert!((negative_share([-0.25, -0.25, 0.75, 0.75]) - (3.0 * 0.0625 - 2.0 / 64.0)).abs() < 1e-15);
    }
}
