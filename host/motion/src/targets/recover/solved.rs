//! Track of given sightings, over all pulses that determine a pose.

use std::collections::{BTreeSet, HashMap};

use crate::{Array, MotionError, Pose, Sighting, Track, Tracker, track_numbered};

use crate::targets::detection::{Detections, TargetsError, WINDOW};

/// Largest number of targets of a track, most sightings first: the time of a pulse grows with the cube of their number.
const MAX_SOLVED: usize = 48;
/// Least number of pulses of a target: it adds three unknowns, and fewer pulses do not contribute to the other unknowns.
const MIN_PULSES_SEEN: usize = 10;

/// Track of some pulses.
pub(super) struct Solved {
    /// Numbers of these pulses.
    pub(super) kept: Vec<usize>,
    /// Sightings of all pulses.
    pub(super) pulses: Vec<Vec<Sighting>>,
    pub(super) found: Track,
}

impl Solved {
    pub(super) fn new(seen: &Detections, pulses: Vec<Vec<Sighting>>) -> Result<Self, TargetsError> {
        let mut kept: Vec<usize> = (0..pulses.len()).filter(|&n| pulses[n].len() > 1).collect();
        if kept.len() < 2 {
            return Err(too_few(&seen.pulses));
        }
        let own = |kept: &[usize]| -> Vec<Vec<Sighting>> {
            kept.iter().map(|&n| pulses[n].clone()).collect()
        };
        let solve = |kept: &[usize]| track_numbered(&seen.array, &own(kept), kept, WINDOW);
        let found = solve(&kept).or_else(|(n, error)| match error {
            MotionError::NoEstimate(_) if n < kept.len() => {
                kept = with_pose(&seen.array, &own(&kept), &kept)?;
                solve(&kept)
            }
            error => Err((n, error)),
        });
        let found = found.map_err(|(n, source)| TargetsError::Motion {
            pulse: kept.get(n).copied().unwrap_or(pulses.len() - 1),
            source,
        })?;
        Ok(Self {
            kept,
            pulses,
            found,
        })
    }

    /// Number of pulses of each target.
    pub(super) fn times_seen(&self) -> HashMap<usize, usize> {
        times_seen(self.kept.iter().map(|&n| &self.pulses[n]))
    }

    /// Pose at a pulse, interpolated between poses.
    pub(super) fn pose(&self, pulse: usize) -> Pose {
        let poses = &self.found.poses;
        let next = self.kept.partition_point(|&n| n < pulse);
        let at = |i: usize| (self.kept[i], poses[i]);
        match (
            next.checked_sub(1).map(at),
            (next < poses.len()).then(|| at(next)),
        ) {
            (_, Some((n, pose))) if n == pulse => pose,
            (Some((before, a)), Some((after, b))) => {
                let part = (pulse - before) as f64 / (after - before) as f64;
                Pose {
                    at_m: a.at_m.lerp(b.at_m, part),
                    heading_rad: a.heading_rad + part * (b.heading_rad - a.heading_rad),
                }
            }
            // Extrapolated over a limited number of pulses.
            (Some((last, pose)), None) => self.beyond(poses.len() - 1, pose, pulse - last),
            (None, Some((first, pose))) => self.beyond(0, pose, first - pulse),
            (None, None) => Pose::default(),
        }
    }
}

/// Largest number of pulses beyond the track's ends for which a pose is extrapolated.
const BEYOND: usize = 30;
/// Number of pulses from which it is extrapolated.
const AT_END: usize = 16;

impl Solved {
    /// Pose `pulses` pulses beyond an end, extrapolated by the mean motion there.
    fn beyond(&self, end: usize, pose: Pose, pulses: usize) -> Pose {
        let poses = &self.found.poses;
        let other = end.abs_diff(AT_END.min(poses.len() - 1));
        let between = self.kept[end].abs_diff(self.kept[other]);
        if between == 0 {
            return pose;
        }
        let part = pulses.min(BEYOND) as f64 / between as f64;
        Pose {
            at_m: pose.at_m + (pose.at_m - poses[other].at_m) * part,
            heading_rad: pose.heading_rad,
        }
    }
}

/// Number of pulses of each target.
fn times_seen<'a>(pulses: impl Iterator<Item = &'a Vec<Sighting>>) -> HashMap<usize, usize> {
    let mut counts: HashMap<usize, usize> = HashMap::new();
    for sighting in pulses.flatten() {
        *counts.entry(sighting.target).or_default() += 1;
    }
    counts
}

/// Sightings of the targets with most pulses.
pub(super) fn solved_for(pulses: &[Vec<Sighting>]) -> Vec<Vec<Sighting>> {
    let mut by_count: Vec<(usize, usize)> = times_seen(pulses.iter()).into_iter().collect();
    by_count.sort_by_key(|&(target, count)| (std::cmp::Reverse(count), target));
    by_count.truncate(MAX_SOLVED);
    by_count.retain(|(_, count)| *count >= MIN_PULSES_SEEN);
    let is_solved = |sighting: &&Sighting| {
        by_count
            .iter()
            .any(|(target, _)| *target == sighting.target)
    };
    let each = pulses.iter();
    each.map(|all| all.iter().filter(is_solved).cloned().collect())
        .collect()
}

/// Sightings of all other targets.
pub(super) fn without(pulses: &[Vec<Sighting>], left_out: &BTreeSet<usize>) -> Vec<Vec<Sighting>> {
    let stays = |sighting: &&Sighting| !left_out.contains(&sighting.target);
    let each = pulses.iter();
    each.map(|all| all.iter().filter(stays).cloned().collect())
        .collect()
}

fn too_few(pulses: &[Vec<Sighting>]) -> TargetsError {
    let ranges = pulses.iter().flatten().map(|sighting| sighting.range_m);
    TargetsError::TooFew {
        most: pulses.iter().map(Vec::len).max().unwrap_or(0),
        pulses: pulses.iter().filter(|all| !all.is_empty()).count(),
        ranges_m: ranges.fold((f64::INFINITY, 0.0), |(near, far), range_m| {
            (near.min(range_m), far.max(range_m))
        }),
    }
}

/// Pulses that determine their pose, given the pulses before.
fn with_pose(
    array: &Array,
    pulses: &[Vec<Sighting>],
    numbers: &[usize],
) -> Result<Vec<usize>, (usize, MotionError)> {
    let mut tracker = Tracker::new(array.clone(), WINDOW).map_err(|error| (0, error))?;
    let mut with_pose = Vec::with_capacity(numbers.len());
    let mut first_error = None;
    for (i, (&n, sightings)) in numbers.iter().zip(pulses).enumerate() {
        tracker.skip(i.checked_sub(1).map_or(0, |m| n - numbers[m] - 1));
        match tracker.push(sightings) {
            Ok(_) => with_pose.push(n),
            Err(error) => {
                first_error.get_or_insert((i, error));
            }
        }
    }
    match first_error {
        Some(error) if with_pose.len() < 2 => Err(error),
        _ => Ok(with_pose),
    }
}
