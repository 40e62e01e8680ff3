//! A plain radar of chirps at one carrier: Chim 2018, 5.4, at 1.2 GHz and 20.48 MS/s, with a matched filter.
//!
//! ```text
//! plan ──> Plan::waveform ── repeated in a burst ──> Transceiver ── two channels ──┬─> sigmf::Writer
//!                                                                                  └─> Compressor ─ pulse by pulse ─> ChirpProfile
//! ```
//!
//! A chirp of `N` samples and silence up to `P` samples are a period, sent as often as a burst has pulses. Of pulse `p`, with `x_0` the reference, `x_1` the echo and `r` the replica,
//!
//! ```text
//! y_c[l] = sum_i x_c[p P + i + l] conj(r[i]) / sum_i |r[i]|^2          range (l - l_0) c / (2 rate)
//! profile[l] = y_1[l] / a_0
//! ```
//!
//! - [`Replica::Ideal`]: `r` is the chirp as it was computed; `l_0` is where `|y_0|` has its top, between samples too, and `a_0` is `y_0` there.
//! - [`Replica::Reference`]: `r` is what the reference received of the same pulse, with all that amplifiers and filters do to a chirp, and its noise; `l_0` is 0 and `a_0` 1.
//!
//! Both ways the synthesisers' phases, which both channels have alike, cancel, and ranges count from the reference's own way: a scatterer at a delay `tau` behind it reads its amplitude over the reference's
//! times `exp(-j 2 pi f tau)` with `f` the carrier. Resolution is `c / (2 B)`; side lobes are those of no window, -13 dB. C calls the same "stretch processing".
//!
//! Neglected: synthesisers apart by `d` hertz move a peak by `d c / (2 B / T)` and turn the phase over a chirp of `T`: 400 Hz in 50 us is 0.02 turns. Ranges beyond `P` fold. The first echoes of a
//! burst are weaker where they come later than a chirp begins.
//!
//! **Recordings** are written by [`crate::sigmf`], a burst a step: one carrier, `period` the samples from pulse to pulse. Its annotations have no place for bandwidth and duration: who compresses a recording again needs the plan
//! that made it, and `profile` of such a recording means nothing.

mod capture;
mod compress;
mod keys;

use std::f64::consts::PI;
use std::io;
use std::path::Path;

use num_complex::{Complex32, Complex64};
use subaperture_describe::{Description, DescriptionError};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_signal::phase::cis;

use crate::error::RadioError;
use crate::plan::MOST_SAMPLES;
use crate::transceiver::{Configuration, Ranges};

pub use capture::{ChirpSummary, capture};
pub use compress::{ChirpProfile, Compressor, Replica};
pub use keys::reference;

/// What to do.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// A name for records.
    pub name: String,
    /// Carrier, hertz.
    pub carrier_hz: f64,
    /// What a chirp sweeps, hertz, about the carrier.
    pub bandwidth_hz: f64,
    /// How long it takes, seconds.
    pub duration_s: f64,
    /// From pulse to pulse, seconds; a whole number of samples.
    pub interval_s: f64,
    /// Pulses a burst.
    pub pulses: usize,
    /// Bursts.
    pub bursts: u64,
    /// Farthest range, metres.
    pub reach_m: f64,
    /// Amplitude, of full scale.
    pub amplitude: f64,
    /// Between a command and its burst, seconds.
    pub lead_s: f64,
    /// What the radio is set to.
    pub radio: Configuration,
}

impl Plan {
    /// Reads a plan.
    ///
    /// # Errors
    /// If the file cannot be read; then what is wrong with its text.
    pub fn read(path: &Path) -> io::Result<Result<Self, DescriptionError>> {
        Description::read(path).map(|description| Self::describe(&description))
    }

    /// The plan of a description.
    ///
    /// # Errors
    /// Everything that is wrong with it, with its lines.
    pub fn describe(description: &Description) -> Result<Self, DescriptionError> {
        keys::build(description).map_err(|faults| description.explain(faults))
    }

    /// Range resolution, metres.
    pub fn resolution_m(&self) -> f64 {
        SPEED_OF_LIGHT_M_S / (2.0 * self.bandwidth_hz)
    }

    /// From sample to sample of a profile, metres.
    pub fn spacing_m(&self) -> f64 {
        SPEED_OF_LIGHT_M_S / (2.0 * self.radio.sample_rate_hz)
    }

    /// Samples of a chirp.
    pub fn chirp_samples(&self) -> usize {
        (self.duration_s * self.radio.sample_rate_hz).round() as usize
    }

    /// Samples from pulse to pulse.
    pub fn period(&self) -> usize {
        (self.interval_s * self.radio.sample_rate_hz).round() as usize
    }

    /// Values of a profile.
    pub fn lags(&self) -> usize {
        (self.reach_m / self.spacing_m()).ceil() as usize + 1 + compress::LOOP_SAMPLES
    }

    /// Samples of a burst: its pulses, and what the last one's farthest echo needs.
    pub fn samples(&self) -> usize {
        let span = self.chirp_samples() + compress::LOOP_SAMPLES + self.lags();
        let pulses = self.pulses.max(1);
        self.period().saturating_mul(pulses - 1) + self.period().max(span)
    }

    /// A chirp, rising, of unit amplitude: `exp(j pi (B / T) t^2)`, `t` counted from its middle.
    pub fn chirp(&self) -> Vec<Complex64> {
        let (count, rate_hz) = (self.chirp_samples(), self.radio.sample_rate_hz);
        let slope = self.bandwidth_hz / self.duration_s;
        let sample = |i: usize| {
            let t = (i as f64 - 0.5 * (count as f64 - 1.0)) / rate_hz;
            cis(PI * slope * t * t)
        };
        (0..count).map(sample).collect()
    }

    /// What is sent, a period of it.
    pub fn waveform(&self) -> Vec<Complex32> {
        let mut period = vec![Complex32::ZERO; self.period()];
        for (to, z) in period.iter_mut().zip(self.chirp()) {
            let z = z * self.amplitude;
            *to = Complex32::new(z.re as f32, z.im as f32);
        }
        period
    }

    /// Checks the plan by itself and against what a radio can do.
    ///
    /// # Errors
    /// The first thing that does not fit.
    pub fn check(&self, ranges: &Ranges) -> Result<(), RadioError> {
        let say = |what: String| Err(RadioError::Unsupported(what));
        ranges
            .carrier_hz
            .check("the carrier", self.carrier_hz, "Hz")?;
        self.radio.check(ranges)?;
        let most_hz = self.radio.bandwidth_hz.min(self.radio.sample_rate_hz);
        if !(self.bandwidth_hz > 0.0 && self.bandwidth_hz <= most_hz) {
            return say(format!(
                "a chirp of {} Hz, where the analog bandwidth and the sample rate let {most_hz} Hz through: sweep less, or set both wider",
                self.bandwidth_hz
            ));
        }
        let periods = self.interval_s * self.radio.sample_rate_hz;
        let is_whole = (periods - periods.round()).abs() <= 1e-9 * periods;
        if !(is_whole && (8.0..=65536.0).contains(&periods)) {
            return say(format!(
                "{periods} samples from pulse to pulse; a whole number is needed, 8 to 65536: choose another interval or sample rate"
            ));
        }
        if self.chirp_samples() < 8 || self.chirp_samples() > self.period() {
            return say(format!(
                "a chirp of {} samples, every {}: it has 8 or more, and ends before the next begins",
                self.chirp_samples(),
                self.period()
            ));
        }
        let folds_m = self.period() as f64 * self.spacing_m();
        if !(self.reach_m > 0.0 && self.reach_m < folds_m) {
            return say(format!(
                "a reach of {} m, where ranges repeat after {folds_m:.1} m: reach less far, or lengthen the interval",
                self.reach_m
            ));
        }
        if self.samples() > MOST_SAMPLES {
            return say(format!(
                "bursts of {} samples; {MOST_SAMPLES} are the most: send fewer pulses a burst",
                self.samples()
            ));
        }
        Ok(())
    }
}
