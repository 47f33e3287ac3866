//! One call of a node: its context made, panics caught, what it returns checked against its declaration.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, PoisonError};

use super::store::Cooked;
use crate::error::{Error, ErrorKind, IS_A_BUG, Result};
use crate::geometry::{Geometry, Kind, Name, Owner, P};
use crate::memory::Ceiling;
use crate::node::masks::ConvertedMasks;
use crate::node::{Carries, Cx, FrameCx, History, InputData, Needs, Node, Outputs, StepCx};
use crate::param::{Clock, Params};
use crate::time::Frame;

/// All that goes into a call.
pub(crate) struct Call<'a> {
    pub(crate) node: &'static Node,
    pub(crate) frame: Frame,
    pub(crate) params: Params,
    pub(crate) inputs: Vec<(&'static str, InputData)>,
    pub(crate) live: Option<&'a [Name]>,
    pub(crate) if_there: &'a [Name],
    pub(crate) outputs_used: &'a [bool],
    pub(crate) cancel: &'a AtomicBool,
    pub(crate) clock: Clock,
    pub(crate) origin: [f64; 3],
    pub(crate) history: Option<&'a dyn History>,
    pub(crate) ceiling: Ceiling,
    pub(crate) held: usize,
}

/// What came out of a call.
pub(crate) struct Returned {
    pub(crate) cooked: Cooked,
    pub(crate) metrics: Vec<(&'static str, f64)>,
    /// Bytes of arrays that no input holds.
    pub(crate) new_bytes: usize,
    /// Names of attributes that nobody takes.
    pub(crate) stripped: Vec<Name>,
}

impl<'a> Call<'a> {
    /// Makes the context and runs `work` in it; a panic becomes an error.
    pub(crate) fn run<T>(self, work: impl FnOnce(&FrameCx<'a>) -> Result<T>) -> Result<(T, Finished<'a>)> {
        let cx = self.context()?;
        let result = guarded(|| work(&cx))?;
        check_integrals(&cx)?;
        Ok((result, Finished { cx: cx.cx }))
    }

    /// The same for a step of a chain from the frame before.
    pub(crate) fn step(self, work: impl FnOnce(&StepCx<'a>) -> Result<()>) -> Result<Finished<'a>> {
        let previous = self.frame.plus(-1);
        let cx = StepCx { cx: self.context()?, previous };
        guarded(|| work(&cx))?;
        check_integrals(&cx)?;
        Ok(Finished { cx: cx.cx.cx })
    }

    fn context(self) -> Result<FrameCx<'a>> {
        for (input, (name, data)) in self.node.inputs.iter().zip(&self.inputs) {
            if let Needs::Kind(kind) = input.spec().needs {
                check_wires(name, kind, data)?;
            }
        }
        Ok(FrameCx {
            cx: Cx {
                node: self.node,
                params: self.params,
                inputs: self.inputs,
                live: self.live,
                if_there: self.if_there,
                outputs_used: self.outputs_used,
                cancel: self.cancel,
                ceiling: self.ceiling,
                held: self.held,
                published: Mutex::default(),
                masks: ConvertedMasks::default(),
            },
            frame: self.frame,
            clock: self.clock,
            origin: self.origin,
            history: self.history,
        })
    }
}

pub(super) fn guarded<T>(work: impl FnOnce() -> Result<T>) -> Result<T> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| Err(panicked(&*panic)))
}

/// A cancelled cook's integrals end early, so that what was made of them is worth nothing.
fn check_integrals(cx: &FrameCx<'_>) -> Result<()> {
    if cx.history.is_some() { cx.check_cancelled() } else { Ok(()) }
}

/// A call that is over, for checking what it returned.
pub(crate) struct Finished<'a> {
    cx: Cx<'a>,
}

impl Finished<'_> {
    /// The outputs in the order of the declaration, checked and stripped of what nobody takes.
    pub(crate) fn check(self, outputs: Outputs) -> Result<Returned> {
        let node = self.cx.node;
        let mut known: Vec<usize> = Vec::new();
        for (_, data) in &self.cx.inputs {
            let wires = data.now.iter().chain(&data.start).chain(data.steps.iter().flat_map(|(_, wires)| wires));
            known.extend(wires.flat_map(|wire| wire.arrays()).map(|(address, _)| address));
        }
        known.sort_unstable();
        let mut new_bytes = 0;
        let mut stripped = Vec::new();
        let mut cooked = Vec::with_capacity(node.outputs.len());
        for (port, declared) in node.outputs.iter().enumerate() {
            if !self.cx.uses_output(port) {
                cooked.push(Arc::default());
                continue;
            }
            let found = outputs.0.iter().find(|(name, _)| *name == declared.name);
            let (_, geometry) = found.ok_or_else(|| Error::contract(format!("it returns no `{}`", declared.name)))?;
            if let Carries::Kinds(kinds) = declared.carries
                && !declared.may_lack
            {
                check_kinds(declared.name, kinds, geometry)?;
            }
            check_finite(geometry, &known).map_err(|error| error.hint(NOT_FINITE))?;
            let fresh = geometry.arrays().into_iter().filter(|(address, _)| known.binary_search(address).is_err());
            new_bytes += fresh.map(|(_, bytes)| bytes).sum::<usize>();
            cooked.push(match self.cx.live {
                Some(live) => without_dead(geometry, live, &mut stripped),
                None => geometry.clone(),
            });
        }
        // Nodes that may make much have asked before. Others are noticed now.
        if new_bytes > Ceiling::LEAST / 16 {
            let refused = self.cx.refuse_larger(new_bytes, "takes");
            refused.map_err(|error| error.hint("use fewer points, or raise --memory"))?;
        }
        let metrics = self.cx.published.into_inner().unwrap_or_else(PoisonError::into_inner);
        Ok(Returned { cooked: cooked.into(), metrics, new_bytes, stripped })
    }

    /// What a step of a chain published.
    pub(crate) fn metrics(self) -> Vec<(&'static str, f64)> {
        self.cx.published.into_inner().unwrap_or_else(PoisonError::into_inner)
    }
}

fn check_wires(input: &str, kind: Kind, data: &InputData) -> Result<()> {
    let wires = data.now.iter().chain(&data.start).chain(data.steps.iter().flat_map(|(_, wires)| wires));
    for wire in wires {
        let there = if kind == Kind::Volume { wire.volume().is_some() } else { wire.part(kind).is_some() };
        if !there {
            let error = Error::refused(format!("the geometry of the input `{input}` has no {kind}"));
            return Err(error.hint("`convect stats FILE` prints what a file has"));
        }
    }
    Ok(())
}

fn check_kinds(output: &str, kinds: &[Kind], geometry: &Geometry) -> Result<()> {
    let there: Vec<Kind> = geometry.kinds().collect();
    match kinds.iter().find(|kind| !there.contains(kind)) {
        Some(kind) => Err(Error::contract(format!("its output `{output}` has no {kind}"))),
        None => Ok(()),
    }
}

/// What to do about numbers beyond single precision that a node made of finite ones.
const NOT_FINITE: &str = "a param of the node is too large or too small, or a number in its inputs";

/// Refuses NaN and infinity in arrays that no input holds: those were checked where they were made.
pub(super) fn check_finite(geometry: &Geometry, known: &[usize]) -> Result<()> {
    for part in geometry.parts() {
        for (owner, name, column) in part.columns() {
            if known.binary_search(&column.address()).is_ok() {
                continue;
            }
            if let Some(row) = column.first_not_finite() {
                let row = match owner {
                    Owner::Once => String::new(),
                    _ => format!(" of {owner} {row}"),
                };
                let fact = format!("`{name}`{row} of the {} is NaN or infinite", part.kind());
                return Err(Error::new(ErrorKind::NotFinite, fact));
            }
        }
    }
    if let Some(volume) = geometry.volume() {
        for grid in [volume.level_grid(), volume.velocity_grid()] {
            if !grid.origin.iter().chain([&grid.cell]).all(|x| x.is_finite()) {
                return Err(Error::new(ErrorKind::NotFinite, "the grid of the volume is NaN or infinite"));
            }
        }
        for (name, field) in volume.fields() {
            let fresh = field.arrays().iter().any(|(address, _)| known.binary_search(address).is_err());
            if !fresh || field.values().iter().chain([&field.background()]).all(|x| x.is_finite()) {
                continue;
            }
            let at = field.nodes().find(|(_, x)| !x.is_finite());
            let at = at.map_or_else(String::new, |(node, _)| format!(" of cell {node:?}"));
            return Err(Error::new(ErrorKind::NotFinite, format!("`{name}`{at} is NaN or infinite")));
        }
    }
    Ok(())
}

/// The geometry without attributes nobody takes, their names put to `stripped`; the same pointer where there is none.
fn without_dead(geometry: &Arc<Geometry>, live: &[Name], stripped: &mut Vec<Name>) -> Arc<Geometry> {
    let dead: Vec<(Kind, Owner, Name)> = geometry
        .parts()
        .flat_map(|part| part.columns().map(move |(owner, name, _)| (part.kind(), owner, name)))
        .filter(|(_, _, name)| ***name != *P.name && !live.contains(name))
        .map(|(kind, owner, name)| (kind, owner, name.clone()))
        .collect();
    if dead.is_empty() {
        return geometry.clone();
    }
    let mut geometry = Geometry::clone(geometry);
    for (kind, owner, name) in dead {
        if let Some(part) = geometry.part_mut(kind) {
            part.remove(owner, &name);
        }
        stripped.push(name);
    }
    Arc::new(geometry)
}

/// The error of a panic: its message, without where in the code, which says nothing to a user.
fn panicked(panic: &(dyn Any + Send)) -> Error {
    let said = panic.downcast_ref::<String>().map(String::as_str).or_else(|| panic.downcast_ref::<&str>().copied());
    let said = said.unwrap_or("no message");
    Error::new(ErrorKind::Panic, format!("it failed unexpectedly: {said}")).hint(IS_A_BUG)
}
