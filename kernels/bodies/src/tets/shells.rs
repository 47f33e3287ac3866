//! Shells: the closed components of a surface, their orientation and nesting, and the bodies they bound.

use super::grid::GridPoint;
use super::repair::{PolygonSide, Polygons, RepairCounts, SignedUnionFind};
use super::surface_fault::SurfaceFault;
use super::winding::Winding;
use numerics::parallel;
use numerics::triangulate::triangulate;

/// Polygons that a thread cuts at a time.
const TASK: usize = 256;

/// A closed component of the surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Shell {
    /// Number of shells that contain it. Even: outer boundary of a body; odd: wall of a cavity.
    pub(super) depth: u32,
    /// The body it bounds, numbered by first faces.
    pub(super) body: u32,
}

/// The surface as triangles that face away from the bodies.
#[derive(Clone, Debug, Default)]
pub(super) struct Shells {
    pub(super) triangles: Vec<[u32; 3]>,
    /// Polygon of each triangle.
    pub(super) polygons: Vec<u32>,
    /// Shell of each triangle.
    pub(super) shell_of: Vec<u32>,
    pub(super) all: Vec<Shell>,
    pub(super) bodies: usize,
}

/// The shell of each polygon, numbered by first faces, and whether the polygon is oriented opposite to the shell's
/// first.
///
/// # Errors
/// If an edge does not have two faces, or a shell is not orientable.
pub(super) fn pieces(polygons: &Polygons, safe: bool) -> Result<Vec<(u32, bool)>, SurfaceFault> {
    let sides = polygons.sides();
    let edges = || sides.chunk_by(|a, b| a.ends == b.ends);
    let face = |side: &PolygonSide| polygons.faces[side.polygon as usize];
    if let Some(crowded) = edges().find(|sides| sides.len() > 2) {
        let count = edges().filter(|sides| sides.len() > 2).count();
        return Err(SurfaceFault::NonManifoldEdge { points: crowded[0].ends, faces: crowded.len(), count });
    }
    if let Some(open) = edges().find(|sides| sides.len() < 2) {
        let count = edges().filter(|sides| sides.len() < 2).count();
        return Err(SurfaceFault::OpenEdge { points: open[0].ends, face: face(&open[0]), count });
    }
    let mut pieces = SignedUnionFind::new(polygons.len());
    let turned = |sides: &[PolygonSide]| sides[0].rises == sides[1].rises;
    for sides in edges() {
        if pieces.join(sides[0].polygon, sides[1].polygon, turned(sides)).is_err() {
            return Err(SurfaceFault::NonOrientable { face: polygons.faces[pieces.root(sides[0].polygon).0 as usize] });
        }
    }
    if let Some(pair) = edges().find(|sides| !safe && turned(sides)) {
        let count = edges().filter(|sides| turned(sides)).count();
        return Err(SurfaceFault::InconsistentOrientation { faces: [face(&pair[0]), face(&pair[1])], count });
    }
    let mut number = vec![u32::MAX; polygons.len()];
    let mut count = 0;
    let numbered = (0..polygons.len() as u32).map(|polygon| {
        let (root, turned) = pieces.root(polygon);
        let number = &mut number[root as usize];
        if *number == u32::MAX {
            *number = count;
            count += 1;
        }
        (*number, turned)
    });
    Ok(numbered.collect())
}

impl Shells {
    /// Triangulates the polygons and orients each shell away from its interior.
    ///
    /// # Errors
    /// If a shell has no volume.
    pub(super) fn outward(
        polygons: &Polygons,
        pieces: &mut [(u32, bool)],
        points: &[[f32; 3]],
        grid_points: &[GridPoint],
    ) -> Result<Self, SurfaceFault> {
        let cut = |polygon: usize| {
            let corners = polygons.get(polygon);
            let at: Vec<[f32; 3]> = corners.iter().map(|corner| points[*corner as usize]).collect();
            triangulate(&at).into_iter().map(move |ear| (ear.map(|k| corners[k as usize]), polygon as u32))
        };
        let cut = parallel::map((0..polygons.len()).step_by(TASK), |_, first| {
            (first..polygons.len().min(first + TASK)).flat_map(cut).collect::<Vec<_>>()
        });
        let (triangles, polygon_of): (Vec<_>, Vec<_>) = cut.into_iter().flatten().unzip();
        let count = pieces.iter().map(|(shell, _)| *shell as usize + 1).max().unwrap_or(0);
        let mut shells = Self {
            shell_of: polygon_of.iter().map(|polygon: &u32| pieces[*polygon as usize].0).collect(),
            triangles,
            polygons: polygon_of,
            all: vec![Shell { depth: 0, body: 0 }; count],
            bodies: 0,
        };
        shells.turn(pieces);
        let mut volumes = vec![0_i128; count];
        for (triangle, shell) in shells.triangles.iter().zip(&shells.shell_of) {
            volumes[*shell as usize] += wedge(triangle.map(|corner| grid_points[corner as usize]));
        }
        if let Some(flat) = volumes.iter().position(|volume| *volume == 0) {
            return Err(SurfaceFault::NoVolume { face: shells.first_face(flat, polygons) });
        }
        shells.turn_whole(pieces, |shell| volumes[shell as usize] < 0);
        Ok(shells)
    }

    fn first_face(&self, shell: usize, polygons: &Polygons) -> u32 {
        let first = self.shell_of.iter().position(|other| *other as usize == shell).expect("a shell has triangles");
        polygons.faces[self.polygons[first] as usize]
    }

    /// Flips the triangles of flipped polygons.
    fn turn(&mut self, pieces: &[(u32, bool)]) {
        for (triangle, polygon) in self.triangles.iter_mut().zip(&self.polygons) {
            if pieces[*polygon as usize].1 {
                triangle.swap(1, 2);
            }
        }
    }

    /// Flips whole shells, and notes that in `pieces`.
    fn turn_whole(&mut self, pieces: &mut [(u32, bool)], which: impl Fn(u32) -> bool) {
        for (triangle, shell) in self.triangles.iter_mut().zip(&self.shell_of) {
            if which(*shell) {
                triangle.swap(1, 2);
            }
        }
        pieces.iter_mut().filter(|(shell, _)| which(*shell)).for_each(|(_, turned)| *turned = !*turned);
    }

    /// Determines the nesting of shells and flips the walls of cavities to face away from the body they bound.
    pub(super) fn nest(&mut self, pieces: &mut [(u32, bool)], grid_points: &[GridPoint]) {
        let within = self.within(grid_points);
        for (shell, others) in self.all.iter_mut().zip(&within) {
            shell.depth = others.len() as u32;
        }
        // The wall of a cavity bounds the body of the deepest shell around it; shells of equal depth that share a
        // point bound the same body.
        let mut bodies = SignedUnionFind::new(self.all.len());
        let depth = |shell: u32| within[shell as usize].len();
        for (shell, others) in within.iter().enumerate().filter(|(_, others)| others.len() % 2 == 1) {
            let around = others.iter().find(|other| depth(**other) + 1 == others.len());
            around.inspect(|around| bodies.join(shell as u32, **around, false).unwrap_or(()));
        }
        let mut shell_at = vec![u32::MAX; grid_points.len()];
        for (triangle, shell) in self.triangles.iter().zip(&self.shell_of) {
            for corner in triangle {
                let other = std::mem::replace(&mut shell_at[*corner as usize], *shell);
                if other != u32::MAX && depth(other) == depth(*shell) {
                    bodies.join(other, *shell, false).unwrap_or(());
                }
            }
        }
        let mut number = vec![u32::MAX; self.all.len()];
        for shell in 0..self.all.len() {
            let number = &mut number[bodies.root(shell as u32).0 as usize];
            if *number == u32::MAX {
                *number = self.bodies as u32;
                self.bodies += 1;
            }
            self.all[shell].body = *number;
        }
        self.turn_whole(pieces, |shell| depth(shell) % 2 == 1);
    }

    /// The shells that contain each shell: those that contain most of a sample of its triangles' centroids.
    fn within(&self, grid_points: &[GridPoint]) -> Vec<Vec<u32>> {
        const SAMPLES: usize = 31;
        if self.all.len() < 2 {
            return vec![Vec::new(); self.all.len()];
        }
        let mut of_shell = vec![Vec::new(); self.all.len()];
        for (triangle, shell) in self.shell_of.iter().enumerate() {
            of_shell[*shell as usize].push(triangle as u32);
        }
        let winding = Winding::new(grid_points, &self.triangles, &self.shell_of);
        parallel::map(&of_shell, |shell, members| {
            let (mut found, mut tally) = (Vec::new(), Vec::new());
            let stride = members.len().div_ceil(SAMPLES);
            let samples = members.iter().step_by(stride);
            let taken = samples.len();
            for member in samples {
                let corners =
                    self.triangles[*member as usize].map(|corner| grid_points[corner as usize].map(i64::from));
                let sum = [0, 1, 2].map(|k| corners[0][k] + corners[1][k] + corners[2][k]);
                winding.around(sum, 3, &mut tally);
                found.extend(tally.iter().map(|(other, _)| *other).filter(|other| *other as usize != shell));
            }
            found.sort_unstable();
            let most = found.chunk_by(|a, b| a == b).filter(|same| 2 * same.len() > taken);
            most.map(|same| same[0]).collect()
        })
    }

    /// The shell of each point; `u32::MAX` for points without a triangle.
    pub(super) fn of_points(&self, points: usize) -> Vec<u32> {
        let mut of = vec![u32::MAX; points];
        for (triangle, shell) in self.triangles.iter().zip(&self.shell_of) {
            triangle.iter().for_each(|corner| of[*corner as usize] = of[*corner as usize].min(*shell));
        }
        of
    }
}

/// Six times the volume between a triangle and the grid's origin.
fn wedge(corners: [GridPoint; 3]) -> i128 {
    let [a, b, c] = corners.map(|corner| corner.map(i64::from));
    let term = |i: usize, j: usize, k: usize| i128::from(a[i]) * i128::from(b[j] * c[k] - b[k] * c[j]);
    term(0, 1, 2) + term(1, 2, 0) + term(2, 0, 1)
}

/// Counts flipped faces; if flipping is not allowed, returns the first shell that needs it as a fault.
pub(super) fn turned(
    polygons: &Polygons,
    pieces: &[(u32, bool)],
    shells: &Shells,
    safe: bool,
    changes: &mut RepairCounts,
) -> Result<(), SurfaceFault> {
    changes.turned_faces = pieces.iter().filter(|(_, turned)| *turned).count();
    let Some(first) = pieces.iter().position(|(_, turned)| *turned).filter(|_| !safe) else { return Ok(()) };
    let mut wrong: Vec<u32> = pieces.iter().filter(|(_, turned)| *turned).map(|(shell, _)| *shell).collect();
    wrong.dedup();
    wrong.sort_unstable();
    wrong.dedup();
    let cavity = shells.all[pieces[first].0 as usize].depth % 2 == 1;
    Err(SurfaceFault::InsideOut { face: polygons.faces[first], cavity, count: wrong.len() })
}
