//! A stepped-carrier radar on a software-defined radio, after Chim 2018, chapter 5: a USRP B210 or what behaves like one.
//!
//! A part of [Subaperture](https://docs.rs/subaperture), radar image formation.
//!
//! # The way of the data
//!
//! ```text
//! plan (TOML) ──> capture ── tune, burst ──> Transceiver: simulated | replay, in record and fault
//!                   │  <── two channels of sc16 counts, events ──┘
//!                   │ settle: the reference tone's own steadiness
//!                   ├─ queue ──> sigmf: .sigmf-data, an annotation a step ──> replay, profile
//!                   └─ queue ──> live: sweep by sweep, for those who look
//! profile: mix (receive with reference, C 5.10) ─> refer to loop or leakage, calibrate ─> fill gaps ─> window, inverse transform ─> range profile
//! history: responses of all sweeps ─ track, antennas ─> phase history: a sweep is a pulse, its carriers are the samples
//! ```
//!
//! At each carrier a tone `f_0` above it is sent and received by two channels at once: the reference (channel 0: the
//! transmitter by a coupler and a cable, C Fig. 5.4) and the echo (channel 1: the antenna); or two antennas, whose reference is the transmitter heard directly
//! ([`profile::leakage`]). Both synthesisers have phases of
//! their own after each retune, and differ in frequency; both channels see the same of it, and the quotient of the two
//! does not. Over carriers it is the scene's response, `sum_s a_s exp(-j 2 pi f tau_s)`, with `f` the carrier and the tone.
//!
//! # Units, signs, invariants
//! - Frequencies in hertz, times in seconds of the device's own clock, float64: a part in a thousand of a sample at 30.72 MS/s for a day.
//! - Samples on the wire and on disk are counts of 16 bits, in full scale 32768 ([`Sample`]); converters of 12 bits fill the upper ones.
//! - Of a delay `tau`, the phase at frequency `f` is `-2 pi f tau`, as everywhere here. C (5.10) has the conjugate.
//! - Samples that did not come are zeros in the buffers and are told ([`Received::lost`]), never closed up: sample `i` of a burst is
//!   always `i / rate` after its first.
//! - What a backend cannot do is an error with what would help; what goes wrong on the way ([`Event`]) is counted and marked, and
//!   ends nothing but what it must.
//! - Memory: buffers of the queues, each of one step; nothing grows with a capture's length.
//!
//! Backends are an implementation of [`Transceiver`] each: [`simulated`], [`replay`], and, with the feature `uhd`, a USRP by Ettus Research's
//! driver UHD. That is under GPL-3.0-or-later or a commercial licence: a program linked with it is passed on under these
//! terms; without the feature nothing of it is needed.
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
pub mod sigmf;
pub mod simulated;
pub mod tone;
mod transceiver;
#[cfg(feature = "uhd")]
pub mod uhd;

pub use antennas::{Antennas, Reference};
#[cfg(not(feature = "uhd"))]
pub use error::NO_UHD;
pub use error::RadioError;
pub use transceiver::{
    About, Burst, Configuration, Event, EventKind, Range, Ranges, Received, Sample, Sensors, Side,
    Source, Transceiver,
};
