//! Ambiguity function of a pulse or a pulse burst, from its samples.
//!
//! ```text
//! chi(tau, f) = sum_t s(t) s*(t - tau) exp(+j 2 pi f t) / sum_t |s(t)|^2
//! ```
//!
//! (Chim 2018, 2.1.2, normalised by the energy): the matched filter output at delay `tau` for an echo with
//! Doppler shift `f`. For a linear FM pulse of bandwidth `B` and duration `T`, rate `k = B / T`,
//!
//! ```text
//! |chi| = (1 - |tau| / T) |sinc((T - |tau|) (f + k tau))|
//! ```
//!
//! which is (2.10) normalised by the energy (its `k` is twice the `alpha` of (2.3)): a ridge along `f = -k tau`,
//! so that a Doppler shift `f` is measured as a delay error `-f / k` (range-Doppler coupling). The volume under `|chi|^2` is the same for all
//! pulses.
//!
//! Delays are whole samples, `-(N - 1)` to `N - 1`; Doppler shifts are arbitrary. **Cost** one FFT of about `2 N`
//! per Doppler shift. **Memory** the result. **Error** float64 rounding.
//!
//! Neglected: Doppler scaling of the pulse (`2 v / c`), and chip lengths that are not whole numbers of
//! samples, which are rounded.

use std::f64::consts::{PI, TAU};

use num_complex::Complex64;
use rayon::prelude::*;
use subaperture_fft as fft;

use subaperture_model::geometry::Axis;
use subaperture_model::quantity::{hertz, seconds};
use subaperture_model::radar::PulseShape;
use subaperture_signal::fast_length::fast_length;

/// Sampled waveform at baseband.
#[derive(Clone, Debug, PartialEq)]
pub struct Sampled {
    /// Complex samples.
    pub samples: Vec<Complex64>,
    /// Sampling rate, hertz.
    pub rate_hz: f64,
}

impl Sampled {
    /// Pulse sampled at `rate_hz`, at the centre of each sampling interval; a recorded pulse at its own rate.
    pub fn pulse(shape: &PulseShape, rate_hz: f64) -> Self {
        let samples = match shape {
            PulseShape::Lfm {
                bandwidth_hz,
                duration_s,
                rising,
            } => {
                let count = (duration_s * rate_hz).round().max(1.0) as usize;
                let chirp_hz_s = bandwidth_hz / duration_s * if *rising { 1.0 } else { -1.0 };
                let time_s = |i: usize| (i as f64 - (count as f64 - 1.0) / 2.0) / rate_hz;
                (0..count)
                    .map(|i| Complex64::cis(PI * chirp_hz_s * time_s(i).powi(2)))
                    .collect()
            }
            PulseShape::PhaseCode { phases_rad, chip_s } => {
                let chip = (chip_s * rate_hz).round().max(1.0) as usize;
                phases_rad
                    .iter()
                    .flat_map(|&phase| std::iter::repeat_n(Complex64::cis(phase), chip))
                    .collect()
            }
            PulseShape::Recorded {
                samples, rate_hz, ..
            } => {
                return Self {
                    samples: samples.clone(),
                    rate_hz: *rate_hz,
                };
            }
        };
        Self { samples, rate_hz }
    }

    /// Burst of `count` of this pulse with the interval `pri_s`, seconds; intervals shorter than the pulse are extended to its length.
    pub fn burst(&self, count: usize, pri_s: f64) -> Self {
        let period = ((pri_s * self.rate_hz).round() as usize).max(self.samples.len());
        let mut samples = vec![Complex64::ZERO; period * count.saturating_sub(1)];
        for start in (0..samples.len()).step_by(period) {
            samples[start..start + self.samples.len()].copy_from_slice(&self.samples);
        }
        if count > 0 {
            samples.extend(&self.samples);
        }
        Self {
            samples,
            rate_hz: self.rate_hz,
        }
    }
}

/// Ambiguity function magnitude `|chi|` over Doppler shift and delay.
#[derive(Clone, Debug, PartialEq)]
pub struct Ambiguity {
    /// Doppler shifts, hertz.
    pub dopplers_hz: Vec<f64>,
    /// Largest delay, samples.
    pub reach: usize,
    /// Sampling rate, hertz.
    pub rate_hz: f64,
    /// Magnitudes per Doppler shift, `2 reach + 1` delays each, ascending.
    pub magnitudes: Vec<f64>,
}

impl Ambiguity {
    /// Compute for `waveform` at `dopplers_hz`. Empty for an empty waveform.
    pub fn new(waveform: &Sampled, dopplers_hz: &[f64]) -> Self {
        let count = waveform.samples.len();
        let reach = count.saturating_sub(1);
        let length = fast_length(2 * count.max(1));
        let (forward, inverse) = (fft::forward(length), fft::inverse(length));
        let energy: f64 = waveform.samples.iter().map(Complex64::norm_sqr).sum();
        let mut spectrum = vec![Complex64::ZERO; length];
        spectrum[..count].copy_from_slice(&waveform.samples);
        forward.process(&mut spectrum);
        let norm = 1.0 / (energy * length as f64);
        let cut = |&doppler_hz: &f64| {
            let mut row = vec![Complex64::ZERO; length];
            let turn = TAU * doppler_hz / waveform.rate_hz;
            for ((t, z), s) in (0u32..).zip(&mut row).zip(&waveform.samples) {
                *z = s * Complex64::cis(turn * f64::from(t));
            }
            forward.process(&mut row);
            for (z, s) in row.iter_mut().zip(&spectrum) {
                *z *= s.conj() * norm;
            }
            inverse.process(&mut row);
            let delays = (length - reach..length).chain(0..=reach);
            let magnitudes = delays.map(|i| row[i % length].norm());
            magnitudes.collect::<Vec<_>>()
        };
        let magnitudes = if count == 0 {
            Vec::new()
        } else {
            dopplers_hz.par_iter().flat_map_iter(cut).collect()
        };
        Self {
            dopplers_hz: dopplers_hz.to_vec(),
            reach,
            rate_hz: waveform.rate_hz,
            magnitudes,
        }
    }

    /// Magnitudes over delay at one Doppler shift.
    ///
    /// # Panics
    /// If `doppler` is out of range.
    pub fn cut(&self, doppler: usize) -> &[f64] {
        let width = 2 * self.reach + 1;
        &self.magnitudes[doppler * width..(doppler + 1) * width]
    }

    /// Delay of sample `index` of a cut, seconds.
    pub fn delay_s(&self, index: usize) -> f64 {
        (index as f64 - self.reach as f64) / self.rate_hz
    }
}

/// Ambiguity function around its peak, for a plot.
#[derive(Clone, Debug, PartialEq)]
pub struct Around {
    /// `|chi|^2` per Doppler shift, dB.
    pub levels_db: Vec<f32>,
    /// Doppler shifts, hertz.
    pub dopplers_hz: Axis,
    /// Delays, seconds.
    pub delays_s: Axis,
}

/// Half-size of the plot, resolution cells (`1 / B` in delay, `1 / T` in Doppler): all delays of
/// a Barker-13 code.
const CELLS: usize = 13;
/// Samples per resolution cell.
const FINENESS: usize = 8;
/// Largest time-bandwidth product; more would take minutes.
pub const MAX_CELLS: f64 = 2e4;

impl Around {
    /// Ambiguity function of `shape` around its peak.
    ///
    /// # Errors
    /// A message, if the time-bandwidth product is above [`MAX_CELLS`], or bandwidth or duration is not positive.
    pub fn peak(shape: &PulseShape) -> Result<Self, String> {
        let (bandwidth_hz, duration_s) = (shape.bandwidth_hz(), shape.duration_s());
        let cells = bandwidth_hz * duration_s;
        if !(bandwidth_hz > 0.0 && duration_s > 0.0 && cells <= MAX_CELLS) {
            return Err(format!(
                "pulse of {} and {}: expected a time-bandwidth product above 0 and at most {MAX_CELLS}; use a shorter pulse",
                hertz(bandwidth_hz),
                seconds(duration_s)
            ));
        }
        let rate_hz = FINENESS as f64 * bandwidth_hz;
        let half = CELLS * FINENESS;
        let axis = |step: f64, half: usize| Axis {
            start: -(half as f64) * step,
            step,
            count: 2 * half + 1,
        };
        let dopplers_hz = axis(1.0 / (FINENESS as f64 * duration_s), half);
        let pulse = Sampled::pulse(shape, rate_hz);
        let delays = half.min(pulse.samples.len() - 1);
        // One shift at a time: all delays of all shifts would need gigabytes.
        let levels_db = (0..dopplers_hz.count).into_par_iter().flat_map_iter(|i| {
            let ambiguity = Ambiguity::new(&pulse, &[dopplers_hz.at(i)]);
            let shown = &ambiguity.cut(0)[ambiguity.reach - delays..=ambiguity.reach + delays];
            let level_db = |m: &f64| (20.0 * m.max(1e-10).log10()) as f32;
            shown.iter().map(level_db).collect::<Vec<_>>()
        });
        Ok(Self {
            levels_db: levels_db.collect(),
            dopplers_hz,
            delays_s: axis(1.0 / rate_hz, delays),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lfm() -> Sampled {
        let shape = PulseShape::Lfm {
            bandwidth_hz: 20e6,
            duration_s: 5e-6,
            rising: true,
        };
        Sampled::pulse(&shape, 200e6)
    }

    fn barker_13() -> Sampled {
        let code = [1, 1, 1, 1, 1, -1, -1, 1, 1, -1, 1, -1, 1];
        let phases_rad = code.iter().map(|&c| if c > 0 { 0.0 } else { PI });
        let shape = PulseShape::PhaseCode {
            phases_rad: phases_rad.collect(),
            chip_s: 1e-7,
        };
        Sampled::pulse(&shape, 80e6)
    }

    #[test]
    fn linear_fm_ambiguity_agrees_with_chim_2_10() {
        let (t, k) = (5e-6, 4e12);
        let dopplers_hz = [0.0, 1e6, -3.3e6];
        let chi = Ambiguity::new(&lfm(), &dopplers_hz);
        for (d, doppler_hz) in dopplers_hz.into_iter().enumerate() {
            for (i, value) in chi.cut(d).iter().enumerate() {
                let tau = chi.delay_s(i);
                let x = PI * (t - tau.abs()) * (doppler_hz + k * tau);
                let sinc = if x == 0.0 { 1.0 } else { x.sin() / x };
                let expected = ((1.0 - tau.abs() / t) * sinc).abs();
                // Sum instead of integral: its sinc is periodic in the sampling rate, with a relative error of
                // (pi (f + k tau) / rate)^2 / 6, which is 2.1e-2 of at most 1/x at the far end: 3e-3
                // of the peak at most, because the sinc itself is 1 / x.
                assert!(
                    (value - expected).abs() < 3e-3,
                    "{doppler_hz} {tau}: {value} {expected}"
                );
            }
            // Ridge: earlier by f / k, within one sample.
            let cut = chi.cut(d);
            let peak = (0..cut.len())
                .max_by(|&a, &b| cut[a].total_cmp(&cut[b]))
                .unwrap();
            let expected_s = -doppler_hz / k;
            assert!(
                (chi.delay_s(peak) - expected_s).abs() <= 1.0 / 200e6,
                "{peak}"
            );
        }
    }

    #[test]
    fn ambiguity_volume_is_independent_of_waveform() {
        // Over one period of Doppler in at least as many steps as samples, the sum of |chi|^2 over delays and
        // the mean over Doppler is exactly sum_tau sum_t |s(t)|^2 |s(t - tau)|^2 / E^2 = 1 (Parseval).
        for waveform in [lfm(), barker_13(), barker_13().burst(3, 3e-6)] {
            let count = waveform.samples.len();
            let shift = |i: usize| i as f64 * waveform.rate_hz / count as f64;
            let dopplers_hz: Vec<f64> = (0..count).map(shift).collect();
            let chi = Ambiguity::new(&waveform, &dopplers_hz);
            let volume: f64 = chi.magnitudes.iter().map(|m| m * m).sum::<f64>() / count as f64;
            assert!((volume - 1.0).abs() < 1e-9, "{volume}");
        }
    }

    #[test]
    fn barker_13_sidelobes_are_one_thirteenth() {
        let chi = Ambiguity::new(&barker_13(), &[0.0]);
        let cut = chi.cut(0);
        // 8 samples per chip: the main lobe is a triangle of one chip on either side.
        assert_eq!(chi.reach, 103);
        let side = cut[103 + 8..].iter().copied().fold(0.0, f64::max);
        let side_db = 20.0 * side.log10();
        assert!((side_db + 22.279).abs() < 1e-3, "{side_db}");
        for i in 0..=8 {
            assert!((cut[103 + i] - (1.0 - i as f64 / 8.0)).abs() < 0.08, "{i}");
        }
    }

    #[test]
    fn burst_repeats_at_pri_and_resolves_doppler() {
        let (count, pri_s) = (8, 20e-6);
        let burst = lfm().burst(count, pri_s);
        // Doppler nulls at 1 / (count pri); ambiguities at 1 / pri, lower by the pulse's own response.
        let dopplers_hz = [0.0, 1.0 / (count as f64 * pri_s), 1.0 / pri_s];
        let chi = Ambiguity::new(&burst, &dopplers_hz);
        let period = (pri_s * 200e6) as usize;
        for lag in 0..count {
            let value = chi.cut(0)[chi.reach + lag * period];
            // count - lag pulses overlap.
            assert!(
                (value - (count - lag) as f64 / count as f64).abs() < 1e-9,
                "{lag}"
            );
        }
        assert!(chi.cut(1)[chi.reach] < 1e-3);
        // sinc(T / PRI) = sinc(0.25) = 0.9003.
        assert!((chi.cut(2)[chi.reach] - 0.9003).abs() < 1e-3);
    }

    #[test]
    fn ambiguity_near_peak_agrees_with_closed_form() {
        let shape = PulseShape::Lfm {
            bandwidth_hz: 20e6,
            duration_s: 5e-6,
            rising: true,
        };
        let around = Around::peak(&shape).unwrap();
        let (dopplers, delays) = (around.dopplers_hz, around.delays_s);
        assert_eq!(around.levels_db.len(), dopplers.count * delays.count);
        let rate = 20e6 / 5e-6;
        for (i, &level_db) in around.levels_db.iter().enumerate() {
            let (f, tau) = (dopplers.at(i / delays.count), delays.at(i % delays.count));
            let left_s = 5e-6 - tau.abs();
            let x = PI * left_s * (f + rate * tau);
            let sinc = if x == 0.0 { 1.0 } else { x.sin() / x };
            let expected = left_s / 5e-6 * sinc.abs();
            let got = 10f64.powf(f64::from(level_db) / 20.0);
            // Sum at 8 samples per cell instead of an integral: 5e-6 for a sweep twice as long.
            assert!((got - expected).abs() < 1e-4, "{f} {tau}: {got} {expected}");
        }
        let long = PulseShape::Lfm {
            bandwidth_hz: 1e9,
            duration_s: 1e-3,
            rising: true,
        };
        assert!(Around::peak(&long).unwrap_err().contains("shorter"));
    }
}
