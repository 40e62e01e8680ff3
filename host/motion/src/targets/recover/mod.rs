//! The radar's track in the scene, from its targets.
//!
//! ```text
//! sightings ── first ──> track of standing targets ── moving ──> velocities of movers ─┐
//!                ^                                                                     │
//!                └──────── second: echoes assigned to places and movers again <────────┘ ── aligned, trust ──> Recovered
//! ```
//!
//! [`crate::track`] estimates poses in a frame of its own. One turn and one shift align them with the recorded positions by least squares: an image lies where it would on the recorded track, and the track's shape is
//! that of the echoes alone. If the recorded positions do not move, the first pose is aligned.
//!
//! **Movers.** Moving targets are left out, and their velocities are estimated on the track, in its aligned frame: errors of the recorded positions that turn the track turn velocities too.
//!
//! **Target numbers.** A target that was lost and found again has two numbers. The track shows that both are in one place within a range resolution: all echoes are then assigned again by the ranges and directions of poses, places
//! and movers, and the track is estimated once more.
//!
//! **Errors.** Covariances are those of the aligned track's shape, enlarged where residuals exceed the stated noise. [`Recovered::trusted`] refuses tracks with errors that no covariance describes, [`Recovered::doubts`] lists other
//! reasons for doubt.
//!
//! **Accuracy.** `tests/movers.rs`; over seeds and SNR `tests/seeds.rs`.

mod aligned;
mod first;
mod moment;
mod moving;
mod second;
mod solved;
mod trust;

use std::collections::BTreeSet;

use crate::joint::Datum;
use crate::{Increment, Track};
use glam::{DMat3, DVec3};
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::Channels;

use crate::targets::detection::{Detections, Settings, TargetsError, detect_targets};
use crate::targets::fault::Fault;
use aligned::Aligned;
use first::{First, first};
use moving::Moving;
use second::second_sightings;
use solved::{Solved, solved_for, without};
use trust::{FITS, Residuals, misfit};

pub use moment::Moment;

/// Rounds of second association.
const ROUNDS: usize = 2;
/// Largest number of rounds, while each round finds more poses.
const MAX_ROUNDS: usize = 5;
/// Squared residuals of a block of pulses over their expectation that are reported.
const UNEVEN: f64 = 9.0;
/// Squared residuals over their expectation beyond which a track is refused.
const REFUSED: f64 = 4.0;
/// The same for two targets at a time: half of the measurements then determine poses and fit in any case.
const REFUSED_OF_TWO: f64 = 1.5;
/// Pulses without a pose, as a fraction of all, from which on movers without a steady velocity are a reason for doubt: echoes so weak lose targets, and
/// phases are unwrapped over the gaps.
const WEAK: f64 = 0.1;
/// RMS distance from the recorded positions over their extent beyond which the two contradict each other.
const CONTRADICTS: f64 = 0.5;

/// Standing target of the track.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Number of the target.
    pub target: usize,
    /// Number of pulses with a sighting.
    pub pulses: usize,
    /// Position, metres in the scene frame, at the height of the radar where the plane of motion is level.
    pub position_m: DVec3,
}

/// Moving target in the scene frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Mover {
    /// Numbers under which it was followed, one after another.
    pub targets: Vec<usize>,
    /// Number of pulses with a sighting.
    pub pulses: usize,
    /// Times of the first and the last sighting, seconds from the collection's start.
    pub seen_s: [f64; 2],
    /// Position at the first sighting, metres in the scene frame, in the plane of motion.
    pub position_m: DVec3,
    /// Velocity, m/s in the scene frame; the mean if it changes.
    pub velocity_m_s: DVec3,
    /// Standard deviation of the velocity along its worst direction, m/s.
    pub sigma_m_s: f64,
    /// Whether the velocity is constant.
    pub steady: bool,
}

/// The radar's track with its targets.
#[derive(Clone, Debug)]
pub struct Recovered {
    /// Poses in the order of pulses; pulses that do not determine one have none.
    pub moments: Vec<Moment>,
    /// Increments between poses in the body's axes, with covariances of x, y and turn for use as independent errors ([`Track::steps`]).
    pub steps: Vec<(Increment, DMat3)>,
    /// Positions of the standing targets.
    pub places: Vec<Place>,
    /// Moving targets with their velocities.
    pub movers: Vec<Mover>,
    /// Targets and sightings of the recording.
    pub seen: Detections,
    /// Sum of squared residuals in standard deviations, and its expectation: measurements less unknowns.
    pub chi_square: [f64; 2],
    /// Whether the least squares converged.
    pub converged: bool,
    /// RMS distance from the recorded positions, metres; `None` if these do not move.
    pub recorded_off_m: Option<f64>,
}

impl Recovered {
    /// Check that the residuals do not contradict the track. Errors that no covariance describes (phases off by whole turns, targets mistaken for others or moving unnoticed, motion out of the plane) leave residuals of many times
    /// the noise.
    ///
    /// # Errors
    /// [`TargetsError::Diverged`]; [`TargetsError::Sparse`] where fewer than half of all pulses have a pose: whole turns of phase cannot be checked over the gaps.
    pub fn trusted(&self) -> Result<(), TargetsError> {
        let [poses, pulses] = [self.moments.len(), self.seen.times_s.len()];
        if 2 * poses < pulses {
            return Err(TargetsError::Sparse { poses, pulses });
        }
        let [sum, expected] = self.chi_square;
        let misfit = sum / expected.max(1.0);
        let most = match by_two(&self.moments) {
            true => REFUSED_OF_TWO,
            false => REFUSED,
        };
        // A track that fits badly and differs from the recorded one is wrong.
        let elsewhere =
            |fault: &Fault| matches!(fault, Fault::Contradicts { .. } | Fault::Reversed);
        let most = match self.seen.faults.iter().any(elsewhere) {
            true => most.min(FITS),
            false => most,
        };
        match misfit > most || !self.converged {
            true => Err(TargetsError::Diverged {
                ratio: misfit.sqrt(),
                converged: self.converged,
            }),
            false => Ok(()),
        }
    }

    /// Faults that may make the track wrong beyond its covariances.
    pub fn doubts(&self) -> impl Iterator<Item = &Fault> {
        self.seen.faults.iter().filter(|fault| fault.is_doubt())
    }

    /// Length of the track from pose to pose, metres.
    pub fn length_m(&self) -> f64 {
        let pairs = self.moments.windows(2);
        pairs
            .map(|pair| pair[0].position_m.distance(pair[1].position_m))
            .sum()
    }
}

/// Estimate the track of a recording's radar. The recording is read once, in blocks; memory grows with pulses and targets, not with samples.
///
/// # Errors
/// [`TargetsError`].
pub fn recover(
    channels: Channels,
    settings: &Settings,
    monitor: &dyn Monitor,
) -> Result<Recovered, TargetsError> {
    let nominal_m = recorded_m(&channels);
    let mut seen = detect_targets(channels, settings, monitor)?;
    let sightings = solved_for(&seen.pulses);
    let apart_m = second::APART * settings.follow.apart_cells * seen.cell_m;
    let First {
        mut solved,
        moving,
        unknown,
        of_pair,
    } = first(&seen, &sightings)?;
    let all = |solved: &Solved, moving: &BTreeSet<usize>, unknown: &BTreeSet<usize>| {
        moving::all(&seen, solved, &sightings, moving, unknown, apart_m)
    };
    let (mut movers, standing) = all(&solved, &moving, &unknown);
    if !standing.is_empty() && !of_pair {
        // Targets that a segment took for movers, or did not classify, may stand still by the whole track.
        let left_out: BTreeSet<usize> = moving.union(&unknown).copied().collect();
        let left_out: BTreeSet<usize> = left_out.difference(&standing).copied().collect();
        if let Ok(more) = Solved::new(&seen, without(&sightings, &left_out))
            && is_better(&more, &solved)
        {
            solved = more;
            movers = all(&solved, &left_out, &BTreeSet::new()).0;
        }
    }
    // Assign echoes to the estimated positions, and join targets in one place.
    for round in 0..MAX_ROUNDS {
        let before = solved.kept.len();
        let [standing, of_movers] = second_sightings(&seen, &solved, &movers, settings.follow);
        match Solved::new(&seen, solved_for(&standing)) {
            Ok(better) if is_better(&better, &solved) => solved = better,
            _ => break,
        }
        if round + 1 >= ROUNDS && solved.kept.len() <= before {
            break;
        }
        movers = updated_movers(&seen, &solved, &movers, &of_movers, apart_m);
    }
    let counts = solved.times_seen();
    let residuals = Residuals::new(&seen, &solved);
    let Solved {
        kept,
        pulses,
        found,
    } = solved;
    let recorded: Vec<DVec3> = kept.iter().map(|&n| nominal_m[n]).collect();
    let aligned = Aligned::new(
        &found,
        &recorded,
        &seen.arrangement,
        seen.array.wavelength_m,
    );
    let datum = match aligned.moves {
        true => Datum::Shape,
        false => Datum::First,
    };
    let variances = found.joint_covariances.aligned(&found.poses, datum);
    let covariance = |i: usize| {
        variances[i].own * residuals.own[i] + variances[i].by_targets * residuals.by_targets
    };
    let moments = kept.iter().enumerate().map(|(i, &n)| Moment {
        pulse: n,
        time_s: seen.times_s[n],
        position_m: aligned.position_m(found.poses[i].at_m, recorded[i]),
        attitude: aligned.attitude(&found.poses[i]),
        covariance: aligned.covariance(&covariance(i)),
        targets: pulses[n].len(),
        residual: residuals.of_pulses[i],
        recorded_m: recorded[i],
    });
    let moments: Vec<Moment> = moments.collect();
    let places = found.targets.iter().map(|(number, target)| Place {
        target: *number,
        pulses: counts.get(number).copied().unwrap_or(0),
        position_m: aligned.position_m(target.at_m, recorded[0]),
    });
    let places = places.collect();
    let movers = movers
        .iter()
        .map(|moving| mover(moving, &aligned, recorded[0]));
    let movers: Vec<Mover> = movers.collect();
    seen.faults
        .extend(wandering(&movers, [moments.len(), pulses.len()]));
    let recorded_off_m = aligned.moves.then(|| off_m(&moments));
    seen.faults
        .extend(faults(&found, &kept, pulses.len(), aligned.reversed));
    if let Some(off_m) = recorded_off_m
        && off_m > CONTRADICTS * aligned.extent_m
    {
        seen.faults.push(Fault::Contradicts {
            off_m,
            extent_m: aligned.extent_m,
        });
    }
    if by_two(&moments) && !of_pair {
        seen.faults.push(Fault::Unconfirmed);
    }
    if of_pair {
        seen.faults.push(Fault::TwoTargets {
            left_out: moving.len(),
        });
    }
    let (worst, place) = residuals.worst();
    if worst > UNEVEN && worst > 1.01 * found.chi_square[0] / found.chi_square[1].max(1.0) {
        seen.faults.push(Fault::Uneven {
            ratio: worst,
            pulse: kept[place],
        });
    }
    // Increments have the larger of both enlargements.
    let steps = found.steps.into_iter().enumerate();
    let steps = steps.map(|(i, (step, variance))| {
        let larger = residuals.by_targets.max(residuals.own[i]);
        (step, variance * larger)
    });
    Ok(Recovered {
        moments,
        steps: steps.collect(),
        places,
        movers,
        seen,
        chi_square: found.chi_square,
        converged: found.converged,
        recorded_off_m,
    })
}

/// Whether the track of another round is better.
fn is_better(after: &Solved, before: &Solved) -> bool {
    let [after_misfit, before_misfit] = [after, before].map(misfit);
    let fits = after_misfit < FITS.max(1.1 * before_misfit);
    fits && (after.kept.len() >= before.kept.len() || before_misfit > FITS)
}

/// Movers estimated from the sightings of another round; unchanged where these are too few.
fn updated_movers(
    seen: &Detections,
    solved: &Solved,
    movers: &[Moving],
    sightings: &[Vec<crate::Sighting>],
    apart_m: f64,
) -> Vec<Moving> {
    let one = |before: &Moving| {
        let names = BTreeSet::from([before.names[0]]);
        let found = moving::all(seen, solved, sightings, &names, &BTreeSet::new(), apart_m).0;
        let better = found.into_iter().next();
        let kept = better
            .filter(|after| before.mover.is_steady() && after.mover.pulses >= before.mover.pulses);
        kept.map_or_else(
            || before.clone(),
            |after| Moving {
                names: before.names.clone(),
                ..after
            },
        )
    };
    movers.iter().map(one).collect()
}

/// Mover in the scene.
fn mover(moving: &Moving, aligned: &Aligned, level_m: DVec3) -> Mover {
    let own = &moving.mover;
    let steady = own.is_steady();
    let first_m = match steady {
        true => own.place_m(own.seen_s[0]),
        false => own.first_m,
    };
    let c = &own.covariance;
    let middle = 0.5 * (c.x_axis.x + c.y_axis.y);
    let half = libm::hypot(0.5 * (c.x_axis.x - c.y_axis.y), c.x_axis.y);
    Mover {
        targets: moving.names.clone(),
        pulses: own.pulses,
        seen_s: own.seen_s,
        position_m: aligned.position_m(first_m, level_m),
        velocity_m_s: aligned.velocity_m_s(match steady {
            true => own.velocity_m_s,
            false => own.mean_m_s,
        }),
        sigma_m_s: match steady {
            true => ((middle + half).max(0.0) * own.misfit().max(1.0)).sqrt(),
            false => own.mean_sigma_m_s,
        },
        steady,
    }
}

/// Doubt by movers without a steady velocity among echoes so weak that many of all pulses have no pose. Of 200 recordings at 15 dB in `tests/seeds.rs`
/// 10 of the 11 tracks whose squared errors exceed twice their variances have such a mover, and 15 of the 126 others.
fn wandering(movers: &[Mover], [poses, pulses]: [usize; 2]) -> Option<Fault> {
    let targets = movers.iter().filter(|mover| !mover.steady).count();
    let blind = pulses.saturating_sub(poses);
    let is_weak = blind as f64 > WEAK * pulses as f64;
    (targets > 0 && is_weak).then_some(Fault::Wandering { targets, blind })
}

/// Whether most pulses have two targets.
fn by_two(moments: &[Moment]) -> bool {
    let sightings: usize = moments.iter().map(|moment| moment.targets).sum();
    2 * sightings < 5 * moments.len()
}

/// RMS distance from the recorded positions, metres.
fn off_m(moments: &[Moment]) -> f64 {
    let squares = moments
        .iter()
        .map(|moment| moment.position_m.distance_squared(moment.recorded_m));
    (squares.sum::<f64>() / moments.len().max(1) as f64).sqrt()
}

/// Recorded phase centre of all channels, pulse by pulse, metres in the scene frame.
fn recorded_m(channels: &Channels) -> Vec<DVec3> {
    let mut sums = vec![DVec3::ZERO; channels.num_pulses()];
    for (_, history) in channels.iter() {
        for (sum, pulse) in sums.iter_mut().zip(&history.collection().pulses) {
            *sum += pulse.phase_centre_m();
        }
    }
    let share = 1.0 / channels.len() as f64;
    sums.into_iter().map(|sum| share * sum).collect()
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
    if sum > FITS * expected {
        faults.push(Fault::Misfit {
            chi_square_ratio: sum / expected,
        });
    }
    faults.extend(reversed.then_some(Fault::Reversed));
    faults
}
