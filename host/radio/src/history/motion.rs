//! Antenna positions during a sweep.

use glam::DVec3;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::Extent;
use subaperture_model::phase_history::{Pulse, Sweep as Motions};

use super::track::Track;
use crate::profile::Sweep;

/// Largest path error accepted, in shortest wavelengths.
const MAX_OFF: f64 = 0.125;

/// Smallest fraction of a sweep's duration that the fitted line must cover for the carriers to count as ordered.
const MIN_COVERED: f64 = 0.5;

/// Motion within a sweep exceeds the model's error bound.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "sweep at {time_s:.3} s: the antennas deviate by {off_m:.3} m from a parabola with evenly timed carriers, which leaves a path error of up to {left_m:.3} m within the scene; \
     expected at most {allowed_m:.3} m. Take carriers in ascending or descending order, move slower, or give a smaller extent"
)]
pub struct MotionError {
    /// Device time of the middle of the sweep, seconds.
    pub time_s: f64,
    /// Largest deviation of an antenna from the model, metres.
    pub off_m: f64,
    /// Largest remaining path error, metres.
    pub left_m: f64,
    /// Largest path error accepted, metres.
    pub allowed_m: f64,
}

/// Line fitted to the times of a sweep's carriers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Timing {
    /// Device time of carrier `K/2`, seconds.
    pub(super) middle_s: f64,
    /// Time from carrier to carrier, seconds; negative for descending carriers, 0 for shuffled ones.
    pub(super) carrier_s: f64,
    /// Device times of the first and last carriers, seconds.
    pub(super) span_s: (f64, f64),
}

impl Timing {
    /// Least-squares fit over the carriers present. A sweep that passed its check has at least two.
    pub(super) fn of(sweep: &Sweep) -> Self {
        let centre = (sweep.values.len() / 2) as f64;
        let count = sweep.usable().max(1) as f64;
        let (mut sum_k, mut sum_t) = (0.0, 0.0);
        let mut span_s = (f64::INFINITY, f64::NEG_INFINITY);
        for (k, time_s) in sweep.moments() {
            sum_k += k as f64;
            sum_t += time_s;
            span_s = (span_s.0.min(time_s), span_s.1.max(time_s));
        }
        let (mean_k, mean_t) = (sum_k / count, sum_t / count);
        let (mut square, mut cross) = (0.0, 0.0);
        for (k, time_s) in sweep.moments() {
            square += (k as f64 - mean_k).powi(2);
            cross += (k as f64 - mean_k) * (time_s - mean_t);
        }
        let slope_s = if square > 0.0 { cross / square } else { 0.0 };
        // For shuffled carriers the slope is meaningless: the line would cover only a small part of the sweep.
        let ordered =
            slope_s.abs() * sweep.values.len() as f64 > MIN_COVERED * (span_s.1 - span_s.0);
        let carrier_s = if ordered { slope_s } else { 0.0 };
        Self {
            middle_s: mean_t + (centre - mean_k) * carrier_s,
            carrier_s,
            span_s,
        }
    }

    /// Whether all times are finite; sums over times of a damaged file may overflow.
    pub(super) fn is_finite(&self) -> bool {
        let (from_s, to_s) = self.span_s;
        [self.middle_s, self.carrier_s, from_s, to_s]
            .iter()
            .all(|s| s.is_finite())
    }

    fn line_s(&self, k: usize, count: usize) -> f64 {
        self.middle_s + (k as f64 - (count / 2) as f64) * self.carrier_s
    }
}

/// Antenna motion of a receiver's channel during a sweep.
pub(super) struct Motion<'a> {
    timing: &'a Timing,
    track: Option<&'a Track>,
    arms_m: [DVec3; 2],
    num_samples: usize,
    velocities_m_s: [DVec3; 2],
    accelerations_m_s2: [DVec3; 2],
}

impl<'a> Motion<'a> {
    pub(super) fn new(
        timing: &'a Timing,
        track: Option<&'a Track>,
        arms_m: [DVec3; 2],
        num_samples: usize,
    ) -> Self {
        let mut motion = Self {
            timing,
            track,
            arms_m,
            num_samples,
            velocities_m_s: [DVec3::ZERO; 2],
            accelerations_m_s2: [DVec3::ZERO; 2],
        };
        // Parabola through both ends and the middle of the line.
        let half_s = 0.5 * num_samples as f64 * timing.carrier_s.abs();
        if track.is_some() && half_s > 0.0 {
            let at = |time_s: f64| motion.antennas_m(time_s);
            let middle_s = timing.middle_s;
            let (before, now, after) = (at(middle_s - half_s), at(middle_s), at(middle_s + half_s));
            for i in [0, 1] {
                motion.velocities_m_s[i] = (after[i] - before[i]) / (2.0 * half_s);
                motion.accelerations_m_s2[i] =
                    (after[i] - 2.0 * now[i] + before[i]) / (half_s * half_s);
            }
        }
        motion
    }

    /// Positions of transmitter and receiver at a device time, metres.
    pub(super) fn antennas_m(&self, time_s: f64) -> [DVec3; 2] {
        match self.track {
            Some(track) => {
                let pose = track.pose(time_s);
                self.arms_m.map(|arm_m| pose.point_m(arm_m))
            }
            None => self.arms_m,
        }
    }

    /// Path from transmitter to point to receiver at a device time, metres.
    pub(super) fn path_m(&self, point_m: DVec3, time_s: f64) -> f64 {
        let [transmitter_m, receiver_m] = self.antennas_m(time_s);
        (point_m - transmitter_m).length() + (point_m - receiver_m).length()
    }

    /// Intra-pulse motion of the pulse.
    pub(super) fn sweep(&self) -> Motions {
        Motions {
            sample_s: self.timing.carrier_s,
            transmitter_m_s: self.velocities_m_s[0],
            transmitter_m_s2: self.accelerations_m_s2[0],
            receiver_m_s: self.velocities_m_s[1],
            receiver_m_s2: self.accelerations_m_s2[1],
            reference_m_s: Some(DVec3::ZERO),
        }
    }

    /// Check the path error against the bound of the module.
    pub(super) fn check(
        &self,
        sweep: &Sweep,
        reference_m: DVec3,
        extent: Option<Extent>,
        highest_hz: f64,
    ) -> Result<(), MotionError> {
        if self.track.is_none() {
            return Ok(());
        }
        let [transmitter_m, receiver_m] = self.antennas_m(self.timing.middle_s);
        let pulse = Pulse {
            time_s: self.timing.middle_s,
            transmitter_m,
            receiver_m,
            reference_m,
            reference_path_m: 0.0,
            start_hz: sweep.start_hz,
            step_hz: sweep.step_hz,
            sweep: self.sweep(),
            recorded_path_m: None,
        };
        let spread = [transmitter_m, receiver_m].map(|from_m| spread(from_m, reference_m, extent));
        let allowed_m = MAX_OFF * SPEED_OF_LIGHT_M_S / highest_hz;
        let (mut off_m, mut left_m) = (0f64, 0f64);
        for (k, time_s) in sweep.moments() {
            let on_line = self.timing.line_s(k, self.num_samples);
            let after = (on_line - self.timing.middle_s) / self.timing.carrier_s;
            let modelled = match self.timing.carrier_s == 0.0 {
                true => [transmitter_m, receiver_m],
                false => pulse.antennas_after_m(after),
            };
            let off = [0, 1].map(|i| self.antennas_m(time_s)[i].distance(modelled[i]));
            off_m = off_m.max(off[0]).max(off[1]);
            left_m = left_m.max(off[0] * spread[0] + off[1] * spread[1]);
        }
        match left_m > allowed_m {
            true => Err(MotionError {
                time_s: self.timing.middle_s,
                off_m,
                left_m,
                allowed_m,
            }),
            false => Ok(()),
        }
    }
}

/// Largest distance between the unit vectors to points of the scene and to its reference point.
fn spread(from_m: DVec3, reference_m: DVec3, extent: Option<Extent>) -> f64 {
    // Opposite directions.
    const ANY: f64 = 2.0;
    let Some(extent) = extent else { return ANY };
    let (within_x, within_y) = (
        extent.x_m.0 <= from_m.x && from_m.x <= extent.x_m.1,
        extent.y_m.0 <= from_m.y && from_m.y <= extent.y_m.1,
    );
    if within_x && within_y {
        return ANY;
    }
    let towards = (reference_m - from_m).normalize_or_zero();
    // Seen from outside a rectangle, the corners are the farthest from the reference direction.
    let corners = [extent.x_m.0, extent.x_m.1]
        .into_iter()
        .flat_map(|x| [extent.y_m.0, extent.y_m.1].map(|y| DVec3::new(x, y, reference_m.z)));
    let each = corners.map(|corner| ((corner - from_m).normalize_or_zero() - towards).length());
    each.fold(0.0, f64::max)
}
