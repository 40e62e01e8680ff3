//! Errors of radios.

/// Error of a radio.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RadioError {
    /// A setting outside the limits of the device.
    #[error(
        "{what} of {asked} {unit} is outside the radio's range: expected {from} to {to} {unit}"
    )]
    OutOfRange {
        /// Name of the setting.
        what: &'static str,
        /// Requested value, in `unit`.
        asked: f64,
        /// Lower limit of the device, in `unit`.
        from: f64,
        /// Upper limit of the device, in `unit`.
        to: f64,
        /// Unit of the values.
        unit: &'static str,
    },
    /// The device is disconnected.
    #[error("radio disconnected ({0}): check its cable and power, then list the radios again")]
    Gone(String),
    /// A burst was requested before the radio was configured and tuned.
    #[error("radio not ready: {0}")]
    NotReady(&'static str),
    /// The requested burst is invalid, with the reason.
    #[error("burst: {0}")]
    Burst(String),
    /// A request that the device does not support.
    #[error("not supported by this radio: {0}")]
    Unsupported(String),
    /// The replayed recording has no further bursts.
    #[error("end of recording: {0}")]
    Ended(String),
    /// Error of the device driver, with advice.
    #[error("{0}")]
    Driver(String),
    /// A file of a backend or of a recording wrapper could not be read or written.
    #[error("{0}")]
    File(String),
}

/// Message for a build without UHD when a USRP is requested.
#[cfg(not(feature = "uhd"))]
pub const NO_UHD: &str = "this build has no USRP support: install UHD (Debian: libuhd-dev) and build with the feature uhd. UHD is under \
                          GPL-3.0-or-later, and so are programs linked with it";
