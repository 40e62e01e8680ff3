//! Joint estimation of point scatterers in a frequency response.
//!
//! Side lobes of other echoes displace the peak of an echo in a range profile. Here all echoes are estimated together
//! by least squares over the measured frequencies `f_n`, with `f_c` their mean:
//!
//! ```text
//! z_n = sum_k a_k exp(-j 4 pi (f_n - f_c) r_k / c) + w_n            w_n white noise
//! ```
//!
//! This is RELAX (Li and Stoica, "Efficient mixed-spectrum estimation with applications to target feature extraction",
//! IEEE Transactions on Signal Processing 44, 1996): the strongest echo of the residual is added, and the ranges and
//! amplitudes of all are adjusted by Gauss-Newton. It ends when the largest peak of the residual is explained by noise
//! (Fisher's test of the periodogram at a probability of false alarm of 0.001), is below the floor, or is within a
//! resolution cell of an echo.
//!
//! Standard deviations are from the inverse of the normal matrix (the Cramer-Rao bound) with the variance of the
//! residual. They contain noise only: a scatterer that is not a point, such as a wall, has a further error.

use num_complex::Complex64;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_signal::dense::Factor;
use subaperture_signal::phase::phasor;
use subaperture_signal::window::Window;

use super::error::ProfileError;
use super::sweep::Sweep;
use super::transform::Profile;

/// Largest number of scatterers.
const MOST: usize = 16;
/// Probability that noise alone is taken for a scatterer.
const FALSE_ALARM: f64 = 1e-3;
/// Gauss-Newton steps after a scatterer is added.
const STEPS: usize = 12;
/// Step of the ranges, in resolution cells, below which the adjustment has converged.
const CONVERGED: f64 = 1e-9;
/// Profile samples per resolution cell in the search for a further scatterer.
const FINENESS: usize = 8;

/// Point scatterer in a frequency response.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointScatterer {
    /// Range, metres.
    pub range_m: f64,
    /// Standard deviation of the range by noise, metres.
    pub sigma_m: f64,
    /// Complex amplitude: the response is `amplitude exp(-j 4 pi f range / c)`.
    pub amplitude: Complex64,
}

/// Echo during the adjustment: range in resolution cells, and amplitude at the mean frequency.
#[derive(Clone, Copy)]
struct Echo {
    cells: f64,
    amplitude: Complex64,
}

/// Measured values with their frequencies relative to the mean, in cycles for one resolution cell of range.
struct Response {
    cycles: Vec<f64>,
    values: Vec<Complex64>,
}

impl Response {
    fn unit(&self, n: usize, cells: f64) -> Complex64 {
        phasor(-self.cycles[n] * cells)
    }

    /// Values minus the echoes.
    fn residual(&self, echoes: &[Echo]) -> Vec<Complex64> {
        let one = |n: usize| {
            let model: Complex64 = (echoes.iter())
                .map(|echo| echo.amplitude * self.unit(n, echo.cells))
                .sum();
            self.values[n] - model
        };
        (0..self.values.len()).map(one).collect()
    }

    /// Derivatives of value `n`: by range, real and imaginary part of the amplitude of each echo.
    fn derivatives(&self, n: usize, echoes: &[Echo], row: &mut Vec<Complex64>) {
        row.clear();
        for echo in echoes {
            let unit = self.unit(n, echo.cells);
            let by_range = Complex64::new(0.0, -std::f64::consts::TAU * self.cycles[n]);
            row.extend([echo.amplitude * unit * by_range, unit, unit * Complex64::I]);
        }
    }

    /// Cholesky factor of the normal matrix, and the gradient. `None` if the echoes cannot be separated.
    fn normal(&self, echoes: &[Echo], residual: &[Complex64]) -> Option<(Factor, Vec<f64>)> {
        let size = 3 * echoes.len();
        let (mut matrix, mut right) = (vec![0.0; size * size], vec![0.0; size]);
        let mut row = Vec::with_capacity(size);
        for (n, left) in residual.iter().enumerate() {
            self.derivatives(n, echoes, &mut row);
            for (i, a) in row.iter().enumerate() {
                right[i] += (a.conj() * left).re;
                for (j, b) in row[..=i].iter().enumerate() {
                    matrix[i * size + j] += a.re * b.re + a.im * b.im;
                }
            }
        }
        Some((Factor::new(size, &matrix, 1e-12)?, right))
    }

    /// Adjust the echoes by Gauss-Newton; `None` if they cannot be separated.
    fn adjusted(&self, mut echoes: Vec<Echo>) -> Option<Vec<Echo>> {
        for _ in 0..STEPS {
            let (factor, right) = self.normal(&echoes, &self.residual(&echoes))?;
            let step = factor.solved(&right)?;
            let mut largest = 0.0_f64;
            for (echo, step) in echoes.iter_mut().zip(step.chunks(3)) {
                // The search leaves a sixteenth of a cell, so that larger steps come from far beyond the linear part.
                echo.cells += step[0].clamp(-0.25, 0.25);
                echo.amplitude += Complex64::new(step[1], step[2]);
                largest = largest.max(step[0].abs());
            }
            if largest < CONVERGED {
                break;
            }
        }
        Some(echoes)
    }
}

/// Whether noise alone has a periodogram peak of this fraction of its power in one of `cells` cells with a probability
/// above [`FALSE_ALARM`]; with `free` complex degrees of freedom.
fn is_noise(fraction: f64, free: f64, cells: f64) -> bool {
    cells.ln() + (free - 1.0) * (-fraction.min(1.0 - 1e-15)).ln_1p() > FALSE_ALARM.ln()
}

impl Sweep {
    /// Point scatterers down to `floor_db` dB below the strongest, in ascending range. At most 16, at least a resolution
    /// cell apart. Ranges beyond `reach_m` metres are given as negative: an echo that arrives before the reference
    /// appears at the far end of the unambiguous range.
    ///
    /// # Errors
    /// If more than a third of the carriers is missing.
    pub fn scatterers(
        &self,
        floor_db: f64,
        reach_m: f64,
    ) -> Result<Vec<PointScatterer>, ProfileError> {
        self.check()?;
        let count = self.values.len();
        let cell_m = SPEED_OF_LIGHT_M_S / (2.0 * self.step_hz * count as f64);
        let middle = (count as f64 - 1.0) / 2.0;
        let there = |(n, value): (usize, &Option<Complex64>)| value.map(|z| (n, z));
        let measured: Vec<_> = self.values.iter().enumerate().filter_map(there).collect();
        let response = Response {
            cycles: (measured.iter())
                .map(|(n, _)| (*n as f64 - middle) / count as f64)
                .collect(),
            values: measured.iter().map(|(_, z)| *z).collect(),
        };
        let places: Vec<usize> = measured.iter().map(|(n, _)| *n).collect();
        let mut echoes: Vec<Echo> = Vec::new();
        let most = MOST.min(response.values.len() / 6);
        while echoes.len() < most {
            let residual = response.residual(&echoes);
            let Some(next) = self.strongest(&places, &residual, &echoes) else {
                break;
            };
            let power: f64 = residual.iter().map(Complex64::norm_sqr).sum();
            let free = residual.len() as f64 - 1.5 * echoes.len() as f64;
            let fraction = next.amplitude.norm_sqr() * residual.len() as f64 / power;
            let top = echoes
                .iter()
                .map(|echo| echo.amplitude.norm())
                .fold(0.0, f64::max);
            let is_low = next.amplitude.norm() < top * 10f64.powf(-floor_db / 20.0);
            if power == 0.0 || is_low || is_noise(fraction, free, count as f64) {
                break;
            }
            let more = [echoes.as_slice(), &[next]].concat();
            let Some(more) = response.adjusted(more) else {
                break;
            };
            echoes = more;
        }
        Ok(self.stated(&response, &echoes, cell_m, reach_m))
    }

    /// Strongest peak of the residual, at least a resolution cell away from every echo.
    fn strongest(&self, places: &[usize], residual: &[Complex64], echoes: &[Echo]) -> Option<Echo> {
        let count = self.values.len();
        let mut values = vec![Complex64::ZERO; count];
        for (n, left) in places.iter().zip(residual) {
            values[*n] = *left;
        }
        let profile = Profile::new(&values, 0.0, self.step_hz, Window::None, FINENESS);
        // Missing carriers are zeros of the sum, which the profile divides by all of them.
        let scale = count as f64 / residual.len() as f64;
        let circular = |a: f64, b: f64| {
            let apart = (a - b).rem_euclid(count as f64);
            apart.min(count as f64 - apart)
        };
        let all = profile.values.iter().enumerate();
        all.map(|(i, z)| (i as f64 / FINENESS as f64, z))
            .filter(|(cells, _)| {
                echoes
                    .iter()
                    .all(|echo| circular(*cells, echo.cells) >= 1.0)
            })
            .max_by(|(_, a), (_, b)| a.norm_sqr().total_cmp(&b.norm_sqr()))
            .map(|(cells, z)| Echo {
                cells,
                // The profile's phase is that at the first frequency.
                amplitude: scale * z * phasor(-(count as f64 - 1.0) / (2.0 * count as f64) * cells),
            })
    }

    /// Scatterers with standard deviations, in ascending range.
    fn stated(
        &self,
        response: &Response,
        echoes: &[Echo],
        cell_m: f64,
        reach_m: f64,
    ) -> Vec<PointScatterer> {
        let residual = response.residual(echoes);
        let free = (residual.len() as f64 - 1.5 * echoes.len() as f64).max(1.0);
        let variance = residual.iter().map(Complex64::norm_sqr).sum::<f64>() / free;
        let covariance = response
            .normal(echoes, &residual)
            .map(|(factor, _)| factor.inverse());
        let size = 3 * echoes.len();
        let count = self.values.len() as f64;
        let middle = (count - 1.0) / 2.0;
        let middle_hz = self.frequency_hz(0) + middle * self.step_hz;
        let one = |(k, echo): (usize, &Echo)| {
            // Ambiguities between the estimate and a range from just beyond the reach down by one ambiguity.
            let turns = (echo.cells - reach_m / cell_m).div_euclid(count) + 1.0;
            let is_within = echo.cells >= 0.0 && echo.cells * cell_m <= reach_m;
            let turns = if is_within { 0.0 } else { turns };
            let range_m = (echo.cells - turns * count) * cell_m;
            let own = covariance.as_ref().map(|all| all[3 * k * (size + 1)]);
            PointScatterer {
                range_m,
                sigma_m: own.map_or(f64::INFINITY, |own| cell_m * (0.5 * variance * own).sqrt()),
                amplitude: echo.amplitude
                    * phasor(middle * turns + 2.0 * middle_hz * range_m / SPEED_OF_LIGHT_M_S),
            }
        };
        let mut all: Vec<PointScatterer> = echoes.iter().enumerate().map(one).collect();
        all.sort_by(|a, b| a.range_m.total_cmp(&b.range_m));
        all
    }
}
