//! From the response over carriers to a profile over range, and its peaks.
//!
//! The sum is an inverse transform of the weighted values, padded with zeros to `fineness` places a resolution cell, times the carrier's phase at
//! each range: exact at each place. A peak is the top of the parabola through the squared magnitudes of three places; with 16 places a cell its error is
//! below a thousandth of a cell for one echo.

use num_complex::Complex64;
use subaperture_fft::Transforms;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_signal::phase::phasor;
use subaperture_signal::window::Window;

/// A complex range profile, from 0 to the unambiguous range.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    /// From place to place, metres.
    pub spacing_m: f64,
    /// A scatterer of amplitude 1 reads 1.
    pub values: Vec<Complex64>,
}

/// A local maximum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peak {
    /// Its range, metres.
    pub range_m: f64,
    /// Its magnitude.
    pub magnitude: f64,
}

impl Profile {
    /// Of values at `start_hz + n step_hz`.
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

    /// Maxima of at least `least` in magnitude, by range. The profile's ends meet: ranges repeat.
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

    /// The largest magnitude over the mean one: some ten and more where there are echoes, 2 to 4 where there is noise.
    pub fn contrast(&self) -> f64 {
        let magnitudes = || self.values.iter().map(|z| z.norm());
        magnitudes().fold(0.0, f64::max) * self.values.len() as f64 / magnitudes().sum::<f64>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One echo, 50 steps of 4 MHz: it reads its amplitude with its phase at a place on it; without a window the response is Dirichlet's kernel, zero at
    /// `c / (2 N step)`, 0.7495 m, to both sides, and ranges beyond 37.47 m fold.
    #[test]
    fn an_echo_reads_its_amplitude_at_its_range_and_nothing_a_resolution_off() {
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
