//! Transform of a frequency response into a range profile, and peak detection.
//!
//! The profile is the inverse FFT of the weighted values, zero-padded to `fineness` samples per resolution cell, times
//! the carrier's phase at each range; it is exact at each sample. A peak is the maximum of the parabola through three
//! squared magnitudes. With 16 samples per cell its error is below a thousandth of a cell for a single echo.

use num_complex::Complex64;
use subaperture_fft::Transforms;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_signal::phase::phasor;
use subaperture_signal::window::Window;

/// Complex range profile from 0 to the unambiguous range.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    /// Sample spacing, metres.
    pub spacing_m: f64,
    /// Complex samples; a scatterer of amplitude 1 has a peak of 1.
    pub values: Vec<Complex64>,
}

/// Local maximum of a range profile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peak {
    /// Range, metres.
    pub range_m: f64,
    /// Magnitude at the peak; 1 for a scatterer of amplitude 1.
    pub magnitude: f64,
}

impl Profile {
    /// Transform values at the frequencies `start_hz + n step_hz`.
    pub fn new(
        values: &[Complex64],
        start_hz: f64,
        step_hz: f64,
        window: Window,
        fineness: usize,
    ) -> Self {
        let count = (values.len() * fineness.max(1)).max(1);
        let weights = window.weights(values.len());
        let sum: f64 = weights.iter().sum();
        let mut profile = vec![Complex64::ZERO; count];
        for ((p, z), weight) in profile.iter_mut().zip(values).zip(&weights) {
            *p = z * (weight / sum);
        }
        Transforms::Portable
            .inverse::<f64>(count)
            .process(&mut profile);
        let spacing_m = SPEED_OF_LIGHT_M_S / (2.0 * step_hz * count as f64);
        for (i, p) in profile.iter_mut().enumerate() {
            *p *= phasor(start_hz * 2.0 * (i as f64 * spacing_m) / SPEED_OF_LIGHT_M_S);
        }
        Self {
            spacing_m,
            values: profile,
        }
    }

    /// Maxima with a magnitude of at least `least`, in ascending range. The profile is circular, since ranges are
    /// ambiguous.
    pub fn peaks(&self, least: f64) -> Vec<Peak> {
        let n = self.values.len();
        let power = |i: usize| self.values[i % n].norm_sqr();
        let peak = |i: usize| {
            let [before, here, after] = [power(i + n - 1), power(i), power(i + 1)];
            if n < 3 || here < least * least || here <= before || here < after {
                return None;
            }
            let bend = before - 2.0 * here + after;
            let off = if bend < 0.0 {
                0.5 * (before - after) / bend
            } else {
                0.0
            };
            Some(Peak {
                range_m: (i as f64 + off) * self.spacing_m,
                magnitude: (here - 0.25 * (before - after) * off).sqrt(),
            })
        };
        (0..n).filter_map(peak).collect()
    }

    /// Ratio of the largest to the mean magnitude: about ten or more with echoes, 2 to 4 for noise.
    pub fn contrast(&self) -> f64 {
        let magnitudes = || self.values.iter().map(|z| z.norm());
        magnitudes().fold(0.0, f64::max) * self.values.len() as f64 / magnitudes().sum::<f64>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One echo, 50 steps of 4 MHz: a sample at its range has the echo's amplitude. Without a window the response is a
    /// Dirichlet kernel with zeros `c / (2 N step)`, 0.7495 m, to both sides. Ranges beyond 37.47 m are ambiguous.
    #[test]
    fn profile_has_echo_amplitude_at_its_range_and_zero_one_resolution_away() {
        let unambiguous_m = SPEED_OF_LIGHT_M_S / 8e6;
        let resolution_m = unambiguous_m / 50.0;
        let at = |range_m: f64| {
            let value = |n: u32| {
                phasor(-(1.1e9 + 4e6 * f64::from(n)) * 2.0 * range_m / SPEED_OF_LIGHT_M_S) * 0.3
            };
            let values: Vec<Complex64> = (0..50).map(value).collect();
            Profile::new(&values, 1.1e9, 4e6, Window::None, 16)
        };
        let range_m = 9.0 * resolution_m;
        let profile = at(range_m);
        assert!((profile.values[144] - 0.3).norm() < 1e-12);
        assert!(profile.values[128].norm() < 1e-12 && profile.values[160].norm() < 1e-12);
        for range_m in [6.3, 16.01, 6.3 + unambiguous_m] {
            let peaks = at(range_m).peaks(0.2);
            assert_eq!(peaks.len(), 1);
            assert!(
                (peaks[0].range_m - range_m % unambiguous_m).abs() < 1e-3 * resolution_m,
                "{peaks:?}"
            );
            assert!((peaks[0].magnitude - 0.3).abs() < 1e-3);
        }
    }
}
