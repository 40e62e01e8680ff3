//! What is wrong with what a radar sees, before a track is made of it: channels, whole turns, too few targets.
//!
//! **Channels.** Of a channel that follows, phases go on from pulse to pulse as they went: second differences are noise and a little motion. Where the mean of
//! `exp(j second difference)` of all targets is no longer than chance makes it (3 over the root of their number), phases are random: the channel is *dead*. Where phases do not
//! change though those of other channels do, it *stands still*: it is saturated, or its samples are. Both are told of each channel by itself.
//!
//! Channels that follow, of three receivers or more, are held to one angle of arrival a target: squared errors of channels about it, as many as channels less two, have a
//! mean of one. Where they have not, and have it with two receivers exchanged, those are *swapped*; where they have it without one receiver, that one is *off*: not where it is said to be, or of
//! another phase. Swapping what mirrors the array is not told: of two receivers alone, or of the first and the last of three at one distance, the world is a mirror image that agrees with all that is measured, but
//! for the transmitter's place.
//!
//! **Whole turns.** Phases tell how a range changes from pulse to pulse but for half wavelengths. Over many pulses the ranges tell those: `whole = (slope of range + phase / 2k) / (wavelength / 2)`. Where
//! they are not 0 the radar moves by more than a quarter of a wavelength a pulse towards a target, and whoever takes the nearest whole turn ([`crate::Pairwise`], [`crate::Robust`] and
//! [`crate::Tracker`] at their first pulses) is wrong.
//!
//! **Units** as in [`crate::model`]. **Cost** pulses times targets times channels, and pairs of receivers times that where channels are off. **Accuracy** `tests/diagnosis.rs`.
//! **Errors** [`MotionError`].

use std::f64::consts::TAU;

use crate::arrival;
use crate::check::{self, MotionError};
use crate::model::{Array, Pose, Sighting};
use crate::series::Series;

/// Second differences that are wanted before phases are called random.
const ENOUGH: usize = 30;
/// Standard deviations of chance.
const CHANCE: f64 = 3.0;
/// A channel's changes against those of others, below which it stands still.
const STILL: f64 = 0.2;
/// Sightings that angles are held to, at most.
const MOST_SIGHTINGS: usize = 400;

/// What is wrong, and what can be trusted all the same.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Finding {
    /// Nothing is seen.
    #[error("{pulses} of {all} pulses see no target: they tell nothing")]
    Nothing {
        /// So many.
        pulses: usize,
        /// Of so many.
        all: usize,
    },
    /// One target is.
    #[error(
        "{pulses} of {all} pulses see one target: its range and radial speed can be trusted, neither a motion across its direction nor a turn is told"
    )]
    OneTarget {
        /// So many.
        pulses: usize,
        /// Of so many.
        all: usize,
    },
    /// A channel without signal.
    #[error(
        "phases of channel {channel} are random from pulse to pulse: it is dead. The others can be trusted"
    )]
    Dead {
        /// Which.
        channel: usize,
    },
    /// All of them.
    #[error(
        "phases of all channels are random from pulse to pulse: nothing is received, or the radar jumps by parts of a wavelength. Ranges can be trusted"
    )]
    AllDead,
    /// A channel that does not follow.
    #[error(
        "phases of channel {channel} change by {changes_rad:.3} rad a pulse, those of the others by {others_rad:.3} rad: it is saturated, or stands still. The others can be trusted"
    )]
    Still {
        /// Which.
        channel: usize,
        /// Root mean square.
        changes_rad: f64,
        /// The same of the others.
        others_rad: f64,
    },
    /// Two receivers are exchanged.
    #[error(
        "receivers {} and {} are swapped: squared errors are {swapped:.1} times what they should be once they are exchanged, {as_told:.1} times as they are", receivers[0], receivers[1]
    )]
    Swapped {
        /// Which.
        receivers: [usize; 2],
        /// Mean squared error in standard deviations, as the array is described.
        as_told: f64,
        /// With these exchanged.
        swapped: f64,
    },
    /// A receiver is not where it is said to be, or of another phase.
    #[error(
        "receiver {receiver} does not agree with the others: squared errors are {as_told:.1} times what they should be with it, {without:.1} times without. The others can be trusted"
    )]
    Off {
        /// Which.
        receiver: usize,
        /// Mean squared error in standard deviations with it.
        as_told: f64,
        /// Without.
        without: f64,
    },
    /// Channels do not agree, and no one of them is why.
    #[error(
        "channels do not agree with one angle of arrival: squared errors are {as_told:.1} times what they should be. Motion towards targets can be trusted, turns cannot"
    )]
    Disagree {
        /// Mean squared error in standard deviations.
        as_told: f64,
    },
    /// Too much motion a pulse.
    #[error(
        "target {target} comes nearer by {turns} half wavelengths a pulse more than its phases tell, which wrap: pulses are too far apart. Ranges can be trusted"
    )]
    Wrapped {
        /// Which.
        target: usize,
        /// More or, below 0, less.
        turns: i64,
    },
}

/// What is wrong with what these pulses see; nothing if nothing is.
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
        findings.push(Finding::Nothing { pulses: none, all });
    }
    if one > 0 {
        findings.push(Finding::OneTarget { pulses: one, all });
    }
    let channels = Channels::new(array, pulses);
    let before = findings.len();
    channels.faults(&mut findings);
    if findings.len() > before {
        // Nothing more is known of angles and phases.
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
                // Phases that grow are paths that shorten.
                turns: turns.round() as i64,
            });
        }
    }
    Ok(findings)
}

/// How each channel's phases go from pulse to pulse.
struct Channels {
    /// The mean of unit phasors of second differences, its length.
    steadiness: Vec<f64>,
    second_differences: usize,
    /// Root mean square of first differences.
    changes_rad: Vec<f64>,
    /// Of noise alone.
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
        if seconds < ENOUGH {
            return;
        }
        // One look is in three second differences, so that their number is a third of theirs.
        let chance = CHANCE / libm::sqrt(seconds as f64 / 3.0);
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
            // A radar that stands still moves no channel.
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

/// Mean squared error in standard deviations of channels about one angle a target, of these receivers in this order, and how many there are beyond what is found.
fn misfit(array: &Array, sightings: &[&Sighting], order: &[usize]) -> [f64; 2] {
    let receivers = array.receivers_m.len();
    let mut used = array.clone();
    // In another order, receiver i of the description has the phases that are told of receiver order[i]; some of them are where they are.
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

/// Holds channels to one angle a target.
fn angles(array: &Array, pulses: &[Vec<Sighting>], findings: &mut Vec<Finding>) {
    let receivers = array.receivers_m.len();
    let all: Vec<&Sighting> = pulses.iter().flatten().collect();
    if array.num_channels() < 3 || all.is_empty() {
        return;
    }
    let every = all.len().div_ceil(MOST_SIGHTINGS);
    let some: Vec<&Sighting> = all.into_iter().step_by(every).collect();
    let told: Vec<usize> = (0..receivers).collect();
    let [as_told, free] = misfit(array, &some, &told);
    // As many standard deviations of a mean of squares, and what is left of geometry.
    let fits = |[mean, free]: [f64; 2]| mean < 1.5 + 5.0 * libm::sqrt(2.0 / free);
    if fits([as_told, free]) {
        return;
    }
    let pairs = (0..receivers).flat_map(|i| (i + 1..receivers).map(move |j| [i, j]));
    let best = pairs
        .map(|[i, j]| {
            let mut order = told.clone();
            order.swap(i, j);
            ([i, j], misfit(array, &some, &order))
        })
        .min_by(|a, b| a.1[0].total_cmp(&b.1[0]));
    if let Some((receivers, swapped)) = best
        && fits(swapped)
    {
        findings.push(Finding::Swapped {
            receivers,
            as_told,
            swapped: swapped[0],
        });
        return;
    }
    let left = (0..receivers).filter(|_| array.transmitters_m.len() * (receivers - 1) > 2);
    let best = left
        .map(|receiver| {
            let order: Vec<usize> = told.iter().copied().filter(|&r| r != receiver).collect();
            (receiver, misfit(array, &some, &order))
        })
        .min_by(|a, b| a.1[0].total_cmp(&b.1[0]));
    findings.push(match best {
        Some((receiver, without)) if fits(without) => Finding::Off {
            receiver,
            as_told,
            without: without[0],
        },
        _ => Finding::Disagree { as_told },
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn findings_say_what_can_be_trusted() {
        let all = [
            Finding::OneTarget { pulses: 1, all: 2 },
            Finding::Dead { channel: 1 },
            Finding::AllDead,
            Finding::Still {
                channel: 1,
                changes_rad: 0.0,
                others_rad: 3.0,
            },
            Finding::Disagree { as_told: 3.0 },
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
