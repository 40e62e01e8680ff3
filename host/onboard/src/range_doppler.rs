//! The range-Doppler map of a sub-CPI, by the host's own transforms.
//!
//! The same sum as the core's (`subaperture_core`, head of the crate), for `M` pulses of `K`
//! frequencies, `R` range bins and `D` Doppler bins, with `f_c` the frequency of sample `K/2`:
//!
//! ```text
//! map[d][r] = 1 / (sum w_fast  sum w_slow)  sum_k sum_m  w_fast[k] w_slow[m] z[m][k]
//!             exp(+j 2 pi (k - K/2)(r - R/2) / R)
//!             exp(-j 2 pi (f_k / f_c)(m - M/2)(d - D/2) / D)
//! ```
//!
//! Written apart from it, on other libraries, so that each can be held against the other
//! ([`crate::crosscheck`]).
//!
//! Memory: [`ScaledDft`]'s tables, the map and one row. Error: -130 dB or so (float32).

use std::sync::Arc;

use num_complex::Complex32;
use subaperture_fft as fft;
use subaperture_fft::Fft;

use subaperture_model::phase_history::Band;
use subaperture_signal::scaled_dft::{ScaledDft, Shape};

/// Makes maps of one shape.
pub struct RangeDopplerMapper {
    fast: Vec<f32>,
    dft: ScaledDft,
    range_fft: Arc<dyn Fft<f32>>,
    slow: Vec<Complex32>,
    scratch: Vec<Complex32>,
}

impl RangeDopplerMapper {
    /// For pulses over `band` with `slow.len()` pulses a sub-CPI, windows `fast` and `slow`.
    pub fn new(
        band: &Band,
        fast: &[f64],
        slow: &[f64],
        range_bins: usize,
        doppler_bins: usize,
    ) -> Self {
        let num_pulses = slow.len();
        let scales = band.scales();
        let shape = Shape {
            inputs: num_pulses,
            input_centre: (num_pulses / 2) as f64,
            input_drift: 0.0,
            outputs: doppler_bins,
            output_centre: (doppler_bins / 2) as f64,
            spacing: -1.0 / doppler_bins as f64,
        };
        let dft = ScaledDft::new(fft::Transforms::Fastest, &scales, shape, |_, m| slow[m]);
        let range_fft = fft::inverse(range_bins);
        let norm = 1.0 / (fast.iter().sum::<f64>() * slow.iter().sum::<f64>());
        let scratch = dft
            .scratch_length()
            .max(range_fft.get_inplace_scratch_len());
        Self {
            fast: fast.iter().map(|w| (w * norm) as f32).collect(),
            slow: vec![Complex32::ZERO; num_pulses],
            scratch: vec![Complex32::ZERO; scratch],
            dft,
            range_fft,
        }
    }

    /// The map of `samples` (pulse by pulse) into `map` (`[doppler][range]`).
    ///
    /// # Panics
    /// If a length is wrong.
    pub fn map(&mut self, samples: &[Complex32], map: &mut [Complex32]) {
        let (num_samples, range_bins) = (self.fast.len(), self.range_fft.len());
        assert_eq!(samples.len(), num_samples * self.slow.len());
        assert_eq!(map.len(), range_bins * self.dft.shape().outputs);
        map.fill(Complex32::ZERO);
        for (k, &weight) in self.fast.iter().enumerate() {
            for (value, pulse) in self.slow.iter_mut().zip(samples.chunks_exact(num_samples)) {
                *value = pulse[k] * weight;
            }
            let place = (k + range_bins - num_samples / 2) % range_bins;
            self.dft
                .transform(k, &self.slow, &mut self.scratch, |d, value| {
                    map[d * range_bins + place] = value;
                });
        }
        for row in map.chunks_exact_mut(range_bins) {
            self.range_fft.process_with_scratch(row, &mut self.scratch);
            // Bin 0 of the transform is path 0, which belongs in the middle.
            row.rotate_right(range_bins / 2);
        }
    }
}
