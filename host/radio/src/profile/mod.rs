//! Range profiles of a recording: Chim 2018 (5.4) to (5.12).
//!
//! ```text
//! step: two channels ─ tone::mix ─> Steps ─ Ranging: by loop or leakage, calibrated ─> Sweep of each receiver ─> gaps filled ─ window, inverse transform ─> profile
//! ```
//!
//! With `N` carriers, `f_n` each with the tone, and weights `w_n`,
//!
//! ```text
//! p(r) = sum_n w_n z_n exp(+j 2 pi f_n 2 r / c) / sum_n w_n
//! ```
//!
//! so that a scatterer of `z_n = exp(-j 2 pi f_n 2 R / c)` reads 1 at `r = R`, as in images. (5.11) has the conjugate, and the tone on the other
//! side of the carrier, by slips of sign in (5.2) and (5.3).
//!
//! Rules for steps that are not whole: blocks of a step with lost samples are left out of its mean; a step of which less than half came, a late
//! one, and one whose reference was unsteady by more than 0.3, is left out. Carriers left out, and those in bands that the plan avoids, are filled by [`gaps`], as long as no more than a third are
//! missing; with more there is no profile.
//!
//! A target that moves with `v` towards the radar is displaced by `f v T / B`, its sweep lasting `T` for the band `B`. Where the radar's track is known,
//! [`Sweep::compensated`] takes that off for one direction ([`crate::history::Capture::still`]).
//!
//! References: a loop ([`Sweep::read`]), or the leakage from antenna to antenna ([`leakage`]); [`Ranging`] does either as the plan says.

mod calibration;
mod error;
mod fits;
pub mod gaps;
pub mod leakage;
mod ranging;
mod sweep;
mod transform;

pub use calibration::{Calibration, Receiver};
pub use error::{CalibrationError, ProfileError};
pub use ranging::{Options, Ranging};
pub use sweep::{Steps, Sweep};
pub use transform::{Peak, Profile};

pub use crate::antennas::Reference;
