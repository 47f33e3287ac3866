//! Checks of a loaded graph before it is cooked: incompatible params, invalid geometry, animated params that leave
//! their range, and gaps in file sequences.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use super::sweep::{Executor, Sweep};
use super::{Delivered, Engine, Stopped};
use crate::error::{CookError, Error, ErrorKind};
use crate::files::unreadable;
use crate::geometry::Name;
use crate::graph::fault::code;
use crate::graph::{Body, Fault, FaultClass, Graph, GraphOutput, Link, Part};
use crate::param::{ParamSpec, Params, Shape, Source};
use crate::plan::{Request, Resolver};
use crate::time::Frame;

/// Checks look at no more frames than this, so that they stay fast. Errors at later frames are reported when cooking.
const MOST_FRAMES: usize = 10_000;

impl Engine {
    /// Finds incompatible params of a node, invalid geometry in files and inline data, and missing files of a sequence.
    /// Each source is cooked once, at the first frame; a static one is not cooked again by a cook that follows.
    ///
    /// With `needed_by`, only nodes that this request depends on are checked, at its frames. Without it, all nodes are,
    /// and animated params are evaluated at all frames of the scene. (A cook reports illegal values itself and skips
    /// those frames.)
    pub fn verify(&self, graph: &Graph, needed_by: Option<&Request>) -> Vec<Fault> {
        let everything =
            Request { outputs: (0..graph.outputs.len()).collect(), frames: vec![graph.scene.start()].into() };
        let plan = match self.plan(graph, needed_by.unwrap_or(&everything)) {
            Ok(plan) => plan,
            Err(_) => return Vec::new(),
        };
        let frames: Vec<Frame> = match needed_by {
            Some(request) => request.frames.iter().take(MOST_FRAMES).collect(),
            None => (graph.scene.first..=graph.scene.last).map(Frame::whole).take(MOST_FRAMES).collect(),
        };
        let mut faults = Vec::new();
        let mut sources = Vec::new();
        // Nodes of one type that set no param share them.
        let mut sound: BTreeSet<*const Source> = BTreeSet::new();
        for (index, node) in graph.nodes.iter().enumerate() {
            let Body::Node { node: declared, specs, params, .. } = &node.body else { continue };
            if !declared.inputs.is_empty() && sound.contains(&params.as_ptr()) {
                continue;
            }
            let own;
            let resolver = match (plan.nodes[index].needed, needed_by) {
                (false, None) => {
                    own = Resolver::new(node, graph, self.files());
                    &own
                }
                _ => &plan.nodes[index].resolver,
            };
            let before = faults.len();
            let reads_sequence = params.iter().any(Source::is_sequence);
            if resolver.is_animated() && (reads_sequence || needed_by.is_none()) {
                let over_time = ParamFaults::over(resolver, declared.checks, &frames);
                let missing = over_time.missing.map(|error| fault(graph, index, error));
                faults.extend(missing.map(|fault| Fault { code: code::FILE_MISSING, ..fault }));
                let illegal = over_time.refused.filter(|_| needed_by.is_none());
                faults.extend(illegal.map(|error| fault(graph, index, error)));
            }
            let error = match resolver.at(graph.scene.start()) {
                // Already reported above, or at a frame that is not requested.
                Err(_) if resolver.is_animated() => None,
                Err(error) => Some(error),
                Ok(params) => declared.checks.and_then(|checks| checks(&params).err()),
            };
            if error.is_none() && faults.len() == before {
                sound.insert(params.as_ptr());
            }
            let at_start = error.map(|error| fault(graph, index, error));
            // It may be what was found over time.
            let is_known =
                |new: &Fault| faults[before..].iter().any(|old| (old.line, old.column) == (new.line, new.column));
            let at_start = at_start.filter(|new| !is_known(new));
            faults.extend(at_start);
            let requested = plan.nodes[index].needed || needed_by.is_none();
            if faults.len() == before && requested && declared.inputs.is_empty() && holds_data(specs, params) {
                sources.push(index);
            }
        }
        let first = frames.iter().min().copied().unwrap_or(graph.scene.start());
        for (index, error) in self.cook_sources(graph, &sources, first) {
            faults.push(fault(graph, index, error.error.clone()));
        }
        // What a file lacks that cannot be read is not known.
        if needed_by.is_none() && faults.is_empty() {
            let of_types = self.type_faults(graph).into_iter();
            faults.extend(of_types.map(|(index, error)| fault(graph, index, error)));
        }
        faults.sort_by_key(|fault| (fault.line, fault.column));
        faults
    }

    fn cook_sources(&self, graph: &Graph, sources: &[usize], frame: Frame) -> Vec<(usize, Arc<CookError>)> {
        let output = |(index, node): (usize, &usize)| GraphOutput {
            name: graph.nodes[*node].id.clone(),
            from: Link { node: index, port: 0 },
            attributes: None,
            v: false,
        };
        // Sources alone: they read nothing, and a graph may have a million other nodes.
        let graph = Graph {
            scene: graph.scene.clone(),
            nodes: sources.iter().map(|node| graph.nodes[*node].clone()).collect(),
            outputs: sources.iter().enumerate().map(output).collect(),
            folder: graph.folder.clone(),
            ..Graph::default()
        };
        let request = Request { outputs: (0..sources.len()).collect(), frames: vec![frame].into() };
        let mut nothing = |_: &[Delivered]| -> Result<(), std::convert::Infallible> { Ok(()) };
        let cancel = AtomicBool::new(false);
        let Ok(plan) = self.plan(&graph, &request) else { return Vec::new() };
        let cooked = self.pool.install(|| Sweep::new(self, &plan, Executor::Check, None, &cancel).run(&mut nothing));
        match cooked {
            Ok(report) => report.errors.into_iter().map(|(output, error, _)| (sources[output], error)).collect(),
            Err(Stopped::Asked(_) | Stopped::Sink(_)) => Vec::new(),
        }
    }
}

/// Whether a source reads a file or has inline geometry.
fn holds_data(specs: &[ParamSpec], params: &[Source]) -> bool {
    let is_data = |shape| matches!(shape, Shape::Vec3s | Shape::Ints | Shape::Tets | Shape::Columns);
    specs.iter().zip(params).any(|(spec, source)| match source {
        Source::File { .. } => true,
        Source::Constant(value) => is_data(spec.shape) && *value != spec.default,
        _ => false,
    })
}

/// The first illegal value and the first missing file of a node over all frames, with the number of further frames.
struct ParamFaults {
    /// An illegal value.
    refused: Option<Error>,
    /// A missing file of a sequence.
    missing: Option<Error>,
}

impl ParamFaults {
    fn over(resolver: &Resolver<'_>, checks: Option<fn(&Params) -> crate::Result<()>>, frames: &[Frame]) -> Self {
        // Files are not opened here, and checks may look at them.
        let checks = checks.filter(|_| !resolver.reads_files());
        let mut refused: Option<(Error, Frame, usize)> = None;
        let mut missing: Option<(Error, Frame, usize)> = None;
        let record = |found: &mut Option<(Error, Frame, usize)>, frame: Frame, error: &dyn Fn() -> Error| match found {
            Some((_, _, more)) => *more += 1,
            None => *found = Some((error(), frame, 0)),
        };
        // Consecutive frames may read the same file.
        let mut last_found: Option<PathBuf> = None;
        for frame in frames {
            let params = resolver.unopened(*frame);
            match params.and_then(|params| checks.map_or(Ok(()), |checks| checks(&params)).map(|()| params)) {
                Err(error) => record(&mut refused, *frame, &|| error.clone()),
                Ok(params) => {
                    for file in resolver.sequence_files(&params) {
                        if last_found.as_ref() == Some(&file.path) {
                            continue;
                        }
                        match std::fs::metadata(&file.path) {
                            Ok(_) => last_found = Some(file.path),
                            Err(error) => record(&mut missing, *frame, &|| {
                                let error = unreadable(&file.path, &error).of(file.param);
                                resolver.with_how_to_hold(error, file.sequence, file.frame)
                            }),
                        }
                    }
                }
            }
        }
        let with_frames = |(error, frame, more): (Error, Frame, usize)| {
            let more = match more {
                0 => String::new(),
                1 => " and at 1 more frame".into(),
                more => format!(" and at {more} more frames"),
            };
            Error { fact: format!("{}, at frame {frame}{more}", error.fact), ..error }
        };
        Self { refused: refused.map(with_frames), missing: missing.map(with_frames) }
    }
}

/// The param that a fault refers to, if any: for an error of a file, the param with its path.
fn param_of(graph: &Graph, node: usize, error: &Error) -> Option<&'static str> {
    let Body::Node { specs, .. } = &graph.nodes[node].body else { return None };
    let file = specs.iter().find(|spec| spec.shape == Shape::File).filter(|_| error.kind == ErrorKind::File);
    let named = || specs.iter().find(|spec| error.fact.starts_with(&format!("`{}`", spec.name)));
    error.param.or_else(|| file.or_else(named).map(|spec| spec.name))
}

fn fault(graph: &Graph, node: usize, error: Error) -> Fault {
    let (code, class) = match error.kind {
        ErrorKind::File => ("file-content", FaultClass::File),
        _ => (code::ILLEGAL_VALUE, FaultClass::Graph),
    };
    let id: &Name = &graph.nodes[node].id;
    let part = match param_of(graph, node, &error) {
        Some(param) => Part::Param(id, param),
        None => Part::Node(id),
    };
    let fault = graph.fault_at(part, code, class, error.fact);
    match error.hint {
        Some(hint) => fault.hint(hint),
        None => fault,
    }
}
