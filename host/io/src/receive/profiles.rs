//! Conversion of range profiles into phase history, for impulse radars and radars that deliver compressed profiles.
//!
//! Bin `i` of a profile is the echo at the range `r_i = r_0 + i dr`, or at the time `t_i = 2 r_i / c`. With `f_c` the
//! frequency to which 0 Hz of the profile corresponds, the spectrum over bins is that of the pulse, `P`, phase-rotated:
//!
//! ```text
//! X[m] = sum_i x[i] exp(-j 2 pi m i / N) = P(f_m) exp(-j 2 pi f_c tau) exp(-j 2 pi f_m (tau - t_0)),   f_m = m c / (2 dr N)
//! z[m] = g X[m] exp(+j 2 pi ((f_c + f_m) reference_path / c - f_m t_0)) = g P(f_m) exp(-j 2 pi (f_c + f_m)(tau - tau_ref))
//! ```
//!
//! A real-valued waveform has `f_c = 0`; only the positive frequencies of its spectrum are kept, which is the analytic
//! signal without a Hilbert transform. The band excludes frequencies outside the pulse: noise, and the converter's
//! offset. With `K` of `N` frequencies kept, `g` is `K / N` for complex profiles and `2 K / N` for real ones, so that
//! an echo whose envelope within the band has a peak of `A` has amplitude `A` in an image without windows.
//!
//! The pulse's own phase remains in `P`: it broadens the range response equally for all echoes, and shifts them by its
//! group delay, which is part of the range bias. Echoes beyond the ends of the profile wrap around, as in any circular
//! transform: the unambiguous range is `N dr`.
//!
//! Cost: one float64 FFT per pulse. Memory: the profiles as read.

use std::ops::Range;
use std::sync::Arc;

use num_complex::{Complex32, Complex64};
use rayon::prelude::*;
use subaperture_fft::{Fft, Transforms};

use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::phase_history::{Collection, PhaseHistory, ReadError, check_finite};
use subaperture_signal::phase::{narrow, phasor, widen};

/// Range axis of profiles, and their frequency reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProfileAxis {
    /// Range of bin 0, metres.
    pub first_range_m: f64,
    /// Bin spacing in range, metres; positive.
    pub range_step_m: f64,
    /// Number of bins.
    pub num_bins: usize,
    /// Frequency to which 0 Hz of complex profiles corresponds, hertz; `None` for a real-valued waveform.
    pub centre_hz: Option<f64>,
}

/// Profiles that cannot be converted into phase history.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{0}")]
pub struct ProfileError(String);

/// Phase history of range profiles.
#[derive(Clone)]
pub struct Profiles {
    collection: Collection,
    axis: ProfileAxis,
    profiles: Vec<Complex32>,
    /// First frequency kept, in steps above [`ProfileAxis::centre_hz`] or 0.
    first_step: i64,
    fft: Arc<dyn Fft<f64>>,
}

impl Profiles {
    /// Convert pulse-major `profiles`, limited to the band from `band_hz.0` to `band_hz.1`. The frequencies of
    /// `collection` and of its pulses are set here.
    ///
    /// # Errors
    /// [`ProfileError`] for lengths that disagree, a sample that is not finite, or a band that the profiles do not
    /// contain.
    pub fn new(
        mut collection: Collection,
        axis: ProfileAxis,
        band_hz: (f64, f64),
        profiles: Vec<Complex32>,
    ) -> Result<Self, ProfileError> {
        let fault = |what: String| Err(ProfileError(what));
        let (count, bins) = (collection.pulses.len(), axis.num_bins);
        if bins == 0 || count == 0 || profiles.len() != count * bins {
            return fault(format!(
                "{count} profiles of {bins} bins: expected as many values and at least one, got {}",
                profiles.len()
            ));
        }
        if !(axis.range_step_m > 0.0 && axis.range_step_m.is_finite()) {
            return fault(format!(
                "bin spacing of {} m: expected a positive number",
                axis.range_step_m
            ));
        }
        let step_hz = SPEED_OF_LIGHT_M_S / (2.0 * axis.range_step_m * bins as f64);
        let centre_hz = axis.centre_hz.unwrap_or(0.0);
        let steps = |hz: f64| (hz - centre_hz) / step_hz;
        let (first_step, last_step) = (steps(band_hz.0).ceil(), steps(band_hz.1).floor());
        let half = bins as f64 / 2.0;
        let least = if axis.centre_hz.is_some() { -half } else { 0.0 };
        if !(first_step > least && last_step < half && band_hz.0 > 0.0) {
            return fault(format!(
                "bins of {:.6} m contain frequencies above {:.6} GHz and below {:.6} GHz, but the band is \
                                {:.6} to {:.6} GHz",
                axis.range_step_m,
                (centre_hz + least * step_hz).max(0.0) / 1e9,
                (centre_hz + half * step_hz) / 1e9,
                band_hz.0 / 1e9,
                band_hz.1 / 1e9
            ));
        }
        if last_step < first_step + 1.0 {
            return fault(format!(
                "frequency spacing of {:.6} MHz: the band contains fewer than two frequencies. Widen it",
                step_hz / 1e6
            ));
        }
        check_finite(&collection.name, 0, bins, &profiles)
            .map_err(|error| ProfileError(error.to_string()))?;
        collection.num_samples = (last_step - first_step) as usize + 1;
        for pulse in &mut collection.pulses {
            pulse.start_hz = centre_hz + first_step * step_hz;
            pulse.step_hz = step_hz;
            let last_m = axis.first_range_m + bins as f64 * axis.range_step_m;
            pulse.recorded_path_m = Some([2.0 * axis.first_range_m, 2.0 * last_m]);
        }
        Ok(Self {
            collection,
            axis,
            profiles,
            first_step: first_step as i64,
            fft: Transforms::Portable.forward(bins),
        })
    }
}

impl PhaseHistory for Profiles {
    fn collection(&self) -> &Collection {
        &self.collection
    }

    fn read(&self, pulses: Range<usize>, samples: &mut [Complex32]) -> Result<(), ReadError> {
        let (bins, width) = (self.axis.num_bins, self.collection.num_samples);
        assert_eq!(
            samples.len(),
            pulses.len() * width,
            "samples must hold {pulses:?} whole"
        );
        let sides = if self.axis.centre_hz.is_some() {
            1.0
        } else {
            2.0
        };
        let gain = sides * width as f64 / bins as f64;
        let start_s = 2.0 * self.axis.first_range_m / SPEED_OF_LIGHT_M_S;
        let scratch = self.fft.get_inplace_scratch_len();
        samples
            .par_chunks_exact_mut(width)
            .zip(pulses)
            .for_each_init(
                || (vec![Complex64::ZERO; bins], vec![Complex64::ZERO; scratch]),
                |(work, scratch), (row, n)| {
                    let profile = &self.profiles[n * bins..(n + 1) * bins];
                    for (z, &x) in work.iter_mut().zip(profile) {
                        *z = widen(x);
                    }
                    self.fft.process_with_scratch(work, scratch);
                    let pulse = &self.collection.pulses[n];
                    let reference_s = pulse.reference_path_m / SPEED_OF_LIGHT_M_S;
                    for (k, z) in row.iter_mut().enumerate() {
                        let step = self.first_step + k as i64;
                        let above_hz = step as f64 * pulse.step_hz;
                        let turns = pulse.frequency_hz(k) * reference_s - above_hz * start_s;
                        let bin = step.rem_euclid(bins as i64) as usize;
                        *z = narrow(work[bin] * phasor(turns) * gain);
                    }
                },
            );
        Ok(())
    }

    fn held_bytes(&self) -> u64 {
        let pulses = size_of_val(self.collection.pulses.as_slice());
        (pulses + size_of_val(self.profiles.as_slice())) as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use std::f64::consts::TAU;
    use subaperture_model::geometry::SceneFrame;
    use subaperture_model::phase_history::{Pulse, Sweep};

    const BINS: usize = 512;
    const STEP_M: f64 = 0.01;

    fn collection(reference_path_m: f64) -> Collection {
        Collection {
            name: "test".to_owned(),
            num_samples: 0,
            pulses: vec![Pulse {
                time_s: 0.0,
                transmitter_m: DVec3::ZERO,
                receiver_m: DVec3::ZERO,
                reference_m: DVec3::ZERO,
                reference_path_m,
                start_hz: 0.0,
                step_hz: 0.0,
                sweep: Sweep::AT_ONCE,
                recorded_path_m: None,
            }],
            frame: SceneFrame::Local,
            extent: None,
            timed: true,
        }
    }

    fn axis(centre_hz: Option<f64>) -> ProfileAxis {
        ProfileAxis {
            first_range_m: 2.0,
            range_step_m: STEP_M,
            num_bins: BINS,
            centre_hz,
        }
    }

    /// Gaussian pulse with a standard deviation of 0.8 GHz at 4 GHz and a range of 4.2345 m: real-valued, or at
    /// baseband.
    fn pulse(complex: bool) -> Vec<Complex32> {
        let (sigma_hz, carrier_hz) = (0.8e9, 4e9);
        (0..BINS)
            .map(|i| {
                let late_s = 2.0 * (2.0 + i as f64 * STEP_M - 4.2345) / SPEED_OF_LIGHT_M_S;
                let envelope = (-0.5 * (TAU * sigma_hz * late_s).powi(2)).exp();
                if complex {
                    let tau = 2.0 * 4.2345 / SPEED_OF_LIGHT_M_S;
                    narrow(phasor(-carrier_hz * tau) * envelope)
                } else {
                    let wave = (TAU * carrier_hz * late_s).cos();
                    Complex32::new((envelope * wave) as f32, 0.0)
                }
            })
            .collect()
    }

    #[test]
    fn profile_echo_has_defined_phase_at_every_frequency() {
        for complex in [false, true] {
            let centre = complex.then_some(4e9);
            let made = Profiles::new(collection(8.0), axis(centre), (3e9, 5e9), pulse(complex));
            let made = made.unwrap();
            let width = made.collection().num_samples;
            let mut row = vec![Complex32::ZERO; width];
            made.read(0..1, &mut row).unwrap();
            let at = made.collection().pulses[0];
            for (k, &z) in row.iter().enumerate() {
                let expected =
                    phasor(-at.frequency_hz(k) * (2.0 * 4.2345 - 8.0) / SPEED_OF_LIGHT_M_S);
                let turned = widen(z) * expected.conj();
                // float32 rounding of 512 values, against a spectrum of about 10 at its edges; the tail of the negative
                // frequencies is exp(-(7 / 0.8)^2 / 2).
                assert!(turned.arg().abs() < 1e-4, "{complex} {k}: {}", turned.arg());
            }
            // The image value at the echo is the mean; limited to +-1.25 sigma, the envelope keeps erf(1.25 / sqrt 2) =
            // 0.7887 of its peak.
            let mean = row.iter().zip(0..).fold(Complex64::ZERO, |sum, (&z, k)| {
                let turns = at.frequency_hz(k) * (2.0 * 4.2345 - 8.0) / SPEED_OF_LIGHT_M_S;
                sum + widen(z) * phasor(turns)
            }) / width as f64;
            // Sum over steps against the integral: half a step at an end, 1 % of the sum.
            assert!((mean.norm() - 0.7887).abs() < 0.01, "{}", mean.norm());
        }
    }

    #[test]
    fn bands_outside_profile_spectrum_are_refused() {
        let refuse =
            |centre, band| match Profiles::new(collection(8.0), axis(centre), band, pulse(false)) {
                Ok(_) => panic!("accepted"),
                Err(error) => error.to_string(),
            };
        // 512 bins of 1 cm: steps of 29.28 MHz up to 7.49 GHz.
        assert!(refuse(None, (3e9, 8e9)).contains("below 7.49"));
        assert!(refuse(None, (3e9, 3.02e9)).contains("29.2"));
        assert!(refuse(Some(20e9), (3e9, 5e9)).contains("above 12.5"));
        let mut bad = pulse(false);
        bad[7].re = f32::NAN;
        assert!(Profiles::new(collection(8.0), axis(None), (3e9, 5e9), bad).is_err());
    }
}
