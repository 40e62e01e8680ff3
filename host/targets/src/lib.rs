//! Targets in range profiles, followed from pulse to pulse, and the radar's own track from them.
//!
//! A part of [Subaperture](https://docs.rs/subaperture), radar image formation: the crate `subaperture`
//! has it as its module `targets`.
//!
//! ```text
//! Channels ─> profile ─> cfar ─> echo ─> follow ─> sightings ─> motion::track ─> recover: a track in the scene
//!             power of    peaks   path and    the same     of each        poses, covariances
//!             all channels        phases      target       pulse
//! ```
//!
//! | module | what it does | of Chim 2018 |
//! |---|---|---|
//! | [`arrangement`] | antennas on their body, from the recording's first pulse | 7.3.2 |
//! | [`cfar`] | detection in the power of all channels, by the mean or an order statistic | 7.3.3 |
//! | [`echo`] | path and phases of each target, with standard deviations | 7.3.3 |
//! | [`follow`] | the same target over pulses | |
//! | [`see()`] | these one after another, over a recording in blocks | 7.4 |
//! | [`recover()`] | the track, laid upon the recorded positions | 7.4 |
//! | [`live`] | the same pulse by pulse, while the radar moves | |
//! | [`fault`] | what is wrong with a recording, and what can be trusted | |
#![forbid(unsafe_code)]

pub mod arrangement;
pub mod cfar;
pub mod echo;
pub mod fault;
pub mod follow;
pub mod live;
mod profile;
mod recover;
mod see;

pub use arrangement::{Arrangement, ArrangementError};
pub use echo::Echo;
pub use fault::Fault;
pub use recover::{Moment, Place, Recovered, recover};
pub use see::{Seen, Settings, TargetsError, see};
