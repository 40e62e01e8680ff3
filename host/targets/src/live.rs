//! A radar's own motion while it moves, by its echoes as they come.
//!
//! ```text
//! pulse of each channel ─ profile, cfar, echo ─> follow: waits for `Follow::within` pulses ─> motion::Tracker: looks at the last forty again ─> Located
//! ```
//!
//! It is what [`crate::recover()`] does with a whole recording, as far as that can be done before the rest has come. A pulse's place is told when it leaves the tracker's window,
//! [`Live::lag`] pulses after its own, and is final: targets that later turn out to be one are not joined, and all pulses are not solved at once.
//!
//! **Frame**: the body's in the first pulse that tells a place ([`Arrangement`]), as the first pulse's positions have it. Echoes tell no more.
//!
//! **Neglected**: targets that move are taken for still. [`subaperture_motion::live`] tells them apart, of more targets than most pulses of a stepped radar show.
//!
//! **Memory**: targets that are followed, [`Settings::most_targets`] a pulse and those not seen for [`crate::follow::Follow::bridge`] pulses at the most; [`Live::lag`] pulses' sightings.
//! **Cost** of a push: two transforms of each channel's profile, and the tracker's, which grows with the cube of the targets. **Accuracy**: `tests/live.rs`; of a
//! radio's walk `tests/cli/live.rs`.

use std::collections::VecDeque;

use glam::{DQuat, DVec3};
use num_complex::Complex32;
use subaperture_model::phase_history::{Band, Pulse};
use subaperture_motion::{Pose, Sighting, Tracker};

use crate::arrangement::Arrangement;
use crate::follow::{Event, Follower};
use crate::profile::Echoes;
use crate::see::{Looker, Settings, TargetsError, profiler};

/// Pulses that motion looks at again: a place is told once, so more than where all are solved together at the end.
const WINDOW: usize = 40;

/// Where a pulse was taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Located {
    /// Its number: pulses are counted from 0 as they are pushed.
    pub pulse: usize,
    /// The body's origin, metres.
    pub position_m: DVec3,
    /// From the body's axes to those of the first pulse's positions.
    pub attitude: DQuat,
}

/// How well it goes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Going {
    /// Pulses of which fewer than two targets are seen, or that do not tell a place: they have none.
    pub blind: usize,
    /// Pulses with phases that may have wrapped: from there on places may be off by half wavelengths.
    pub doubtful: usize,
    /// Squared errors in standard deviations of the last window, and how many they should be.
    pub chi_square: [f64; 2],
    /// Targets that are known.
    pub targets: usize,
}

/// Finds where a radar is, pulse by pulse.
pub struct Live {
    looker: Looker,
    arrangement: Arrangement,
    order: Vec<usize>,
    follower: Follower,
    tracker: Tracker,
    within: usize,
    /// The heading that the first pulse was found to have, which is that of the body in its frame.
    first_rad: Option<f64>,
    pushed: usize,
    released: usize,
    /// Numbers of the pulses in the tracker's window.
    window: VecDeque<usize>,
    /// Targets that are seen no more and could not be forgotten yet.
    lost: Vec<usize>,
    going: Going,
}

impl Live {
    /// Of an array whose channels' antennas are where these pulses of one moment say, one a channel, of `num_samples` samples each.
    ///
    /// # Errors
    /// Channels that are no array, receivers too far apart to tell angles, too few samples, settings that cannot be.
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
        let follower = Follower::new(settings.follow, cell_m).map_err(TargetsError::Settings)?;
        Ok(Self {
            looker: Looker::new(profiler, settings, first.len())?,
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
            going: Going::default(),
        })
    }

    /// Where the antennas are on the body that is located.
    pub fn arrangement(&self) -> &Arrangement {
        &self.arrangement
    }

    /// Pulses after which a place is told at the latest, of those that tell one.
    pub fn lag(&self) -> usize {
        self.within + WINDOW
    }

    /// How well it goes.
    pub fn going(&self) -> Going {
        Going {
            targets: self.tracker.targets().count(),
            ..self.going
        }
    }

    /// Takes the next pulse, of each channel its samples and what they are compensated by; places that are known now, in the order of pulses. Samples that are no numbers tell nothing.
    ///
    /// # Panics
    /// If there are not as many channels and samples as at first.
    pub fn push(&mut self, channels: &[(Pulse, Vec<Complex32>)]) -> Vec<Located> {
        assert_eq!(channels.len(), self.order.len(), "channels");
        let is_number = |z: &Complex32| z.re.is_finite() && z.im.is_finite();
        let whole = channels.iter().all(|(_, z)| z.iter().all(is_number));
        let mut found = match whole {
            true => {
                let each = channels.iter();
                let echoes: Echoes = each
                    .map(|(pulse, samples)| self.looker.uncompensated(pulse, samples))
                    .collect();
                self.looker.find(&echoes).0
            }
            false => Vec::new(),
        };
        found.retain(|echo| self.looker.is_heard(echo));
        for echo in &mut found {
            echo.phases_rad = self.order.iter().map(|&c| echo.phases_rad[c]).collect();
        }
        self.pushed += 1;
        let told = self.follower.push(&found);
        for event in self.follower.events() {
            if let Event::Lost { target, .. } = event {
                self.lost.push(target);
            }
        }
        told.map_or_else(Vec::new, |told| {
            self.understand(&told).into_iter().collect()
        })
    }

    /// Places of the pulses that wait still, when no more come.
    pub fn finish(&mut self) -> Vec<Located> {
        let mut located = Vec::new();
        for told in self.follower.finish() {
            located.extend(self.understand(&told));
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

    /// What is seen in a pulse; the place of the one that leaves the window for it.
    fn understand(&mut self, sightings: &[Sighting]) -> Option<Located> {
        let number = self.released;
        self.released += 1;
        let tracker = &mut self.tracker;
        self.lost.retain(|&target| {
            let known = tracker.targets().any(|(name, _)| name == target);
            known && !tracker.forget(target)
        });
        if sightings.len() < 2 {
            self.going.blind += 1;
            return None;
        }
        let oldest = self.tracker.window().first().copied();
        match self.tracker.push(sightings) {
            Ok(step) => {
                self.window.push_back(number);
                self.going.chi_square = step.chi_square;
                self.going.doubtful += usize::from(step.doubtful > 0);
            }
            Err(_) => self.going.blind += 1,
        }
        // Whether the pulse was understood or not, the oldest may have made room for it.
        if self.window.len() == self.tracker.window().len() {
            return None;
        }
        let (number, pose) = (self.window.pop_front()?, oldest?);
        Some(self.located(number, &pose))
    }

    fn located(&mut self, pulse: usize, pose: &Pose) -> Located {
        let first_rad = *self.first_rad.get_or_insert(pose.heading_rad);
        // What is held is the direction to the first target; the body's first heading is the frame's.
        let back = DQuat::from_rotation_z(-first_rad);
        let own = &self.arrangement;
        Located {
            pulse,
            position_m: own.origin_m + own.attitude * (back * pose.at_m.extend(0.0)),
            attitude: own.attitude * DQuat::from_rotation_z(pose.heading_rad - first_rad),
        }
    }
}
