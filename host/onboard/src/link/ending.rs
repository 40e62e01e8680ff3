//! How a transfer ended, and why.

use std::io;
use std::path::PathBuf;
use std::time::Duration;

use subaperture_core::link::{MAX_ANTENNAS, Refusal};

use super::counts::Counts;
use subaperture_model::phase_history::ReadError;

/// Why a firmware that nobody named is not run.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum UnnamedFirmware {
    /// None is where it is looked for.
    #[error(
        "there is no {} here or above {}: build it with 'cargo xtask module', or name the firmware",
        name.display(), here.display()
    )]
    NotThere {
        /// What is looked for.
        name: PathBuf,
        /// Where that begins.
        here: PathBuf,
    },
    /// Others could have put it there.
    #[error("{} was found, but {what}: if you trust it, name it", firmware.display())]
    Untrusted {
        /// What was found.
        firmware: PathBuf,
        /// What is open to whom.
        what: String,
    },
}

/// What a sink of maps fails with.
pub type SinkError = Box<dyn std::error::Error + Send + Sync>;

/// Why a session did not do what it should.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LinkError {
    /// The line is gone.
    #[error("the line to the module: {0}")]
    Line(#[from] io::Error),
    /// Nothing that makes sense comes.
    #[error(
        "the module does not answer: is it running this firmware, at this speed, and is nobody else \
         talking to it?"
    )]
    Silent,
    /// Another protocol.
    #[error(
        "the module speaks protocol version {0}, this program version {PROTOCOL}: update the older \
         of the two", PROTOCOL = subaperture_core::link::PROTOCOL_VERSION
    )]
    Version(u8),
    /// It said no.
    #[error("the module refuses: {0}")]
    Refused(Refusal),
    /// What is to be sent contradicts itself; nothing was sent.
    #[error(transparent)]
    Mismatch(#[from] Mismatch),
    /// It answers, but takes no pulse and sends no map.
    #[error(
        "the module answers, but for {0:?} it has taken no pulse and sent no map: its line may lose every \
         long frame, or it hangs; switch it off and on"
    )]
    Stuck(Duration),
    /// It began anew.
    #[error("the module began anew again and again, without a map in between")]
    Restarted,
    /// It began anew in the middle of a run whose state it alone had.
    #[error(
        "the module began anew at pulse {0}: increments up to there are good; begin again from there"
    )]
    BeganAnew(u32),
    /// It began anew in the middle of a run of range profiles.
    #[error(
        "the module began anew at sweep {0}: profiles up to there are good; begin again from there"
    )]
    BeganAnewAtSweep(u32),
    /// Samples cannot be read.
    #[error(transparent)]
    Recording(#[from] ReadError),
    /// A map cannot be kept.
    #[error("{0}")]
    Sink(SinkError),
    /// The user wants it so.
    #[error("interrupted")]
    Cancelled,
}

/// What does not go together in what is to be sent to a module for increments or range profiles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Mismatch {
    /// More antennas than a message holds.
    #[error("{0} antennas; a message holds {MAX_ANTENNAS}: leave some out")]
    Antennas(usize),
    /// Not a channel for each pair of antennas.
    #[error(
        "{transmitters} transmitters and {receivers} receivers make {} channels, and the recording has {channels}: name the \
         antennas of these channels, transmitter by transmitter, receiver by receiver", transmitters * receivers
    )]
    Channels {
        /// Transmitters named.
        transmitters: usize,
        /// Receivers named.
        receivers: usize,
        /// Channels of the recording.
        channels: usize,
    },
    /// A channel's pulses are not as long as the setup says.
    #[error(
        "channel {channel} has {samples} samples a pulse, and the setup {frequencies} frequencies: they are to be the same"
    )]
    Samples {
        /// The channel, from 0.
        channel: usize,
        /// Its samples a pulse.
        samples: usize,
        /// Those of the setup.
        frequencies: u16,
    },
    /// Not a weight for each carrier.
    #[error("{weights} weights for {carriers} carriers: each needs one")]
    Weights {
        /// Weights given.
        weights: usize,
        /// Carriers of the setup.
        carriers: u16,
    },
    /// A burst is at no carrier of the setup, or longer than it says.
    #[error(
        "burst {index} of sweep {sweep} is of {got} samples at carrier {carrier}, counted from 0, and the setup has {carriers} carriers and bursts of {samples} \
         samples: they are to fit"
    )]
    Burst {
        /// The sweep.
        sweep: u32,
        /// The burst in it, from 0.
        index: usize,
        /// Its carrier, from 0.
        carrier: u16,
        /// Carriers of the setup.
        carriers: u16,
        /// Its samples.
        got: usize,
        /// Those of the setup.
        samples: u32,
    },
    /// A pulse is of other frequencies than the setup's.
    #[error(
        "pulse {pulse} of channel {channel} has another first frequency or step than the setup: all pulses need those of it"
    )]
    Band {
        /// The channel, from 0.
        channel: usize,
        /// The first such pulse, from 0.
        pulse: usize,
    },
}

impl LinkError {
    /// Whether connecting and configuring anew may help.
    pub(super) fn is_passing(&self) -> bool {
        matches!(
            self,
            Self::Line(_) | Self::Silent | Self::Stuck(_) | Self::Restarted
        )
    }
}

/// How a transfer ended.
#[derive(Debug)]
pub enum Ending {
    /// Every map was taken.
    Complete,
    /// All was done that was to be; maps are missing.
    Incomplete,
    /// It broke off.
    Failed(LinkError),
}

/// What came of a transfer.
#[derive(Debug)]
pub struct Outcome {
    /// What was done.
    pub counts: Counts,
    /// Sub-CPI and patch of every map that is missing.
    pub missing: Vec<(u32, u16)>,
    /// How it ended.
    pub ending: Ending,
}
