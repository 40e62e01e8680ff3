//! CRSD 1.0 (NGA.STND.0080): received signal before pulse compression, with the transmitted pulses and the tracks of
//! both antennas; read, and compressed to phase history.
//!
//! A file is laid out as CPHD is: a text header, XML, and blocks of support arrays, per-pulse parameters (PPP, of the transmitted pulses),
//! per-vector parameters (PVP, of the received signal) and samples. Its first line names one of three kinds: `CRSDsar` has both sides and
//! can be imaged; `CRSDtx` has no echoes and `CRSDrcv` no pulses, and either is refused.
//!
//! # Signal model
//! Phases are in cycles and rise with frequency times time; there is no `SGN`. A pulse is, about its middle at `TxTime`,
//!
//! ```text
//! x(t) = exp(j 2 pi (PhiX0 + FxFreq0 u + FxRate u^2 / 2)),     u = t - TxTime,   |u| <= TXmt / 2
//! ```
//!
//! Sample `i` of a vector was received at `t = RcvStart + i / Fs`, and its phase is relative to that of a reference signal,
//! `RefPhi0 + RefFreq (t - RcvStart)`. An echo that is `tau` late is hence
//!
//! ```text
//! s[i] = AmpSF^-1 exp(j 2 pi (PhiX0 + FxFreq0 u + FxRate u^2 / 2 - RefPhi0 - RefFreq i / Fs)),    u = t - tau - TxTime
//! ```
//!
//! Turned by `RefPhi0 - PhiX0 - FxFreq0 (RcvStart - TxTime) - FxRate TXmt^2 / 8 + (RefFreq - FxFreq0) i / Fs` it is the echo of a
//! [pulse at baseband](crate::receive) about `FxFreq0`, which [`Compressed`](crate::receive::Compressed) filters and refers to
//! the reference point (`ReferenceGeometry/RefPoint`). The band is the intersection of the transmitted (`FX1` to `FX2`) and the received band (`FRCV1` to `FRCV2`).
//!
//! # Motion
//! `TxPos` is of `TxTime` and `RcvPos` of `RcvStart`: the receiver is carried on by `RcvVel` to the moment at which the echo of the reference
//! point arrives. While a pulse lasts both antennas move on, by `TxVel` and `RcvVel`, and each frequency was sent at its own moment:
//! [`Compressed::moving`](crate::receive::Compressed::moving). Neglected is that the echo of another point arrives sooner or later than the
//! reference point's, while the receiver moves: its path is off by the receiver's radial velocity over light's, times the difference of paths
//! (750 m/s and 30 m: 75 um).
//!
//! # Limitations
//! - Waveforms with phase modulation (`TxWFType` `XM`, `LFM w XM`), pulses that differ from one to the next in `FxFreq0`, `FxRate` or `TXmt`, and
//!   samples whose instantaneous band moves (`FICRate`, a receiver that de-chirps): refused, each by name.
//! - Vectors without a pulse of the radar's own (`TxPulseIndex` -1), of noise or of calibration (`SIGNAL` 2 and 3): left out.
//! - Antenna patterns are sampled arrays: they are counted ([`CrsdInfo::num_antenna_patterns`]), and no beam is made of them.
//! - Dwell times, gains (`DGRGC`), the transmitter's response over frequency (`FxResponseArray`) and the atmosphere: as in
//!   [CPHD](super::cphd) not corrected for.
//!
//! # Accuracy
//! Points written by a script of its own formulas, and found consistent by sarkit's `crsdcheck`, are focused to where they stand:
//! `tests/recordings/crsd.rs`.

mod echoes;
mod header;
mod metadata;
mod pulses;
mod read;
mod vectors;

pub use header::Kind;
pub use metadata::{CrsdChannel, CrsdInfo};
pub use read::Crsd;
