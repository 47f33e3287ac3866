//! The wind nodes at extremes: absurd numbers, empty inputs, wind from any direction, difficult colliders.
//! `GROUPS` lists the tables for `cargo bench --bench laws`.
//!
//! Each row of a table is a scene. The results of all its nodes are finite, keep lengths and roots, have envelopes in
//! 0…1 and no uncounted crossings, and have the same bits on one thread and on seven; or the scene is refused, if the
//! row says so, with a message and never with a panic.

mod colliders;
mod empty;
mod groups;
mod guided;
mod numbers;
mod winds;

use std::collections::BTreeMap;
use std::sync::Arc;

use conformance::cook_all;
use engine::cook::{Engine, Settings};
use engine::error::ErrorKind;
use engine::geometry::{Component, ENVELOPE, Geometry, Kind, P};
use engine::graph::Body;
use engine::time::Frame;
use numerics::random::Key;
use numerics::shapes::icosphere;
use numerics::vector::{self, DVec3, to_f64};

use crate::cooked::{fault, graph, metrics};
use crate::page::{self, Outcome, split};

type Point = [f32; 3];
type At = Arc<dyn Fn(Frame) -> Geometry + Send + Sync>;

/// The nodes that are checked: the chain, and the nodes that attach, interpolate, deform and resample curves.
const NODES: [&str; 9] = ["gusts", "lee", "wind", "swing", "out", "grown", "hairs", "guided", "fine"];

/// The inputs of all nodes in a row.
#[derive(Clone)]
struct Scene {
    fur: At,
    skin: At,
    /// Guides at rest, if they are not the fur itself.
    posts: Option<At>,
    /// Params by node.
    params: BTreeMap<&'static str, String>,
    fps: f64,
    /// Nodes that refuse the scene.
    refused: &'static [&'static str],
}

impl Scene {
    /// Fur on a ball of radius ½, in a wind that turns.
    fn new() -> Self {
        let params = [
            ("gusts", r#""radius_range": [0.4, 0.8], "start_frame_range": [-10, 2], "base": 0.2"#),
            ("wind", r#""wind_dir": { "keyframes": [[1, [1, 0, 0]], [3, [0, 0.5, 1]]] }"#),
            ("hairs", r#""density": 20"#),
            ("lee", ""),
            ("swing", ""),
            ("out", ""),
            ("guided", ""),
            ("fine", ""),
        ];
        Self {
            fur: Arc::new(|_| curves(&hairs(20, 5, 0.3))),
            skin: Arc::new(|_| ball()),
            posts: None,
            params: params.map(|(node, params)| (node, params.to_owned())).into(),
            fps: 24.0,
            refused: &[],
        }
    }

    fn fur(self, at: impl Fn(Frame) -> Geometry + Send + Sync + 'static) -> Self {
        Self { fur: Arc::new(at), ..self }
    }

    fn skin(self, at: impl Fn(Frame) -> Geometry + Send + Sync + 'static) -> Self {
        Self { skin: Arc::new(at), ..self }
    }

    fn posts(self, at: impl Fn(Frame) -> Geometry + Send + Sync + 'static) -> Self {
        Self { posts: Some(Arc::new(at)), ..self }
    }

    /// Replaces the params of a node.
    fn with(mut self, node: &'static str, params: impl Into<String>) -> Self {
        self.params.insert(node, params.into());
        self
    }

    fn refused(self, refused: &'static [&'static str]) -> Self {
        Self { refused, ..self }
    }

    fn nodes(&self) -> String {
        let params = |node: &str| self.params.get(node).map_or("", String::as_str);
        let posts = if self.posts.is_some() { "posts" } else { "fur" };
        format!(
            r#"
            "fur": {{ "type": "Curve_In", "params": {{ "points": [[0, 0, 0], [0, 1, 0]] }} }},
            "skin": {{ "type": "Mesh_Primitive" }}, "still": {{ "type": "Mesh_Primitive" }},
            "gust": {{ "type": "Gust_Control" }},
            "gusts": {{ "type": "Curve_Wind_Gusts", "inputs": {{ "curves": "fur", "controls": ["gust"] }}, "params": {{ {} }} }},
            "lee": {{ "type": "Curve_Wind_Shielding", "inputs": {{ "curves": "gusts", "colliders": ["skin"] }}, "params": {{ {} }} }},
            "wind": {{ "type": "Curve_Wind", "inputs": {{ "curves": "lee" }}, "params": {{ {} }} }},
            "swing": {{ "type": "Curve_Jiggle", "inputs": {{ "curves": "wind", "skin": "skin" }}, "params": {{ {} }} }},
            "out": {{ "type": "Curve_Wind_Collision",
                     "inputs": {{ "curves": "swing", "rest": "fur", "colliders": ["skin"] }}, "params": {{ {} }} }},
            "grown": {{ "type": "Curve_Attach", "inputs": {{ "curves": "fur", "rest_skin": "still", "skin": "skin" }} }},
            "hairs": {{ "type": "Curve_Interpolate", "inputs": {{ "guides": "fur", "skin": "skin" }}, "params": {{ {} }} }},
            "posts": {{ "type": "Curve_In", "params": {{ "points": [[0, 0, 0], [0, 1, 0]] }} }},
            "blown": {{ "type": "Curve_Wind", "inputs": {{ "curves": "{posts}" }} }},
            "guided": {{ "type": "Curve_Deform", "params": {{ {} }}, "inputs": {{
                "curves": "fur", "rest_guides": "{posts}", "guides": "blown", "rest_skin": "still", "skin": "skin" }} }},
            "fine": {{ "type": "Curve_Resample", "inputs": {{ "curves": "wind" }}, "params": {{ {} }} }}"#,
            params("gusts"),
            params("lee"),
            params("wind"),
            params("swing"),
            params("out"),
            params("hairs"),
            params("guided"),
            params("fine"),
        )
    }

    /// The first fault of such a graph before cooking.
    fn fault(&self) -> Option<String> {
        fault(&self.nodes(), "out")
    }

    /// Cooks frames 1 to 3 on `threads` threads.
    fn cook(&self, threads: usize) -> Cooked {
        self.cook_some(&NODES, &[1, 2, 3], threads)
    }

    /// Cooks some of the nodes at some of the frames.
    fn cook_some(&self, nodes: &[&str], frames: &[i64], threads: usize) -> Cooked {
        let mut graph = graph(&self.nodes(), nodes, 3);
        graph.scene.fps = self.fps;
        let first = (self.skin)(Frame::whole(1));
        let given: [(&str, At); 3] =
            [("fur", self.fur.clone()), ("skin", self.skin.clone()), ("still", Arc::new(move |_| first.clone()))];
        let posts = self.posts.clone().map(|at| ("posts", at));
        for (id, at) in given.into_iter().chain(posts) {
            let node = graph.nodes.iter_mut().find(|node| &*node.id == id).unwrap();
            node.body = Body::Given { at, moves: true };
        }
        let engine = Engine::new(&Settings { threads, ..Settings::default() }).unwrap();
        let frames: Vec<Frame> = frames.iter().copied().map(Frame::whole).collect();
        let (found, report) = cook_all(&engine, &graph, &frames);
        let errors =
            report.errors.iter().map(|(_, error, _)| (error.node.to_string(), error.error.kind, error.to_string()));
        let mut errors: Vec<_> = errors.collect();
        errors.dedup();
        let metrics = metrics(&graph, report);
        let metric = |node: &str, name: &str| -> Vec<f64> {
            let values = metrics.get(node).and_then(|node| node.get(name));
            values.map(|values| values.values().copied().collect()).unwrap_or_default()
        };
        let made = |frame: &Frame| {
            let output = |node: &&str| nodes.iter().position(|name| name == node);
            NODES.iter().map(|node| found.get(&(output(node)?, *frame)).cloned()).collect()
        };
        let counts = ["crossings_left", "started_inside", "contacts", "unfreed_segments"];
        Cooked {
            frames: frames.iter().map(made).collect(),
            counts: counts.map(|name| (name, metric("out", name))).into(),
            errors,
        }
    }
}

/// The outcome.
#[derive(PartialEq)]
struct Cooked {
    /// For each frame the result of each node.
    frames: Vec<Vec<Option<Arc<Geometry>>>>,
    /// Collision's counts by frame.
    counts: BTreeMap<&'static str, Vec<f64>>,
    /// Node, kind and message.
    errors: Vec<(String, ErrorKind, String)>,
}

impl Cooked {
    fn of(&self, frame: usize, node: &str) -> Option<&Component> {
        let place = NODES.iter().position(|name| *name == node).unwrap();
        self.frames[frame][place].as_ref().map(|geometry| geometry.curves().unwrap())
    }
}

/// The part of the page.
const PART: &str = "Wind";

/// Records a refusal.
fn record_refused(rows: &str, case: &str, said: &str) {
    page::record(PART, rows, case, Outcome::Refused, said);
}

/// Checks the guarantees of this module for every node in each of these scenes, and records them as `rows` of NUMERICS B, or
/// as those that a scene's name begins with; returns the results.
fn hold<const N: usize>(numbers: &str, rows: [(&str, Scene); N]) -> Vec<Cooked> {
    let held = rows.into_iter().map(|(what, scene)| {
        let cooked = scene.cook(1);
        assert!(cooked == scene.cook(7), "{what}: other bits on 7 threads than on one");
        for (node, kind, error) in &cooked.errors {
            assert!(matches!(kind, ErrorKind::Refused | ErrorKind::NotFinite), "{what}: {error} ({kind:?})");
            assert!(scene.refused.contains(&node.as_str()), "{what}: {error}");
        }
        let wrong = scene.refused.iter().find(|node| !cooked.errors.iter().any(|(refused, ..)| refused == *node));
        assert_eq!(wrong, None, "{what}: it is not refused");
        let worst = check_all(what, &cooked, &scene);
        let (numbers, case) = split(numbers, what);
        match cooked.errors.first() {
            Some((_, _, said)) => record_refused(numbers, case, said),
            None => {
                let most = |name: &str| cooked.counts[name].iter().copied().fold(0.0, f64::max);
                let (left, contacts) = (most("crossings_left"), most("contacts"));
                let outcome = if left > 0.0 { Outcome::Capped } else { Outcome::Finite };
                let figure = format!("lengths within {worst:.0e}, contacts: {contacts}, crossings left: {left}");
                page::record(PART, numbers, case, outcome, &figure);
            }
        }
        cooked
    });
    held.collect()
}

/// Checks all frames of an outcome; returns the largest change of a length.
fn check_all(what: &str, cooked: &Cooked, scene: &Scene) -> f64 {
    let of_frame = |frame: usize| {
        let at = Frame::whole(frame as i64 + 1);
        check(&format!("{what}, frame {}", frame + 1), cooked, frame, (scene.fur)(at), (scene.skin)(at))
    };
    (0..3).map(of_frame).fold(0.0, f64::max)
}

fn check(what: &str, cooked: &Cooked, frame: usize, fur: Geometry, skin: Geometry) -> f64 {
    let (fur, mut worst) = (fur.curves().unwrap(), 0.0_f64);
    for node in NODES {
        let Some(made) = cooked.of(frame, node) else { continue };
        assert!(made.positions().as_flattened().iter().all(|x| x.is_finite()), "{what}: `{node}`");
        if let Some(envelope) = made.get(ENVELOPE).filter(|_| fur.get(ENVELOPE).is_none()) {
            assert!(envelope.iter().all(|x| (0.0..=1.0).contains(x)), "{what}: `{node}`");
        }
        if !["hairs", "fine"].contains(&node) {
            assert_eq!(made.runs(), fur.runs(), "{what}: `{node}`");
            let error = length_error(made, fur);
            assert!(error <= 1e-5, "{what}: `{node}` changes lengths by {error:.1e} of a curve's");
            worst = worst.max(error);
        }
        if ["wind", "swing"].contains(&node) {
            let roots =
                |part: &Component| part.runs().ranges().map(|cvs| part.positions()[cvs.start]).collect::<Vec<_>>();
            assert!(roots(made) == roots(fur), "{what}: `{node}` moves roots");
        }
    }
    if let Some(out) = cooked.of(frame, "out") {
        let (found, counted) = (crossings(out, skin.mesh().unwrap()), cooked.counts["crossings_left"][frame]);
        assert!(found as f64 <= counted, "{what}: {found} segments cross, {counted} were counted");
    }
    worst
}

/// The largest change of a segment's length beyond the rounding of stored positions, relative to the curve's length.
fn length_error(made: &Component, fur: &Component) -> f64 {
    let mut worst = 0.0_f64;
    for cvs in fur.runs().ranges() {
        let (now, then) = (&made.positions()[cvs.clone()], &fur.positions()[cvs]);
        let lengths = |points: &[Point]| -> Vec<f64> {
            points.windows(2).map(|ends| (to_f64(ends[1]) - to_f64(ends[0])).norm()).collect()
        };
        let largest = now.iter().chain(then).flatten().fold(0.0_f32, |most, x| most.max(x.abs()));
        let allowed = 4.0 * (f64::from(largest.next_up()) - f64::from(largest));
        let (now, then) = (lengths(now), lengths(then));
        let whole: f64 = then.iter().sum();
        for (now, then) in now.iter().zip(&then) {
            let beyond = ((now - then).abs() - allowed).max(0.0);
            worst = worst.max(if whole > 0.0 { beyond / whole } else { beyond });
        }
    }
    worst
}

/// Segments that pass through a triangle: their ends are on opposite sides of it, and they pass all three edges on the
/// same side; in f64.
fn crossings(curves: &Component, mesh: &Component) -> usize {
    let corners = |triangle: &[u32; 3]| triangle.map(|corner| mesh.positions()[corner as usize]);
    let triangles: Vec<[Point; 3]> = mesh.triangles().corners.iter().map(corners).collect();
    let bounds: Vec<[Point; 2]> = triangles.iter().map(|triangle| bounds_of(triangle)).collect();
    let segments = curves.runs().ranges().flat_map(|cvs| curves.positions()[cvs].windows(2));
    let passes_any = |ends: &&[Point]| {
        let around = bounds_of(ends);
        let mut near = triangles.iter().zip(&bounds).filter(|(_, bounds)| overlap(&around, bounds));
        near.any(|(triangle, _)| crosses(to_f64(ends[0]), to_f64(ends[1]), &triangle.map(to_f64)))
    };
    segments.filter(passes_any).count()
}

/// The least and the greatest coordinates.
fn bounds_of(points: &[Point]) -> [Point; 2] {
    let mut bounds = [points[0]; 2];
    for p in points {
        for axis in 0..3 {
            bounds[0][axis] = bounds[0][axis].min(p[axis]);
            bounds[1][axis] = bounds[1][axis].max(p[axis]);
        }
    }
    bounds
}

/// Compared one by one: these are most of the work, and tests are not optimised.
fn overlap([from, to]: &[Point; 2], [least, most]: &[Point; 2]) -> bool {
    from[0] <= most[0]
        && to[0] >= least[0]
        && from[1] <= most[1]
        && to[1] >= least[1]
        && from[2] <= most[2]
        && to[2] >= least[2]
}

fn crosses(a: DVec3, b: DVec3, triangle: &[DVec3; 3]) -> bool {
    let [p, q, r] = triangle.map(|corner| corner - a);
    let along = b - a;
    let normal = (q - p).cross(&(r - p));
    let (start, end) = (-normal.dot(&p), normal.dot(&(along - p)));
    let volumes = [along.dot(&p.cross(&q)), along.dot(&q.cross(&r)), along.dot(&r.cross(&p))];
    start * end < 0.0 && (volumes.iter().all(|x| *x > 0.0) || volumes.iter().all(|x| *x < 0.0))
}

/// Curves from lists of CVs.
fn curves(list: &[Vec<Point>]) -> Geometry {
    let counts = list.iter().map(|curve| curve.len() as u32).collect();
    Component::curves(counts, list.concat()).unwrap().into()
}

/// Leaning curves of `cvs` CVs and this length on the ball.
fn hairs(count: u64, cvs: usize, length: f32) -> Vec<Vec<Point>> {
    let hair = |k: u64| {
        let up = direction(Key::new(5).of(k));
        let lean = direction(Key::new(6).of(k));
        let along = vector::add(up, vector::scale(lean, 0.4));
        let at = |cv: usize| cv as f32 / (cvs - 1).max(1) as f32 * length / vector::length(along);
        (0..cvs).map(|cv| vector::add(vector::scale(up, 0.5), vector::scale(along, at(cv)))).collect()
    };
    (0..count).map(hair).collect()
}

fn direction(key: Key) -> Point {
    let v: Point = [0, 1, 2].map(|axis| key.of(axis).between([-1.0, 1.0]));
    let size = vector::length(v);
    if (0.1..1.0).contains(&size) { v.map(|x| x / size) } else { direction(key.of(9)) }
}

/// A ball of radius ½, of 320 triangles.
fn ball() -> Geometry {
    ball_of(|triangles| triangles)
}

/// The ball's points with other faces.
fn ball_of(triangles: impl Fn(Vec<[u32; 3]>) -> Vec<[u32; 3]>) -> Geometry {
    let ball = icosphere(0.5, 2);
    mesh(&triangles(ball.triangles()), ball.points.iter().map(|p| p.map(|x| x as f32)).collect())
}

fn mesh(triangles: &[[u32; 3]], points: Vec<Point>) -> Geometry {
    Component::mesh(vec![3; triangles.len()], triangles.as_flattened().to_vec(), points).unwrap().into()
}

/// A geometry with every position mapped.
fn moved(mut geometry: Geometry, change: impl Fn(Point) -> Point) -> Geometry {
    for kind in [Kind::Curves, Kind::Mesh] {
        if let Some(part) = geometry.part_mut(kind) {
            part.edit(P).unwrap().iter_mut().for_each(|p| *p = change(*p));
        }
    }
    geometry
}

crate::page::groups! {
    colliders::curves_that_start_inside_a_collider_are_counted_and_do_not_get_deeper,
    colliders::no_kind_of_collider_is_crossed,
    colliders::extreme_steps_and_offsets_keep_the_guarantees,
    groups::an_empty_group_changes_no_bit_and_a_full_one_is_none,
    groups::clumps_of_any_numbers_hold,
    groups::loops_shear_and_fading_hold_at_any_size,
    guided::any_guides_give_finite_curves_of_the_same_lengths,
    guided::roots_inside_the_skin_and_thin_skins_are_no_trouble,
    guided::curves_of_any_shape_are_resampled,
    empty::empty_and_degenerate_curves_pass_through_every_node,
    empty::triangles_without_area_among_others_change_nothing,
    empty::curves_without_a_skin_bend_and_swing,
    numbers::scenes_of_any_scale_and_position_are_finite_and_keep_lengths,
    numbers::any_frame_rate_gives_finite_curves,
    numbers::nan_and_infinity_are_refused_by_name_in_every_input,
    numbers::lengths_roots_and_bits_are_kept_at_both_ends_of_every_range,
    winds::wind_from_any_direction_bends_curves_and_keeps_their_lengths,
    winds::envelopes_out_of_range_and_thousands_of_gusts_give_finite_curves,
    winds::springs_of_any_stiffness_and_damping_are_stable,
    winds::every_node_handles_curves_of_2_and_of_10_000_cvs,
    winds::a_million_curves_pass_through_the_chain,
    winds::a_million_curves_are_attached_and_interpolated,
}
