//! What a radio refuses, or fails at, and what to do.

/// Why a radio did not do what it was asked.
#[derive(Debug, thiserror::Error)]
pub enum RadioError {
    /// Beyond what the device can do.
    #[error(
        "{what} of {asked} {unit} is out of the radio's range, {from} to {to} {unit}: choose one within"
    )]
    OutOfRange {
        /// The quantity.
        what: &'static str,
        /// What was asked for.
        asked: f64,
        /// The least.
        from: f64,
        /// The most.
        to: f64,
        /// Their unit.
        unit: &'static str,
    },
    /// The device does not answer any more.
    #[error("the radio is gone ({0}): check its cable and its power, then list the radios again")]
    Gone(String),
    /// A burst before the radio was configured and tuned.
    #[error("the radio is not ready: {0}")]
    NotReady(&'static str),
    /// A burst that makes no sense.
    #[error("burst: {0}")]
    Burst(String),
    /// Something the device has no means for.
    #[error("this radio cannot do that: {0}")]
    Unsupported(String),
    /// A replayed recording has no more.
    #[error("the recording ends here: {0}")]
    Ended(String),
    /// What a device's driver says, and what helps.
    #[error("{0}")]
    Driver(String),
    /// What a backend reads from, or a wrapper writes to, failed.
    #[error("{0}")]
    File(String),
}

/// What to do where a USRP is asked for and this build has no UHD.
#[cfg(not(feature = "uhd"))]
pub const NO_UHD: &str = "this build knows no USRP: install UHD (Debian: libuhd-dev) and build with the feature uhd; UHD is under \
                          GPL-3.0-or-later, and so is what is linked with it";
