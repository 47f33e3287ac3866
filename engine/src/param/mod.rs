//! Params: the values that an artist sets on a node.
//!
//! A node declares typed handles ([`Param`]) through [`crate::params!`]; the engine keeps erased [`Value`]s, resolved
//! from a [`Source`] (a literal, keyframes or an expression) at each time they are read.

mod choice;
mod code;
mod controls;
mod handle;
mod source;
mod spec;
mod turn;
mod unit;
mod value;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

pub use choice::{Choice, ChoiceOption};
pub use code::Code;
pub use controls::ControlTable;
pub(crate) use controls::ControlValue;
pub use handle::{Param, ParamDecl, ParamType, RampDefault};
pub(crate) use source::mixed_seed;
pub use source::{Clock, CodeSource, Keyframe, Keyframes, Source};
pub use spec::{Bounds, Companions, Facts, ParamSpec, Shape, Unset};
pub use turn::euler_to_turn;
pub use unit::Unit;
pub use value::{Maskable, Seed, Span, Turn, Value};

/// Which params of a node have been read.
#[derive(Debug, Default)]
pub(crate) struct ReadLog(Box<[AtomicBool]>);

impl ReadLog {
    pub(crate) fn new(params: usize) -> Self {
        Self((0..params).map(|_| AtomicBool::new(false)).collect())
    }
}

/// A node's params at one time.
#[derive(Clone, Debug)]
pub struct Params {
    pub(crate) specs: Arc<[ParamSpec]>,
    pub(crate) values: Arc<[Value]>,
    pub(crate) log: Arc<ReadLog>,
}

impl Params {
    /// Params with a value for each of `specs`, for calling functions of a declaration outside a cook.
    ///
    /// # Panics
    /// If the numbers of values and specs differ.
    pub fn new(specs: Arc<[ParamSpec]>, values: Vec<Value>) -> Self {
        assert_eq!(specs.len(), values.len(), "a value for each param");
        let log = Arc::new(ReadLog::new(specs.len()));
        Self { specs, values: values.into(), log }
    }

    /// Whether the param at `index` of the declaration has been read. Clones share this, and so do all params that one
    /// plan resolves for a node, at any frame.
    pub fn was_read(&self, index: usize) -> bool {
        self.log.0.get(index).is_some_and(|read| read.load(Ordering::Relaxed))
    }

    /// The value of a param.
    ///
    /// # Panics
    /// If the node does not declare the handle. The engine turns the panic into an error with node and frame, and the
    /// conformance suite fails.
    pub fn get<T: ParamType>(&self, param: Param<T>) -> T::Value {
        let index =
            self.specs.iter().position(|spec| std::ptr::eq(spec.name, param.name()) || spec.name == param.name());
        let index = index.unwrap_or_else(|| panic!("it reads the param `{}`, which it does not declare", param.name()));
        if let Some(read) = self.log.0.get(index) {
            read.store(true, Ordering::Relaxed);
        }
        T::typed(&self.values[index])
            .unwrap_or_else(|| panic!("it reads the param `{}` as another type than it declares", param.name()))
    }
}
