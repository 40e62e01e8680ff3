//! Baseband pulse shapes.
//!
//! A sweep is `exp(j pi (B / T) t (t - T))` for `0 <= t < T`, sampled: its frequency runs from `-B/2` to `B/2`, or
//! backwards for a falling sweep. A phase code is band-limited to the sampling rate, so its spectrum is that of its
//! chips within it,
//!
//! ```text
//! P(f) = rate chip_s sinc(f chip_s) exp(-j pi f chip_s) sum_c exp(j phase_c - j 2 pi f c chip_s)
//! ```
//!
//! A recorded pulse has the spectrum of its samples. All phases refer to the start of the pulse: that of a sweep is 0 there,
//! and `-pi B T / 4` in its middle.

use num_complex::Complex64;
use subaperture_fft::Transforms;

use super::PulseShape;
use subaperture_signal::phase::{cis, phasor};

impl PulseShape {
    /// Duration of the pulse, seconds.
    pub fn duration_s(&self) -> f64 {
        match self {
            Self::Lfm { duration_s, .. } => *duration_s,
            Self::PhaseCode { phases_rad, chip_s } => phases_rad.len() as f64 * chip_s,
            Self::Recorded {
                samples, rate_hz, ..
            } => samples.len() as f64 / rate_hz,
        }
    }

    /// Bandwidth, hertz: the swept band, the inverse of the chip duration, or the band in use of a recorded pulse.
    pub fn bandwidth_hz(&self) -> f64 {
        match self {
            Self::Lfm { bandwidth_hz, .. } => *bandwidth_hz,
            Self::PhaseCode { chip_s, .. } => 1.0 / chip_s,
            Self::Recorded { bandwidth_hz, .. } => *bandwidth_hz,
        }
    }

    /// Unscaled discrete Fourier transform of the zero-padded pulse, `count` samples at `rate_hz` in total. A longer
    /// pulse wraps around.
    pub fn spectrum(&self, rate_hz: f64, count: usize) -> Vec<Complex64> {
        match self {
            Self::Lfm {
                bandwidth_hz,
                duration_s,
                rising,
            } => {
                let chirp_hz_s = bandwidth_hz / duration_s * if *rising { 1.0 } else { -1.0 };
                let mut samples = vec![Complex64::ZERO; count];
                // A last sample that rounding places at the end of the pulse is outside it.
                let length = (duration_s * rate_hz * (1.0 - 1e-12)).ceil() as usize;
                for i in 0..length {
                    let t = i as f64 / rate_hz;
                    samples[i % count] += phasor(0.5 * chirp_hz_s * t * (t - duration_s));
                }
                Transforms::Portable.forward(count).process(&mut samples);
                samples
            }
            Self::Recorded { samples: own, .. } => {
                let mut samples = vec![Complex64::ZERO; count];
                for (i, z) in own.iter().enumerate() {
                    samples[i % count] += z;
                }
                Transforms::Portable.forward(count).process(&mut samples);
                samples
            }
            Self::PhaseCode { phases_rad, chip_s } => (0..count)
                .map(|m| {
                    let above = if m < count.div_ceil(2) { 0 } else { count };
                    let turns = (m as f64 - above as f64) * rate_hz / count as f64 * chip_s;
                    let chips = phases_rad.iter().enumerate();
                    let sum: Complex64 = chips
                        .map(|(c, &phase)| cis(phase) * phasor(-turns * c as f64))
                        .sum();
                    let half = std::f64::consts::PI * turns;
                    let sinc = if half == 0.0 {
                        1.0
                    } else {
                        libm::sin(half) / half
                    };
                    sum * phasor(-0.5 * turns) * (rate_hz * chip_s * sinc)
                })
                .collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Parseval: a sweep of unit amplitude has 400 samples of energy for any transform length.
    #[test]
    fn sweep_energy_is_independent_of_transform_length() {
        let shape = PulseShape::Lfm {
            bandwidth_hz: 80e6,
            duration_s: 4e-6,
            rising: false,
        };
        for count in [512, 1001] {
            let spectrum = shape.spectrum(100e6, count);
            let energy: f64 = spectrum.iter().map(Complex64::norm_sqr).sum::<f64>() / count as f64;
            assert!((energy - 400.0).abs() < 1e-9, "{energy}");
        }
        // Falling sweep: the conjugate of the rising one, with a mirrored spectrum.
        let rising = PulseShape::Lfm {
            bandwidth_hz: 80e6,
            duration_s: 4e-6,
            rising: true,
        };
        let (up, down) = (rising.spectrum(1e8, 512), shape.spectrum(1e8, 512));
        for m in 0..512 {
            assert!((up[m].conj() - down[(512 - m) % 512]).norm() < 1e-9);
        }
    }

    /// One chip over a whole window of `N` samples: `P[0] = N`, all others 0.
    #[test]
    fn chip_of_window_length_has_dc_only() {
        let shape = PulseShape::PhaseCode {
            phases_rad: vec![0.0],
            chip_s: 64e-8,
        };
        let spectrum = shape.spectrum(1e8, 64);
        assert!((spectrum[0] - 64.0).norm() < 1e-12);
        assert!(spectrum[1..].iter().all(|z| z.norm() < 1e-11));
    }
}
