//! MPGA between neighbouring pulses with exact path lengths, unbiased by errors of the directions, and with outliers excluded.
//!
//! ```text
//! y_c  =  phase_c(n) - phase_c(n-1)  =  f_c(x; P) + noise        f_c = -2 pi (path_c(x, P) - path_c(0, P)) / wavelength,     x = (dx, dy, turn)
//! ```
//!
//! for each target in both pulses. Its position `P` in the array's frame at the former pulse is known from earlier pulses: angles and ranges are averaged as they come, moved along by the estimated motion, and
//! forgotten over the `memory` pulses of [`Robust::new`]. `P` has an error of known covariance `Q`.
//!
//! **Bias by errors of the directions.** Least squares set `S(P) = sum of J(P)^T V^-1 (y - f(x; P))` to zero, `J = df/dx`. At the true motion `S(P)` has mean 0 for the true positions. For positions
//! with errors `e`, `f` and `J` err *together*: `f` is about `J x`, and `E (dJ e)^T V^-1 (-dJ e) x < 0` for each target, so that the estimate is biased towards no motion. The mean of `S` over the errors is, to the
//! fourth order,
//!
//! ```text
//! E S(P + e)  =  S(P) + 1/2 sum over a of d^2 S / d e_a^2,       e_a along the axes of Q, one standard deviation long
//! ```
//!
//! and follows from differences at `P + e_a` and `P - e_a`. The estimator sets `S` minus that mean to zero: the corrected score of errors in variables (Nakamura 1990). It includes the curvature of sines and
//! cosines. `P` follows from differences between channels, not from their mean, so that its errors are independent of most of `y`; turns follow from these differences too and share one part in `memory`.
//!
//! **Outliers** (a moving target, two targets in a range cell, a wrapped phase). A target whose `r^T V^-1 r` exceeds the 0.9999 quantile is weighted down, the more the farther it is off. `V` is the noise of two
//! pulses and the effect of `Q` on `f`. Inliers have full weight, so that the covariance is that of least squares. Where the fit of all targets leaves an outlier, the iteration starts from the motion of that pair of
//! targets with which most others agree: from the fit of all it would converge to the target whose direction is unique, right or wrong. Two pulses reveal outliers of several standard deviations only: at 15 dB
//! a target that moves by 0.5 mm a pulse raised the error over 1 m from 3.6 to 19 mm. [`crate::movers::classify`] finds such targets over many pulses.
//!
//! **Covariance** of a single increment. Errors of increments are correlated: the phase noise of a pulse enters two increments with opposite signs, and the error of `P` enters `memory` increments with the same sign.
//! The covariance of a sum is not the sum of covariances. Where targets are excluded now and then, noise does not cancel between increments, and the heading drifts.
//!
//! **Units** metres, radians. **Cost** targets times the cube of channels. **Accuracy** `tests/increments.rs`: from 15 dB on, the mean over seeds is within its standard deviation of the truth. **Errors** [`MotionError`].

use std::f64::consts::{PI, TAU};

use glam::{DMat2, DMat3, DVec2, DVec3};
use subaperture_signal::dense::Factor;

use crate::MIN_PIVOT;
use crate::arrival;
use crate::check::{self, MotionError};
use crate::increment::{Heading, Increment, WRAPPED};
use crate::joint::NoEstimate;
use crate::model::{Array, Sighting};

/// Largest number of Gauss-Newton steps.
const MAX_STEPS: usize = 12;
/// Information of a turn that is held at 0, 1/rad^2.
const HELD: f64 = 1e16;

/// Motion between two pulses.
#[derive(Clone, Debug, PartialEq)]
pub struct RobustEstimate {
    /// Motion from the former to the latter.
    pub increment: Increment,
    /// Covariance of x, y (metres) and turn (radians).
    pub covariance: DMat3,
    /// Targets in both pulses with their weights: 1 for inliers, less for outliers.
    pub weights: Vec<(usize, f64)>,
    /// Sum of squared residuals in standard deviations, and its expectation (measurements less unknowns).
    pub chi_square: [f64; 2],
    /// Number of phases with ambiguous whole turns.
    pub doubtful: usize,
}

/// Averaged position of a target.
#[derive(Clone)]
struct Place {
    name: usize,
    /// Position in the array's frame at the last pulse.
    at_m: DVec2,
    information: DMat2,
    /// Phases of its last sighting.
    phases_rad: Vec<f64>,
    sigma_rad: f64,
    pulse: usize,
}

/// Estimator of motion, pulse by pulse.
pub struct Robust {
    array: Array,
    heading: Heading,
    /// Share of information that remains at each pulse.
    kept: f64,
    memory: usize,
    places: Vec<Place>,
    last: Increment,
    pulses: usize,
}

/// Target in two pulses.
struct Pair {
    name: usize,
    at_m: DVec2,
    /// Axes of its covariance, one standard deviation long.
    axes_m: [DVec2; 2],
    differences_rad: Vec<f64>,
    /// Variance of each phase difference.
    variance: f64,
}

/// Contribution of a target to the equations of motion.
struct Part {
    matrix: DMat3,
    /// Score at the estimated position, and the same corrected for its bias.
    score: DVec3,
    unbiased: DVec3,
    /// Squared residual in standard deviations.
    square: f64,
}

impl Part {
    /// Squared residual after a small step.
    fn square_after(&self, step: DVec3) -> f64 {
        self.square - 2.0 * self.score.dot(step) + step.dot(self.matrix * step)
    }
}

/// Quantile 0.9999 of the squared residual of this many measurements.
fn residual_limit(numbers: usize) -> f64 {
    let n = numbers as f64;
    n + 4.0 * libm::sqrt(2.0 * n) + 8.0
}

/// Wrap to -pi to pi.
fn wrapped(phase: f64) -> f64 {
    phase - TAU * (phase / TAU).round()
}

/// Columns whose outer products sum to the inverse.
fn axes(information: DMat2) -> [DVec2; 2] {
    // Lower triangle of the covariance (Cholesky).
    let covariance = information.inverse();
    let [a, b, d] = [
        covariance.x_axis.x,
        covariance.x_axis.y,
        covariance.y_axis.y,
    ];
    let first = libm::sqrt(a.max(0.0));
    let along = if first > 0.0 { b / first } else { 0.0 };
    let second = libm::sqrt((d - along * along).max(0.0));
    [DVec2::new(first, along), DVec2::new(0.0, second)]
}

impl Pair {
    /// Contribution at a motion.
    fn part(&self, array: &Array, motion: &Increment) -> Option<Part> {
        let size = self.differences_rad.len();
        let k = array.rad_m();
        let pose = motion.pose();
        let line = |at_m: DVec2| {
            let errors: Vec<f64> = motion
                .phases_rad(array, at_m)
                .zip(&self.differences_rad)
                .map(|(model, measured)| measured - model)
                .collect();
            let slopes: Vec<DVec3> = array
                .paths(&pose, at_m)
                .iter()
                .map(|path| (k * path.slope).extend(-k * path.turn_m))
                .collect();
            (errors, slopes)
        };
        let here = line(self.at_m);
        let around = self
            .axes_m
            .map(|axis| [axis, -axis].map(|axis| line(self.at_m + axis)));
        // Noise, and the effect of position errors on the model.
        let mut variance = vec![0.0; size * size];
        for [(ahead, _), (behind, _)] in &around {
            for i in 0..size {
                for j in 0..size {
                    let [a, b] = [i, j].map(|i| 0.5 * (ahead[i] - behind[i]));
                    variance[i * size + j] += a * b;
                }
            }
        }
        (0..size).for_each(|i| variance[i * size + i] += self.variance);
        let factor = Factor::new(size, &variance, MIN_PIVOT)?;
        let weighed = |errors: &[f64]| {
            let mut errors = errors.to_vec();
            factor.solve(&mut errors);
            errors
        };
        let score = |(errors, slopes): &(Vec<f64>, Vec<DVec3>)| {
            let weighed = weighed(errors);
            let each = weighed.iter().zip(slopes);
            each.map(|(error, slope)| *slope * *error).sum::<DVec3>()
        };
        let mut matrix = DMat3::ZERO;
        for axis in 0..3 {
            let column: Vec<f64> = here.1.iter().map(|slope| slope[axis]).collect();
            let each = weighed(&column).into_iter().zip(&here.1);
            *matrix.col_mut(axis) = each.map(|(x, slope)| *slope * x).sum();
        }
        let own = score(&here);
        let bias = around
            .iter()
            .map(|[ahead, behind]| 0.5 * (score(ahead) + score(behind)) - own)
            .sum::<DVec3>();
        let square = weighed(&here.0)
            .iter()
            .zip(&here.0)
            .map(|(a, b)| a * b)
            .sum();
        Some(Part {
            matrix,
            score: own,
            unbiased: own - bias,
            square,
        })
    }
}

impl Robust {
    /// Estimator whose target positions are averaged over `memory` pulses, at least 2. Around 100 is typical: the radar should move little against the ranges meanwhile.
    ///
    /// # Errors
    /// [`MotionError::Antennas`], [`MotionError::Array`], [`MotionError::Baseline`].
    pub fn new(array: Array, heading: Heading, memory: usize) -> Result<Self, MotionError> {
        check::array(&array)?;
        let memory = memory.max(2);
        Ok(Self {
            array,
            heading,
            kept: 1.0 - 1.0 / memory as f64,
            memory,
            places: Vec::new(),
            last: Increment::default(),
            pulses: 0,
        })
    }

    /// Take the next pulse and return the motion since the pulse before; `None` for the first pulse.
    ///
    /// # Errors
    /// [`MotionError::Sighting`]: the pulse is ignored. [`NoEstimate::Pose`]: positions are forgotten, and the next pulse will be compared with this one.
    pub fn push(&mut self, sightings: &[Sighting]) -> Result<Option<RobustEstimate>, MotionError> {
        check::sightings(&self.array, sightings)?;
        let number = self.pulses;
        self.pulses += 1;
        let found = match number {
            0 => None,
            _ => match self.compare(sightings, number) {
                Ok(found) => Some(found),
                Err(error) => {
                    self.places.clear();
                    self.see(sightings, number);
                    return Err(error.into());
                }
            },
        };
        if let Some(found) = &found {
            self.last = found.increment;
            for place in &mut self.places {
                place.at_m = found.increment.seen_after(place.at_m);
                let turn = DMat2::from_angle(found.increment.turn_rad);
                place.information = turn.transpose() * place.information * turn * self.kept;
            }
        }
        self.see(sightings, number);
        let memory = self.memory;
        self.places.retain(|place| number - place.pulse < memory);
        Ok(found)
    }

    /// Motion since the former pulse.
    fn compare(&self, sightings: &[Sighting], number: usize) -> Result<RobustEstimate, NoEstimate> {
        let mut doubtful = 0;
        let mut pairs = Vec::with_capacity(sightings.len());
        for sighting in sightings {
            let seen = |place: &&Place| place.name == sighting.target && place.pulse + 1 == number;
            let Some(place) = self.places.iter().find(seen) else {
                continue;
            };
            let expected = self.last.phases_rad(&self.array, place.at_m);
            let phases = sighting.phases_rad.iter().zip(&place.phases_rad);
            let differences_rad = phases
                .zip(expected)
                .map(|((after, before), expected)| {
                    let off = wrapped(after - before - expected);
                    doubtful += usize::from(off.abs() > WRAPPED * PI);
                    expected + off
                })
                .collect();
            let [a, b] = [place.sigma_rad, sighting.phase_sigma_rad];
            pairs.push(Pair {
                name: place.name,
                at_m: place.at_m,
                axes_m: axes(place.information),
                differences_rad,
                variance: a * a + b * b,
            });
        }
        let no_pose = NoEstimate::Pose(number);
        if pairs.len() < 2 {
            return Err(no_pose);
        }
        let limit = residual_limit(self.array.num_channels());
        let parts = |motion: &Increment| {
            let each = pairs.iter().map(|pair| pair.part(&self.array, motion));
            each.collect::<Option<Vec<Part>>>().ok_or(no_pose)
        };
        let mut motion = self.last;
        motion.step(self.start(&parts(&motion)?, limit).ok_or(no_pose)?);
        let mut last = None;
        for _ in 0..MAX_STEPS {
            let parts = parts(&motion)?;
            let weight = |part: &Part| (limit / part.square).powi(2).min(1.0);
            let weights: Vec<f64> = parts.iter().map(weight).collect();
            let counted = || parts.iter().zip(&weights);
            let matrix = counted().map(|(part, weight)| part.matrix * *weight).sum();
            let covariance = self.inverse(matrix).ok_or(no_pose)?;
            let score: DVec3 = counted()
                .map(|(part, weight)| part.unbiased * *weight)
                .sum();
            let step = covariance * score;
            motion.step(step);
            let sum = counted()
                .map(|(part, weight)| part.square * weight)
                .sum::<f64>();
            last = Some((covariance, weights, sum));
            // In squared standard deviations.
            if step.dot(score).abs() < 1e-8 {
                break;
            }
        }
        let (covariance, weights, sum) = last.expect("there are steps");
        if !(motion.moved_m.is_finite() && motion.turn_rad.is_finite()) {
            return Err(no_pose);
        }
        let numbers = pairs.len() * self.array.num_channels();
        let unknowns = match self.heading {
            Heading::Estimated => 3,
            Heading::Known => 2,
        };
        Ok(RobustEstimate {
            increment: motion,
            covariance,
            weights: pairs.iter().map(|pair| pair.name).zip(weights).collect(),
            chi_square: [sum, numbers.saturating_sub(unknowns) as f64],
            doubtful,
        })
    }

    /// Inverse of the normal matrix of a motion.
    fn inverse(&self, mut matrix: DMat3) -> Option<DMat3> {
        if self.heading == Heading::Known {
            matrix.z_axis.z += HELD;
        }
        // Symmetric, so that rows are columns.
        let factor = Factor::new(3, &matrix.to_cols_array(), MIN_PIVOT)?;
        Some(DMat3::from_cols_slice(&factor.inverse()))
    }

    /// First step: the fit of all if it leaves no outlier, else that of the pair with which most targets agree.
    fn start(&self, parts: &[Part], limit: f64) -> Option<DVec3> {
        let of = |some: &[&Part]| {
            let inverse = self.inverse(some.iter().map(|part| part.matrix).sum())?;
            Some(inverse * some.iter().map(|part| part.score).sum::<DVec3>())
        };
        let all = of(&parts.iter().collect::<Vec<_>>())?;
        let squares = |step: DVec3| parts.iter().map(move |part| part.square_after(step));
        if squares(all).all(|square| square <= limit) {
            return Some(all);
        }
        // A pair fits itself but for one number: an outlier must cost more than the noise of inliers.
        let far = 5.0 * limit;
        let counted = |step: &DVec3| squares(*step).map(|square| square.min(far)).sum::<f64>();
        let pairs = parts.iter().enumerate().flat_map(|(i, a)| {
            let others = parts[i + 1..].iter();
            others.filter_map(move |b| of(&[a, b]))
        });
        let candidates = [all, DVec3::ZERO].into_iter().chain(pairs);
        candidates.min_by(|a, b| counted(a).total_cmp(&counted(b)))
    }

    /// Average angles and ranges of a pulse.
    fn see(&mut self, sightings: &[Sighting], number: usize) {
        for sighting in sightings {
            let known = |place: &&mut Place| place.name == sighting.target;
            match self.places.iter_mut().find(known) {
                Some(place) => place.see(&self.array, sighting, number),
                None => self.places.push(Place::new(&self.array, sighting, number)),
            }
        }
    }
}

impl Place {
    fn new(array: &Array, sighting: &Sighting, pulse: usize) -> Self {
        let arrival = arrival::look(array, sighting);
        let from = arrival.at_m - array.centre_m();
        let (along, across) = (from.normalize_or_zero(), from.perp().normalize_or_zero());
        let across_m = arrival.bearing_sigma_rad * sighting.range_m;
        let outer =
            |u: DVec2, sigma: f64| DMat2::from_cols(u * u.x, u * u.y) * (1.0 / (sigma * sigma));
        Self {
            name: sighting.target,
            at_m: arrival.at_m,
            information: outer(along, sighting.range_sigma_m) + outer(across, across_m),
            phases_rad: sighting.phases_rad.clone(),
            sigma_rad: sighting.phase_sigma_rad,
            pulse,
        }
    }

    /// Average the angle and range of another pulse.
    fn see(&mut self, array: &Array, sighting: &Sighting, pulse: usize) {
        let k = array.rad_m();
        let sigma = sighting.phase_sigma_rad;
        let paths = array.paths(&Default::default(), self.at_m);
        let count = paths.len() as f64;
        let mean_slope = paths.iter().map(|path| path.slope).sum::<DVec2>() / count;
        let mean_m = paths.iter().map(|path| path.length_m).sum::<f64>() / count;
        let axes_m = axes(self.information);
        let errors: Vec<(f64, DVec2)> = paths
            .iter()
            .zip(&sighting.phases_rad)
            .map(|(path, phase)| (phase + k * path.length_m, -k * (path.slope - mean_slope)))
            .collect();
        // Channels that can be unwrapped against the first by the averaged position.
        let sure = |slope: DVec2| {
            let squares = axes_m.iter().map(|axis| slope.dot(*axis).powi(2));
            3.0 * libm::sqrt(squares.sum::<f64>() + 2.0 * sigma * sigma) < PI
        };
        let about = errors[0];
        let usable: Vec<(f64, DVec2)> = errors
            .iter()
            .map(|(error, slope)| (wrapped(error - about.0), *slope - about.1))
            .filter(|(_, slope)| sure(*slope))
            .collect();
        let count = usable.len() as f64;
        let mean_error = usable.iter().map(|(error, _)| error).sum::<f64>() / count;
        let mean = usable.iter().map(|(_, slope)| *slope).sum::<DVec2>() / count;
        let (mut matrix, mut right, mut square) = (DMat2::ZERO, DVec2::ZERO, 0.0);
        let mut add = |error: f64, slope: DVec2, weight: f64| {
            matrix += DMat2::from_cols(slope * slope.x, slope * slope.y) * weight;
            right += slope * (error * weight);
            square += error * error * weight;
        };
        for (error, slope) in &usable {
            add(error - mean_error, *slope - mean, 1.0 / (sigma * sigma));
        }
        let range_off_m = sighting.range_m - 0.5 * mean_m;
        add(
            range_off_m,
            0.5 * mean_slope,
            sighting.range_sigma_m.powi(-2),
        );
        // Expected squared residual beyond noise and position error.
        let both = self.information + matrix;
        let expected = square - right.dot(both.inverse() * right);
        let weight = (residual_limit(usable.len()) / expected).clamp(0.0, 1.0);
        self.information += matrix * weight;
        let step = self.information.inverse() * (right * weight);
        if step.is_finite() {
            self.at_m += step;
        }
        self.phases_rad.clone_from(&sighting.phases_rad);
        self.sigma_rad = sigma;
        self.pulse = pulse;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outer_products_of_axes_sum_to_covariance() {
        let information = DMat2::from_cols(DVec2::new(4.0, 1.0), DVec2::new(1.0, 9.0));
        let [a, b] = axes(information);
        let sum = DMat2::from_cols(a * a.x, a * a.y) + DMat2::from_cols(b * b.x, b * b.y);
        assert!((sum * information).abs_diff_eq(DMat2::IDENTITY, 1e-14));
    }
}
