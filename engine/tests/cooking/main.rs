//! Tests of planning and cooking, with small nodes whose results can be computed by hand.

mod builder;
mod cancelled;
mod checkpoints;
mod depth;
mod faults;
mod integrals;
mod keys;
mod killed;
mod memory;
mod nodes;
mod once;
mod overhead;
mod solvers;
mod velocities;
mod windows;
