//! Antenna tracks of a block of pulses after repeated decimation by two.
//!
//! Decimation keeps every other pulse at its position. At `W - 2` output positions beyond each end the kernel extends past
//! the data, and no antenna position exists: the track is extrapolated by a least-squares polynomial through the pulses near the end
//! (Forsythe's orthogonal polynomials on evenly spaced nodes). Among degrees that fit about equally well, the lowest is used, since it
//! extrapolates with the least growth. No echoes were recorded there; only smoothness of the paths matters.
//!
//! **Roughness.** Interpolation of the omitted pulses is exact as far as paths to the pixels of a patch, relative to the path to its centre, change
//! smoothly from pulse to pulse. The deviation from smoothness is measured as the distance `m`, metres, of each antenna from the fifth-degree polynomial through
//! the six retained positions around it (Lagrange weights 3, -25, 150, 150, -25, 3 over 256). It rotates the phase of a term by at most
//!
//! ```text
//! 2 pi f / c (|m(transmitter)| / d + |m(receiver)| / d) |p - q|
//! ```
//!
//! for a pixel `p` of a patch about `q` at a distance `d` from the antennas: the angle between the lines of sight to both is at most
//! `|p - q| / d`.

use std::ops::Range;

use glam::DVec3;

use subaperture_kernels::decimation::halved;
use subaperture_model::phase_history::Pulse;

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

/// Block of pulses and its decimations by 1, 2, 4, ...
pub(super) struct Stretch {
    pub(super) pulses: Range<usize>,
    pub(super) thinned: Vec<Thinned>,
}

impl Stretch {
    /// Decimate `pulses` of the recorded ones with these taps while it is profitable.
    pub(super) fn new(recorded: &[Pulse], pulses: Range<usize>, taps: &[f32]) -> Self {
        let antennas = recorded[pulses.clone()].iter();
        let first = Thinned {
            antennas: antennas.map(|p| [p.transmitter_m, p.receiver_m]).collect(),
            weights: vec![1.0; pulses.len()],
            roughness_m: 0.0,
        };
        let mut thinned = vec![first];
        while let Some(last) = thinned.last()
            && pays(last.antennas.len(), taps.len())
        {
            thinned.push(last.halved(taps));
        }
        Self { pulses, thinned }
    }
}

/// Largest ratio of output to input length for a profitable decimation.
const WORTHWHILE: f64 = 0.8;

/// Whether decimating `count` samples reduces their number enough.
pub(super) fn pays(count: usize, taps: usize) -> bool {
    halved(count, taps) as f64 <= WORTHWHILE * count as f64
}

impl Thinned {
    fn halved(&self, taps: &[f32]) -> Self {
        let before = &self.antennas;
        let (count, width) = (before.len(), taps.len());
        let fitted = count.min(FITTED * width);
        let ends = [Ending::new(&before[..fitted], 0), {
            let last = &before[count - fitted..];
            Ending::new(last, fitted - 1)
        }];
        let beyond = (count - fitted) as f64;
        let place = |i: usize| 2 * i as isize - (width - 2) as isize;
        let at = |place: isize| match usize::try_from(place) {
            Ok(place) if place < count => before[place],
            Ok(_) => ends[1].at(place as f64 - beyond),
            Err(_) => ends[0].at(place as f64),
        };
        let mut weights = vec![0.0; halved(count, width)];
        for (n, weight) in self.weights.iter().enumerate() {
            match n % 2 {
                0 => weights[n / 2 + width / 2 - 1] += weight,
                _ => {
                    for (new, tap) in weights[n / 2..].iter_mut().zip(taps) {
                        *new += f64::from(tap * tap) * weight;
                    }
                }
            }
        }
        Self {
            antennas: (0..weights.len()).map(|i| at(place(i))).collect(),
            weights,
            roughness_m: self.roughness_m(),
        }
    }

    /// RMS deviation of the odd pulses from the interpolation of even ones, metres.
    fn roughness_m(&self) -> f64 {
        let (mut squares, mut count) = (0.0, 0usize);
        for around in self.antennas.windows(11).step_by(2) {
            let miss_m = |leg: usize| {
                let even = |i: usize| around[i][leg];
                let outer = (even(0) + even(10)) * 3.0 - (even(2) + even(8)) * 25.0;
                let between = (outer + (even(4) + even(6)) * 150.0) / 256.0;
                between.distance(around[5][leg])
            };
            squares += (miss_m(0) + miss_m(1)).powi(2);
            count += 1;
        }
        (squares / count.max(1) as f64).sqrt()
    }
}

/// Extrapolation of the antenna track beyond an end.
struct Ending([Polynomial; 2]);

impl Ending {
    /// Fit a polynomial to the given pulses that passes exactly through pulse `end`.
    fn new(antennas: &[Antennas], end: usize) -> Self {
        Self([0, 1].map(|leg| {
            let positions: Vec<DVec3> = antennas.iter().map(|a| a[leg]).collect();
            let mut fit = Polynomial::best(&positions);
            fit.origin += positions[end] - fit.at(end as f64);
            fit
        }))
    }

    fn at(&self, u: f64) -> Antennas {
        [0, 1].map(|leg| self.0[leg].at(u))
    }
}

/// Least-squares polynomial through positions at `u = 0, 1, ..`, in the orthogonal polynomials
/// `p_(j+1) = s p_j - b_j p_(j-1)` of `s = (2 u - M + 1) / M`.
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
        let misfit_m = |fit: &Self| {
            let each = positions.iter().enumerate();
            let squares = each.map(|(u, at)| fit.at(u as f64).distance_squared(*at));
            (squares.sum::<f64>() / positions.len() as f64).sqrt()
        };
        let fits = (0..=most).map(|degree| Self::new(positions, degree));
        let fits: Vec<(Self, f64)> = fits
            .map(|fit| (misfit_m(&fit), fit))
            .map(|(m, f)| (f, m))
            .collect();
        let best_m = fits.iter().map(|(_, m)| *m).fold(f64::INFINITY, f64::min);
        // Deviations of a hundredth of a micrometre are negligible at any frequency.
        let enough_m = best_m * ABOUT_AS_WELL + 1e-8;
        let good = fits.into_iter().find(|(_, m)| *m <= enough_m);
        good.map_or_else(|| Self::new(positions, 0), |(fit, _)| fit)
    }

    fn new(positions: &[DVec3], most: usize) -> Self {
        let mut fit = Self {
            // Positions are relative to one of them, to keep digits far from the scene origin.
            origin: positions[0],
            count: positions.len() as f64,
            recurrence: [0.0; DEGREE + 1],
            coefficients: [DVec3::ZERO; DEGREE + 1],
        };
        let mut norm_before = 0.0;
        for degree in 0..=most.min(positions.len() - 1) {
            let (mut norm, mut sum) = (0.0, DVec3::ZERO);
            for (u, position) in positions.iter().enumerate() {
                let value = fit.basis(u as f64)[degree];
                norm += value * value;
                sum += (*position - fit.origin) * value;
            }
            fit.coefficients[degree] = sum / norm;
            if degree > 0 {
                fit.recurrence[degree] = norm / norm_before;
            }
            norm_before = norm;
        }
        fit
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
    use super::*;

    #[test]
    fn quintic_is_fitted_and_extrapolated() {
        let curve = |u: f64| {
            let s = u / 100.0 - 0.7;
            DVec3::new(1e4 + s.powi(5), 3.0 * s * s, -s.powi(3) + s)
        };
        let positions: Vec<DVec3> = (0..150).map(|n| curve(f64::from(n))).collect();
        let fit = Polynomial::new(&positions, DEGREE);
        for u in [-40.0, 0.0, 33.3, 149.0, 190.0] {
            assert!(fit.at(u).distance(curve(u)) < 1e-8, "{u}");
        }
        // Few pulses: interpolate all of them.
        let few = Polynomial::new(&positions[..3], DEGREE);
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
        let taps = [0.01, -0.05, 0.1, 0.44, 0.44, 0.1, -0.05, 0.01];
        let half = thinned.halved(&taps);
        assert_eq!(half.antennas.len(), 107);
        for (i, [at, _]) in half.antennas.iter().enumerate() {
            let u = 2.0 * i as f64 - 6.0;
            // Beyond the ends: extrapolation by a polynomial through 24 pulses.
            let allowed = if (0.0..=200.0).contains(&u) {
                0.0
            } else {
                2e-3
            };
            assert!(at.distance(curve(u)) <= allowed, "{i}");
        }
        assert!(half.roughness_m < 1e-8);
        let power: f64 = half.weights.iter().sum();
        let of_taps: f64 = taps.iter().map(|t| f64::from(t * t)).sum();
        assert!((power - 101.0 - 100.0 * of_taps).abs() < 1e-9);
    }

    #[test]
    fn roughness_measures_deviation_from_smooth_track() {
        let jitter_m = 1e-3;
        let antennas = (0..300).map(|n| {
            let off_m = if n % 2 == 0 { 0.0 } else { jitter_m };
            [
                DVec3::new(f64::from(n), off_m, 0.0),
                DVec3::new(f64::from(n), 0.0, 0.0),
            ]
        });
        let thinned = Thinned {
            antennas: antennas.collect(),
            weights: vec![1.0; 300],
            roughness_m: 0.0,
        };
        assert!((thinned.roughness_m() / jitter_m - 1.0).abs() < 1e-9);
    }
}
