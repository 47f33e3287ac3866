//! Planning and cooking, tried with small nodes whose results can be worked by hand.

mod checkpoints;
mod faults;
mod integrals;
mod keys;
mod killed;
mod memory;
mod net;
mod nodes;
mod once;
mod overhead;
mod solvers;
mod velocities;
mod windows;
