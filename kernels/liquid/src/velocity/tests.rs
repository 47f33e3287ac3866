use numerics::lanes::{F32x16, LANES, get, set};
use numerics::vector::{Vec3, dot, sub};

use super::*;
use crate::rows::{Cell, Periods};

/// Half a turn takes 1 / SPIN · π.
const SPIN: f32 = 0.05;

fn ball(radius: f32, by: i32) -> CellRows {
    let reach = radius as i32 + 2;
    let inside = |cell: Cell| {
        let p = Site::Centre.of(cell);
        dot(p, p) < radius * radius
    };
    CellRows::cuboid([-reach; 3], [reach; 3]).filtered(|cell, _| inside(cell)).dilated(by)
}

/// The field of `velocity` on all faces.
fn faces(rows: &CellRows, velocity: impl Fn(Vec3) -> Vec3 + Sync) -> FaceFields<f32> {
    rows.tabulate_each(|cell| [0, 1, 2].map(|axis| velocity(Site::FACES[axis].of(cell))[axis]))
}

fn rigid([x, y, z]: Vec3) -> Vec3 {
    [0.3 - SPIN * y + 0.01 * z, SPIN * x - 0.1, 0.2 - 0.01 * x]
}

/// Of each cell of `rows` the faces that touch a cell of `liquid`.
fn touching(rows: &CellRows, liquid: &CellRows) -> Vec<FaceMask> {
    rows.tabulate(|cell| {
        let below = |axis: usize| {
            let mut below = cell;
            below[axis] -= 1;
            below
        };
        let touches = |axis: usize| liquid.find(cell).is_some() || liquid.find(below(axis)).is_some();
        (0..3).map(|axis| u8::from(touches(axis)) << axis).sum()
    })
}

#[test]
fn rigid_motion_is_continued_exactly() {
    let (liquid, rows) = (ball(6.3, 0), ball(6.3, 7));
    let exact = faces(&rows, rigid);
    let mut known = touching(&rows, &liquid);
    let mut given = exact.clone();
    for axis in 0..3 {
        let unknown = known.iter().map(|mask| mask >> axis & 1 == 0);
        given[axis].iter_mut().zip(unknown).filter(|(_, unknown)| *unknown).for_each(|(value, _)| *value = f32::NAN);
    }
    let mut smooth = given.clone();
    let slopes = [Slopes::nearest(0.2), Slopes { steepest: 0.2, smooth: true }];
    extrapolate(&rows, &mut known, [&mut given, &mut smooth], slopes, u32::MAX);
    assert!(known.iter().all(|mask| *mask == ALL_FACES));
    // Far out, what rounding makes of differences that are the same counts as rough.
    let (near, everywhere) = (ball(6.3, 3), ball(6.3, 7));
    for (field, within) in [(&given, &everywhere), (&smooth, &near)] {
        for (at, cell) in rows.iter().enumerate().filter(|(_, cell)| within.find(*cell).is_some()) {
            let [value, exact] = [field, &exact].map(|faces| [0, 1, 2].map(|axis| faces[axis][at]));
            assert!((0..3).all(|axis| (value[axis] - exact[axis]).abs() < 2e-4), "{cell:?}: {value:?} {exact:?}");
        }
    }
}

#[test]
fn single_faces_are_continued_as_they_are_and_slopes_are_bounded() {
    let rows = CellRows::from_cells(&(-9..9).map(|x| [x, 0, 0]).chain([[30, 5, 5]]).collect::<Vec<_>>());
    let at = |x: i32| rows.find([x, 0, 0]).unwrap();
    let mut known = vec![0; rows.len()];
    let mut fields: FaceFields<f32> = std::array::from_fn(|_| vec![0.0; rows.len()]);
    (known[at(0)], known[at(1)]) = (0b011, 0b001);
    (fields[0][at(0)], fields[0][at(1)], fields[1][at(0)]) = (1.0, 5.0, 3.0);
    extrapolate(&rows, &mut known, [&mut fields], [Slopes::nearest(0.5)], u32::MAX);
    assert_eq!([-2, -1, 2, 3].map(|x| fields[0][at(x)]), [0.0, 0.5, 5.5, 6.0]);
    assert!((-9..9).all(|x| fields[1][at(x)] == 3.0 && known[at(x)] == 0b011));
    // What cannot be reached stays as it is.
    assert_eq!((known[rows.len() - 1], fields[0][rows.len() - 1]), (0, 0.0));
}

/// The faces at x = 3, 4 and 5 that follow those with the values `given` at x = 0, 1 and 2, the first two by `slopes`.
fn after(given: [f32; 3], slopes: Slopes) -> [f32; 3] {
    let rows = CellRows::from_cells(&(0..6).map(|x| [x, 0, 0]).collect::<Vec<_>>());
    let mut known = vec![0b001, 0b001, 0b001, 0, 0, 0];
    let mut fields: FaceFields<f32> = std::array::from_fn(|_| vec![0.0; rows.len()]);
    fields[0][..3].copy_from_slice(&given);
    extrapolate(&rows, &mut known, [&mut fields], [slopes], 2);
    [3, 4, 5].map(|at| fields[0][at])
}

#[test]
fn only_smooth_fields_slope_and_not_far() {
    let smooth = Slopes { steepest: 10.0, smooth: true };
    assert_eq!(after([1.0, 2.0, 3.0], smooth), [4.0, 5.0, 5.0]);
    // Differences of 4 and 5: 4, less 3 · (5 − 4) ÷ (5 + 4) of it.
    assert!((after([0.0, 4.0, 9.0], smooth)[0] - (9.0 + 4.0 * 2.0 / 3.0)).abs() < 1e-5);
    for rough in [[0.0, 1.0, 3.0], [0.0, 2.0, 3.0], [0.0, 2.0, 1.0], [0.0, 0.0, 1.0]] {
        assert_eq!(after(rough, smooth), [rough[2]; 3], "{rough:?}");
    }
    assert_eq!(after([0.0, 1.0, 3.0], Slopes::nearest(1.5)), [4.5, 6.0, 6.0]);
}

fn turned([x, y, z]: Vec3, angle: f32) -> Vec3 {
    let (sine, cosine) = numerics::trig::sin_cos(angle);
    [cosine * x - sine * y, sine * x + cosine * y, z]
}

/// Where one point goes, among others that go elsewhere.
fn followed(velocity: &MacVelocity, bounds: [Vec3; 2], step: f32, start: Vec3) -> Vec3 {
    let nothing = F32x16::splat(0.0);
    let (mut starts, mut velocities) = ([nothing; 3], [nothing; 3]);
    for lane in 0..LANES {
        let at = if lane == 5 { start } else { [lane as f32 - 7.0, 1.3, -0.4] };
        set(&mut starts, lane, at);
        set(&mut velocities, lane, velocity.at(&mut Sampler::new(velocity.rows()), at));
    }
    get(&Tracer::new(velocity, bounds, step).trace(&starts, &velocities), 5)
}

#[test]
fn points_follow_a_rotation_to_third_order() {
    let rows = ball(9.0, 4);
    let velocity = MacVelocity::new(rows.clone(), faces(&rows, |[x, y, _]| [-y, x, 0.0]));
    let bounds = [[-1e3; 3], [1e3; 3]];
    let start = [6.0, 2.0, -1.0];
    let error = |angle: f32| {
        let end = followed(&velocity, bounds, angle, start);
        let off = sub(end, turned(start, angle));
        dot(off, off).sqrt()
    };
    assert!(error(0.1) < 5e-5 && error(0.4) < 1e-2, "{} {}", error(0.1), error(0.4));
    assert_eq!(followed(&velocity, [[-1e3; 3], [1e3, 2.5, 1e3]], 0.4, start)[1], 2.5);
}

/// A smooth field carried along keeps its shape: MacCormack to second order, and never beyond the values there were.
#[test]
fn fields_are_carried_with_the_flow() {
    let rows = CellRows::cuboid([0; 3], [40, 24, 24]);
    let wave = |x: f32| 1.0 + numerics::trig::sin_cos(x * 0.5).0;
    let velocity = MacVelocity::new(rows.clone(), faces(&rows, |_| [1.0, 0.0, 0.0]));
    let wanted = vec![ALL_FACES; rows.len()];
    let error = |scheme| {
        let mut carried = faces(&rows, |[x, ..]| [wave(x), 0.0, -wave(x)]);
        let step = 0.45;
        for _ in 0..10 {
            let bounds = [[0.0; 3], [40.0, 24.0, 24.0]];
            let (method, periods) = (Method::Ralston, Periods::NONE);
            let advection = Advection { velocity: &velocity, bounds, periods, step, method, scheme };
            carried = advection.carry(&carried, &rows, &wanted);
        }
        let mut worst = 0.0_f32;
        for (at, cell) in rows.iter().enumerate().filter(|(_, [x, y, z])| (12..30).contains(x) && y.max(z) < &23) {
            worst = worst.max((carried[0][at] - wave(Site::FaceX.of(cell)[0] - 4.5)).abs());
            assert!((-1e-5..=2.00001).contains(&carried[0][at]) && (-2.00001..=1e-5).contains(&carried[2][at]));
        }
        worst
    };
    let (plain, corrected) = (error(Scheme::SemiLagrangian), error(Scheme::MacCormack));
    assert!(plain > 0.2 && 3.0 * corrected < plain, "{plain} {corrected}");
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let bits = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let (liquid, rows) = (ball(13.0, 0), ball(13.0, 4));
            let rough = |p: Vec3| rigid(p.map(|x| x + 3.0 * numerics::trig::sin_cos(2.0 * x).0));
            let mut fields = faces(&rows, rough);
            let mut known = touching(&rows, &liquid);
            extrapolate(&rows, &mut known, [&mut fields], [Slopes::nearest(0.3)], u32::MAX);
            let velocity = MacVelocity::new(rows.clone(), fields);
            let bounds = [[-15.0; 3], [15.0; 3]];
            let carry = Advection {
                velocity: &velocity,
                bounds,
                periods: Periods::NONE,
                step: 1.7,
                method: Method::Ralston,
                scheme: Scheme::MacCormack,
            };
            let wanted = touching(&liquid, &liquid);
            let carried = carry.carry(velocity.faces(), &liquid, &wanted);
            carried.iter().flatten().map(|value| value.to_bits()).collect::<Vec<_>>()
        })
    };
    let one = bits(1);
    assert!(one.iter().any(|bits| *bits != 0) && one == bits(2) && one == bits(7));
}
