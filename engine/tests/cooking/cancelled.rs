//! What a cancelled cook leaves behind.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicI64, Ordering};

use engine::cook::{Delivered, DiskCache};
use engine::geometry::{Component, Geometry, Kind};
use engine::node::{Chain, Cook, FrameCx, Node, Output, Outputs, StepCx};
use engine::param::Param;
use engine::plan::Request;
use engine::time::Frame;
use engine::{Error, params};
use serde::{Deserialize, Serialize};

use crate::builder::{TestGraph, engine, row};

const OUT: Output = Output::new("points", &[Kind::Points], "A point.");

/// Cancels the cooks that are given it.
static CANCEL: AtomicBool = AtomicBool::new(false);

/// Held by tests that cancel.
static ALONE: Mutex<()> = Mutex::new(());

/// A point at x = frame; cancels the cook on the way.
static CANCELLING: Node = Node::new(
    "Cancelling",
    1,
    "A point, and the end of the cook.",
    Cook::Frame {
        cook: |cx| {
            CANCEL.store(true, Ordering::Relaxed);
            Ok(OUT.with(row(&[cx.frame().number() as f32])))
        },
        reads_clock: |_| true,
    },
)
.outputs(&[&OUT]);

/// Gives up where the cook is cancelled.
static PATIENT: Node = Node::new(
    "Patient",
    1,
    "A point, unless the cook is cancelled.",
    Cook::Frame {
        cook: |cx| {
            CANCEL.store(true, Ordering::Relaxed);
            cx.check_cancelled()?;
            Ok(OUT.with(row(&[0.0])))
        },
        reads_clock: |_| true,
    },
)
.outputs(&[&OUT]);

#[test]
fn a_result_that_is_finished_after_a_cancellation_is_kept() {
    let _alone = ALONE.lock();
    for (node, kept) in [(&CANCELLING, 1), (&PATIENT, 0)] {
        let mut graph = TestGraph::new(1, 40);
        graph.add("stopped", node).out();
        let folder = tempfile::tempdir().expect("a folder");
        let cook = || {
            CANCEL.store(false, Ordering::Relaxed);
            let mut disk = DiskCache::open(folder.path(), u64::MAX).keeping_all();
            let mut sink = |_: &[Delivered]| -> Result<(), std::convert::Infallible> { Ok(()) };
            let request = Request::everything(&graph.0);
            let cooked = engine(2, 1 << 30).cook(&graph.0, &request, Some(&mut disk), &CANCEL, &mut sink);
            let report = cooked.unwrap_or_else(|stop| panic!("{stop:?}"));
            assert!(report.cancelled && report.errors.is_empty(), "{:?}", report.errors);
            report.nodes[0].from_cache
        };
        assert_eq!([cook(), cook()], [0, kept], "{}", node.name);
    }
}

params! { SUMMING_PARAMS:
    SPEED: Param<f32> = Param::float("speed", 1.0, "How fast.").history();
}

/// The frame whose step cancels the cook.
static CANCELLED_AT: AtomicI64 = AtomicI64::new(0);

/// A point that moves by an integral.
#[derive(Serialize, Deserialize)]
struct Summing(f64);

impl Chain for Summing {
    fn start(_: &FrameCx) -> Result<Self, Error> {
        Ok(Self(0.0))
    }

    fn step(&mut self, cx: &StepCx) -> Result<(), Error> {
        if cx.frame() == Frame::whole(CANCELLED_AT.load(Ordering::Relaxed)) {
            CANCEL.store(true, Ordering::Relaxed);
        }
        self.0 += cx.integral(cx.frame())[0] - cx.integral(cx.previous())[0];
        Ok(())
    }

    fn output(&self, _: &FrameCx) -> Result<Outputs, Error> {
        Ok(OUT.with(Geometry::from(Component::points(vec![[self.0 as f32, 0.0, 0.0]]))))
    }
}

static SUMMING: Node = Node::new("Summing", 1, "A point that moves by an integral.", Cook::solver::<Summing>(|_| None))
    .params(SUMMING_PARAMS)
    .outputs(&[&OUT])
    .integrates(|params| [f64::from(params.get(SPEED)), 0.0, 0.0]);

/// Integrals end early in a cancelled cook: a step that has read one must not be taken for done.
#[test]
fn a_step_that_was_cancelled_is_made_again() {
    let _alone = ALONE.lock();
    let mut graph = TestGraph::new(1, 8);
    graph.add("summing", &SUMMING).keyed("speed", &[(1.0, 0.0), (8.0, 2.0)]).out();
    let whole = graph.cook(1..=8).bits();
    for frame in 2..=8 {
        let folder = tempfile::tempdir().expect("a folder");
        let mut disk = DiskCache::open(folder.path(), u64::MAX).keeping_all();
        CANCEL.store(false, Ordering::Relaxed);
        CANCELLED_AT.store(frame, Ordering::Relaxed);
        let mut sink = |_: &[Delivered]| -> Result<(), std::convert::Infallible> { Ok(()) };
        let request = Request::everything(&graph.0);
        let cooked = engine(1, 1 << 30).cook(&graph.0, &request, Some(&mut disk), &CANCEL, &mut sink);
        assert!(cooked.unwrap_or_else(|stop| panic!("{stop:?}")).cancelled);
        CANCELLED_AT.store(0, Ordering::Relaxed);
        let mut disk = DiskCache::open(folder.path(), u64::MAX).keeping_all();
        let frames: Vec<Frame> = (1..=8).map(Frame::whole).collect();
        let resumed = graph.cook_with(&engine(1, 1 << 30), &frames, Some(&mut disk));
        assert!(resumed.bits() == whole, "cancelled at {frame}");
    }
}
