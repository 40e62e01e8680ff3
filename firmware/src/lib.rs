//! What the programs for a board share.
//!
//! | module | what it is |
//! |---|---|
//! | [`station`] | the module's end of the link, without input or output |
//! | [`engine`] | the arithmetics as the link sees them |
//! | [`odometer`] | an odometer as the link sees it |
//! | [`profiler`] | a profiler as the link sees it |
//! | [`products`] | detections and chips |
//! | [`sizes`] | what the application is built for |
//! | `serve` | the application's loop |
//! | `board` | `Board` and the two boards that there are |
//! | `memory` | where statics lie; how much of the stack was used |
//! | `fault` | panics and exceptions: a line of log, then a reset, counted |
//! | `module` | the buffers, and the station in them |
//! | `meter` | instructions on the emulated board, cycles on a real one |
//! | `riscv_virt` | start, output and end on QEMU's RISC-V machine |
//!
//! The last seven are for a target only (six for ARM, one for RISC-V); the others run on a host too.
#![no_std]

pub mod engine;
pub mod odometer;
pub mod products;
pub mod profiler;
pub mod sizes;
pub mod station;

#[cfg(all(target_os = "none", target_arch = "arm"))]
pub mod board;
#[cfg(all(target_os = "none", target_arch = "arm"))]
pub mod fault;
#[cfg(all(target_os = "none", target_arch = "arm"))]
pub mod memory;
#[cfg(all(
    target_os = "none",
    target_arch = "arm",
    not(feature = "board-microbit")
))]
pub mod meter;
#[cfg(all(
    target_os = "none",
    target_arch = "arm",
    not(feature = "board-microbit")
))]
pub mod module;
#[cfg(all(
    target_os = "none",
    target_arch = "arm",
    not(feature = "board-microbit")
))]
pub mod serve;

#[cfg(all(target_os = "none", target_arch = "riscv32"))]
pub mod riscv_virt;
