//! Online track from echoes, pulse by pulse.
//!
//! ```text
//! pulse of each channel ─ profile, cfar, echo ─> follow: delay of `TrackerSettings::within` pulses ─> motion::Tracker: fixed-lag smoother over 40 pulses ─> Located
//! ```
//!
//! The online form of [`crate::targets::recover()`]. The pose of a pulse is reported when it leaves the smoother's window, [`Live::lag`] pulses after the pulse, and is final: targets that later turn out to be one are not joined, and there
//! is no joint solution over all pulses.
//!
//! **Frame**: the body's frame in the first pulse with a pose ([`Arrangement`]), placed by the first pulse's recorded position. Echoes do not determine an absolute position or orientation.
//!
//! **Contradictions**: the echo of two targets that are not resolved has a phase that is off by up to half a turn. A sighting whose phases are off by more than noise against the other sightings of its pulse is left out,
//! while three that agree remain.
//!
//! **Neglected**: moving targets count as standing ones until they contradict the others. [`crate::live`] separates them, but needs more targets than most pulses of a stepped-frequency radar show.
//!
//! **Memory**: targets that are followed, at most [`Settings::most_targets`] a pulse and those not seen for [`crate::targets::follow::TrackerSettings::bridge`] pulses; sightings of [`Live::lag`] pulses. **Cost** of a pulse: two transforms of each
//! channel's profile, and the smoother's time, which grows with the cube of the targets. **Accuracy**: `tests/live.rs`; of a radio's walk `tests/cli/live.rs`.

use std::collections::{BTreeMap, VecDeque};

use crate::joint::HUBER;
use crate::{MotionError, Pose, Sighting, Step, Tracker};
use glam::{DQuat, DVec3};
use num_complex::Complex32;
use subaperture_model::phase_history::{Band, Pulse};

use crate::targets::arrangement::Arrangement;
use crate::targets::detection::{Settings, TargetDetector, TargetsError, profiler};
use crate::targets::follow::{Event, TargetTracker};
use crate::targets::profile::Echoes;

/// Lag of the smoother, pulses: poses are final, so it is longer than where a joint solution follows.
const WINDOW: usize = 40;
/// RMS residual of a sighting's phases, radians, beyond which it contradicts the others if it is beyond [`HUBER`] standard deviations too. Peaks of two targets that are not resolved are off by up to 3 rad at any SNR;
/// sightings that are off by less than this move a pose by less than a hundredth of the wavelength.
const CONTRADICTS_RAD: f64 = 0.1;
/// Number of sightings that have to agree before others are left out: two determine a pose and check it, a third decides which of two that contradict each other is right.
const MIN_CONSISTENT: usize = 3;
/// Number of contradicting sightings in a row after which a target starts anew.
const MAX_CONTRADICTIONS: usize = 8;

/// Pose of a pulse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Located {
    /// Number of the pulse, counted from 0 as pushed.
    pub pulse: usize,
    /// Position of the body's origin, metres.
    pub position_m: DVec3,
    /// Rotation from the body's axes to those of the first pulse's positions.
    pub attitude: DQuat,
}

/// State of the estimation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Going {
    /// Number of pulses without a pose: fewer than two targets, or sightings that do not determine it.
    pub blind: usize,
    /// Number of pulses with ambiguous whole turns of phase: half-wavelength slips are possible from there on.
    pub doubtful: usize,
    /// Number of sightings that are left out because they contradict the others of their pulse: echoes of targets that are too near to each other in range, or of moving ones.
    pub contradictions: usize,
    /// Sum of squared residuals of the last window in standard deviations, and its expectation.
    pub chi_square: [f64; 2],
    /// Number of known targets.
    pub targets: usize,
}

/// Online estimator of the radar's poses.
pub struct Live {
    detector: TargetDetector,
    arrangement: Arrangement,
    order: Vec<usize>,
    follower: TargetTracker,
    tracker: Tracker,
    within: usize,
    /// Estimated heading of the first pulse; the frame is turned to it.
    first_rad: Option<f64>,
    pushed: usize,
    released: usize,
    /// Numbers of the pulses in the smoother's window.
    window: VecDeque<usize>,
    /// Dead targets that could not be removed yet.
    lost: Vec<usize>,
    /// Number of contradicting sightings in a row, by target.
    contradictions: BTreeMap<usize, usize>,
    going: Going,
}

impl Live {
    /// Estimator for an array with antennas at the positions of these simultaneous pulses, one a channel, of `num_samples` samples each.
    ///
    /// # Errors
    /// Channels that do not form an array, receivers too far apart for directions of arrival, too few samples, invalid settings.
    pub fn new(
        first: &[Pulse],
        num_samples: usize,
        settings: &Settings,
    ) -> Result<Self, TargetsError> {
        let arrangement = Arrangement::of_pulses(first)?;
        let band = |pulse: &Pulse| Band {
            start_hz: pulse.start_hz,
            step_hz: pulse.step_hz,
            count: num_samples,
        };
        let own = band(&first[0]);
        if first.iter().any(|pulse| band(pulse) != own) {
            return Err(TargetsError::Band);
        }
        let profiler = profiler(own, first[0].reference_path_m, settings)?;
        let tracker = Tracker::new(arrangement.array(profiler.middle_hz()), WINDOW);
        let cell_m = 0.5 * profiler.cell_m();
        let follower =
            TargetTracker::new(settings.follow, cell_m).map_err(TargetsError::Settings)?;
        Ok(Self {
            detector: TargetDetector::new(profiler, settings, first.len())?,
            order: arrangement.order(),
            arrangement,
            follower,
            tracker: tracker.map_err(TargetsError::Array)?,
            within: settings.follow.within,
            first_rad: None,
            pushed: 0,
            released: 0,
            window: VecDeque::with_capacity(WINDOW + 1),
            lost: Vec::new(),
            contradictions: BTreeMap::new(),
            going: Going::default(),
        })
    }

    /// Antennas on the located body.
    pub fn arrangement(&self) -> &Arrangement {
        &self.arrangement
    }

    /// Largest number of pulses after which a pose is reported.
    pub fn lag(&self) -> usize {
        self.within + WINDOW
    }

    /// State of the estimation.
    pub fn going(&self) -> Going {
        Going {
            targets: self.tracker.targets().count(),
            ..self.going
        }
    }

    /// Take the next pulse: of each channel the samples with their compensation. Returns poses that became final, in the order of pulses. Samples that are not finite are ignored.
    ///
    /// # Panics
    /// If the number of channels or samples differs from the first.
    pub fn push(&mut self, channels: &[(Pulse, Vec<Complex32>)]) -> Vec<Located> {
        assert_eq!(channels.len(), self.order.len(), "channels");
        let is_number = |z: &Complex32| z.re.is_finite() && z.im.is_finite();
        let whole = channels.iter().all(|(_, z)| z.iter().all(is_number));
        let mut found = match whole {
            true => {
                let each = channels.iter();
                let echoes: Echoes = each
                    .map(|(pulse, samples)| self.detector.uncompensated(pulse, samples))
                    .collect();
                self.detector.find(&echoes).0
            }
            false => Vec::new(),
        };
        found.retain(|echo| self.detector.is_above_noise(echo));
        for echo in &mut found {
            echo.phases_rad = self.order.iter().map(|&c| echo.phases_rad[c]).collect();
        }
        self.pushed += 1;
        let sightings = self.follower.push(&found);
        for event in self.follower.events() {
            if let Event::Lost { target, .. } = event {
                self.lost.push(target);
            }
        }
        sightings.map_or_else(Vec::new, |sightings| {
            self.estimate(&sightings).into_iter().collect()
        })
    }

    /// Return the remaining poses at the end.
    pub fn finish(&mut self) -> Vec<Located> {
        let mut located = Vec::new();
        for sightings in self.follower.finish() {
            located.extend(self.estimate(&sightings));
        }
        let poses = self.tracker.window().to_vec();
        let left = std::mem::take(&mut self.window);
        located.extend(
            left.into_iter()
                .zip(poses)
                .map(|(n, pose)| self.located(n, &pose)),
        );
        located
    }

    /// Take the sightings of a pulse, and return the pose of the pulse that leaves the window.
    fn estimate(&mut self, sightings: &[Sighting]) -> Option<Located> {
        let number = self.released;
        self.released += 1;
        let tracker = &mut self.tracker;
        self.lost.retain(|&target| {
            let known = tracker.targets().any(|(name, _)| name == target);
            known && !tracker.forget(target)
        });
        if sightings.len() < 2 {
            self.going.blind += 1;
            self.tracker.skip(1);
            return None;
        }
        let oldest = self.tracker.window().first().copied();
        match self.consistent(sightings) {
            Ok(step) => {
                self.window.push_back(number);
                self.going.chi_square = step.chi_square;
                self.going.doubtful += usize::from(step.doubtful > 0);
            }
            Err(_) => self.going.blind += 1,
        }
        // The oldest may have left the window even if this pulse was refused.
        if self.window.len() == self.tracker.window().len() {
            return None;
        }
        let (number, pose) = (self.window.pop_front()?, oldest?);
        Some(self.located(number, &pose))
    }

    /// Push a pulse without the sightings that contradict the others: the worst one is left out in turn, until those that remain agree. They have to be three at least, and more than half; where such a majority does not
    /// agree, all are kept. A target starts anew after [`MAX_CONTRADICTIONS`] contradicting sightings in a row, since its own position may be wrong.
    fn consistent(&mut self, sightings: &[Sighting]) -> Result<Step, MotionError> {
        let before = self.tracker.clone();
        let mut step = self.tracker.push(sightings)?;
        let mut rest = sightings.to_vec();
        let mut worst = worst_contradiction(&self.tracker);
        let mut tracker = before.clone();
        while let Some(target) = worst {
            rest.retain(|sighting| sighting.target != target);
            tracker.clone_from(&before);
            let majority = 2 * rest.len() > sightings.len();
            match tracker.push(&rest) {
                Ok(without) if majority && rest.len() >= MIN_CONSISTENT => {
                    worst = worst_contradiction(&tracker);
                    if worst.is_none() {
                        self.tracker.clone_from(&tracker);
                        step = without;
                    }
                }
                _ => return Ok(step),
            }
        }
        for sighting in sightings {
            let target = sighting.target;
            if rest.iter().any(|other| other.target == target) {
                self.contradictions.remove(&target);
                continue;
            }
            self.going.contradictions += 1;
            let count = self.contradictions.entry(target).or_default();
            *count += 1;
            if *count > MAX_CONTRADICTIONS && self.tracker.forget(target) {
                self.contradictions.remove(&target);
            }
        }
        Ok(step)
    }

    fn located(&mut self, pulse: usize, pose: &Pose) -> Located {
        let first_rad = *self.first_rad.get_or_insert(pose.heading_rad);
        // The smoother holds the direction to the first target; the frame is the body's at its first heading.
        let back = DQuat::from_rotation_z(-first_rad);
        let own = &self.arrangement;
        Located {
            pulse,
            position_m: own.origin_m + own.attitude * (back * pose.at_m.extend(0.0)),
            attitude: own.attitude * DQuat::from_rotation_z(pose.heading_rad - first_rad),
        }
    }
}

/// The target whose sighting in the last pulse contradicts the others most.
fn worst_contradiction(tracker: &Tracker) -> Option<usize> {
    let residuals = tracker.residuals().into_iter();
    residuals
        .filter(|one| one.rms_sigmas > HUBER && one.rms_rad > CONTRADICTS_RAD)
        .max_by(|a, b| a.rms_sigmas.total_cmp(&b.rms_sigmas))
        .map(|one| one.target)
}
