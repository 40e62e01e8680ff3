//! Range profiles of a recording: Chim 2018 (5.4) to (5.12).
//!
//! ```text
//! step: two channels ─ tone::mix ─> z_n, echo over reference at f_n ─ calibration ─> gaps filled ─ window, inverse transform ─> profile
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
//! one, and one whose reference was unsteady by more than 0.3, is left out. Carriers left out are filled by [`gaps`], as long as no more than a third are
//! missing; with more there is no profile.
//!
//! A target that moves with `v` towards the radar is displaced by `f v T / B`, its sweep lasting `T` for the band `B`: not compensated
//! here, for a profile knows no track.

mod calibration;
pub mod gaps;
mod transform;

pub use calibration::{Calibration, CalibrationError};
pub use transform::{Peak, Profile};

use num_complex::Complex64;
use subaperture_signal::window::Window;

use crate::sigmf::{Recording, Setup, SigmfError};
use crate::tone::Tone;
use crate::transceiver::Sample;

/// A reference that is off its tone by more, as [`crate::tone`] measures it, is no reference.
const USELESS: f64 = 0.3;

/// What the echo is referred to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Reference {
    /// The loop from the transmitter to receiver 0.
    #[default]
    Loopback,
    /// Nothing but the tone as it was sent: the synthesisers' phases stay in the echo, and there is no profile. To show that.
    None,
}

/// The scene's response over the carriers of a sweep.
#[derive(Clone, Debug, PartialEq)]
pub struct Sweep {
    /// Frequency of value 0, hertz: carrier and tone.
    pub start_hz: f64,
    /// From value to value, hertz.
    pub step_hz: f64,
    /// Echo over reference; `None` where a step was left out.
    pub values: Vec<Option<Complex64>>,
    /// Device times of the steps, seconds; 0 where there is none.
    pub times_s: Vec<f64>,
}

/// Why there is no profile.
#[derive(Debug, thiserror::Error)]
pub enum ProfileError {
    /// The recording cannot be read.
    #[error(transparent)]
    Recording(#[from] SigmfError),
    /// It has no such sweep.
    #[error("the recording has no sweep {0}")]
    NoSweep(u64),
    /// Too little is left of a sweep.
    #[error(
        "{left} of {steps} steps are usable, and a profile needs two of three: {}",
        "record again, or look at another sweep"
    )]
    TooFew {
        /// Steps left.
        left: usize,
        /// Steps of a sweep.
        steps: usize,
    },
    /// What was asked for makes no sense.
    #[error("{0}")]
    Options(String),
    /// The calibration is of something else.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
}

impl Sweep {
    /// Mixes every step of a sweep of a recording; the best of several bursts of a carrier.
    ///
    /// # Errors
    /// If there is no such sweep, or it cannot be read.
    pub fn read(
        recording: &mut Recording,
        sweep: u64,
        reference: Reference,
    ) -> Result<Self, ProfileError> {
        let setup = recording.setup().clone();
        let indices: Vec<usize> = (0..recording.steps().len())
            .filter(|&i| recording.steps()[i].sweep == sweep)
            .collect();
        if indices.is_empty() {
            return Err(ProfileError::NoSweep(sweep));
        }
        let tone = Tone::new(setup.period);
        let mut mixed = Self::empty(&setup);
        let mut unsteady = vec![f64::INFINITY; setup.steps];
        let mut channels: [Vec<Sample>; 2] = Default::default();
        for index in indices {
            recording.read(index, &mut channels)?;
            let step = &recording.steps()[index];
            let lost: Vec<_> = step.lost.iter().map(|&(from, to)| from..to).collect();
            let Some(burst) = tone.mix([&channels[0], &channels[1]], &lost) else {
                continue;
            };
            if burst.whole < 0.5
                || burst.unsteady > USELESS
                || burst.unsteady >= unsteady[step.step]
            {
                continue;
            }
            unsteady[step.step] = burst.unsteady;
            mixed.times_s[step.step] = step.time_s;
            mixed.values[step.step] = Some(match reference {
                Reference::Loopback => burst.value,
                Reference::None => burst.unreferred,
            });
        }
        Ok(mixed)
    }

    fn empty(setup: &Setup) -> Self {
        Self {
            start_hz: setup.start_hz + setup.sample_rate_hz / setup.period as f64,
            step_hz: setup.step_hz,
            values: vec![None; setup.steps],
            times_s: vec![0.0; setup.steps],
        }
    }

    /// Carriers that are there.
    pub fn usable(&self) -> usize {
        self.values.iter().flatten().count()
    }

    /// Frequency of value `n`, hertz.
    pub fn frequency_hz(&self, n: usize) -> f64 {
        self.start_hz + n as f64 * self.step_hz
    }

    /// The response with all carriers, those left out filled as [`gaps`] says for echoes up to `reach_m`.
    ///
    /// # Errors
    /// If more than a third is missing; if `reach_m` is not between 0 and the unambiguous range.
    pub fn filled(&self, reach_m: f64) -> Result<Vec<Complex64>, ProfileError> {
        let (left, steps) = (self.usable(), self.values.len());
        if 3 * left < 2 * steps {
            return Err(ProfileError::TooFew { left, steps });
        }
        gaps::fill(&self.values, self.step_hz, reach_m).map_err(ProfileError::Options)
    }

    /// The range profile, at some `fineness` places a resolution cell, of echoes up to `reach_m`.
    ///
    /// # Errors
    /// As [`Self::filled`].
    pub fn profile(
        &self,
        window: Window,
        fineness: usize,
        reach_m: f64,
    ) -> Result<Profile, ProfileError> {
        let values = self.filled(reach_m)?;
        Ok(Profile::new(
            &values,
            self.start_hz,
            self.step_hz,
            window,
            fineness,
        ))
    }
}
