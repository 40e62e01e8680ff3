//! What the programs for a board share: the board itself, its memory, faults and logs.
//!
//! | module | what it is |
//! |---|---|
//! | [`board`] | [`board::Board`] and the two boards that there are |
//! | [`memory`] | where statics lie; how much of the stack was used |
//! | [`fault`] | panics and exceptions: a line of log, then a reset, counted |
//!
//! On a host the library is empty: only `selftest` runs there, to be compared.
#![no_std]

#[cfg(target_os = "none")]
pub mod board;
#[cfg(target_os = "none")]
pub mod fault;
#[cfg(target_os = "none")]
pub mod memory;
