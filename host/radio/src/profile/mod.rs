//! Range profiles of recordings of stepped carriers (Chim 2018, (5.4) to (5.12)) and of chirps.
//!
//! ```text
//! step: two channels ─ tone::mix ─> Steps ─ Ranging: loop or leakage reference, calibration ─> Sweep per receiver ─> fill gaps ─ window, inverse FFT ─> profile
//! ```
//!
//! For `N` carriers, where `f_n` is the carrier plus the tone's frequency, and window weights `w_n`,
//!
//! ```text
//! p(r) = sum_n w_n z_n exp(+j 2 pi f_n 2 r / c) / sum_n w_n
//! ```
//!
//! A scatterer with `z_n = exp(-j 2 pi f_n 2 R / c)` gives 1 at `r = R`, as in images. (5.11) has the conjugate, and
//! the tone on the other side of the carrier, because of sign errors in (5.2) and (5.3).
//!
//! Incomplete steps: blocks with lost samples are excluded from a step's mean. A step is skipped if less than half of
//! it was received, if it was late, or if its reference deviates from a steady tone by more than 0.3. Skipped carriers
//! and those in avoided bands are interpolated by [`gaps`] if at most a third is missing; with more there is no
//! profile.
//!
//! Range-Doppler coupling: a target that moves with velocity `v` towards the radar is displaced by `f v T / B`, for a
//! sweep of duration `T` over the bandwidth `B`. If the radar's track is known, [`Sweep::compensated`] compensates the
//! radar's own motion for one direction ([`crate::history::Capture::still`]).
//!
//! The reference is a loopback cable ([`Sweep::read`]) or the leakage from antenna to antenna ([`leakage`]);
//! [`Ranging`] uses the one in the plan.

mod calibration;
mod chirp;
mod error;
mod fits;
pub mod gaps;
pub mod leakage;
mod ranging;
mod receiver;
mod scatterers;
mod sweep;
mod transform;

pub use calibration::Calibration;
pub use chirp::ChirpResponse;
pub use error::{CalibrationError, ProfileError};
pub use ranging::{Options, Ranging};
pub use receiver::{Receiver, Reflector};
pub use scatterers::PointScatterer;
pub use sweep::{Steps, Sweep};
pub use transform::{Peak, Profile};

pub use crate::antennas::Reference;
