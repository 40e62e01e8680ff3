//! A board: a serial link, a counter, a watchdog, a log.

use core::fmt;

use embedded_hal::digital::OutputPin;
use embedded_io::{Read, ReadReady, Write, WriteReady};

#[cfg(feature = "board-an500")]
mod an500;
#[cfg(feature = "board-h743")]
mod h743;

#[cfg(all(not(feature = "defmt"), feature = "board-microbit"))]
mod semihosting;

#[cfg(feature = "board-an500")]
pub use an500::{An500, An500 as Current, UartError};
#[cfg(feature = "board-h743")]
pub use h743::{H743, H743 as Current, SerialLink};

#[cfg(not(any(
    feature = "board-an500",
    feature = "board-h743",
    feature = "board-microbit"
)))]
compile_error!("choose a board: --features board-an500, board-h743 or board-microbit");
#[cfg(any(
    all(feature = "board-an500", feature = "board-h743"),
    all(feature = "board-an500", feature = "board-microbit"),
    all(feature = "board-h743", feature = "board-microbit")
))]
compile_error!("two boards: add --no-default-features to --features board-...");

// The micro:bit stands for parts without atomic exchange and floating point: it has a log, and no `Board`.

/// What a program asks of the machine it runs on.
pub trait Board: Sized {
    /// The serial link. `read` and `write` block until they can move a byte; a program that must not
    /// wait asks `read_ready` and `write_ready` first.
    type Link: Read + ReadReady + Write + WriteReady;
    /// A light; high is on.
    type Light: OutputPin;

    /// Name, for the banner.
    const NAME: &'static str;
    /// Rate of [`Board::ticks`].
    const TICKS_HZ: u32;
    /// The watchdog resets the board when it was not fed for this long.
    const WATCHDOG_MS: u32;

    /// The board, set up; `None` if it was taken before. The watchdog sleeps until it is first fed.
    fn take() -> Option<Self>;

    /// The serial link.
    fn link(&mut self) -> &mut Self::Link;

    /// Sleeps until the link has something to read, or a little less: a program that has nothing to do
    /// calls it and asks again.
    fn wait(&mut self);

    /// The light.
    fn light(&mut self) -> &mut Self::Light;

    /// A counter that runs up at [`Board::TICKS_HZ`] and wraps.
    fn ticks(&self) -> u32;

    /// Starts the watchdog, or tells it that the program is alive.
    fn feed_watchdog(&mut self);

    /// Starts over.
    fn reset(&mut self) -> ! {
        reset()
    }

    /// A line of log for a person at a debugger; lost where there is none.
    fn log(&mut self, message: fmt::Arguments<'_>) {
        log(message);
    }
}

/// Starts over; for places that do not own the board.
pub fn reset() -> ! {
    cortex_m::peripheral::SCB::sys_reset()
}

/// Logs a line; for places that do not own the board.
#[cfg(feature = "defmt")]
pub fn log(message: fmt::Arguments<'_>) {
    defmt::println!("{}", defmt::Display2Format(&message));
}

/// Logs a line; for places that do not own the board. It leaves by the second UART: no debugger or emulator has to
/// serve it, so that the application runs where semihosting, which lets a program read and write the host's
/// files, is off.
#[cfg(all(not(feature = "defmt"), feature = "board-an500"))]
pub fn log(message: fmt::Arguments<'_>) {
    an500::line(message);
}

/// Logs a line; for places that do not own the board.
#[cfg(all(not(feature = "defmt"), feature = "board-microbit"))]
pub fn log(message: fmt::Arguments<'_>) {
    semihosting::line(message);
}

/// Logs a line, but without `defmt` there is nobody to read it: semihosting would stop a board that
/// runs without a debugger.
#[cfg(all(not(feature = "defmt"), feature = "board-h743"))]
pub fn log(_message: fmt::Arguments<'_>) {}

#[cfg(all(feature = "defmt", feature = "board-h743"))]
use defmt_rtt as _;
#[cfg(all(feature = "defmt", feature = "board-an500"))]
use defmt_semihosting as _;

/// Ends a program that is a test: the emulator exits with success or failure; a board waits for a person.
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
