//! Board abstraction: serial link, counter, watchdog, log.

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
compile_error!("no board selected: add --features board-an500, board-h743 or board-microbit");
#[cfg(any(
    all(feature = "board-an500", feature = "board-h743"),
    all(feature = "board-an500", feature = "board-microbit"),
    all(feature = "board-h743", feature = "board-microbit")
))]
compile_error!("several boards selected: add --no-default-features to --features board-...");

// The micro:bit represents devices without atomic exchange and floating point: it has a log but no `Board`.

/// Hardware interface of the application.
pub trait Board: Sized {
    /// Serial link. `read` and `write` block until at least one byte can be transferred. Check `read_ready` and
    /// `write_ready` first to avoid blocking.
    type Link: Read + ReadReady + Write + WriteReady;
    /// Status light; high is on.
    type Light: OutputPin;

    /// Board name for the start-up banner.
    const NAME: &'static str;
    /// Rate of [`Board::ticks`] in hertz.
    const TICKS_HZ: u32;
    /// Watchdog timeout in milliseconds.
    const WATCHDOG_MS: u32;

    /// Initialise and return the board. `None` if it was taken before. The watchdog starts when it is first fed.
    fn take() -> Option<Self>;

    /// Serial link of the board.
    fn link(&mut self) -> &mut Self::Link;

    /// Sleep until the link has received something. May return early: check again and repeat.
    fn wait(&mut self);

    /// Status light of the board.
    fn light(&mut self) -> &mut Self::Light;

    /// Free-running counter at [`Board::TICKS_HZ`], wrapping.
    fn ticks(&self) -> u32;

    /// Start or feed the watchdog.
    fn feed_watchdog(&mut self);

    /// Reset the board.
    fn reset(&mut self) -> ! {
        reset()
    }

    /// Log a line for a debugger. Discarded if none is attached.
    fn log(&mut self, message: fmt::Arguments<'_>) {
        log(message);
    }
}

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
    an500::line(message);
}

/// Log a line, for code that does not own the board.
#[cfg(all(not(feature = "defmt"), feature = "board-microbit"))]
pub fn log(message: fmt::Arguments<'_>) {
    semihosting::line(message);
}

/// Discard a log line. Without `defmt` there is no reader: semihosting would halt a board that runs without a debugger.
#[cfg(all(not(feature = "defmt"), feature = "board-h743"))]
pub fn log(_message: fmt::Arguments<'_>) {}

#[cfg(all(feature = "defmt", feature = "board-h743"))]
use defmt_rtt as _;
#[cfg(all(feature = "defmt", feature = "board-an500"))]
use defmt_semihosting as _;

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
