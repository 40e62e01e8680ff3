//! Hardware interface of the application.

use core::fmt;

use embedded_hal::digital::OutputPin;
use embedded_io::{Read, ReadReady, Write, WriteReady};

use super::unowned::{log, reset};

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
    /// Maximum duration of a processing step in microseconds: that which fills the receive buffer of the link. `None` where
    /// the counter does not measure the time of the processor.
    const MAX_STEP_US: Option<u32>;
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

    /// Log a line for an attached debugger; without one it is discarded.
    fn log(&mut self, message: fmt::Arguments<'_>) {
        log(message);
    }
}
