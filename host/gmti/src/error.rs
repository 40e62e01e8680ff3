//! Errors of moving target indication.

use subaperture_focus::FormError;
use subaperture_model::phase_history::ReadError;

use crate::adaptive::AdaptiveError;
use crate::tracker::TrackerError;

/// Error of moving target indication.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum GmtiError {
    /// The recording has one channel.
    #[error(
        "expected at least two channels with receivers apart along the track, found {found}: clutter is cancelled by comparing \
         channels"
    )]
    Channels {
        /// Number of channels in the recording.
        found: usize,
    },
    /// The recording has no pulse times.
    #[error(
        "expected pulse times, found none: moving targets differ between channels by the time between their passes; state the pulse \
         repetition frequency if the recording does not contain it"
    )]
    Untimed,
    /// The track does not suit.
    #[error("track: {0}")]
    Track(&'static str),
    /// The channels have the same along-track position.
    #[error(
        "expected phase centres apart along the track, found an extent of {extent_m:.2e} m: channels apart across the track measure \
         heights, not motion; state the positions of the receivers if the recording does not contain them"
    )]
    NoBaseline {
        /// Along-track extent of the phase centres, metres.
        extent_m: f64,
    },
    /// The frequencies of channels or pulses differ by more than a tenth of their step.
    #[error(
        "expected frequencies in all pulses of all channels that differ by at most a tenth of their step, found different ones"
    )]
    Band,
    /// The frequencies change from pulse to pulse or differ between channels.
    #[error(
        "expected one frequency axis in all pulses of all channels for integration over sub-CPIs, found different ones: detect the targets in \
         images, without sub-CPIs"
    )]
    SharedBand,
    /// A channel has no signal.
    #[error("channel '{channel}' has no signal: leave it out")]
    Dead {
        /// Name of the channel.
        channel: String,
    },
    /// A channel does not agree with the first one.
    #[error(
        "channel '{channel}' has a coherence of {coherence:.3} with channel '{reference}', expected at least {expected}: leave it out, or \
         check that both have recorded the same scene"
    )]
    Incoherent {
        /// Name of the channel.
        channel: String,
        /// Name of the reference channel.
        reference: String,
        /// Measured coherence, 0 to 1.
        coherence: f64,
        /// Smallest coherence of an accepted channel.
        expected: f64,
    },
    /// Two channels have exchanged positions or samples.
    #[error(
        "channels '{channel}' and '{reference}' are probably exchanged: their coherence is {exchanged:.3} with exchanged positions and \
         {stated:.3} with the stated ones"
    )]
    Exchanged {
        /// Name of the channel.
        channel: String,
        /// Name of the reference channel.
        reference: String,
        /// Coherence with the stated positions.
        stated: f64,
        /// Coherence with exchanged positions.
        exchanged: f64,
    },
    /// The images of all channels exceed the memory limit.
    #[error(
        "images of {channels} channels need {needed_bytes} bytes, but {allowed_bytes} are allowed: choose a smaller grid"
    )]
    Memory {
        /// Number of channels in the recording.
        channels: usize,
        /// Memory of all images, bytes.
        needed_bytes: u64,
        /// Memory available for images, bytes.
        allowed_bytes: u64,
    },
    /// The range-Doppler maps of all sub-CPIs exceed the memory limit.
    #[error(
        "range-Doppler maps of {sub_cpis} sub-CPIs need {needed_bytes} bytes, but {allowed_bytes} are allowed: choose a smaller grid or a lower largest speed"
    )]
    SubCpiMemory {
        /// Number of sub-CPIs of the aperture.
        sub_cpis: usize,
        /// Memory of all maps, bytes.
        needed_bytes: u64,
        /// Memory available for maps, bytes.
        allowed_bytes: u64,
    },
    /// A setting is out of its range, or the training data do not suffice.
    #[error("{0}")]
    Unsuited(String),
    /// The targets could not be tracked.
    #[error(transparent)]
    Tracker(#[from] TrackerError),
    /// Adaptive detection is not possible.
    #[error(transparent)]
    Adaptive(#[from] AdaptiveError),
    /// An image could not be formed.
    #[error(transparent)]
    Form(#[from] FormError),
    /// The recording could not be read.
    #[error(transparent)]
    Read(#[from] ReadError),
}
