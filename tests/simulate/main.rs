//! Tests of the simulator: engines, chain from echoes to recordings, receivers, random scenarios.

mod bits;
mod chain;
mod distributed;
mod engine;
mod patterns;
mod receiver;
mod scenarios;
