//! Along-track spectrum of pulses at uneven positions.
//!
//! ```text
//! Y(kx_q) = sum_n z_n exp(-j kx_q (s_n - s_0))
//! ```
//!
//! Each pulse, with the centre wavenumber removed, is gridded onto 6 cells of an even grid with a Kaiser-Bessel
//! kernel, whose roll-off is divided out of the transform. The grid has twice as many cells per period as retained wavenumbers, so that only
//! the kernel error of -107 dB remains, for any pulse positions. This is the type-1 non-uniform FFT (Beatty, Nishimura and
//! Pauly 2005). It takes a transform of `2 Q` per frequency, compared with one of the padded pulses for even positions.

use num_complex::Complex32;

use crate::frequency_domain::taps::{TAPS, cells};
use subaperture_signal::kaiser_bessel::KaiserBessel;

/// Relative RMS error: the kernel (-107 dB) and its table (-114 dB).
pub(super) const ERROR: f64 = 5e-6;

/// Bytes stored per pulse.
pub(in crate::frequency_domain) const PULSE_BYTES: usize = size_of::<Spread>();

/// First cell and weights of a gridded pulse.
struct Spread {
    first: u32,
    weights: [f32; TAPS],
}

/// Slow-time transform of pulses at uneven positions.
pub(in crate::frequency_domain) struct Uneven {
    pulses: Vec<Spread>,
    /// Inverse roll-off `1 / Phi` of each retained wavenumber.
    roll_off: Vec<f32>,
}

impl Uneven {
    /// Prepare for pulses at the given distances from the first one, metres, and `num_bins` retained wavenumbers, `2 pi / period_m` apart.
    pub(in crate::frequency_domain) fn new(
        places_m: impl Iterator<Item = f64>,
        period_m: f64,
        num_bins: usize,
    ) -> Self {
        let kernel = KaiserBessel::new(TAPS);
        let length = cells(num_bins);
        let cells = length as f64 / period_m;
        let spread = |place_m: f64| {
            let place = place_m * cells;
            let whole = place.floor();
            let first = (whole as i64 + 1 - TAPS as i64 / 2).rem_euclid(length as i64);
            Spread {
                first: first as u32,
                weights: kernel.weights::<TAPS>((place - whole) as f32),
            }
        };
        Self {
            pulses: places_m.map(spread).collect(),
            roll_off: kernel.emphasis(num_bins, length),
        }
    }

    /// Grid one value per pulse onto the cells.
    pub(in crate::frequency_domain) fn spread(
        &self,
        values: impl Iterator<Item = Complex32>,
        line: &mut [Complex32],
    ) {
        let length = line.len();
        line.fill(Complex32::ZERO);
        for (value, pulse) in values.zip(&self.pulses) {
            let first = pulse.first as usize;
            for (i, weight) in (first..).zip(pulse.weights) {
                line[if i < length { i } else { i - length }] += value * weight;
            }
        }
    }

    /// Copy the retained wavenumbers from the transform of the cells.
    pub(in crate::frequency_domain) fn kept(&self, line: &[Complex32], bins: &mut [Complex32]) {
        let (length, half) = (line.len(), bins.len() / 2);
        for (q, (bin, roll_off)) in bins.iter_mut().zip(&self.roll_off).enumerate() {
            *bin = line[(q + length - half) % length] * roll_off;
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use num_complex::Complex64;
    use subaperture_fft::forward;
    use subaperture_signal::phase::{cis, narrow, widen};

    use super::*;

    #[test]
    fn uneven_spectrum_equals_direct_sum_over_pulses() {
        // Pulses that cluster, stand still, reverse and leave a gap, within 40 m of a period of 90 m; bins from -7 to 23.
        let places_m: Vec<f64> = (0..200)
            .map(|n| {
                let t = f64::from(n) / 199.0;
                let gap_m = if n > 120 { 9.0 } else { 0.0 };
                let turning_m = 6.0 * (9.0 * t).sin();
                (12.0 + 12.0 * t + turning_m + gap_m).max(9.0)
            })
            .collect();
        let values: Vec<Complex64> = (0..200).map(|n| cis(f64::from(n * n) * 0.37)).collect();
        let (period_m, num_bins, first_bin) = (90.0, 31, -7);
        let middle = f64::from(first_bin + num_bins / 2) * TAU / period_m;
        let uneven = Uneven::new(places_m.iter().copied(), period_m, num_bins as usize);
        let lowered = values.iter().zip(&places_m);
        let lowered = lowered.map(|(value, place_m)| narrow(value * cis(-middle * place_m)));
        let mut line = vec![Complex32::ZERO; cells(num_bins as usize)];
        uneven.spread(lowered, &mut line);
        forward(line.len()).process(&mut line);
        let mut bins = vec![Complex32::ZERO; num_bins as usize];
        uneven.kept(&line, &mut bins);
        let (mut error, mut power) = (0.0, 0.0);
        for (q, got) in (first_bin..).zip(&bins) {
            let kx = f64::from(q) * TAU / period_m;
            let terms = values.iter().zip(&places_m);
            let sum: Complex64 = terms
                .map(|(value, place_m)| value * cis(-kx * place_m))
                .sum();
            error += (widen(*got) - sum).norm_sqr();
            power += sum.norm_sqr();
        }
        let relative = (error / power).sqrt();
        // Kernel error, and float32 sums of 200 values.
        assert!(relative < ERROR, "{relative:e}");
    }
}
