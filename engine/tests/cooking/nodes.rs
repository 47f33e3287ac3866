//! Small nodes, each for one property of the engine. All of them move points along x.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

use engine::geometry::{Attr, Component, Geometry, P};
use engine::node::{Chain, Opt, Past, Resumable};
use engine::node::{Cook, Cx, FrameCx, Input, Many, Metric, Node, Output, Outputs, StepCx, Times};
use engine::param::{Clock, Param, Params, Unit};
use engine::{Error, Result, inputs, params};
use serde::{Deserialize, Serialize};

/// Records the calls of the nodes whose param `probe` is its number.
pub(crate) struct Probe(i64);

static CALLS: Mutex<BTreeMap<i64, Vec<Call>>> = Mutex::new(BTreeMap::new());

/// A recorded call.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Call {
    /// The function that was called: `cook`, `start`, `step` or `output`.
    pub(crate) part: &'static str,
    /// The frame, if the node can read it.
    pub(crate) frame: Option<f64>,
    /// Times at which an input was sampled.
    pub(crate) samples: Vec<f64>,
}

impl Probe {
    /// A probe with a unique number, so that tests that run in parallel do not count each other's calls.
    pub(crate) fn new() -> Self {
        let mut calls = CALLS.lock().unwrap_or_else(PoisonError::into_inner);
        let number = calls.len() as i64 + 1;
        calls.insert(number, Vec::new());
        Self(number)
    }

    /// The value for the param `probe`.
    pub(crate) fn number(&self) -> i64 {
        self.0
    }

    pub(crate) fn calls(&self) -> Vec<Call> {
        CALLS.lock().unwrap_or_else(PoisonError::into_inner)[&self.0].clone()
    }

    pub(crate) fn count(&self) -> usize {
        self.calls().len()
    }

    /// Frames of the calls of one function, in order.
    pub(crate) fn frames(&self, part: &str) -> Vec<f64> {
        self.calls().iter().filter(|call| call.part == part).filter_map(|call| call.frame).collect()
    }
}

fn record(cx: &Cx, part: &'static str, frame: Option<f64>, samples: Vec<f64>) {
    let mut calls = CALLS.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(calls) = calls.get_mut(&cx.get(PROBE)) {
        calls.push(Call { part, frame, samples });
    }
}

const PROBE: Param<i64> = Param::int("probe", 0, "Which probe counts the calls.");
const AMOUNT: Param<f32> = Param::float("amount", 1.0, "How far.").unit(Unit::Metres);
const POINTS: Input = Input::one("points", engine::geometry::Kind::Points, "Points to move.");
const OUT: Output = Output::new("points", &[engine::geometry::Kind::Points], "The points, moved.");

/// The input's points with x changed.
fn moved(input: &Geometry, change: impl Fn(f32) -> f32) -> Result<Geometry> {
    let mut geometry = input.clone();
    if let Some(points) = geometry.part_mut(engine::geometry::Kind::Points) {
        points.edit(P).into_iter().flatten().for_each(|p| p[0] = change(p[0]));
    }
    Ok(geometry)
}

fn first_x(geometry: &Geometry) -> f32 {
    geometry.points().and_then(|points| points.positions().first()).map_or(0.0, |p| p[0])
}

// ——— pure ———

params! { SOURCE_PARAMS:
    COUNT: Param<i64> = Param::int("count", 1, "How many points.").at_least(0.0);
    SOURCE_AMOUNT: Param<f32> = AMOUNT;
    SOURCE_PROBE: Param<i64> = PROBE;
}

/// `count` points at x = `amount`.
pub(crate) static SOURCE: Node = Node::new(
    "Source",
    1,
    "Points at one position.",
    Cook::Pure(|cx| {
        record(cx, "cook", None, Vec::new());
        Ok(OUT.with(Geometry::from(Component::points(vec![[cx.get(SOURCE_AMOUNT), 0.0, 0.0]; cx.get(COUNT) as usize]))))
    }),
)
.params(SOURCE_PARAMS)
.outputs(&[&OUT]);

params! { ADD_PARAMS:
    ADD_AMOUNT: Param<f32> = AMOUNT;
    TWICE: Param<bool> = Param::bool("twice", false, "Adds `more` too.");
    MORE: Param<f32> = Param::float("more", 0.0, "How much more.").when(|params| params.get(TWICE));
    ADD_PROBE: Param<i64> = PROBE;
}
inputs! { ADD_INPUTS: ADD_POINTS: Input = POINTS; }

/// Adds `amount`, and `more` if `twice` is set.
pub(crate) static ADD: Node = Node::new(
    "Add",
    1,
    "Moves points.",
    Cook::Pure(|cx| {
        record(cx, "cook", None, Vec::new());
        let more = if cx.get(TWICE) { cx.get(MORE) } else { 0.0 };
        let amount = cx.get(ADD_AMOUNT) + more;
        Ok(OUT.with(moved(cx.input(ADD_POINTS), |x| x + amount)?))
    }),
)
.inputs(ADD_INPUTS)
.params(ADD_PARAMS)
.outputs(&[&OUT])
.writes(&[&P]);

inputs! { SUM_INPUTS: SUM_POINTS: Input<Many> = Input::many("points", engine::geometry::Kind::Points, "Points to add up."); }
params! { SUM_PARAMS: SUM_PROBE: Param<i64> = PROBE; }

/// One point at the sum of the first points' x.
pub(crate) static SUM: Node = Node::new(
    "Sum",
    1,
    "Adds points up.",
    Cook::Pure(|cx| {
        record(cx, "cook", None, Vec::new());
        let sum = cx.input(SUM_POINTS).iter().map(|wire| first_x(wire)).sum::<f32>();
        Ok(OUT.with(Geometry::from(Component::points(vec![[sum, 0.0, 0.0]]))))
    }),
)
.inputs(SUM_INPUTS)
.params(SUM_PARAMS)
.outputs(&[&OUT]);

// ——— frame ———

params! { CLOCK_PARAMS:
    CLOCK_AMOUNT: Param<f32> = AMOUNT;
    CLOCK_PROBE: Param<i64> = PROBE;
}
inputs! { CLOCK_INPUTS: CLOCK_POINTS: Input = POINTS; }

const HEIGHT: Metric = Metric::new("height", Unit::Metres, "How far the first point is.");

/// Adds `amount` × frame. If `amount` is 0, it does not read the clock.
pub(crate) static CLOCK: Node = Node::new(
    "Clock",
    1,
    "Moves points with the clock.",
    Cook::Frame {
        cook: |cx| {
            record(cx, "cook", Some(cx.frame().number()), Vec::new());
            let amount = cx.get(CLOCK_AMOUNT) * cx.frame().number() as f32;
            let geometry = moved(cx.input(CLOCK_POINTS), |x| x + amount)?;
            cx.publish(HEIGHT, f64::from(first_x(&geometry)));
            Ok(OUT.with(geometry))
        },
        reads_clock: |params| params.get(CLOCK_AMOUNT) != 0.0,
    },
)
.inputs(CLOCK_INPUTS)
.params(CLOCK_PARAMS)
.outputs(&[&OUT])
.metrics(&[&HEIGHT])
.writes(&[&P]);

params! { DRIFT_PARAMS:
    SPEED: Param<f32> = Param::float("speed", 1.0, "How fast.").unit(Unit::MetresPerSecond).history();
    UPTO: Param<f32> = Param::float("upto", 0.0, "Number of frames before the current one at which the integral ends.");
}
inputs! { DRIFT_INPUTS: DRIFT_POINTS: Input = POINTS; }

/// Adds ∫ speed dt from time 0.
pub(crate) static DRIFT: Node = Node::new(
    "Drift",
    1,
    "Moves points at a keyed speed.",
    Cook::Frame {
        cook: |cx| {
            let upto = cx.frame().plus(-(cx.get(UPTO) as i64));
            let displacement = cx.integral(upto)[0] as f32;
            Ok(OUT.with(moved(cx.input(DRIFT_POINTS), |x| x + displacement)?))
        },
        reads_clock: |_| true,
    },
)
.inputs(DRIFT_INPUTS)
.params(DRIFT_PARAMS)
.outputs(&[&OUT])
.integrates(|params| [f64::from(params.get(SPEED)), 0.0, 0.0])
.writes(&[&P]);

params! { SPREAD_PARAMS:
    SPREAD_SPEED: Param<f32> = Param::float("speed", 1.0, "How fast.").unit(Unit::MetresPerSecond).history();
    SHARE: Param<f32> = Param::float("share", 1.0, "Factor of the displacement.").at_least(0.0);
}
inputs! { SPREAD_INPUTS: SPREAD_POINTS: Input = POINTS; }

/// Adds share · (∫ speed dt + ∫ speed² dt) from time 0.
pub(crate) static SPREAD: Node = Node::new(
    "Spread",
    1,
    "Moves points at a keyed speed and at its square.",
    Cook::Frame {
        cook: |cx| {
            let [linear, square] = cx.integrals(cx.frame());
            let displacement = cx.get(SHARE) * (linear[0] + square[1]) as f32;
            Ok(OUT.with(moved(cx.input(SPREAD_POINTS), |x| x + displacement)?))
        },
        reads_clock: |_| true,
    },
)
.inputs(SPREAD_INPUTS)
.params(SPREAD_PARAMS)
.outputs(&[&OUT])
.integrates(|params| [f64::from(params.get(SPREAD_SPEED)), 0.0, 0.0])
.integrates(|params| {
    let speed = f64::from(params.get(SPREAD_SPEED));
    [0.0, speed * speed, 0.0]
})
.writes(&[&P]);

params! { FROM_START_PARAMS: FROM_START_PROBE: Param<i64> = PROBE; }
inputs! { FROM_START_INPUTS:
    FROM_POINTS: Input = POINTS;
    REST: Input = Input::one("rest", engine::geometry::Kind::Points, "Where points were.").read_at(|_| Times::START);
}

/// How far points are from where `rest` was at the scene's start.
pub(crate) static FROM_START: Node = Node::new(
    "From_Start",
    1,
    "Motion since the start.",
    Cook::Pure(|cx| {
        record(cx, "cook", None, Vec::new());
        let rest = first_x(cx.at_start(REST));
        Ok(OUT.with(moved(cx.input(FROM_POINTS), |x| x - rest)?))
    }),
)
.inputs(FROM_START_INPUTS)
.params(FROM_START_PARAMS)
.outputs(&[&OUT])
.writes(&[&P]);

params! { FAIL_PARAMS:
    HOW: Param<i64> = Param::int("how", 0, "0: succeeds; 1: panics; 2: returns NaN; 3: refuses; 4: returns no output.");
    WHEN: Param<i64> = Param::int("at", 3, "At which frame.");
}
inputs! { FAIL_INPUTS: FAIL_POINTS: Input = POINTS; }

/// Fails at one frame.
pub(crate) static FAIL: Node = Node::new(
    "Fail",
    1,
    "Fails.",
    Cook::Frame {
        cook: |cx| {
            let now = cx.frame().number() == cx.get(WHEN) as f64;
            match cx.get(HOW) {
                1 if now => panic!("all is lost"),
                2 if now => {
                    let mut geometry = cx.input(FAIL_POINTS).clone();
                    let points = geometry.part_mut(engine::geometry::Kind::Points).expect("checked");
                    if let Some(last) = points.edit(P).and_then(<[_]>::last_mut) {
                        last[1] = f32::NAN;
                    }
                    Ok(OUT.with(geometry))
                }
                3 if now => Err(Error::refused("there is no such frame").hint("ask for another")),
                4 if now => Ok(Outputs::default()),
                _ => Ok(OUT.with(cx.input(FAIL_POINTS).clone())),
            }
        },
        reads_clock: |_| true,
    },
)
.inputs(FAIL_INPUTS)
.params(FAIL_PARAMS)
.outputs(&[&OUT])
.writes(&[&P]);

/// An attribute that is only needed if something downstream reads it.
pub(crate) const DUST: Attr<f32> = Attr::point("dust");
const WANTED: Metric = Metric::new("wanted", Unit::None, "1 if something downstream reads `dust`.");
const NEEDED: Metric =
    Metric::new("needed", Unit::None, "1 if something downstream reads `dust` even if it is neutral.");
inputs! { DUSTY_INPUTS: DUSTY_POINTS: Input = POINTS; }

/// Writes `dust`.
pub(crate) static DUSTY: Node = Node::new(
    "Dusty",
    1,
    "Writes `dust`.",
    Cook::Pure(|cx| {
        cx.publish(WANTED, f64::from(u8::from(cx.wants(DUST))));
        cx.publish(NEEDED, f64::from(u8::from(cx.needs(DUST))));
        let mut geometry = cx.input(DUSTY_POINTS).clone();
        if let Some(points) = geometry.part_mut(engine::geometry::Kind::Points) {
            let rows = points.point_count();
            points.set(DUST, vec![0.5; rows])?;
        }
        Ok(OUT.with(geometry))
    }),
)
.inputs(DUSTY_INPUTS)
.outputs(&[&OUT])
.metrics(&[&WANTED, &NEEDED])
.writes(&[&DUST]);

const UNSURE: Metric = Metric::new("unsure", Unit::None, "Infinite at frame 2, undefined at frame 3.");
inputs! { UNSURE_INPUTS: UNSURE_POINTS: Input = POINTS; }

/// Publishes what no file can hold.
pub(crate) static UNSURE_NODE: Node = Node::new(
    "Unsure",
    1,
    "Publishes what no file can hold.",
    Cook::Frame {
        cook: |cx| {
            let value = [0.5, f64::INFINITY, f64::NAN][cx.frame().floor_number().clamp(1, 3) as usize - 1];
            cx.publish(UNSURE, value);
            Ok(OUT.with(cx.input(UNSURE_POINTS).clone()))
        },
        reads_clock: |_| true,
    },
)
.inputs(UNSURE_INPUTS)
.outputs(&[&OUT])
.metrics(&[&UNSURE]);

// ——— window ———

params! { FOLLOW_PARAMS:
    FRAMES: Param<i64> = Param::int("frames", 8, "Length of the window.").unit(Unit::Frames).at_least(0.0);
    PREROLL: Param<i64> = Param::int("preroll", 0, "Frames before the scene's first that it reads.").unit(Unit::Frames)
        .at_least(0.0);
    RATE: Param<f32> = Param::float("rate", 0.5, "Fraction of the distance covered per frame.").within(0.0, 1.0);
    FOLLOW_PROBE: Param<i64> = PROBE;
}
inputs! { FOLLOW_INPUTS:
    FOLLOW_POINTS: Input = POINTS;
    ANCHOR: Input<Opt> = Input::optional("anchor", engine::geometry::Kind::Points, "Points that the result is relative to.")
        .read_at(|_| Times::START);
}

/// An exponential filter: follows its input.
struct Follow {
    xs: Vec<f32>,
    anchor: f32,
}

impl Chain for Follow {
    fn start(cx: &FrameCx) -> Result<Self> {
        record(cx, "start", Some(cx.frame().number()), Vec::new());
        let anchor = cx.at_start(ANCHOR).map_or(0.0, first_x);
        Ok(Self { xs: cx.part(FOLLOW_POINTS).positions().iter().map(|p| p[0]).collect(), anchor })
    }

    fn step(&mut self, cx: &StepCx) -> Result<()> {
        record(cx, "step", Some(cx.frame().number()), Vec::new());
        let rate = cx.get(RATE);
        for (x, goal) in self.xs.iter_mut().zip(cx.part(FOLLOW_POINTS).positions()) {
            *x += (goal[0] - *x) * rate;
        }
        Ok(())
    }

    fn output(&self, cx: &FrameCx) -> Result<Outputs> {
        record(cx, "output", Some(cx.frame().number()), Vec::new());
        let mut geometry = cx.input(FOLLOW_POINTS).clone();
        let points = geometry.part_mut(engine::geometry::Kind::Points).expect("the engine checks what an input needs");
        points.set(P, self.xs.iter().map(|x| [*x - self.anchor, 0.0, 0.0]).collect())?;
        Ok(OUT.with(geometry))
    }
}

impl Resumable for Follow {
    type Saved = Vec<f32>;

    fn save(&self) -> Self::Saved {
        self.xs.clone()
    }

    fn resume(xs: Self::Saved, cx: &FrameCx) -> Result<Self> {
        record(cx, "resume", Some(cx.frame().number()), Vec::new());
        Ok(Self { xs, anchor: cx.at_start(ANCHOR).map_or(0.0, first_x) })
    }
}

fn past(params: &Params, _: Clock) -> Past {
    Past { frames: params.get(FRAMES) as u32, preroll: params.get(PREROLL) as u32 }
}

/// Follows its input, by half of the distance per frame.
const FOLLOW_NODE: Node = Node::new("Follow", 1, "Points that lag.", Cook::resumable_window::<Follow>(past))
    .inputs(FOLLOW_INPUTS)
    .params(FOLLOW_PARAMS)
    .outputs(&[&OUT])
    .writes(&[&P]);

/// Follows its input, by half of the distance per frame.
pub(crate) static FOLLOW: Node = FOLLOW_NODE;

/// The same, as points that move `points`; between frames they are 10 further along than that.
pub(crate) static MOVING: Node = Node { name: "Moving", ..FOLLOW_NODE }.follows(&FOLLOW_POINTS, |input, between| {
    let moved_by = first_x(between) - first_x(input);
    *between = moved(input, |x| x + moved_by + 10.0).expect("as many rows as before");
});

// ——— solver ———

/// The value of a start that is not set.
const UNSET: i64 = -1_000_000;

params! { BOUNCE_PARAMS:
    START: Param<i64> = Param::int("start_frame", UNSET, "The start frame; the scene's first frame if left out.").fixed();
    GRAVITY: Param<f32> = Param::float("gravity", -9.81, "Acceleration.").unit(Unit::MetresPerSecondSquared);
    SAMPLES: Param<i64> = Param::int("samples", 4, "Times within a step at which the floor is read.").within(1.0, 8.0);
    BOUNCE_PROBE: Param<i64> = PROBE;
}
inputs! { BOUNCE_INPUTS:
    DROPPED: Input = Input::one("points", engine::geometry::Kind::Points, "Positions at the start.").read_at(|_| Times::START);
    FLOOR: Input<Opt> = Input::optional("floor", engine::geometry::Kind::Points, "Height of the floor.")
        .read_at(|params| Times::within_step(params.get(SAMPLES) as u8));
    PUSH: Input<Opt> = Input::optional("push", engine::geometry::Kind::Points, "Displacement per frame.");
}

/// Points that fall along x and bounce off a floor.
#[derive(Serialize, Deserialize)]
struct Bounce {
    x: Vec<f64>,
    v: Vec<f64>,
}

impl Chain for Bounce {
    fn start(cx: &FrameCx) -> Result<Self> {
        record(cx, "start", Some(cx.frame().number()), Vec::new());
        let dropped = cx.at_start(DROPPED).points().expect("the engine checks what an input needs");
        let x: Vec<f64> = dropped.positions().iter().map(|p| f64::from(p[0])).collect();
        Ok(Self { v: vec![0.0; x.len()], x })
    }

    fn step(&mut self, cx: &StepCx) -> Result<()> {
        let samples = cx.samples(FLOOR);
        record(cx, "step", Some(cx.frame().number()), samples.iter().map(|(frame, _)| frame.number()).collect());
        let push = cx.input(PUSH).map_or(0.0, |push| f64::from(first_x(push)));
        let steps = samples.len().saturating_sub(1).max(1);
        let dt = cx.dt() / steps as f64;
        for step in 0..steps {
            let wires = samples.get(step + 1).map(|(_, wires)| wires.as_slice()).unwrap_or_default();
            let floor = wires.first().map_or(f64::NEG_INFINITY, |wire| f64::from(first_x(wire)));
            for (x, v) in self.x.iter_mut().zip(&mut self.v) {
                *v += f64::from(cx.get(GRAVITY)) * dt;
                *x += *v * dt + push / steps as f64;
                if *x < floor {
                    (*x, *v) = (floor, -0.5 * *v);
                }
            }
        }
        Ok(())
    }

    fn output(&self, cx: &FrameCx) -> Result<Outputs> {
        record(cx, "output", Some(cx.frame().number()), Vec::new());
        Ok(OUT.with(Geometry::from(Component::points(self.x.iter().map(|x| [*x as f32, 0.0, 0.0]).collect()))))
    }
}

/// Drops points.
pub(crate) static BOUNCE: Node = Node::new(
    "Bounce",
    1,
    "Points that fall and bounce.",
    Cook::solver::<Bounce>(|params| Some(params.get(START)).filter(|start| *start != UNSET)),
)
.inputs(BOUNCE_INPUTS)
.params(BOUNCE_PARAMS)
.outputs(&[&OUT]);
