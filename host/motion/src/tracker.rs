//! Pulse by pulse: phases without wraps, a window of pulses that are looked at again, and those before it as known.

use std::collections::VecDeque;
use std::f64::consts::{PI, TAU};

use glam::{DMat3, DVec2};

use crate::check::{self, MotionError};
use crate::increment::{Heading, Increment, WRAPPED};
use crate::joint::{self, Estimate, Known, NoEstimate};
use crate::model::{Array, Pose, Sighting, Target};
use crate::steps::steps;

/// Follows a radar.
#[derive(Clone)]
pub struct Tracker {
    array: Array,
    window: usize,
    /// Of the pulses in the window, and all targets.
    estimate: Estimate,
    pulses: VecDeque<Vec<Sighting>>,
    /// Number of the first of them.
    first: usize,
    known: Known,
    /// What each target is called.
    names: Vec<usize>,
    /// The next heading, where it is known.
    turned_rad: f64,
}

/// What a pulse told.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// Where the radar is.
    pub pose: Pose,
    /// Covariance of x, y and heading.
    pub covariance: DMat3,
    /// Of the window: the sum of squared errors in standard deviations, and about how many it should be: as many as there are numbers, less those that
    /// are found of them.
    pub chi_square: [f64; 2],
    /// Phases that may have wrapped.
    pub doubtful: usize,
    /// Whether the least squares of the window came to their end.
    pub settled: bool,
}

impl Tracker {
    /// With so many pulses that are looked at again, 2 at the least: the cost of a pulse grows with them.
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
            known: Known::default(),
            names: Vec::new(),
            turned_rad: 0.0,
        })
    }

    /// The same of a radar whose headings are known: 0, or what [`Self::turn_to`] says. They need not be told by what is seen, which makes the rest surer; what they
    /// are off is believed.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn held(array: Array, window: usize) -> Result<Self, MotionError> {
        let mut tracker = Self::new(array, window)?;
        tracker.estimate.heading = Heading::Held;
        Ok(tracker)
    }

    /// The heading of pulses from the next one on, radians counterclockwise from the frame's x axis, where headings are known.
    pub fn turn_to(&mut self, heading_rad: f64) {
        self.turned_rad = heading_rad;
    }

    /// Where targets are: the number they are called by, and what is known of them.
    pub fn targets(&self) -> impl Iterator<Item = (usize, Target)> {
        let names = self.names.iter().copied();
        names.zip(self.estimate.targets.iter().copied())
    }

    /// Poses of the pulses in the window, the last one last, as they are known by now.
    pub fn window(&self) -> &[Pose] {
        &self.estimate.poses
    }

    /// The last pulse as it is understood: targets by their place in [`Self::targets`], phases without wraps.
    pub fn last(&self) -> &[Sighting] {
        self.pulses.back().map_or(&[], Vec::as_slice)
    }

    /// Drops a target with all that it told of the others since the window began; what it told before that stays as part of what is known of them. Not
    /// done, and `false`, if it is not known or if a pulse of the window would be left with less than two.
    pub fn forget(&mut self, target: usize) -> bool {
        let Some(index) = self.names.iter().position(|name| *name == target) else {
            return false;
        };
        let without = |pulse: &Vec<Sighting>| pulse.iter().filter(|s| s.target != index).count();
        if self.pulses.iter().any(|pulse| without(pulse) < 2) {
            return false;
        }
        self.known.forget(index);
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

    /// Takes the next pulse: what is seen in it, each target by a number of its own.
    ///
    /// # Errors
    /// [`MotionError`]; the pulse is then as if it had not been.
    pub fn push(&mut self, sightings: &[Sighting]) -> Result<Step, MotionError> {
        check::sightings(&self.array, sightings)?;
        if self.pulses.len() == self.window {
            self.leave_behind()?;
        }
        let before = self.estimate.clone();
        let done = self.advance(sightings);
        if done.is_err() {
            self.estimate = before;
            self.names.truncate(self.estimate.targets.len());
            self.pulses.truncate(self.estimate.poses.len());
        }
        done
    }

    fn advance(&mut self, sightings: &[Sighting]) -> Result<Step, MotionError> {
        let mut expected = match self.estimate.poses[..] {
            [] => Pose::default(),
            [only] => only,
            // It goes on as it went.
            [.., before, last] => Pose {
                at_m: 2.0 * last.at_m - before.at_m,
                heading_rad: 2.0 * last.heading_rad - before.heading_rad,
            },
        };
        let held = self.estimate.heading == Heading::Held;
        if held {
            expected.heading_rad = self.turned_rad;
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
            &self.known,
        )?;
        let known_to =
            joint::covariances(&self.array, pulses, self.first, &self.estimate, &self.known)?;
        // Later on pulses left behind tell the targets.
        let targets = match self.first {
            0 => self.estimate.targets.len(),
            _ => 0,
        };
        let found = (if held { 2 } else { 3 }) * pulses.len() + 3 * targets;
        Ok(Step {
            pose: self.estimate.poses[pulses.len() - 1],
            covariance: known_to.pose(pulses.len() - 1),
            chi_square: [solved.sum, beyond(pulses, found)],
            doubtful,
            settled: solved.settled,
        })
    }

    /// The first pulse of the window is looked at no more.
    fn leave_behind(&mut self) -> Result<(), NoEstimate> {
        let targets = &self.estimate.targets;
        self.known.take(
            &self.array,
            &self.pulses[0],
            self.first,
            (&self.estimate.poses[0], self.estimate.heading),
            targets,
        )?;
        self.pulses.pop_front();
        self.estimate.poses.remove(0);
        self.first += 1;
        Ok(())
    }

    /// A sighting by our own numbers, its phases continued from before; and how many of them may have wrapped.
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

/// A target by its range and the angle at which it arrives at the nearest two receivers.
fn first_look(array: &Array, sighting: &Sighting, pose: &Pose) -> Target {
    let ([i, j], baseline) = array.shortest_baseline().expect("there are two receivers");
    let turns = (sighting.phases_rad[j] - sighting.phases_rad[i]) / TAU;
    let turns = turns - turns.round();
    // Nearer to the target the phase is larger, for the path is shorter.
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

/// How many numbers are measured beyond those that are found of them.
fn beyond(pulses: &[Vec<Sighting>], found: usize) -> f64 {
    let sightings = pulses.iter().flatten();
    let measured: usize = sightings.map(|s| s.phases_rad.len() + 1).sum();
    measured.saturating_sub(found) as f64
}

/// A track, known as well as all pulses together tell.
#[derive(Clone, Debug, PartialEq)]
pub struct Track {
    /// One a pulse.
    pub poses: Vec<Pose>,
    /// As each was known when its pulse had come, in a frame turned a little otherwise.
    pub live: Vec<Pose>,
    /// Of x, y and heading of each.
    pub covariances: Vec<DMat3>,
    /// From each pose to the next, in the axes of the former, with a covariance of x, y and turn by which they can be taken for independent of one
    /// another: the whole of them is as uncertain as it is, parts of it more than they are.
    pub steps: Vec<(Increment, DMat3)>,
    /// By the numbers they are called.
    pub targets: Vec<(usize, Target)>,
    /// The sum of squared errors in standard deviations, and how many numbers there are beyond those that are found.
    pub chi_square: [f64; 2],
    /// Phases that may have wrapped, of each pulse.
    pub doubtful: Vec<usize>,
    /// Whether the least squares came to their end.
    pub settled: bool,
}

/// The track of a radar that saw this, pulse by pulse: followed first, with so many pulses that are looked at again, then all of it at once.
///
/// # Errors
/// [`MotionError`], and the pulse's number.
pub fn track(
    array: &Array,
    pulses: &[Vec<Sighting>],
    window: usize,
) -> Result<Track, (usize, MotionError)> {
    let tracker = Tracker::new(array.clone(), window).map_err(|error| (0, error))?;
    whole(tracker, pulses, |_| 0.0)
}

/// The same of a radar whose headings are known: of each pulse one, radians counterclockwise from the frame's x axis; of a rail 0 all along.
///
/// # Errors
/// As [`track`]; [`MotionError::Headings`].
pub fn track_turned(
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
    let tracker = Tracker::held(array.clone(), window).map_err(|error| (0, error))?;
    whole(tracker, pulses, |n| headings_rad[n])
}

/// All pulses by a tracker, then at once.
fn whole(
    mut tracker: Tracker,
    pulses: &[Vec<Sighting>],
    heading_rad: impl Fn(usize) -> f64,
) -> Result<Track, (usize, MotionError)> {
    let array = &tracker.array.clone();
    let heading = tracker.estimate.heading;
    let mut estimate = Estimate {
        heading,
        ..Estimate::default()
    };
    let (mut understood, mut doubtful) = (Vec::new(), Vec::new());
    for (n, sightings) in pulses.iter().enumerate() {
        tracker.turn_to(heading_rad(n));
        let step = tracker.push(sightings).map_err(|error| (n, error))?;
        estimate.poses.push(step.pose);
        understood.push(tracker.last().to_vec());
        doubtful.push(step.doubtful);
    }
    estimate.targets = tracker.targets().map(|(_, target)| target).collect();
    let live = estimate.poses.clone();
    let at_last = |error: NoEstimate| (pulses.len(), error.into());
    let nothing = Known::default();
    let solved = joint::solve(array, &understood, 0, &mut estimate, &nothing).map_err(at_last)?;
    let covariances =
        joint::covariances(array, &understood, 0, &estimate, &nothing).map_err(at_last)?;
    let of_pose = if heading == Heading::Held { 2 } else { 3 };
    let found = of_pose * (pulses.len().max(1) - 1) + 3 * estimate.targets.len();
    let names = tracker.targets().map(|(name, _)| name);
    Ok(Track {
        targets: names.zip(estimate.targets.iter().copied()).collect(),
        steps: steps(&estimate.poses, &covariances),
        poses: estimate.poses,
        live,
        covariances: covariances.poses().collect(),
        chi_square: [solved.sum, beyond(&understood, found)],
        doubtful,
        settled: solved.settled,
    })
}
