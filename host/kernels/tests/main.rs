//! SIMD kernels against their defining sums, and bit for bit in all instruction sets
//! of the processor. They use the library as built, so that its kernels, which compile slowly, are compiled once.

mod bits;
mod decimation;
mod folded_sums;
mod horner;
mod tile;
// Unit tests use the rest of this module.
#[allow(dead_code)]
#[path = "../src/trial.rs"]
mod trial;
