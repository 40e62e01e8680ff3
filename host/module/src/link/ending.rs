//! Result of a transfer, and error types of the link.

use std::io;
use std::path::PathBuf;
use std::time::Duration;

use subaperture_core::link::{MAX_ANTENNAS, Refusal};

use super::counts::Counts;
use subaperture_model::phase_history::ReadError;

/// Reason why firmware that was not named explicitly is not run.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum UnnamedFirmware {
    /// No firmware at the default location.
    #[error(
        "no {} in or above {}: build it with 'cargo xtask module', or name the firmware",
        name.display(), here.display()
    )]
    NotThere {
        /// Expected path below the folder.
        name: PathBuf,
        /// Folder where the search starts.
        here: PathBuf,
    },
    /// The firmware is writable by other users.
    #[error("{} was found, but {what}: if you trust it, name it", firmware.display())]
    Untrusted {
        /// Path of the firmware found.
        firmware: PathBuf,
        /// Path and the permission that makes it unsafe.
        what: String,
    },
}

/// Error of a map sink.
pub type SinkError = Box<dyn std::error::Error + Send + Sync>;

/// Error of a session.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LinkError {
    /// Line failure.
    #[error("line to the module: {0}")]
    Line(#[from] io::Error),
    /// No valid answer.
    #[error(
        "the module does not answer: check that it runs this firmware, at this bit rate, and that no other program \
         uses the line"
    )]
    Silent,
    /// Other protocol version.
    #[error(
        "protocol version: expected {PROTOCOL}, found {0} on the module: update the older \
         of the two", PROTOCOL = subaperture_core::link::PROTOCOL_VERSION
    )]
    Version(u8),
    /// Command refused by the module.
    #[error("refused by the module: {0}")]
    Refused(Refusal),
    /// Inconsistent input; nothing was sent.
    #[error(transparent)]
    Mismatch(#[from] Mismatch),
    /// The module answers but accepts no pulses and sends no maps.
    #[error(
        "no progress: the module answers, but for {0:?} it has accepted no pulse and sent no map. The line may lose every \
         long frame, or the module hangs: power-cycle it"
    )]
    Stuck(Duration),
    /// Repeated restarts of the module.
    #[error(
        "the module restarted repeatedly without completing a map: check its power supply and line"
    )]
    Restarted,
    /// Restart of the module during a motion run, whose state is lost.
    #[error(
        "the module restarted at pulse {0}: earlier increments are valid; start again from there"
    )]
    BeganAnew(u32),
    /// Restart of the module during a range-profile run.
    #[error(
        "the module restarted at sweep {0}: earlier profiles are valid; start again from there"
    )]
    BeganAnewAtSweep(u32),
    /// The recording cannot be read.
    #[error(transparent)]
    Recording(#[from] ReadError),
    /// A map cannot be stored.
    #[error("{0}")]
    Sink(SinkError),
    /// Cancelled by the user.
    #[error("interrupted")]
    Cancelled,
}

/// Inconsistency in the input of a motion or range-profile run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Mismatch {
    /// More antennas than a message holds.
    #[error("antennas: expected at most {MAX_ANTENNAS}, found {0}: leave some out")]
    Antennas(usize),
    /// The number of channels differs from the number of antenna pairs.
    #[error(
        "channels: expected {} for {transmitters} transmitters x {receivers} receivers, found {channels} in the recording: name the \
         antennas of these channels, transmitters outermost, receivers innermost", transmitters * receivers
    )]
    Channels {
        /// Number of transmitters.
        transmitters: usize,
        /// Number of receivers.
        receivers: usize,
        /// Number of channels in the recording.
        channels: usize,
    },
    /// The number of samples per pulse differs from the setup.
    #[error(
        "samples per pulse of channel {channel}: expected {frequencies} as in the setup, found {samples}"
    )]
    Samples {
        /// Channel index from 0.
        channel: usize,
        /// Samples per pulse of the channel.
        samples: usize,
        /// Frequencies of the setup.
        frequencies: u16,
    },
    /// The number of weights differs from the number of carriers.
    #[error("carrier weights: expected one per carrier ({carriers}), found {weights}")]
    Weights {
        /// Number of weights.
        weights: usize,
        /// Number of carriers in the setup.
        carriers: u16,
    },
    /// A burst has a carrier outside the setup or is longer than the setup states.
    #[error(
        "burst {index} of sweep {sweep}: expected a carrier below {carriers} and at most {samples} samples as in the setup, found carrier {carrier} and {got} \
         samples"
    )]
    Burst {
        /// Sweep number.
        sweep: u32,
        /// Index of the burst in the sweep, from 0.
        index: usize,
        /// Carrier index of the burst, from 0.
        carrier: u16,
        /// Number of carriers in the setup.
        carriers: u16,
        /// Number of samples of the burst.
        got: usize,
        /// Samples per burst in the setup.
        samples: u32,
    },
    /// A pulse has other frequencies than the setup.
    #[error(
        "pulse {pulse} of channel {channel}: expected the start frequency and step of the setup, found others"
    )]
    Band {
        /// Channel index from 0.
        channel: usize,
        /// Index of the first such pulse, from 0.
        pulse: usize,
    },
}

impl LinkError {
    /// Whether reconnecting and reconfiguring may help.
    pub(super) fn is_passing(&self) -> bool {
        matches!(
            self,
            Self::Line(_) | Self::Silent | Self::Stuck(_) | Self::Restarted
        )
    }
}

/// How a transfer ended.
#[derive(Debug)]
pub enum TransferEnd {
    /// Every map was received.
    Complete,
    /// All runs were done, but maps are missing.
    Incomplete,
    /// The transfer was aborted by an error.
    Failed(LinkError),
}

/// Result of a transfer.
#[derive(Debug)]
pub struct Outcome {
    /// Statistics of the session.
    pub counts: Counts,
    /// Sub-CPI and patch of every missing map.
    pub missing: Vec<(u32, u16)>,
    /// How the transfer ended.
    pub ending: TransferEnd,
}

impl Outcome {
    /// Outcome of a run without maps.
    pub fn without_maps(counts: Counts, ending: Result<(), LinkError>) -> Self {
        Self {
            counts,
            missing: Vec::new(),
            ending: ending.map_or_else(TransferEnd::Failed, |()| TransferEnd::Complete),
        }
    }
}
