//! Pulsed chirp (LFM) radar at one carrier, with a matched filter; Chim 2018, 5.4, at 1.2 GHz and 20.48 MS/s.
//!
//! ```text
//! plan ──> Plan::waveform ── repeated in a burst ──> Transceiver ── two channels ──┬─> sigmf::Writer
//!                                                                                  └─> Compressor ─ per pulse ─> ChirpProfile
//! ```
//!
//! A period is a chirp of `N` samples followed by silence up to `P` samples, and is repeated for each pulse of a burst.
//! For pulse `p`, with `x_0` the reference, `x_1` the echo and `r` the replica,
//!
//! ```text
//! y_c[l] = sum_i x_c[p P + i + l] conj(r[i]) / sum_i |r[i]|^2          range (l - l_0) c / (2 rate)
//! profile[l] = y_1[l] / a_0
//! ```
//!
//! - [`Replica::Ideal`]: `r` is the computed chirp. `l_0` is the interpolated position of the peak of `|y_0|`, and
//!   `a_0` is `y_0` there.
//! - [`Replica::Reference`]: `r` is the reference channel of the same pulse. It contains the distortion of the chirp by
//!   amplifiers and filters, and the reference's noise. `l_0` is 0 and `a_0` is 1.
//!
//! With either replica the synthesisers' phases cancel, since they are common to both channels. Ranges are relative to
//! the delay of the reference path. A scatterer with delay `tau` relative to it appears with its amplitude over the
//! reference's, times `exp(-j 2 pi f tau)` with `f` the carrier. The resolution is `c / (2 B)`. No window is applied:
//! the sidelobes are at -13 dB. C calls the same processing "stretch processing".
//!
//! Neglected: an LO offset of `d` hertz between the synthesisers moves a peak by `d c / (2 B / T)` and turns the phase
//! over a chirp of duration `T`; 400 Hz in 50 us is 0.02 turns. Ranges beyond `P` samples are ambiguous. The first
//! echoes of a burst are weaker where they arrive after the chirp's start.
//!
//! **Recordings** are written by [`crate::sigmf`], one burst per step with a single carrier and `period` the samples of
//! a pulse interval. The annotations do not hold bandwidth and duration: compressing a recording again needs the plan
//! that made it, and `profile` does not apply to such a recording.

mod capture;
mod compress;
mod keys;

use std::f64::consts::PI;

use num_complex::{Complex32, Complex64};
use subaperture_describe::declare::section;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_signal::phase::cis;

use crate::error::RadioError;
use crate::plan::MAX_SAMPLES;
use crate::transceiver::{Configuration, Ranges};

pub use capture::{ChirpSummary, capture};
pub use compress::{ChirpProfile, Compressor, Replica};
pub use keys::reference;

/// Largest delay of the reference after transmission, in samples: cable delay plus internal delay of the radio. The
/// search for the reference covers as many lags.
const LOOP_SAMPLES: usize = 8;

/// Plan of a chirp capture.
#[section]
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Name, written to the metadata of the recording.
    #[skip]
    pub name: String,
    /// Centre frequency of the chirp.
    #[key(default = "1.2 GHz", positive)]
    pub carrier_hz: f64,
    /// Swept bandwidth. Range resolution is c / (2 bandwidth). At most the radio's bandwidth and sample rate.
    #[key(required = "16 MHz", positive)]
    pub bandwidth_hz: f64,
    /// Duration of the chirp.
    #[key(default = "50 us", positive)]
    pub duration_s: f64,
    /// Pulse repetition interval, a whole number of samples. The unambiguous range is c / 2 times the interval.
    #[key(default = "200 us", positive)]
    pub interval_s: f64,
    /// Contiguous pulses per burst.
    #[key(default = 16, whole(1, 1 << 20))]
    pub pulses: usize,
    /// Number of bursts; 0 runs until stopped.
    #[key(default = 1)]
    pub bursts: u64,
    /// Maximum range of a profile.
    #[key(default = "300 m", positive)]
    pub reach_m: f64,
    /// Amplitude of the chirp, relative to the converter's full scale.
    #[key(default = 0.7, within(1e-6, 1.0, "0.000001 to 1"))]
    pub amplitude: f64,
    /// Lead time from a burst's command to its start, for the command to reach the device.
    #[key(default = "1 ms", positive)]
    pub lead_s: f64,
    /// Clock, gains and ports of the radio.
    #[skip]
    pub radio: Configuration,
}

impl Plan {
    /// Range resolution `c / (2 B)`, metres.
    pub fn resolution_m(&self) -> f64 {
        SPEED_OF_LIGHT_M_S / (2.0 * self.bandwidth_hz)
    }

    /// Sample spacing of a range profile, metres.
    pub fn spacing_m(&self) -> f64 {
        SPEED_OF_LIGHT_M_S / (2.0 * self.radio.sample_rate_hz)
    }

    /// Samples of a chirp.
    pub fn chirp_samples(&self) -> usize {
        (self.duration_s * self.radio.sample_rate_hz).round() as usize
    }

    /// Samples of a pulse repetition interval.
    pub fn period(&self) -> usize {
        (self.interval_s * self.radio.sample_rate_hz).round() as usize
    }

    /// Number of values of a range profile.
    pub fn lags(&self) -> usize {
        (self.reach_m / self.spacing_m()).ceil() as usize + 1 + LOOP_SAMPLES
    }

    /// Samples of a burst: its pulses, and the tail for the last pulse's farthest echo.
    pub fn samples(&self) -> usize {
        let span = self.chirp_samples() + LOOP_SAMPLES + self.lags();
        let pulses = self.pulses.max(1);
        self.period().saturating_mul(pulses - 1) + self.period().max(span)
    }

    /// Rising chirp of unit amplitude: `exp(j pi (B / T) t^2)`, with `t` from the middle of the chirp.
    pub fn chirp(&self) -> Vec<Complex64> {
        let (count, rate_hz) = (self.chirp_samples(), self.radio.sample_rate_hz);
        let slope = self.bandwidth_hz / self.duration_s;
        let sample = |i: usize| {
            let t = (i as f64 - 0.5 * (count as f64 - 1.0)) / rate_hz;
            cis(PI * slope * t * t)
        };
        (0..count).map(sample).collect()
    }

    /// Transmitted waveform: one period, scaled by the amplitude.
    pub fn waveform(&self) -> Vec<Complex32> {
        let mut period = vec![Complex32::ZERO; self.period()];
        for (to, z) in period.iter_mut().zip(self.chirp()) {
            let z = z * self.amplitude;
            *to = Complex32::new(z.re as f32, z.im as f32);
        }
        period
    }

    /// Check the plan's consistency, and check it against the limits of a radio.
    ///
    /// # Errors
    /// The first value that does not fit.
    pub fn check(&self, ranges: &Ranges) -> Result<(), RadioError> {
        let say = |what: String| Err(RadioError::Unsupported(what));
        ranges.carrier_hz.check("carrier", self.carrier_hz, "Hz")?;
        self.radio.check(ranges)?;
        let most_hz = self.radio.bandwidth_hz.min(self.radio.sample_rate_hz);
        if !(self.bandwidth_hz > 0.0 && self.bandwidth_hz <= most_hz) {
            return say(format!(
                "chirp bandwidth of {} Hz: expected at most {most_hz} Hz, the smaller of analog bandwidth and sample rate. Sweep less, or raise both",
                self.bandwidth_hz
            ));
        }
        let periods = self.interval_s * self.radio.sample_rate_hz;
        let is_whole = (periods - periods.round()).abs() <= 1e-9 * periods;
        if !(is_whole && (8.0..=65536.0).contains(&periods)) {
            return say(format!(
                "pulse interval of {periods} samples: expected a whole number from 8 to 65536. Choose another interval or sample rate"
            ));
        }
        if self.chirp_samples() < 8 || self.chirp_samples() > self.period() {
            return say(format!(
                "chirp of {} samples, interval of {} samples: expected a chirp of 8 samples or more that is no longer than the interval",
                self.chirp_samples(),
                self.period()
            ));
        }
        let folds_m = self.period() as f64 * self.spacing_m();
        if !(self.reach_m > 0.0 && self.reach_m < folds_m) {
            return say(format!(
                "reach of {} m exceeds the unambiguous range of {folds_m:.1} m: reduce the reach, or lengthen the interval",
                self.reach_m
            ));
        }
        if self.samples() > MAX_SAMPLES {
            return say(format!(
                "burst of {} samples: expected at most {MAX_SAMPLES}. Send fewer pulses per burst",
                self.samples()
            ));
        }
        Ok(())
    }
}
