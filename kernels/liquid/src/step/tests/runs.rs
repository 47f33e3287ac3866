use super::*;
use numerics::vector::length;
use rayon::ThreadPoolBuilder;

/// A dam that breaks over a ball.
fn splash(frames: u32) -> Liquid<PlainLevelSet> {
    let domain = Domain::closed([0; 3], [24, 16, 12]);
    let settings = LiquidSettings::new(domain, 1.0 / 24.0);
    let mut liquid = Liquid::new(settings, PlainLevelSet::new(domain, block([-9.0; 3], [9.0, 12.0, 30.0])));
    go_on(&mut liquid, frames);
    liquid
}

fn go_on(liquid: &mut Liquid<PlainLevelSet>, frames: u32) {
    let ball = |_: f64, p: Vec3| length([p[0] - 14.0, p[1] - 1.0, p[2] - 6.0]) - 3.2;
    let around = Surroundings { solid: Some(Solid::still(&ball)), ..FALLING };
    for _ in 0..frames {
        let report = liquid.step_frame(&around, 1.0 / 24.0);
        assert!(report.max_divergence < 1e-4 && report.caps_hit == 0, "{report:?}");
    }
}

fn bits(liquid: &Liquid<PlainLevelSet>) -> Vec<u32> {
    let phi = liquid.surface().view().phi.iter();
    phi.chain(liquid.motion().velocity().faces().iter().flatten()).map(|value| value.to_bits()).collect()
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let run = |threads| {
        let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| bits(&splash(12)))
    };
    let one = run(1);
    assert!(one == run(2) && one == run(7));
}

#[test]
fn a_liquid_taken_apart_and_resumed_goes_on_with_the_same_bits() {
    fn is_stored<T: serde::Serialize + serde::de::DeserializeOwned>(_: &T) {}
    let mut whole = splash(5);
    is_stored(whole.motion());
    let mut resumed = Liquid::resume(whole.settings.clone(), whole.surface().clone(), whole.motion().clone());
    go_on(&mut whole, 4);
    go_on(&mut resumed, 4);
    assert!(bits(&whole) == bits(&resumed) && whole.motion() == resumed.motion());
}

/// What a substep keeps for the next one within a frame is what that would have made, beside a solid that moves, too.
#[test]
fn a_frame_of_several_substeps_has_the_bits_of_several_frames() {
    let domain = Domain::closed([0; 3], [24, 16, 12]);
    let run = |frames: &[f64]| {
        let surface = PlainLevelSet::new(domain, block([3.0, -9.0, -9.0], [11.0, 9.0, 30.0]));
        let mut liquid = Liquid::new(LiquidSettings::new(domain, 1.0 / 24.0), surface);
        // 1.4 cells in a 32nd of a second.
        liquid.set_velocity(|_| [1.4 * 32.0 / 24.0, 0.0, 0.0], &WEIGHTLESS);
        let (mut start, mut substeps) = (0.0, 0);
        for seconds in frames {
            let ball = |time: f64, p: Vec3| {
                let x = 14.0 - 8.0 * (start + time) as f32;
                length([p[0] - x, p[1] - 1.0, p[2] - 6.0]) - 3.2
            };
            let velocity = |_: f64, _: Vec3| [-8.0 / 24.0, 0.0, 0.0];
            let solid = Solid { distance: &ball, velocity: &velocity, speed: 8.0 / 24.0 };
            substeps += liquid.step_frame(&Surroundings { solid: Some(solid), ..WEIGHTLESS }, *seconds).substeps;
            start += seconds;
        }
        (substeps, bits(&liquid))
    };
    let (whole, halves) = (run(&[1.0 / 16.0]), run(&[1.0 / 32.0; 2]));
    assert!(whole.0 > 1 && whole.0 == halves.0, "{} {}", whole.0, halves.0);
    assert!(whole.1 == halves.1);
}

#[test]
fn memory_follows_the_liquid() {
    let domain = Domain::closed([0; 3], [64; 3]);
    let stored = |height: f32| {
        let settings = LiquidSettings::new(domain, 1.0 / 64.0);
        let mut liquid = Liquid::new(settings, PlainLevelSet::new(domain, |p| p[1] - height));
        let report = liquid.step_frame(&FALLING, 1.0 / 24.0);
        assert_eq!(report.liquid_cells, (height as usize) * 4096);
        (report.stored_cells, liquid.stored_rows().len())
    };
    let (film, full) = (stored(3.2), stored(60.2));
    assert!(4 * film.0 < full.0 && 4 * film.1 < full.1, "{film:?} {full:?}");
}

#[test]
fn no_liquid_no_time_and_too_little_time_are_told() {
    let domain = Domain::closed([0; 3], [8; 3]);
    let mut none = Liquid::new(LiquidSettings::new(domain, 0.1), PlainLevelSet::new(domain, |_| 3.0));
    let report = none.step_frame(&FALLING, 1.0 / 24.0);
    assert_eq!((report.liquid_cells, report.substeps, report.pressure_iterations), (0, 1, 0));
    assert_eq!(none.step_frame(&FALLING, 0.0).substeps, 0);
    let settings = LiquidSettings { max_substeps: 3, ..LiquidSettings::new(domain, 0.1) };
    let mut fast =
        Liquid::new(settings, PlainLevelSet::new(domain, |p| length([p[0] - 4.0, p[1] - 4.0, p[2] - 4.0]) - 2.5));
    fast.set_velocity(|_| [300.0, 40.0, -1.0], &FALLING);
    let report = fast.step_frame(&FALLING, 0.25);
    assert!(report.substeps == 3 && report.caps_hit > 0 && report.cfl_reached > 2.0, "{report:?}");
    assert!(largest(&fast).is_finite());
}

#[test]
fn a_cancelled_frame_ends_after_the_substep_it_is_in() {
    let domain = Domain::closed([0; 3], [12; 3]);
    let mut liquid = Liquid::new(LiquidSettings::new(domain, 0.1), PlainLevelSet::new(domain, |p| p[1] - 6.3));
    let before = liquid.surface().clone();
    let report = liquid.step_frame(&Surroundings { cancelled: &|| true, ..FALLING }, 1.0);
    assert_eq!((report.substeps, liquid.surface()), (0, &before));
}

/// Ten thousand times the gravity, in one substep a frame: whatever is left of it is finite, and it ends.
#[test]
fn a_substep_takes_a_bounded_time_however_far_liquid_moves() {
    let domain = Domain::closed([0; 3], [24, 16, 12]);
    let settings = LiquidSettings { cfl: 1e9, max_substeps: 1, ..LiquidSettings::new(domain, 1.0 / 24.0) };
    let mut liquid = Liquid::new(settings, PlainLevelSet::new(domain, block([-9.0; 3], [9.0, 12.0, 30.0])));
    let around = Surroundings::new(&|_| [3e4, -1e5, 0.0], &|_| 0.0);
    let mut farthest = 0.0_f64;
    for _ in 0..4 {
        farthest = farthest.max(liquid.step_frame(&around, 1.0 / 24.0).cfl_reached);
    }
    assert!(farthest > 1e3, "{farthest}");
    assert!(liquid.motion().velocity().faces().iter().flatten().all(|u| u.is_finite()));
}
