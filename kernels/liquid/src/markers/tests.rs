use std::f32::consts::PI;

use numerics::trig;
use rayon::ThreadPoolBuilder;

use super::*;
use crate::extract::{Placement, extract};
use crate::level_set::BAND;
use crate::rows::{Cell, CellRows};

fn made(high: Cell, phi: impl Fn(Vec3) -> f32 + Sync) -> LevelSet {
    let rows = CellRows::cuboid([0; 3], high);
    let phi = rows.tabulate(|cell| phi(cell.map(|n| n as f32 + 0.5)));
    LevelSet::new(&rows, &phi, [0; 3], high)
}

fn ball(centre: Vec3, radius: f32) -> impl Fn(Vec3) -> f32 + Sync {
    move |p| length(sub(p, centre)) - radius
}

/// Shares of cells that are inside, roughly: good for sums of differences.
fn shares(set: &LevelSet) -> Vec<f32> {
    let (low, high) = set.domain();
    let mut sampler = PhiSampler::new(set.view());
    let inside = |cell: Cell| {
        let mut corner = |n: i32| {
            let point = [n & 1, n >> 1 & 1, n >> 2].map(|x| 0.25 + 0.5 * x as f32);
            (0.5 - 2.0 * sampler.at(add(cell.map(|x| x as f32), point))).clamp(0.0, 1.0)
        };
        (0..8).map(&mut corner).sum::<f32>() / 8.0
    };
    CellRows::cuboid(low, high).iter().map(inside).collect()
}

/// Σ |a − b| ÷ Σ a.
fn difference(a: &[f32], b: &[f32]) -> f32 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum::<f32>() / a.iter().sum::<f32>()
}

fn volume(set: &LevelSet) -> f64 {
    extract(set.view(), Placement::Projected).volume()
}

/// A disk or, with `is_ball`, a ball of radius 15, cut by a slot 5 wide and 25 deep, of a box of 100 in cells of `unit`.
fn slotted(p: Vec3, centre: Vec3, is_ball: bool, unit: f32) -> f32 {
    let mut from = scale(sub(p, centre), 1.0 / unit);
    from[2] *= f32::from(is_ball);
    let (beside, above) = (from[0].abs() - 2.5, from[1] - 10.0);
    let slot = if beside > 0.0 && above > 0.0 { length([beside, above, 0.0]) } else { beside.max(above) };
    (length(from) - 15.0).max(-slot) * unit
}

/// A turn about the middle of a box in `steps`.
fn turning(middle: f32, steps: u32) -> impl Fn(Vec3) -> Vec3 + Sync {
    let angle = 2.0 * PI / steps as f32;
    move |[x, y, _]| [angle * (middle - y), angle * (x - middle), 0.0]
}

/// Planes of markers touch a ball from outside: without its curvature it would grow, at 2.5 cells radius by 2 % in a step.
#[test]
fn balls_of_a_few_cells_move_with_their_volume() {
    for (radius, by) in [(2.5, 0.015), (4.0, 0.005), (6.0, 0.0025)] {
        let mut set = made([30; 3], ball([11.1, 10.8, 11.4], radius));
        let mut markers = Markers::new(&set, 0, 1);
        let exact = 4.0 / 3.0 * std::f64::consts::PI * f64::from(radius * radius * radius);
        for step in 1..=20 {
            markers.step(&mut set, &|_: Vec3| [0.13, 0.21, 0.08], 0.3);
            let off = volume(&set) / exact - 1.0;
            assert!(off.abs() < by, "{radius}, step {step}: {off}");
        }
    }
}

#[test]
fn the_slotted_disk_keeps_its_slot() {
    let shape = |p: Vec3| slotted(p, [50.0, 75.0, 0.0], false, 1.0);
    let mut set = made([100, 100, 2], shape);
    let mut markers = Markers::new(&set, 0, 1);
    let first = markers.ids.len() as u64;
    let (before, full) = (shares(&set), volume(&set));
    for _ in 0..2 * 300 {
        markers.step(&mut set, &turning(50.0, 300), 0.9);
    }
    let (area, l1) = (volume(&set) / full - 1.0, difference(&before, &shares(&set)));
    assert!(area.abs() < 0.005 && l1 < 0.0125, "{area} {l1}");
    let mut sampler = PhiSampler::new(set.view());
    assert!((62..84).all(|y| sampler.at([50.0, y as f32 + 0.5, 1.0]) > 0.5));
    for (marker, id) in markers.markers.iter().zip(&markers.ids) {
        assert!(*id >= first || shape(marker.point).abs() < 0.16, "{marker:?} left the surface");
    }
}

#[test]
fn the_slotted_ball_keeps_its_volume() {
    let mut set = made([48; 3], |p| slotted(p, [24.0, 36.0, 24.0], true, 0.48));
    let mut markers = Markers::new(&set, 0, 1);
    let (before, full) = (shares(&set), volume(&set));
    for _ in 0..150 {
        markers.step(&mut set, &turning(24.0, 150), 0.85);
    }
    let (change, l1) = (volume(&set) / full - 1.0, difference(&before, &shares(&set)));
    assert!(change.abs() < 0.02 && l1 < 0.02, "{change} {l1}");
}

/// LeVeque's deformation of a box of `size` cells: a sheet at half of the steps, the ball again at the end.
fn deform(size: i32, steps: u32, period: f32) -> (f64, f32) {
    let n = size as f32;
    let mut set = made([size; 3], ball([0.35 * n; 3], 0.15 * n));
    let mut markers = Markers::new(&set, 0, 1);
    let (before, full) = (shares(&set), volume(&set));
    for step in 0..steps {
        let dt = period / steps as f32 * trig::cos(PI * (step as f32 + 0.5) / steps as f32);
        let flow = move |p: Vec3| {
            let [a, b, c] = p.map(|x| trig::sin(PI * x / n));
            let [d, e, f] = p.map(|x| trig::sin(2.0 * PI * x / n));
            [2.0 * a * a * e * f, -d * b * b * f, -d * e * c * c].map(|u| u * dt * n)
        };
        markers.step(&mut set, &flow, 1.0);
    }
    (volume(&set) / full - 1.0, difference(&before, &shares(&set)))
}

#[test]
fn a_ball_returns_from_a_sheet() {
    let (change, l1) = deform(48, 150, 1.5);
    assert!(change.abs() < 0.003 && l1 < 0.005, "{change} {l1}");
}

#[test]
fn at_rest_nothing_changes() {
    let mut set = made([30; 3], ball([15.2, 14.9, 15.1], 8.0));
    let mut markers = Markers::new(&set, 1, 3);
    let points = markers.markers.clone();
    assert!(points.len() > 1500 && points.len() < 4500, "{} markers", points.len());
    // The first step makes first-order distances of exact ones, which moves the tricubic surface by 4e-3 cells.
    markers.step(&mut set, &|_: Vec3| [0.0; 3], 0.0);
    let start = volume(&set);
    for _ in 1..12 {
        markers.step(&mut set, &|_: Vec3| [0.0; 3], 0.0);
    }
    let change = volume(&set) / start - 1.0;
    assert!(change.abs() < 1e-4, "{change}");
    let (phi, later) = (set.phi().to_vec(), markers.clone());
    for _ in 0..12 {
        markers.step(&mut set, &|_: Vec3| [0.0; 3], 0.0);
    }
    assert!(set.phi().iter().zip(&phi).all(|(a, b)| (a - b).abs() < 1e-5));
    // The first looks find a few places that the start left out; after that none comes, and none moves.
    let by_id = |markers: &Markers| {
        let mut all: Vec<_> = markers.ids.iter().copied().zip(markers.markers.clone()).collect();
        all.sort_unstable_by_key(|(id, _)| *id);
        all
    };
    let (later, now) = (by_id(&later), by_id(&markers));
    assert!(now.len() == later.len() && now.len() < points.len() + 6);
    // Normals are made unit again each step, and are off by its rounding.
    let stays = |now: &Marker, then: &Marker| now.point == then.point && length(sub(now.normal, then.normal)) < 1e-5;
    assert!(now.iter().zip(&later).all(|(now, then)| now.0 == then.0 && stays(&now.1, &then.1)));
    for ((id, now), start) in now.iter().zip(&points) {
        assert!(stays(now, start), "{id}: {start:?} {now:?}");
    }
}

#[test]
fn normals_turn_and_shear_with_the_surface() {
    let set = made([40; 3], |[_, y, _]| y - 20.3);
    let mut markers = Markers::new(&set, 0, 1);
    for _ in 0..10 {
        markers.advect(&|[x, ..]: Vec3| [0.0, 0.05 * x, 0.0]);
    }
    let exact = unit([-0.5, 1.0, 0.0]).unwrap();
    assert!(markers.markers.iter().all(|marker| length(sub(marker.normal, exact)) < 1e-3));
}

/// Takes away the markers near a point, and has the hole filled; gives back how many are new.
fn fill_hole(set: &LevelSet, markers: &mut Markers, at: Vec3) -> usize {
    let left: Vec<u32> =
        (0..markers.ids.len() as u32).filter(|n| length(sub(markers.markers[*n as usize].point, at)) > 2.5).collect();
    markers.reorder(&left);
    markers.upkeep(set);
    markers.ids.len() - left.len()
}

#[test]
fn new_markers_lie_on_the_surface_and_get_the_attributes_around_them() {
    let shape = ball([15.2, 14.9, 15.1], 9.0);
    let set = made([30; 3], &shape);
    let mut markers = Markers::new(&set, 2, 3);
    let value = |p: Vec3| 0.3 * p[0] - 0.2 * p[1] + 0.1 * p[2];
    markers.attributes[0] = markers.markers.iter().map(|marker| value(marker.point)).collect();
    markers.attributes[1] = vec![7.0; markers.ids.len()];
    let old = markers.ids.len();
    let new = fill_hole(&set, &mut markers, [15.2, 23.9, 15.1]);
    assert!(new > 20, "{new} new markers");
    for n in markers.ids.len() - new..markers.ids.len() {
        let marker = markers.markers[n];
        assert!(markers.ids[n] >= old as u64);
        assert!(shape(marker.point).abs() < 0.02, "{} off", shape(marker.point));
        assert!(length(sub(marker.normal, unit(sub(marker.point, [15.2, 14.9, 15.1])).unwrap())) < 0.05);
        assert!((markers.attributes[0][n] - value(marker.point)).abs() < 0.1);
        assert!((markers.attributes[1][n] - 7.0).abs() < 1e-5);
    }
    let mut ids = markers.ids.clone();
    ids.sort_unstable();
    ids.dedup();
    assert_eq!(ids.len(), markers.ids.len());
}

#[test]
fn both_sides_of_a_sheet_keep_their_own_attributes() {
    let set = made([24; 3], |[_, y, _]| (y - 12.1).abs() - 0.8);
    let mut markers = Markers::new(&set, 1, 3);
    markers.attributes[0] = markers.markers.iter().map(|marker| marker.normal[1].signum()).collect();
    let new = fill_hole(&set, &mut markers, [12.0, 12.1, 12.0]);
    assert!(new > 10, "{new} new markers");
    assert!(markers.attributes[0].iter().all(|value| (-1.0..=1.0).contains(value)), "within the values that came in");
    for (marker, value) in markers.markers.iter().zip(&markers.attributes[0]) {
        assert!((value - marker.normal[1].signum()).abs() < 1e-5);
        assert!((marker.point[1] - 12.1).abs() > 0.7);
    }
}

#[test]
fn markers_far_from_all_others_have_the_attributes_of_the_nearest() {
    let balls = |p: Vec3| f32::min(ball([8.0; 3], 4.0)(p), ball([24.0, 8.0, 8.0], 3.0)(p));
    let set = made([32, 16, 16], balls);
    let mut markers = Markers::new(&made([32, 16, 16], ball([8.0; 3], 4.0)), 1, 3);
    let old = markers.ids.len();
    markers.attributes[0] = markers.markers.iter().map(|marker| marker.point[0]).collect();
    markers.upkeep(&set);
    let all = markers.markers.iter().zip(&markers.attributes[0]);
    let far: Vec<f32> = all.filter(|(marker, _)| marker.point[0] > 20.0).map(|(_, value)| *value).collect();
    assert!(far.len() > 50 && markers.ids.len() >= old + far.len(), "{} new markers", far.len());
    assert!(far.iter().all(|value| (6.0..12.1).contains(value)), "{far:?}");
}

#[test]
fn markers_are_thinned_and_dropped() {
    let set = made([20; 3], |[_, y, _]| y - 10.2);
    let mut markers = Markers::new(&set, 0, 3);
    let crowd: Vec<u32> = (0..markers.ids.len() as u32).flat_map(|n| [n; 5]).collect();
    markers.reorder(&crowd);
    let crowded = markers.ids.len();
    markers.markers[0].point = [10.0, 16.0, 10.0];
    markers.markers[1].point = [10.0, 10.2, 22.0];
    markers.upkeep(&set);
    assert!(markers.ids.len() < crowded / 2 && markers.ids.len() > crowded / 5);
    assert!(markers.markers.iter().all(|marker| (marker.point[1] - 10.2).abs() < 0.1 && marker.point[2] < 21.0));
}

#[test]
fn nothing_and_everything_have_no_markers() {
    for phi in [BAND, -BAND] {
        let mut set = made([8; 3], |_| phi);
        let mut markers = Markers::new(&set, 1, 1);
        for _ in 0..6 {
            markers.step(&mut set, &|_: Vec3| [0.5; 3], 1.0);
        }
        assert!(markers.ids.is_empty() && markers.attributes[0].is_empty());
    }
    let mut one = made([1; 3], |_| -0.5);
    let mut markers = Markers::new(&one, 1, 1);
    for _ in 0..6 {
        markers.step(&mut one, &|_: Vec3| [0.0; 3], 1.0);
    }
    assert!(one.phi().iter().all(|phi| phi.is_finite()));
}

#[test]
fn bits_do_not_depend_on_threads() {
    let run = |threads| {
        let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut set = made([40; 3], |p| slotted(p, [20.0, 30.0, 20.0], true, 0.4));
            let mut markers = Markers::new(&set, 1, 5);
            markers.attributes[0] = markers.markers.iter().map(|marker| marker.point[0]).collect();
            for _ in 0..11 {
                markers.step(&mut set, &turning(20.0, 60), 1.8);
            }
            (markers, set.phi().to_vec())
        })
    };
    let one = run(1);
    assert!(one.0.ids.len() > 1000);
    assert!([2, 7].into_iter().all(|threads| run(threads) == one));
}

/// Markers of the old surface do not pull φ back to it, whether the new one lies a tenth of a cell outside it or far inside.
#[test]
fn shapes_that_are_added_and_taken_away_stay_so() {
    let centre = [12.0; 3];
    let mut set = made([24; 3], ball(centre, 7.0));
    let mut markers = Markers::new(&set, 1, 7);
    let still = |_: Vec3| [0.0; 3];
    let mut radius = 7.0;
    for next in [7.1, 7.6, 6.0] {
        let shape = ball(centre, next);
        markers.change(&mut set, [0; 3], [24; 3], &|p, phi| {
            if next > radius { phi.min(shape(p)) } else { phi.max(shape(p)) }
        });
        (0..3).for_each(|_| markers.step(&mut set, &still, 0.0));
        let ratio = volume(&set) / f64::from(4.0 / 3.0 * PI * next * next * next);
        assert!((ratio - 1.0).abs() < 0.01, "{radius} to {next}: {ratio}");
        let off = |marker: &Marker| (length(sub(marker.point, centre)) - next).abs();
        assert!(markers.markers.len() > 500 && markers.markers.iter().all(|marker| off(marker) < 0.1));
        assert!(markers.ids.len() == markers.markers.len() && markers.attributes[0].len() == markers.markers.len());
        radius = next;
    }
}
