//! Cooking: a sweep over the asked frames, oldest first, slice by slice.
//!
//! A slice is a handful of frames. For each slice the sweep asks, from the outputs upwards, what must be there; then
//! cooks node by node, in the order of the graph, all frames of a node in parallel (and elements within a node). So
//! there is nothing to lock or to wait for, a result is dropped once its last reader in the slice is done, and time spent
//! between two nodes is that node's own. Windows and solvers are chains: states that move along with the sweep.

mod call;
mod deliver;
mod disk;
mod interpolate;
mod report;
mod store;
mod sweep;
mod tips;
mod types;
mod verify;
mod warnings;

use std::collections::BTreeMap;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, PoisonError};

pub use disk::DiskCache;
pub use report::{NodeReport, Report};
pub use tips::{EndTips, NodeEndTips};

use crate::error::CookError;
use crate::files::Files;
use crate::geometry::Geometry;
use crate::graph::Graph;
use crate::key::ContentKey;
use crate::memory::Ceiling;
use crate::plan::{Plan, Request};
use crate::time::Frame;
use store::Store;
use sweep::{Executor, Sweep};

/// A finished frame of an output.
#[derive(Clone, Debug)]
pub struct Delivered {
    /// Place of the output in the graph.
    pub output: usize,
    /// The frame.
    pub frame: Frame,
    /// What came out.
    pub geometry: Arc<Geometry>,
}

/// Takes finished frames, oldest first; what it returns as an error ends the cook.
pub type Sink<'a, E> = dyn FnMut(&[Delivered]) -> Result<(), E> + Send + 'a;

/// How an engine works. None of it changes a bit of any result.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Threads; 0: as many as the machine has.
    pub threads: usize,
    /// Bytes of results to hold.
    pub memory: usize,
    /// The most that a result may take together with what it is made from; a node that asks for more is refused.
    pub ceiling: Ceiling,
}

impl Default for Settings {
    fn default() -> Self {
        Self { threads: 0, memory: 1 << 30, ceiling: Ceiling::NONE }
    }
}

/// Why a cook ended early.
#[derive(Debug)]
pub enum Stopped<E> {
    /// What was asked cannot be cooked at all.
    Asked(Arc<CookError>),
    /// The sink refused a frame.
    Sink(E),
}

/// Cooks graphs, and remembers between cooks what stood still.
pub struct Engine {
    pool: Arc<rayon::ThreadPool>,
    memory: usize,
    ceiling: Ceiling,
    store: Mutex<Store>,
    files: Arc<Files>,
    /// Whether results at consecutive samples are compared, for the report.
    compares: bool,
    /// What a check of a graph has cooked already, for the report of the cook that follows.
    verified: Mutex<BTreeMap<ContentKey, NodeReport>>,
}

impl Engine {
    /// An engine with its own threads.
    ///
    /// # Errors
    /// Where the system does not give the threads.
    pub fn new(settings: &Settings) -> Result<Self, String> {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(settings.threads)
            .thread_name(|k| format!("convect {k}"))
            .build()
            .map_err(|error| format!("cannot start threads: {error}"))?;
        let store = Mutex::new(Store::new(settings.memory / 2));
        let files = Arc::new(Files::within(settings.ceiling));
        let Settings { memory, ceiling, .. } = *settings;
        Ok(Self { pool: Arc::new(pool), memory, ceiling, store, files, compares: false, verified: Mutex::default() })
    }

    /// From now on, cooks compare results at consecutive samples, for metrics such as [`crate::node::Metric::jumps`].
    #[must_use]
    pub fn comparing_samples(mut self, compares: bool) -> Self {
        self.compares = compares;
        self
    }

    /// Plans a request on `graph`.
    ///
    /// # Errors
    /// Where a sub-frame is asked of something that a solver is part of.
    pub fn plan<'g>(&self, graph: &'g Graph, request: &Request) -> Result<Plan<'g>, Arc<CookError>> {
        Plan::new(graph, request, self.files.clone())
    }

    /// Cooks what is asked, and hands finished frames to `sink`, oldest first. A node that fails spoils what depends on
    /// it, and nothing else: [`Report::errors`] says what was lost. `cancel` ends the cook between two nodes.
    ///
    /// # Errors
    /// Where the request cannot be cooked at all, or the sink refuses.
    pub fn cook<E: Send>(
        &self,
        graph: &Graph,
        request: &Request,
        disk: Option<&mut DiskCache>,
        cancel: &AtomicBool,
        sink: &mut Sink<'_, E>,
    ) -> Result<Report, Stopped<E>> {
        let plan = self.plan(graph, request).map_err(Stopped::Asked)?;
        let plan = if disk.is_some() { plan.keeping_all_outputs() } else { plan };
        self.pool.install(|| Sweep::new(self, &plan, Executor::Cook, disk, cancel).ending_the_plan().run(sink))
    }

    /// Cooks `nodes` (indices in [`Graph::nodes`]) for a request instead of its outputs, and keeps their results on disk,
    /// where a cook of the same outputs finds them. Nothing is delivered.
    ///
    /// # Errors
    /// Where the request cannot be cooked at all.
    pub fn cook_nodes(
        &self,
        graph: &Graph,
        (request, nodes): (&Request, &[usize]),
        disk: &mut DiskCache,
        cancel: &AtomicBool,
    ) -> Result<Report, Arc<CookError>> {
        let plan = self.plan(graph, request)?.keeping_all_outputs();
        let mut nothing = |_: &[Delivered]| -> Result<(), std::convert::Infallible> { Ok(()) };
        let sweep = || Sweep::new(self, &plan, Executor::Cook, Some(disk), cancel).until(nodes).run(&mut nothing);
        match self.pool.install(sweep) {
            Ok(report) => Ok(report),
            Err(Stopped::Asked(error)) => Err(error),
            Err(Stopped::Sink(never)) => match never {},
        }
    }

    /// Cooks a plan that the caller keeps. With `reload`, the state of every solver is serialised and read back after each
    /// step: a check that checkpoints are complete, as it must not change a bit of the results.
    ///
    /// # Errors
    /// Where the sink refuses.
    pub fn cook_plan<E: Send>(&self, plan: &Plan, reload: bool, sink: &mut Sink<'_, E>) -> Result<Report, Stopped<E>> {
        let cancel = AtomicBool::new(false);
        let executor = if reload { Executor::Reload } else { Executor::Cook };
        self.pool.install(|| Sweep::new(self, plan, executor, None, &cancel).run(sink))
    }

    /// What a cook would do, without cooking: how often each node would cook.
    ///
    /// # Errors
    /// Where the request cannot be cooked at all.
    pub fn rehearse(&self, graph: &Graph, request: &Request) -> Result<Report, Arc<CookError>> {
        let plan = self.plan(graph, request)?;
        let cancel = AtomicBool::new(false);
        let fresh = Self {
            pool: self.pool.clone(),
            memory: self.memory,
            ceiling: self.ceiling,
            store: Mutex::new(Store::new(usize::MAX)),
            files: self.files.clone(),
            compares: false,
            verified: Mutex::default(),
        };
        let mut nothing = |_: &[Delivered]| -> Result<(), std::convert::Infallible> { Ok(()) };
        match Sweep::new(&fresh, &plan, Executor::Rehearsal, None, &cancel).run(&mut nothing) {
            Ok(report) => Ok(report),
            Err(Stopped::Asked(error)) => Err(error),
            Err(Stopped::Sink(_)) => unreachable!("a rehearsal delivers nothing"),
        }
    }

    /// Threads that cook.
    pub fn threads(&self) -> usize {
        self.pool.current_num_threads()
    }

    /// The files this engine has read.
    pub fn files(&self) -> &Arc<Files> {
        &self.files
    }

    fn note_verified(&self, key: ContentKey, report: &NodeReport) {
        let mut verified = self.verified.lock().unwrap_or_else(PoisonError::into_inner);
        verified.entry(key).or_insert_with(|| report.clone());
    }

    fn take_verified(&self, key: ContentKey) -> Option<NodeReport> {
        self.verified.lock().unwrap_or_else(PoisonError::into_inner).remove(&key)
    }

    fn store<T>(&self, work: impl FnOnce(&mut Store) -> T) -> T {
        work(&mut self.store.lock().unwrap_or_else(PoisonError::into_inner))
    }
}
