//! Ground moving target indication (GMTI): clutter cancellation, detection, radial velocity and position.
//!
//! Part of [Subaperture](https://docs.rs/subaperture), radar image formation; the crate `subaperture`
//! re-exports it as the module `gmti`.
//!
//! ```text
//! channels ─> Alignment: common section of the aperture, lags
//!          ─> balance: gain, phase, delay ─> Balanced phase history
//!          ─> Imaging: image of each channel ─> registration: baseline, crab ─> ChannelImages
//!          ─> detection: adaptive matched filter of channel differences ─> StatisticMap
//!          ─> Target: radial velocity, position, covariance; cross-range velocity by focus
//!          ─> refocus: image of each target under its own motion ─> Chip
//!          ─> geojson, stanag4607; tracker: tracks over several recordings or dwells
//! ```
//!
//! [`find`] does all of it. [`space_time`] detects targets of any velocity in the maps of sub-CPIs instead of the images. [`adaptive`] contains the statistics with their thresholds and probabilities, for vectors of any kind.
//!
//! **Signs.** Radial velocities are positive when approaching, and `v = -rate / 2` of the path rate `rate` of a monostatic radar. A target of radial velocity `v` at the range
//! `R` appears `R v / V` ahead along the track of a radar of speed `V`. Lags are positive for channels behind channel 0. A target has the phase
//! `+4 pi v tau_c / lambda` in channel `c` of lag `tau_c`, relative to channel 0.
//!
//! **Sources.** Schone 2020, sections 1.2 and 6.2 (one pipeline for imaging and GMTI); Dickey, Santa, "Final report on anticlutter techniques", General Electric, 1953 (DPCA);
//! Ender, "Space-time processing for multichannel synthetic aperture radar", Electronics and Communication Engineering Journal 11, 1999.
#![forbid(unsafe_code)]

pub mod adaptive;
mod alignment;
pub mod ati;
mod balance;
mod correlation;
pub mod detection;
mod error;
pub mod evaluation;
mod gate;
pub mod geojson;
mod groups;
mod images;
mod interleaved;
mod moments;
mod motion;
mod noise;
mod place;
mod radial;
mod refocus;
pub mod registration;
mod report;
mod sensitivity;
pub mod space_time;
pub mod stanag4607;
mod target;
pub mod tracker;
mod turns;

pub use alignment::Alignment;
pub use balance::{Balanced, ChannelBalance, MIN_COHERENCE, balance};
pub use error::GmtiError;
pub use images::{Cancellation, ChannelImages, Imaging};
pub use motion::{CrossRange, MAX_CROSS_RANGE_M_S};
pub use refocus::Chip;
pub use report::{MovingTargets, find, find_in_dwells};
pub use sensitivity::{AtVelocity, Sensitivity};
pub use target::Target;
