//! Echoes given to targets once more, by the places that a track has found.

use subaperture_motion::{Sighting, Target};

use super::solved::Solved;
use crate::echo::Echo;
use crate::follow::{Follow, associate, differences_rad, sighting};
use crate::see::Seen;

/// Sightings of all pulses by the places of a track's targets: those that are one place are one target, and those too near to each other in range are
/// not told.
pub(super) fn looked_again(seen: &Seen, solved: &Solved, follow: Follow) -> Vec<Vec<Sighting>> {
    let targets = distinct(solved, seen.cell_m);
    let gate_m = follow.gate_cells * seen.cell_m;
    let apart_m = follow.apart_cells * seen.cell_m;
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
        let each = expected
            .iter()
            .map(|(range_m, rad)| Some((*range_m, rad.as_slice())));
        let taken = associate(each, echoes, gate_m);
        let mut told = Vec::new();
        for (i, echo) in taken.into_iter().enumerate() {
            let near = |other: &(f64, Vec<f64>)| (other.0 - expected[i].0).abs() < apart_m;
            let alone = expected.iter().filter(|other| near(other)).count() == 1;
            if let Some(echo) = echo.filter(|_| alone) {
                told.push(sighting(targets[i].0, &echoes[echo]));
            }
        }
        told
    };
    seen.echoes.iter().enumerate().map(pulse).collect()
}

/// Targets at different places, those seen most often first.
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
