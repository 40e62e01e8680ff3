//! A radar followed pulse by pulse among targets that move.
//!
//! A [`Tracker`] takes all that is seen for still. Here it is given only what stands: after each stretch of pulses it is told which targets agree with one motion of the radar
//! ([`crate::movers`]), and those whose errors against that grow beyond noise, in one stretch or little by little, are dropped. The stretch is then followed once more without them, from the tracker as it
//! was before it, so that a target that moves from its first sight on leaves nothing behind; one that is found late, for it is slow or began to move, is taken out of what is known
//! with all that it told, and what it bent before stays. Targets that appear later are not used until a whole stretch has told of them, as long as three that
//! are known to stand are seen.
//!
//! Velocities of what was dropped are found as the batch form finds them, of the last [`MOST_LOOKS`] pulses.
//!
//! **Units** metres, radians, seconds. **Cost** a pulse's of the tracker, twice that of a stretch where something is dropped, and the cube of the targets once a stretch. **Memory** the tracker twice, a stretch of sightings,
//! and [`MOST_LOOKS`] of what moves. **Accuracy** `tests/live.rs`.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use crate::check::{self, MotionError};
use crate::model::{Array, Pose, Sighting};
use crate::movers::{Doubt, LEAST_STRETCH, Mover, Told, stretch, velocity};
use crate::series::Series;
use crate::tracker::{Step, Tracker};

/// Pulses of which a velocity is found, at the most: the first poses of a track, whose headings are not known as well yet, are to be left behind.
pub const MOST_LOOKS: usize = 500;

/// Targets that are known to stand: with as many what is new can wait.
const ENOUGH: usize = 3;

/// Follows a radar by what stands still.
pub struct Live {
    array: Array,
    tracker: Tracker,
    /// As it was before the stretch.
    before: Tracker,
    stretch: usize,
    /// The stretch so far, all that was seen.
    pulses: Vec<Vec<Sighting>>,
    /// Number of its first pulse.
    first: usize,
    told: BTreeMap<usize, Told>,
    moving: BTreeSet<usize>,
    recent: VecDeque<Recent>,
}

/// A pulse of the last ones.
struct Recent {
    time_s: f64,
    pose: Pose,
    /// Of what moves.
    sightings: Vec<Sighting>,
}

/// What a pulse told.
#[derive(Clone, Debug, PartialEq)]
pub struct Look {
    /// Of the tracker.
    pub step: Step,
    /// Targets that move, as this pulse has shown.
    pub dropped: Vec<usize>,
    /// Poses of the last pulses without these, this one's last; none if nothing was dropped.
    pub again: Vec<Pose>,
    /// Why a stretch that this pulse ends does not tell what moves.
    pub doubt: Option<Doubt>,
}

impl Live {
    /// With so many pulses that are looked at again (2 at the least), and so many after which it is told what moves (8 at the least).
    ///
    /// # Errors
    /// As [`Tracker::new`].
    pub fn new(array: Array, window: usize, stretch: usize) -> Result<Self, MotionError> {
        let tracker = Tracker::new(array.clone(), window)?;
        Ok(Self {
            array,
            before: tracker.clone(),
            tracker,
            stretch: stretch.max(LEAST_STRETCH),
            pulses: Vec::new(),
            first: 0,
            told: BTreeMap::new(),
            moving: BTreeSet::new(),
            recent: VecDeque::new(),
        })
    }

    /// The tracker of what stands.
    pub fn tracker(&self) -> &Tracker {
        &self.tracker
    }

    /// Takes the next pulse: when it was, and what is seen in it, each target by a number of its own.
    ///
    /// # Errors
    /// [`MotionError`]; the pulse is then as if it had not been.
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
        if self.recent.len() == MOST_LOOKS {
            self.recent.pop_front();
        }
        self.recent.push_back(recent);
        self.understand(self.tracker.window().to_vec());
        self.pulses.push(sightings.to_vec());
        let look = Look {
            step,
            dropped: Vec::new(),
            again: Vec::new(),
            doubt: None,
        };
        match self.pulses.len() == self.stretch {
            true => Ok(self.judged(look)),
            false => Ok(look),
        }
    }

    /// What moves, of the last pulses: those of which they tell enough.
    pub fn movers(&self) -> Vec<Mover> {
        let each = self.recent.iter();
        let pulses: Vec<Vec<Sighting>> = each.clone().map(|one| one.sightings.clone()).collect();
        let poses: Vec<Pose> = each.clone().map(|one| one.pose).collect();
        let times_s: Vec<f64> = each.map(|one| one.time_s).collect();
        let all = Series::all(&self.array, &pulses);
        all.iter()
            .filter(|series| series.looks.len() >= LEAST_STRETCH)
            .filter_map(|series| velocity(&self.array, series, &poses, &times_s))
            .collect()
    }

    /// What is given to the tracker.
    fn standing(&self, sightings: &[Sighting]) -> Vec<Sighting> {
        let known = |sighting: &&Sighting| {
            self.told.contains_key(&sighting.target) && !self.moving.contains(&sighting.target)
        };
        let told: Vec<Sighting> = sightings.iter().filter(known).cloned().collect();
        if told.len() >= ENOUGH {
            return told;
        }
        let stands = |sighting: &&Sighting| !self.moving.contains(&sighting.target);
        sightings.iter().filter(stands).cloned().collect()
    }

    /// Takes poses of the last pulses as they are understood by now.
    fn understand(&mut self, poses: Vec<Pose>) {
        let last = self.recent.iter_mut().rev().zip(poses.into_iter().rev());
        last.for_each(|(recent, pose)| recent.pose = pose);
    }

    /// What a whole stretch tells, and the next begins.
    fn judged(&mut self, mut look: Look) -> Look {
        let pulses = std::mem::take(&mut self.pulses);
        let (changes, by) = stretch(&self.array, &pulses, self.first);
        self.first += pulses.len();
        match by {
            Err(doubt) => look.doubt = Some(doubt),
            Ok(motion) => {
                for change in &changes {
                    let told = self.told.entry(change.name).or_default();
                    told.add(change, motion);
                    if told.moves() && self.moving.insert(change.name) {
                        look.dropped.push(change.name);
                    }
                }
            }
        }
        if look.dropped.is_empty() {
            return look;
        }
        // From the last backwards: of a long stretch the first are forgotten.
        for (recent, pulse) in self.recent.iter_mut().rev().zip(pulses.iter().rev()) {
            let moves = |sighting: &&Sighting| self.moving.contains(&sighting.target);
            recent.sightings = pulse.iter().filter(moves).cloned().collect();
        }
        if let Some((tracker, step, again)) = self.again(&pulses, &look.dropped) {
            self.tracker = tracker;
            look.step = step;
            self.understand(again.clone());
            self.understand(self.tracker.window().to_vec());
            look.again = again;
        } else {
            // What is left does not follow the stretch: from here on it is followed as it was.
            for target in &look.dropped {
                self.tracker.forget(*target);
            }
        }
        look
    }

    /// The stretch from its beginning without what was dropped: the tracker, its last step, and all poses. None if that does not tell them.
    fn again(
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
