//! Minimisation over phases for one set of carriers; equations in the parent module.

use num_complex::Complex64;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_signal::dense::Factor;
use subaperture_signal::phase::{cis, phasor};

use super::Leakage;
use crate::profile::error::ProfileError;
use crate::profile::gaps::covariance;

/// Noise relative to the echoes' power in a carrier.
const NOISE: f64 = 1e-4;
/// Alternations between responses and phases before the Gauss-Newton steps.
const ALTERNATIONS: usize = 8;
/// Maximum number of Gauss-Newton steps.
const MAX_STEPS: usize = 40;
/// Smallest relative decrease of the cost for another step.
const MIN_GAIN: f64 = 1e-6;

/// One vector per receiver.
type Both = [Vec<Complex64>; 2];

/// Quantities common to all sweeps with the same carriers.
#[derive(Debug)]
pub(super) struct Phases {
    /// Indices of the known carriers.
    pub(super) known: Vec<usize>,
    /// `P` relative to the middle of the echoes' delays, where it is real.
    inverse: Vec<f64>,
    /// Phase factors that shift each receiver's values to that middle.
    centring: Both,
    /// Leakage response `l`, shifted to that middle.
    shape: Both,
    /// `P l`.
    weighed: Both,
    /// `l^H P l`.
    norm: [f64; 2],
}

/// Solution for a sweep.
pub(super) struct Solved {
    /// Echoes divided by the leakage.
    pub(super) over_leakage: Both,
    pub(super) amplitudes: [Complex64; 2],
    /// Powers summed over carriers and receivers.
    pub(super) leakage: f64,
    pub(super) echoes: f64,
    pub(super) residual: f64,
}

impl Phases {
    /// Prepare for echoes with ranges `span_m` (minimum and maximum, metres) beyond the direct wave.
    pub(super) fn new(
        leakage: &Leakage,
        step_hz: f64,
        known: Vec<usize>,
        frequencies_hz: &[f64],
        span_m: (f64, f64),
    ) -> Result<Self, ProfileError> {
        let k = known.len();
        let last = known.last().map_or(0, |n| n + 1);
        let share = step_hz * 2.0 * (span_m.1 - span_m.0) / SPEED_OF_LIGHT_M_S;
        let covariance = covariance(last, share);
        let mut matrix = vec![0.0; k * k];
        for (i, &a) in known.iter().enumerate() {
            for (j, &b) in known.iter().enumerate() {
                matrix[i * k + j] = covariance[a.abs_diff(b)];
            }
            matrix[i * k + i] += NOISE;
        }
        let Some(factor) = Factor::new(k, &matrix, 0.0) else {
            return Err(ProfileError::Options(
                "singular covariance of the carriers".to_owned(),
            ));
        };
        let inverse = factor.inverse();
        let middle_s = (span_m.0 + span_m.1) / SPEED_OF_LIGHT_M_S;
        let centring = [0, 1].map(|i| {
            let delay_s = leakage.delays_s[i] + middle_s;
            let turns = frequencies_hz.iter().map(|hz| phasor(hz * delay_s));
            turns.collect::<Vec<_>>()
        });
        let shape = [0, 1].map(|i| {
            let own = |place: usize| match &leakage.shapes {
                Some(shapes) => shapes[i][known[place]],
                None => phasor(-frequencies_hz[place] * leakage.delays_s[i]),
            };
            let turned = (0..k).map(|place| own(place) * centring[i][place]);
            turned.collect::<Vec<_>>()
        });
        let weighed = [0, 1].map(|i| product(&inverse, &shape[i]));
        let norm = [0, 1].map(|i| dot(&shape[i], &weighed[i]).re);
        if norm.iter().any(|norm| *norm <= 0.0 || !norm.is_finite()) {
            return Err(ProfileError::Options(
                "the leakage is zero or not finite: it cannot be the reference".to_owned(),
            ));
        }
        Ok(Self {
            known,
            inverse,
            centring,
            shape,
            weighed,
            norm,
        })
    }

    /// Leakage amplitude in phase-corrected values.
    fn amplitude(&self, i: usize, a: &[Complex64]) -> Complex64 {
        dot(&self.weighed[i], a) / self.norm[i]
    }

    /// `Q_i a_i`.
    fn weigh(&self, a: &Both) -> Both {
        [0, 1].map(|i| {
            let mut product = product(&self.inverse, &a[i]);
            let amplitude = self.amplitude(i, &a[i]);
            for (p, w) in product.iter_mut().zip(&self.weighed[i]) {
                *p -= w * amplitude;
            }
            product
        })
    }

    pub(super) fn solve(&self, z: &Both) -> Solved {
        // Start from the receiver whose power varies less over the carriers: its echoes are weaker.
        let spread = |i: usize| {
            let powers = || {
                z[i].iter()
                    .zip(&self.shape[i])
                    .map(|(z, l)| z.norm_sqr() / l.norm_sqr().max(f64::MIN_POSITIVE))
            };
            let count = z[i].len() as f64;
            let mean = powers().sum::<f64>() / count;
            powers().map(|p| (p - mean).powi(2)).sum::<f64>() / (count * mean * mean)
        };
        let i = usize::from(spread(1) < spread(0));
        let mut a = [0, 1].map(|i| -> Vec<Complex64> {
            z[i].iter()
                .zip(&self.centring[i])
                .map(|(z, turn)| z * turn)
                .collect()
        });
        let first: Vec<f64> = a[i]
            .iter()
            .zip(&self.shape[i])
            .map(|(a, l)| argument(a * l.conj()))
            .collect();
        a = turned(&a, &first);
        let mut weighed = self.weigh(&a);
        for _ in 0..ALTERNATIONS {
            let off = |n: usize| {
                let each = [0, 1].map(|i| a[i][n] * (a[i][n] - weighed[i][n] * NOISE).conj());
                argument(each[0] + each[1])
            };
            let off: Vec<f64> = (0..a[0].len()).map(off).collect();
            a = turned(&a, &off);
            weighed = self.weigh(&a);
        }
        self.newton(&mut a, &mut weighed);
        self.parts(&a, &weighed)
    }

    /// Gauss-Newton steps with Levenberg-Marquardt damping.
    fn newton(&self, a: &mut Both, weighed: &mut Both) {
        let k = self.known.len();
        let (mut damping, mut sum) = (1e-3, cost(a, weighed));
        for _ in 0..MAX_STEPS {
            let gradient: Vec<f64> = (0..k)
                .map(|n| {
                    -2.0 * [0, 1]
                        .map(|i| (a[i][n].conj() * weighed[i][n]).im)
                        .iter()
                        .sum::<f64>()
                })
                .collect();
            let curvature = self.curvature(a);
            let mean = (0..k).map(|n| curvature[n * k + n]).sum::<f64>() / k as f64;
            let better = (0..8).find_map(|_| {
                let mut damped = curvature.clone();
                (0..k).for_each(|n| damped[n * k + n] += damping * mean);
                let step = Factor::new(k, &damped, 0.0).and_then(|factor| factor.solved(&gradient));
                let tried = step.map(|step| {
                    let back: Vec<f64> = step.iter().map(|s| -s).collect();
                    let tried = turned(a, &back);
                    let weighed = self.weigh(&tried);
                    (cost(&tried, &weighed), tried, weighed)
                });
                let tried = tried.filter(|(new, ..)| *new < sum);
                damping = match tried {
                    Some(_) => (damping * 0.1).max(1e-12),
                    None => damping * 10.0,
                };
                tried
            });
            let Some((new, next, next_weighed)) = better else {
                return;
            };
            let gain = (sum - new) / new.max(f64::MIN_POSITIVE);
            (*a, *weighed, sum) = (next, next_weighed, new);
            if gain < MIN_GAIN {
                return;
            }
        }
    }

    /// `2 Re sum_i conj(a_m) Q_mn a_n`.
    fn curvature(&self, a: &Both) -> Vec<f64> {
        let k = self.known.len();
        let mut matrix = vec![0.0; k * k];
        for i in [0, 1] {
            let along: Vec<Complex64> = a[i]
                .iter()
                .zip(&self.weighed[i])
                .map(|(a, w)| a.conj() * w)
                .collect();
            let share = 1.0 / self.norm[i];
            for m in 0..k {
                let (row, inverse) = (&mut matrix[m * k..][..=m], &self.inverse[m * k..][..=m]);
                let (am, wm) = (a[i][m], along[m] * share);
                for (n, (entry, p)) in row.iter_mut().zip(inverse).enumerate() {
                    let (an, wn) = (a[i][n], along[n]);
                    let apart = am.re * an.re + am.im * an.im;
                    *entry += 2.0 * (p * apart - (wm.re * wn.re + wm.im * wn.im));
                }
            }
        }
        matrix
    }

    fn parts(&self, a: &Both, weighed: &Both) -> Solved {
        let amplitudes = [0, 1].map(|i| self.amplitude(i, &a[i]));
        let (mut leakage, mut echoes, mut residual) = (0.0, 0.0, 0.0);
        let over_leakage = [0, 1].map(|i| {
            let each = a[i].iter().zip(&self.shape[i]).zip(&weighed[i]);
            each.map(|((a, l), w)| {
                let direct = l * amplitudes[i];
                leakage += direct.norm_sqr();
                echoes += (a - direct).norm_sqr();
                residual += (w * NOISE).norm_sqr();
                (a - direct) / direct
            })
            .collect()
        });
        Solved {
            over_leakage,
            amplitudes,
            leakage,
            echoes,
            residual,
        }
    }
}

/// Values of both receivers times `exp(-j phases)`.
fn turned(a: &Both, phases: &[f64]) -> Both {
    let turns: Vec<Complex64> = phases.iter().map(|phase| cis(-phase)).collect();
    [0, 1].map(|i| a[i].iter().zip(&turns).map(|(a, turn)| a * turn).collect())
}

fn cost(a: &Both, weighed: &Both) -> f64 {
    [0, 1].map(|i| dot(&a[i], &weighed[i]).re).iter().sum()
}

fn argument(z: Complex64) -> f64 {
    libm::atan2(z.im, z.re)
}

/// `a^H b`.
fn dot(a: &[Complex64], b: &[Complex64]) -> Complex64 {
    a.iter().zip(b).map(|(a, b)| a.conj() * b).sum()
}

/// Product of a real row-major matrix and a vector.
fn product(matrix: &[f64], x: &[Complex64]) -> Vec<Complex64> {
    let row = |row: &[f64]| row.iter().zip(x).map(|(m, x)| x * m).sum();
    matrix.chunks_exact(x.len()).map(row).collect()
}
