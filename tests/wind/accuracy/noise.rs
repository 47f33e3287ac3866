//! Noise, by statistics over many cells.

use numerics::noise::{Field, NoiseKind};
use numerics::random::Key;
use numerics::vector::DVec3;

use super::Figure;
use crate::cooked::cook;

const POINTS: u64 = 40_000;

/// The mean of each number in `of` over many random points.
fn average<const N: usize>(of: impl Fn([f64; 3]) -> [f64; N]) -> [f64; N] {
    let mut sums = [0.0; N];
    for i in 0..POINTS {
        let point = [0, 1, 2].map(|axis| Key::new(99).of(i).of(axis).f64() * 1_000.0 - 500.0);
        sums.iter_mut().zip(of(point)).for_each(|(sum, x)| *sum += x);
    }
    sums.map(|sum| sum / POINTS as f64)
}

/// Mean and rms of each component, and the largest correlation between any two of them, here and 2 cells apart and
/// more.
fn statistics(kind: NoiseKind) -> ([f64; 3], [f64; 3], f64) {
    let field = Field::new(kind, 1, 0.5, 3);
    let at = |p: [f64; 3]| field.at(p).map(f64::from);
    let mean = average(at);
    let rms = average(|p| at(p).map(|x| x * x)).map(f64::sqrt);
    let mut most = 0.0_f64;
    for away in [[0.0; 3], [2.0, 0.0, 0.0], [0.0, 2.5, 0.0], [0.0, 0.0, 3.0], [4.0, 4.0, -4.0]] {
        let products: [f64; 9] = average(|p| {
            let (here, there) = (at(p), at((DVec3::from(p) + DVec3::from(away)).into()));
            std::array::from_fn(|pair| here[pair / 3] * there[pair % 3])
        });
        for (pair, product) in products.iter().enumerate() {
            let (a, b) = (pair / 3, pair % 3);
            if a != b || away != [0.0; 3] {
                most = most.max((product / (rms[a] * rms[b])).abs());
            }
        }
    }
    (mean, rms, most)
}

/// The order at which the jump of the second derivative across faces of cells falls with the step: 1 if it is
/// continuous, 0 if it jumps.
fn smoothness(kind: NoiseKind) -> f64 {
    let field = Field::new(kind, 1, 0.5, 8);
    let jump = |step: f64| {
        let over = |i: u64| {
            let across = [1, 2].map(|axis| Key::new(4).of(i).of(axis).f64() * 30.0);
            let at = |x: f64| f64::from(field.at([i as f64 + x * step, across[0], across[1]])[0]);
            (at(1.5) - 3.0 * at(0.5) + 3.0 * at(-0.5) - at(-1.5)).abs() / (step * step)
        };
        (0..2000).map(over).sum::<f64>()
    };
    libm::log2(jump(0.04) / jump(0.01)) / 2.0
}

/// Cells along a side of wavelet noise's period.
const SIDE: usize = 64;

/// Cook & DeRose 2005, appendix: the downsampling filter, from its middle outwards.
const HALVING: [f64; 16] = [
    0.655_340, 0.033_979, -0.243_780, -0.025_936, 0.103_311, 0.011_655, -0.044_412, -0.005_040, 0.019_120, 0.002_172,
    -0.008_233, -0.000_938, 0.003_546, 0.000_410, -0.001_528, 0.000_334,
];

fn each_line(values: &mut [f64], change: impl Fn(&[f64]) -> Vec<f64>) {
    for stride in [1, SIDE, SIDE * SIDE] {
        for start in (0..values.len()).filter(|start| (start / stride).is_multiple_of(SIDE)) {
            let line: Vec<f64> = (0..SIDE).map(|i| values[start + i * stride]).collect();
            for (i, value) in change(&line).into_iter().enumerate() {
                values[start + i * stride] = value;
            }
        }
    }
}

/// The fraction of wavelet noise's energy that remains after downsampling and upsampling (Cook & DeRose 2005, section
/// 3).
fn left_after_halving() -> f64 {
    let field = Field::new(NoiseKind::Wavelet, 1, 0.5, 3);
    let cell = |i: usize| [i % SIDE, i / SIDE % SIDE, i / (SIDE * SIDE)].map(|x| x as f64);
    let mut values: Vec<f64> = (0..SIDE * SIDE * SIDE).map(|i| f64::from(field.at(cell(i))[0])).collect();
    // At its lattice points the noise is its coefficients filtered by (1, 6, 1)/8 along each axis, which is inverted
    // here.
    each_line(&mut values, |line| {
        let mut solved = line.to_vec();
        for _ in 0..15 {
            let near = |i: usize| solved[(i + 1) % SIDE] + solved[(i + SIDE - 1) % SIDE];
            solved = (0..SIDE).map(|i| (line[i] - 0.125 * near(i)) / 0.75).collect();
        }
        solved
    });
    let energy = |values: &[f64]| values.iter().map(|x| x * x).sum::<f64>();
    let before = energy(&values);
    each_line(&mut values, |line| {
        let tap = |i: usize, k: usize| HALVING[k] * (line[(2 * i + SIDE - k) % SIDE] + line[(2 * i + 1 + k) % SIDE]);
        let coarse: Vec<f64> = (0..SIDE / 2).map(|i| (0..HALVING.len()).map(|k| tap(i, k)).sum()).collect();
        let beside = |i: usize| coarse[(i / 2 + if i.is_multiple_of(2) { SIDE / 2 - 1 } else { 1 }) % (SIDE / 2)];
        (0..SIDE).map(|i| 0.75 * coarse[i / 2] + 0.25 * beside(i)).collect()
    });
    energy(&values) / before
}

/// Difference between the shapes of curves and of those 2 m upwind a second earlier, with a scroll of 2 m/s.
fn scroll_error() -> f64 {
    let roots = (0..40).map(|i| (f64::from(i % 8), 0.37 * f64::from(i / 8)));
    let points: Vec<String> = roots.map(|(x, z)| format!("[{x}, 0, {z}], [{x}, 0.5, {z}], [{x}, 1, {z}]")).collect();
    let counts = vec!["3"; points.len()].join(", ");
    let nodes = format!(
        r#""fur": {{ "type": "Curve_In", "params": {{ "points": [{}], "counts": [{counts}] }} }},
           "wind": {{ "type": "Curve_Wind", "inputs": {{ "curves": "fur" }}, "params": {{ "scroll": 2 }} }}"#,
        points.join(", ")
    );
    let frames = cook(&nodes, &["wind"], 25).remove(0);
    let shape = |frame: usize, curve: usize, k: usize| {
        let cvs = &frames[frame].curves().unwrap().positions()[3 * curve..3 * curve + 3];
        (0..3).map(|d| f64::from(cvs[k][d]) - f64::from(cvs[0][d])).collect::<Vec<_>>()
    };
    let mut worst = 0.0_f64;
    for curve in (0..40).filter(|curve| curve % 8 < 6) {
        for k in 1..3 {
            let pairs = shape(0, curve, k).into_iter().zip(shape(24, curve + 2, k));
            worst = pairs.map(|(a, b)| (a - b).abs()).fold(worst, f64::max);
        }
    }
    worst
}

pub(super) fn figures() -> Vec<Figure> {
    let lattice = Field::new(NoiseKind::Perlin, 6, 0.7, 8);
    let cells = (-500..500).map(|i| [f64::from(i), f64::from(3 * i), f64::from(1_000_000 - i)]);
    let on_lattice = cells.flat_map(|cell| lattice.at(cell)).fold(0.0_f32, |most, x| most.max(x.abs()));
    let gradient = [NoiseKind::Perlin, NoiseKind::Billow].map(statistics);
    let means = gradient.iter().flat_map(|(mean, _, _)| mean).fold(0.0_f64, |most, x| most.max(x.abs()));
    let rms: Vec<f64> = gradient.iter().flat_map(|(_, rms, _)| *rms).collect();
    let alike = gradient.iter().map(|(_, _, most)| *most).fold(0.0, f64::max);
    vec![
        Figure::error("gradient noise at its lattice points, 6 octaves: largest value", f64::from(on_lattice), 0.0, ""),
        Figure::error("gradient and billow noise: mean", means, 1e-2, ""),
        Figure::within("their rms", &rms, [0.15, 0.4]),
        Figure::error("their correlation between components, and at distances of 2 cells and more", alike, 5e-2, ""),
        Figure::within(
            "gradient noise is C²: order at which jumps of its second derivative between cells vanish",
            &[smoothness(NoiseKind::Perlin)],
            [0.9, 1.1],
        ),
        Figure::error(
            "it scrolls downwind at 2 m/s: difference from curves 2 m upwind a second earlier",
            scroll_error(),
            1e-5,
            " L",
        ),
        Figure::error("wavelet noise: energy that remains after downsampling by two", left_after_halving(), 1e-2, ""),
    ]
}
