//! The support of a collection in spatial frequency, in the scene plane.

use glam::{DVec2, DVec3};

use super::{median, positive};
use crate::SPEED_OF_LIGHT_M_S;
use crate::phase_history::{Collection, Pulse};

/// The samples of the scene's spectrum in the scene plane, cycles a metre.
pub(super) struct Support {
    samples: Vec<DVec2>,
    /// Unit vector in the scene plane along the mean line of sight.
    pub(super) range: DVec2,
    /// Unit vector in the scene plane across it.
    pub(super) cross: DVec2,
}

impl Support {
    /// Both band edges of every pulse.
    pub(super) fn of(collection: &Collection, centre: DVec3) -> Self {
        let mut samples = Vec::with_capacity(2 * collection.pulses.len());
        let mut mean = DVec2::ZERO;
        for pulse in &collection.pulses {
            let gradient = path_gradient(pulse, centre);
            mean += gradient;
            // The band is `count` cells wide, not `count - 1`.
            for k in [-0.5, collection.num_samples as f64 - 0.5] {
                let frequency_hz = pulse.start_hz + k * pulse.step_hz;
                samples.push(gradient * (frequency_hz / SPEED_OF_LIGHT_M_S));
            }
        }
        // A full circle has no mean direction: any will do.
        let range = mean.try_normalize().unwrap_or(DVec2::X);
        Self {
            samples,
            range,
            cross: range.perp(),
        }
    }

    /// One over the extent along `direction`. Worse than `limit_m` counts as none.
    pub(super) fn resolution_m(&self, direction: DVec2, limit_m: f64) -> Option<f64> {
        let (low, high) = self
            .samples
            .iter()
            .map(|k| k.dot(direction))
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), k| {
                (l.min(k), h.max(k))
            });
        let resolution_m = 1.0 / (high - low);
        (resolution_m > 0.0 && resolution_m < limit_m).then_some(resolution_m)
    }

    pub(super) fn unambiguous_range_m(&self, pulse: &Pulse, centre: DVec3) -> Option<f64> {
        let gradient = path_gradient(pulse, centre).length();
        positive(1.0 / (pulse.step_hz * gradient / SPEED_OF_LIGHT_M_S))
    }

    /// One over the median step across range from pulse to pulse, at the middle of the band.
    pub(super) fn unambiguous_cross_m(
        &self,
        pulses: &[Pulse],
        centre: DVec3,
        limit_m: f64,
    ) -> Option<f64> {
        let across = |n: usize| {
            // Both band edges: their mean is the middle of the band.
            let k = (self.samples[2 * n] + self.samples[2 * n + 1]) / 2.0;
            (k, path_gradient(&pulses[n], centre).try_normalize())
        };
        let steps = (1..pulses.len()).filter_map(|n| {
            let ((before, _), (after, look)) = (across(n - 1), across(n));
            Some((after - before).dot(look?.perp()).abs())
        });
        let extent_m = 1.0 / median(steps)?;
        // Steps by rounding alone are no movement.
        (extent_m.is_finite() && extent_m < 1e6 * limit_m).then_some(extent_m)
    }
}

/// `u_t + u_r` in the scene plane: how the path grows with the scene point.
fn path_gradient(pulse: &Pulse, point: DVec3) -> DVec2 {
    let sum = (point - pulse.transmitter_m).normalize_or_zero()
        + (point - pulse.receiver_m).normalize_or_zero();
    sum.truncate()
}
