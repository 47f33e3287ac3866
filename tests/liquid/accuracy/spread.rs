//! A viscous liquid spreads on a plane, and a surface is carried along.

use liquid::extract::{Placement, extract};
use liquid::level_set::{LevelSet, PhiSampler};
use liquid::markers::Markers;
use liquid::rows::CellRows;
use liquid::volumes::VolumeTargets;
use numerics::vector::length;

use super::flows::Deformation;
use super::*;

pub(super) fn figures(effort: Effort) -> Vec<Figure> {
    let (radii, exponent) = spreading(effort.choose(10, 16));
    let (volume, shape) = deformed(effort.choose(48, 100), effort.choose(1.5, 3.0));
    vec![
        Figure::within("syrup spreads on a plane: radius ÷ 0.894 (gV³t/3ν)^⅛ (Huppert 1982)", &radii, [0.9, 1.1])
            .has_coarse_form(effort),
        Figure::within("its exponent of time, 0.125", &[exponent], [0.105, 0.145]).has_coarse_form(effort),
        Figure::error("a ball becomes a sheet and a ball again (LeVeque 1996), 100³ cells: volume", volume, 0.03, "")
            .has_coarse_form(effort),
        Figure::error("its shape: what is out of place ÷ its volume", shape, 0.01, "").has_coarse_form(effort),
    ]
}

/// A cylinder `n` cells high and in radius spreads on a floor, a quarter of it between planes of symmetry: its radius, once
/// it is twice that at the start, ÷ Huppert's, and the slope of ln radius over ln t.
fn spreading(n: i32) -> (Vec<f64>, f64) {
    let (radius, viscosity) = (0.16, 16.0);
    let cell = radius / f64::from(n);
    let walls = [[Wall::FreeSlip, Wall::Open], [Wall::Closed, Wall::Open], [Wall::FreeSlip, Wall::Open]];
    let settings = LiquidSettings::new(domain([3 * n, n + 4, 3 * n], walls), cell);
    let size = n as f32;
    let mut liquid = at_rest(settings, |[x, y, z]| (length([x, 0.0, z]) - size).max(y - size));
    let mut targets = VolumeTargets::new(liquid.surface_mut(), cell, None);
    let thickness = |_| viscosity;
    let around = Surroundings::new(&|_| [0.0, -GRAVITY, 0.0], &thickness);
    let volume = 4.0 * targets.volume();
    let pull = GRAVITY * volume * volume * volume / (3.0 * viscosity / 1000.0);
    let (mut ratios, mut points) = (Vec::new(), Vec::new());
    for frame in 1..=64 {
        liquid.step_frame(&around, 1.0 / 16.0);
        targets.correct(liquid.surface_mut(), None);
        let time = f64::from(frame) / 16.0;
        if ![16, 24, 32, 48, 64].contains(&frame) {
            continue;
        }
        let mesh = liquid.surface().mesh(None);
        let front = mesh.points.iter().fold(0.0_f32, |most, [x, _, z]| most.max(length([*x, 0.0, *z])));
        let front = f64::from(front) * cell;
        ratios.push(front / (0.894 * libm::pow(pull * time, 0.125)));
        points.push((libm::log(time), libm::log(front)));
    }
    (ratios, slope(&points))
}

/// The slope of the straight line closest to points.
fn slope(points: &[(f64, f64)]) -> f64 {
    let count = points.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / count;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let products = points.iter().map(|p| [(p.0 - x) * (p.1 - y), (p.0 - x) * (p.0 - x)]);
    let [top, bottom] = products.fold([0.0; 2], |sum, product| [sum[0] + product[0], sum[1] + product[1]]);
    top / bottom
}

/// A surface and its markers after LeVeque's deformation: the change of its volume, and the volume that is out of place,
/// both ÷ the volume.
fn deformed(size: u32, period: f32) -> (f64, f64) {
    let flow = Deformation::new(size, period);
    let high = [size as i32; 3];
    let rows = CellRows::cuboid([0; 3], high);
    let phi = rows.tabulate(|cell| flow.start(cell.map(|n| n as f32 + 0.5)));
    let mut set = LevelSet::new(&rows, &phi, [0; 3], high);
    let mut markers = Markers::new(&set, 0, 1);
    let volume = |set: &LevelSet| extract(set.view(), Placement::Projected).volume();
    let (full, before) = (volume(&set), shares(&set));
    for step in 0..flow.steps {
        markers.step(&mut set, &flow.step(step), 1.0);
    }
    let away = before.iter().zip(&shares(&set)).map(|(a, b)| f64::from((a - b).abs())).sum::<f64>();
    ((volume(&set) / full - 1.0).abs(), away / before.iter().map(|share| f64::from(*share)).sum::<f64>())
}

/// Shares of cells that are inside, of 4³ points each.
fn shares(set: &LevelSet) -> Vec<f32> {
    let (low, high) = set.domain();
    let inside = |cell: [i32; 3]| {
        let phi = set.rows().find(cell).map_or(5.0, |at| set.phi()[at]);
        if phi.abs() > 2.0 {
            return f32::from(phi < 0.0);
        }
        let mut sampler = PhiSampler::new(set.view());
        let point = |n: usize| {
            let part = [n % 4, n / 4 % 4, n / 16];
            [0, 1, 2].map(|axis| cell[axis] as f32 + (part[axis] as f32 + 0.5) * 0.25)
        };
        (0..64).map(|n| (0.5 - 4.0 * sampler.at(point(n))).clamp(0.0, 1.0)).sum::<f32>() / 64.0
    };
    CellRows::cuboid(low, high).tabulate(inside)
}
