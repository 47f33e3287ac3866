use numerics::vector::length;
use rayon::ThreadPoolBuilder;

use super::*;

fn ball(centre: Vec3, radius: f32) -> impl Fn(Vec3) -> f32 {
    move |p| length(sub(p, centre)) - radius
}

fn made(size: i32, phi: impl Fn(Vec3) -> f32 + Sync) -> LevelSet {
    let rows = CellRows::cuboid([0; 3], [size; 3]);
    let phi = rows.tabulate(|cell| phi(cell.map(|n| n as f32 + 0.5)));
    LevelSet::new(&rows, &phi, [0; 3], [size; 3])
}

/// The largest |φ − exact| among cells of which |exact| < `within`.
fn error(set: &LevelSet, within: f32, exact: impl Fn(Vec3) -> f32) -> f32 {
    let (low, high) = set.domain();
    let mut sampler = PhiSampler::new(set.view());
    let cells = CellRows::cuboid(low, high);
    let errors = cells.iter().map(|cell| {
        let at = cell.map(|n| n as f32 + 0.5);
        let exact = exact(at);
        if exact.abs() < within { (sampler.at(at) - exact).abs() } else { 0.0 }
    });
    errors.fold(0.0, f32::max)
}

#[test]
fn a_level_set_stores_the_liquid_and_its_band_alone() {
    let phi = ball([20.0; 3], 9.0);
    let set = made(60, &phi);
    assert!(error(&set, BAND, &phi) < 1e-6);
    for cell in CellRows::cuboid([0; 3], [60; 3]).iter() {
        let exact = phi(cell.map(|n| n as f32 + 0.5));
        assert_eq!(set.band().find(cell).is_some(), exact.abs() < BAND);
        assert!(exact >= BAND || set.rows().find(cell).is_some());
    }
    assert!(set.rows().len() < 18_000, "{} of 216000 cells", set.rows().len());
}

#[test]
fn filling_makes_a_distance_of_any_level_set_and_keeps_its_zero() {
    let exact = ball([16.2, 15.7, 16.1], 8.0);
    // Steep on one side, flat on the other.
    let mut set = made(32, |p| exact(p) * (1.0 + 0.05 * (p[0] - 16.0)));
    let before = set.clone();
    set.fill();
    assert!(error(&set, 3.0, &exact) < 0.55, "{}", error(&set, 3.0, &exact));
    for (at, cell) in set.rows().iter().enumerate() {
        assert_eq!(set.phi[at] < 0.0, before.phi[at] < 0.0, "{cell:?}");
        if exact(cell.map(|n| n as f32 + 0.5)).abs() < 0.3 {
            assert_eq!(set.phi[at], before.phi[at]);
        }
    }
    // At rest it stays as it is.
    let mut rest = || {
        set.advect(&|_: Vec3| [0.0; 3], 0.0);
        set.fill();
        set.clone()
    };
    let still = rest();
    for later in [rest(), rest(), rest()] {
        assert!(later.rows() == still.rows() && later.phi == still.phi);
    }
}

#[test]
fn a_flow_carries_the_surface() {
    let way = [0.7, -0.4, 0.2];
    for (steps, scaled) in [(10, 1.0), (3, 3.3)] {
        let mut set = made(40, ball([16.0, 22.0, 18.0], 7.0));
        for _ in 0..steps {
            set.advect(&|_: Vec3| scale(way, scaled), 0.83 * scaled);
            set.fill();
        }
        let moved = scale(way, scaled * steps as f32);
        let exact = ball(add([16.0, 22.0, 18.0], moved), 7.0);
        assert!(error(&set, 2.0, &exact) < 0.6, "{}", error(&set, 2.0, &exact));
    }
}

#[test]
fn a_surface_meets_walls_and_leaves_through_them() {
    // A pool against five walls: at rest nothing changes, and there is no surface along the walls.
    let mut set = made(16, |[_, y, _]| y - 6.3);
    for _ in 0..3 {
        set.advect(&|_: Vec3| [0.0; 3], 0.5);
        set.fill();
    }
    assert!(error(&set, 4.0, |[_, y, _]| y - 6.3) < 1e-5);
    let mut sampler = PhiSampler::new(set.view());
    assert_eq!(sampler.at([0.0, 7.3, 16.0]), 1.0);
    assert_eq!(sampler.at([-3.0, -3.0, 19.0]), -BAND);
    // All of it flows out through the floor.
    for _ in 0..12 {
        set.advect(&|_: Vec3| [0.0, -1.0, 0.0], 1.0);
        set.fill();
    }
    assert!(set.phi().iter().all(|phi| *phi > 0.0));
}

#[test]
fn shapes_are_added_and_cut_away() {
    let first = ball([10.0; 3], 4.0);
    let second = ball([18.0, 10.0, 10.0], 5.0);
    let mut set = made(30, &first);
    set.change([9, 1, 1], [28, 20, 20], &|p, phi| phi.min(second(p)));
    assert!(error(&set, 4.0, |p| first(p).min(second(p))) < 1e-6);
    set.change([0; 3], [30; 3], &|p, phi| phi.max(-first(p)));
    set.fill();
    let mut sampler = PhiSampler::new(set.view());
    assert!(sampler.at([10.0; 3]) > 3.0 && sampler.at([18.0, 10.0, 10.0]) < -3.0);
}

#[test]
fn nothing_and_everything_are_level_sets() {
    let flow = |_: Vec3| [0.5, 0.5, 0.5];
    let mut none = made(8, |_| BAND);
    let mut all = made(8, |_| -BAND);
    let mut one = made(1, |_| -0.5);
    for set in [&mut none, &mut all, &mut one] {
        set.advect(&flow, 1.0);
        set.fill();
        assert!(set.phi().iter().all(|phi| phi.is_finite() && phi.abs() <= BAND));
    }
    assert_eq!(none.rows().len(), 0);
    assert!(CellRows::cuboid([0; 3], [8; 3]).iter().all(|cell| all.phi()[all.rows().find(cell).unwrap()] == -BAND));
    assert!(PhiSampler::new(one.view()).at([0.5; 3]) < 0.0);
    assert_eq!(PhiSampler::new(none.view()).at([1e30, f32::INFINITY, -1e30]), BAND);
}

#[test]
fn bits_do_not_depend_on_threads() {
    let run = |threads| {
        let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut set = made(48, ball([24.0; 3], 15.0));
            for _ in 0..4 {
                set.advect(&|[x, y, _]: Vec3| [0.03 * (24.0 - y), 0.03 * (x - 24.0), 0.1], 0.8);
                set.fill();
            }
            (set.rows().clone(), set.phi)
        })
    };
    let one = run(1);
    assert!(one.1.len() > 20_000);
    assert!([2, 7].into_iter().all(|threads| run(threads) == one));
}

#[test]
fn gradients_are_those_of_the_interpolated_field() {
    let set = made(20, ball([10.0; 3], 6.0));
    let mut sampler = PhiSampler::new(set.view());
    let at = [13.3, 14.2, 8.9];
    let (value, gradient) = sampler.gradient(at);
    assert_eq!(value, sampler.at(at));
    for axis in 0..3 {
        let mut near = [at; 2];
        (near[0][axis], near[1][axis]) = (at[axis] - 0.05, at[axis] + 0.05);
        let difference = (sampler.at(near[1]) - sampler.at(near[0])) / 0.1;
        assert!((difference - gradient[axis]).abs() < 1e-4);
    }
}

/// The value of φ at a cell of a set that has met a solid.
fn met(phi: impl Fn(Vec3) -> f32 + Sync, solid: impl Fn(Vec3) -> f32 + Sync) -> impl Fn(Cell) -> f32 {
    let rows = CellRows::cuboid([0; 3], [20, 20, 6]);
    let phi = rows.tabulate(|cell| phi(cell.map(|x| x as f32 + 0.5)).clamp(-BAND, BAND));
    let mut set = LevelSet::new(&rows, &phi, [0; 3], [20, 20, 6]);
    set.meet(&solid, 1.0);
    move |cell| set.rows().find(cell).map_or(BAND, |at| set.phi()[at])
}

/// A pool that ends within a wall, x < 6: its surface, which slopes by 1 in 2, goes on inside.
#[test]
fn a_surface_goes_on_into_a_solid_and_ends_there() {
    let slope = |p: Vec3, by: f32| (p[1] - 8.0 - by * (p[0] - 6.0)) * 0.894_427_2;
    // Towards the wall it rises: straight on.
    let rising = met(|p| slope(p, -0.5), |p| p[0] - 6.0);
    // Towards the wall it falls: straight on, too.
    let falling = met(|p| slope(p, 0.5), |p| p[0] - 6.0);
    for y in 6..11 {
        for x in 4..6 {
            let on = |by: f32, x: f32| slope([x, y as f32 + 0.5, 3.5], by);
            // The normal of φ leaves the wall's: only its part along the wall's normal counts.
            let (up, down) = (rising([x, y, 3]), falling([x, y, 3]));
            assert!((up - on(-0.5, 6.5)).abs() < 1e-4 || up < on(-0.5, 6.5), "{x} {y}: {up}");
            assert!((down - on(0.5, x as f32 + 0.5)).abs() < 1e-4, "{x} {y}: {down} {}", on(0.5, x as f32 + 0.5));
        }
        for at in [&rising as &dyn Fn(Cell) -> f32, &falling] {
            assert!((0..3).all(|x| at([x, y, 3]) > 0.0), "there is none deep inside");
        }
    }
    assert!((falling([9, 9, 3]) - slope([9.5, 9.5, 3.5], 0.5)).abs() < 1e-4, "outside it stays");
}

/// A film of 0.3 cells on a wall: liquid from there to some depth, with one surface, where it is.
#[test]
fn a_film_thinner_than_a_cell_has_one_surface() {
    for wall in [6.0, 6.2, 6.49, 6.7] {
        let at = met(|p| p[0] - wall - 0.3, |p| p[0] - wall);
        for x in 4..11 {
            let (phi, expected) = (at([x, 9, 3]), x as f32 + 0.5 - wall - 0.3);
            assert!((phi - expected).abs() < 1e-4, "{wall}, {x}: {phi} {expected}");
        }
    }
    let dry = met(|p| 9.0 - p[0], |p| p[0] - 6.0);
    assert!((0..8).all(|x| dry([x, 9, 3]) > 0.0), "liquid that is not there is not made");
}
