use rayon::ThreadPoolBuilder;

use super::*;
use crate::extract::{Placement, extract};
use crate::marked::MarkedSurface;
use crate::rows::Cell;
use numerics::vector::{length, sub};

const FRAME: f64 = 1.0 / 24.0;

fn marked(domain: Domain, distance: impl Fn(Vec3) -> f32 + Sync) -> MarkedSurface {
    MarkedSurface::new(domain, 1, distance, 0, 1)
}

fn ball(centre: Vec3, radius: f32) -> impl Fn(f64, Vec3) -> f32 + Sync {
    move |_, p| length(sub(p, centre)) - radius
}

const EVERYWHERE: [Cell; 2] = [[-99; 3], [99; 3]];

fn shape<'a>(distance: &'a (dyn Fn(f64, Vec3) -> f32 + Sync)) -> SourceShape<'a> {
    SourceShape { distance, bounds: EVERYWHERE }
}

/// A pool in a box of 16³ cells of 1/16 m.
fn pool(depth: f32) -> Liquid<MarkedSurface> {
    let domain = Domain::closed([0; 3], [16; 3]);
    Liquid::new(LiquidSettings::new(domain, 0.0625), marked(domain, |p| p[1] - depth))
}

fn volume(liquid: &Liquid<MarkedSurface>) -> f64 {
    let surface = liquid.surface();
    let cell = liquid.settings.cell / f64::from(surface.resolution());
    extract(surface.level_set().view(), Placement::Projected).volume() * cell * cell * cell
}

/// The volume after each of these frames, m³.
fn volumes(liquid: &mut Liquid<MarkedSurface>, around: &Surroundings<'_>, frames: usize) -> Vec<f64> {
    (0..frames)
        .map(|_| {
            let report = liquid.step_frame(around, FRAME);
            assert_eq!((report.caps_hit, report.solves_cut_short), (0, 0), "{report:?}");
            assert!(report.max_divergence < 1e-4, "{report:?}");
            volume(liquid)
        })
        .collect()
}

/// Volume gained a second from frame `first` on.
fn gained(volumes: &[f64], first: usize) -> f64 {
    (volumes[volumes.len() - 1] - volumes[first]) / (FRAME * (volumes.len() - 1 - first) as f64)
}

/// First it fills its shape, then its liquid grows. In a frame, of 40 cells' volume, the one turns into the other: what there is is
/// ∫ rate dt at any frame, to a seventh of what a frame gives.
#[test]
fn a_source_in_the_open_gives_its_rate() {
    for (middle, share) in [(20.0, 1.0), (0.0, 0.5)] {
        let domain = Domain::closed([0; 3], [40, 40, 2]);
        let mut liquid = Liquid::new(LiquidSettings::new(domain, 1.0), marked(domain, |_| 5.0));
        let distance = move |_: f64, p: Vec3| length([p[0] - middle, p[1] - 20.0, 0.0]) - 8.0;
        let given = 40.0 * share * 24.0;
        let rate = move |from: f64, to: f64| given * (to - from);
        let sources = [LiquidSource::new(shape(&distance), Some(&rate))];
        let around = Surroundings { sources: &sources, ..WEIGHTLESS };
        let volumes = volumes(&mut liquid, &around, 24);
        for (n, volume) in volumes.iter().enumerate() {
            let frames = volume / (given * FRAME);
            assert!((frames - (n + 1) as f64).abs() < 0.15, "{middle} {n} {frames}: {volumes:?}");
        }
    }
}

#[test]
fn a_source_in_a_full_pool_gives_its_rate() {
    for centre in [[8.0, 4.0, 8.0], [0.0, 4.0, 8.0]] {
        let mut liquid = pool(7.3);
        let distance = ball(centre, 2.6);
        let rate = |from: f64, to: f64| 0.2 * (to - from);
        let sources = [LiquidSource::new(shape(&distance), Some(&rate))];
        let around = Surroundings { sources: &sources, ..FALLING };
        let volumes = volumes(&mut liquid, &around, 24);
        let gained = gained(&volumes, 2);
        assert!((gained / 0.2 - 1.0).abs() < 0.01, "{centre:?} {gained}: {volumes:?}");
        let account = liquid.sources()[0];
        assert!((account.moved / (0.2 * FRAME) - 1.0).abs() < 0.01 && account.withheld == 0.0, "{account:?}");
        assert!(length(sub(account.place, centre)) < 1.3, "{account:?}");
    }
}

#[test]
fn a_surface_with_smaller_cells_is_fed_by_the_same_rate() {
    let domain = Domain::closed([0; 3], [20, 20, 2]);
    let surface = MarkedSurface::new(domain, 2, |_| 5.0, 0, 1);
    let mut liquid = Liquid::new(LiquidSettings::new(domain, 1.0), surface);
    let disk = |_: f64, p: Vec3| length([p[0] - 10.0, p[1] - 10.0, 0.0]) - 5.0;
    let rate = |from: f64, to: f64| 240.0 * (to - from);
    let sources = [LiquidSource::new(shape(&disk), Some(&rate))];
    let around = Surroundings { sources: &sources, ..WEIGHTLESS };
    let volumes = volumes(&mut liquid, &around, 24);
    let gained = gained(&volumes, 3);
    assert!((volumes[23] / 240.0 - 1.0).abs() < 0.06 && (gained / 240.0 - 1.0).abs() < 0.06, "{gained}: {volumes:?}");
}

#[test]
fn a_source_half_in_a_solid_gives_its_rate() {
    let solid = |_: f64, p: Vec3| p[0] - 6.4;
    let mut liquid = pool(7.3);
    let distance = ball([6.4, 4.0, 8.0], 2.6);
    let rate = |from: f64, to: f64| 0.1 * (to - from);
    let sources = [LiquidSource::new(shape(&distance), Some(&rate))];
    let around = Surroundings { sources: &sources, solid: Some(Solid::still(&solid)), ..FALLING };
    let outside = |liquid: &Liquid<MarkedSurface>| {
        let view = liquid.surface().view();
        let share = |(at, cell): (usize, Cell)| {
            let open = f64::from(Site::Centre.of(cell)[0] - 6.4 + 0.5).clamp(0.0, 1.0);
            let is_in = liquid.settings.domain.contains(cell);
            if is_in { open * f64::from((0.5 - view.phi[at]).clamp(0.0, 1.0)) } else { 0.0 }
        };
        view.rows.iter().enumerate().map(share).sum::<f64>() / 4096.0
    };
    let mut volumes = Vec::new();
    for _ in 0..24 {
        liquid.step_frame(&around, FRAME);
        volumes.push(outside(&liquid));
    }
    let gained = gained(&volumes, 2);
    assert!((gained / 0.1 - 1.0).abs() < 0.01, "{gained}: {volumes:?}");
}

#[test]
fn a_sink_in_a_pool_takes_its_rate() {
    let mut liquid = pool(12.3);
    let distance = ball([8.0, 3.0, 8.0], 2.6);
    let rate = |from: f64, to: f64| 0.2 * (to - from);
    let sinks = [LiquidSink::new(shape(&distance), Some(&rate))];
    let around = Surroundings { sinks: &sinks, ..FALLING };
    let volumes = volumes(&mut liquid, &around, 24);
    let gained = gained(&volumes, 2);
    assert!((gained / -0.2 - 1.0).abs() < 0.01, "{gained}: {volumes:?}");
}

#[test]
fn a_sink_takes_no_more_than_there_is() {
    let mut liquid = pool(4.8);
    // Cells whose middle is in the shape.
    let shape_volume = 90.0 * liquid.settings.cell_volume();
    let distance = ball([8.0, 3.0, 8.0], 2.6);
    let rate = |from: f64, to: f64| 1e6 * (to - from);
    let sinks = [LiquidSink::new(shape(&distance), Some(&rate))];
    let around = Surroundings { sinks: &sinks, ..FALLING };
    for frame in 0..12 {
        let report = liquid.step_frame(&around, FRAME);
        let most = f64::from(report.substeps + 1) * shape_volume;
        assert!(report.sunk > 0.0 && report.sunk < most, "{frame}: {most} {report:?}");
        let withheld = liquid.sinks().iter().map(|account| account.withheld).sum::<f64>();
        assert!((withheld + report.sunk - 1e6 * FRAME).abs() < 0.1, "{frame}: {withheld} {report:?}");
    }
}

/// What comes out of liquid or vanishes in it does so from the first frame on, in which the level rises by as much.
#[test]
fn a_source_and_a_sink_in_a_pool_pass_their_rates_from_the_first_frame_on() {
    let distance = ball([8.0, 4.0, 8.0], 2.6);
    for viscosity in [0.0, 10.0] {
        for sign in [1.0, -1.0] {
            let mut liquid = pool(8.3);
            let rate = |from: f64, to: f64| 0.2 * (to - from);
            let viscosity = |_| viscosity;
            let around = Surroundings { viscosity: &viscosity, ..FALLING };
            let (source, sink) =
                ([LiquidSource::new(shape(&distance), Some(&rate))], [LiquidSink::new(shape(&distance), Some(&rate))]);
            let around = match sign > 0.0 {
                true => Surroundings { sources: &source, ..around },
                false => Surroundings { sinks: &sink, ..around },
            };
            let start = volume(&liquid);
            for frame in 1..=12 {
                let report = liquid.step_frame(&around, FRAME);
                let (moved, other) =
                    if sign > 0.0 { (report.sourced, report.sunk) } else { (report.sunk, report.sourced) };
                assert!((moved / (0.2 * FRAME) - 1.0).abs() < 1e-9 && other == 0.0, "{sign} {frame}: {report:?}");
                let gained = sign * (volume(&liquid) - start) / (0.2 * FRAME);
                assert!((gained / f64::from(frame) - 1.0).abs() < 0.01, "{sign} {frame}: {gained}");
            }
        }
    }
}

/// A hole in thick liquid on a plate that passes through the middles of cells.
#[test]
fn a_sink_on_a_plate_takes_what_the_liquid_loses() {
    let domain = Domain::closed([0; 3], [32, 14, 32]);
    let (plate, still) = (|p: Vec3| p[1] - 3.5, |_: f64, p: Vec3| p[1] - 3.5);
    let mut surface = marked(domain, block([5.0, -99.0, 5.0], [27.0, 8.2, 27.0]));
    surface.meet(&plate);
    let mut liquid = Liquid::new(LiquidSettings::new(domain, 0.009), surface);
    let drain = block([17.0, -99.0, 9.0], [23.0, 99.0, 23.0]);
    let drain = |_: f64, p: Vec3| drain(p);
    let sinks = [LiquidSink::new(shape(&drain), None)];
    let around = Surroundings { viscosity: &|_| 50.0, sinks: &sinks, solid: Some(Solid::still(&still)), ..FALLING };
    let left = |liquid: &Liquid<MarkedSurface>| liquid.surface().mesh(Some(&plate)).volume();
    // The edges of the block are rounded at first.
    (0..4).for_each(|_| {
        liquid.step_frame(&around, FRAME);
    });
    let before = left(&liquid);
    let sunk: f64 = (0..20).map(|_| liquid.step_frame(&around, FRAME).sunk).sum();
    let (sunk, gone) = (sunk / liquid.settings.cell_volume(), before - left(&liquid));
    // 505 of 141 where rounding filled its edges again and again.
    assert!(sunk > 60.0 && (sunk - gone).abs() < 0.03 * before, "{sunk} of {gone} of {before}");
}

#[test]
fn a_rate_is_integrated() {
    let mut liquid = pool(7.3);
    let distance = ball([8.0, 4.0, 8.0], 2.6);
    // 0.4·t m³/s over a second.
    let mut sum = 0.0;
    let start = volume(&liquid);
    for frame in 0..24 {
        let now = f64::from(frame) * FRAME;
        let rate = move |from: f64, to: f64| 0.2 * ((now + to) * (now + to) - (now + from) * (now + from));
        let sources = [LiquidSource::new(shape(&distance), Some(&rate))];
        sum += liquid.step_frame(&Surroundings { sources: &sources, ..FALLING }, FRAME).sourced;
    }
    assert!((sum - 0.2).abs() < 1e-9, "{sum} {:?}", liquid.sources()[0]);
    let gained = volume(&liquid) - start;
    assert!((gained / sum - 1.0).abs() < 0.01, "{gained} {sum}");
}

/// A nozzle keeps its shape full of liquid with its velocity: it gives area · speed, and a sink that takes all that enters
/// takes as much.
#[test]
fn a_jet_has_the_speed_of_its_nozzle_and_a_sink_takes_it() {
    let domain = Domain::closed([0; 3], [40, 6, 4]);
    let mut liquid = Liquid::new(LiquidSettings::new(domain, 1.0 / 16.0), marked(domain, |_| 5.0));
    let nozzle = |_: f64, p: Vec3| (p[0] - 5.0).abs() - 3.0;
    let drain = |_: f64, p: Vec3| (p[0] - 35.0).abs() - 3.0;
    let velocity = |_: f64| [1.0, 0.0, 0.0];
    let sources = [LiquidSource { velocity: Some(&velocity), ..LiquidSource::new(shape(&nozzle), None) }];
    let sinks = [LiquidSink::new(shape(&drain), None)];
    let around = Surroundings { sources: &sources, sinks: &sinks, ..WEIGHTLESS };
    let mut last = [0.0; 2];
    for frame in 0..60 {
        let report = liquid.step_frame(&around, FRAME);
        if frame >= 48 {
            last = [last[0] + report.sourced, last[1] + report.sunk];
        }
    }
    let [given, taken] = last.map(|volume| volume / (12.0 * FRAME));
    let expected = 24.0 / 256.0;
    assert!((given / expected - 1.0).abs() < 0.01, "{given} {expected}");
    assert!((taken / expected - 1.0).abs() < 0.01, "{taken} {expected}");
    let motion = liquid.motion();
    let inside = |cell: Cell| domain.contains(cell) && (3..30).contains(&cell[0]);
    let mut count = 0;
    for (at, _) in motion.rows().iter().enumerate().filter(|(_, cell)| inside(*cell)) {
        let u = motion.velocity().faces()[0][at];
        assert!((u - 1.0).abs() < 1e-3, "{u}");
        count += 1;
    }
    assert_eq!(count, 27 * 24);
}

/// Around a nozzle in a pool, thick liquid resists; inside, it has the speed.
#[test]
fn a_nozzle_in_a_pool_has_its_speed() {
    for viscosity in [0.0, 1e5] {
        let mut liquid = pool(9.3);
        let (distance, viscosity) = (ball([8.0, 4.0, 8.0], 2.6), |_| viscosity);
        let velocity = |_: f64| [0.5, -1.0, 0.0];
        let sources = [LiquidSource { velocity: Some(&velocity), ..LiquidSource::new(shape(&distance), None) }];
        let around = Surroundings { sources: &sources, viscosity: &viscosity, ..FALLING };
        for _ in 0..3 {
            let report = liquid.step_frame(&around, FRAME);
            assert!(report.max_divergence < 1e-4 && report.unbalanced < 1e-6, "{report:?}");
            let motion = liquid.motion();
            for (at, cell) in motion.rows().iter().enumerate() {
                for axis in (0..3).filter(|axis| distance(0.0, Site::FACES[*axis].of(cell)) < 0.0) {
                    assert_eq!(motion.velocity().faces()[axis][at], velocity(0.0)[axis]);
                }
            }
        }
    }
}

/// Liquid comes in at rest, however fast what came in before has become.
#[test]
fn a_source_kept_full_in_the_air_gives_steadily() {
    let mut liquid = pool(2.3);
    let distance = ball([8.0, 12.0, 8.0], 2.6);
    let sources = [LiquidSource::new(shape(&distance), None)];
    let around = Surroundings { sources: &sources, ..FALLING };
    let given: Vec<f64> = (0..24).map(|_| liquid.step_frame(&around, FRAME).sourced).collect();
    let [first, then]: [f64; 2] = [&given[8..16], &given[16..]].map(|part| part.iter().sum());
    assert!((then / first - 1.0).abs() < 0.05, "{given:?}");
    // What falls freely from the top of the shape leaves at its foot.
    let falling = std::f64::consts::PI * 2.6 * 2.6 / 256.0 * (2.0 * 9.81 * 5.2 / 16.0_f64).sqrt();
    assert!((0.5..1.0).contains(&(then / (8.0 * FRAME * falling))), "{then} {falling}");
}

#[test]
fn a_box_full_to_the_brim_takes_nothing_and_goes_on() {
    for viscosity in [0.0, 100.0] {
        let domain = Domain::closed([0; 3], [8; 3]);
        let mut liquid = Liquid::new(LiquidSettings::new(domain, 0.125), marked(domain, |_| -5.0));
        let (distance, other) = (ball([2.5; 3], 1.6), ball([5.5; 3], 1.6));
        let rate = |from: f64, to: f64| 0.1 * (to - from);
        let viscosity = |_| viscosity;
        let sources = [LiquidSource::new(shape(&distance), Some(&rate))];
        let around = Surroundings { sources: &sources, viscosity: &viscosity, ..FALLING };
        for _ in 0..6 {
            let report = liquid.step_frame(&around, FRAME);
            let account = liquid.sources()[0];
            assert!(report.sourced == 0.0 && report.unbalanced > 1e-3 && report.solves_cut_short == 0, "{report:?}");
            assert!((account.withheld / (0.1 * FRAME) - 1.0).abs() < 1e-9 && account.owed.abs() < 1e-9, "{account:?}");
            assert!(largest(&liquid) < 1e-3);
        }
        // What a sink takes elsewhere makes room.
        let less = |from: f64, to: f64| 0.05 * (to - from);
        let sinks = [LiquidSink::new(shape(&other), Some(&less))];
        let around = Surroundings { sinks: &sinks, ..around };
        for _ in 0..6 {
            let report = liquid.step_frame(&around, FRAME);
            let passed = 0.05 * FRAME;
            assert!((report.sourced - passed).abs() < 1e-6 && (report.sunk - passed).abs() < 1e-6, "{report:?}");
            assert!(largest(&liquid) > 0.02 && report.max_divergence < 1e-4);
        }
    }
}

#[test]
fn sources_where_no_liquid_can_be_give_nothing() {
    let solid = ball([8.0, 4.0, 8.0], 4.0);
    for distance in [ball([8.0, 4.0, 8.0], 2.0), ball([8.0, 19.0, 8.0], 2.9), ball([80.0; 3], 2.0)] {
        let rate = |from: f64, to: f64| 0.1 * (to - from);
        for rate in [Some(&rate as _), None] {
            let sources = [LiquidSource::new(shape(&distance), rate)];
            let sinks = [LiquidSink::new(shape(&distance), rate)];
            let around =
                Surroundings { sources: &sources, sinks: &sinks, solid: Some(Solid::still(&solid)), ..FALLING };
            let mut liquid = pool(9.3);
            for _ in 0..3 {
                let report = liquid.step_frame(&around, FRAME);
                // Differences of two sums.
                assert!(report.sourced.abs() < 1e-9 && report.sunk.abs() < 1e-9, "{report:?}");
                let withheld = if rate.is_some() { 0.1 * FRAME } else { 0.0 };
                for account in [liquid.sources()[0], liquid.sinks()[0]] {
                    assert!((account.withheld - withheld).abs() < 1e-9 && account.owed == 0.0, "{account:?}");
                }
                assert!(largest(&liquid) < 1e-3 && report.unbalanced == 0.0, "{report:?}");
            }
        }
    }
}

/// Shapes too thin for the grid count as half a cell deep.
#[test]
fn a_sheet_between_the_middles_of_cells_gives_its_rate() {
    let mut liquid = pool(3.3);
    let sheet = |_: f64, p: Vec3| (p[1] - 9.0).abs().max(length([p[0] - 8.0, 0.0, p[2] - 8.0]) - 3.0);
    let rate = |from: f64, to: f64| 0.05 * (to - from);
    let sources = [LiquidSource::new(shape(&sheet), Some(&rate))];
    let around = Surroundings { sources: &sources, ..FALLING };
    let given: f64 = (0..24).map(|_| liquid.step_frame(&around, FRAME).sourced).sum();
    assert!((given / (0.05 * 24.0 * FRAME) - 1.0).abs() < 0.1, "{given}");
}

fn fountain(frames: std::ops::Range<u32>, liquid: &mut Liquid<PlainLevelSet>) {
    let nozzle = ball([5.0, 5.0, 6.0], 1.8);
    let inlet = ball([14.0, 9.0, 6.0], 2.2);
    let outlet = ball([18.0, 1.0, 6.0], 2.0);
    let velocity = |_: f64| [0.0, 2.0, 0.0];
    for frame in frames {
        let now = f64::from(frame) * FRAME;
        let rate = move |from: f64, to: f64| 0.02 * (to - from) * (1.0 + now);
        let sources = [
            LiquidSource { velocity: Some(&velocity), ..LiquidSource::new(shape(&nozzle), None) },
            LiquidSource::new(shape(&inlet), Some(&rate)),
        ];
        let sinks = [LiquidSink::new(shape(&outlet), Some(&rate))];
        liquid.step_frame(&Surroundings { sources: &sources, sinks: &sinks, ..FALLING }, FRAME);
    }
}

fn start() -> Liquid<PlainLevelSet> {
    let domain = Domain::closed([0; 3], [24, 16, 12]);
    Liquid::new(LiquidSettings::new(domain, 1.0 / 24.0), PlainLevelSet::new(domain, |p| p[1] - 4.3))
}

fn bits(liquid: &Liquid<PlainLevelSet>) -> Vec<u32> {
    let phi = liquid.surface().view().phi.iter();
    phi.chain(liquid.motion().velocity().faces().iter().flatten()).map(|value| value.to_bits()).collect()
}

#[test]
fn sources_resume_and_run_on_any_number_of_threads_with_the_same_bits() {
    let run = |threads| {
        let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut liquid = start();
            fountain(0..9, &mut liquid);
            liquid
        })
    };
    let mut whole = start();
    fountain(0..5, &mut whole);
    let mut resumed = Liquid::resume(whole.settings.clone(), whole.surface().clone(), whole.motion().clone());
    assert!(resumed.sources().iter().chain(resumed.sinks()).all(|account| account.moved > 0.0));
    fountain(5..9, &mut resumed);
    fountain(5..9, &mut whole);
    assert!(bits(&whole) == bits(&resumed) && whole.motion() == resumed.motion());
    for threads in [1, 3] {
        let other = run(threads);
        assert!(bits(&other) == bits(&whole) && other.motion() == whole.motion());
    }
}

/// A sink beside a block that does not flow takes what is in its shape, once. The face that it cuts is made anew each substep:
/// what markers keep of it must not come back to be taken again.
#[test]
fn a_sink_beside_a_stiff_block_takes_its_part_once() {
    let floor = |_: f64, p: Vec3| p[1] - 2.0;
    for height in [0.0, 2.0] {
        let domain = Domain::closed([0; 3], [30, 12, 12]);
        let solid = (height > 0.0).then(|| Solid::still(&floor));
        let surface = marked(domain, |p| p[1] - height - 3.0);
        let mut liquid = Liquid::new(LiquidSettings::new(domain, 0.02), surface);
        let drain = |_: f64, p: Vec3| (22.0 - p[0]).max(p[1] - height - 4.0);
        let sinks = [LiquidSink::new(shape(&drain), None)];
        let around = Surroundings { sinks: &sinks, solid, ..Surroundings::new(&|_| [0.0, -9.81, 0.0], &|_| 1e7) };
        let part = 8.0 * 3.0 * 12.0 * 8e-6;
        let mut taken = 0.0;
        for frame in 0..24 {
            taken += liquid.step_frame(&around, FRAME).sunk;
            assert!((taken / part - 1.0).abs() < 0.02, "{height} {frame}: {taken} {part}");
        }
    }
}

/// From the first frame on, whatever the rate is: as a thinner stream where it is below section · velocity. Rates are shares of
/// that; the radius is in cells.
#[test]
fn a_nozzle_gives_any_rate_steadily_from_the_first_frame_on() {
    for (radius, share) in [(4.0, 0.3), (4.0, 0.9), (4.0, 1.5), (2.0, 0.9), (1.0, 1.5), (1.0, 0.6)] {
        let domain = Domain::closed([0; 3], [20, 34, 20]);
        let mut liquid = Liquid::new(LiquidSettings::new(domain, 0.03), marked(domain, |_| 5.0));
        let distance =
            move |_: f64, p: Vec3| (length([p[0] - 10.0, 0.0, p[2] - 10.0]) - radius).max((p[1] - 30.0).abs() - 1.67);
        let area = std::f64::consts::PI * f64::from(radius * radius) * 9e-4;
        let given = share * area * 0.3;
        let (rate, velocity) = (move |from: f64, to: f64| given * (to - from), |_: f64| [0.0, -0.3, 0.0]);
        let sources = [LiquidSource { velocity: Some(&velocity), ..LiquidSource::new(shape(&distance), Some(&rate)) }];
        let around = Surroundings { sources: &sources, ..Surroundings::new(&|_| [0.0, -9.81, 0.0], &|_| 30.0) };
        let frames = (0..16).map(|_| (liquid.step_frame(&around, FRAME).sourced, liquid.sources()[0]));
        let (sourced, accounts): (Vec<f64>, Vec<FlowAccount>) = frames.unzip();
        let shares: Vec<f64> = sourced.iter().map(|volume| volume / (given * FRAME)).collect();
        // A ball of a cell's radius is what comes first.
        let first = (4.2 * 2.7e-5 / (given * FRAME)) as usize;
        assert!(accounts.iter().all(|account| account.withheld < 1e-12));
        assert!((0..first).all(|n| accounts[n].is_collecting()), "{radius} {share}: {shares:?}");
        // A frame may have up to half more or less, as filling becomes pouring; in all no more than one is missing.
        let steady = shares[first + 1..].iter().all(|share| (share - 1.0).abs() < 0.5);
        let sum = shares.iter().sum::<f64>() / 16.0;
        assert!(steady && (sum - 1.0).abs() < 1.0 / 16.0, "{radius} {share}: {sum} {shares:?}");
    }
}

/// A rate 5 % above section · velocity, of a narrow nozzle whose liquid all moves at the velocity that it imposes: pressure has
/// nothing to say there, so nothing can pour.
#[test]
fn a_nozzle_that_is_a_little_too_narrow_gives_its_rate() {
    let domain = Domain::closed([0; 3], [16, 60, 16]);
    let mut liquid = Liquid::new(LiquidSettings::new(domain, 0.04), marked(domain, |_| 5.0));
    let distance = |_: f64, p: Vec3| (length([p[0] - 7.5, 0.0, p[2] - 7.5]) - 2.0).max((p[1] - 55.0).abs() - 2.0);
    let given = 1.05 * std::f64::consts::PI * 4.0 * 1.6e-3 * 2.0;
    let (rate, velocity) = (move |from: f64, to: f64| given * (to - from), |_: f64| [0.0, -2.0, 0.0]);
    let sources = [LiquidSource { velocity: Some(&velocity), ..LiquidSource::new(shape(&distance), Some(&rate)) }];
    let around = Surroundings { sources: &sources, ..WEIGHTLESS };
    let mut sourced = 0.0;
    for frame in 1..=20 {
        sourced += liquid.step_frame(&around, FRAME).sourced;
        let account = liquid.sources()[0];
        assert!(account.withheld == 0.0, "{frame}: {account:?}");
        let late = f64::from(frame) - sourced / (given * FRAME);
        assert!(late.abs() < 0.15, "{frame}: {late} frames late");
    }
}
