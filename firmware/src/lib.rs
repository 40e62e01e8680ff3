//! Embedded module firmware: the library shared by the programs for a board.
//!
//! | module | content |
//! |---|---|
//! | [`endpoint`] | the module's end of the link, without input or output |
//! | [`front_end`] | sources of pulses on the module: SPI converter, frames over a serial port |
//! | [`engine`] | interface between the link and the arithmetic engines |
//! | [`odometer`] | interface between the link and an odometer |
//! | [`profiler`] | interface between the link and a range profiler |
//! | [`products`] | detections and image chips |
//! | [`sizes`] | buffer sizes of the application |
//! | `serve` | main loop of the application |
//! | `board` | trait `Board`, the two boards that implement it, and their links: serial, Ethernet, USB |
//! | `memory` | placement of statics; stack high-water mark |
//! | `fault` | panic and exception handlers: log, count, reset |
//! | `module` | static buffers and the endpoint that uses them |
//! | `meter` | instruction count on the emulated board, cycle count on a real one |
//! | `riscv_virt` | start-up, output and exit on QEMU's RISC-V machine |
//!
//! The last seven compile for a target only (six for ARM, one for RISC-V); the others also run on a host.
#![no_std]

pub mod endpoint;
pub mod engine;
pub mod front_end;
pub mod odometer;
pub mod products;
pub mod profiler;
pub mod sizes;

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
