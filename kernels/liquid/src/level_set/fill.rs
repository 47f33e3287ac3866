//! φ as a distance: |∇φ| = 1 in the band, by sweeps over all cells at once (Jacobi), upwind (Rouy and Tourin 1992).

use numerics::simd::{Path, kernel};
use numerics::vector::dot;

use super::BAND;
use crate::stencil::{Run, Stencil};

/// Distances grow from the surface by at most a cell a sweep along the axes, so at the corners of the band by 1/√3.
const SWEEPS: usize = 9;

/// Keeps |φ| ≤ 1 of active cells that a neighbour lies on the other side of, makes the other active ones distances. Signs
/// stay.
pub(super) fn fill(stencil: &Stencil, phi: &mut [f32]) {
    let path = Path::chosen();
    let mut least = vec![0.0; phi.len()];
    let mut distance = vec![BAND; phi.len()];
    stencil.update([&mut least, &mut distance], |runs, first, [least, distance]| {
        keep_interface(path, runs, first, phi, least, distance);
    });
    let mut next = distance.clone();
    for _ in 0..SWEEPS {
        stencil.update([&mut next], |runs, first, [next]| sweep(path, runs, first, &distance, &least, next));
        std::mem::swap(&mut distance, &mut next);
    }
    stencil.update([phi], |runs, first, [phi]| {
        for run in runs {
            for at in run.range() {
                phi[at - first] = distance[at].copysign(phi[at - first]);
            }
        }
    });
}

kernel! {
    /// Where the surface passes between a cell and a neighbour: its distance, which is also the least it may get.
    fn keep_interface(runs: &[Run], first: usize, phi: &[f32], least: &mut [f32], distance: &mut [f32]) =
        keep_interface_body;
}

#[inline(always)]
fn keep_interface_body(runs: &[Run], first: usize, phi: &[f32], least: &mut [f32], distance: &mut [f32]) {
    for run in runs {
        let [own, near @ ..] = Neighbours::of(phi, run).all();
        let out = run.at as usize - first..run.at as usize - first + own.len();
        let (least, distance) = (&mut least[out.clone()], &mut distance[out]);
        for n in 0..own.len() {
            let inside = own[n] < 0.0;
            let crossed = near.iter().fold(false, |crossed, near| crossed | ((near[n] < 0.0) != inside));
            let kept = own[n].abs().min(1.0);
            least[n] = if crossed { kept } else { 0.0 };
            distance[n] = if crossed { kept } else { BAND };
        }
    }
}

kernel! {
    fn sweep(runs: &[Run], first: usize, distance: &[f32], least: &[f32], next: &mut [f32]) = sweep_body;
}

#[inline(always)]
fn sweep_body(runs: &[Run], first: usize, distance: &[f32], least: &[f32], next: &mut [f32]) {
    for run in runs {
        let [own, x0, x1, y0, y1, z0, z1] = Neighbours::of(distance, run).all();
        let least = &least[run.range()];
        let next = &mut next[run.at as usize - first..run.at as usize - first + own.len()];
        for n in 0..own.len() {
            let upwind = eikonal(x0[n].min(x1[n]), y0[n].min(y1[n]), z0[n].min(z1[n]));
            next[n] = own[n].min(upwind.max(least[n]));
        }
    }
}

/// The distance at a cell of which the nearest neighbours along each axis have these.
#[inline(always)]
fn eikonal(x: f32, y: f32, z: f32) -> f32 {
    let (low, high) = (x.min(y), x.max(y));
    let (a, rest) = (low.min(z), low.max(z));
    let (b, c) = (rest.min(high), rest.max(high));
    let one = a + 1.0;
    let apart = b - a;
    let two = 0.5 * (a + b + (2.0 - apart * apart).max(0.0).sqrt());
    let sum = a + b + c;
    let three = (1.0 / 3.0) * (sum + (sum * sum - 3.0 * (dot([a, b, c], [a, b, c]) - 1.0)).max(0.0).sqrt());
    let fewer = if one <= b { one } else { two };
    if fewer <= c { fewer } else { three }
}

/// A run of cells and its neighbours in a field.
struct Neighbours<'a> {
    own: &'a [f32],
    x: [&'a [f32]; 2],
    y: [&'a [f32]; 2],
    z: [&'a [f32]; 2],
}

impl<'a> Neighbours<'a> {
    #[inline(always)]
    fn of(field: &'a [f32], run: &Run) -> Self {
        let from = |at: u32| &field[at as usize..at as usize + run.len as usize];
        let [y, z] = [run.y, run.z].map(|pair| pair.map(from));
        Self { own: from(run.at), x: [run.at - 1, run.at + 1].map(from), y, z }
    }

    /// The run, its neighbours along x, y and z: below and above.
    #[inline(always)]
    fn all(self) -> [&'a [f32]; 7] {
        let Self { own, x: [x0, x1], y: [y0, y1], z: [z0, z1] } = self;
        [own, x0, x1, y0, y1, z0, z1]
    }
}
