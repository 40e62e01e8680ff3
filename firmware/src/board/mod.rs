//! Board abstraction: serial link, counter, watchdog, log.

#[cfg(feature = "board-an500")]
mod an500;
#[cfg(feature = "board-an500")]
mod cmsdk;
#[cfg(feature = "board-h743")]
mod h743;
mod interface;
#[cfg(all(not(defmt_log), feature = "board-microbit"))]
mod semihosting;
#[cfg(feature = "board-an500")]
mod uart;
mod unowned;

#[cfg(feature = "board-an500")]
pub use an500::{An500, An500 as Current, UartError, front_end};
#[cfg(feature = "board-h743")]
pub use h743::{H743, H743 as Current, SerialLink};
#[cfg(feature = "spi-front-end")]
pub use h743::{SpiFrontEnd, front_end};
pub use interface::Board;
pub use unowned::{end, log, log_event, reset};

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
