//! What the programs for a board share.
//!
//! | module | what it is |
//! |---|---|
//! | [`station`] | the module's end of the link, without input or output |
//! | [`engine`] | the arithmetics as the link sees them |
//! | [`products`] | detections and chips |
//! | [`sizes`] | what the application is built for |
//! | `serve` | the application's loop |
//! | `board` | `Board` and the two boards that there are |
//! | `memory` | where statics lie; how much of the stack was used |
//! | `fault` | panics and exceptions: a line of log, then a reset, counted |
//! | `module` | the buffers, and the station in them |
//! | `meter` | instructions on the emulated board, cycles on a real one |
//!
//! The last six are for a target only; the others run on a host too.
#![no_std]

pub mod engine;
pub mod products;
pub mod sizes;
pub mod station;

#[cfg(target_os = "none")]
pub mod board;
#[cfg(target_os = "none")]
pub mod fault;
#[cfg(target_os = "none")]
pub mod memory;
#[cfg(target_os = "none")]
pub mod meter;
#[cfg(target_os = "none")]
pub mod module;
#[cfg(target_os = "none")]
pub mod serve;
