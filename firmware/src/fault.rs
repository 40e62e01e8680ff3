//! Panic and exception handlers: log one line, count, reset.
//!
//! With the feature `no-panic` the panic handler calls an undefined function, so a program in which the compiler cannot
//! rule out every panic does not link.

use core::panic::PanicInfo;

use cortex_m_rt::{ExceptionFrame, exception};

use crate::{board, log};

/// Number of resets by [`die`] since power-on.
pub fn resets() -> u32 {
    // SAFETY: see `RESETS`.
    let [count, check] = unsafe { (&raw const RESETS).read_volatile() };
    if count == !check { count } else { 0 }
}

/// Log `reason`, count the reset, and reset the board.
pub fn die(reason: core::fmt::Arguments<'_>) -> ! {
    board::log(reason);
    count_and_reset()
}

fn count_and_reset() -> ! {
    let count = resets().wrapping_add(1);
    // SAFETY: see `RESETS`.
    unsafe { (&raw mut RESETS).write_volatile([count, !count]) };
    cortex_m::asm::dsb();
    board::reset()
}

/// Reset count and its complement, in memory that a reset preserves; any other content dates from power-on. Accessed only
/// by volatile access of whole words, by the program and by handlers that never return to it.
// SAFETY: cortex-m-rt neither zeroes sections of this name nor places them in flash; any bits are a valid value of
// this type.
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
    // SAFETY: nothing is ever called by this name, because a program that refers to it does not link.
    unsafe extern "C" {
        /// Undefined on purpose.
        safe fn panic_is_reachable() -> !;
    }
    panic_is_reachable()
}

// SAFETY: cortex-m-rt requires `unsafe` for a handler that may interrupt anything. This one touches no program state
// except `RESETS`, and does not return.
#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    log!(
        error,
        "hard fault at 0x{:08x}, called from 0x{:08x}",
        frame.pc(),
        frame.lr()
    );
    count_and_reset()
}

/// Handler for every other exception and unhandled interrupt. Number -14 is the watchdog.
// SAFETY: as above.
#[exception]
unsafe fn DefaultHandler(number: i16) -> ! {
    log!(error, "exception {}", number);
    count_and_reset()
}
