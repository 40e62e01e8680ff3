//! Diagnosis of sightings before a track is estimated: channels, whole turns, too few targets.
//!
//! **Channels.** Phases of a working channel continue from pulse to pulse: second differences are noise and a little motion. Where the mean of `exp(j second difference)` over all targets is within chance (3 over the
//! root of their number), phases are random and the channel is *dead*. Where phases do not change although those of other channels do, the channel *stands still*: it is saturated, or its samples repeat. Both are
//! reported of each channel by itself.
//!
//! Working channels of three receivers or more must agree with one direction of arrival a target: squared errors about it, of as many degrees of freedom as channels less two, have mean 1. If they do so only with two
//! receivers exchanged, these are *swapped*. If they do so only without one receiver, that one is *off*: its position or phase is wrong. A swap that mirrors the array cannot be detected: with two receivers alone,
//! or the first and the last of three equidistant ones, a mirrored scene agrees with all measurements but for the place of the transmitter.
//!
//! **Whole turns.** Phase differences between pulses are ambiguous by half wavelengths of range. Ranges over many pulses resolve that: `whole = (slope of range + phase / 2k) / (wavelength / 2)`. If it is not 0, the radar
//! moves by more than a quarter of a wavelength a pulse towards a target, and algorithms that take the nearest whole turn fail ([`crate::Pairwise`], [`crate::Robust`], and [`crate::Tracker`] at its first pulses).
//!
//! **Units** as in [`crate::model`]. **Cost** pulses times targets times channels, and pairs of receivers times that where channels are off. **Accuracy** `tests/diagnosis.rs`.
//! **Errors** [`MotionError`].

use std::f64::consts::TAU;

use crate::arrival;
use crate::check::{self, MotionError};
use crate::model::{Array, Pose, Sighting};
use crate::series::Series;

/// Least number of second differences to call phases random.
const MIN_SECOND_DIFFERENCES: usize = 30;
/// Standard deviations of chance.
const CHANCE_SIGMAS: f64 = 3.0;
/// Ratio of a channel's phase changes to those of the others, below which it stands still.
const STILL: f64 = 0.2;
/// Largest number of sightings that directions of arrival are checked with.
const MAX_SIGHTINGS: usize = 400;

/// Fault of the sightings, and what stays reliable.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Finding {
    /// Pulses without a target.
    #[error("no target in {pulses} of {all} pulses: they do not contribute to the track")]
    NoTarget {
        /// Number of pulses without a target.
        pulses: usize,
        /// Number of all pulses.
        all: usize,
    },
    /// Pulses with one target.
    #[error(
        "one target in {pulses} of {all} pulses: its range and radial speed can be trusted, motion across the line of sight and turns are not observable"
    )]
    OneTarget {
        /// Number of pulses with one target.
        pulses: usize,
        /// Number of all pulses.
        all: usize,
    },
    /// Channel with random phases.
    #[error(
        "channel {channel} is dead: its phases are random from pulse to pulse. The other channels can be trusted"
    )]
    Dead {
        /// Number of the channel.
        channel: usize,
    },
    /// All channels have random phases.
    #[error(
        "all channels are dead: their phases are random from pulse to pulse, without echoes or because the radar moves by an unsteady part of a wavelength per pulse. Ranges can be trusted"
    )]
    AllDead,
    /// Channel whose phases do not change.
    #[error(
        "channel {channel} is saturated or repeats its samples: its phases change by {changes_rad:.3} rad per pulse, those of the other channels by {others_rad:.3} rad. The other channels can be trusted"
    )]
    Still {
        /// Number of the channel.
        channel: usize,
        /// RMS change a pulse, radians.
        changes_rad: f64,
        /// Median RMS change a pulse of the other channels, radians.
        others_rad: f64,
    },
    /// Two receivers are exchanged.
    #[error(
        "receivers {} and {} are swapped: squared residuals are {as_described:.1} times their expectation, {swapped:.1} times with the two exchanged. Exchange them in the description of the array", receivers[0], receivers[1]
    )]
    Swapped {
        /// Numbers of the receivers.
        receivers: [usize; 2],
        /// Mean squared error over its expectation, for the array as described.
        as_described: f64,
        /// Mean squared error over its expectation with the receivers exchanged.
        swapped: f64,
    },
    /// Receiver with a wrong position or phase.
    #[error(
        "receiver {receiver} has a wrong position or phase: squared residuals are {as_described:.1} times their expectation with it, {without:.1} times without. The other receivers can be trusted"
    )]
    Off {
        /// Number of the receiver.
        receiver: usize,
        /// Mean squared error over its expectation with the receiver.
        as_described: f64,
        /// Mean squared error over its expectation without the receiver.
        without: f64,
    },
    /// Channels disagree, and no single receiver explains it.
    #[error(
        "channels do not agree on one direction of arrival per target: squared residuals are {as_described:.1} times their expectation. Motion towards targets can be trusted, turns cannot"
    )]
    Disagree {
        /// Mean squared error over its expectation.
        as_described: f64,
    },
    /// Motion between pulses exceeds the unambiguous phase.
    #[error(
        "phases of target {target} wrap from pulse to pulse: its range decreases by {turns} half wavelengths per pulse more than the phases show. Ranges can be trusted; transmit pulses at shorter intervals"
    )]
    Wrapped {
        /// Number of the target.
        target: usize,
        /// Half wavelengths a pulse: positive if the target approaches faster than its phases show.
        turns: i64,
    },
}

/// Check sightings before a track is estimated. An empty list means no fault.
///
/// # Errors
/// [`MotionError`], and the pulse's number.
pub fn examine(
    array: &Array,
    pulses: &[Vec<Sighting>],
) -> Result<Vec<Finding>, (usize, MotionError)> {
    check::array(array).map_err(|error| (0, error))?;
    for (n, pulse) in pulses.iter().enumerate() {
        check::sightings(array, pulse).map_err(|error| (n, error))?;
    }
    let mut findings = Vec::new();
    let all = pulses.len();
    let seeing = |targets: usize| pulses.iter().filter(|pulse| pulse.len() == targets).count();
    let [none, one] = [seeing(0), seeing(1)];
    if none > 0 {
        findings.push(Finding::NoTarget { pulses: none, all });
    }
    if one > 0 {
        findings.push(Finding::OneTarget { pulses: one, all });
    }
    let channels = Channels::new(array, pulses);
    let before = findings.len();
    channels.faults(&mut findings);
    if findings.len() > before {
        // Angles and phases are unusable.
        return Ok(findings);
    }
    angles(array, pulses, &mut findings);
    if findings.len() > before {
        return Ok(findings);
    }
    for series in Series::wrapping(array, pulses) {
        let [turns, sigma] = series.turns(array);
        if sigma < 0.1 && turns.round() != 0.0 {
            findings.push(Finding::Wrapped {
                target: series.name,
                // Phases grow where paths shorten.
                turns: turns.round() as i64,
            });
        }
    }
    Ok(findings)
}

/// Statistics of each channel's phases from pulse to pulse.
struct Channels {
    /// Magnitude of the mean phasor of second differences.
    steadiness: Vec<f64>,
    second_differences: usize,
    /// RMS of first differences.
    changes_rad: Vec<f64>,
    /// RMS of first differences by noise alone.
    noise_rad: f64,
}

fn wrapped(phase: f64) -> f64 {
    phase - TAU * (phase / TAU).round()
}

impl Channels {
    fn new(array: &Array, pulses: &[Vec<Sighting>]) -> Self {
        let count = array.num_channels();
        let mut phasors = vec![[0.0; 2]; count];
        let mut squares = vec![0.0; count];
        let (mut firsts, mut seconds, mut noise) = (0usize, 0usize, 0.0);
        let find = |pulse: &'_ [Sighting], name: usize| -> Option<Vec<f64>> {
            let seen = pulse.iter().find(|sighting| sighting.target == name);
            seen.map(|sighting| sighting.phases_rad.clone())
        };
        for (n, pulse) in pulses.iter().enumerate().skip(1) {
            for sighting in pulse {
                let Some(before) = find(&pulses[n - 1], sighting.target) else {
                    continue;
                };
                firsts += 1;
                noise += 2.0 * sighting.phase_sigma_rad.powi(2);
                let former = match n {
                    1 => None,
                    _ => find(&pulses[n - 2], sighting.target),
                };
                seconds += usize::from(former.is_some());
                for c in 0..count {
                    let first = wrapped(sighting.phases_rad[c] - before[c]);
                    squares[c] += first * first;
                    if let Some(former) = &former {
                        let second = first - (before[c] - former[c]);
                        let (sin, cos) = libm::sincos(second);
                        phasors[c][0] += cos;
                        phasors[c][1] += sin;
                    }
                }
            }
        }
        let mean = |sum: f64, of: usize| sum / of.max(1) as f64;
        Self {
            steadiness: phasors
                .iter()
                .map(|[re, im]| mean(libm::hypot(*re, *im), seconds))
                .collect(),
            second_differences: seconds,
            changes_rad: squares
                .iter()
                .map(|sum| libm::sqrt(mean(*sum, firsts)))
                .collect(),
            noise_rad: libm::sqrt(mean(noise, firsts)),
        }
    }

    fn faults(&self, findings: &mut Vec<Finding>) {
        let seconds = self.second_differences;
        if seconds < MIN_SECOND_DIFFERENCES {
            return;
        }
        // A sighting enters three second differences: a third of their number is independent.
        let chance = CHANCE_SIGMAS / libm::sqrt(seconds as f64 / 3.0);
        let is_random = |c: usize| self.steadiness[c] < chance;
        let count = self.steadiness.len();
        let random: Vec<usize> = (0..count).filter(|&c| is_random(c)).collect();
        if random.len() == count {
            findings.push(Finding::AllDead);
            return;
        }
        findings.extend(random.iter().map(|&channel| Finding::Dead { channel }));
        let follow: Vec<usize> = (0..count).filter(|&c| !is_random(c)).collect();
        for &channel in &follow {
            let mut others: Vec<f64> = follow
                .iter()
                .filter(|&&c| c != channel)
                .map(|&c| self.changes_rad[c])
                .collect();
            others.sort_by(f64::total_cmp);
            let Some(&others_rad) = others.get(others.len() / 2) else {
                continue;
            };
            let changes_rad = self.changes_rad[channel];
            // A radar that stands still changes no phase.
            let moves = others_rad > 3.0 * self.noise_rad;
            let still = libm::hypot(STILL * others_rad, self.noise_rad);
            if moves && changes_rad < still {
                findings.push(Finding::Still {
                    channel,
                    changes_rad,
                    others_rad,
                });
            }
        }
    }
}

/// Mean squared error of channels about one direction of arrival a target over its expectation, for receivers in this order, and the degrees of freedom.
fn misfit(array: &Array, sightings: &[&Sighting], order: &[usize]) -> [f64; 2] {
    let receivers = array.receivers_m.len();
    let mut used = array.clone();
    // In another order, receiver i of the description has the phases of receiver order[i]; receivers left out are removed from the description.
    if order.len() < receivers {
        used.receivers_m = order.iter().map(|&r| array.receivers_m[r]).collect();
    }
    if check::array(&used).is_err() {
        return [f64::INFINITY, 0.0];
    }
    let channels = used.num_channels();
    let mut squares: Vec<f64> = Vec::with_capacity(sightings.len());
    for sighting in sightings {
        let transmitters = 0..array.transmitters_m.len();
        let phases_rad = transmitters
            .flat_map(|t| {
                order
                    .iter()
                    .map(move |r| sighting.phases_rad[t * receivers + r])
            })
            .collect();
        let seen = Sighting {
            phases_rad,
            ..(*sighting).clone()
        };
        let found = arrival::look(&used, &seen);
        let paths = used.paths(&Pose::default(), found.at_m);
        let both = found.phases_rad.iter().zip(&paths);
        let errors: Vec<f64> = both
            .map(|(phase, path)| phase + used.rad_m() * path.length_m)
            .collect();
        let mean = errors.iter().sum::<f64>() / channels as f64;
        let square: f64 = errors.iter().map(|error| (error - mean).powi(2)).sum();
        squares.push(square / sighting.phase_sigma_rad.powi(2));
    }
    let free = sightings.len() * channels.saturating_sub(2);
    [squares.iter().sum::<f64>() / free as f64, free as f64]
}

/// Check that channels agree with one direction of arrival a target.
fn angles(array: &Array, pulses: &[Vec<Sighting>], findings: &mut Vec<Finding>) {
    let receivers = array.receivers_m.len();
    let all: Vec<&Sighting> = pulses.iter().flatten().collect();
    if array.num_channels() < 3 || all.is_empty() {
        return;
    }
    let every = all.len().div_ceil(MAX_SIGHTINGS);
    let some: Vec<&Sighting> = all.into_iter().step_by(every).collect();
    let described: Vec<usize> = (0..receivers).collect();
    let [as_described, free] = misfit(array, &some, &described);
    // Chance of a mean of squares, and model errors of the geometry.
    let fits = |[mean, free]: [f64; 2]| mean < 1.5 + 5.0 * libm::sqrt(2.0 / free);
    if fits([as_described, free]) {
        return;
    }
    let pairs = (0..receivers).flat_map(|i| (i + 1..receivers).map(move |j| [i, j]));
    let best = pairs
        .map(|[i, j]| {
            let mut order = described.clone();
            order.swap(i, j);
            ([i, j], misfit(array, &some, &order))
        })
        .min_by(|a, b| a.1[0].total_cmp(&b.1[0]));
    if let Some((receivers, swapped)) = best
        && fits(swapped)
    {
        findings.push(Finding::Swapped {
            receivers,
            as_described,
            swapped: swapped[0],
        });
        return;
    }
    let left = (0..receivers).filter(|_| array.transmitters_m.len() * (receivers - 1) > 2);
    let best = left
        .map(|receiver| {
            let order = described.iter().copied().filter(|&r| r != receiver);
            let order: Vec<usize> = order.collect();
            (receiver, misfit(array, &some, &order))
        })
        .min_by(|a, b| a.1[0].total_cmp(&b.1[0]));
    findings.push(match best {
        Some((receiver, without)) if fits(without) => Finding::Off {
            receiver,
            as_described,
            without: without[0],
        },
        _ => Finding::Disagree { as_described },
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn findings_state_which_data_can_be_trusted() {
        let all = [
            Finding::OneTarget { pulses: 1, all: 2 },
            Finding::Dead { channel: 1 },
            Finding::AllDead,
            Finding::Still {
                channel: 1,
                changes_rad: 0.0,
                others_rad: 3.0,
            },
            Finding::Disagree { as_described: 3.0 },
            Finding::Wrapped {
                target: 1,
                turns: 1,
            },
        ];
        for finding in all {
            assert!(finding.to_string().contains("can"), "{finding}");
        }
    }
}
