//! The foundation of all kernels: vectors, lanes, SIMD paths, trigonometry, random numbers, noise, ramps, trees of
//! triangles, of points and of moving boxes, closest points, crossing times, partitions, factored matrices and shapes.
//! Plain slices in, plain slices out; it knows neither nodes nor geometry.
//!
//! Promise: the same bits on any x86-64 or aarch64 CPU and for any number of threads. Sums have a
//! fixed order, products and sums are never fused, transcendental functions are our own.
//!
//! How a kernel is written: scalar, branch-free functions, called from loops over [`lanes::LANES`] inside a function
//! made by `simd::kernel!`. The compiler vectorises each such loop to the CPU's width. Inner loops over anything else,
//! branches and bounds checks would prevent that, so they stay outside.

#![allow(clippy::needless_range_loop, reason = "a loop over lanes reads and writes many arrays")]

pub mod adjacency;
pub mod affine;
pub mod cholesky;
pub mod closest_point;
pub mod cluster_order;
pub mod coplanarity;
pub mod lanes;
pub mod masked;
pub mod noise;
pub mod parallel;
pub mod partition;
pub mod pieces;
pub mod point_tree;
pub mod quad;
pub mod ramp;
pub mod random;
pub mod rank_one;
pub mod rotation;
pub mod shapes;
pub mod simd;
pub mod sparse_field;
pub mod swept;
pub mod tree;
pub mod triangulate;
pub mod trig;
pub mod vector;
pub mod volume;
