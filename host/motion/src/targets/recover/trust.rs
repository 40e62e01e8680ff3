//! Consistency of a track: its residuals against the stated noise.
//!
//! Covariances follow from the standard deviations of single echoes and assume independent errors from pulse to pulse. The residuals of the track check both:
//!
//! ```text
//! misfit   s^2   = chi-square / expected, at least 1; of blocks of 32 pulses where it is larger there beyond chance
//! correlation length kappa = 1 + 2 sum over lags of the autocorrelation of residuals, target by target and channel by channel, at least 1
//! ```
//!
//! The own part of a pose's covariance is multiplied by the misfit of the track, or of its block. The part from the targets' positions, which are averages over many pulses, is multiplied by `s^2 kappa`: clutter in a target's range cell
//! and neighbouring targets distort its phases for as long as the geometry stays similar.
//!
//! Errors that no covariance describes lead to a refusal: phases off by whole turns, echoes of other targets, targets that move unnoticed, motion out of the plane. They leave residuals of many standard deviations, whose cost
//! Huber's weights limit to [`crate::joint::HUBER`] times their size: a share `p` of phases that is off by a turn at 15 dB adds about `400 p` to the misfit.

use std::collections::HashMap;

use crate::Sighting;

use super::solved::Solved;
use crate::targets::detection::Detections;

/// Squared residuals over their expectation up to which a track fits.
pub(super) const FITS: f64 = 2.0;
/// Pulses of a block.
const BLOCK: usize = 32;

/// Squared residuals over their expectation.
pub(super) fn misfit(solved: &Solved) -> f64 {
    let [sum, expected] = solved.found.chi_square;
    sum / expected.max(1.0)
}

/// Factors of the covariances by the residuals.
pub(super) struct Residuals {
    /// RMS residual of each pulse, in standard deviations.
    pub(super) of_pulses: Vec<f64>,
    /// Factor of the own covariance of each pose.
    pub(super) own: Vec<f64>,
    /// Factor of the covariance by the targets' positions.
    pub(super) by_targets: f64,
}

impl Residuals {
    pub(super) fn new(seen: &Detections, solved: &Solved) -> Self {
        let found = &solved.found;
        let channels = seen.array.num_channels();
        // Residuals of each target with the pulses' numbers.
        let mut series: HashMap<usize, Vec<(usize, Vec<f64>)>> = HashMap::new();
        let mut squares: Vec<(f64, usize)> = Vec::with_capacity(found.poses.len());
        for (i, (pulse, pose)) in found
            .unwrapped_sightings
            .iter()
            .zip(&found.poses)
            .enumerate()
        {
            let (mut sum, mut count) = (0.0, 0);
            for sighting in pulse {
                let (_, target) = &found.targets[sighting.target];
                let lines = seen.array.lines(pose, target);
                let errors: Vec<f64> = errors(sighting, &lines);
                sum += errors.iter().map(|e| e * e).sum::<f64>();
                count += errors.len();
                let own = series.entry(sighting.target).or_default();
                own.push((solved.kept[i], errors));
            }
            squares.push((sum, count));
        }
        let of_pulses = squares
            .iter()
            .map(|(sum, count)| (sum / (*count).max(1) as f64).sqrt())
            .collect();
        let whole = misfit(solved).max(1.0);
        let mut own = Vec::with_capacity(squares.len());
        for block in squares.chunks(BLOCK) {
            let sum: f64 = block.iter().map(|(sum, _)| sum).sum();
            let numbers: usize = block.iter().map(|(_, count)| count).sum();
            // Each pose takes three degrees of freedom.
            let free = numbers.saturating_sub(3 * block.len()).max(1) as f64;
            // Five standard deviations of a mean of squares.
            let chance = whole * (1.0 + 5.0 * (2.0 / free).sqrt());
            let ratio = sum / free;
            let misfit = if ratio > chance {
                whole.max(ratio)
            } else {
                whole
            };
            own.extend(block.iter().map(|_| misfit));
        }
        let phases = correlation_length(series.values(), 0..channels);
        let ranges = correlation_length(series.values(), channels..channels + 1);
        Self {
            of_pulses,
            own,
            by_targets: whole * phases.max(ranges),
        }
    }

    /// Misfit of the block that fits worst, and the place of its first pulse in the track.
    pub(super) fn worst(&self) -> (f64, usize) {
        let all = self.own.iter().copied().zip(0..);
        all.fold(
            (0.0, 0),
            |worst, one| if one.0 > worst.0 { one } else { worst },
        )
    }
}

/// Residuals of phases and range, in standard deviations.
fn errors(sighting: &Sighting, lines: &[crate::model::Line]) -> Vec<f64> {
    let phases = sighting
        .phases_rad
        .iter()
        .map(|phase| (*phase, sighting.phase_sigma_rad));
    let range = (sighting.range_m, sighting.range_sigma_m);
    phases
        .chain([range])
        .zip(lines)
        .map(|((value, sigma), line)| (value - line.value) / sigma)
        .collect()
}

/// Correlation length of residuals in pulses: 1 plus twice the sum of their autocorrelation up to the first insignificant lag.
fn correlation_length<'a>(
    series: impl Iterator<Item = &'a Vec<(usize, Vec<f64>)>> + Clone,
    numbers: std::ops::Range<usize>,
) -> f64 {
    let most = series.clone().map(Vec::len).max().unwrap_or(0) / 4;
    // Outliers belong to the misfit.
    let bounded = |e: f64| e.clamp(-4.0, 4.0);
    let alike = |lag: usize| {
        let (mut products, mut count) = (0.0, 0usize);
        for one in series.clone() {
            for (i, (pulse, errors)) in one.iter().enumerate() {
                let Some((other, later)) = one.get(i + lag) else {
                    break;
                };
                if *other == pulse + lag {
                    for c in numbers.clone() {
                        products += bounded(errors[c]) * bounded(later[c]);
                        count += 1;
                    }
                }
            }
        }
        (products, count)
    };
    let (square, all) = alike(0);
    if all == 0 || square <= 0.0 {
        return 1.0;
    }
    let mean = square / all as f64;
    let mut sum = 1.0;
    for lag in 1..=most {
        let (products, count) = alike(lag);
        let rho = products / (count.max(1) as f64 * mean);
        // Three standard deviations of a mean of so many.
        if count == 0 || rho < 3.0 / (count as f64).sqrt() {
            break;
        }
        sum += 2.0 * rho;
    }
    sum
}
