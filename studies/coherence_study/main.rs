//! How many curves jump from sample to sample after collision, by `coherence`, on four bodies: a camel with thin legs,
//! the same with deep folds, a trefoil knot and a sphere. The tables of docs/wind.md.
//!
//! `cargo run --release -p studies --bin coherence_study [camel|folds|knot|sphere]… [still|moving|eighths|storm]…
//! [coherence=X]… [loft=X] [curves=N] [pairs=N]`. 10,000 curves of 7 CVs; wind turns by 1° a frame. Each row compares `pairs` pairs
//! of samples: a frame apart (still, moving), an eighth of one (eighths) or a quarter (storm). Jumps are tips that move by
//! more than a quarter of their length; those are added whose curves do not jump in the wind alone.
//!
//! `… --bin coherence_study heights`: which heights above the skin `offset_scale` and `loft` keep, on these bodies and a
//! plane. `unfreed`: which segments cross in a storm. `follow`: the tips that jump at `coherence` 1 where those of the wind alone do not,
//! each followed in ever smaller steps: how far it moves in the longest of them, and how far the wind alone moves it there.

mod bodies;
mod crossing;
mod heights;
mod scene;

use bodies::Body;
use curves::collide::{Collide, Collided, ContactMethod, SkinSurface, collide};
use heights::{Heights, KeptBy};
use numerics::vector::{Vec3, length, sub};
use scene::{CVS, Case, Groom, Sample};

/// Frames over which pairs are spread: a turn of the wind.
const FRAMES: f64 = 360.0;

/// A jump is a way of a tip longer than this share of its length.
const JUMP: f64 = 0.25;

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let numbers =
        |name: &str| -> Vec<f64> { words.iter().filter_map(|word| word.strip_prefix(name)?.parse().ok()).collect() };
    let number = |name: &str, default: f64| numbers(name).first().copied().unwrap_or(default);
    let asked = |all: [&'static str; 4]| -> Vec<&'static str> {
        let named: Vec<_> = all.into_iter().filter(|name| words.iter().any(|word| word == name)).collect();
        if named.is_empty() { all.to_vec() } else { named }
    };
    let (curves, pairs) = (number("curves=", 10_000.0) as usize, number("pairs=", 36.0) as usize);
    if words.iter().any(|word| word == "unfreed") {
        return print_unfreed(curves);
    }
    if words.iter().any(|word| word == "heights") {
        return print_heights(curves);
    }
    if words.iter().any(|word| word == "follow") {
        for body in asked(["camel", "folds", "knot", "sphere"]) {
            print_followed(body, &Groom::on(Body::named(body), curves), pairs);
        }
        return;
    }
    let loft = number("loft=", 0.0);
    let mut coherences = numbers("coherence=");
    if coherences.is_empty() {
        coherences = vec![0.0, 1.0];
    }
    println!(
        "body    case    coherence  jumps %   wind's %  added %  p99.9 of way/L  contacts  crossings  to rest  way of tips/L"
    );
    for body in asked(["camel", "folds", "knot", "sphere"]) {
        let groom = Groom::on(Body::named(body), curves);
        for name in asked(["still", "moving", "eighths", "storm"]) {
            let (case, step) = match name {
                "still" => (Case::Still, 1.0),
                "moving" => (Case::Moving, 1.0),
                "eighths" => (Case::Moving, 0.125),
                _ => (Case::Storm, 0.25),
            };
            let (sums, wind) = compared(&groom, (case, step), pairs, &coherences, loft);
            for (coherence, sums) in coherences.iter().zip(sums) {
                println!("{body:7} {name:7} {coherence:9} {}", sums.row(&wind));
            }
        }
    }
}

/// Pairs of samples that are a `step` apart, at each coherence; and the ways of tips in the wind alone.
fn compared(
    groom: &Groom,
    (case, step): (Case, f64),
    pairs: usize,
    coherences: &[f64],
    loft: f64,
) -> (Vec<Sums>, Vec<f64>) {
    let mut sums = vec![Sums::default(); coherences.len()];
    let mut wind = Vec::new();
    for pair in 0..pairs {
        let frame = FRAMES * pair as f64 / pairs as f64;
        let samples = [0.0, step].map(|step| groom.at(case, frame + step));
        let blown = ways(groom, &samples[0].goal, &samples[1].goal);
        for (coherence, sums) in coherences.iter().zip(&mut sums) {
            let [before, after] = [&samples[0], &samples[1]].map(|sample| collided(groom, sample, *coherence, loft));
            sums.add(groom, &samples[0], [&before, &after], &blown);
        }
        wind.extend(blown);
    }
    (sums, wind)
}

/// The parts into which the frame of a jump is cut.
const CUTS: [u32; 4] = [1, 8, 64, 256];

/// Tips that jump at `coherence` 1 on a still skin and not in the wind alone, step by step.
fn print_followed(body: &str, groom: &Groom, pairs: usize) {
    println!(
        "body    curve   frame  of a frame  longest step/L: after collision  of the wind then  of the wind at most"
    );
    for pair in 0..pairs {
        let frame = FRAMES * pair as f64 / pairs as f64;
        for curve in jumping(groom, frame, 1.0) {
            let one = groom.only(curve);
            for cuts in CUTS {
                let way = longest_step(&one, frame, cuts);
                println!(
                    "{body:7} {curve:6} {frame:6} {:>11} {:31.5} {:17.5} {:19.5}",
                    format!("1/{cuts}"),
                    way.collided,
                    way.of_wind_then,
                    way.of_wind
                );
            }
        }
    }
}

/// The curves whose tips jump in a `step` after `frame`, and not in the wind alone.
fn jumping(groom: &Groom, frame: f64, step: f64) -> Vec<usize> {
    let [before, after] = [frame, frame + step].map(|frame| still(groom, frame));
    let moved = ways(groom, &before.collided, &after.collided);
    let blown = ways(groom, &before.blown, &after.blown);
    (0..moved.len()).filter(|curve| moved[*curve] > JUMP && blown[*curve] <= JUMP).collect()
}

/// Curves on a still skin.
struct Still {
    /// In the wind alone, and after collision with `coherence` 1.
    blown: Vec<Vec3>,
    collided: Vec<Vec3>,
}

fn still(groom: &Groom, frame: f64) -> Still {
    let sample = groom.at(Case::Still, frame);
    let collided = collided(groom, &sample, 1.0, 0.0).points;
    Still { blown: sample.goal, collided }
}

/// The longest of the ways in the parts of a frame.
#[derive(Clone, Copy, Debug, Default)]
struct Longest {
    collided: f64,
    /// That of the wind in the same part.
    of_wind_then: f64,
    /// The wind's longest in any part.
    of_wind: f64,
}

/// The longest step of the tip of a groom's one curve in the frame after `frame`, cut into so many parts.
fn longest_step(one: &Groom, frame: f64, cuts: u32) -> Longest {
    let mut longest = Longest::default();
    let mut before = still(one, frame);
    for part in 1..=cuts {
        let after = still(one, frame + f64::from(part) / f64::from(cuts));
        let moved = ways(one, &before.collided, &after.collided)[0];
        let blown = ways(one, &before.blown, &after.blown)[0];
        longest.of_wind = longest.of_wind.max(blown);
        if moved > longest.collided {
            (longest.collided, longest.of_wind_then) = (moved, blown);
        }
        before = after;
    }
    longest
}

/// Segments that cross in each of 48 frames of a storm, without coherence.
fn print_unfreed(curves: usize) {
    println!("body    segments that cross in 48 frames  of curves free at rest");
    for body in ["camel", "folds", "knot", "sphere"] {
        let groom = Groom::on(Body::named(body), curves);
        let (mut all, mut of_free) = (0, 0);
        for frame in 0..48 {
            let sample = groom.at(Case::Storm, f64::from(frame));
            let out = collided(&groom, &sample, 0.0, 0.0);
            for curve in (0..out.crossings.len()).filter(|curve| out.crossings[*curve] > 0) {
                let crossings = out.crossings[curve];
                all += crossings;
                of_free += if crossing::is_free_at_rest(&groom, &sample, &out.points, curve) { crossings } else { 0 };
            }
        }
        println!("{body:7} {all:32} {of_free:23}");
    }
}

fn print_heights(curves: usize) {
    println!("body    kept by            pressed CVs  at most 2 % low  5 % low  within 5 %  length error");
    for body in ["plane", "camel", "folds", "knot", "sphere"] {
        let groom = Groom::on(Body::named(body), curves);
        for by in [KeptBy::OffsetScale(1.0), KeptBy::OffsetScale(0.5), KeptBy::Loft(0.5), KeptBy::Loft(0.1)] {
            let heights = Heights::on(&groom, by, 12);
            let [two, five, within] = heights.percents();
            println!(
                "{body:7} {:17} {:12} {two:14.2} % {five:6.2} % {within:9.2} % {:13.1e}",
                format!("{by:?}"),
                heights.pressed,
                heights.length_error
            );
        }
    }
}

fn collided(groom: &Groom, sample: &Sample, coherence: f64, loft: f64) -> Collided {
    collided_with(groom, sample, |how| Collide { coherence: coherence.into(), loft: loft.into(), ..how })
}

/// Curves collided, with what `set` makes of the settings of the node's defaults.
fn collided_with<'a>(groom: &'a Groom, sample: &'a Sample, set: impl FnOnce(Collide<'a>) -> Collide<'a>) -> Collided {
    let obstacles = [&sample.tree];
    let how = set(Collide {
        obstacles: &[],
        skin: Some(SkinSurface { tree: &sample.tree, triangles: &groom.body.triangles, normals: &sample.normals }),
        method: ContactMethod::Exact,
        gap: 1e-4.into(),
        offset_root: 1e-4.into(),
        offset_scale: None,
        loft: 0.0.into(),
        coherence: 0.0.into(),
        at_rest: None,
        blend: 1.0.into(),
        width: 0.0.into(),
    });
    collide(&groom.starts, &sample.rest, &sample.goal, &Collide { obstacles: &obstacles, ..how })
}

/// What pairs of samples add up to.
#[derive(Clone, Default)]
struct Sums {
    /// How far each tip moved, in lengths.
    ways: Vec<f64>,
    /// Jumps of curves that did not jump in the wind alone.
    added: usize,
    /// The sum of the tips' distances from rest, in lengths.
    from_rest: f64,
    samples: f64,
    contacts: u64,
    crossings: u64,
    blended: u64,
}

impl Sums {
    fn add(&mut self, groom: &Groom, at: &Sample, [before, after]: [&Collided; 2], blown: &[f64]) {
        let moved = ways(groom, &before.points, &after.points);
        self.added += moved.iter().zip(blown).filter(|(way, blown)| **way > JUMP && **blown <= JUMP).count();
        self.ways.extend(moved);
        self.from_rest += ways(groom, &at.rest, &before.points).iter().sum::<f64>();
        self.samples += 1.0;
        self.contacts += before.contacts;
        self.crossings += before.crossings_left;
        self.blended += before.blended_to_rest;
    }

    /// Share of tips, in percent, that jump where those of the wind alone do not.
    fn added_percent(&self) -> f64 {
        100.0 * self.added as f64 / self.ways.len() as f64
    }

    fn row(mut self, wind: &[f64]) -> String {
        self.ways.sort_by(f64::total_cmp);
        let high = self.ways.get(self.ways.len() * 999 / 1000).copied().unwrap_or(0.0);
        let each = |sum: u64| sum as f64 / self.samples;
        let from_rest = self.from_rest / self.ways.len() as f64;
        format!(
            "{:8.4} {:9.4} {:8.4} {high:15.3} {:10.0} {:10.2} {:8.1} {from_rest:13.4}",
            jumps(&self.ways),
            jumps(wind),
            self.added_percent(),
            each(self.contacts),
            each(self.crossings),
            each(self.blended),
        )
    }
}

/// Share of ways above a quarter of the length, in percent.
fn jumps(ways: &[f64]) -> f64 {
    100.0 * ways.iter().filter(|way| **way > JUMP).count() as f64 / ways.len() as f64
}

/// How far each tip moved, in lengths of its curve.
fn ways(groom: &Groom, before: &[Vec3], after: &[Vec3]) -> Vec<f64> {
    let distance = |a: Vec3, b: Vec3| f64::from(length(sub(a, b)));
    let way = |ends: &[u32]| {
        let cvs = ends[0] as usize..ends[1] as usize;
        assert_eq!(cvs.len(), CVS, "curves of other CVs");
        let long: f64 = after[cvs.clone()].windows(2).map(|pair| distance(pair[0], pair[1])).sum();
        // Seen from the root, so that the speed of the skin does not count.
        let [before, after] = [before, after].map(|points| sub(points[cvs.end - 1], points[cvs.start]));
        distance(before, after) / long
    };
    groom.starts.windows(2).map(way).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// On a still skin in wind that turns by 1° a frame, few tips jump that the wind alone does not make jump.
    #[test]
    fn coherent_collision_adds_few_jumps_on_bodies_of_all_kinds() {
        for (body, most) in [("camel", 0.05), ("folds", 0.07), ("knot", 0.01), ("sphere", 0.003)] {
            let groom = Groom::on(Body::named(body), 10_000);
            let (sums, _) = compared(&groom, (Case::Still, 1.0), 12, &[1.0], 0.0);
            let [sums] = &sums[..] else { panic!("one coherence, so one sum") };
            let (added, crossings) = (sums.added_percent(), sums.crossings as f64 / sums.samples);
            println!("{body}: {added:.4} % of tips jump, {crossings} segments cross");
            assert!(added <= most && crossings <= 1.0, "{body}: {added} % of at most {most}, {crossings} crossings");
        }
    }

    /// What moves by more than a quarter of its length in a degree of wind on a sphere does so evenly: in a part of the degree it moves by
    /// little more than that part of the way.
    #[test]
    fn the_last_fast_tip_on_a_sphere_does_not_jump() {
        let groom = Groom::on(Body::named("sphere"), 10_000);
        let found = jumping(&groom, 80.0, 1.0);
        assert!(found.len() <= 1, "{found:?}");
        for curve in found {
            let one = groom.only(curve);
            let [whole, parts] = [1, 16].map(|cuts| longest_step(&one, 80.0, cuts).collided);
            assert!(whole > JUMP && parts < 1.5 * whole / 16.0, "{parts} of {whole}");
        }
    }
}
