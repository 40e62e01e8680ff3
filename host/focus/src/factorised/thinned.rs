//! Antenna tracks of a block of pulses after repeated decimation by two or three.
//!
//! Decimation keeps every second or third pulse at its position. At output positions beyond each end the kernel extends past
//! the data, and no antenna position exists: the track is extrapolated by a least-squares polynomial through the pulses near the end
//! (Forsythe's orthogonal polynomials on evenly spaced nodes). Among degrees that fit about equally well, the lowest is used, since it
//! extrapolates with the least growth. No echoes were recorded there; only smoothness of the paths matters.
//!
//! **Roughness.** Interpolation of the omitted pulses is exact as far as paths to the pixels of a patch, relative to the path to its centre, change
//! smoothly from pulse to pulse. The deviation from smoothness is measured as the distance `m`, metres, of each antenna from the fifth-degree polynomial through
//! the six retained positions around it. It rotates the phase of a term by at most
//!
//! ```text
//! 2 pi f / c (|m(transmitter)| / d + |m(receiver)| / d) |p - q|
//! ```
//!
//! for a pixel `p` of a patch about `q` at a distance `d` from the antennas: the angle between the lines of sight to both is at most
//! `|p - q| / d`.

use std::ops::Range;

use glam::DVec3;

use subaperture_kernels::decimation::decimated;
use subaperture_model::phase_history::Pulse;

use super::decimations::{Decimations, pays};

/// Highest degree of the extrapolation polynomials.
const DEGREE: usize = 5;
/// Minimum pulses per degree; fewer pulses would be interpolated rather than smoothed.
const PULSES_A_DEGREE: usize = 6;
/// Largest ratio of fit errors for which the lower degree is used.
const ABOUT_AS_WELL: f64 = 1.3;
/// Number of pulses fitted by a polynomial, in multiples of the kernel taps.
const FITTED: usize = 3;

/// Positions of transmitter and receiver, metres.
pub(super) type Antennas = [DVec3; 2];

/// Antennas and weights after a number of decimations.
pub(super) struct Thinned {
    pub(super) antennas: Vec<Antennas>,
    /// Power of a pulse relative to a recorded one: 1 for recorded pulses, the sum of squared kernel weights otherwise.
    pub(super) weights: Vec<f64>,
    /// RMS deviation from smoothness of the pulses omitted by the last decimation, metres, both antennas together.
    pub(super) roughness_m: f64,
}

/// Block of pulses and its repeated decimations, the recorded pulses first.
pub(super) struct Stretch {
    pub(super) pulses: Range<usize>,
    pub(super) thinned: Vec<Thinned>,
}

impl Stretch {
    /// Decimate `pulses` of the recorded ones while it is profitable.
    pub(super) fn new(recorded: &[Pulse], pulses: Range<usize>, decimations: &Decimations) -> Self {
        let antennas = recorded[pulses.clone()].iter();
        let first = Thinned {
            antennas: antennas.map(|p| [p.transmitter_m, p.receiver_m]).collect(),
            weights: vec![1.0; pulses.len()],
            roughness_m: 0.0,
        };
        let mut thinned = vec![first];
        while let Some(last) = thinned.last() {
            let factor = decimations.factor(0, thinned.len() - 1);
            if !pays(last.antennas.len(), factor, decimations.num_taps()) {
                break;
            }
            thinned.push(last.decimated(factor, decimations));
        }
        Self { pulses, thinned }
    }
}

impl Thinned {
    fn decimated(&self, factor: usize, decimations: &Decimations) -> Self {
        let before = &self.antennas;
        let (count, width) = (before.len(), decimations.num_taps());
        let fitted = count.min(FITTED * width);
        let ends = [Ending::new(&before[..fitted], 0), {
            let last = &before[count - fitted..];
            Ending::new(last, fitted - 1)
        }];
        let beyond = (count - fitted) as f64;
        let place = |i: usize| (factor * i) as isize - (factor * (width / 2 - 1)) as isize;
        let at = |place: isize| match usize::try_from(place) {
            Ok(place) if place < count => before[place],
            Ok(_) => ends[1].at(place as f64 - beyond),
            Err(_) => ends[0].at(place as f64),
        };
        let mut weights = vec![0.0; decimated(count, factor, width)];
        for (n, weight) in self.weights.iter().enumerate() {
            match n % factor {
                0 => weights[n / factor + width / 2 - 1] += weight,
                phase => {
                    let taps = decimations.taps(factor, phase);
                    for (new, tap) in weights[n / factor..].iter_mut().zip(taps) {
                        *new += f64::from(tap * tap) * weight;
                    }
                }
            }
        }
        Self {
            antennas: (0..weights.len()).map(|i| at(place(i))).collect(),
            weights,
            roughness_m: self.roughness_m(factor),
        }
    }

    /// RMS deviation of the omitted pulses from the interpolation of retained ones, metres.
    fn roughness_m(&self, factor: usize) -> f64 {
        let weights: Vec<[f64; 6]> = (1..factor)
            .map(|phase| lagrange(2.0 + phase as f64 / factor as f64))
            .collect();
        let (mut squares, mut count) = (0.0, 0usize);
        let monostatic = self.antennas.iter().all(|[t, r]| t == r);
        for around in self.antennas.windows(5 * factor + 1).step_by(factor) {
            for (phase, weights) in (1..).zip(&weights) {
                let miss_m = |leg: usize| {
                    let retained = around.iter().step_by(factor);
                    let terms = retained.zip(weights).map(|(a, &weight)| a[leg] * weight);
                    terms
                        .sum::<DVec3>()
                        .distance(around[2 * factor + phase][leg])
                };
                let transmitter_m = miss_m(0);
                let receiver_m = if monostatic { transmitter_m } else { miss_m(1) };
                squares += (transmitter_m + receiver_m).powi(2);
                count += 1;
            }
        }
        (squares / count.max(1) as f64).sqrt()
    }
}

/// Weights of values at 0, 1, .. in the polynomial through all of them at `u` (Lagrange).
fn lagrange<const N: usize>(u: f64) -> [f64; N] {
    std::array::from_fn(|i| {
        let others = (0..N).filter(|&j| j != i);
        let terms = others.map(|j| (u - j as f64) / (i as f64 - j as f64));
        terms.product()
    })
}

/// Extrapolation of the antenna track beyond an end.
struct Ending([Polynomial; 2]);

impl Ending {
    /// Fit a polynomial to the given pulses that passes exactly through pulse `end`.
    fn new(antennas: &[Antennas], end: usize) -> Self {
        let fit = |leg: usize| {
            let positions: Vec<DVec3> = antennas.iter().map(|a| a[leg]).collect();
            let mut fit = Polynomial::best(&positions);
            fit.origin += positions[end] - fit.at(end as f64);
            fit
        };
        let transmitter = fit(0);
        match antennas
            .iter()
            .all(|[transmitter, receiver]| transmitter == receiver)
        {
            true => Self([transmitter; 2]),
            false => Self([transmitter, fit(1)]),
        }
    }

    fn at(&self, u: f64) -> Antennas {
        [0, 1].map(|leg| self.0[leg].at(u))
    }
}

/// Least-squares polynomial through positions at `u = 0, 1, ..`, in the orthogonal polynomials
/// `p_(j+1) = s p_j - b_j p_(j-1)` of `s = (2 u - M + 1) / M`.
#[derive(Clone, Copy)]
struct Polynomial {
    origin: DVec3,
    count: f64,
    recurrence: [f64; DEGREE + 1],
    coefficients: [DVec3; DEGREE + 1],
}

impl Polynomial {
    /// Fit of the lowest degree that is about as good as any.
    fn best(positions: &[DVec3]) -> Self {
        let most = (positions.len() / PULSES_A_DEGREE).clamp(1, DEGREE);
        let (fit, misfits_m) = Self::fitted(positions, most);
        let best_m = misfits_m.iter().copied().fold(f64::INFINITY, f64::min);
        // Deviations of a hundredth of a micrometre are negligible at any frequency.
        let enough_m = best_m * ABOUT_AS_WELL + 1e-8;
        let good = misfits_m.iter().position(|m| *m <= enough_m);
        fit.truncated(good.unwrap_or(0))
    }

    /// Fit of degree `most` or of as many positions as there are, with the RMS residuals of the fits of all degrees up to it.
    fn fitted(positions: &[DVec3], most: usize) -> (Self, Vec<f64>) {
        let mut fit = Self {
            // Positions are relative to one of them, to keep digits far from the scene origin.
            origin: positions[0],
            count: positions.len() as f64,
            recurrence: [0.0; DEGREE + 1],
            coefficients: [DVec3::ZERO; DEGREE + 1],
        };
        let mut residuals: Vec<DVec3> = positions.iter().map(|p| *p - fit.origin).collect();
        let mut misfits_m = Vec::with_capacity(DEGREE + 1);
        let mut norm_before = 0.0;
        for degree in 0..=most.min(positions.len() - 1) {
            let basis: Vec<f64> = (0..positions.len())
                .map(|u| fit.basis(u as f64)[degree])
                .collect();
            let norm: f64 = basis.iter().map(|value| value * value).sum();
            let products = basis.iter().zip(&residuals).map(|(value, r)| *r * *value);
            let coefficient = products.sum::<DVec3>() / norm;
            for (residual, value) in residuals.iter_mut().zip(&basis) {
                *residual -= coefficient * *value;
            }
            fit.coefficients[degree] = coefficient;
            if degree > 0 {
                fit.recurrence[degree] = norm / norm_before;
            }
            norm_before = norm;
            let squares: f64 = residuals.iter().map(|r| r.length_squared()).sum();
            misfits_m.push((squares / fit.count).sqrt());
        }
        (fit, misfits_m)
    }

    /// Fit of a lower degree: the polynomials are orthogonal, so that its coefficients are the same.
    fn truncated(mut self, degree: usize) -> Self {
        self.coefficients[degree + 1..].fill(DVec3::ZERO);
        self
    }

    /// All polynomials at `u` for which the recurrence is known: `p_(j+1)` needs `b_j`.
    fn basis(&self, u: f64) -> [f64; DEGREE + 1] {
        let s = (2.0 * u - self.count + 1.0) / self.count;
        let mut basis = [1.0; DEGREE + 1];
        basis[1] = s;
        for j in 1..DEGREE {
            basis[j + 1] = s * basis[j] - self.recurrence[j] * basis[j - 1];
        }
        basis
    }

    fn at(&self, u: f64) -> DVec3 {
        let terms = self.basis(u).into_iter().zip(self.coefficients);
        self.origin + terms.map(|(value, c)| c * value).sum::<DVec3>()
    }
}

#[cfg(test)]
mod tests {
    use super::super::decimations::FACTORS;
    use super::*;
    use subaperture_signal::decimation_kernel::DecimationKernel;

    #[test]
    fn quintic_is_fitted_and_extrapolated() {
        let curve = |u: f64| {
            let s = u / 100.0 - 0.7;
            DVec3::new(1e4 + s.powi(5), 3.0 * s * s, -s.powi(3) + s)
        };
        let positions: Vec<DVec3> = (0..150).map(|n| curve(f64::from(n))).collect();
        let (fit, _) = Polynomial::fitted(&positions, DEGREE);
        for u in [-40.0, 0.0, 33.3, 149.0, 190.0] {
            assert!(fit.at(u).distance(curve(u)) < 1e-8, "{u}");
        }
        // Few pulses: interpolate all of them.
        let (few, _) = Polynomial::fitted(&positions[..3], DEGREE);
        assert!(few.at(2.0).distance(curve(2.0)) < 1e-8);
    }

    #[test]
    fn decimated_antennas_are_retained_and_extrapolated_smoothly() {
        let curve = |u: f64| {
            let s = u / 100.0;
            DVec3::new(20.0 * s, (3.0 * s).sin(), 100.0 + s * s)
        };
        let antennas: Vec<Antennas> = (0..201).map(|n| [curve(f64::from(n)); 2]).collect();
        let thinned = Thinned {
            weights: vec![1.0; antennas.len()],
            antennas,
            roughness_m: 0.0,
        };
        for factor in FACTORS {
            let width = 8;
            let kernels = FACTORS.map(|factor| DecimationKernel::new(factor, width, 0.28));
            let decimations = Decimations::new([3; 2], [factor; 2], &kernels);
            let after = thinned.decimated(factor, &decimations);
            assert_eq!(after.antennas.len(), 199 / factor + width);
            for (i, [at, _]) in after.antennas.iter().enumerate() {
                let u = factor as f64 * (i as f64 - (width / 2 - 1) as f64);
                // Beyond the ends: extrapolation by a polynomial through 3 W pulses, over a distance that grows with the factor.
                let allowed = if (0.0..=200.0).contains(&u) {
                    0.0
                } else {
                    1e-3 * (factor as f64).powi(3)
                };
                assert!(at.distance(curve(u)) <= allowed, "{factor}: {i}");
            }
            assert!(after.roughness_m < 1e-8 * (factor as f64).powi(3));
            let power: f64 = after.weights.iter().sum();
            let of_taps = |phase: usize| {
                let taps = decimations.taps(factor, phase);
                let squares: f32 = taps.map(|tap| tap * tap).sum();
                (201 - phase).div_ceil(factor) as f64 * f64::from(squares)
            };
            let expected = 201usize.div_ceil(factor) as f64 + (1..factor).map(of_taps).sum::<f64>();
            assert!((power / expected - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn roughness_measures_deviation_from_smooth_track() {
        for factor in FACTORS {
            roughness_is_the_offset_of_omitted_pulses(factor);
        }
    }

    fn roughness_is_the_offset_of_omitted_pulses(factor: usize) {
        let jitter_m = 1e-3;
        let antennas = (0..300).map(|n| {
            let off_m = if n % factor == 0 { 0.0 } else { jitter_m };
            [
                DVec3::new(n as f64, off_m, 0.0),
                DVec3::new(n as f64, 0.0, 0.0),
            ]
        });
        let thinned = Thinned {
            antennas: antennas.collect(),
            weights: vec![1.0; 300],
            roughness_m: 0.0,
        };
        assert!((thinned.roughness_m(factor) / jitter_m - 1.0).abs() < 1e-9);
    }
}
