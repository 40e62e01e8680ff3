//! Panics and exceptions: a line of log, then a reset; resets are counted.
//!
//! With the feature `no-panic` there are no panics: the handler calls a function that does not
//! exist, so that a program in which the compiler could not rule out every panic does not link.

use core::panic::PanicInfo;

use cortex_m_rt::{ExceptionFrame, exception};

use crate::board;

/// Resets by [`die`] since the power came on.
pub fn resets() -> u32 {
    // SAFETY: see `RESETS`.
    let [count, check] = unsafe { (&raw const RESETS).read_volatile() };
    if count == !check { count } else { 0 }
}

/// Logs `reason`, counts, resets.
pub fn die(reason: core::fmt::Arguments<'_>) -> ! {
    board::log(reason);
    let count = resets().wrapping_add(1);
    // SAFETY: see `RESETS`.
    unsafe { (&raw mut RESETS).write_volatile([count, !count]) };
    cortex_m::asm::dsb();
    board::reset()
}

/// The count and its complement, in memory that a reset leaves alone; anything else is what the memory
/// held when the power came on. Touched only by volatile access of whole words: from the program, and
/// from handlers that never return to it.
// SAFETY: cortex-m-rt keeps sections of this name out of what is zeroed and out of the flash; any bits
// are a value of this type.
#[unsafe(link_section = ".uninit.resets")]
static mut RESETS: [u32; 2] = [0; 2];

#[cfg(not(feature = "no-panic"))]
#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    die(format_args!("{info}"))
}

#[cfg(feature = "no-panic")]
#[panic_handler]
fn panic(_info: &PanicInfo<'_>) -> ! {
    // SAFETY: nothing is ever called by this name, for a program that refers to it does not link.
    unsafe extern "C" {
        /// Undefined on purpose.
        safe fn panic_is_reachable() -> !;
    }
    panic_is_reachable()
}

// SAFETY: `unsafe` is what cortex-m-rt asks of a handler that may interrupt anything; this one touches no
// state of the program but `RESETS`, and does not return.
#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    die(format_args!(
        "hard fault at 0x{:08x}, called from 0x{:08x}",
        frame.pc(),
        frame.lr()
    ))
}

/// Every other exception and interrupt that nobody handles; -14 is the watchdog's.
// SAFETY: as above.
#[exception]
unsafe fn DefaultHandler(number: i16) -> ! {
    die(format_args!("exception {number}"))
}
