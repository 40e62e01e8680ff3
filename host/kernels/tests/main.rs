//! The kernels that are written over some numbers at once: against the sums that define them, and bit for bit in all instructions
//! that the processor has. Of the library as it is used, so that its kernels, which take long to compile, are compiled once.

mod bits;
mod halving;
mod horner;
mod tile;
// The rest of it is used by the tests beside the code.
#[allow(dead_code)]
#[path = "../src/trial.rs"]
mod trial;
