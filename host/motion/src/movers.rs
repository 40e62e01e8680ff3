//! Targets that move (C 1.2.4): which, and how fast.
//!
//! **Which.** Through a stretch of pulses each target's range changes by what its phases tell, `dr`, and the direction in which it is seen by `dw`. Of targets that stand still
//!
//! ```text
//! dr_i = -u_i . D        dw_i = -Phi - across(u_i) . D / range_i
//! ```
//!
//! with one motion `D` of the array's middle and one turn `Phi`, in the frame of the stretch's mean heading, and `u_i` the mean direction (to the third order in `D / range`).
//! `D` is good to the error of the mean direction times itself, so that of a motion of some centimetres a tenth of a millimetre is left: what moves by more is
//! seen to. Two targets agree with any motion; the largest group of three or more that agree with one is taken to stand still. What is a little off in each
//! stretch, always to the same side, is found by the sum of its errors.
//!
//! **How fast.** The track being found of the others, a place and a velocity that does not change are found by least squares of the mover's phases and ranges.
//!
//! **What cannot be told.** Only relative motion is measured. If all that is seen moves alike, the radar seems to move the other way; if more targets move alike
//! than stand still, they are taken for those that stand; if as many, [`Doubt::Divided`] says so. A target that moves along a circle about the radar changes no
//! range: its direction tells it, a hundred times less surely.
//!
//! **Units** metres, radians, seconds. **Cost** the cube of the targets a stretch. **Accuracy** `tests/movers.rs`.

use std::collections::{BTreeMap, BTreeSet};

use glam::{DMat2, DMat3, DVec2, DVec3};

use crate::check::{self, MotionError};
use crate::dense::Factor;
use crate::model::{Array, Pose, Sighting};
use crate::series::{Series, line, unit};
use crate::tracker::{Track, track};

/// Squared error of a target's two numbers that one in ten thousand that stand still exceeds.
const USUAL: f64 = 18.4;
/// The same of pairs that tell the motion by themselves, and badly.
const FAR: f64 = 5.0 * USUAL;
/// The same of one in a hundred million.
const NEVER: f64 = 40.0;
/// Standard deviations of a sum of errors that are too many for chance.
const STEADY: f64 = 6.0;
/// Least-squares steps for a velocity, at most.
const MOST_STEPS: usize = 30;

/// Why it is not told which targets move.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Doubt {
    /// There are not three.
    #[error(
        "{targets} targets are seen from pulse {first} to {last}: of less than three it cannot be told which move"
    )]
    Few {
        /// Seen in all these pulses.
        targets: usize,
        /// The first pulse.
        first: usize,
        /// And the last.
        last: usize,
    },
    /// No three of them agree.
    #[error(
        "no three of {targets} targets agree with one motion of the radar from pulse {first} to {last}: all but two of them move, or all do. Their ranges, directions and radial speeds can be trusted, the radar's motion cannot"
    )]
    Disagree {
        /// Seen in all these pulses.
        targets: usize,
        /// The first pulse.
        first: usize,
        /// And the last.
        last: usize,
    },
    /// Two groups are as large.
    #[error(
        "from pulse {first} to {last} targets {some:?} agree with one motion of the radar and {others:?} with another: which of them move is not told"
    )]
    Divided {
        /// One group.
        some: Vec<usize>,
        /// The other.
        others: Vec<usize>,
        /// The first pulse.
        first: usize,
        /// And the last.
        last: usize,
    },
}

/// Which targets move.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sorted {
    /// Those that agreed with the radar's motion throughout.
    pub standing: Vec<usize>,
    /// Those that did not, at one time or another.
    pub moving: Vec<usize>,
    /// Those that no stretch tells of.
    pub unknown: Vec<usize>,
    /// Stretches that do not tell.
    pub doubts: Vec<Doubt>,
}

/// A target that moves.
#[derive(Clone, Debug, PartialEq)]
pub struct Mover {
    /// As it is called.
    pub target: usize,
    /// Where it is at the time 0, in the track's frame.
    pub at_m: DVec2,
    /// Metres a second.
    pub velocity_m_s: DVec2,
    /// Of the velocity.
    pub covariance: DMat2,
    /// The sum of squared errors in standard deviations, and how many numbers there are beyond those that are found: more than that if its velocity changes.
    pub chi_square: [f64; 2],
}

/// A track among targets that move.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// By targets that stand still.
    pub track: Track,
    /// The others, in its frame.
    pub movers: Vec<Mover>,
    /// Which are which.
    pub sorted: Sorted,
}

/// Why there is no such track.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NoScene {
    /// A pulse is wrong, or tells nothing.
    #[error("pulse {pulse}: {error}")]
    Motion {
        /// Which.
        pulse: usize,
        /// What is wrong.
        error: MotionError,
    },
    /// There is not a time of each pulse.
    #[error("{times} times are given of {pulses} pulses, or they do not grow")]
    Times {
        /// Times.
        times: usize,
        /// Pulses.
        pulses: usize,
    },
    /// It is not told which targets stand still.
    #[error("{0}")]
    Doubt(Doubt),
}

/// A target in a stretch of pulses.
struct Change {
    name: usize,
    u: DVec2,
    range_m: f64,
    /// Of its range, and its direction.
    by: [f64; 2],
    /// Standard deviations of both, and of the mean direction.
    sigma: [f64; 3],
}

impl Change {
    fn new(array: &Array, series: &Series) -> Self {
        let looks = &series.looks;
        let (first, last) = (&looks[0], &looks[looks.len() - 1]);
        let k = array.rad_m();
        let channels = array.num_channels() as f64;
        let count = looks.len() as f64;
        let bearings = series.bearings_rad(array);
        let pulses = looks.iter().map(|look| look.pulse as f64);
        let [slope, slope_sigma, mean] = line(pulses.zip(bearings));
        let length = (last.pulse - first.pulse) as f64;
        let bearing_sigma = looks
            .iter()
            .map(|look| look.arrival.bearing_sigma_rad)
            .sum::<f64>()
            / count;
        let [a, b] = [first, last].map(|look| look.sighting.phase_sigma_rad);
        let phase_sigma = libm::hypot(a, b);
        Self {
            name: series.name,
            u: unit(mean),
            range_m: looks.iter().map(|look| look.sighting.range_m).sum::<f64>() / count,
            by: [
                -(last.common_rad - first.common_rad) / (2.0 * k),
                slope * length,
            ],
            sigma: [
                phase_sigma / (2.0 * k * libm::sqrt(channels)),
                slope_sigma * length * bearing_sigma,
                bearing_sigma / libm::sqrt(count),
            ],
        }
    }

    /// How its numbers follow from the motion and turn.
    fn lines(&self) -> [DVec3; 2] {
        let across = self.u.perp() / -self.range_m;
        [(-self.u).extend(0.0), across.extend(-1.0)]
    }

    /// Its errors in standard deviations, if it stands still.
    fn errors(&self, motion: DVec3) -> [f64; 2] {
        let sigma = self.sigmas(motion);
        let lines = self.lines();
        [0, 1].map(|i| (self.by[i] - lines[i].dot(motion)) / sigma[i])
    }

    fn sigmas(&self, motion: DVec3) -> [f64; 2] {
        let by_direction = self.u.perp().dot(motion.truncate()) * self.sigma[2];
        [libm::hypot(self.sigma[0], by_direction), self.sigma[1]]
    }

    fn square(&self, motion: DVec3) -> f64 {
        self.errors(motion).iter().map(|error| error * error).sum()
    }
}

/// The motion that some targets tell; none if it does not follow of them.
fn motion<'a>(some: impl Iterator<Item = &'a Change> + Clone) -> Option<DVec3> {
    let mut motion = DVec3::ZERO;
    // What directions err makes the weights follow the motion.
    for _ in 0..3 {
        let (mut matrix, mut right) = (DMat3::ZERO, DVec3::ZERO);
        for change in some.clone() {
            let both = change.lines().into_iter().zip(change.by);
            for ((line, by), sigma) in both.zip(change.sigmas(motion)) {
                let weighed = line / (sigma * sigma);
                matrix += DMat3::from_cols(line * weighed.x, line * weighed.y, line * weighed.z);
                right += weighed * by;
            }
        }
        let factor = Factor::new(3, &matrix.to_cols_array())?;
        let mut solved = right.to_array();
        factor.solve(&mut solved);
        motion = DVec3::from_array(solved);
    }
    motion.is_finite().then_some(motion)
}

/// The largest group of these that agree with one motion, and that motion.
fn group(changes: &[&Change]) -> Option<(BTreeSet<usize>, DVec3)> {
    let mut best: Option<(BTreeSet<usize>, DVec3, f64)> = None;
    for i in 0..changes.len() {
        for j in i + 1..changes.len() {
            let Some(start) = motion([changes[i], changes[j]].into_iter()) else {
                continue;
            };
            let near = |limit: f64, motion: DVec3| {
                let agree = move |c: &usize| changes[*c].square(motion) < limit;
                (0..changes.len()).filter(agree).collect::<Vec<usize>>()
            };
            let mut found = near(FAR, start);
            let mut by = start;
            // Those that are off go, the worst first.
            while found.len() >= 3 {
                let some = found.iter().map(|&c| changes[c]);
                let Some(told) = motion(some) else { break };
                by = told;
                let worst = found
                    .iter()
                    .copied()
                    .max_by(|&a, &b| changes[a].square(by).total_cmp(&changes[b].square(by)))
                    .expect("there are three");
                if changes[worst].square(by) < USUAL {
                    break;
                }
                found.retain(|&c| c != worst);
            }
            let agree = near(USUAL, by);
            if found.len() < 3 || agree.len() < 3 {
                continue;
            }
            let sum = agree.iter().map(|&c| changes[c].square(by)).sum::<f64>();
            let better = best.as_ref().is_none_or(|(group, _, least)| {
                agree.len() > group.len() || agree.len() == group.len() && sum < *least
            });
            if better {
                best = Some((agree.into_iter().collect(), by, sum));
            }
        }
    }
    best.map(|(group, by, _)| (group, by))
}

/// What stretches tell of a target.
#[derive(Clone, Copy, Default)]
struct Told {
    /// Of its errors in standard deviations.
    sums: [f64; 2],
    /// The largest of its squared errors.
    largest: f64,
    stretches: usize,
    /// In how many it was off.
    off: usize,
}

impl Told {
    fn add(&mut self, change: &Change, motion: DVec3) {
        let errors = change.errors(motion);
        (0..2).for_each(|i| self.sums[i] += errors[i]);
        let square = change.square(motion);
        self.largest = self.largest.max(square);
        self.stretches += 1;
        self.off += usize::from(square >= USUAL);
    }

    /// Off once by what never happens, or more often than happens, or always to one side.
    fn moves(&self) -> bool {
        let limit = STEADY * libm::sqrt(self.stretches as f64);
        let steady = self.sums.iter().any(|sum| sum.abs() > limit);
        self.largest > NEVER || self.off > 1 + self.stretches / 50 || steady
    }
}

/// Which targets move, stretch by stretch of so many pulses, 8 at the least.
///
/// # Errors
/// [`MotionError`], and the pulse's number.
pub fn sort(
    array: &Array,
    pulses: &[Vec<Sighting>],
    stretch: usize,
) -> Result<Sorted, (usize, MotionError)> {
    check::array(array).map_err(|error| (0, error))?;
    for (n, pulse) in pulses.iter().enumerate() {
        check::sightings(array, pulse).map_err(|error| (n, error))?;
    }
    let stretch = stretch.max(8);
    let mut sorted = Sorted::default();
    let mut told: BTreeMap<usize, Told> = BTreeMap::new();
    let mut all = Vec::new();
    for (i, some) in pulses.chunks(stretch).enumerate() {
        if some.len() < 8 {
            continue;
        }
        let first = i * stretch;
        let last = first + some.len() - 1;
        let series = Series::all(array, some);
        let whole = series
            .iter()
            .filter(|series| series.looks.len() == some.len());
        let changes: Vec<Change> = whole.map(|series| Change::new(array, series)).collect();
        match agreement(&changes, [first, last]) {
            Err(doubt) => sorted.doubts.push(doubt),
            Ok(motion) => changes
                .iter()
                .for_each(|change| told.entry(change.name).or_default().add(change, motion)),
        }
        all.push(changes);
    }
    for (name, told) in told {
        match told.moves() {
            true => sorted.moving.push(name),
            false => sorted.standing.push(name),
        }
    }
    // Three that agree in some stretches may do so by chance: those that stand still agree in all.
    let fail = |changes: &&Vec<Change>| {
        let stands = |change: &&Change| sorted.standing.contains(&change.name);
        let some = changes.iter().filter(stands);
        let motion = motion(some.clone());
        let fits = |motion| some.clone().all(|change| change.square(motion) < NEVER);
        some.clone().count() >= 3 && !motion.is_some_and(fits)
    };
    let failed = all.iter().filter(fail).count();
    if sorted.standing.len() < 3 || failed > 1 + all.len() / 50 {
        sorted.standing.clear();
        sorted.moving.clear();
    }
    let seen: BTreeSet<usize> = pulses.iter().flatten().map(|s| s.target).collect();
    let is_told = |name: &usize| sorted.standing.contains(name) || sorted.moving.contains(name);
    sorted.unknown = seen.into_iter().filter(|name| !is_told(name)).collect();
    Ok(sorted)
}

/// The motion with which most agree.
fn agreement(changes: &[Change], [first, last]: [usize; 2]) -> Result<DVec3, Doubt> {
    let targets = changes.len();
    if targets < 3 {
        return Err(Doubt::Few {
            targets,
            first,
            last,
        });
    }
    let all: Vec<&Change> = changes.iter().collect();
    let (most, by) = group(&all).ok_or(Doubt::Disagree {
        targets,
        first,
        last,
    })?;
    let rest: Vec<usize> = (0..targets).filter(|c| !most.contains(c)).collect();
    let others: Vec<&Change> = rest.iter().map(|&c| &changes[c]).collect();
    match group(&others) {
        Some((second, _)) if second.len() >= most.len() => Err(Doubt::Divided {
            some: most.iter().map(|&c| changes[c].name).collect(),
            others: second.iter().map(|&c| others[c].name).collect(),
            first,
            last,
        }),
        _ => Ok(by),
    }
}

/// The track of a radar that saw this, by what stands still, and the velocities of what does not. Stretches and window count pulses: see [`sort`], [`track`].
///
/// # Errors
/// [`NoScene`].
pub fn track_among_movers(
    array: &Array,
    pulses: &[Vec<Sighting>],
    times_s: &[f64],
    stretch: usize,
    window: usize,
) -> Result<Scene, NoScene> {
    let grow = times_s.windows(2).all(|pair| pair[0] < pair[1]);
    if times_s.len() != pulses.len() || !grow || !times_s.iter().all(|time| time.is_finite()) {
        return Err(NoScene::Times {
            times: times_s.len(),
            pulses: pulses.len(),
        });
    }
    let wrong = |(pulse, error)| NoScene::Motion { pulse, error };
    let sorted = sort(array, pulses, stretch).map_err(wrong)?;
    if sorted.standing.is_empty() {
        let [targets, last] = [sorted.unknown.len(), pulses.len().max(1) - 1];
        let nothing = match targets < 3 {
            true => Doubt::Few {
                targets,
                first: 0,
                last,
            },
            false => Doubt::Disagree {
                targets,
                first: 0,
                last,
            },
        };
        let divided = |doubt: &&Doubt| matches!(doubt, Doubt::Divided { .. });
        let doubt = sorted.doubts.iter().find(divided).cloned();
        return Err(NoScene::Doubt(doubt.unwrap_or(nothing)));
    }
    let stands = |sighting: &&Sighting| sorted.standing.contains(&sighting.target);
    let standing: Vec<Vec<Sighting>> = pulses
        .iter()
        .map(|pulse| pulse.iter().filter(stands).cloned().collect())
        .collect();
    let track = track(array, &standing, window).map_err(wrong)?;
    let series = Series::all(array, pulses);
    let movers = series
        .iter()
        .filter(|series| sorted.moving.contains(&series.name))
        .filter_map(|series| velocity(array, series, &track.poses, times_s))
        .collect();
    Ok(Scene {
        track,
        movers,
        sorted,
    })
}

/// Numbers that a mover has: place, velocity and phase.
const UNKNOWNS: usize = 5;

/// A target's velocity, the radar's poses being known; none if it does not follow.
fn velocity(array: &Array, series: &Series, poses: &[Pose], times_s: &[f64]) -> Option<Mover> {
    let k = array.rad_m();
    let looks = &series.looks;
    let place = |look: &crate::series::Look| {
        let pose = &poses[look.pulse];
        let from = unit(pose.heading_rad).rotate(look.arrival.at_m);
        (times_s[look.pulse], pose.at_m + from)
    };
    let [vx, _, _] = line(looks.iter().map(|look| (place(look).0, place(look).1.x)));
    let [vy, _, _] = line(looks.iter().map(|look| (place(look).0, place(look).1.y)));
    let count = looks.len() as f64;
    let mean_s = looks.iter().map(|look| place(look).0).sum::<f64>() / count;
    let mean_m = looks.iter().map(|look| place(look).1).sum::<DVec2>() / count;
    let mut velocity = DVec2::new(vx, vy);
    let mut at_m = mean_m;
    let mut phase = None;
    let mut last = None;
    for _ in 0..MOST_STEPS {
        let mut matrix = [0.0; UNKNOWNS * UNKNOWNS];
        let mut right = [0.0; UNKNOWNS];
        let mut sum = 0.0;
        for look in looks {
            let pose = &poses[look.pulse];
            let t = times_s[look.pulse] - mean_s;
            let paths = array.paths(pose, at_m + velocity * t);
            let channels = paths.len() as f64;
            let mean_path_m = paths.iter().map(|path| path.length_m).sum::<f64>() / channels;
            let mean_slope = paths.iter().map(|path| path.slope).sum::<DVec2>() / channels;
            let phase = *phase.get_or_insert(look.common_rad + k * mean_path_m);
            let mut add = |error: f64, slope: DVec2, of_phase: f64, sigma: f64| {
                let row = [slope.x, slope.y, slope.x * t, slope.y * t, of_phase];
                let weight = 1.0 / (sigma * sigma);
                sum += error * error * weight;
                for i in 0..UNKNOWNS {
                    right[i] += weight * row[i] * error;
                    (0..UNKNOWNS)
                        .for_each(|j| matrix[i * UNKNOWNS + j] += weight * row[i] * row[j]);
                }
            };
            for (measured, path) in Series::phases_rad(look).iter().zip(&paths) {
                let error = measured - (phase - k * path.length_m);
                add(error, -k * path.slope, 1.0, look.sighting.phase_sigma_rad);
            }
            let error_m = look.sighting.range_m - 0.5 * mean_path_m;
            add(error_m, 0.5 * mean_slope, 0.0, look.sighting.range_sigma_m);
        }
        let factor = Factor::new(UNKNOWNS, &matrix)?;
        let promised: f64 = {
            let mut step = right;
            factor.solve(&mut step);
            at_m += DVec2::new(step[0], step[1]);
            velocity += DVec2::new(step[2], step[3]);
            phase = phase.map(|phase| phase + step[4]);
            step.iter().zip(&right).map(|(a, b)| a * b).sum()
        };
        let inverse = factor.inverse();
        let of = |i: usize, j: usize| inverse[i * UNKNOWNS + j];
        let covariance = DMat2::from_cols_array(&[of(2, 2), of(2, 3), of(3, 2), of(3, 3)]);
        last = Some((sum - promised, covariance));
        if promised < 1e-5 {
            break;
        }
    }
    let (sum, covariance) = last?;
    let numbers = looks.len() * (array.num_channels() + 1);
    let mover = Mover {
        target: series.name,
        at_m: at_m - velocity * mean_s,
        velocity_m_s: velocity,
        covariance,
        chi_square: [sum, numbers.saturating_sub(UNKNOWNS) as f64],
    };
    (mover.at_m.is_finite() && velocity.is_finite()).then_some(mover)
}
