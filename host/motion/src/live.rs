//! Online track among moving targets.
//!
//! A [`Tracker`] assumes that every target stands still. Here it is given standing targets only. After each segment of pulses, [`crate::movers`] finds which targets agree with one motion of the radar, and targets whose errors
//! exceed noise, in one segment or accumulated over many, are dropped. The segment is then repeated without them from the tracker's state before it, so that a target that moves from its first echo on leaves no trace.
//! A target that is found late, being slow or having started to move, is marginalised out of the prior; its earlier influence on the others stays. New targets are not used until a whole segment has confirmed them,
//! while three confirmed ones are seen.
//!
//! Velocities of dropped targets are estimated as in the batch form, from the last [`MAX_LOOKS`] pulses.
//!
//! **Units** metres, radians, seconds. **Cost** that of the tracker, twice that for a segment in which a target is dropped, and the cube of the targets once a segment. **Memory** two trackers, one segment of
//! sightings, and [`MAX_LOOKS`] pulses of moving targets. **Accuracy** `tests/live.rs`.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use crate::check::{self, MotionError};
use crate::model::{Array, Pose, Sighting};
use crate::movers::{Doubt, MIN_SEGMENT, Mover, Record, segment_changes, velocity};
use crate::series::Series;
use crate::tracker::{Step, Tracker};

/// Largest number of pulses from which a velocity is estimated: the first poses of a track have uncertain headings and drop out.
pub const MAX_LOOKS: usize = 500;

/// Number of confirmed standing targets from which on new targets wait for confirmation.
const MIN_CONFIRMED: usize = 3;

/// Online estimator of the radar's track from standing targets.
pub struct Live {
    array: Array,
    tracker: Tracker,
    /// State before the present segment.
    before: Tracker,
    segment_length: usize,
    /// All sightings of the present segment.
    pulses: Vec<Vec<Sighting>>,
    /// Number of the segment's first pulse.
    first: usize,
    records: BTreeMap<usize, Record>,
    moving: BTreeSet<usize>,
    recent: VecDeque<Recent>,
}

/// Recent pulse with its pose.
struct Recent {
    time_s: f64,
    pose: Pose,
    /// Sightings of moving targets.
    sightings: Vec<Sighting>,
}

/// Result of a pulse.
#[derive(Clone, Debug, PartialEq)]
pub struct Look {
    /// Result of the tracker.
    pub step: Step,
    /// Targets found to move at this pulse.
    pub dropped: Vec<usize>,
    /// Poses of the last pulses estimated without the dropped targets, this pulse's last; empty if none was dropped.
    pub repeated: Vec<Pose>,
    /// Reason why a segment that ends with this pulse does not separate moving targets.
    pub doubt: Option<Doubt>,
}

impl Live {
    /// Estimator with a fixed-lag window of `window` pulses, at least 2, and segments of `segment_length` pulses, at least 8.
    ///
    /// # Errors
    /// As [`Tracker::new`].
    pub fn new(array: Array, window: usize, segment_length: usize) -> Result<Self, MotionError> {
        let tracker = Tracker::new(array.clone(), window)?;
        Ok(Self {
            array,
            before: tracker.clone(),
            tracker,
            segment_length: segment_length.max(MIN_SEGMENT),
            pulses: Vec::new(),
            first: 0,
            records: BTreeMap::new(),
            moving: BTreeSet::new(),
            recent: VecDeque::new(),
        })
    }

    /// The tracker of standing targets.
    pub fn tracker(&self) -> &Tracker {
        &self.tracker
    }

    /// Take the next pulse: its time in seconds, and one sighting a target.
    ///
    /// # Errors
    /// [`MotionError`]: the pulse is ignored.
    pub fn push(&mut self, time_s: f64, sightings: &[Sighting]) -> Result<Look, MotionError> {
        check::sightings(&self.array, sightings)?;
        let last_s = self
            .recent
            .back()
            .map_or(f64::NEG_INFINITY, |last| last.time_s);
        if !time_s.is_finite() || time_s <= last_s {
            return Err(MotionError::Time { time_s, last_s });
        }
        if self.pulses.is_empty() {
            self.before = self.tracker.clone();
        }
        let step = self.tracker.push(&self.standing(sightings))?;
        let moves = |sighting: &&Sighting| self.moving.contains(&sighting.target);
        let recent = Recent {
            time_s,
            pose: step.pose,
            sightings: sightings.iter().filter(moves).cloned().collect(),
        };
        if self.recent.len() == MAX_LOOKS {
            self.recent.pop_front();
        }
        self.recent.push_back(recent);
        self.update_poses(self.tracker.window().to_vec());
        self.pulses.push(sightings.to_vec());
        let look = Look {
            step,
            dropped: Vec::new(),
            repeated: Vec::new(),
            doubt: None,
        };
        match self.pulses.len() == self.segment_length {
            true => Ok(self.evaluate_segment(look)),
            false => Ok(look),
        }
    }

    /// Moving targets with their velocities, from the last pulses.
    pub fn movers(&self) -> Vec<Mover> {
        let each = self.recent.iter();
        let pulses: Vec<Vec<Sighting>> = each.clone().map(|one| one.sightings.clone()).collect();
        let poses: Vec<Pose> = each.clone().map(|one| one.pose).collect();
        let times_s: Vec<f64> = each.map(|one| one.time_s).collect();
        let all = Series::all(&self.array, &pulses);
        all.iter()
            .filter(|series| series.looks.len() >= MIN_SEGMENT)
            .filter_map(|series| velocity(&self.array, series, &poses, &times_s))
            .collect()
    }

    /// Sightings that are given to the tracker.
    fn standing(&self, sightings: &[Sighting]) -> Vec<Sighting> {
        let is_confirmed = |sighting: &&Sighting| {
            self.records.contains_key(&sighting.target) && !self.moving.contains(&sighting.target)
        };
        let confirmed: Vec<Sighting> = sightings.iter().filter(is_confirmed).cloned().collect();
        if confirmed.len() >= MIN_CONFIRMED {
            return confirmed;
        }
        let stands = |sighting: &&Sighting| !self.moving.contains(&sighting.target);
        sightings.iter().filter(stands).cloned().collect()
    }

    /// Update the poses of the last pulses.
    fn update_poses(&mut self, poses: Vec<Pose>) {
        let last = self.recent.iter_mut().rev().zip(poses.into_iter().rev());
        last.for_each(|(recent, pose)| recent.pose = pose);
    }

    /// Evaluate a whole segment and begin the next.
    fn evaluate_segment(&mut self, mut look: Look) -> Look {
        let pulses = std::mem::take(&mut self.pulses);
        let (changes, by) = segment_changes(&self.array, &pulses, self.first);
        self.first += pulses.len();
        match by {
            Err(doubt) => look.doubt = Some(doubt),
            Ok(motion) => {
                for change in &changes {
                    let record = self.records.entry(change.name).or_default();
                    record.add(change, motion);
                    if record.moves() && self.moving.insert(change.name) {
                        look.dropped.push(change.name);
                    }
                }
            }
        }
        if look.dropped.is_empty() {
            return look;
        }
        // Last pulse first: `recent` does not reach back to the first pulses of a long segment.
        for (recent, pulse) in self.recent.iter_mut().rev().zip(pulses.iter().rev()) {
            let moves = |sighting: &&Sighting| self.moving.contains(&sighting.target);
            recent.sightings = pulse.iter().filter(moves).cloned().collect();
        }
        if let Some((tracker, step, repeated)) = self.repeat_segment(&pulses, &look.dropped) {
            self.tracker = tracker;
            look.step = step;
            self.update_poses(repeated.clone());
            self.update_poses(self.tracker.window().to_vec());
            look.repeated = repeated;
        } else {
            // The remaining targets do not determine the segment: keep the track and forget the dropped targets from here on.
            for target in &look.dropped {
                self.tracker.forget(*target);
            }
        }
        look
    }

    /// Repeat the segment without the dropped targets: the tracker, its last step, and all poses. `None` if they do not determine the poses.
    fn repeat_segment(
        &self,
        pulses: &[Vec<Sighting>],
        dropped: &[usize],
    ) -> Option<(Tracker, Step, Vec<Pose>)> {
        let mut tracker = self.before.clone();
        for target in dropped {
            tracker.forget(*target);
        }
        let mut last = None;
        let mut poses = Vec::with_capacity(pulses.len());
        for pulse in pulses {
            let step = tracker.push(&self.standing(pulse)).ok()?;
            poses.push(step.pose);
            last = Some(step);
        }
        Some((tracker, last?, poses))
    }
}
