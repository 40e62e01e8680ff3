//! First track: from standing targets, if they can be separated from moving ones.
//!
//! [`movers::classify`] compares targets segment by segment. If it finds a standing group, the track is estimated without moving targets. With fewer than three targets at a time it finds none: all targets are assumed to
//! stand still, and the squared residuals of the whole track decide. If they contradict it, the track of every pair of targets is tried: a pair is accepted if it is the only one that fits.

use std::collections::BTreeSet;

use crate::movers;
use crate::movers::Doubt;

use super::solved::{Solved, without};
use super::trust::{FITS, misfit};
use crate::targets::detection::{Detections, TargetsError};

/// Pulses of a segment.
const SEGMENT: usize = 32;
/// Largest number of targets whose pairs are tried: each pair is a track.
const MAX_TRIED: usize = 5;
/// Squared residuals over their expectation: upper limit for the accepted pair's track, and lower limit for every other pair's.
const ONLY: [f64; 2] = [1.3, 1.5];

/// Track of standing targets, and the targets left out.
pub(super) struct First {
    pub(super) solved: Solved,
    /// Numbers of the moving targets.
    pub(super) moving: BTreeSet<usize>,
    /// Unclassified targets that are not part of the track.
    pub(super) unknown: BTreeSet<usize>,
    /// Whether the track rests on two targets that no third confirms.
    pub(super) of_pair: bool,
}

/// First track from the sightings of all pulses.
///
/// # Errors
/// [`TargetsError`].
pub(super) fn first(
    seen: &Detections,
    sightings: &[Vec<crate::Sighting>],
) -> Result<First, TargetsError> {
    let classes = movers::classify(&seen.array, sightings, SEGMENT)
        .map_err(|(pulse, source)| TargetsError::Motion { pulse, source })?;
    let moving: BTreeSet<usize> = classes.moving.iter().copied().collect();
    let unknown: BTreeSet<usize> = classes.unknown.iter().copied().collect();
    let solve = |left_out: &BTreeSet<usize>| Solved::new(seen, without(sightings, left_out));
    if !classes.standing.is_empty() {
        let all = solve(&moving);
        let fits = |solved: &Solved| misfit(solved) < FITS;
        if unknown.is_empty() || all.as_ref().is_ok_and(fits) {
            return Ok(First {
                solved: all?,
                moving,
                unknown: BTreeSet::new(),
                of_pair: false,
            });
        }
        let both: BTreeSet<usize> = moving.union(&unknown).copied().collect();
        let known = solve(&both);
        return match (all, known) {
            (Ok(all), Ok(known)) if misfit(&all) <= misfit(&known) => Ok(First {
                solved: all,
                moving,
                unknown: BTreeSet::new(),
                of_pair: false,
            }),
            (_, Ok(solved)) => Ok(First {
                solved,
                moving,
                unknown,
                of_pair: false,
            }),
            (all, Err(_)) => Ok(First {
                solved: all?,
                moving,
                unknown: BTreeSet::new(),
                of_pair: false,
            }),
        };
    }
    let no_target = BTreeSet::new();
    let all = solve(&no_target);
    if all.as_ref().is_ok_and(|solved| misfit(solved) < FITS) {
        return Ok(First {
            solved: all?,
            moving: no_target.clone(),
            unknown: no_target,
            of_pair: false,
        });
    }
    if let Some((solved, moving)) = only_group(seen, sightings) {
        return Ok(First {
            solved,
            moving,
            unknown: no_target,
            of_pair: true,
        });
    }
    // At least three targets, but no three that agree: no track.
    let decides = |doubt: &&Doubt| !matches!(doubt, Doubt::Few { .. });
    match classes.doubts.into_iter().find(|doubt| decides(&doubt)) {
        Some(doubt) => Err(TargetsError::Movers(doubt)),
        None => Ok(First {
            solved: all?,
            moving: no_target.clone(),
            unknown: no_target,
            of_pair: false,
        }),
    }
}

/// Track of the only pair of targets that fits.
fn only_group(
    seen: &Detections,
    sightings: &[Vec<crate::Sighting>],
) -> Option<(Solved, BTreeSet<usize>)> {
    let names: BTreeSet<usize> = sightings.iter().flatten().map(|s| s.target).collect();
    let names: Vec<usize> = names.into_iter().collect();
    if !(3..=MAX_TRIED).contains(&names.len()) {
        return None;
    }
    let mut tried = Vec::new();
    for (i, a) in names.iter().enumerate() {
        for b in &names[i + 1..] {
            let left_out: BTreeSet<usize> = names
                .iter()
                .filter(|n| *n != a && *n != b)
                .copied()
                .collect();
            if let Ok(solved) = Solved::new(seen, without(sightings, &left_out)) {
                tried.push((misfit(&solved), solved, left_out));
            }
        }
    }
    tried.sort_by(|a, b| a.0.total_cmp(&b.0));
    let second = tried.get(1).map_or(f64::INFINITY, |tried| tried.0);
    let (best, solved, moving) = tried.into_iter().next()?;
    (best < ONLY[0] && second > ONLY[1]).then_some((solved, moving))
}
