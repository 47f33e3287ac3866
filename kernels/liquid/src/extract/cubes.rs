//! The cubes that the surface passes through, found from where rows of cells go in and out of the liquid.

use std::cmp::{max, min};
use std::ops::Range;

use numerics::parallel;

use super::table::table;
use crate::level_set::PhiView;

/// A cube with corners inside and corners outside.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Cube {
    pub(super) x: i32,
    /// Its row of the table of loops: a bit for each corner inside, and 256 if its ambiguous face is flipped.
    pub(super) kind: u16,
    /// The vertex of its first loop.
    pub(super) vertex: u32,
}

impl Cube {
    /// Whether a corner is inside.
    pub(super) fn inside(&self, corner: usize) -> bool {
        self.kind >> corner & 1 == 1
    }
}

/// The cubes of one z, by y and then x.
#[derive(Clone, Debug, Default)]
pub(super) struct Slab {
    /// Where the cubes of each y start; then the number of all.
    first: Vec<u32>,
    cubes: Vec<Cube>,
    /// Its vertices.
    pub(super) vertices: Range<u32>,
}

/// All cubes that the surface passes through.
#[derive(Clone, Debug, Default)]
pub(super) struct Cubes {
    /// y and z of the first row.
    pub(super) low: [i32; 2],
    pub(super) slabs: Vec<Slab>,
}

impl Slab {
    fn row(&self, y: usize) -> &[Cube] {
        &self.cubes[self.first[y] as usize..self.first[y + 1] as usize]
    }
}

impl Cubes {
    /// Finds them and numbers their vertices.
    pub(super) fn find(view: PhiView<'_>) -> Self {
        let Some((low, high)) = view.rows.bounds() else { return Self::default() };
        let low = [1, 2].map(|axis| max(low[axis], view.low[axis]) - 1);
        let high = [1, 2].map(|axis| min(high[axis], view.high[axis]) + 1);
        if low[0] >= high[0] || low[1] >= high[1] {
            return Self::default();
        }
        let layers: Vec<Layer> = parallel::map(low[1]..high[1], |_, z| Layer::new(view, [low[0], high[0]], z));
        let slabs = parallel::map(layers.windows(2), |_, layers| Slab::between(layers));
        let mut cubes = Self { low, slabs };
        cubes.flip();
        cubes.number();
        cubes
    }

    /// The cubes of a row; none beyond the cubes.
    pub(super) fn row(&self, y: i32, z: i32) -> &[Cube] {
        let [j, k] = [y - self.low[0], z - self.low[1]];
        match self.slabs.get(k as usize) {
            Some(slab) if j >= 0 && (j as usize) + 1 < slab.first.len() => slab.row(j as usize),
            _ => &[],
        }
    }

    /// The rows of a slab that hold cubes: y and cubes.
    pub(super) fn rows(&self, slab: usize) -> impl Iterator<Item = (i32, &[Cube])> {
        let slab = &self.slabs[slab];
        let rows = (0..slab.first.len() - 1).map(|y| (self.low[0] + y as i32, slab.row(y)));
        rows.filter(|(_, cubes)| !cubes.is_empty())
    }

    fn kind(&self, [x, y, z]: [i32; 3]) -> u16 {
        let row = self.row(y, z);
        row.binary_search_by_key(&x, |cube| cube.x).map_or(0, |at| row[at].kind)
    }

    /// Flips the faces that both of their cubes are to flip.
    fn flip(&mut self) {
        let table = table();
        let to_flip = |slab: usize| {
            let mut found = Vec::new();
            for (y, cubes) in self.rows(slab) {
                for (at, cube) in cubes.iter().enumerate() {
                    let Some(face) = table.flip[usize::from(cube.kind)] else { continue };
                    let mut across = [cube.x, y, self.low[1] + slab as i32];
                    across[usize::from(face / 2)] += 2 * i32::from(face % 2) - 1;
                    if table.flip[usize::from(self.kind(across))] == Some(face ^ 1) {
                        found.push(self.slabs[slab].first[(y - self.low[0]) as usize] as usize + at);
                    }
                }
            }
            found
        };
        let flipped: Vec<Vec<usize>> = parallel::map(0..self.slabs.len(), |_, slab| to_flip(slab));
        for (slab, flipped) in self.slabs.iter_mut().zip(flipped) {
            flipped.into_iter().for_each(|cube| slab.cubes[cube].kind |= 256);
        }
    }

    fn number(&mut self) {
        let table = table();
        parallel::for_each(&mut self.slabs, |_, slab| {
            let mut next = 0;
            for cube in &mut slab.cubes {
                cube.vertex = next;
                next += u32::from(table.loops[usize::from(cube.kind)].count);
            }
            slab.vertices = 0..next;
        });
        let mut first = 0_u32;
        for slab in &mut self.slabs {
            let end = first.checked_add(slab.vertices.end).expect("more vertices than a u32 counts");
            slab.vertices = first..end;
            first = end;
        }
        parallel::for_each(&mut self.slabs, |_, slab| {
            slab.cubes.iter_mut().for_each(|cube| cube.vertex += slab.vertices.start);
        });
    }
}

/// Where the rows of one z go in and out of the liquid: at even places of a row's list in, at odd ones out.
struct Layer {
    first: Vec<u32>,
    turns: Vec<i32>,
}

impl Layer {
    fn new(view: PhiView<'_>, [low, high]: [i32; 2], z: i32) -> Self {
        let mut layer = Self { first: vec![0], turns: Vec::new() };
        let beyond = |y: i32| y < view.low[1] || y >= view.high[1] || z < view.low[2] || z >= view.high[2];
        for y in low..high {
            let spans = if beyond(y) { &[] } else { view.rows.row(y, z) };
            for span in spans {
                let (start, end) = (max(span.start, view.low[0]), min(span.end, view.high[0]));
                if start < end {
                    push_turns(
                        start,
                        &view.phi[span.at(start)..span.at(start) + (end - start) as usize],
                        &mut layer.turns,
                    );
                }
            }
            layer.first.push(layer.turns.len() as u32);
        }
        layer
    }

    fn row(&self, y: usize) -> &[i32] {
        &self.turns[self.first[y] as usize..self.first[y + 1] as usize]
    }
}

/// Appends where the values of neighbouring cells from `start` go in and out.
fn push_turns(start: i32, phi: &[f32], turns: &mut Vec<i32>) {
    let mut inside = false;
    for (number, sixteen) in phi.chunks(16).enumerate() {
        // Counted without branches: most of the cells are far from the surface.
        let below = sixteen.iter().map(|phi| u32::from(*phi < 0.0)).sum::<u32>() as usize;
        if below == if inside { sixteen.len() } else { 0 } {
            continue;
        }
        for (n, phi) in sixteen.iter().enumerate() {
            if (*phi < 0.0) != inside {
                inside = !inside;
                turns.push(start + (16 * number + n) as i32);
            }
        }
    }
    if inside {
        turns.push(start + phi.len() as i32);
    }
}

impl Slab {
    /// The cubes between two layers.
    fn between(layers: &[Layer]) -> Self {
        let [below, above] = layers else { return Self::default() };
        let mut slab = Self { first: vec![0], ..Self::default() };
        for y in 0..below.first.len() - 2 {
            push_cubes([below.row(y), below.row(y + 1), above.row(y), above.row(y + 1)], &mut slab.cubes);
            slab.first.push(slab.cubes.len() as u32);
        }
        slab
    }
}

/// Appends the cubes of a row between four rows of cells.
fn push_cubes(mut turns: [&[i32]; 4], cubes: &mut Vec<Cube>) {
    // Bit r: row r is inside at `x`.
    let mut inside = 0_usize;
    let mut x = i32::MIN;
    loop {
        let next = turns.iter().filter_map(|turns| turns.first()).fold(i32::MAX, |next, turn| min(next, *turn));
        if next == i32::MAX {
            return;
        }
        if inside != 0 && inside != 15 {
            cubes.extend((x..next - 1).map(|x| cube(x, inside, inside)));
        }
        let before = inside;
        for (row, turns) in turns.iter_mut().enumerate() {
            while let [first, rest @ ..] = *turns
                && *first == next
            {
                inside ^= 1 << row;
                *turns = rest;
            }
        }
        cubes.push(cube(next - 1, before, inside));
        x = next;
    }
}

/// The cube between rows that are inside at `x` where `low` has a bit, and at x + 1 where `high` has.
fn cube(x: i32, low: usize, high: usize) -> Cube {
    const SPREAD: [u16; 16] = [0, 1, 4, 5, 16, 17, 20, 21, 64, 65, 68, 69, 80, 81, 84, 85];
    Cube { x, kind: SPREAD[low] | SPREAD[high] << 1, vertex: 0 }
}
