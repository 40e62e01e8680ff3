//! Pulsed chirp (LFM) radar at one carrier; Chim 2018, 5.4, at 1.2 GHz and 20.48 MS/s.
//!
//! ```text
//! plan ──> Plan::waveform ── repeated in a burst ──> Transceiver ── two channels ──┬─> sigmf::Writer
//!                                                                                  └─> ChirpResponse ─ per burst ─> Sweep
//! ```
//!
//! A period is a chirp of `N` samples followed by silence up to `P` samples, and is repeated for each pulse of a burst.
//! Channel 0 is the reference, a loop from the transmitter; channel 1 is the echo. The spectrum of the echo is divided by
//! that of the reference ([`crate::profile::ChirpResponse`]), which cancels the chirp with its distortion and the phases
//! of the synthesisers. Ranges are relative to the delay of the reference path. C multiplies by the conjugate of a copy
//! of the transmitted chirp instead, which leaves its distortion in the profile, and calls it "stretch processing".
//!
//! The resolution is `c / (2 B)` over 0.8 of the bandwidth.
//!
//! **Recordings** are written by [`crate::sigmf`], one burst per step with a single carrier, `period` the samples of a
//! pulse interval and `step_hz` the bandwidth. [`crate::profile`] divides the spectrum of the echo by that of the
//! reference, burst by burst; from there on, a burst is a sweep like that of stepped carriers.
//! [`crate::experiment::ChirpExperiment`] is a plan with its radio, as a file.

mod capture;

use std::f64::consts::PI;

use num_complex::{Complex32, Complex64};
use subaperture_describe::declare::section;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_signal::phase::cis;

use crate::error::RadioError;
use crate::plan::MAX_SAMPLES;
use crate::transceiver::{Configuration, Ranges};

pub use capture::{ChirpSummary, Ready, capture, capture_ready, prepare};

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
    /// Contiguous pulses per burst. The first is not used, because echoes of a pulse before it are missing.
    #[key(default = 16, whole(2, 1 << 20))]
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

    /// Samples of a burst.
    pub fn samples(&self) -> usize {
        self.period().saturating_mul(self.pulses)
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
