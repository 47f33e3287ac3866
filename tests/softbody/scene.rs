//! A Softbody node with its inputs, cooked in memory.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::sync::Arc;

use conformance::cook_all;
use engine::cook::{Engine, Settings};
use engine::error::ErrorKind;
use engine::geometry::{Attr, Component, Geometry};
use engine::graph::Body;
use engine::time::Frame;

use crate::cooked::{fault, graph, metrics};

pub(crate) type At = Arc<dyn Fn(Frame) -> Geometry + Send + Sync>;

/// The node, and its inputs.
#[derive(Clone)]
pub(crate) struct Scene {
    bodies: Vec<Geometry>,
    colliders: Vec<At>,
    goals: Vec<Geometry>,
    pins: Option<At>,
    /// Params by name, as in a graph file.
    params: BTreeMap<String, String>,
    fps: f64,
}

impl Scene {
    /// A body alone, without self-collision.
    pub(crate) fn of(body: impl Into<Geometry>) -> Self {
        Self {
            bodies: vec![body.into()],
            colliders: Vec::new(),
            goals: Vec::new(),
            pins: None,
            params: [("self_collision".into(), "false".into())].into(),
            fps: 24.0,
        }
    }

    pub(crate) fn and(mut self, body: impl Into<Geometry>) -> Self {
        self.bodies.push(body.into());
        self
    }

    pub(crate) fn collider(mut self, at: impl Fn(Frame) -> Geometry + Send + Sync + 'static) -> Self {
        self.colliders.push(Arc::new(at));
        self
    }

    /// A goal shape for a body, due at `frame` and held for `hold` frames.
    pub(crate) fn goal(mut self, shape: Component, frame: f32, strength: f32, hold: f32) -> Self {
        let mut shape = shape;
        for (name, value) in [("goal_frame", frame), ("goal_strength", strength), ("goal_hold", hold)] {
            shape.set(Attr::<f32>::once(name), vec![value]).unwrap();
        }
        self.goals.push(shape.into());
        self
    }

    /// Hard pins at these points; each holds the particles within `radius` of it at frame 1.
    pub(crate) fn pins(self, radius: f32, at: impl Fn(Frame) -> Vec<[f32; 3]> + Send + Sync + 'static) -> Self {
        let pins = move |frame: Frame| {
            let places = at(frame);
            let count = places.len();
            let mut pins = Component::points(places);
            for (name, value) in [("pin_radius", radius), ("pin_strength", 0.0), ("pin_release", 1e9)] {
                pins.set(Attr::<f32>::point(name), vec![value; count]).unwrap();
            }
            pins.into()
        };
        Self { pins: Some(Arc::new(pins)), ..self }
    }

    /// At `fps` frames a second.
    pub(crate) fn at(self, fps: f64) -> Self {
        Self { fps, ..self }
    }

    /// Replaces a param.
    pub(crate) fn set(mut self, name: &str, value: impl Display) -> Self {
        self.params.insert(name.into(), value.to_string());
        self
    }

    /// The lowest allowed height of particles; `None` without a ground.
    pub(crate) fn kept_from_ground(&self) -> Option<f64> {
        let number = |name: &str, default: f64| self.params.get(name).map_or(default, |value| value.parse().unwrap());
        let there = self.params.get("ground").is_some_and(|value| value == "true");
        there.then(|| number("ground_height", 0.0) + number("thickness", 1e-3))
    }

    fn nodes(&self) -> String {
        let names =
            |letter: char, count: usize| -> Vec<String> { (0..count).map(|k| format!("{letter}{k}")).collect() };
        let (bodies, colliders) = (names('b', self.bodies.len()), names('c', self.colliders.len()));
        let (goals, pins) = (names('g', self.goals.len()), names('p', usize::from(self.pins.is_some())));
        let node = |name: &String, body: &str| format!(r#""{name}": {{ {body} }},"#);
        let tets = r#""type": "Tet_In", "params": { "points": [[0, 0, 0]] }"#;
        let points = r#""type": "Point_In", "params": { "points": [[0, 0, 0]] }"#;
        let given = bodies
            .iter()
            .chain(&goals)
            .map(|name| node(name, tets))
            .chain(colliders.iter().map(|name| node(name, r#""type": "Mesh_Primitive""#)))
            .chain(pins.iter().map(|name| node(name, points)));
        let params: Vec<String> = self.params.iter().map(|(name, value)| format!(r#""{name}": {value}"#)).collect();
        format!(
            r#"{} "soft": {{ "type": "Softbody",
                "inputs": {{ "bodies": {bodies:?}, "colliders": {colliders:?}, "goals": {goals:?}, "pins": {pins:?} }},
                "params": {{ {} }} }}"#,
            given.collect::<String>(),
            params.join(", ")
        )
    }

    /// The first fault of such a graph before cooking.
    pub(crate) fn fault(&self) -> Option<String> {
        fault(&self.nodes(), "soft")
    }

    /// Cooks `frames` on `threads` threads.
    pub(crate) fn cook(&self, frames: impl IntoIterator<Item = i64>, threads: usize) -> Cooked {
        let frames: Vec<Frame> = frames.into_iter().map(Frame::whole).collect();
        let last = frames.last().map_or(1, |frame| frame.floor_number().max(1));
        let mut graph = graph(&self.nodes(), &["soft.surface", "soft.tets"], last);
        graph.scene.fps = self.fps;
        let still = |geometry: &Geometry| -> (At, bool) {
            let geometry = geometry.clone();
            (Arc::new(move |_| geometry.clone()), false)
        };
        let mut give = |name: String, (at, moves): (At, bool)| {
            let node = graph.nodes.iter_mut().find(|node| *node.id == *name).unwrap();
            node.body = Body::Given { at, moves };
        };
        self.bodies.iter().enumerate().for_each(|(k, body)| give(format!("b{k}"), still(body)));
        self.goals.iter().enumerate().for_each(|(k, goal)| give(format!("g{k}"), still(goal)));
        self.colliders.iter().enumerate().for_each(|(k, at)| give(format!("c{k}"), (at.clone(), true)));
        self.pins.iter().for_each(|at| give("p0".into(), (at.clone(), true)));

        let engine = Engine::new(&Settings { threads, ..Settings::default() }).unwrap();
        let (mut found, report) = cook_all(&engine, &graph, &frames);
        let mut errors: Vec<_> =
            report.errors.iter().map(|(_, error, _)| (error.error.kind, error.to_string())).collect();
        errors.dedup();
        let mut made = |output: usize| frames.iter().map(|frame| found.remove(&(output, *frame))).collect();
        let (surface, tets) = (made(0), made(1));
        let metrics = metrics(&graph, report).remove("soft").unwrap_or_default();
        Cooked { surface, tets, metrics, errors }
    }

    /// As [`Scene::cook`] of frames 1 to `last` on two threads, which must not fail.
    pub(crate) fn run(&self, last: i64) -> Cooked {
        let cooked = self.cook(1..=last, 2);
        assert!(cooked.errors.is_empty(), "{:?}", cooked.errors[0]);
        cooked
    }
}

/// The result.
#[derive(PartialEq)]
pub(crate) struct Cooked {
    /// One entry per requested frame.
    pub(crate) surface: Vec<Option<Arc<Geometry>>>,
    pub(crate) tets: Vec<Option<Arc<Geometry>>>,
    /// By name and frame.
    pub(crate) metrics: BTreeMap<String, BTreeMap<Frame, f64>>,
    /// Kind and message.
    pub(crate) errors: Vec<(ErrorKind, String)>,
}

impl Cooked {
    /// Particles at a requested frame, by its index in the request.
    pub(crate) fn at(&self, place: usize) -> Vec<[f64; 3]> {
        crate::measure::points(self.tets[place].as_ref().unwrap())
    }

    /// Particles at the last frame.
    pub(crate) fn last(&self) -> Vec<[f64; 3]> {
        self.at(self.tets.len() - 1)
    }

    /// Values of a metric at the frames that have it.
    pub(crate) fn metric(&self, name: &str) -> Vec<f64> {
        self.metrics.get(name).map(|values| values.values().copied().collect()).unwrap_or_default()
    }

    /// The largest of them.
    pub(crate) fn most(&self, name: &str) -> f64 {
        self.metric(name).into_iter().fold(f64::NEG_INFINITY, f64::max)
    }
}
