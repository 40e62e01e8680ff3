//! Reset, log, and end of a program, for code that does not own the board.

use core::fmt;

#[cfg(all(feature = "defmt", feature = "board-h743"))]
use defmt_rtt as _;
#[cfg(all(feature = "defmt", feature = "board-an500"))]
use defmt_semihosting as _;

/// Reset the board, for code that does not own it.
pub fn reset() -> ! {
    cortex_m::peripheral::SCB::sys_reset()
}

/// Log a line, for code that does not own the board.
#[cfg(feature = "defmt")]
pub fn log(message: fmt::Arguments<'_>) {
    defmt::println!("{}", defmt::Display2Format(&message));
}

/// Log a line, for code that does not own the board. Uses the second UART: no debugger or emulator has to serve it, so the
/// application runs with semihosting disabled, which would let a program read and write the host's files.
#[cfg(all(not(feature = "defmt"), feature = "board-an500"))]
pub fn log(message: fmt::Arguments<'_>) {
    super::cmsdk::line(message);
}

/// Log a line, for code that does not own the board.
#[cfg(all(not(feature = "defmt"), feature = "board-microbit"))]
pub fn log(message: fmt::Arguments<'_>) {
    super::semihosting::line(message);
}

/// Discard a log line. Without `defmt` there is no reader: semihosting would halt a board that runs without a debugger.
#[cfg(all(not(feature = "defmt"), feature = "board-h743"))]
pub fn log(_message: fmt::Arguments<'_>) {}

/// End a test program: the emulator exits with success or failure; a board waits.
pub fn end(_success: bool) -> ! {
    #[cfg(any(feature = "board-an500", feature = "board-microbit"))]
    cortex_m_semihosting::debug::exit(if _success {
        cortex_m_semihosting::debug::EXIT_SUCCESS
    } else {
        cortex_m_semihosting::debug::EXIT_FAILURE
    });
    loop {
        cortex_m::asm::wfi();
    }
}
