//! Division of pulses with intra-pulse motion into parts, each a pulse with antenna positions of its own.
//!
//! The phase of a sample `d` after the middle of a pulse is expanded to `d^2` ([`super::blurs`]). The term in `d^3`,
//!
//! ```text
//! 2 pi a d^3,   a = step r'' / (2 c) turns
//! ```
//!
//! is replaced by its regression on `d` over the weighted samples, `2 pi a g d` with `g = sum w^2 d^4 / sum w^2 d^2`, which shifts the range profile.
//! Without a window this leaves 0.4 of the RMS of `d^3` (a Legendre polynomial of degree 3), and less under one. A pulse in `S` parts of
//! `K / S` samples has `S^3` times less of it: acceleration over longer or wider pulses is followed to any bound, at `S` times the work for each pixel.

use std::ops::Range;

use subaperture_model::phase_history::Pulse;

/// Largest number of parts of a pulse.
pub(super) const MAX_PARTS: usize = 64;

/// Parts of equal numbers of samples of a pulse; the last part may have fewer.
pub(super) struct PulseParts {
    num_samples: usize,
    width: usize,
    /// Fast-time weights of each part, `width` of them: zero beyond the last sample.
    windows: Vec<Vec<f64>>,
    /// Regression `g` of `d^3` on `d` for each part, samples squared.
    regressions: Vec<f64>,
}

impl PulseParts {
    /// Divide pulses with the given fast-time weights, one per sample, into at most `count` parts.
    pub(super) fn new(fast: &[f64], count: usize) -> Self {
        let width = fast.len().div_ceil(count.max(1)).max(1);
        let windows: Vec<Vec<f64>> = fast
            .chunks(width)
            .map(|weights| {
                let mut window = weights.to_vec();
                window.resize(width, 0.0);
                window
            })
            .collect();
        Self {
            num_samples: fast.len(),
            width,
            regressions: windows.iter().map(|window| regression(window)).collect(),
            windows,
        }
    }

    /// Number of parts of a pulse, each with its own antenna position.
    pub(super) fn count(&self) -> usize {
        self.windows.len()
    }

    /// Samples of a part.
    pub(super) fn width(&self) -> usize {
        self.width
    }

    /// Fast-time weights of a part.
    pub(super) fn window(&self, part: usize) -> &[f64] {
        &self.windows[part]
    }

    /// Regression of `d^3` on `d` for a part, samples squared.
    pub(super) fn regression(&self, part: usize) -> f64 {
        self.regressions[part]
    }

    /// Samples of a pulse that belong to a part.
    pub(super) fn samples(&self, part: usize) -> Range<usize> {
        let start = part * self.width;
        start..(start + self.width).min(self.num_samples)
    }

    /// Part of a pulse: its geometry is that of the part's sample `width / 2`.
    pub(super) fn of(&self, pulse: &Pulse, part: usize) -> Pulse {
        let first = part * self.width;
        let after = (first + self.width / 2) as f64 - (self.num_samples / 2) as f64;
        let mut own = *pulse;
        if after == 0.0 && first == 0 {
            return own;
        }
        let s = after * pulse.sweep.sample_s;
        own.time_s += s;
        own.start_hz = pulse.frequency_hz(first);
        [own.transmitter_m, own.receiver_m] = pulse.antennas_after_m(after);
        own.sweep.transmitter_m_s += s * pulse.sweep.transmitter_m_s2;
        own.sweep.receiver_m_s += s * pulse.sweep.receiver_m_s2;
        own.reference_m += s * pulse.sweep.reference_m_s.unwrap_or_default();
        own.reference_path_m += pulse.reference_drift_m(after);
        own
    }
}

/// `sum w^2 d^4 / sum w^2 d^2` with `d = k - K/2`; 0 for a single sample.
fn regression(window: &[f64]) -> f64 {
    let (mut fourth, mut second) = (0.0, 0.0);
    for (k, weight) in window.iter().enumerate() {
        let d = k as f64 - (window.len() / 2) as f64;
        let square = (weight * d).powi(2);
        second += square;
        fourth += square * d * d;
    }
    match second > 0.0 {
        true => fourth / second,
        false => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use subaperture_model::phase_history::Sweep;

    use super::*;

    /// Without a window the regression is `3 h^2 / 5` with `h` half the samples.
    #[test]
    fn regression_of_cubic_phase_leaves_legendre_polynomial() {
        let parts = PulseParts::new(&[1.0; 2001], 1);
        assert!((parts.regression(0) / 0.6e6 - 1.0).abs() < 2e-3);
    }

    #[test]
    fn parts_of_a_pulse_keep_paths_and_frequencies_of_every_sample() {
        let moving = |x: f64| DVec3::new(0.4 + x, -0.3, 0.1 * x);
        let mut pulse = Pulse {
            transmitter_m: DVec3::new(1.0, -20.0, 3.0),
            receiver_m: DVec3::new(2.0, -20.0, 3.0),
            reference_m: DVec3::new(0.0, 5.0, 0.0),
            reference_path_m: 51.0,
            start_hz: 1.7e9,
            step_hz: 1.5e6,
            time_s: 7.0,
            sweep: Sweep {
                sample_s: 2e-4,
                transmitter_m_s: moving(0.0),
                transmitter_m_s2: moving(3.0),
                receiver_m_s: moving(1.0),
                receiver_m_s2: moving(-2.0),
                reference_m_s: None,
            },
            recorded_path_m: None,
        };
        let point = DVec3::new(4.0, 9.0, 1.0);
        for reference_m_s in [None, Some(DVec3::ZERO), Some(moving(2.0))] {
            pulse.sweep.reference_m_s = reference_m_s;
            for count in [1, 2, 3, 7, 21] {
                let num_samples = 21;
                let parts = PulseParts::new(&vec![1.0; num_samples], count);
                let mut seen = 0;
                for part in 0..parts.count() {
                    let own = parts.of(&pulse, part);
                    for (i, k) in parts.samples(part).enumerate() {
                        assert!((own.frequency_hz(i) - pulse.frequency_hz(k)).abs() < 1e-3);
                        let of = |pulse: &Pulse, k: usize, count: usize| {
                            pulse.relative_path_after_m(point, k as f64 - (count / 2) as f64)
                        };
                        let [got, expected] =
                            [of(&own, i, parts.width()), of(&pulse, k, num_samples)];
                        assert!((got - expected).abs() < 1e-12, "{count} {part} {k}");
                        seen += 1;
                    }
                }
                assert_eq!(seen, num_samples);
            }
        }
    }
}
