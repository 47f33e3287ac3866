//! Bodies at rest in the node's output, compared with the equilibrium of the same springs.

use super::*;
use crate::scene::Scene;

/// x with A·x = b, by elimination with the largest pivot.
fn solve(mut a: Vec<Vec<f64>>, mut b: Vec<f64>) -> Vec<f64> {
    let count = b.len();
    for k in 0..count {
        let pivot = (k..count).max_by(|i, j| a[*i][k].abs().total_cmp(&a[*j][k].abs())).unwrap();
        a.swap(k, pivot);
        b.swap(k, pivot);
        let (above, below) = a.split_at_mut(k + 1);
        for (i, row) in below.iter_mut().enumerate().filter(|(_, row)| row[k] != 0.0) {
            let share = row[k] / above[k][k];
            row[k..].iter_mut().zip(&above[k][k..]).for_each(|(x, y)| *x -= share * y);
            b[k + 1 + i] -= share * b[k];
        }
    }
    for k in (0..count).rev() {
        let known: f64 = (k + 1..count).map(|j| a[k][j] * b[j]).sum();
        b[k] = (b[k] - known) / a[k][k];
    }
    b
}

/// The equilibrium of weight and springs, by Newton's method from a nearby state; given each particle's weight and the
/// particles that are held.
fn balance(springs: &[shapes::Spring], weights: &[V], held: &[bool], near: &[V]) -> Vec<V> {
    let free: Vec<usize> = (0..near.len()).filter(|i| !held[*i]).collect();
    let row = |i: usize| free.binary_search(&i).ok();
    let mut x = near.to_vec();
    for _ in 0..30 {
        let mut force: Vec<f64> = free.iter().flat_map(|i| weights[*i]).collect();
        let mut slope = vec![vec![0.0; force.len()]; force.len()];
        for spring in springs {
            let [a, b] = spring.ends;
            let way = plus_multiple(x[b], x[a], -1.0);
            let size = DVec3::from(way).norm();
            let n = way.map(|x| x / size);
            let (pull, k) = (spring.stiffness * (size - spring.length), spring.stiffness);
            let own = |p: usize, q: usize| {
                let across = if p == q { pull / size } else { 0.0 };
                across + (k - pull / size) * n[p] * n[q]
            };
            for (i, sign) in [(a, 1.0), (b, -1.0)] {
                let Some(i) = row(i) else { continue };
                (0..3).for_each(|p| force[3 * i + p] += sign * pull * n[p]);
                for (j, other) in [(a, 1.0), (b, -1.0)] {
                    let Some(j) = row(j) else { continue };
                    for p in 0..3 {
                        (0..3).for_each(|q| slope[3 * i + p][3 * j + q] += sign * other * own(p, q));
                    }
                }
            }
        }
        let step = solve(slope, force);
        for (i, place) in free.iter().enumerate() {
            x[*place] = plus_multiple(x[*place], [step[3 * i], step[3 * i + 1], step[3 * i + 2]], 1.0);
        }
        if largest(step.iter().map(|x| x.abs())) < 1e-12 {
            return x;
        }
    }
    panic!("the equilibrium was not found");
}

/// Distance of a beam of 1 m, held at one end, from the equilibrium of its springs, and the rounding of stored
/// positions.
fn cantilever() -> [f64; 2] {
    let beam = shapes::block([8, 2, 2], 0.125, [0.0; 3]);
    let root: Vec<[f32; 3]> = beam.positions().iter().filter(|p| p[0] == 0.0).copied().collect();
    let scene = Scene::of(beam.clone()).pins(1e-3, move |_| root.clone());
    let scene = scene.set("stiffness", 1e6).set("damping", 0.1).set("volume", 0);
    let cooked = scene.cook([400], 2);
    let found = cooked.last();
    let rest: Vec<V> = beam.positions().iter().map(|p| p.map(f64::from)).collect();
    let mut weights = vec![[0.0; 3]; rest.len()];
    for tet in beam.tet_corners() {
        let volume = crate::measure::volume(tet.map(|corner| rest[corner as usize])) / 6.0;
        tet.iter().for_each(|corner| weights[*corner as usize][1] -= 250.0 * volume * f64::from(9.81_f32));
    }
    let held: Vec<bool> = rest.iter().map(|p| p[0] == 0.0).collect();
    let exact = balance(&shapes::springs(&beam, 1e6), &weights, &held, &found);
    assert!(rest[8][1] - found[8][1] > 0.05, "it sags");
    let stored: Vec<[f32; 3]> = found.iter().map(|p| p.map(|x| x as f32)).collect();
    [largest(found.iter().zip(&exact).map(|(a, b)| distance(a, b))), storage(&stored)]
}

/// Effective modulus ÷ `stiffness` of a bar of 1 m² by 5 m, stretched by 1 %, with `cells` cells across.
fn modulus(cells: u32) -> f64 {
    const PULL: f32 = 0.05;
    let bar = shapes::block([5 * cells, cells, cells], 1.0 / f64::from(cells), [0.0; 3]);
    let end = |x: f32| -> Vec<usize> {
        (0..bar.point_count()).filter(|i| (bar.positions()[*i][0] - x).abs() < 1e-5).collect()
    };
    let (fixed, pulled) = (end(0.0), end(5.0));
    let places: Vec<[f32; 3]> = fixed.iter().chain(&pulled).map(|i| bar.positions()[*i]).collect();
    let pins = move |frame: engine::time::Frame| {
        let way = if frame.number() > 1.0 { PULL } else { 0.0 };
        places.iter().map(|[x, y, z]| [if *x > 1.0 { x + way } else { *x }, *y, *z]).collect()
    };
    let scene = Scene::of(bar.clone()).pins(1e-3, pins).set("gravity", "[0, 0, 0]").set("volume", 0);
    let cooked = scene.set("stiffness", 1e5).set("density", 100).set("damping", 0.05).cook([48], 2);
    let points = cooked.last();
    let middle = |x: f32| mean(&end(x).iter().map(|i| points[*i]).collect::<Vec<_>>())[0];
    // Away from the held ends; F = 2U ÷ Δ on 1 m².
    let strain = middle(3.0) - middle(2.0) - 1.0;
    2.0 * cooked.metric("elastic").last().unwrap() / f64::from(PULL) / strain / 1e5
}

pub(super) fn figures(effort: Effort) -> Vec<Figure> {
    let cells = effort.choose(&[4, 6][..], &[4, 6, 8, 10]);
    let moduli: Vec<f64> = cells.iter().map(|cells| modulus(*cells)).collect();
    let apart = largest(moduli.iter().flat_map(|a| moduli.iter().map(move |b| a / b - 1.0)));
    vec![
        Figure::stored("A beam at rest: distance from the equilibrium of its springs", [cantilever()], 1e-6, " L"),
        Figure::within(
            "effective modulus of a stretched bar ÷ `stiffness`, 4 to 10 cells across",
            &moduli,
            [0.88, 1.12],
        )
        .has_coarse_form(effort),
        Figure::error("its variation between those resolutions", apart, 3e-2, "").has_coarse_form(effort),
    ]
}
