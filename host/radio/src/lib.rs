//! Stepped-frequency continuous-wave (SFCW) radar on a software-defined radio, after Chim 2018, chapter 5 (a USRP B210
//! or compatible).
//!
//! Part of [Subaperture](https://docs.rs/subaperture), radar image formation.
//!
//! # Data flow
//!
//! ```text
//! plan (TOML) ──> capture ── tune, burst ──> Transceiver: simulated | replay, wrapped in record and fault
//!                   │  <── two channels of sc16 counts, events ──┘
//!                  │ settle: repeat the burst until the reference tone is steady
//!                  ├─ queue ──> sigmf: .sigmf-data, one annotation per step ──> replay, profile
//!                  └─ queue ──> live: display, sweep by sweep
//! profile: mix (echo times conjugate reference, C 5.10) ─> reference to loop or leakage, calibrate ─> fill gaps ─> window, inverse FFT ─> range profile
//! history: responses of all sweeps ─ track, antennas ─> phase history: one pulse per sweep, one sample per carrier
//! ```
//!
//! At each carrier the radio sends a tone `f_0` above the carrier and receives on two channels at once. With a loopback
//! reference, channel 0 is connected to the transmitter by a coupler and a cable (C Fig. 5.4) and channel 1 to the
//! receiving antenna. With a leakage reference, both channels have antennas and the direct wave from the transmitter is
//! the reference ([`profile::leakage`]). Each retune gives both synthesisers a new random phase, and their frequencies
//! differ by an offset. Both are common to the two channels and cancel in their quotient. Over the carriers, the
//! quotient is the frequency response of the scene, `sum_s a_s exp(-j 2 pi f tau_s)`, where `f` is the carrier plus the
//! tone's frequency.
//!
//! # Units, signs, invariants
//! - Frequencies are in hertz. Times are seconds of the device clock, float64: after a day the resolution is a
//!   thousandth of a sample at 30.72 MS/s.
//! - Samples on the wire and on disk are 16-bit counts, full scale 32768 ([`Sample`]). 12-bit converters fill the upper
//!   bits.
//! - A delay `tau` has the phase `-2 pi f tau` at frequency `f`, as in the other crates. C (5.10) uses the conjugate.
//! - Lost samples are zeros in the buffers and listed in [`Received::lost`]. They are never removed: sample `i` of a
//!   burst is always `i / rate` after the first.
//! - A request that a backend cannot fulfil is an error that says what to change. Transport faults ([`Event`]) are
//!   counted and flagged; the capture goes on unless the device is gone.
//! - Memory: the queues' buffers, each of one step. Memory does not grow with the length of a capture.
//!
//! A vector network analyser is no such radio: [`vna`] captures its sweeps into Touchstone files.
//!
//! Each backend implements [`Transceiver`]: [`simulated`], [`replay`] and, with the feature `uhd`, a USRP by Ettus
//! Research's driver UHD. UHD is licensed under GPL-3.0-or-later or a commercial licence: programs linked with it are
//! distributed under these terms. Without the feature, UHD is not needed.
#![deny(unsafe_code)]

mod antennas;
pub mod capture;
pub mod chirp;
mod error;
pub mod experiment;
pub mod fault;
pub mod history;
pub mod live;
pub mod plan;
pub mod profile;
pub mod record;
pub mod replay;
pub mod selftest;
pub mod sigmf;
pub mod simulated;
pub mod tone;
mod transceiver;
#[cfg(feature = "uhd")]
pub mod uhd;
pub mod vna;

pub use antennas::{Antennas, Reference};
#[cfg(not(feature = "uhd"))]
pub use error::NO_UHD;
pub use error::RadioError;
pub use transceiver::{
    About, Burst, Configuration, Event, EventKind, Range, Ranges, Received, Sample, Sensors, Side,
    Source, Transceiver,
};

/// Driver of a radio that this library computes.
const OWN_DRIVER: &str = concat!("subaperture ", env!("CARGO_PKG_VERSION"));

/// Beginning of the serial number of every simulated radio.
const SIMULATED_SERIAL: &str = "SIM";
