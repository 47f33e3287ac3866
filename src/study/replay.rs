//! The search of a study on grids of which every setting was cooked (tests/study_grids, made by `tools/grids.sh`): what it would
//! cook, and what it would pick. `cargo test --lib study::replay -- --nocapture` prints the table.

use std::path::Path;

use serde_json::Value;

use super::bench::{Cost, Run};
use super::knobs::{Knob, KnobArg};
use super::measure::{LONG, REPEATS};
use super::norms::{Errors, Norm, Statistic};
use super::outcome::{Goal, Outcome};
use super::search::{self, Point, Target};

/// A grid of which every setting was cooked.
struct Grid {
    name: &'static str,
    knobs: Vec<Knob>,
    runs: Vec<Run>,
    floor: f64,
    reference_ms: f64,
    frames: f64,
}

/// What a search made of a grid.
struct Replayed {
    cooked: Vec<Run>,
    pick: usize,
}

/// A grid's name; the largest share of its time that a search may take, with each setting cooked once, without the reference,
/// and as the commands cook them; and how many times as long as the cheapest setting within the tolerance the pick may take.
/// The search was made on the first two, and on dough_rolling as it was before; no number in it is from these others.
const GRIDS: [(&str, [f64; 3]); 7] = [
    ("sauce_pour", [0.25, 0.21, 1.2]),
    ("bear_storm", [0.25, 0.19, 1.2]),
    ("dough_rolling", [0.25, 0.25, 1.3]),
    ("curve_wind_collision", [0.25, 0.25, 1.4]),
    // All settings take about the same time, so that a quarter of it is that of four or five.
    ("curve_jiggle", [0.3, 0.3, 1.6]),
    // The best setting alone takes 29 %, and the splash is chaotic.
    ("dam_break", [0.55, 0.65, 1.5]),
    // 16 settings, of which the finest is the only one within the two lowest tolerances.
    ("softbody_cage", [0.45, 0.45, 1.5]),
];

/// The same of the first two with noisy times, at noise 0.
const MOST_EXPENSIVE: f64 = 1.3;

impl Grid {
    fn read(name: &'static str) -> Self {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let text = std::fs::read(root.join("tests/study_grids").join(name).with_extension("json")).unwrap();
        let value: Value = serde_json::from_slice(&text).unwrap();
        let path = root.join(value["graph"].as_str().unwrap());
        let graph = crate::load::loaded(&std::fs::read(&path).unwrap(), &path, &[])
            .unwrap_or_else(|faults| panic!("{}", faults[0]));
        let knob = |knob: &Value| {
            let values: Vec<String> = knob[1].as_array().unwrap().iter().map(Value::to_string).collect();
            let arg: KnobArg = format!("{}={}", knob[0].as_str().unwrap(), values.join(",")).parse().unwrap();
            Knob::new(&arg, &graph)
        };
        let knobs: Vec<Knob> = value["knobs"].as_array().unwrap().iter().map(knob).collect();
        let run = |run: &Value| {
            let place = |index: usize| run[index].as_u64().unwrap() as usize;
            let number = |index: usize| run[index].as_f64().unwrap();
            let (error, ms) = (number(knobs.len()), number(knobs.len() + 1));
            run_of((0..knobs.len()).map(place).collect(), error, ms)
        };
        let runs: Vec<Run> = value["runs"].as_array().unwrap().iter().map(run).collect();
        assert_eq!(runs.len(), knobs.iter().map(|knob| knob.values.len()).product::<usize>(), "{name}: a whole grid");
        let number = |key: &str| value[key].as_f64().unwrap();
        let (floor, reference_ms, frames) = (number("floor"), number("reference_cpu_ms"), number("frames"));
        Self { name, knobs, runs, floor, reference_ms, frames }
    }

    fn run(&self, setting: &[usize]) -> &Run {
        self.runs.iter().find(|run| run.setting == setting).unwrap()
    }

    /// Tolerances from a fifth above what the best setting errs to what the coarsest does, in equal ratios.
    fn tolerances(&self, count: usize) -> Vec<f64> {
        let errors = || self.runs.iter().filter_map(|run| Some(run.errors()?.mean));
        let least = 1.2 * self.floor.max(errors().fold(f64::INFINITY, f64::min));
        let most = errors().fold(0.0, f64::max);
        (0..count).map(|k| least * libm::pow(most / least, k as f64 / (count - 1) as f64)).collect()
    }

    /// Searches with times that `disturbed` makes of those of the grid; the pick is that of the outcome.
    fn search(&self, tolerance: f64, disturbed: &dyn Fn(&[usize], f64) -> f64) -> Replayed {
        let goal = Goal::Tolerance(tolerance);
        let mut cooked: Vec<Run> = Vec::new();
        let mut measure = |setting: &[usize]| {
            let run = self.run(setting);
            let (error, ms) = (run.errors().unwrap().mean, disturbed(setting, run.cost().unwrap().cpu_ms));
            if cooked.iter().all(|known| known.setting != setting) {
                cooked.push(run_of(setting.to_vec(), error, ms));
            }
            Ok(Some(Point { error, ms }))
        };
        search::search(&self.knobs, &|| Target { goal, floor: self.floor }, &mut measure).unwrap();
        let mut outcome = Outcome {
            graph: String::new(),
            output: String::new(),
            norm: Norm::of(&["points".into(), "mean".into()]).unwrap(),
            unit: "m",
            frames: Vec::new(),
            knobs: self.knobs.clone(),
            reference: Vec::new(),
            why: String::new(),
            floor: Some(Errors { mean: self.floor, p99: self.floor, max: self.floor }),
            is_beyond: true,
            rounding: 0.0,
            runs: cooked,
            front: Vec::new(),
            pick: None,
            goal,
        };
        outcome.judge();
        Replayed { pick: outcome.pick.unwrap(), cooked: outcome.runs }
    }

    /// The time of cooking a run as often as a study does, where it repeats it.
    fn repeated(&self, run: &Run) -> f64 {
        let ms = run.cost().unwrap().cpu_ms;
        let again = (1..REPEATS).take_while(|cooks| ms * self.frames * f64::from(*cooks) <= LONG).count();
        ms * (1 + again) as f64
    }

    /// The share of the time of the full grid that a search takes: each setting cooked once; and as the commands cook them,
    /// with repetitions and the reference.
    fn shares(&self, replayed: &Replayed, tolerance: f64) -> [f64; 2] {
        let once = |runs: &[Run]| runs.iter().map(|run| run.cost().unwrap().cpu_ms).sum::<f64>();
        let cooked = &replayed.cooked;
        let goal = Goal::Tolerance(tolerance);
        let is_near = |place: &usize| goal.is_near(cooked, *place, Statistic::Mean, self.floor);
        let near: f64 = (0..cooked.len()).filter(is_near).map(|place| self.repeated(&cooked[place])).sum();
        let others: f64 =
            (0..cooked.len()).filter(|place| !is_near(place)).map(|place| cooked[place].cost().unwrap().cpu_ms).sum();
        let all: f64 = self.runs.iter().map(|run| self.repeated(run)).sum();
        [once(cooked) / once(&self.runs), (near + others + self.reference_ms) / (all + self.reference_ms)]
    }

    /// The least time of the grid within a tolerance.
    fn cheapest(&self, tolerance: f64) -> f64 {
        let within = self.runs.iter().filter(|run| run.errors().unwrap().mean.max(self.floor) <= tolerance);
        within.map(|run| run.cost().unwrap().cpu_ms).fold(f64::INFINITY, f64::min)
    }
}

fn run_of(setting: Vec<usize>, error: f64, ms: f64) -> Run {
    let cost = Cost { ms, cpu_ms: ms, peak_bytes: 0, nodes: Vec::new(), repeats: 1 };
    Run { setting, result: Ok((cost, Errors { mean: error, p99: error, max: error })) }
}

fn undisturbed(_: &[usize], ms: f64) -> f64 {
    ms
}

#[test]
fn a_search_finds_what_the_full_grid_has_for_a_part_of_its_time() {
    println!("grid                 tolerance  settings  share once  as cooked  time ÷ cheapest  error ÷ tolerance");
    for (grid, most) in GRIDS.map(|(name, most)| (Grid::read(name), most)) {
        let tolerances = grid.tolerances(12);
        let mut worst = [0.0_f64; 3];
        for tolerance in &tolerances {
            let replayed = grid.search(*tolerance, &undisturbed);
            let pick = &replayed.cooked[replayed.pick];
            let error = pick.errors().unwrap().mean / tolerance;
            let ratio = pick.cost().unwrap().cpu_ms / grid.cheapest(*tolerance);
            let [once, as_cooked] = grid.shares(&replayed, *tolerance);
            println!(
                "{:<20} {tolerance:9.2e}  {:2} of {:2}  {:8.0} %  {:7.0} %  {ratio:15.2}  {error:17.2}",
                grid.name,
                replayed.cooked.len(),
                grid.runs.len(),
                100.0 * once,
                100.0 * as_cooked
            );
            assert!(error <= 1.0, "{}: {error}", grid.name);
            worst = [worst[0].max(once), worst[1].max(as_cooked), worst[2].max(ratio)];
        }
        println!("{}: at most {worst:.2?}", grid.name);
        assert!(worst.iter().zip(most).all(|(found, most)| *found <= most), "{}: {worst:.2?}", grid.name);
    }
}

/// Numbers from 0 to 1, the same in each run of the test.
fn noise(seed: u64) -> f64 {
    let mut x = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0x5851_f42d_4c95_7f2d;
    x = (x ^ (x >> 31)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    ((x ^ (x >> 29)) >> 11) as f64 / (1_u64 << 53) as f64
}

#[test]
fn with_noisy_times_the_pick_meets_the_tolerance_and_is_as_cheap() {
    const RERUNS: u64 = 3;
    for noisy in [0.05, 0.2] {
        for (place, grid) in GRIDS.map(|(name, _)| Grid::read(name)).into_iter().enumerate() {
            let (mut same, mut all, mut worst) = (0, 0, 0.0_f64);
            for tolerance in grid.tolerances(12) {
                let usual = grid.search(tolerance, &undisturbed);
                let usual = &usual.cooked[usual.pick].setting;
                for rerun in 0..RERUNS {
                    let disturbed = |setting: &[usize], ms: f64| {
                        let seed = setting.iter().fold(rerun, |seed, value| 101 * seed + *value as u64 + 1);
                        ms * (0..3).map(|cook| 1.0 + noisy * noise(3 * seed + cook)).fold(f64::INFINITY, f64::min)
                    };
                    let replayed = grid.search(tolerance, &disturbed);
                    let pick = grid.run(&replayed.cooked[replayed.pick].setting);
                    assert!(pick.errors().unwrap().mean <= tolerance);
                    worst = worst.max(pick.cost().unwrap().cpu_ms / grid.cheapest(tolerance));
                    same += u64::from(pick.setting == *usual);
                    all += 1;
                }
            }
            println!(
                "{}, each cook up to {:.0} % longer: the same pick in {same} of {all} searches, at most {worst:.2} times the cheapest",
                grid.name,
                100.0 * noisy
            );
            // sauce_pour has settings that take the same time to a hundredth: another pick is one of these. The grids after the
            // first two are printed for what they are: they were not made for the search, nor it for them.
            assert!(
                same * 10 >= all * 7 && (place > 1 || worst <= MOST_EXPENSIVE * (1.0 + noisy / 2.0)),
                "{}: {same} {worst}",
                grid.name
            );
        }
    }
}
