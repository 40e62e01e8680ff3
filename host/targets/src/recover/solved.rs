//! A track of sightings, of as many pulses as tell it.

use std::collections::HashMap;

use subaperture_motion::{Array, MotionError, Pose, Sighting, Track, Tracker, track};

use crate::see::{Seen, TargetsError, WINDOW};

/// Targets whose places are found, those seen most often: a pulse's time grows with the cube of their number.
const MOST_SOLVED: usize = 48;
/// Pulses in which a target has to be told of: its place is three numbers more to find, and fewer pulses say nothing of the others.
const LEAST_TOLD: usize = 10;

/// A track, of these pulses.
pub(super) struct Solved {
    /// Their numbers.
    pub(super) kept: Vec<usize>,
    /// Of all pulses.
    pub(super) pulses: Vec<Vec<Sighting>>,
    pub(super) found: Track,
}

impl Solved {
    pub(super) fn new(seen: &Seen, pulses: Vec<Vec<Sighting>>) -> Result<Self, TargetsError> {
        let mut kept: Vec<usize> = (0..pulses.len()).filter(|&n| pulses[n].len() > 1).collect();
        if kept.len() < 2 {
            return Err(too_few(&seen.pulses));
        }
        let own = |kept: &[usize]| -> Vec<Vec<Sighting>> {
            kept.iter().map(|&n| pulses[n].clone()).collect()
        };
        let solve = |kept: &[usize]| track(&seen.array, &own(kept), WINDOW);
        let found = solve(&kept).or_else(|(n, error)| match error {
            MotionError::NoEstimate(_) if n < kept.len() => {
                kept = tellable(&seen.array, &own(&kept), &kept)?;
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

    /// In how many pulses targets are seen, by number.
    pub(super) fn times_seen(&self) -> HashMap<usize, usize> {
        times_seen(self.kept.iter().map(|&n| &self.pulses[n]))
    }

    /// The pose at a pulse, between those that are known if need be.
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
            (Some((_, pose)), None) | (None, Some((_, pose))) => pose,
            (None, None) => Pose::default(),
        }
    }
}

/// In how many pulses targets are seen, by number.
fn times_seen<'a>(pulses: impl Iterator<Item = &'a Vec<Sighting>>) -> HashMap<usize, usize> {
    let mut counts: HashMap<usize, usize> = HashMap::new();
    for sighting in pulses.flatten() {
        *counts.entry(sighting.target).or_default() += 1;
    }
    counts
}

/// Sightings of the targets that are seen most often.
pub(super) fn solved_for(pulses: &[Vec<Sighting>]) -> Vec<Vec<Sighting>> {
    let mut by_count: Vec<(usize, usize)> = times_seen(pulses.iter()).into_iter().collect();
    by_count.sort_by_key(|&(target, count)| (std::cmp::Reverse(count), target));
    by_count.truncate(MOST_SOLVED);
    by_count.retain(|(_, count)| *count >= LEAST_TOLD);
    let is_solved = |sighting: &&Sighting| {
        by_count
            .iter()
            .any(|(target, _)| *target == sighting.target)
    };
    let each = pulses.iter();
    each.map(|all| all.iter().filter(is_solved).cloned().collect())
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

/// The pulses that tell their pose beside those before them.
fn tellable(
    array: &Array,
    pulses: &[Vec<Sighting>],
    numbers: &[usize],
) -> Result<Vec<usize>, (usize, MotionError)> {
    let mut tracker = Tracker::new(array.clone(), WINDOW).map_err(|error| (0, error))?;
    let mut tellable = Vec::with_capacity(numbers.len());
    let mut first_error = None;
    for (i, (&n, sightings)) in numbers.iter().zip(pulses).enumerate() {
        match tracker.push(sightings) {
            Ok(_) => tellable.push(n),
            Err(error) => {
                first_error.get_or_insert((i, error));
            }
        }
    }
    match first_error {
        Some(error) if tellable.len() < 2 => Err(error),
        _ => Ok(tellable),
    }
}
