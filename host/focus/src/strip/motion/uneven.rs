//! The spectrum along the track of pulses at uneven places.
//!
//! ```text
//! Y(kx_q) = sum_n z_n exp(-j kx_q (s_n - s_0))
//! ```
//!
//! Each pulse, brought down by the middle of the wavenumbers that are kept, is spread over 6 cells of an even grid with a Kaiser-Bessel
//! kernel, whose roll-off is divided out of the transform: the grid has twice as many cells a period as wavenumbers are kept, so that what
//! is left is the kernel's error, -107 dB, wherever the pulses are. It is the type-1 transform of uneven samples (Beatty, Nishimura and
//! Pauly 2005), and takes a transform of `2 Q` for each frequency, as one over even places takes one of the padded pulses.

use num_complex::Complex32;

use crate::strip::axes::{TAPS, cells};
use subaperture_signal::kaiser_bessel::KaiserBessel;

/// Relative RMS error: the kernel (-107 dB) and its table (-114 dB).
pub(super) const ERROR: f64 = 5e-6;

/// Bytes kept of a pulse.
pub(in crate::strip) const PULSE_BYTES: usize = size_of::<Spread>();

/// Where a pulse is spread to, and with which weights.
struct Spread {
    first: u32,
    weights: [f32; TAPS],
}

/// The transform over slow time of pulses where they are.
pub(in crate::strip) struct Uneven {
    pulses: Vec<Spread>,
    /// `1 / Phi` of each wavenumber that is kept.
    roll_off: Vec<f32>,
}

impl Uneven {
    /// Of pulses so many metres from the first place, of which `num_bins` wavenumbers are kept, `2 pi / period_m` apart.
    pub(in crate::strip) fn new(
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

    /// Spreads a value of each pulse over the cells.
    pub(in crate::strip) fn spread(
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

    /// The wavenumbers that are kept, of the cells' transform.
    pub(in crate::strip) fn kept(&self, line: &[Complex32], bins: &mut [Complex32]) {
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
    fn it_is_the_sum_over_pulses_wherever_they_are() {
        // Pulses that crowd, stand still, turn back and leave a gap, within 40 m of a period of 90 m; bins from -7 to 23.
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
        // The kernel's error, and float32 sums of 200 values.
        assert!(relative < ERROR, "{relative:e}");
    }
}
