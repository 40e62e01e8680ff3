//! Phase history of a capture: a sweep is a pulse, its carriers are the samples.
//!
//! ```text
//! recording ─ profile::Ranging ─> Capture: a response a sweep and receiver, the time of each carrier
//!                                    └ channels(Placement: track, antennas, reference point) ─> Channels of one receiver or two
//! ```
//!
//! Receiver `i` at carrier `f_k`, taken at `t_k`, of a scatterer at `p` is `exp(-j 2 pi f_k path_i(p, t_k) / c)`; a sample of phase history is that
//! times `exp(+j 2 pi f_k path_i(s, t_k) / c)`, with the scene's reference point `s`: each carrier is referred to it at its own moment.
//!
//! **Motion within a sweep.** Carriers take milliseconds each, so that a radar at 1 m/s is decimetres further at the end of a sweep. A pulse's
//! [`Motion`](subaperture_model::phase_history::Sweep) has antennas on parabolas and carriers at even times. Times are laid on a line by least squares,
//! `t_k = t + (k - K/2) T`, parabolas through the track's places at the ends and the middle of the sweep. What the true places `A(t_k)` are off by, `d_k` (a burst that was taken again delays those
//! after it; shuffled carriers are on no line at all; a track bends), is taken off towards the reference point, exactly; towards `p` there remains
//!
//! ```text
//! |(u(p) - u(s)) . d_k|        for each of both antennas, u the directions from them
//! ```
//!
//! which is bounded over the scene's extent ([`Placement::extent`]; without one, by directions that are opposite), and refused above an eighth of the shortest wavelength: 45 degrees of phase.
//! For carriers in their order that bound allows all that walks; shuffled ones it allows while the radar moves by less than that within a sweep, or
//! the scene is narrow.
//!
//! **Missing carriers** are filled from the others ([`crate::profile::gaps`]), after what the track knows of the motion is taken off; sweeps of which too few are there, or that a leakage does
//! not explain, are left out and told ([`Capture::left_out`]).
//!
//! Memory: 40 bytes a carrier and receiver while it is open, 8 in each history; refused beyond [`Options::memory_bytes`]. Cost: mixing all samples once.

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

/// Why a capture is no phase history.
#[derive(Debug, thiserror::Error)]
pub enum HistoryError {
    /// The recording.
    #[error(transparent)]
    Recording(#[from] SigmfError),
    /// Options that make no sense, or no calibration of this set-up.
    #[error(transparent)]
    Profile(#[from] ProfileError),
    /// Not one sweep is of use.
    #[error("{path}: none of {sweeps} sweeps is of use: {first}")]
    NoSweep {
        /// The recording.
        path: String,
        /// How many there are.
        sweeps: usize,
        /// What is wrong with the first.
        first: String,
    },
    /// The track.
    #[error("{0}")]
    Track(String),
    /// The radar moved too much while it swept.
    #[error(transparent)]
    Motion(#[from] MotionError),
    /// What was made makes no sense as phase history.
    #[error(transparent)]
    History(#[from] ReadError),
    /// The receivers do not belong together.
    #[error(transparent)]
    Channels(#[from] ChannelError),
}
