//! Along-track alignment of channels: the same section of the synthetic aperture, seen by each channel at its own time.
//!
//! The phase centre of a channel is the middle between its transmitter and receiver. Channel `c` passes the along-track position `s`
//! at the time `t_c(s)`, with the lag `tau_c = t_c(s) - t_0(s)` behind channel 0. Stationary scatterers have the same echo at the same
//! `s`; a moving target has the additional path `rho tau_c`, `rho` its path rate. This is the displaced phase centre antenna (DPCA)
//! condition, and it need not be met by whole pulses: the slow-time weight of pulse `n` of channel `c` is
//!
//! ```text
//! w_c[n] = w((s_c[n] - s_mid) / L) |cell_c[n] in section| / mean cell,
//! ```
//!
//! `w` the window over the section common to all channels, `L` its length, and `cell_c[n]` the part of the track nearer to this pulse than to any
//! other. All channels then approximate the same integral over the section. The difference of their images of a stationary scene is that
//! of two quadratures: small wherever the pulse repetition frequency exceeds the clutter's Doppler bandwidth.

use std::sync::Arc;

use glam::DVec3;
use subaperture_model::phase_history::{Collection, Weights};
use subaperture_signal::window::Window;

use crate::error::GmtiError;

/// Smallest along-track extent of the phase centres, as a fraction of the pulse spacing.
const MIN_EXTENT: f64 = 1e-3;

/// Number of positions over which lags are averaged.
const LAG_POSITIONS: usize = 33;

/// Channels aligned along the track.
#[derive(Clone, Debug)]
pub struct Alignment {
    along_m: Vec<Vec<f64>>,
    times_s: Arc<[f64]>,
    section_m: [f64; 2],
    lags_s: Vec<f64>,
}

impl Alignment {
    /// Align channels whose pulse `n` belongs to the same transmission.
    ///
    /// # Errors
    /// [`GmtiError::Channels`] for fewer than two; [`GmtiError::Untimed`]; [`GmtiError::Track`] if the radar does not move in one
    /// direction along its track; [`GmtiError::NoBaseline`] if the phase centres have no along-track separation.
    pub fn new(channels: &[&Collection]) -> Result<Self, GmtiError> {
        let [first, _, ..] = channels else {
            return Err(GmtiError::Channels {
                found: channels.len(),
            });
        };
        if channels.iter().any(|channel| !channel.timed) {
            return Err(GmtiError::Untimed);
        }
        let count = first.pulses.len();
        if count < 3 || channels.iter().any(|channel| channel.pulses.len() != count) {
            return Err(GmtiError::Track(
                "expected at least three pulses, as many in each channel",
            ));
        }
        let scale = 1.0 / channels.len() as f64;
        let mean = |n: usize| {
            let centres = channels
                .iter()
                .map(|channel| channel.pulses[n].phase_centre_m());
            centres.sum::<DVec3>() * scale
        };
        let track_m: Vec<DVec3> = (0..count).map(mean).collect();
        let mut length_m = 0.0;
        let mut along_m = vec![Vec::with_capacity(count); channels.len()];
        for n in 0..count {
            let (before, after) = (
                track_m[n.saturating_sub(1)],
                track_m[(n + 1).min(count - 1)],
            );
            let direction = (after - before).normalize_or_zero();
            if n > 0 {
                length_m += track_m[n].distance(track_m[n - 1]);
            }
            for (along_m, channel) in along_m.iter_mut().zip(channels) {
                let offset_m = channel.pulses[n].phase_centre_m() - track_m[n];
                along_m.push(length_m + offset_m.dot(direction));
            }
        }
        let ascends = |along_m: &Vec<f64>| along_m.windows(2).all(|pair| pair[1] > pair[0]);
        if !along_m.iter().all(ascends) {
            return Err(GmtiError::Track(
                "the radar stands still or reverses: expected a track in one direction",
            ));
        }
        let start_m = along_m
            .iter()
            .map(|along_m| along_m[0])
            .fold(f64::MIN, f64::max);
        let end_m = along_m
            .iter()
            .map(|along_m| along_m[count - 1])
            .fold(f64::MAX, f64::min);
        if end_m <= start_m {
            return Err(GmtiError::Track(
                "the track is shorter than the array: no section of it is seen by all channels",
            ));
        }
        let times_s: Arc<[f64]> = first.pulses.iter().map(|pulse| pulse.time_s).collect();
        let mut aligned = Self {
            along_m,
            times_s,
            section_m: [start_m, end_m],
            lags_s: Vec::new(),
        };
        aligned.lags_s = (0..channels.len())
            .map(|channel| aligned.mean_lag_s(channel))
            .collect();
        let spread_s = aligned.lag_spread_s();
        let pri_s = (aligned.times_s[count - 1] - aligned.times_s[0]) / (count - 1) as f64;
        if spread_s.is_nan() || spread_s <= MIN_EXTENT * pri_s {
            return Err(GmtiError::NoBaseline {
                extent_m: spread_s * (end_m - start_m) / (pri_s * (count - 1) as f64),
            });
        }
        Ok(aligned)
    }

    /// Time at which a channel passes an along-track position, seconds.
    pub(crate) fn time_s(&self, channel: usize, along_m: f64) -> f64 {
        let (n, part) = self.place(channel, along_m);
        self.times_s[n] + part * (self.times_s[n + 1] - self.times_s[n])
    }

    /// Pulse of a channel before an along-track position, and the fraction of the spacing to the next one. The position may be a pulse spacing outside of the track.
    pub(crate) fn place(&self, channel: usize, along_m: f64) -> (usize, f64) {
        let own = &self.along_m[channel];
        let after = own.partition_point(|&s| s <= along_m);
        let n = after.clamp(1, own.len() - 1) - 1;
        (n, (along_m - own[n]) / (own[n + 1] - own[n]))
    }

    fn mean_lag_s(&self, channel: usize) -> f64 {
        let [start_m, end_m] = self.section_m;
        let lag = |i: usize| {
            let along_m = start_m + (end_m - start_m) * (i as f64 + 0.5) / LAG_POSITIONS as f64;
            self.time_s(channel, along_m) - self.time_s(0, along_m)
        };
        (0..LAG_POSITIONS).map(lag).sum::<f64>() / LAG_POSITIONS as f64
    }

    /// Largest difference of two lags, seconds.
    pub(crate) fn lag_spread_s(&self) -> f64 {
        let most = self.lags_s.iter().copied().fold(f64::MIN, f64::max);
        most - self.lags_s.iter().copied().fold(f64::MAX, f64::min)
    }

    /// Lag of each channel behind channel 0, seconds; negative for a phase centre ahead of it.
    pub fn lags_s(&self) -> &[f64] {
        &self.lags_s
    }

    /// Time at which channel 0 is in the middle of the section, seconds.
    pub fn centre_s(&self) -> f64 {
        let [start_m, end_m] = self.section_m;
        self.time_s(0, (start_m + end_m) / 2.0)
    }

    /// Time in which channel 0 passes the section, seconds.
    pub fn duration_s(&self) -> f64 {
        let [start_m, end_m] = self.section_m;
        self.time_s(0, end_m) - self.time_s(0, start_m)
    }

    /// Speed of the radar along its track, metres per second, mean over the section.
    pub fn speed_m_s(&self) -> f64 {
        let [start_m, end_m] = self.section_m;
        (end_m - start_m) / self.duration_s()
    }

    /// Pulses of channel 0 in the middle of the section: the eighth of it about its middle, at least three.
    pub fn middle_pulses(&self) -> std::ops::Range<usize> {
        let [start_m, end_m] = self.section_m;
        let (middle_m, half_m) = ((start_m + end_m) / 2.0, (end_m - start_m) / 16.0);
        let own = &self.along_m[0];
        let start = own.partition_point(|&s| s < middle_m - half_m);
        let end = own.partition_point(|&s| s < middle_m + half_m);
        let start = start.min(own.len() - 3);
        start..end.max(start + 3)
    }

    /// Mean pulse interval of the middle pulses, seconds.
    pub(crate) fn interval_s(&self) -> f64 {
        let times_s = &self.times_s[self.middle_pulses()];
        (times_s[times_s.len() - 1] - times_s[0]) / (times_s.len() - 1) as f64
    }

    /// Pulse of `channel` nearest to the along-track position of each pulse of channel 0; `None` outside its track. With `exchanged`, as if the
    /// channel were as far on the other side of channel 0.
    pub(crate) fn nearest(&self, channel: usize, exchanged: bool) -> Vec<Option<usize>> {
        let own = &self.along_m[channel];
        let count = own.len();
        let partner = |n: usize| {
            let reference_m = self.along_m[0][n];
            let along_m = match exchanged {
                false => reference_m,
                true => reference_m + 2.0 * (own[n] - reference_m),
            };
            let after = own.partition_point(|&s| s < along_m);
            let nearest = match after {
                0 => 0,
                _ if after == count => count - 1,
                _ if own[after] - along_m < along_m - own[after - 1] => after,
                _ => after - 1,
            };
            let spacing_m = (own[count - 1] - own[0]) / (count - 1) as f64;
            ((own[nearest] - along_m).abs() <= spacing_m).then_some(nearest)
        };
        (0..count).map(partner).collect()
    }

    /// Weights of each channel by windows over frequency and over the section.
    pub fn weights(&self, num_samples: usize, fast: Window, slow: Window) -> Vec<Weights> {
        let of_channel = |channel: usize| Weights {
            fast: fast.weights(num_samples),
            slow: self.slow_weights(channel, self.section_m, slow),
            illumination: None,
            windows: None,
        };
        (0..self.along_m.len()).map(of_channel).collect()
    }

    /// Weight of each pulse of a channel by a window over a section of the track.
    pub(crate) fn slow_weights(
        &self,
        channel: usize,
        [start_m, end_m]: [f64; 2],
        window: Window,
    ) -> Vec<f64> {
        let (middle_m, length_m) = ((start_m + end_m) / 2.0, end_m - start_m);
        let shape = window.shape();
        let own = &self.along_m[channel];
        let count = own.len();
        let mean_m = (own[count - 1] - own[0]) / (count - 1) as f64;
        let weight = |n: usize| {
            let before_m = own[n] - own[n.saturating_sub(1)];
            let after_m = own[(n + 1).min(count - 1)] - own[n];
            // The first and the last cell are as long on both sides.
            let (before_m, after_m) = match n {
                0 => (after_m, after_m),
                _ if n + 1 == count => (before_m, before_m),
                _ => (before_m, after_m),
            };
            let cell_start_m = (own[n] - before_m / 2.0).max(start_m);
            let cell_end_m = (own[n] + after_m / 2.0).min(end_m);
            let covered_m = (cell_end_m - cell_start_m).max(0.0);
            let u = ((own[n] - middle_m) / length_m).clamp(-0.5, 0.5);
            match covered_m > 0.0 {
                true => shape(u) * covered_m / mean_m,
                false => 0.0,
            }
        };
        (0..count).map(weight).collect()
    }

    /// Section of the track, start and end, that all channels share, metres from the first pulse.
    pub(crate) fn section_m(&self) -> [f64; 2] {
        self.section_m
    }

    /// Along-track positions of the pulses of a channel, metres.
    pub(crate) fn along_m(&self, channel: usize) -> &[f64] {
        &self.along_m[channel]
    }
}
