//! Memory: what is kept and dropped, and results that do not depend on threads or memory.

use engine::cook::DiskCache;
use engine::geometry::{Component, Geometry, Kind, Owner};
use engine::graph::Link;
use engine::node::{Chain, Cook, FrameCx, Input, Metric, Node, Output, Outputs, StepCx};
use engine::time::Frame;
use engine::{Result, inputs, metrics};
use serde::{Deserialize, Serialize};

use crate::builder::{Cooked, TestGraph, engine};
use crate::nodes::{ADD, BOUNCE, CLOCK, DUST, DUSTY, FOLLOW, SOURCE, SUM, UNSURE_NODE};

fn dusty(attributes: Option<Vec<engine::geometry::Name>>) -> Cooked {
    let mut graph = TestGraph::new(1, 2);
    let a = graph.add("a", &SOURCE).done();
    let dusty = graph.add("dusty", &DUSTY).wire("points", a).done();
    let add = graph.add("add", &ADD).wire("points", dusty).done();
    graph.output(add).attributes = attributes;
    graph.cook(1..=2)
}

fn has_dust(geometry: &Geometry) -> bool {
    geometry.points().is_some_and(|points| points.table(Owner::Point).column("dust").is_some())
}

#[test]
fn an_attribute_that_nothing_reads_is_dropped() {
    let all = dusty(None);
    assert!(has_dust(all.geometry(1.0)));
    assert_eq!(all.node("dusty").metrics["wanted"].values().next(), Some(&1.0));
    let requested = dusty(Some(vec!["dust".into()]));
    assert!(has_dust(requested.geometry(2.0)));
    let none = dusty(Some(Vec::new()));
    assert!(!has_dust(none.geometry(1.0)));
    assert_eq!(none.node("dusty").metrics["wanted"].values().next(), Some(&0.0));
    let other = dusty(Some(vec!["colour".into()]));
    assert!(!has_dust(other.geometry(1.0)));
}

const FEW: Output = Output::new("few", &[Kind::Points], "A point.");
const MANY: Output = Output::new("many", &[Kind::Points], "Many points.");

metrics! { TWO_METRICS:
    MANY_WANTED = Metric::new("many_wanted", engine::param::Unit::None, "1 where `many` is made.");
}

/// Points of `many`.
const COUNT: usize = 10_000;

/// A solver with two outputs, of which it makes `many` only where that is wanted.
#[derive(Serialize, Deserialize)]
struct Two(f32);

impl Chain for Two {
    fn start(cx: &FrameCx) -> Result<Self> {
        Ok(Self(cx.frame().number() as f32))
    }

    fn step(&mut self, _: &StepCx) -> Result<()> {
        self.0 += 1.0;
        Ok(())
    }

    fn output(&self, cx: &FrameCx) -> Result<Outputs> {
        let points = |count: usize| Geometry::from(Component::points(vec![[self.0, 0.0, 0.0]; count]));
        cx.publish(MANY_WANTED, f64::from(u8::from(cx.wants_output(MANY))));
        let few = FEW.with(points(1));
        Ok(if cx.wants_output(MANY) { few.and(MANY, points(COUNT)) } else { few })
    }
}

static TWO: Node = Node::new("Two", 1, "A solver with two outputs.", Cook::solver::<Two>(|_| None))
    .outputs(&[&FEW, &MANY])
    .metrics(TWO_METRICS);

#[test]
fn an_output_of_a_solver_that_nothing_reads_is_not_kept() {
    let graph = |ports: &[usize]| {
        let mut graph = TestGraph::new(1, 8);
        let Link { node, .. } = graph.add("two", &TWO).done();
        for port in ports {
            graph.output(Link { node, port: *port });
        }
        graph
    };
    // One engine for all: what a cook of one output leaves behind is not taken for the other.
    let engine = engine(2, 1 << 30);
    let wanted = |cooked: &Cooked| cooked.node("two").metrics["many_wanted"].values().all(|wanted| *wanted == 1.0);
    let few = graph(&[0]).cook_in(&engine, 1..=8);
    assert!(!wanted(&few) && few.report.peak_bytes < COUNT, "{}", few.report.peak_bytes);
    let many = graph(&[1]).cook_in(&engine, 1..=8);
    assert!(wanted(&many) && many.report.peak_bytes > 12 * COUNT);
    assert_eq!(many.geometry(8.0).points().map(Component::point_count), Some(COUNT));
    let both = graph(&[0, 1]).cook_in(&engine, 1..=8);
    assert!(wanted(&both) && both.x(8.0) == 8.0 && few.x(8.0) == 8.0 && many.x(8.0) == 8.0);
    // Results on disk are for cooks of other outputs, too.
    let folder = tempfile::tempdir().expect("a folder");
    let mut disk = DiskCache::open(folder.path(), u64::MAX);
    let frames: Vec<Frame> = (1..=8).map(Frame::whole).collect();
    assert!(wanted(&graph(&[0]).cook_with(&engine, &frames, Some(&mut disk))));
}

inputs! { SWEEP_INPUTS: SWEEP_POINTS: Input = Input::one("points", Kind::Points, "Points."); }
const SWEPT: Output = Output::like("points", &SWEEP_POINTS, "The points.");

/// Reads `dust` where it is there.
static SWEEP: Node = Node::new(
    "Sweep",
    1,
    "Reads `dust` where it is there.",
    Cook::Pure(|cx| Ok(SWEPT.with(cx.input(SWEEP_POINTS).clone()))),
)
.inputs(SWEEP_INPUTS)
.outputs(&[&SWEPT])
.reads(&[&DUST])
.reads_if_there(&[&DUST]);

#[test]
fn an_attribute_that_is_read_only_where_it_is_there_is_wanted_but_not_needed() {
    let metrics = |attributes: &[&str], also_itself: bool| {
        let mut graph = TestGraph::new(1, 1);
        let a = graph.add("a", &SOURCE).done();
        let dusty = graph.add("dusty", &DUSTY).wire("points", a).done();
        let sweep = graph.add("sweep", &SWEEP).wire("points", dusty).done();
        graph.output(sweep).attributes = Some(attributes.iter().map(|name| (*name).into()).collect());
        if also_itself {
            graph.output(dusty).attributes = Some(vec!["dust".into()]);
        }
        let cooked = graph.cook([1]);
        ["wanted", "needed"].map(|metric| cooked.node("dusty").metrics[metric].values().next().copied())
    };
    assert_eq!(metrics(&[], false), [Some(1.0), Some(0.0)]);
    assert_eq!(
        metrics(&["dust"], false),
        [Some(1.0); 2],
        "an output that names it has it, through the node that reads it"
    );
    assert_eq!(metrics(&[], true), [Some(1.0); 2]);
}

#[test]
fn unchanged_attributes_are_shared_up_to_the_last_node() {
    let mut graph = TestGraph::new(1, 1);
    let a = graph.add("a", &SOURCE).done();
    let dusty = graph.add("dusty", &DUSTY).wire("points", a).done();
    graph.output(dusty);
    let b = graph.add("b", &ADD).wire("points", dusty).done();
    graph.add("c", &ADD).wire("points", b).out();
    let cooked = graph.cook([1]);
    let address = |output: usize| {
        let points = cooked.found[&(output, crate::builder::at(1.0))].points();
        points.and_then(|points| points.table(Owner::Point).column("dust")).map(engine::geometry::Column::address)
    };
    assert!(address(0).is_some());
    assert_eq!(address(0), address(1));
}

#[test]
fn metrics_are_reported_also_for_cached_results() {
    let mut graph = TestGraph::new(1, 20);
    let a = graph.add("a", &SOURCE).done();
    let clock = graph.add("clock", &CLOCK).set("amount", 0.0_f32).wire("points", a).done();
    graph.add("moving", &CLOCK).wire("points", clock).out();
    let engine = engine(1, 1 << 30);
    for _ in 0..2 {
        let cooked = graph.cook_in(&engine, 1..=20);
        assert_eq!(cooked.node("clock").metrics["height"].values().copied().collect::<Vec<_>>(), [1.0]);
        assert_eq!(cooked.node("moving").metrics["height"].len(), 20);
    }
}

#[test]
fn a_metric_that_is_no_number_is_left_out_with_a_note() {
    let mut graph = TestGraph::new(1, 3);
    let a = graph.add("a", &SOURCE).done();
    graph.add("unsure", &UNSURE_NODE).wire("points", a).out();
    let cooked = graph.cook(1..=3);
    let metrics = &cooked.node("unsure").metrics["unsure"];
    assert_eq!(metrics.iter().map(|(frame, value)| (frame.number(), *value)).collect::<Vec<_>>(), [(1.0, 0.5)]);
    let notes: Vec<String> = cooked.report.notes.iter().map(ToString::to_string).collect();
    assert_eq!(notes, ["`unsure` (Unsure) reports no `unsure` at frame 2, because it is infinite"]);
}

/// A graph with all kinds of nodes and a few thousand points.
fn everything() -> TestGraph {
    let mut graph = TestGraph::new(1, 40);
    let a = graph.add("a", &SOURCE).set("count", 1000_i64).done();
    let still = graph.add("still", &ADD).set("amount", 0.5_f32).wire("points", a).done();
    let clock = graph.add("clock", &CLOCK).set("amount", 0.1_f32).wire("points", still).done();
    let held = graph.add("held", &ADD).keyed("amount", &[(10.0, 0.0), (14.0, 1.0)]).wire("points", still).done();
    let follow = graph.add("follow", &FOLLOW).set("frames", 11_i64).wire("points", clock).done();
    let bounce = graph.add("bounce", &BOUNCE).wire("points", held).wire("floor", follow).done();
    graph.output(follow);
    graph.output(held);
    graph.add("sum", &SUM).wire("points", bounce).wire("points", follow).wire("points", still).out();
    graph
}

#[test]
fn results_do_not_depend_on_threads_and_memory() {
    let graph = everything();
    let reference = graph.cook_in(&engine(1, 1 << 30), 1..=40).bits();
    for threads in [1, 2, 7] {
        for memory in [0, 30_000, 1 << 30] {
            let cooked = graph.cook_in(&engine(threads, memory), 1..=40);
            assert!(cooked.report.errors.is_empty());
            assert!(cooked.bits() == reference, "{threads} threads, {memory} bytes");
        }
    }
}

#[test]
fn results_do_not_depend_on_the_order_of_requested_frames() {
    let graph = everything();
    let reference = graph.cook(1..=40).bits();
    let engine = engine(2, 100_000);
    for frames in [vec![40], vec![3, 1, 2], vec![39, 1], (20..30).collect(), vec![9], vec![8]] {
        for (key, bits) in graph.cook_in(&engine, frames.iter().copied()).bits() {
            assert!(reference[&key] == bits, "output {} at {}", key.0, key.1);
        }
    }
}

#[test]
fn kept_results_stay_below_the_memory_limit() {
    // Static results of 12,000 bytes, each read by an animated node.
    let mut graph = TestGraph::new(1, 30);
    let a = graph.add("a", &SOURCE).set("count", 1000_i64).done();
    let ids: Vec<&'static str> = vec!["b0", "b1", "b2", "b3", "b4", "b5", "b6", "b7", "b8", "b9"];
    for (k, id) in ids.into_iter().enumerate() {
        let still = graph.add(id, &ADD).set("amount", k as f32).wire("points", a).done();
        graph.add("moving", &CLOCK).wire("points", still).out();
    }
    let roomy = graph.cook_in(&engine(1, 1 << 30), 1..=30);
    let tight = graph.cook_in(&engine(1, 60_000), 1..=30);
    assert!(roomy.bits() == tight.bits());
    // One frame takes 21 results; half of the memory is for results kept between slices.
    assert!(tight.report.peak_bytes <= 21 * 12_000 + 30_000, "{}", tight.report.peak_bytes);
    assert!(tight.report.peak_bytes < roomy.report.peak_bytes);
}

#[test]
fn memory_does_not_grow_with_the_number_of_frames() {
    let graph = everything();
    let engine = |frames: i64| graph.cook_in(&engine(1, 1 << 30), 1..=frames).report.peak_bytes;
    let few = engine(100);
    assert!(engine(1000) <= few + few / 50, "{} for 1,000 frames, {few} for 100", engine(1000));
}

#[test]
fn nothing_made_of_given_geometry_outlives_its_cook() {
    let engine = engine(1, 1 << 30);
    let mut graph = TestGraph::new(1, 4);
    let given = graph.still("given", crate::builder::row(&[0.0; 1000]));
    let still = graph.add("still", &ADD).set("amount", 1.0_f32).wire("points", given).done();
    graph.add("moving", &CLOCK).wire("points", still).out();
    let peaks = [(); 3].map(|()| graph.cook_in(&engine, 1..=4).report.peak_bytes);
    assert_eq!(peaks, [peaks[0]; 3]);
}
