//! What the programs for a board share.
//!
//! | module | what it is |
//! |---|---|
//! | [`station`] | the module's end of the link, without input or output |
//! | [`sizes`] | what the application is built for |
//! | `serve` | the application's loop |
//! | `board` | `Board` and the two boards that there are |
//! | `memory` | where statics lie; how much of the stack was used |
//! | `fault` | panics and exceptions: a line of log, then a reset, counted |
//!
//! The last four are for a target only; the others run on a host too.
#![no_std]

pub mod sizes;
pub mod station;

#[cfg(target_os = "none")]
pub mod board;
#[cfg(target_os = "none")]
pub mod fault;
#[cfg(target_os = "none")]
pub mod memory;
#[cfg(target_os = "none")]
pub mod serve;
