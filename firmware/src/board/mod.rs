//! Board abstraction: serial link, counter, watchdog, log.

#[cfg(feature = "board-an500")]
mod an500;
#[cfg(feature = "board-an500")]
mod cmsdk;
#[cfg(feature = "ethernet")]
mod ethernet;
#[cfg(feature = "board-h743")]
mod h743;
mod interface;
#[cfg(feature = "board-an500")]
mod interrupt;
#[cfg(feature = "ethernet")]
mod lan9118;
#[cfg(all(not(defmt_log), feature = "board-microbit"))]
mod semihosting;
#[cfg(feature = "board-an500")]
#[cfg_attr(
    feature = "ethernet",
    allow(
        dead_code,
        reason = "the link is not UART0, and the front end only receives"
    )
)]
mod serial;
#[cfg(feature = "board-an500")]
mod uart;
mod unowned;
#[cfg(all(feature = "board-h743", not(feature = "usb")))]
mod usart;
#[cfg(all(feature = "board-h743", feature = "usb"))]
mod usb;

#[cfg(feature = "board-an500")]
pub use an500::{An500, An500 as Current, front_end};
#[cfg(feature = "ethernet")]
pub use ethernet::{PORT, TcpError, TcpLink};
#[cfg(feature = "board-h743")]
pub use h743::{H743, H743 as Current};
#[cfg(feature = "spi-front-end")]
pub use h743::{SpiFrontEnd, front_end};
pub use interface::Board;
#[cfg(feature = "board-an500")]
pub use serial::{Uart, UartError};
pub use unowned::{end, log, log_event, reset};
#[cfg(all(feature = "board-h743", not(feature = "usb")))]
pub use usart::{BAUD, SerialLink};
#[cfg(all(feature = "board-h743", feature = "usb"))]
pub use usb::UsbLink;

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
#[cfg(all(feature = "ethernet", not(feature = "board-an500")))]
compile_error!("ethernet needs the controller of the AN500: add --features board-an500");
#[cfg(all(feature = "ethernet", feature = "no-panic"))]
compile_error!(
    "ethernet excludes no-panic: smoltcp indexes and unwraps where the linker cannot rule out a panic"
);
#[cfg(all(
    any(feature = "usb", feature = "serial-12m"),
    not(feature = "board-h743")
))]
compile_error!("usb and serial-12m need the STM32H743: add --features board-h743");
#[cfg(all(feature = "usb", feature = "serial-12m"))]
compile_error!("several links selected: choose one of usb and serial-12m, or neither");
#[cfg(all(feature = "spi-front-end", not(feature = "board-h743")))]
compile_error!("spi-front-end needs the STM32H743: add --features board-h743");
#[cfg(all(feature = "usb", feature = "no-panic"))]
compile_error!(
    "usb excludes no-panic: usb-device and its driver index and assert where the linker cannot rule out a panic"
);

// The micro:bit represents devices without atomic exchange and floating point: it has a log but no `Board`.
