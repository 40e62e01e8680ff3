//! The radar's track from its targets, in the scene.
//!
//! [`subaperture_motion::track`] tells poses in a frame of its own. They are laid upon the recorded positions as well as turn and shift can do it (least squares),
//! so that an image lies where it would, and their shape is that of the echoes alone. Where the recorded positions do not move, the first pose
//! is laid upon them.
//!
//! A target that was lost and found again has another number then. The track tells that both are at one place, within a range resolution: all echoes are given to targets
//! again, by the ranges and angles that poses and places say, and the track is found once more.

mod again;
mod laid;
mod moment;
mod solved;

use std::collections::HashMap;
use std::f64::consts::TAU;

use glam::{DMat3, DVec3};
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::Channels;
use subaperture_motion::{Array, Increment, Pose, Sighting, Target, Track};

use crate::fault::Fault;
use crate::see::{Seen, Settings, TargetsError, see};
use again::looked_again;
use laid::Laid;
use solved::{Solved, solved_for};

pub use moment::Moment;

/// Times that echoes are looked at again by what is known of the targets.
const LOOKS: usize = 2;
/// Squared errors over their expected number from which on something is wrong with the model, not the noise.
const MISFIT: f64 = 2.0;

/// A target of the track.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Its number.
    pub target: usize,
    /// In how many pulses it was seen.
    pub pulses: usize,
    /// Where, metres in the scene frame, at the height of the radar where the plane of motion is level.
    pub position_m: DVec3,
}

/// A radar's track, and what it was found by.
#[derive(Clone, Debug)]
pub struct Recovered {
    /// In the order of pulses; those that tell nothing have none.
    pub moments: Vec<Moment>,
    /// From each moment to the next in the body's axes, with a covariance of x, y and turn by which they can be taken for independent
    /// ([`Track::steps`]).
    pub steps: Vec<(Increment, DMat3)>,
    /// Targets.
    pub places: Vec<Place>,
    /// What was seen.
    pub seen: Seen,
    /// Squared errors in standard deviations, and how many numbers there are beyond those that are found.
    pub chi_square: [f64; 2],
    /// Whether the least squares came to their end.
    pub settled: bool,
}

impl Recovered {
    /// The track's length, metres: from pose to pose.
    pub fn length_m(&self) -> f64 {
        let pairs = self.moments.windows(2);
        pairs
            .map(|pair| pair[0].position_m.distance(pair[1].position_m))
            .sum()
    }
}

/// Finds the track of a recording's radar. The recording is read once, in blocks; memory grows with pulses and targets, not with samples.
///
/// # Errors
/// [`TargetsError`].
pub fn recover(
    channels: Channels,
    settings: &Settings,
    monitor: &dyn Monitor,
) -> Result<Recovered, TargetsError> {
    let nominal_m = recorded_m(&channels);
    let mut seen = see(channels, settings, monitor)?;
    let mut solved = Solved::new(&seen, solved_for(&seen.pulses))?;
    // What is known of the targets' places tells which echoes are theirs, and which of them are one.
    for _ in 0..LOOKS {
        let again = solved_for(&looked_again(&seen, &solved, settings.follow));
        match Solved::new(&seen, again) {
            Ok(better) if better.kept.len() >= solved.kept.len() => solved = better,
            _ => break,
        }
    }
    let counts = solved.times_seen();
    let Solved {
        kept,
        pulses,
        found,
    } = solved;
    let recorded: Vec<DVec3> = kept.iter().map(|&n| nominal_m[n]).collect();
    let laid = Laid::new(
        &found,
        &recorded,
        &seen.arrangement,
        seen.array.wavelength_m,
    );
    let targets: HashMap<usize, Target> = found.targets.iter().copied().collect();
    let moments = kept.iter().enumerate().map(|(i, &n)| Moment {
        pulse: n,
        time_s: seen.times_s[n],
        position_m: laid.position_m(found.poses[i].at_m, recorded[i]),
        attitude: laid.attitude(&found.poses[i]),
        covariance: laid.covariance(&found.covariances[i]),
        targets: pulses[n].len(),
        residual: residual(&seen.array, &found.poses[i], &targets, &pulses[n]),
        recorded_m: recorded[i],
    });
    let moments: Vec<Moment> = moments.collect();
    let places = found.targets.iter().map(|(number, target)| Place {
        target: *number,
        pulses: counts.get(number).copied().unwrap_or(0),
        position_m: laid.position_m(target.at_m, recorded[0]),
    });
    let places = places.collect();
    seen.faults
        .extend(faults(&found, &kept, pulses.len(), laid.reversed));
    Ok(Recovered {
        moments,
        steps: found.steps,
        places,
        seen,
        chi_square: found.chi_square,
        settled: found.settled,
    })
}

/// Where the recording has the middle of all channels' antennas, pulse by pulse, metres in the scene frame.
fn recorded_m(channels: &Channels) -> Vec<DVec3> {
    let mut sums = vec![DVec3::ZERO; channels.num_pulses()];
    for (_, history) in channels.iter() {
        for (sum, pulse) in sums.iter_mut().zip(&history.collection().pulses) {
            *sum += 0.5 * (pulse.transmitter_m + pulse.receiver_m);
        }
    }
    let share = 1.0 / channels.len() as f64;
    sums.into_iter().map(|sum| share * sum).collect()
}

/// RMS of what is off, in standard deviations. Phases are compared but for whole turns.
fn residual(
    array: &Array,
    pose: &Pose,
    targets: &HashMap<usize, Target>,
    sightings: &[Sighting],
) -> f64 {
    let (mut sum, mut count) = (0.0, 0usize);
    for sighting in sightings {
        let Some(target) = targets.get(&sighting.target) else {
            continue;
        };
        let lines = array.lines(pose, target);
        let (range, phases) = lines.split_last().expect("a range follows the phases");
        sum += ((sighting.range_m - range.value) / sighting.range_sigma_m).powi(2);
        for (phase, line) in sighting.phases_rad.iter().zip(phases) {
            let turns = (phase - line.value) / TAU;
            sum += (TAU * (turns - turns.round()) / sighting.phase_sigma_rad).powi(2);
        }
        count += lines.len();
    }
    (sum / count.max(1) as f64).sqrt()
}

fn faults(found: &Track, kept: &[usize], all: usize, reversed: bool) -> Vec<Fault> {
    let mut faults = Vec::new();
    let ends = [0].into_iter().chain(kept.iter().map(|n| n + 1));
    let starts = kept.iter().copied().chain([all]);
    let gaps = || ends.clone().zip(starts.clone()).filter(|(a, b)| a < b);
    if let Some((first, _)) = gaps().next() {
        faults.push(Fault::Blind {
            pulses: all - kept.len(),
            first,
            longest: gaps().map(|(a, b)| b - a).max().unwrap_or(0),
        });
    }
    let doubtful = || (0..kept.len()).filter(|&i| found.doubtful[i] > 0);
    if let Some(first) = doubtful().next() {
        faults.push(Fault::Doubtful {
            pulses: doubtful().count(),
            first: kept[first],
        });
    }
    let [sum, expected] = found.chi_square;
    if sum > MISFIT * expected {
        faults.push(Fault::Misfit {
            chi_square_ratio: sum / expected,
        });
    }
    faults.extend(reversed.then_some(Fault::Reversed));
    faults
}
