//! Targets in range profiles, their association from pulse to pulse, and the radar's track estimated from them.
//!
//! ```text
//! Channels ─> profile ─> cfar ─> echo ─> follow ─> sightings ─> motion::track ─> recover: a track in the scene
//!             power of    peaks   path and    association  of each        poses, covariances
//!             all channels        phases      by target    pulse
//! ```
//!
//! | module | purpose | Chim 2018 |
//! |---|---|---|
//! | [`arrangement`] | antennas on their body, from the recording's first pulse | 7.3.2 |
//! | [`cfar`] | CFAR detection in the power of all channels, cell averaging or order statistic | 7.3.3 |
//! | [`echo`] | path and phases of each target, with standard deviations | 7.3.3 |
//! | [`follow`] | association of targets from pulse to pulse | |
//! | [`detect_targets()`] | all of these over a recording, in blocks | 7.4 |
//! | [`recover()`] | the track, aligned with the recorded positions | 7.4 |
//! | [`on_track()`] | channels on a track that replaces the recorded positions | 7.4 |
//! | [`live`] | online track, pulse by pulse | |
//! | [`fault`] | faults of a recording, and what stays reliable | |

pub mod arrangement;
pub mod cfar;
mod detection;
pub mod echo;
pub mod fault;
pub mod follow;
mod for_module;
pub mod live;
mod placed;
mod profile;
mod recover;

pub use arrangement::{Arrangement, ArrangementError};
pub use detection::{Detections, Settings, TargetsError, detect_targets};
pub use echo::{Echo, Subtraction};
pub use fault::Fault;
pub use placed::on_track;
pub use recover::{Moment, Mover, Place, Recovered, recover};
