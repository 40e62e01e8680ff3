//! Phase history of a capture: one pulse per sweep, one sample per carrier.
//!
//! ```text
//! recording ─ profile::Ranging ─> Capture: one response per sweep and receiver, with the time of each carrier
//!                                    └ channels(Placement: track, antennas, reference point) ─> Channels of one receiver or two
//! ```
//!
//! For receiver `i` at carrier `f_k`, taken at time `t_k`, the response of a scatterer at `p` is `exp(-j 2 pi f_k
//! path_i(p, t_k) / c)`. The phase history sample is this response times `exp(+j 2 pi f_k path_i(s, t_k) / c)`, where
//! `s` is the motion compensation reference point: each carrier is compensated at its own time.
//!
//! **Motion within a sweep.** Each carrier takes milliseconds, so that a radar moving at 1 m/s travels decimetres
//! during a sweep. The intra-pulse [`Motion`](subaperture_model::phase_history::Sweep) of a pulse models antennas on
//! parabolas and carriers at evenly spaced times. A least-squares line fits the times, `t_k = t + (k - K/2) T`; the
//! parabolas pass through the track's positions at the ends and the middle of the sweep. The true antenna positions
//! `A(t_k)` deviate from this model by `d_k`: a repeated burst delays later carriers, shuffled carriers fit no line,
//! and tracks bend. The deviation is compensated exactly towards the reference point `s`. Towards `p` there remains a
//! path error of
//!
//! ```text
//! |(u(p) - u(s)) . d_k|        for each of the two antennas, with u the unit vector from the antenna
//! ```
//!
//! The error is bounded over the scene's extent ([`Placement::extent`]; without an extent, opposite directions are
//! assumed). A bound above an eighth of the shortest wavelength (45 degrees of phase) is an error. At walking speed,
//! ordered carriers meet the bound. Shuffled carriers meet it only if the radar moves by less than that within a sweep,
//! or if the scene is narrow.
//!
//! **Missing carriers** are interpolated from the others ([`crate::profile::gaps`]) after compensation of the known
//! motion. Sweeps with too few carriers, or without a detectable leakage reference, are skipped and listed in
//! [`Capture::left_out`].
//!
//! Memory: 40 bytes per carrier and receiver while the capture is open, and 8 in each history; more than
//! [`Options::memory_bytes`] is an error. Cost: one pass that mixes all samples.

mod motion;
mod placed;
mod read;
mod track;

pub use motion::MotionError;
pub use placed::Placement;
pub use read::{Capture, LeftOut, Options};
pub use track::Track;

use subaperture_model::phase_history::{ChannelError, ReadError};

use crate::profile::ProfileError;
use crate::sigmf::SigmfError;

/// Reason why a capture cannot become phase history.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum HistoryError {
    /// Error of the recording.
    #[error(transparent)]
    Recording(#[from] SigmfError),
    /// Invalid options, or a calibration of another set-up.
    #[error(transparent)]
    Profile(#[from] ProfileError),
    /// No sweep is usable.
    #[error("{path}: no usable sweep among {sweeps}; the first is unusable because: {first}")]
    NoSweep {
        /// Path of the recording.
        path: String,
        /// Number of sweeps in it.
        sweeps: usize,
        /// Fault of the first sweep.
        first: String,
    },
    /// Error of the track or of the placement.
    #[error("{0}")]
    Track(String),
    /// The radar moved too much within a sweep.
    #[error(transparent)]
    Motion(#[from] MotionError),
    /// The resulting phase history is invalid.
    #[error(transparent)]
    History(#[from] ReadError),
    /// The channels of the receivers are inconsistent.
    #[error(transparent)]
    Channels(#[from] ChannelError),
}
