//! Where vertices lie, and their normals.

use numerics::vector::{Vec3, add, dot, scale, unit};

use super::cubes::{Cube, Cubes};
use super::table::{ends, table};
use crate::level_set::cubic::{Block, cubic};
use crate::level_set::{PhiView, RowBlocks};

/// Corner c of the cube in a [`Block`].
const CORNERS: [usize; 8] = [21, 22, 25, 26, 37, 38, 41, 42];

/// Points and normals of the vertices of a slab.
pub(super) fn vertices(view: PhiView<'_>, cubes: &Cubes, slab: usize, project: bool) -> Vec<(Vec3, Vec3)> {
    let z = cubes.low[1] + slab as i32;
    let mut out = Vec::with_capacity(cubes.slabs[slab].vertices.len());
    for (y, row) in cubes.rows(slab) {
        let mut blocks = RowBlocks::new(view, y, z);
        for cube in row {
            let corner = [cube.x, y, z].map(|n| n as f32 + 0.5);
            let walls = Walls::of(view, [cube.x, y, z]);
            if !walls.none() && walls.are_all(cube) {
                out.push((add(corner, [0.5; 3]), walls.outward()));
                continue;
            }
            let block = blocks.at(cube.x);
            let loops = table().loops[usize::from(cube.kind)];
            for edges in &loops.edges[..usize::from(loops.count)] {
                let crossings = Crossings::of(cube, &block, *edges, walls);
                let (at, normal) = crossings.vertex(&block, walls, project && loops.count == 1);
                out.push((add(corner, at), normal));
            }
        }
    }
    out
}

/// Through which of its axes a cube reaches out of the domain: −1 below, 1 above, 0 not.
#[derive(Clone, Copy)]
struct Walls([i32; 3]);

impl Walls {
    fn of(view: PhiView<'_>, cube: [i32; 3]) -> Self {
        Self(std::array::from_fn(|axis| {
            i32::from(cube[axis] + 1 == view.high[axis]) - i32::from(cube[axis] < view.low[axis])
        }))
    }

    fn none(self) -> bool {
        self.0 == [0; 3]
    }

    /// Whether all corners of a cube that are in the domain are inside, so that its surface is on walls alone.
    fn are_all(self, cube: &Cube) -> bool {
        let is_beyond = |corner: usize, axis: usize| self.0[axis] == 2 * (corner >> axis & 1) as i32 - 1;
        let is_in_domain = |corner: usize| (0..3).all(|axis| !is_beyond(corner, axis));
        (0..8).all(|corner| cube.inside(corner) == is_in_domain(corner))
    }

    /// The normal of a vertex on walls alone.
    fn outward(self) -> Vec3 {
        unit(self.0.map(|wall| wall as f32)).unwrap_or([0.0, 1.0, 0.0])
    }
}

/// What the crossings of a loop with the edges of a cube say of its vertex.
struct Crossings {
    /// Their mean, on walls where the cube reaches through them.
    mean: Vec3,
    /// The sum of the edges' directions, from inside to outside.
    outward: Vec3,
    /// Whether the loop crosses edges within the domain.
    free: bool,
}

impl Crossings {
    fn of(cube: &Cube, block: &Block, edges: u16, Walls(walls): Walls) -> Self {
        // Crossings within the domain, and those of walls.
        let (mut sums, mut counts, mut outward) = ([[0.0; 3]; 2], [0.0_f32; 2], [0.0; 3]);
        let mut rest = edges;
        while rest != 0 {
            let edge = rest.trailing_zeros() as usize;
            rest &= rest - 1;
            let ([a, b], axis) = (ends(edge), edge / 4);
            let (low, high) = (block[CORNERS[a]], block[CORNERS[b]]);
            let wall = walls[axis] != 0;
            let at = if wall { 0.5 } else { low / (low - high) };
            let mut point = [a & 1, a >> 1 & 1, a >> 2].map(|n| n as f32);
            point[axis] = at;
            let kind = usize::from(wall);
            sums[kind] = add(sums[kind], point);
            counts[kind] += 1.0;
            outward[axis] += if cube.inside(a) { 1.0 } else { -1.0 };
        }
        let free = counts[0] > 0.0;
        let kind = usize::from(!free);
        let mut mean = scale(sums[kind], 1.0 / counts[kind]);
        for axis in 0..3 {
            if walls[axis] != 0 {
                mean[axis] = 0.5;
            }
        }
        Self { mean, outward, free }
    }

    /// The place of the vertex in the cube and its normal; `project` moves it onto φ = 0.
    #[inline]
    fn vertex(&self, block: &Block, walls: Walls, project: bool) -> (Vec3, Vec3) {
        if !self.free {
            return (self.mean, walls.outward());
        }
        let at = if project { newton(block, self.mean, walls) } else { self.mean };
        let (_, gradient) = cubic(block, at);
        // Between two sheets closer than a cell the gradient may point the wrong way.
        let outward = if walls.none() { self.outward } else { gradient };
        let normal = unit(gradient).filter(|normal| dot(*normal, outward) > 0.0);
        (at, normal.or(unit(self.outward)).unwrap_or([0.0, 1.0, 0.0]))
    }
}

/// A longer step says that φ is too rough for its gradient to lead to its zero; taken all the same, quads cross each
/// other on white noise.
const LONGEST_STEP: f32 = 0.2;

/// One step of Newton's method along the gradient, kept in the cube and on its walls.
#[inline(always)]
fn newton(block: &Block, at: Vec3, Walls(walls): Walls) -> Vec3 {
    let (value, mut gradient) = cubic(block, at);
    for axis in 0..3 {
        if walls[axis] != 0 {
            gradient[axis] = 0.0;
        }
    }
    let square = dot(gradient, gradient);
    let step = value / square;
    let tame = square > 1e-4 && step * step * square < LONGEST_STEP * LONGEST_STEP;
    if !tame {
        return at;
    }
    std::array::from_fn(|axis| (at[axis] - step * gradient[axis]).clamp(0.0, 1.0))
}
