//! Keystone transform by sinc resampling with precomputed weights: Schone 2020, (2.26) and 5.1.
//!
//! Frequency `k` is resampled in slow time to `u (f_c / f_k)`, where a scatterer's phase advances by the same angle per
//! pulse at every frequency:
//!
//! ```text
//! y[i] = sum_m sinc(u_i f_c / f_k - u_m) x[m],   u_m = m - (M - 1) / 2
//! ```
//!
//! Pulses beyond the sub-CPI's edges count as zero, which is the error of this method: each edge moves by up to `M B /
//! (4 f_c)` pulses, so that neighbouring sub-CPIs leave a gap or overlap of up to twice that. [`super::scaled_dft`] has
//! no such edges.
//!
//! Memory: `K M^2` float32. Cost: `M` real-by-complex multiply-adds per sample.

use num_complex::Complex32;

/// Resampling weights for every frequency of a band, and sub-CPIs of one length.
pub struct SincKeystone {
    num_pulses: usize,
    weights: Vec<f32>,
}

impl SincKeystone {
    /// Compute the weights for `scales[k] = f_k / f_c` and sub-CPIs of `num_pulses` pulses.
    pub fn new(scales: &[f64], num_pulses: usize) -> Self {
        let centre = (num_pulses as f64 - 1.0) / 2.0;
        let mut weights = Vec::with_capacity(scales.len() * num_pulses * num_pulses);
        for scale in scales {
            for i in 0..num_pulses {
                let place = (i as f64 - centre) / scale + centre;
                weights.extend((0..num_pulses).map(|m| sinc(place - m as f64) as f32));
            }
        }
        Self {
            num_pulses,
            weights,
        }
    }

    /// Memory of the weights, bytes.
    pub fn bytes(frequencies: usize, num_pulses: usize) -> u64 {
        4 * frequencies as u64 * (num_pulses as u64).pow(2)
    }

    /// Resample the slow-time row `x` of frequency `k` into `y`; both have the sub-CPI's length.
    ///
    /// # Panics
    /// If `y` or `x` is shorter.
    pub fn resample(&self, k: usize, x: &[Complex32], y: &mut [Complex32]) {
        let m = self.num_pulses;
        let matrix = &self.weights[k * m * m..(k + 1) * m * m];
        for (y, row) in y[..m].iter_mut().zip(matrix.chunks_exact(m)) {
            *y = x[..m].iter().zip(row).map(|(x, w)| x * w).sum();
        }
    }
}

/// Normalised sinc, `sin(pi x) / (pi x)`.
#[inline]
pub fn sinc(x: f64) -> f64 {
    let angle = std::f64::consts::PI * x;
    if angle == 0.0 {
        1.0
    } else {
        libm::sin(angle) / angle
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keystone_rescales_tone_and_keeps_centre_frequency() {
        let (m, scale) = (64, 1.01);
        let keystone = SincKeystone::new(&[1.0, scale], m);
        let tone = |rate: f64| -> Vec<Complex32> {
            (0..m)
                .map(|i| Complex32::cis((std::f64::consts::TAU * rate * (i as f64 - 31.5)) as f32))
                .collect()
        };
        let mut y = vec![Complex32::ZERO; m];
        keystone.resample(0, &tone(0.1), &mut y);
        assert!(y.iter().zip(tone(0.1)).all(|(a, b)| (a - b).norm() < 1e-5));
        // At f = 1.01 f_c the phase of a scatterer advances 1.01 times as fast, and as fast as at f_c after resampling.
        // The truncated sinc leaves about 1 / (pi distance) of the edge: 0.02 in the middle half.
        keystone.resample(1, &tone(0.1 * scale), &mut y);
        let middle = 16..48;
        assert!(
            y[middle.clone()]
                .iter()
                .zip(&tone(0.1)[middle])
                .all(|(a, b)| (a - b).norm() < 0.02)
        );
    }
}
