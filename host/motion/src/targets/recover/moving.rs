//! Moving targets: joined where one was lost and found again, with expected ranges and phase differences.

use std::collections::BTreeSet;

use crate::movers::{Mover, velocities};
use crate::{Pose, Sighting, Target};

use super::solved::Solved;
use crate::targets::detection::Detections;
use crate::targets::follow::differences_rad;

/// Squared velocity over its variance that one standing target in ten million exceeds.
const MOVES: f64 = 32.0;
/// Least number of pulses with a sighting of a mover.
const MIN_SEEN: usize = 16;
/// Pulses beyond the last sighting for which a mover of changing velocity is expected.
const BEYOND: usize = 30;
/// Sightings from which the range rate at an end is taken.
const AT_END: usize = 8;

/// Moving target with all its numbers.
#[derive(Clone)]
pub(super) struct Moving {
    pub(super) names: Vec<usize>,
    pub(super) mover: Mover,
    /// Expected range and phase differences of each pulse of the recording.
    pub(super) expected: Vec<Option<(f64, Vec<f64>)>>,
}

/// Poses and times of the pulses with a pose.
struct Posed {
    poses: Vec<Pose>,
    times_s: Vec<f64>,
}

/// Movers among these targets, with velocities beyond their errors, in the track's frame; and those of them that stand still on the track. Sightings within `apart_m` in range of a place of the track are not used.
pub(super) fn all(
    seen: &Detections,
    solved: &Solved,
    all_sightings: &[Vec<Sighting>],
    certain: &BTreeSet<usize>,
    doubtful: &BTreeSet<usize>,
    apart_m: f64,
) -> (Vec<Moving>, BTreeSet<usize>) {
    let all_sightings = &clear(seen, solved, all_sightings, certain, doubtful, apart_m);
    let posed = Posed {
        poses: solved.found.poses.clone(),
        times_s: solved.kept.iter().map(|&n| seen.times_s[n]).collect(),
    };
    let of = |names: &[usize]| -> Option<Mover> {
        let pulse = |&n: &usize| -> Vec<Sighting> {
            let own = all_sightings[n]
                .iter()
                .filter(|s| names.contains(&s.target));
            let named = own.map(|s| Sighting {
                target: names[0],
                ..s.clone()
            });
            // Numbers seen in one pulse are two targets.
            named.take(1).collect()
        };
        let pulses: Vec<Vec<Sighting>> = solved.kept.iter().map(pulse).collect();
        let found = velocities(&seen.array, &pulses, &posed.poses, &posed.times_s);
        found.into_iter().next()
    };
    let moves = |mover: &Mover| {
        let v = mover.velocity_m_s;
        let square = v.dot(mover.covariance.inverse() * v) / mover.misfit().max(1.0);
        let gone_m = v.length() * (mover.seen_s[1] - mover.seen_s[0]);
        // A target without a constant velocity moves if the classification says so.
        let square = match certain.contains(&mover.target) && !mover.is_steady() {
            true => f64::INFINITY,
            false => square,
        };
        mover.pulses >= MIN_SEEN && square > MOVES && gone_m > 0.25 * seen.array.wavelength_m
    };
    let mut groups: Vec<(Vec<usize>, Mover)> = Vec::new();
    let mut standing = BTreeSet::new();
    for &name in certain.union(doubtful) {
        let Some(mover) = of(&[name]) else { continue };
        if moves(&mover) {
            groups.push((vec![name], mover));
        } else if mover.is_steady() && mover.pulses >= MIN_SEEN {
            standing.insert(name);
        }
    }
    groups.sort_by(|a, b| a.1.seen_s[0].total_cmp(&b.1.seen_s[0]));
    // The same target under another number continues its motion.
    let mut i = 0;
    while i < groups.len() {
        let joined = (i + 1..groups.len()).find_map(|j| {
            let apart = groups[j].1.seen_s[0] > groups[i].1.seen_s[1];
            let near = || {
                let [a, b] = [&groups[i].1, &groups[j].1];
                let middle_s = 0.5 * (a.seen_s[1] + b.seen_s[0]);
                a.place_m(middle_s).distance(b.place_m(middle_s)) < 6.0 * seen.cell_m
            };
            if !apart || !near() {
                return None;
            }
            let names: Vec<usize> = groups[i].0.iter().chain(&groups[j].0).copied().collect();
            let both = of(&names)?;
            let worst = groups[i].1.misfit().max(groups[j].1.misfit());
            (both.is_steady() || both.misfit() < 1.5 * worst).then_some((j, names, both))
        });
        match joined {
            Some((j, names, mover)) => {
                groups.remove(j);
                groups[i] = (names, mover);
            }
            None => i += 1,
        }
    }
    let each = groups.into_iter();
    let movers = each.map(|(names, mover)| Moving {
        expected: expected(seen, solved, all_sightings, &names, &mover),
        names,
        mover,
    });
    (movers.collect(), standing)
}

/// Sightings of these targets at more than `apart_m` in range from every place of the track: a nearer one may be the echo of that place, or be distorted by it.
fn clear(
    seen: &Detections,
    solved: &Solved,
    all_sightings: &[Vec<Sighting>],
    certain: &BTreeSet<usize>,
    doubtful: &BTreeSet<usize>,
    apart_m: f64,
) -> Vec<Vec<Sighting>> {
    let pulse = |(n, sightings): (usize, &Vec<Sighting>)| {
        let own = |s: &&Sighting| certain.contains(&s.target) || doubtful.contains(&s.target);
        let own: Vec<&Sighting> = sightings.iter().filter(own).collect();
        if own.is_empty() {
            return Vec::new();
        }
        let pose = solved.pose(n);
        let range_m = |target: &Target| seen.array.lines(&pose, target).last().map(|l| l.value);
        let places = solved.found.targets.iter();
        let places_m: Vec<f64> = places.filter_map(|(_, target)| range_m(target)).collect();
        let alone = |s: &&Sighting| places_m.iter().all(|m| (m - s.range_m).abs() > apart_m);
        own.into_iter().filter(alone).cloned().collect()
    };
    all_sightings.iter().enumerate().map(pulse).collect()
}

/// Expected range and phase differences of a mover in every pulse: by its velocity if constant, else interpolated from its sightings.
fn expected(
    seen: &Detections,
    solved: &Solved,
    all_sightings: &[Vec<Sighting>],
    names: &[usize],
    mover: &Mover,
) -> Vec<Option<(f64, Vec<f64>)>> {
    let count = seen.echoes.len();
    if mover.is_steady() {
        let at = |n: usize| {
            let target = Target {
                at_m: mover.place_m(seen.times_s[n]),
                ..Target::default()
            };
            let lines = seen.array.lines(&solved.pose(n), &target);
            let values: Vec<f64> = lines.iter().map(|line| line.value).collect();
            let (range_m, phases_rad) = values.split_last().expect("a range follows the phases");
            Some((*range_m, differences_rad(phases_rad)))
        };
        return (0..count).map(at).collect();
    }
    let own: Vec<(usize, &Sighting)> = all_sightings
        .iter()
        .enumerate()
        .flat_map(|(n, pulse)| pulse.iter().map(move |s| (n, s)))
        .filter(|(_, s)| names.contains(&s.target))
        .collect();
    let rate = |some: &[(usize, &Sighting)]| match some {
        [first, .., last] if last.0 > first.0 => {
            (last.1.range_m - first.1.range_m) / (last.0 - first.0) as f64
        }
        _ => 0.0,
    };
    let ends = [
        rate(&own[..own.len().min(AT_END)]),
        rate(&own[own.len().saturating_sub(AT_END)..]),
    ];
    let at = |n: usize| {
        let next = own.partition_point(|(seen, _)| *seen < n);
        let beyond = |(m, s): &(usize, &Sighting), rate: f64| {
            let away = n as f64 - *m as f64;
            (n.abs_diff(*m) <= BEYOND)
                .then(|| (s.range_m + rate * away, differences_rad(&s.phases_rad)))
        };
        match (next.checked_sub(1).map(|i| &own[i]), own.get(next)) {
            (Some(before), Some(after)) => {
                let part = (n - before.0) as f64 / (after.0 - before.0) as f64;
                let range_m = before.1.range_m + part * (after.1.range_m - before.1.range_m);
                let near = if part < 0.5 { before } else { after };
                Some((range_m, differences_rad(&near.1.phases_rad)))
            }
            (Some(last), None) => beyond(last, ends[1]),
            (None, Some(first)) => beyond(first, ends[0]),
            (None, None) => None,
        }
    };
    (0..count).map(at).collect()
}
