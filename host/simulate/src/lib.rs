//! Simulation of radar recordings from a known radar, track and scene.
//!
//! Part of [Subaperture](https://docs.rs/subaperture), radar image formation; module `simulate` of the crate
//! `subaperture`.
//!
//! Data flow:
//!
//! ```text
//! scenario (TOML) ─> Experiment { radar, track, measured track, scene }
//!                        │ engine: the sum over scatterers, pulse by pulse
//!                        v
//!     waveform Ideal, Stepped ──────────────────────> phase history ─> io::cphd
//!     waveform Pulsed, Fmcw ─> echoes ─> receive ──┘
//!                        ^ receiver: thermal noise, phase noise, interference, converter
//! ```
//!
//! - [`scene`] contains the reflecting objects, [`subaperture_model::radar`] the radar, [`subaperture_model::track`]
//!   its motion, [`track`] random perturbations of the motion.
//! - [`navigation_log`] writes navigation logs of the true track.
//! - [`engine`] computes the sum over all scatterers of the scene for one pulse of one antenna pair. No other part of
//!   the simulator computes echoes.
//! - [`subaperture_io::receive`] converts echoes, simulated or recorded, into phase history. The simulator makes phase
//!   history from echoes only with that crate.
//! - [`PointTargetHistory`] is the plain sum of Schone 2020 (2.11) with the stop-and-go approximation. [`Preset`] returns it,
//!   and it is an independent check of the engine.
//!
//! With the feature `elevation-models` scenarios read HGT and GeoTIFF as terrain.
//!
//! All random effects depend only on the seed, the kind of effect and the pulse index: the same seed gives
//! bit-identical files with any number of threads and any order of reading.
#![forbid(unsafe_code)]

mod channel;
pub mod engine;
pub mod experiment;
mod log_states;
pub mod navigation_log;
mod plain;
mod preset;
pub mod random;
pub mod receiver;
mod record_error;
mod recording;
pub mod scenario;
pub mod scene;
pub mod track;

pub use channel::Channel;
pub use experiment::{Experiment, Pair};
pub use plain::{Noise, PointTargetHistory, Scatterer};
pub use preset::{Preset, PresetError, Variation};
pub use record_error::RecordError;
pub use recording::Recording;
