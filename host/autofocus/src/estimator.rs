//! Estimators of the phase error common to the histories of several points.
//!
//! Of rows `x_i` (a point's history each, centred, low-passed) with errors of power `s_i` around a constant times `exp(j phi)`:
//!
//! - [`Estimator::Gradient`], C (6.5) to (6.8): the phase's step from pulse to pulse, summed up. C takes
//!   `sum Im(x* x') / sum |x|^2` of a derivative by a transform, which is right for small steps; here the step is
//!   `arg sum_i x_i*[n] x_i[n+1] / s_i`, the maximum-likelihood estimate of a difference of any size. Errors add up from pulse to pulse.
//! - [`Estimator::Eigenvector`]: the phases of the `v` that makes `sum_i |v^H x_i|^2 / s_i` largest, the maximum-likelihood estimate of all
//!   phases at once (Jakowatz and Wahl, Eigenvector method for maximum-likelihood estimation of phase errors in
//!   SAR imagery, 1993): the dominant eigenvector of the rows' covariance, found by power iteration on the rows, so that no
//!   matrix is made. From all pairs of pulses, not from neighbours alone.
//!
//! With a total of `S = sum_i a_i / s_i` signal to noise a pulse the variance of a phase is no less than `1 / (2 S)` (Cramér and Rao).
//! The eigenvector reaches it within the accuracy of a test on 3200 phases (below).

use std::fmt;
use std::str::FromStr;

use num_complex::Complex64;

use subaperture_fft::{forward, inverse};
use subaperture_signal::fast_length::fast_length;

/// Phase estimator of [`PhaseGradient`](super::PhaseGradient).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Estimator {
    /// Phase difference of neighbouring pulses by maximum likelihood, summed up. Needs bright points of high signal-to-noise ratio, for errors
    /// add up from pulse to pulse; the cheapest. Use it to compare with Chim's results.
    Gradient,
    /// All phases at once by maximum likelihood, from bright points: the dominant eigenvector of their covariance. Use it over wide angles, in
    /// near scenes and for errors that are independent from pulse to pulse. Texture without bright points is not focused.
    Eigenvector,
    /// Likelihood of all range cells, points, texture and clutter alike, as curves that are as smooth as held-out data require. The
    /// default, and the most accurate on small far scenes. Falls back on [`Estimator::Eigenvector`] where the geometry leaves too few cells.
    #[default]
    Likelihood,
}

/// An estimator's name is not one of the known ones.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("estimator '{0}': write likelihood, eigenvector or gradient")]
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
    /// A value a pulse.
    pub(crate) values: Vec<Complex64>,
    /// One over the power of its errors.
    pub(crate) weight: f64,
}

/// Power iterations at most, and how still the vector is when they end: far below any error.
const ITERATIONS: usize = 200;
const STILL: f64 = 1e-10;

/// The common phases, radians; zeros of no rows.
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
    // Histories are centred: that there is no error is a start that no eigenvector of use is orthogonal to.
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

/// Low-pass filter: keep frequencies below `width / 2` cycles per pulse; `width` from 0 to 1 (all). PGA's window around a point at
/// zero. Ends are padded, so that the one does not run into the other.
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
        // A Hann edge of a quarter of the width keeps rings away.
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

    /// Rows of amplitude 1 with a random phase each, in noise of power `noise`, under `phases`.
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
    fn the_eigenvector_reaches_the_bound() {
        let count = 400;
        let mut gauss = random(3);
        let truth: Vec<f64> = (0..count).map(|_| 2.0 * gauss()).collect();
        // Signal to noise a pulse: 2 x 5 + 8 x 1 + 10 x 0.1 = 19; by rows weighed alike it would be less than 9.
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
        // 3200 phases determine a variance to 2.5 %. The mean phase is fitted (1 of 400), 20 rows' own phases are known to
        // 1/400, and the arc of a Gaussian at a signal to noise of 19 is wider by 1 / (2 x 19) of itself.
        assert!(mean < 1.12 * bound && mean > 0.9 * bound, "{mean} {bound}");
        let rows = rows(&truth, &noise, 100);
        let steps = variance(&phases_rad(Estimator::Gradient, &rows, count), &truth);
        assert!(steps > 2.0 * mean, "{steps}: steps add their errors up");
    }

    #[test]
    fn both_follow_a_smooth_phase() {
        let truth: Vec<f64> = (0..300)
            .map(|n| 9.0 * (f64::from(n) / 40.0).sin())
            .collect();
        let rows = rows(&truth, &[0.01; 6], 1);
        for estimator in [Estimator::Gradient, Estimator::Eigenvector] {
            let found = phases_rad(estimator, &rows, truth.len());
            // By steps errors add up: 600 of 1 / (2 x 600), a walk of 1 / 1200 a step has a variance about its mean of
            // 300 / 6 of that.
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
