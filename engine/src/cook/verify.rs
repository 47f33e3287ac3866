//! What can be found out about a loaded graph before it cooks: params that do not go together, files that are no geometry.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use super::sweep::Sweep;
use super::{CookError, Delivered, Engine, Stopped};
use crate::error::{Error, ErrorKind};
use crate::geometry::Name;
use crate::graph::{Body, Fault, FaultClass, Graph, GraphOutput, Link, Part};
use crate::param::{Shape, Source};
use crate::plan::{Plan, Request};

impl Engine {
    /// Faults of the params of every node together, and of the files that sources read: each source is cooked once, at
    /// the scene's first frame, and what stands still is not cooked again by a cook that follows. With `needed_by`, only
    /// the files of what that request depends on are read.
    pub fn verify(&self, graph: &Graph, needed_by: Option<&Request>) -> Vec<Fault> {
        let everything = Request { outputs: (0..graph.outputs.len()).collect(), frames: vec![graph.scene.start()] };
        let plan = match self.plan(graph, needed_by.unwrap_or(&everything)) {
            Ok(plan) => plan,
            Err(_) => return Vec::new(),
        };
        let mut faults = Vec::new();
        let mut sources = Vec::new();
        for (place, node) in graph.nodes.iter().enumerate() {
            let Body::Node { node: declared, params, .. } = &node.body else { continue };
            let error = match plan.nodes[place].resolver.at(graph.scene.start()) {
                // A moving param may be refused at frames that nobody asks for: the cook will tell.
                Err(_) if plan.nodes[place].resolver.is_animated() => None,
                Err(error) => Some(error),
                Ok(params) => declared.checks.and_then(|checks| checks(&params).err()),
            };
            let reads_file = params.iter().any(|source| matches!(source, Source::File { .. }));
            match error {
                Some(error) => faults.push(fault(graph, &node.id, params_part(graph, place, &error), error)),
                None if reads_file && (plan.nodes[place].needed || needed_by.is_none()) => sources.push(place),
                None => {}
            }
        }
        for (place, error) in self.cook_sources(&plan, &sources) {
            let part = params_part(graph, place, &error.error);
            faults.push(fault(graph, &error.node, part, error.error.clone()));
        }
        faults.sort_by_key(|fault| (fault.line, fault.column));
        faults
    }

    fn cook_sources(&self, plan: &Plan, sources: &[usize]) -> Vec<(usize, Arc<CookError>)> {
        let mut graph = plan.graph.clone();
        graph.outputs = sources
            .iter()
            .map(|node| GraphOutput {
                name: graph.nodes[*node].id.clone(),
                from: Link { node: *node, port: 0 },
                attributes: None,
                v: false,
            })
            .collect();
        let frames = vec![graph.scene.start()];
        let request = Request { outputs: (0..sources.len()).collect(), frames };
        let mut nothing = |_: &[Delivered]| -> Result<(), std::convert::Infallible> { Ok(()) };
        let cancel = AtomicBool::new(false);
        let Ok(plan) = self.plan(&graph, &request) else { return Vec::new() };
        let cooked = self.pool.install(|| {
            let mut sweep = Sweep::new(self, &plan, None, &cancel, false);
            sweep.verifying = true;
            sweep.run(&mut nothing)
        });
        match cooked {
            Ok(report) => report.errors.into_iter().map(|(output, error, _)| (sources[output], error)).collect(),
            Err(Stopped::Asked(_) | Stopped::Sink(_) | Stopped::Cache(_)) => Vec::new(),
        }
    }
}

/// The param a fault belongs to, if it belongs to one: that of the file, where the file is the trouble.
fn params_part(graph: &Graph, node: usize, error: &Error) -> Option<&'static str> {
    let Body::Node { specs, .. } = &graph.nodes[node].body else { return None };
    let file = specs.iter().find(|spec| spec.shape == Shape::File).filter(|_| error.kind == ErrorKind::File);
    let named = || specs.iter().find(|spec| error.fact.starts_with(&format!("`{}`", spec.name)));
    file.or_else(named).map(|spec| spec.name)
}

fn fault(graph: &Graph, node: &Name, param: Option<&'static str>, error: Error) -> Fault {
    let (code, class) = match error.kind {
        ErrorKind::File => ("file-content", FaultClass::File),
        _ => ("illegal-value", FaultClass::Graph),
    };
    let part = match param {
        Some(param) => Part::Param(node, param),
        None => Part::Node(node),
    };
    let fault = graph.fault_at(part, code, class, error.fact);
    match error.hint {
        Some(hint) => fault.hint(hint),
        None => fault,
    }
}
