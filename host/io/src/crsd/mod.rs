//! CRSD 1.0 (NGA.STND.0080), read only: received signal before pulse compression, with the transmitted pulses and the
//! tracks of both antennas. Reading compresses it to phase history.
//!
//! The file layout is that of CPHD: a text header, XML, and blocks of support arrays, per-pulse parameters (PPP, of
//! the transmitted pulses), per-vector parameters (PVP, of the received signal) and samples. The first line states
//! one of three kinds: `CRSDsar` contains pulses and echoes; `CRSDtx` has no echoes and `CRSDrcv` no pulses, so both
//! are refused.
//!
//! # Signal model
//! Phases are in cycles and increase with frequency times time; there is no `SGN`. A pulse is, about its middle at
//! `TxTime`,
//!
//! ```text
//! x(t) = exp(j 2 pi (PhiX0 + FxFreq0 u + FxRate u^2 / 2)),     u = t - TxTime,   |u| <= TXmt / 2
//! ```
//!
//! Sample `i` of a vector was received at `t = RcvStart + i / Fs`, and its phase is relative to that of a reference
//! signal, `RefPhi0 + RefFreq (t - RcvStart)`. An echo with the delay `tau` is therefore
//!
//! ```text
//! s[i] = AmpSF^-1 exp(j 2 pi (PhiX0 + FxFreq0 u + FxRate u^2 / 2 - RefPhi0 - RefFreq i / Fs)),    u = t - tau - TxTime
//! ```
//!
//! Phase-rotated by `RefPhi0 - PhiX0 - FxFreq0 (RcvStart - TxTime) - FxRate TXmt^2 / 8 + (RefFreq - FxFreq0) i / Fs`
//! it is the echo of a [pulse at baseband](crate::receive) about `FxFreq0`, which
//! [`Compressed`](crate::receive::Compressed) filters and references to the reference point
//! (`ReferenceGeometry/RefPoint`). The band is the intersection of the transmitted (`FX1` to `FX2`) and the received
//! band (`FRCV1` to `FRCV2`).
//!
//! # Motion
//! `TxPos` is valid at `TxTime` and `RcvPos` at `RcvStart`. The receiver position is extrapolated by `RcvVel` to the
//! arrival of the reference point's echo. During a pulse both antennas move by `TxVel` and `RcvVel`, and each
//! frequency has its own transmission time: [`Compressed::moving`](crate::receive::Compressed::moving). Neglected:
//! the echo of another point arrives earlier or later than the reference point's, while the receiver moves. Its path
//! error is the receiver's radial velocity over the speed of light, times the path difference (750 m/s and 30 m: 75
//! um).
//!
//! # Limitations
//! - Refused, with an error that names the property: waveforms with phase modulation (`TxWFType` `XM`, `LFM w XM`),
//!   pulses that differ in `FxFreq0`, `FxRate` or `TXmt`, and samples whose instantaneous band moves (`FICRate`, a
//!   deramping receiver).
//! - Left out: vectors without a transmitted pulse (`TxPulseIndex` -1), and vectors of noise or calibration (`SIGNAL`
//!   2 and 3).
//! - Antenna patterns are sampled arrays: they are counted ([`CrsdInfo::num_antenna_patterns`]) but give no beam.
//! - Not corrected, as in [CPHD](super::cphd): dwell times, gains (`DGRGC`), the transmitter's frequency response
//!   (`FxResponseArray`) and the atmosphere.
//!
//! # Accuracy
//! Points simulated by an independent script, whose files pass sarkit's `crsdcheck`, are focused at their positions:
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
