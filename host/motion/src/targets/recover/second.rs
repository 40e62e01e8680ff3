//! Second association: echoes are assigned to the estimated positions of targets and movers.

use crate::{Sighting, Target};

use super::moving::Moving;
use super::solved::Solved;
use crate::targets::detection::Detections;
use crate::targets::echo::Echo;
use crate::targets::follow::{TrackerSettings, associate, differences_rad, sighting};

/// Targets up to this multiple of the follower's distance distort each other's phases by more than noise.
pub(super) const APART: f64 = 4.0 / 3.0;

/// Sightings of all pulses by the positions of the track's targets and the expected positions of movers. Targets in one place are joined, and targets too near to each other in range are left out. Returns those of standing
/// targets, then those of movers by their first number.
pub(super) fn second_sightings(
    seen: &Detections,
    solved: &Solved,
    movers: &[Moving],
    follow: TrackerSettings,
) -> [Vec<Vec<Sighting>>; 2] {
    let targets = distinct(solved, seen.cell_m);
    let gate_m = follow.gate_cells * seen.cell_m;
    let apart_m = APART * follow.apart_cells * seen.cell_m;
    let pulse = |(n, echoes): (usize, &Vec<Echo>)| {
        let pose = solved.pose(n);
        let expected: Vec<(f64, Vec<f64>)> = targets
            .iter()
            .map(|(_, target)| {
                let lines = seen.array.lines(&pose, target);
                let values: Vec<f64> = lines.iter().map(|line| line.value).collect();
                let (range_m, phases_rad) =
                    values.split_last().expect("a range follows the phases");
                (*range_m, differences_rad(phases_rad))
            })
            .collect();
        let moving = movers.iter().map(|moving| moving.expected[n].clone());
        let expected: Vec<Option<(f64, Vec<f64>)>> =
            expected.into_iter().map(Some).chain(moving).collect();
        let each = expected.iter().map(|one| {
            one.as_ref()
                .map(|(range_m, rad)| (*range_m, rad.as_slice()))
        });
        let taken = associate(each, echoes, gate_m);
        let mut assigned = [Vec::new(), Vec::new()];
        for (i, echo) in taken.into_iter().enumerate() {
            let (Some(echo), Some((range_m, _))) = (echo, &expected[i]) else {
                continue;
            };
            let near = |other: &(f64, Vec<f64>)| (other.0 - range_m).abs() < apart_m;
            let alone = expected
                .iter()
                .flatten()
                .filter(|other| near(other))
                .count()
                == 1;
            if alone {
                let [standing, moving] = &mut assigned;
                match targets.get(i) {
                    Some((name, _)) => standing.push(sighting(*name, &echoes[echo])),
                    None => {
                        moving.push(sighting(movers[i - targets.len()].names[0], &echoes[echo]))
                    }
                }
            }
        }
        assigned
    };
    let (standing, moving) = seen
        .echoes
        .iter()
        .enumerate()
        .map(pulse)
        .map(|[standing, moving]| (standing, moving))
        .unzip();
    [standing, moving]
}

/// Targets in different places, most sightings first.
fn distinct(solved: &Solved, cell_m: f64) -> Vec<(usize, Target)> {
    let counts = solved.times_seen();
    let mut all: Vec<(usize, usize, Target)> = solved
        .found
        .targets
        .iter()
        .map(|(number, target)| (counts.get(number).copied().unwrap_or(0), *number, *target))
        .collect();
    all.sort_by_key(|(count, number, _)| (std::cmp::Reverse(*count), *number));
    let mut distinct: Vec<(usize, Target)> = Vec::new();
    for (_, number, target) in all {
        let is_there = |(_, other): &(usize, Target)| other.at_m.distance(target.at_m) < cell_m;
        if !distinct.iter().any(is_there) {
            distinct.push((number, target));
        }
    }
    distinct
}
