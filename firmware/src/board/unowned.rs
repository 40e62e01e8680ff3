//! Reset, log, and end of a program, for code that does not own the board.

use core::fmt;

#[cfg(all(defmt_log, feature = "board-h743"))]
use defmt_rtt as _;
#[cfg(all(defmt_log, feature = "board-an500"))]
use defmt_semihosting as _;
use subaperture_core::link::Event;
#[cfg(defmt_log)]
use subaperture_core::link::Level;

/// Reset the board, for code that does not own it.
pub fn reset() -> ! {
    cortex_m::peripheral::SCB::sys_reset()
}

/// Log a line at a level (`info`, `warn` or `error`). With `defmt` the arguments are sent unformatted; the format string must
/// be one that `core::fmt` and `defmt` both accept.
#[macro_export]
macro_rules! log {
    ($level:ident, $($argument:tt)*) => {{
        #[cfg(defmt_log)]
        defmt::$level!($($argument)*);
        #[cfg(not(defmt_log))]
        $crate::board::log(format_args!($($argument)*));
    }};
}

/// Log an event of the endpoint.
#[cfg(defmt_log)]
pub fn log_event(event: &Event) {
    match event.level() {
        Level::Info => defmt::info!("{}", event),
        Level::Warn => defmt::warn!("{}", event),
        Level::Error => defmt::error!("{}", event),
    }
}

/// Log an event of the endpoint.
#[cfg(not(defmt_log))]
pub fn log_event(event: &Event) {
    log(format_args!("{}: {event}", event.level()));
}

/// Log a formatted line, for code that does not own the board: the output of test programs, and the reasons of panics.
#[cfg(defmt_log)]
pub fn log(message: fmt::Arguments<'_>) {
    defmt::error!("{}", defmt::Display2Format(&message));
}

/// Log a line, for code that does not own the board. Uses the second UART: no debugger or emulator has to serve it, so the
/// application runs with semihosting disabled, which would let a program read and write the host's files.
#[cfg(all(not(defmt_log), feature = "board-an500"))]
pub fn log(message: fmt::Arguments<'_>) {
    super::cmsdk::line(message);
}

/// Log a line, for code that does not own the board.
#[cfg(all(not(defmt_log), feature = "board-microbit"))]
pub fn log(message: fmt::Arguments<'_>) {
    super::semihosting::line(message);
}

/// Discard a log line. Without `defmt` there is no reader: semihosting would halt a board that runs without a debugger.
#[cfg(all(not(defmt_log), feature = "board-h743"))]
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
