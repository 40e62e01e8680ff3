//! Multi-target tracker: associates echoes with targets from pulse to pulse.
//!
//! **Prediction.** A Kalman filter of range and range rate (cells per pulse) with constant rate and white acceleration
//! noise. Phase differences between channels, which represent the direction of arrival, are held at their last values.
//! **Association.** Candidate pairs are echoes within the range gate of a target with phase differences within
//! [`MAX_PHASE_DEVIATION_RAD`] RMS of those held. The pair with the smallest deviation is assigned first, then the best of the
//! remaining ones. **Birth.** Any other echo starts a candidate. It is confirmed as a target if it is detected often
//! enough among its first pulses, and deleted otherwise. **Death.** A target undetected for longer than the bridging time
//! is deleted. Its identifier is reused only after all others. **Crossing.** Targets too close to each other are not
//! reported.
//!
//! The host ([`subaperture::targets`](https://docs.rs/subaperture)) uses the same rules, except that it reports a
//! candidate's earlier echoes after confirmation. Increments are sent immediately, so here a target counts from the
//! pulse that confirms it. If there is no room for another candidate, the one undetected for longest is replaced.

use core::f64::consts::TAU;

use super::echo::Measurement;
use super::{Echo, TrackerSettings};

/// Maximum deviation of phase differences from the last ones, in radians RMS.
const MAX_PHASE_DEVIATION_RAD: f64 = 1.2;

/// Track of a target or candidate.
#[derive(Clone, Copy, Debug)]
struct Track<const CHANNELS: usize> {
    /// Whether this entry is used. Not an `Option`: its `None` would contain a nonzero byte, and statics that are not all
    /// zero take flash memory.
    is_active: bool,
    name: u16,
    confirmed: bool,
    /// Pulses since the first detection, and since the last one.
    age: u32,
    unseen: u32,
    times_seen: u32,
    cells: f64,
    /// Range rate in cells per pulse.
    rate_cells: f64,
    /// Covariance: variance of range, covariance, variance of range rate.
    variance: [f64; 3],
    /// Phase of each channel relative to the first.
    phase_differences_rad: [f64; CHANNELS],
    /// Too close to another target to be resolved.
    is_close: bool,
}

/// Tracker of at most `TARGETS` targets and candidates.
#[derive(Clone, Debug)]
pub(super) struct Tracker<const TARGETS: usize, const CHANNELS: usize> {
    all: [Track<CHANNELS>; TARGETS],
    next: u16,
}

impl<const TARGETS: usize, const CHANNELS: usize> Tracker<TARGETS, CHANNELS> {
    /// Create a tracker without tracks.
    pub(super) const fn new() -> Self {
        Self {
            all: [Track::EMPTY; TARGETS],
            next: 0,
        }
    }

    /// Process the echoes of a pulse `pulses` after the previous one. Writes the echoes of confirmed targets and returns
    /// their number. `channels` is the number of channels in use.
    pub(super) fn push(
        &mut self,
        follow: &TrackerSettings,
        echoes: &[Measurement<CHANNELS>],
        (pulses, channels): (u32, usize),
        reported: &mut [Echo<CHANNELS>],
    ) -> usize {
        self.forget(follow, pulses);
        // At most as many steps as a target can be undetected or a candidate pending: no track survives more.
        for _ in 0..pulses {
            if !self.all.iter().any(|track| track.is_active) {
                break;
            }
            self.predict(follow);
        }
        self.find_crossings(follow);
        let assigned = self.associate(follow, echoes, channels);
        let mut count = 0;
        for (track, echo) in self.all.iter_mut().zip(&assigned) {
            let echo = echo.and_then(|e| echoes.get(e));
            let Some(echo) = echo else { continue };
            track.update(follow, echo);
            track.confirmed |=
                track.age < u32::from(follow.within) && track.times_seen >= u32::from(follow.seen);
            if track.confirmed
                && !track.is_close
                && let Some(place) = reported.get_mut(count)
            {
                *place = Echo {
                    target: track.name,
                    // In cells; the odometer converts it to metres.
                    range_m: echo.cells,
                    phases_rad: echo.phases_rad,
                    phase_sigma_rad: echo.phase_sigma_rad,
                };
                count += 1;
            }
        }
        for (e, echo) in echoes.iter().enumerate() {
            if !assigned.contains(&Some(e)) {
                self.start_track(follow, echo);
            }
        }
        self.forget(follow, 1);
        count
    }

    /// Delete tracks that expire within `pulses` more pulses, before an echo at their range is assigned to them: targets
    /// undetected for longer than the bridging time, and candidates that can no longer be confirmed.
    fn forget(&mut self, follow: &TrackerSettings, pulses: u32) {
        for track in &mut self.all {
            track.is_active &= match track.confirmed {
                true => track.unseen.saturating_add(pulses) <= u32::from(follow.bridge) + 1,
                false => track.age.saturating_add(pulses) < u32::from(follow.within),
            };
        }
    }

    fn predict(&mut self, follow: &TrackerSettings) {
        let noise = follow.acceleration_cells * follow.acceleration_cells;
        for track in self.all.iter_mut().filter(|track| track.is_active) {
            let [range, both, rate] = track.variance;
            track.cells += track.rate_cells;
            track.variance = [
                range + 2.0 * both + rate + 0.25 * noise,
                both + rate + 0.5 * noise,
                rate + noise,
            ];
            track.age = track.age.saturating_add(1);
            track.unseen = track.unseen.saturating_add(1);
        }
    }

    fn find_crossings(&mut self, follow: &TrackerSettings) {
        for i in 0..TARGETS {
            let track = self.all.get(i).filter(|track| track.is_active);
            let Some(track) = track else { continue };
            let is_close = self.is_close_to_target(follow, track.cells, Some(track.name));
            if let Some(track) = self.all.get_mut(i) {
                track.is_close = is_close;
            }
        }
    }

    /// Whether a target other than `name` is within the crossing distance.
    fn is_close_to_target(&self, follow: &TrackerSettings, cells: f64, name: Option<u16>) -> bool {
        self.all.iter().any(|other| {
            let apart = libm::fabs(other.cells - cells);
            other.is_active
                && other.confirmed
                && Some(other.name) != name
                && apart < follow.apart_cells
        })
    }

    /// Index of the echo assigned to each track.
    fn associate(
        &self,
        follow: &TrackerSettings,
        echoes: &[Measurement<CHANNELS>],
        channels: usize,
    ) -> [Option<usize>; TARGETS] {
        let mut assigned = [None; TARGETS];
        loop {
            let mut best: Option<(f64, usize, usize)> = None;
            for (i, track) in self.all.iter().enumerate() {
                let free = assigned.get(i).is_some_and(Option::is_none);
                if !(track.is_active && free) {
                    continue;
                }
                for (e, echo) in echoes.iter().enumerate() {
                    let off = (echo.cells - track.cells) / follow.gate_cells;
                    if libm::fabs(off) >= 1.0 || assigned.contains(&Some(e)) {
                        continue;
                    }
                    let phase_deviation =
                        track.phase_deviation_rad(echo, channels) / MAX_PHASE_DEVIATION_RAD;
                    let sum = off * off + phase_deviation * phase_deviation;
                    if phase_deviation < 1.0 && best.is_none_or(|(least, ..)| sum < least) {
                        best = Some((sum, i, e));
                    }
                }
            }
            let Some((_, i, e)) = best else {
                return assigned;
            };
            if let Some(place) = assigned.get_mut(i) {
                *place = Some(e);
            }
        }
    }

    /// Next identifier that is not in use.
    fn name(&self) -> u16 {
        let is_taken = |name| {
            self.all
                .iter()
                .any(|track| track.is_active && track.name == name)
        };
        // One of `TARGETS + 1` consecutive identifiers is free, since there are at most `TARGETS` tracks.
        (0..=TARGETS)
            .map(|step| self.next.wrapping_add(step as u16))
            .find(|name| !is_taken(*name))
            .unwrap_or(self.next)
    }

    fn start_track(&mut self, follow: &TrackerSettings, echo: &Measurement<CHANNELS>) {
        let is_close = self.is_close_to_target(follow, echo.cells, None);
        let mut place = self.all.iter().position(|track| !track.is_active);
        if place.is_none() {
            let candidates = self.all.iter().enumerate().filter_map(|(i, track)| {
                (!track.confirmed && track.unseen > 0).then_some((track.unseen, i))
            });
            place = candidates.max().map(|(_, i)| i);
        }
        let name = self.name();
        let Some(place) = place.and_then(|i| self.all.get_mut(i)) else {
            return;
        };
        self.next = name.wrapping_add(1);
        *place = Track {
            is_active: true,
            name,
            confirmed: follow.seen <= 1,
            age: 0,
            unseen: 0,
            times_seen: 1,
            cells: echo.cells,
            rate_cells: 0.0,
            variance: [
                echo.sigma_cells * echo.sigma_cells,
                0.0,
                follow.gate_cells * follow.gate_cells,
            ],
            phase_differences_rad: phase_differences_rad(&echo.phases_rad),
            is_close,
        };
    }
}

impl<const CHANNELS: usize> Track<CHANNELS> {
    /// Initial value of a buffer.
    const EMPTY: Self = Self {
        is_active: false,
        name: 0,
        confirmed: false,
        age: 0,
        unseen: 0,
        times_seen: 0,
        cells: 0.0,
        rate_cells: 0.0,
        variance: [0.0; 3],
        phase_differences_rad: [0.0; CHANNELS],
        is_close: false,
    };

    fn update(&mut self, follow: &TrackerSettings, echo: &Measurement<CHANNELS>) {
        let [range, both, rate] = self.variance;
        let mut noise = echo.sigma_cells * echo.sigma_cells;
        if self.is_close {
            // The measurement is of both targets together.
            noise += follow.gate_cells * follow.gate_cells;
        }
        let (gain, rate_gain) = (range / (range + noise), both / (range + noise));
        let off = echo.cells - self.cells;
        self.cells += gain * off;
        self.rate_cells += rate_gain * off;
        self.variance = [
            range - gain * range,
            both - gain * both,
            rate - rate_gain * both,
        ];
        self.unseen = 0;
        self.times_seen = self.times_seen.saturating_add(1);
        if !self.is_close {
            self.phase_differences_rad = phase_differences_rad(&echo.phases_rad);
        }
    }

    /// RMS deviation of phase differences from those held.
    fn phase_deviation_rad(&self, echo: &Measurement<CHANNELS>, channels: usize) -> f64 {
        let new = phase_differences_rad(&echo.phases_rad);
        let mut squares = 0.0;
        for (held, new) in self.phase_differences_rad.iter().zip(&new).take(channels) {
            let turns = (new - held) / TAU;
            let off = TAU * (turns - libm::round(turns));
            squares += off * off;
        }
        // The first channel is the reference and contributes nothing.
        libm::sqrt(squares / channels.saturating_sub(1).max(1) as f64)
    }
}

/// Phase of each channel relative to the first.
fn phase_differences_rad<const CHANNELS: usize>(phases_rad: &[f64; CHANNELS]) -> [f64; CHANNELS] {
    let first = phases_rad.first().copied().unwrap_or(0.0);
    phases_rad.map(|phase| phase - first)
}

#[cfg(test)]
mod tests {
    use super::*;

    const FOLLOW: TrackerSettings = TrackerSettings {
        gate_cells: 0.5,
        acceleration_cells: 0.01,
        apart_cells: 1.5,
        seen: 2,
        within: 3,
        bridge: 4,
    };

    fn echo(cells: f64) -> Measurement<2> {
        Measurement {
            cells,
            sigma_cells: 0.01,
            phase_sigma_rad: 0.01,
            ..Measurement::EMPTY
        }
    }

    /// Targets reported `pulses` pulses later, for echoes at one or two ranges.
    fn reported(follower: &mut Tracker<3, 2>, pulses: u32, cells: &[f64]) -> [Option<u16>; 2] {
        let seen = [cells[0], cells[cells.len() - 1]].map(echo);
        let mut reported = [Echo {
            target: 0,
            range_m: 0.0,
            phases_rad: [0.0; 2],
            phase_sigma_rad: 0.0,
        }; 3];
        let count = follower.push(&FOLLOW, &seen[..cells.len()], (pulses, 2), &mut reported);
        core::array::from_fn(|i| reported[..count].get(i).map(|echo| echo.target))
    }

    /// A target is bridged over four missed pulses but not five, and a candidate counts for three, whether pulses arrive without it or not at all.
    #[test]
    fn expired_tracks_are_deleted_before_association() {
        let known = |is_known: bool| [is_known.then_some(0), None];
        for (lost, is_known) in [(4, true), (5, false), (1000, false), (u32::MAX - 1, false)] {
            let mut follower = Tracker::new();
            assert_eq!(reported(&mut follower, 0, &[7.0]), known(false));
            assert_eq!(reported(&mut follower, 1, &[7.0]), known(true));
            let later = reported(&mut follower, lost + 1, &[7.0]);
            assert_eq!(later, known(is_known), "{lost}");
        }
        for (lost, is_known) in [(1, true), (2, false)] {
            let mut follower = Tracker::new();
            assert_eq!(reported(&mut follower, 0, &[7.0]), known(false));
            let later = reported(&mut follower, lost + 1, &[7.0]);
            assert_eq!(later, known(is_known), "{lost}");
        }
    }

    /// The identifier counter returns to that of a target that is still tracked.
    #[test]
    fn identifier_in_use_is_not_reassigned() {
        let mut follower = Tracker::new();
        follower.next = u16::MAX;
        reported(&mut follower, 0, &[7.0]);
        assert_eq!(reported(&mut follower, 1, &[7.0]), [Some(u16::MAX), None]);
        follower.next = u16::MAX;
        reported(&mut follower, 1, &[7.0, 20.0]);
        let both = reported(&mut follower, 1, &[7.0, 20.0]);
        assert_eq!(both, [Some(u16::MAX), Some(0)]);
    }
}
