//! Numerics of convect: plain slices in, plain slices out; knows no node and no geometry.
//!
//! Promise: the same bits on any x86-64 or aarch64 CPU and for any number of threads. Sums have a
//! fixed order, products and sums are never fused, transcendental functions are our own.

pub mod bend;
pub mod lanes;
pub mod noise;
pub mod ramp;
pub mod random;
pub mod simd;
pub mod trig;
pub mod vec3;
