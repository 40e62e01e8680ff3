//! The radar's track from its targets, in the scene.
//!
//! [`subaperture_motion::track`] tells poses in a frame of its own. They are laid upon the recorded positions as well as turn and shift can do it (least squares),
//! so that an image lies where it would, and their shape is that of the echoes alone. Where the recorded positions do not move, the first pose
//! is laid upon them.
//!
//! A target that was lost and found again has another number then. The track tells that both are at one place, within a range resolution: all echoes are given to targets
//! again, by the ranges and angles that poses and places say, and the track is found once more.

use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

use glam::{DMat2, DMat3, DQuat, DVec2, DVec3};
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::Channels;
use subaperture_motion::{
    Array, Increment, MotionError, Pose, Sighting, Target, Track, Tracker, track,
};

use crate::arrangement::Arrangement;
use crate::echo::Echo;
use crate::fault::Fault;
use crate::follow::{Follow, associate, differences_rad, sighting};
use crate::see::{Seen, Settings, TargetsError, see};

/// Times that echoes are looked at again by what is known of the targets.
const LOOKS: usize = 2;
/// Pulses that motion looks at again.
const WINDOW: usize = 10;
/// Targets whose places are found, those seen most often: a pulse's time grows with the cube of their number.
const MOST_SOLVED: usize = 48;
/// Pulses in which a target has to be told of: its place is three numbers more to find, and fewer pulses say nothing of the others.
const LEAST_TOLD: usize = 10;
/// Squared errors over their expected number from which on something is wrong with the model, not the noise.
const MISFIT: f64 = 2.0;

/// A moment of the track.
#[derive(Clone, Debug, PartialEq)]
pub struct Moment {
    /// The pulse's number in the recording.
    pub pulse: usize,
    /// When, seconds from the collection's start.
    pub time_s: f64,
    /// The body's origin, metres in the scene frame.
    pub position_m: DVec3,
    /// From the body's axes to the scene's.
    pub attitude: DQuat,
    /// Covariance of x and y, metres, and of the heading, radians: along the scene's axes where the plane of motion is level, else along the body's of the first pulse; relative to
    /// the first pose's place and the direction to the first target.
    pub covariance: DMat3,
    /// Targets seen.
    pub targets: usize,
    /// RMS of what ranges and phases are off, in standard deviations.
    pub residual: f64,
    /// Where the recording has the middle of the antennas, metres in the scene frame.
    pub recorded_m: DVec3,
}

impl Moment {
    /// Standard deviation of the place along the worst direction, metres.
    pub fn spread_m(&self) -> f64 {
        self.axes()[0].length()
    }

    /// A closed ring about the place, at so many standard deviations, metres in the scene's x and y where the plane of motion is level.
    pub fn ellipse_m(&self, sigmas: f64) -> Vec<DVec2> {
        const CORNERS: usize = 36;
        let [major, minor] = self.axes();
        let corner = |i: usize| {
            let (sin, cos) = libm::sincos(TAU * i as f64 / CORNERS as f64);
            self.position_m.truncate() + sigmas * (cos * major + sin * minor)
        };
        (0..=CORNERS).map(corner).collect()
    }

    /// Half axes of the ellipse of one standard deviation.
    fn axes(&self) -> [DVec2; 2] {
        let c = &self.covariance;
        let (a, b, both) = (c.x_axis.x, c.y_axis.y, c.x_axis.y);
        let (middle, half) = (0.5 * (a + b), libm::hypot(0.5 * (a - b), both));
        let towards = DVec2::from_angle(0.5 * libm::atan2(2.0 * both, a - b));
        let size = |variance: f64| variance.max(0.0).sqrt();
        [
            size(middle + half) * towards,
            size(middle - half) * towards.perp(),
        ]
    }
}

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
    let count = |target: usize| {
        let all = kept.iter().flat_map(|&n| &pulses[n]);
        all.filter(|sighting| sighting.target == target).count()
    };
    let places = found.targets.iter().map(|(number, target)| Place {
        target: *number,
        pulses: count(*number),
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

/// A track, of these pulses.
struct Solved {
    /// Their numbers.
    kept: Vec<usize>,
    /// Of all pulses.
    pulses: Vec<Vec<Sighting>>,
    found: Track,
}

impl Solved {
    fn new(seen: &Seen, pulses: Vec<Vec<Sighting>>) -> Result<Self, TargetsError> {
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

    /// The pose at a pulse, between those that are known if need be.
    fn pose(&self, pulse: usize) -> Pose {
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

/// Sightings of all pulses by the places of a track's targets: those that are one place are one target, and those too near to each other in range are
/// not told.
fn looked_again(seen: &Seen, solved: &Solved, follow: Follow) -> Vec<Vec<Sighting>> {
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
    let count = |number: usize| {
        let all = solved.kept.iter().flat_map(|&n| &solved.pulses[n]);
        all.filter(|sighting| sighting.target == number).count()
    };
    let mut all: Vec<(usize, usize, Target)> = solved
        .found
        .targets
        .iter()
        .map(|(number, target)| (count(*number), *number, *target))
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

/// Sightings of the targets that are seen most often.
fn solved_for(pulses: &[Vec<Sighting>]) -> Vec<Vec<Sighting>> {
    let mut counts: HashMap<usize, usize> = HashMap::new();
    for sighting in pulses.iter().flatten() {
        *counts.entry(sighting.target).or_default() += 1;
    }
    let mut by_count: Vec<(usize, usize)> = counts.into_iter().collect();
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

/// A frame laid upon the recorded positions.
struct Laid {
    origin_m: DVec3,
    body: DQuat,
    turn_rad: f64,
    shift_m: DVec2,
    /// The scene's x from the body's in the first pulse, if the plane is level.
    yaw_rad: f64,
    reversed: bool,
}

impl Laid {
    fn new(
        found: &Track,
        recorded_m: &[DVec3],
        arrangement: &Arrangement,
        wavelength_m: f64,
    ) -> Self {
        let body = arrangement.attitude;
        let in_plane = |at: &DVec3| (body.inverse() * (*at - arrangement.origin_m)).truncate();
        let wanted: Vec<DVec2> = recorded_m.iter().map(in_plane).collect();
        let got: Vec<DVec2> = found.poses.iter().map(|pose| pose.at_m).collect();
        let share = 1.0 / got.len() as f64;
        let mean = |all: &[DVec2]| all.iter().sum::<DVec2>() * share;
        let (mean_got, mean_wanted) = (mean(&got), mean(&wanted));
        let (mut dot, mut cross, mut size) = (0.0, 0.0, 0.0);
        for (got, wanted) in got.iter().zip(&wanted) {
            let (a, b) = (*got - mean_got, *wanted - mean_wanted);
            dot += a.dot(b);
            cross += a.perp_dot(b);
            size += b.length_squared();
        }
        let moves = (size * share).sqrt() > 0.25 * wavelength_m;
        let mean_heading = found.poses.iter().map(|pose| pose.heading_rad).sum::<f64>() * share;
        let (turn_rad, shift_m) = match moves {
            true => {
                let turn_rad = libm::atan2(cross, dot);
                (turn_rad, mean_wanted - turned(turn_rad, mean_got))
            }
            false => {
                let turn_rad = -found.poses[0].heading_rad;
                (turn_rad, wanted[0] - turned(turn_rad, got[0]))
            }
        };
        let off = (turn_rad + mean_heading) / TAU;
        let level = (body * DVec3::Z).distance(DVec3::Z) < 1e-6;
        let x = body * DVec3::X;
        Self {
            origin_m: arrangement.origin_m,
            body,
            turn_rad,
            shift_m,
            yaw_rad: match level {
                true => libm::atan2(x.y, x.x),
                false => 0.0,
            },
            reversed: moves && TAU * (off - off.round()).abs() > 0.5 * PI,
        }
    }

    /// Of a place in the plane, as far out of it as `recorded_m` is.
    fn position_m(&self, at_m: DVec2, recorded_m: DVec3) -> DVec3 {
        let out_m = (self.body.inverse() * (recorded_m - self.origin_m)).z;
        let laid = turned(self.turn_rad, at_m) + self.shift_m;
        self.origin_m + self.body * laid.extend(out_m)
    }

    fn attitude(&self, pose: &Pose) -> DQuat {
        self.body * DQuat::from_rotation_z(pose.heading_rad + self.turn_rad)
    }

    fn covariance(&self, covariance: &DMat3) -> DMat3 {
        let (sin, cos) = libm::sincos(self.turn_rad + self.yaw_rad);
        let turn = DMat3::from_mat2(DMat2::from_cols(
            DVec2::new(cos, sin),
            DVec2::new(-sin, cos),
        ));
        turn * *covariance * turn.transpose()
    }
}

fn turned(by_rad: f64, at_m: DVec2) -> DVec2 {
    let (sin, cos) = libm::sincos(by_rad);
    DVec2::new(cos * at_m.x - sin * at_m.y, sin * at_m.x + cos * at_m.y)
}
