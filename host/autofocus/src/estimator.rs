//! Estimators of the phase error common to the histories of several points.
//!
//! Each row `x_i` is the history of a point, centred and low-pass filtered: a constant times `exp(j phi)` plus errors of power `s_i`.
//!
//! - [`Estimator::Gradient`], C (6.5) to (6.8): the phase step from pulse to pulse, accumulated. C uses
//!   `sum Im(x* x') / sum |x|^2` with a derivative by a transform, which is accurate for small steps; here the step is
//!   `arg sum_i x_i*[n] x_i[n+1] / s_i`, the maximum-likelihood estimate of a difference of any size. Errors accumulate from pulse to pulse.
//! - [`Estimator::Eigenvector`]: the phases of the `v` that maximises `sum_i |v^H x_i|^2 / s_i`, the maximum-likelihood estimate of all
//!   phases together (Jakowatz and Wahl, Eigenvector method for maximum-likelihood estimation of phase errors in
//!   SAR imagery, 1993): the dominant eigenvector of the rows' covariance, found by power iteration on the rows without
//!   forming the matrix. It uses all pairs of pulses, not neighbours alone.
//!
//! For a total signal-to-noise ratio per pulse of `S = sum_i a_i / s_i`, the Cramér-Rao bound of the variance of a phase is `1 / (2 S)`.
//! The eigenvector reaches it within the accuracy of a test on 3200 phases (below).

use std::fmt;
use std::str::FromStr;

use num_complex::Complex64;

use subaperture_fft::{forward, inverse};
use subaperture_signal::fast_length::fast_length;

/// Phase estimator of [`PhaseGradient`](super::PhaseGradient).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Estimator {
    /// Accumulated maximum-likelihood phase differences of neighbouring pulses. The cheapest; needs bright points of high signal-to-noise ratio, as
    /// errors accumulate from pulse to pulse. Use it to compare with Chim's results.
    Gradient,
    /// Joint maximum likelihood of all phases from bright points: the dominant eigenvector of their covariance. Use it over wide angles, in
    /// near scenes and for errors that are independent from pulse to pulse. Texture without bright points is not focused.
    Eigenvector,
    /// Maximum likelihood over all range cells, with points, texture and clutter. Phases are curves with a smoothness chosen on held-out data. The
    /// default, and the most accurate on small far scenes. Falls back to [`Estimator::Eigenvector`] where the geometry leaves too few cells.
    #[default]
    Likelihood,
}

/// Unknown name of an estimator.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown estimator '{0}': expected likelihood, eigenvector or gradient")]
pub struct UnknownEstimator(String);

impl FromStr for Estimator {
    type Err = UnknownEstimator;

    fn from_str(text: &str) -> Result<Self, UnknownEstimator> {
        match text {
            "gradient" => Ok(Self::Gradient),
            "eigenvector" => Ok(Self::Eigenvector),
            "likelihood" => Ok(Self::Likelihood),
            _ => Err(UnknownEstimator(text.to_owned())),
        }
    }
}

impl fmt::Display for Estimator {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Gradient => "gradient",
            Self::Eigenvector => "eigenvector",
            Self::Likelihood => "likelihood",
        })
    }
}

/// A point's history with its weight.
#[derive(Clone, Debug)]
pub(crate) struct Row {
    /// Values, one per pulse.
    pub(crate) values: Vec<Complex64>,
    /// One over the power of its errors.
    pub(crate) weight: f64,
}

/// Largest number of power iterations, and the change of the vector that ends them, far below any error.
const ITERATIONS: usize = 200;
const STILL: f64 = 1e-10;

/// Common phases, radians; zeros if there are no rows.
pub(crate) fn phases_rad(estimator: Estimator, rows: &[Row], count: usize) -> Vec<f64> {
    match estimator {
        Estimator::Gradient => gradient(rows, count),
        Estimator::Eigenvector | Estimator::Likelihood => eigenvector(rows, count),
    }
}

fn gradient(rows: &[Row], count: usize) -> Vec<f64> {
    let mut phase = 0.0;
    let steps = (1..count).map(|n| {
        let step = |row: &Row| row.values[n - 1].conj() * row.values[n] * row.weight;
        let sum: Complex64 = rows.iter().map(step).sum();
        phase += libm::atan2(sum.im, sum.re);
        phase
    });
    std::iter::once(0.0).chain(steps).take(count).collect()
}

fn eigenvector(rows: &[Row], count: usize) -> Vec<f64> {
    // Start from zero phases: histories are centred, so the dominant eigenvector is not orthogonal to them.
    let mut vector = vec![Complex64::ONE; count];
    for _ in 0..ITERATIONS {
        let mut next = vec![Complex64::ZERO; count];
        for row in rows {
            let along: Complex64 = row
                .values
                .iter()
                .zip(&vector)
                .map(|(x, v)| x.conj() * v)
                .sum();
            let along = along * row.weight;
            next.iter_mut()
                .zip(&row.values)
                .for_each(|(v, x)| *v += x * along);
        }
        let length = next.iter().map(|v| v.norm_sqr()).sum::<f64>().sqrt();
        if !(length > 0.0 && length.is_finite()) {
            return vec![0.0; count];
        }
        let scale = (count as f64).sqrt() / length;
        next.iter_mut().for_each(|v| *v *= scale);
        let moved: f64 = next
            .iter()
            .zip(&vector)
            .map(|(a, b)| (a - b).norm_sqr())
            .sum();
        vector = next;
        if moved < STILL * count as f64 {
            break;
        }
    }
    vector.iter().map(|v| libm::atan2(v.im, v.re)).collect()
}

/// Low-pass filter that keeps frequencies below `width / 2` cycles per pulse; `width` from 0 to 1 (all). This is PGA's window around a
/// centred point. Ends are padded against wrap-around.
pub(crate) fn low_pass(values: &mut [Complex64], width: f64) {
    if width >= 1.0 || values.is_empty() {
        return;
    }
    let length = fast_length(2 * values.len());
    let mut spectrum = vec![Complex64::ZERO; length];
    spectrum[..values.len()].copy_from_slice(values);
    forward::<f64>(length).process(&mut spectrum);
    let half = ((0.5 * width * length as f64).ceil() as usize).max(1);
    for (i, value) in spectrum.iter_mut().enumerate() {
        let away = i.min(length - i);
        // A Hann edge of a quarter of the width avoids ringing.
        let edge = (away as f64 - 0.75 * half as f64) / (0.5 * half as f64);
        *value *= match edge {
            e if e <= 0.0 => 1.0,
            e if e >= 1.0 => 0.0,
            e => 0.5 + 0.5 * libm::cos(std::f64::consts::PI * e),
        };
    }
    inverse::<f64>(length).process(&mut spectrum);
    let scale = 1.0 / length as f64;
    for (value, kept) in values.iter_mut().zip(spectrum) {
        *value = kept * scale;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chance::gauss;
    use subaperture_signal::phase::cis;

    fn random(seed: u64) -> impl FnMut() -> f64 {
        let mut state = seed;
        move || gauss(&mut state)
    }

    /// Rows of amplitude 1 with a random constant phase each, the phase errors `phases`, and noise of power `noise`.
    fn rows(phases: &[f64], noise: &[f64], seed: u64) -> Vec<Row> {
        let mut gauss = random(seed);
        let row = |&noise: &f64| {
            let own = 7.0 * gauss();
            let mut value = |&phase: &f64| {
                let error = Complex64::new(gauss(), gauss()) * (noise / 2.0).sqrt();
                cis(phase + own) + error
            };
            Row {
                values: phases.iter().map(&mut value).collect(),
                weight: 1.0 / noise,
            }
        };
        noise.iter().map(row).collect()
    }

    fn variance(found: &[f64], truth: &[f64]) -> f64 {
        let left: Vec<f64> = found.iter().zip(truth).map(|(a, b)| a - b).collect();
        let mean: Complex64 = left.iter().map(|&x| cis(x)).sum();
        let mean = mean.im.atan2(mean.re);
        let squares = left
            .iter()
            .map(|x| super::super::correction::wrap(x - mean).powi(2));
        squares.sum::<f64>() / left.len() as f64
    }

    #[test]
    fn eigenvector_reaches_cramer_rao_bound() {
        let count = 400;
        let mut gauss = random(3);
        let truth: Vec<f64> = (0..count).map(|_| 2.0 * gauss()).collect();
        // Signal-to-noise ratio per pulse: 2 x 5 + 8 x 1 + 10 x 0.1 = 19; with equal weights of the rows it would be less than 9.
        let noise: Vec<f64> = [vec![0.2; 2], vec![1.0; 8], vec![10.0; 10]].concat();
        let total: f64 = noise.iter().map(|s| 1.0 / s).sum();
        let bound = 1.0 / (2.0 * total);
        let mut sum = 0.0;
        for seed in 0..8 {
            let rows = rows(&truth, &noise, 100 + seed);
            sum += variance(&phases_rad(Estimator::Eigenvector, &rows, count), &truth);
        }
        let mean = sum / 8.0;
        println!("variance {mean:.4} rad^2, bound {bound:.4}");
        // 3200 phases determine a variance to 2.5 %. The mean phase is fitted (1 of 400), the constant phases of 20 rows are estimated
        // to 1/400, and the argument of a Gaussian at a signal-to-noise ratio of 19 has a larger variance by 1 / (2 x 19).
        assert!(mean < 1.12 * bound && mean > 0.9 * bound, "{mean} {bound}");
        let rows = rows(&truth, &noise, 100);
        let steps = variance(&phases_rad(Estimator::Gradient, &rows, count), &truth);
        assert!(steps > 2.0 * mean, "{steps}: steps add their errors up");
    }

    #[test]
    fn both_estimators_recover_smooth_phase() {
        let truth: Vec<f64> = (0..300)
            .map(|n| 9.0 * (f64::from(n) / 40.0).sin())
            .collect();
        let rows = rows(&truth, &[0.01; 6], 1);
        for estimator in [Estimator::Gradient, Estimator::Eigenvector] {
            let found = phases_rad(estimator, &rows, truth.len());
            // Errors of steps accumulate: a random walk of 300 steps of variance 1 / 1200 has a variance about its mean of
            // 300 / 6 times that.
            assert!(variance(&found, &truth) < 0.15, "{estimator}");
        }
        assert_eq!(phases_rad(Estimator::Eigenvector, &[], 3), [0.0; 3]);
    }

    #[test]
    fn low_pass_keeps_slow_phases() {
        let tone = |cycles: f64| -> Vec<Complex64> {
            (0..256)
                .map(|n| cis(std::f64::consts::TAU * cycles * f64::from(n)))
                .collect()
        };
        let power = |values: &[Complex64]| {
            values[32..224].iter().map(|v| v.norm_sqr()).sum::<f64>() / 192.0
        };
        let mut slow = tone(0.02);
        low_pass(&mut slow, 0.1);
        let mut fast = tone(0.2);
        low_pass(&mut fast, 0.1);
        assert!((power(&slow) - 1.0).abs() < 0.02, "{}", power(&slow));
        assert!(power(&fast) < 1e-3, "{}", power(&fast));
    }
}
