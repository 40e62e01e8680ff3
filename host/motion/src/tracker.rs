//! Fixed-lag smoother with phase unwrapping, and batch least squares of a whole track.

use std::collections::VecDeque;
use std::f64::consts::{PI, TAU};

use glam::{DMat3, DVec2};

use crate::check::{self, MotionError};
use crate::increment::{Heading, Increment, WRAPPED};
use crate::joint::{self, Covariances, Estimate, NoEstimate, Prior};
use crate::model::{Array, Pose, Sighting, Target};
use crate::steps::steps;
use crate::wraps;

/// Fixed-lag smoother: the poses of the last pulses are re-estimated with every pulse, earlier pulses are marginalised into a prior of the targets.
#[derive(Clone)]
pub struct Tracker {
    array: Array,
    window: usize,
    /// Poses of the window, and all targets.
    estimate: Estimate,
    pulses: VecDeque<Vec<Sighting>>,
    /// Number of the window's first pulse.
    first: usize,
    prior: Prior,
    /// Number of each target in the caller's count.
    names: Vec<usize>,
    /// Heading of the next pulse, where headings are known.
    next_heading_rad: f64,
    /// Pulses from each pose of the window back to the pose before it, and from the next pose to the last.
    gaps: Vec<usize>,
    next_gap: usize,
}

/// Result of a pulse.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// Pose of the radar.
    pub pose: Pose,
    /// Covariance of x, y (metres) and heading (radians).
    pub covariance: DMat3,
    /// Sum of squared residuals of the window in standard deviations, and about its expectation: measurements less unknowns.
    pub chi_square: [f64; 2],
    /// Number of phases with ambiguous whole turns.
    pub doubtful: usize,
    /// Whether the least squares of the window converged.
    pub converged: bool,
}

/// Residual of a sighting of a [`Tracker`]'s last pulse: measured phases less those of the estimate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Residual {
    /// Number of the target.
    pub target: usize,
    /// RMS over the channels, radians.
    pub rms_rad: f64,
    /// RMS over the channels in standard deviations.
    pub rms_sigmas: f64,
}

impl Tracker {
    /// Smoother with a window of `window` pulses, at least 2. The cost of a pulse is proportional to it.
    ///
    /// # Errors
    /// [`MotionError::Antennas`], [`MotionError::Array`], [`MotionError::Baseline`].
    pub fn new(array: Array, window: usize) -> Result<Self, MotionError> {
        check::array(&array)?;
        Ok(Self {
            array,
            window: window.max(2),
            estimate: Estimate::default(),
            pulses: VecDeque::new(),
            first: 0,
            prior: Prior::default(),
            names: Vec::new(),
            next_heading_rad: 0.0,
            gaps: Vec::new(),
            next_gap: 1,
        })
    }

    /// Smoother for known headings: 0, or those set by [`Self::set_heading`]. Headings are not estimated, so that positions are more certain; errors of the headings are not detected.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn with_known_headings(array: Array, window: usize) -> Result<Self, MotionError> {
        let mut tracker = Self::new(array, window)?;
        tracker.estimate.heading = Heading::Known;
        Ok(tracker)
    }

    /// Set the heading of the next pulses, radians counterclockwise from the frame's x axis, where headings are known.
    pub fn set_heading(&mut self, heading_rad: f64) {
        self.next_heading_rad = heading_rad;
    }

    /// Targets with their numbers.
    pub fn targets(&self) -> impl Iterator<Item = (usize, Target)> {
        let names = self.names.iter().copied();
        names.zip(self.estimate.targets.iter().copied())
    }

    /// Poses of the pulses in the window, the last one last.
    pub fn window(&self) -> &[Pose] {
        &self.estimate.poses
    }

    /// Sightings of the last pulse with unwrapped phases; targets by their position in [`Self::targets`].
    pub fn last(&self) -> &[Sighting] {
        self.pulses.back().map_or(&[], Vec::as_slice)
    }

    /// Residuals of the last pulse, one entry a sighting in the order pushed. The first sighting of a target has none, as it alone determines the target.
    pub fn residuals(&self) -> Vec<Residual> {
        let (Some(pulse), Some(pose)) = (self.pulses.back(), self.estimate.poses.last()) else {
            return Vec::new();
        };
        let of = |sighting: &Sighting| {
            let lines = self
                .array
                .lines(pose, &self.estimate.targets[sighting.target]);
            let phases = sighting.phases_rad.iter().zip(&lines);
            let squares: f64 = phases
                .map(|(phase, line)| (phase - line.value).powi(2))
                .sum();
            let rms_rad = libm::sqrt(squares / sighting.phases_rad.len() as f64);
            Residual {
                target: self.names[sighting.target],
                rms_rad,
                rms_sigmas: rms_rad / sighting.phase_sigma_rad,
            }
        };
        pulse.iter().map(of).collect()
    }

    /// Remove a target with its sightings in the window; its earlier influence stays in the marginalised prior. Returns `false` and changes no state if it is unknown, or if a pulse of the window would keep fewer
    /// than two targets.
    pub fn forget(&mut self, target: usize) -> bool {
        let Some(index) = self.names.iter().position(|name| *name == target) else {
            return false;
        };
        let without = |pulse: &Vec<Sighting>| pulse.iter().filter(|s| s.target != index).count();
        if self.pulses.iter().any(|pulse| without(pulse) < 2) {
            return false;
        }
        self.prior.forget(index);
        self.names.remove(index);
        self.estimate.targets.remove(index);
        for pulse in &mut self.pulses {
            pulse.retain(|sighting| sighting.target != index);
            for sighting in pulse {
                sighting.target -= usize::from(sighting.target > index);
            }
        }
        true
    }

    /// Count pulses that are not pushed: pulses are at equal intervals in time, and the next pose is predicted farther on.
    pub fn skip(&mut self, pulses: usize) {
        self.next_gap = self.next_gap.saturating_add(pulses);
    }

    /// Take the next pulse, one sighting a target.
    ///
    /// # Errors
    /// [`MotionError`]: the pulse is skipped ([`Self::skip`]).
    pub fn push(&mut self, sightings: &[Sighting]) -> Result<Step, MotionError> {
        check::sightings(&self.array, sightings)?;
        if self.pulses.len() == self.window {
            self.leave_behind()?;
        }
        let before = self.estimate.clone();
        let done = self.advance(sightings);
        match &done {
            Ok(_) => {
                self.gaps.push(self.next_gap);
                self.next_gap = 1;
            }
            Err(_) => {
                self.estimate = before;
                self.names.truncate(self.estimate.targets.len());
                self.pulses.truncate(self.estimate.poses.len());
                self.skip(1);
            }
        }
        done
    }

    fn advance(&mut self, sightings: &[Sighting]) -> Result<Step, MotionError> {
        let mut expected = self.predicted();
        let known_heading = self.estimate.heading == Heading::Known;
        if known_heading {
            expected.heading_rad = self.next_heading_rad;
        }
        let mut doubtful = 0;
        let mut own = Vec::with_capacity(sightings.len());
        for sighting in sightings {
            let (sighting, doubts) = self.unwrapped(sighting, &expected);
            doubtful += doubts;
            own.push(sighting);
        }
        self.pulses.push_back(own);
        self.estimate.poses.push(expected);
        let pulses = self.pulses.make_contiguous();
        let solved = joint::solve(
            &self.array,
            pulses,
            self.first,
            &mut self.estimate,
            &self.prior,
        )?;
        let covariances =
            joint::covariances(&self.array, pulses, self.first, &self.estimate, &self.prior)?;
        // Later, the prior determines the targets.
        let targets = match self.first {
            0 => self.estimate.targets.len(),
            _ => 0,
        };
        let found = (if known_heading { 2 } else { 3 }) * pulses.len() + 3 * targets;
        Ok(Step {
            pose: self.estimate.poses[pulses.len() - 1],
            covariance: covariances.pose(pulses.len() - 1),
            chi_square: [solved.sum, degrees_of_freedom(pulses, found)],
            doubtful,
            converged: solved.converged,
        })
    }

    /// Prediction of the next pose at the present velocity, which is taken over as many pulses as the prediction spans: a long gap does not multiply the noise of one step.
    fn predicted(&self) -> Pose {
        let poses = &self.estimate.poses;
        let Some((last, before)) = poses.split_last() else {
            return Pose::default();
        };
        let steps = self.next_gap.min(before.len());
        if steps == 0 {
            return *last;
        }
        let from = &before[before.len() - steps];
        let over: usize = self.gaps[self.gaps.len() - steps..].iter().sum();
        let ratio = self.next_gap as f64 / over as f64;
        Pose {
            at_m: last.at_m + (last.at_m - from.at_m) * ratio,
            heading_rad: last.heading_rad + (last.heading_rad - from.heading_rad) * ratio,
        }
    }

    /// Marginalise the first pulse of the window.
    fn leave_behind(&mut self) -> Result<(), NoEstimate> {
        let targets = &self.estimate.targets;
        self.prior.take(
            &self.array,
            &self.pulses[0],
            self.first,
            (&self.estimate.poses[0], self.estimate.heading),
            targets,
        )?;
        self.pulses.pop_front();
        self.estimate.poses.remove(0);
        self.gaps.remove(0);
        self.first += 1;
        Ok(())
    }

    /// Sighting by internal target number with phases unwrapped against the pose, and the number of phases in doubt.
    fn unwrapped(&mut self, sighting: &Sighting, pose: &Pose) -> (Sighting, usize) {
        let known = self.names.iter().position(|name| *name == sighting.target);
        let index = known.unwrap_or_else(|| {
            let target = first_look(&self.array, sighting, pose);
            self.estimate.targets.push(target);
            self.names.push(sighting.target);
            self.names.len() - 1
        });
        let expected = self.array.lines(pose, &self.estimate.targets[index]);
        let mut doubtful = 0;
        let phases = sighting.phases_rad.iter().zip(&expected);
        let phases_rad: Vec<f64> = phases
            .map(|(phase, line)| {
                let whole = phase + TAU * ((line.value - phase) / TAU).round();
                doubtful += usize::from((whole - line.value).abs() > WRAPPED * PI);
                whole
            })
            .collect();
        let own = Sighting {
            target: index,
            phases_rad,
            ..sighting.clone()
        };
        (own, doubtful)
    }
}

/// Target from its range and its direction of arrival at the two nearest receivers.
fn first_look(array: &Array, sighting: &Sighting, pose: &Pose) -> Target {
    let ([i, j], baseline) = array.shortest_baseline().expect("there are two receivers");
    let turns = (sighting.phases_rad[j] - sighting.phases_rad[i]) / TAU;
    let turns = turns - turns.round();
    // The phase is larger at the receiver nearer to the target, where the path is shorter.
    let along = (turns * array.wavelength_m / baseline.length()).clamp(-1.0, 1.0);
    let direction = baseline.normalize();
    let ahead = match direction.perp() {
        perp if perp.y < 0.0 => -perp,
        perp => perp,
    };
    let from = direction * along + ahead * (1.0 - along * along).sqrt();
    let heading = DVec2::from_angle(pose.heading_rad);
    let mut target = Target {
        at_m: pose.at_m + heading.rotate(from) * sighting.range_m,
        phase_rad: 0.0,
        from: *pose,
    };
    target.phase_rad = sighting.phases_rad[0] - array.lines(pose, &target)[0].value;
    target
}

/// Degrees of freedom: measurements minus unknowns.
fn degrees_of_freedom(pulses: &[Vec<Sighting>], found: usize) -> f64 {
    let sightings = pulses.iter().flatten();
    let measured: usize = sightings.map(|s| s.phases_rad.len() + 1).sum();
    measured.saturating_sub(found) as f64
}

/// Track estimated from all pulses together.
#[derive(Clone, Debug, PartialEq)]
pub struct Track {
    /// Pose of each pulse.
    pub poses: Vec<Pose>,
    /// Pose of each pulse as estimated online, when the pulse was pushed, in a slightly rotated frame.
    pub live: Vec<Pose>,
    /// Covariances of x, y (metres) and heading (radians) of each pose, in the frame held by the first position and the first target.
    pub covariances: Vec<DMat3>,
    /// Joint covariances of poses and targets; [`Covariances::aligned`] returns those of the track's shape.
    pub joint_covariances: Covariances,
    /// Sightings with unwrapped phases; targets by their position in `targets`.
    pub unwrapped_sightings: Vec<Vec<Sighting>>,
    /// Increments between poses in the axes of the former pose, with covariances of x, y and turn that stand for independent errors: the chain as a whole is as uncertain as the joint estimate, parts of it more.
    pub steps: Vec<(Increment, DMat3)>,
    /// Targets with their numbers.
    pub targets: Vec<(usize, Target)>,
    /// Sum of squared residuals in standard deviations, and its expectation: measurements less unknowns.
    pub chi_square: [f64; 2],
    /// Number of phases of each pulse with ambiguous whole turns.
    pub doubtful: Vec<usize>,
    /// Whether the least squares converged.
    pub converged: bool,
}

/// Estimate the track of a radar from its sightings: fixed-lag smoother with a window of `window` pulses, then least squares over all pulses.
///
/// # Errors
/// [`MotionError`] with the pulse's number.
pub fn track(
    array: &Array,
    pulses: &[Vec<Sighting>],
    window: usize,
) -> Result<Track, (usize, MotionError)> {
    let numbers: Vec<usize> = (0..pulses.len()).collect();
    track_numbered(array, pulses, &numbers, window)
}

/// [`track`] of a subset of a recording's pulses. `numbers` are the pulses' numbers in the recording, strictly ascending; all pulses of the recording are at equal intervals in time.
///
/// # Errors
/// [`MotionError`] with the pulse's position in `pulses`.
///
/// # Panics
/// If there are not as many numbers as pulses, or they do not ascend.
pub fn track_numbered(
    array: &Array,
    pulses: &[Vec<Sighting>],
    numbers: &[usize],
    window: usize,
) -> Result<Track, (usize, MotionError)> {
    assert_eq!(numbers.len(), pulses.len());
    let tracker = Tracker::new(array.clone(), window).map_err(|error| (0, error))?;
    whole(tracker, pulses, numbers, |_| 0.0)
}

/// [`track`] with known headings, one per pulse, radians counterclockwise from the frame's x axis; on a rail all are 0.
///
/// # Errors
/// As [`track`]; [`MotionError::Headings`].
pub fn track_with_headings(
    array: &Array,
    pulses: &[Vec<Sighting>],
    headings_rad: &[f64],
    window: usize,
) -> Result<Track, (usize, MotionError)> {
    let known = headings_rad.iter().all(|heading| heading.is_finite());
    if headings_rad.len() != pulses.len() || !known {
        let error = MotionError::Headings {
            headings: headings_rad.len(),
            pulses: pulses.len(),
        };
        return Err((0, error));
    }
    let tracker =
        Tracker::with_known_headings(array.clone(), window).map_err(|error| (0, error))?;
    let numbers: Vec<usize> = (0..pulses.len()).collect();
    whole(tracker, pulses, &numbers, |n| headings_rad[n])
}

/// Largest number of rounds of unwrapping against the joint estimate.
const MAX_ROUNDS: usize = 4;

/// Track by the fixed-lag smoother, refined by joint least squares over all pulses.
///
/// The smoother unwraps phases against a predicted pose. If the prediction was wrong for one target and right for the others, the joint estimate is near the right pose all the same, and that phase is off by a
/// turn. Phases are therefore unwrapped against the joint estimate, and it is repeated until no phase changes.
fn whole(
    mut tracker: Tracker,
    pulses: &[Vec<Sighting>],
    numbers: &[usize],
    heading_rad: impl Fn(usize) -> f64,
) -> Result<Track, (usize, MotionError)> {
    let array = &tracker.array.clone();
    let heading = tracker.estimate.heading;
    let mut estimate = Estimate {
        heading,
        ..Estimate::default()
    };
    let mut unwrapped_sightings = Vec::new();
    for (n, sightings) in pulses.iter().enumerate() {
        tracker.set_heading(heading_rad(n));
        tracker.skip(n.checked_sub(1).map_or(0, |m| numbers[n] - numbers[m] - 1));
        let step = tracker.push(sightings).map_err(|error| (n, error))?;
        estimate.poses.push(step.pose);
        unwrapped_sightings.push(tracker.last().to_vec());
    }
    estimate.targets = tracker.targets().map(|(_, target)| target).collect();
    let live = estimate.poses.clone();
    let at_last = |error: NoEstimate| (pulses.len(), error.into());
    let no_prior = Prior::default();
    let mut solved =
        joint::solve(array, &unwrapped_sightings, 0, &mut estimate, &no_prior).map_err(at_last)?;
    for _ in 0..MAX_ROUNDS {
        let (mut next, again) = (
            estimate.clone(),
            wraps::rewrapped(array, &unwrapped_sightings, &estimate),
        );
        if again == unwrapped_sightings {
            break;
        }
        match joint::solve(array, &again, 0, &mut next, &no_prior) {
            Ok(better) if better.sum < solved.sum => {
                (estimate, unwrapped_sightings, solved) = (next, again, better);
            }
            _ => break,
        }
    }
    let covariances = joint::covariances(array, &unwrapped_sightings, 0, &estimate, &no_prior)
        .map_err(at_last)?;
    let of_pose = if heading == Heading::Known { 2 } else { 3 };
    let found = of_pose * (pulses.len().max(1) - 1) + 3 * estimate.targets.len();
    let names = tracker.targets().map(|(name, _)| name);
    Ok(Track {
        doubtful: wraps::doubtful(array, &unwrapped_sightings, numbers, &estimate),
        targets: names.zip(estimate.targets.iter().copied()).collect(),
        steps: steps(&estimate.poses, &covariances),
        poses: estimate.poses,
        live,
        covariances: covariances.poses().collect(),
        joint_covariances: covariances,
        chi_square: [solved.sum, degrees_of_freedom(&unwrapped_sightings, found)],
        unwrapped_sightings,
        converged: solved.converged,
    })
}
