//! What is held, what is dropped, and that neither threads nor memory change a bit.

use engine::geometry::{Geometry, Owner};

use crate::net::{Cooked, Net, engine};
use crate::nodes::{ADD, BOUNCE, CLOCK, DUSTY, FOLLOW, SOURCE, SUM};

fn dusty(attributes: Option<Vec<engine::geometry::Name>>) -> Cooked {
    let mut net = Net::new(1, 2);
    let a = net.add("a", &SOURCE).done();
    let dusty = net.add("dusty", &DUSTY).wire("points", a).done();
    let add = net.add("add", &ADD).wire("points", dusty).done();
    net.output(add).attributes = attributes;
    net.cook(1..=2)
}

fn has_dust(geometry: &Geometry) -> bool {
    geometry.points().is_some_and(|points| points.table(Owner::Point).column("dust").is_some())
}

#[test]
fn an_attribute_that_nobody_takes_is_not_wanted_and_not_kept() {
    let all = dusty(None);
    assert!(has_dust(all.geometry(1.0)));
    assert_eq!(all.node("dusty").metrics["wanted"].values().next(), Some(&1.0));
    let asked = dusty(Some(vec!["dust".into()]));
    assert!(has_dust(asked.geometry(2.0)));
    let none = dusty(Some(Vec::new()));
    assert!(!has_dust(none.geometry(1.0)));
    assert_eq!(none.node("dusty").metrics["wanted"].values().next(), Some(&0.0));
    let other = dusty(Some(vec!["colour".into()]));
    assert!(!has_dust(other.geometry(1.0)));
}

#[test]
fn what_passes_through_is_shared_to_the_last_node() {
    let mut net = Net::new(1, 1);
    let a = net.add("a", &SOURCE).done();
    let dusty = net.add("dusty", &DUSTY).wire("points", a).done();
    net.output(dusty);
    let b = net.add("b", &ADD).wire("points", dusty).done();
    net.add("c", &ADD).wire("points", b).out();
    let cooked = net.cook([1]);
    let address = |output: usize| {
        let points = cooked.found[&(output, crate::net::at(1.0))].points();
        points.and_then(|points| points.table(Owner::Point).column("dust")).map(engine::geometry::Column::address)
    };
    assert!(address(0).is_some());
    assert_eq!(address(0), address(1));
}

#[test]
fn metrics_are_there_for_every_frame_though_a_result_is_found_again() {
    let mut net = Net::new(1, 20);
    let a = net.add("a", &SOURCE).done();
    let clock = net.add("clock", &CLOCK).set("amount", 0.0_f32).wire("points", a).done();
    net.add("moving", &CLOCK).wire("points", clock).out();
    let engine = engine(1, 1 << 30);
    for _ in 0..2 {
        let cooked = net.cook_in(&engine, 1..=20);
        assert_eq!(cooked.node("clock").metrics["height"].values().copied().collect::<Vec<_>>(), [1.0]);
        assert_eq!(cooked.node("moving").metrics["height"].len(), 20);
    }
}

/// All kinds of nodes, a few thousand points.
fn everything() -> Net {
    let mut net = Net::new(1, 40);
    let a = net.add("a", &SOURCE).set("count", 1000_i64).done();
    let still = net.add("still", &ADD).set("amount", 0.5_f32).wire("points", a).done();
    let clock = net.add("clock", &CLOCK).set("amount", 0.1_f32).wire("points", still).done();
    let held = net.add("held", &ADD).keyed("amount", &[(10.0, 0.0), (14.0, 1.0)]).wire("points", still).done();
    let follow = net.add("follow", &FOLLOW).set("frames", 11_i64).wire("points", clock).done();
    let bounce = net.add("bounce", &BOUNCE).wire("points", held).wire("floor", follow).done();
    net.output(follow);
    net.output(held);
    net.add("sum", &SUM).wire("points", bounce).wire("points", follow).wire("points", still).out();
    net
}

#[test]
fn threads_and_memory_change_no_bit() {
    let net = everything();
    let reference = net.cook_in(&engine(1, 1 << 30), 1..=40).bits();
    for threads in [1, 2, 7] {
        for memory in [0, 30_000, 1 << 30] {
            let cooked = net.cook_in(&engine(threads, memory), 1..=40);
            assert!(cooked.report.errors.is_empty());
            assert!(cooked.bits() == reference, "{threads} threads, {memory} bytes");
        }
    }
}

#[test]
fn the_order_in_which_frames_are_asked_changes_no_bit() {
    let net = everything();
    let reference = net.cook(1..=40).bits();
    let engine = engine(2, 100_000);
    for frames in [vec![40], vec![3, 1, 2], vec![39, 1], (20..30).collect(), vec![9], vec![8]] {
        for (place, bits) in net.cook_in(&engine, frames.iter().copied()).bits() {
            assert!(reference[&place] == bits, "output {} at {}", place.0, place.1);
        }
    }
}

#[test]
fn what_is_held_stays_below_the_memory_that_was_allowed() {
    // Thirty still results of 12,000 bytes, each read by something that moves.
    let mut net = Net::new(1, 30);
    let a = net.add("a", &SOURCE).set("count", 1000_i64).done();
    let ids: Vec<&'static str> = vec!["b0", "b1", "b2", "b3", "b4", "b5", "b6", "b7", "b8", "b9"];
    for (k, id) in ids.into_iter().enumerate() {
        let still = net.add(id, &ADD).set("amount", k as f32).wire("points", a).done();
        net.add("moving", &CLOCK).wire("points", still).out();
    }
    let roomy = net.cook_in(&engine(1, 1 << 30), 1..=30);
    let tight = net.cook_in(&engine(1, 60_000), 1..=30);
    assert!(roomy.bits() == tight.bits());
    // One frame takes 21 results; half of the memory is for what is kept from slice to slice.
    assert!(tight.report.peak_bytes <= 21 * 12_000 + 30_000, "{}", tight.report.peak_bytes);
    assert!(tight.report.peak_bytes < roomy.report.peak_bytes);
}

#[test]
fn memory_does_not_grow_with_the_number_of_frames() {
    let net = everything();
    let engine = |frames: i64| net.cook_in(&engine(1, 1 << 30), 1..=frames).report.peak_bytes;
    let few = engine(100);
    assert!(engine(1000) <= few + few / 50, "{} for 1,000 frames, {few} for 100", engine(1000));
}
