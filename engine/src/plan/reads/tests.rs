//! Frames read, worked out by hand. No node here can be cooked.

use serde::{Deserialize, Serialize};

use super::*;
use crate::geometry::{Geometry, Kind};
use crate::graph::{Graph, GraphNode, GraphOutput, Scene};
use crate::node::{Chain, Cx, FrameCx, Input, Many, Opt, Outputs, Past, StepCx};
use crate::param::{Keyframes, Param, ParamType, Source};
use crate::plan::Request;
use crate::{inputs, params};

fn uncooked(_: &Cx) -> crate::Result<Outputs> {
    unreachable!("nothing is cooked")
}

#[derive(Serialize, Deserialize)]
struct Uncooked;

impl Chain for Uncooked {
    fn start(_: &FrameCx) -> crate::Result<Self> {
        unreachable!("nothing is cooked")
    }
    fn step(&mut self, _: &StepCx) -> crate::Result<()> {
        unreachable!("nothing is cooked")
    }
    fn output(&self, _: &FrameCx) -> crate::Result<Outputs> {
        unreachable!("nothing is cooked")
    }
}

params! { PARAMS: SAMPLES: Param<i64> = Param::int("samples", 4, "Samples a step.").within(1.0, 8.0); }
inputs! { INPUTS:
    NOW: Input<Opt> = Input::optional("now", Kind::Points, "Read now.");
    BOTH: Input<Opt> = Input::optional("both", Kind::Points, "Read now and at the start.")
        .read_at(|_| Times::NOW.and(Times::START));
    START: Input<Opt> = Input::optional("start", Kind::Points, "Read at the start.").read_at(|_| Times::START);
    NEVER: Input<Opt> = Input::optional("never", Kind::Points, "Not read.").read_at(|_| Times::NEVER);
}
inputs! { STEPPED:
    DROPPED: Input<Opt> = Input::optional("start", Kind::Points, "Read at the start.").read_at(|_| Times::START);
    FLOOR: Input<Many> = Input::many("steps", Kind::Points, "Read within a step.")
        .read_at(|params| Times::within_step(params.get(SAMPLES) as u8));
    PUSH: Input<Opt> = Input::optional("now", Kind::Points, "Read now.");
}

static PURE: Node = Node::new("Pure", 1, "Pure.", Cook::Pure(uncooked)).inputs(INPUTS);
static FRAME: Node =
    Node::new("Frame", 1, "Frame.", Cook::Frame { cook: |cx| uncooked(cx), reads_clock: |_| true }).inputs(INPUTS);
static WINDOW: Node =
    Node::new("Window", 1, "Window.", Cook::window::<Uncooked>(|_, _| Past { frames: 8, preroll: 4 })).inputs(INPUTS);
static SOLVER: Node =
    Node::new("Solver", 1, "Solver.", Cook::solver::<Uncooked>(|_| Some(3))).inputs(STEPPED).params(PARAMS);

/// A graph over frames 1 to 10, of `still` (0) and `moving` (1) geometry and what is added.
struct Net(Graph);

impl Net {
    fn new() -> Self {
        let given = |id: &str, moves| GraphNode {
            id: id.into(),
            body: Body::Given { at: Arc::new(|_| Geometry::default()), moves },
        };
        let scene = Scene { last: 10, ..Scene::default() };
        Self(Graph { scene, nodes: vec![given("still", false), given("moving", true)], ..Graph::default() })
    }

    /// Adds a node, wired to these nodes input by input.
    fn add(&mut self, id: &str, node: &'static Node, wires: &[&[usize]]) -> usize {
        let links = |nodes: &&[usize]| nodes.iter().map(|node| Link { node: *node, port: 0 }).collect();
        let params = node.param_specs().iter().map(|spec| Source::Constant(spec.default.clone())).collect();
        let inputs = (0..node.inputs.len()).map(|input| wires.get(input).map(links).unwrap_or_default()).collect();
        let body = Body::Node { node, specs: node.param_specs().into(), params, inputs };
        self.0.nodes.push(GraphNode { id: id.into(), body });
        self.0.nodes.len() - 1
    }

    fn plan(&mut self) -> Plan<'_> {
        let output = |(node, of): (usize, &GraphNode)| GraphOutput {
            name: of.id.clone(),
            from: Link { node, port: 0 },
            attributes: None,
            v: true,
        };
        self.0.outputs = self.0.nodes.iter().enumerate().map(output).collect();
        let request = Request::everything(&self.0);
        Plan::new(&self.0, &request, Arc::default()).expect("a plan")
    }
}

fn at(frame: f64) -> Frame {
    Frame::exactly(frame).expect("a frame")
}

/// By input that is read: the frames, as a node is told them.
fn frames(plan: &Plan<'_>, node: usize, moment: Moment) -> String {
    let reads = plan.reads(node, moment).expect("params in range");
    let list = |frames: &[Frame]| frames.iter().map(Frame::to_string).collect::<Vec<_>>().join(" ");
    let mut inputs = Vec::new();
    for input in &reads.inputs {
        let now = input.now.map(|frame| format!(" now {frame}"));
        let start = input.start.map(|frame| format!(" start {frame}"));
        let steps = Some(format!(" steps {}", list(&input.steps))).filter(|_| !input.steps.is_empty());
        let text: String = [now, start, steps].into_iter().flatten().collect();
        if !text.is_empty() {
            inputs.push(format!("{}:{text}", input.name));
        }
    }
    inputs.join(", ")
}

/// The results that are read, in the order in which keys hash them.
fn results(plan: &Plan<'_>, node: usize, moment: Moment) -> String {
    let reads = plan.reads(node, moment).expect("params in range");
    let read = reads.inputs.iter().flat_map(|input| input.results(plan));
    read.map(|read| format!("{}@{}", plan.graph.nodes[read.node].id, read.frame)).collect::<Vec<_>>().join(" ")
}

#[test]
fn pure_and_frame_nodes_read_their_frame_and_the_scenes_first() {
    for node in [&PURE, &FRAME] {
        let mut net = Net::new();
        let node = net.add("node", node, &[&[0], &[1], &[1], &[1]]);
        let plan = net.plan();
        let rows = [
            (1.0, "now: now 1, both: now 1 start 1, start: start 1", "still@1 moving@1 moving@1 moving@1"),
            (3.0, "now: now 3, both: now 3 start 1, start: start 1", "still@1 moving@3 moving@1 moving@1"),
            (2.5, "now: now 2.5, both: now 2.5 start 1, start: start 1", "still@1 moving@2.5 moving@1 moving@1"),
            (12.0, "now: now 12, both: now 12 start 1, start: start 1", "still@1 moving@12 moving@1 moving@1"),
        ];
        for (frame, read, of) in rows {
            let moment = Moment::Frame(at(frame));
            assert_eq!((&*frames(&plan, node, moment), &*results(&plan, node, moment)), (read, of), "frame {frame}");
        }
    }
}

#[test]
fn a_node_that_reads_the_start_alone_is_the_same_at_all_frames() {
    let mut net = Net::new();
    let start = net.add("start", &PURE, &[&[], &[], &[1]]);
    let never = net.add("never", &PURE, &[&[0], &[], &[], &[1]]);
    let reader = net.add("reader", &PURE, &[&[start], &[never]]);
    let plan = net.plan();
    assert_eq!(results(&plan, reader, Moment::Frame(at(7.0))), "start@1 never@1 never@1");
    assert_eq!([start, never, reader].map(|node| plan.nodes[node].varies), [false; 3]);
    assert_eq!([1, start, 0].map(|node| plan.nodes[node].read_at_start), [true, false, false]);
    assert_eq!([1, start].map(|node| plan.reread_frame(node)), [Some(at(1.0)); 2]);
}

#[test]
fn a_window_reads_each_whole_frame_and_the_scenes_first_wherever_its_states_start() {
    let mut net = Net::new();
    let window = net.add("window", &WINDOW, &[&[1], &[0], &[1]]);
    let plan = net.plan();
    let rows = [
        (Moment::ChainStart(1), "now: now 1, both: now 1 start 1, start: start 1", "moving@1 still@1 still@1 moving@1"),
        (
            Moment::ChainStart(-3),
            "now: now -3, both: now -3 start 1, start: start 1",
            "moving@-3 still@1 still@1 moving@1",
        ),
        (Moment::ChainStep(5), "now: now 5, both: now 5", "moving@5 still@1"),
        (Moment::ChainOutput(at(5.0)), "now: now 5, both: now 5", "moving@5 still@1"),
        (Moment::ChainOutput(at(5.5)), "", ""),
    ];
    for (moment, read, of) in rows {
        assert_eq!((&*frames(&plan, window, moment), &*results(&plan, window, moment)), (read, of), "{moment:?}");
    }
}

#[test]
fn between_frames_an_output_is_made_of_two_neighbours_each_way_inside_the_scene() {
    let mut net = Net::new();
    let plan = net.plan();
    let rows: [(f64, &[i64]); 7] = [
        (5.0, &[5]),
        (5.5, &[4, 5, 6, 7]),
        (8.5, &[7, 8, 9, 10]),
        (9.5, &[8, 9, 10, 10]),
        (10.0, &[10]),
        (10.5, &[9, 10, 11, 12]),
        (0.5, &[-1, 0, 1, 2]),
    ];
    for (frame, whole) in rows {
        assert_eq!(plan.output_frames(at(frame)).all(), whole, "frame {frame}");
    }
    assert_eq!(plan.output_frames(at(5.25)), OutputFrames::Between([4, 5, 6, 7], 0.25));
}

#[test]
fn a_solver_reads_its_own_start_and_samples_within_each_step() {
    let mut net = Net::new();
    let window = net.add("window", &WINDOW, &[&[1]]);
    let solver = net.add("solver", &SOLVER, &[&[1], &[window, 0], &[0]]);
    let plan = net.plan();
    let rows = [
        (Moment::ChainStart(3), "start: start 3, steps: steps 3, now: now 3", "moving@3 window@3 still@1 still@1"),
        (
            Moment::ChainStep(4),
            "steps: steps 3 3.25 3.5 3.75 4, now: now 4",
            "window@3 window@3.25 window@3.5 window@3.75 window@4 still@1 still@1 still@1 still@1 still@1 still@1",
        ),
        (Moment::ChainOutput(at(4.0)), "now: now 4", "still@1"),
    ];
    for (moment, read, of) in rows {
        assert_eq!((&*frames(&plan, solver, moment), &*results(&plan, solver, moment)), (read, of), "{moment:?}");
    }
}

#[test]
fn a_step_over_a_solver_samples_whole_frames_and_an_unwired_input_has_its_samples_too() {
    let mut net = Net::new();
    let under = net.add("under", &SOLVER, &[&[1]]);
    let carried = net.add("carried", &PURE, &[&[under]]);
    let over = net.add("over", &SOLVER, &[&[], &[carried, 1]]);
    let plan = net.plan();
    let step = Moment::ChainStep(4);
    assert_eq!(results(&plan, over, step), "carried@3 carried@4 moving@3 moving@4");
    assert_eq!(frames(&plan, under, step), "steps: steps 3 3.25 3.5 3.75 4, now: now 4");
    assert_eq!(results(&plan, under, step), "");
}

#[test]
fn a_window_sampled_within_a_step_needs_the_whole_frames_around_it() {
    let mut net = Net::new();
    let window = net.add("window", &WINDOW, &[&[1]]);
    let solver = net.add("solver", &SOLVER, &[&[], &[window]]);
    let plan = net.plan();
    let mut whole: Vec<i64> = Vec::new();
    let reads = plan.reads(solver, Moment::ChainStep(4)).expect("params in range");
    for read in reads.inputs.iter().flat_map(|input| input.results(&plan)) {
        whole.extend(plan.output_frames(read.frame).all());
    }
    whole.sort_unstable();
    whole.dedup();
    assert_eq!(whole, [2, 3, 4, 5]);
}

/// So a key of the state at a frame covers its output there.
#[test]
fn an_output_reads_nothing_that_the_state_did_not_read_on_arriving() {
    let mut net = Net::new();
    let window = net.add("window", &WINDOW, &[&[1], &[1], &[1], &[1]]);
    let solver = net.add("solver", &SOLVER, &[&[1], &[window], &[1]]);
    let plan = net.plan();
    let read = |node, moment| -> Vec<Read> {
        let reads = plan.reads(node, moment).expect("params in range");
        reads.inputs.iter().flat_map(|input| input.results(&plan)).collect()
    };
    for node in [window, solver] {
        for frame in -3..=12 {
            let output = read(node, Moment::ChainOutput(Frame::whole(frame)));
            for arrival in [Moment::ChainStart(frame), Moment::ChainStep(frame)] {
                let arrived = read(node, arrival);
                assert!(!output.is_empty() && output.iter().all(|read| arrived.contains(read)), "{arrival:?}");
            }
        }
    }
}

#[test]
fn samples_follow_the_params_of_the_frame_and_refused_ones_are_an_error() {
    let mut net = Net::new();
    let solver = net.add("solver", &SOLVER, &[&[], &[1]]);
    let Body::Node { params, .. } = &mut net.0.nodes[solver].body else { unreachable!("just added") };
    let keys = [(4.0, 2_i64), (5.0, 1), (6.0, 9)].map(|(frame, samples)| (frame, i64::erase(samples))).to_vec();
    let interpolation = numerics::ramp::Interpolation::Constant;
    Arc::make_mut(params)[0] = Source::Keys(Arc::new(Keyframes { keys, interpolation }), i64::shape());
    let plan = net.plan();
    assert_eq!(results(&plan, solver, Moment::ChainStep(4)), "moving@3 moving@3.5 moving@4");
    assert_eq!(results(&plan, solver, Moment::ChainStep(5)), "moving@4 moving@5");
    let error = plan.reads(solver, Moment::ChainStep(6)).expect_err("9 is out of range");
    assert_eq!((&*error.node, error.frame), ("solver", at(6.0)));
}

#[test]
fn a_delivered_frame_reads_half_a_frame_each_way_where_its_velocity_is_a_difference_and_a_whole_one_of_a_solver() {
    let mut net = Net::new();
    let solver = net.add("solver", &SOLVER, &[&[1]]);
    let plan = net.plan();
    let read = |output: usize, frame: f64| -> Vec<Frame> {
        plan.delivery(output, at(frame)).all().map(|read| read.frame).collect()
    };
    assert_eq!(read(1, 1.0), [1.0, 1.0, 1.5].map(at));
    assert_eq!(read(1, 5.0), [5.0, 4.5, 5.5].map(at));
    assert_eq!(read(1, 10.0), [10.0, 9.5, 10.0].map(at));
    assert_eq!(read(0, 5.0), [1.0; 3].map(at));
    assert_eq!(read(solver, 5.0), [5.0, 4.0, 6.0].map(at));
    assert_eq!(read(solver, 1.0), [1.0, 1.0, 2.0].map(at));
    assert_eq!(read(solver, 10.0), [10.0, 9.0, 10.0].map(at));
    let seconds = plan.delivery(1, at(5.0)).around.map(|(_, seconds)| seconds * plan.graph.scene.fps);
    assert!(seconds.is_some_and(|frames| (frames - 1.0).abs() < 1e-12), "{seconds:?}");
    assert_eq!(plan.measured_frames(1, 0, at(5.0)), [5.0, 4.5, 5.5].map(at));
    assert_eq!(plan.measured_frames(0, 1, at(5.0)), [at(1.0)]);
}
