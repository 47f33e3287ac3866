//! What all kernels stand on: vectors, lanes, SIMD paths, trigonometry, random numbers, noise, ramps, triangle trees and
//! shapes; plain slices in, plain slices out; knows no node and no geometry.
//!
//! Promise: the same bits on any x86-64 or aarch64 CPU and for any number of threads. Sums have a
//! fixed order, products and sums are never fused, transcendental functions are our own.
//!
//! How a kernel is written: scalar, branch-free functions, and loops over [`lanes::LANES`] that call
//! them, inside a function made by `simd::kernel!`. Each such loop becomes vectors of the CPU's
//! width. A loop over something else inside of it, a choice of code or a bound to check would keep
//! it from that, so those stay outside.

#![allow(clippy::needless_range_loop, reason = "a loop over lanes reads and writes many arrays")]

pub mod affine;
pub mod lanes;
pub mod masked;
pub mod noise;
pub mod ramp;
pub mod random;
pub mod shapes;
pub mod simd;
pub mod tree;
pub mod triangulate;
pub mod trig;
pub mod vector;
pub mod volume;
