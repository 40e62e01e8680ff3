//! Simulated recordings: a radar that can be told to do anything, and a scene that is known.
//!
//! A part of [Subaperture](https://docs.rs/subaperture), radar image formation: the crate `subaperture`
//! has it as its module `simulate`.
//!
//! The way of the data:
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
//! - [`scene`] is what reflects, [`subaperture_model::radar`] what transmits and receives,
//!   [`subaperture_model::track`] how it moves, [`track`] what disturbs that at random.
//! - [`engine`] computes, for one pulse of one pair of antennas, the sum over all scatterers
//!   of the scene; nothing else in the simulator knows how.
//! - [`subaperture_receive`] turns echoes, simulated or recorded, into phase history. The simulator
//!   never makes phase history from echoes in any other way.
//! - [`Simulated`] is the plain sum of Schone 2020 (2.11) with the radar standing still during a
//!   pulse: what [`Preset`] gives, and a second opinion on the engine.
//!
//! Everything random depends on the seed, the kind of disturbance and the pulse's index only: the same
//! seed gives the same file on any number of threads and in any order of reading.
#![forbid(unsafe_code)]

mod channel;
pub mod engine;
pub mod experiment;
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
pub use plain::{Noise, Scatterer, Simulated};
pub use preset::{Preset, PresetError, Variation};
pub use record_error::RecordError;
pub use recording::Recording;
