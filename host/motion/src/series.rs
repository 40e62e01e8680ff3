//! Phase unwrapping of one target through many pulses, whatever the motion of the radar.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use glam::DVec2;

use crate::arrival::{self, Arrival};
use crate::model::{Array, Sighting};

/// Echoes of one target in the order of pulses.
pub(crate) struct Series<'a> {
    pub(crate) name: usize,
    pub(crate) looks: Vec<Look<'a>>,
}

/// Echo of a target in a pulse.
#[derive(Clone)]
pub(crate) struct Look<'a> {
    pub(crate) pulse: usize,
    pub(crate) sighting: &'a Sighting,
    pub(crate) arrival: Arrival,
    /// Mean phase of all channels, unwrapped, radians.
    pub(crate) common_rad: f64,
}

/// Least-squares line through points `(x, y)` of equal weight: its slope, the slope's standard deviation for unit standard deviation of `y`, and its value at the mean of `x`.
pub(crate) fn line(points: impl Iterator<Item = (f64, f64)> + Clone) -> [f64; 3] {
    let count = points.clone().count() as f64;
    let mean_x = points.clone().map(|(x, _)| x).sum::<f64>() / count;
    let mean_y = points.clone().map(|(_, y)| y).sum::<f64>() / count;
    let spread: f64 = points.clone().map(|(x, _)| (x - mean_x).powi(2)).sum();
    let product: f64 = points.map(|(x, y)| (x - mean_x) * (y - mean_y)).sum();
    [product / spread, 1.0 / libm::sqrt(spread), mean_y]
}

/// Sightings of each target with their pulse numbers.
fn sightings(pulses: &[Vec<Sighting>]) -> BTreeMap<usize, Vec<(usize, &Sighting)>> {
    let mut by_name: BTreeMap<usize, Vec<(usize, &Sighting)>> = BTreeMap::new();
    for (n, pulse) in pulses.iter().enumerate() {
        for sighting in pulse {
            by_name
                .entry(sighting.target)
                .or_default()
                .push((n, sighting));
        }
    }
    by_name
}

impl<'a> Series<'a> {
    /// Series of all targets, in the order of their numbers. Whole turns from pulse to pulse that phases cannot resolve follow from the ranges.
    pub(crate) fn all(array: &Array, pulses: &'a [Vec<Sighting>]) -> Vec<Self> {
        let mut all = Self::wrapping(array, pulses);
        for series in &mut all {
            let [turns, sigma] = series.turns(array);
            if sigma < 0.2 {
                for look in &mut series.looks {
                    look.common_rad += TAU * turns.round() * look.pulse as f64;
                }
            }
        }
        all
    }

    /// Series of all targets, in the order of their numbers, by phases alone.
    pub(crate) fn wrapping(array: &Array, pulses: &'a [Vec<Sighting>]) -> Vec<Self> {
        let each = sightings(pulses).into_iter();
        each.map(|(name, seen)| Self::new(array, name, &seen))
            .collect()
    }

    /// Unwrap with the phase rate of the last two echoes.
    fn new(array: &Array, name: usize, seen: &[(usize, &'a Sighting)]) -> Self {
        let mut rate = 0.0;
        let mut looks: Vec<Look> = Vec::with_capacity(seen.len());
        for &(pulse, sighting) in seen {
            let arrival = arrival::look(array, sighting);
            let mean = arrival.phases_rad.iter().sum::<f64>() / arrival.phases_rad.len() as f64;
            let common_rad = match looks.last() {
                None => mean,
                Some(last) => {
                    let pulses = (pulse - last.pulse) as f64;
                    let expected = last.common_rad + rate * pulses;
                    let common = mean + TAU * ((expected - mean) / TAU).round();
                    rate = (common - last.common_rad) / pulses;
                    common
                }
            };
            looks.push(Look {
                pulse,
                sighting,
                arrival,
                common_rad,
            });
        }
        Self { name, looks }
    }

    /// Difference of range rate and phase rate, turns per pulse, and its standard deviation; infinite for fewer than three pulses.
    pub(crate) fn turns(&self, array: &Array) -> [f64; 2] {
        if self.looks.len() < 3 {
            return [0.0, f64::INFINITY];
        }
        let k = array.rad_m();
        let off = |look: &Look| look.sighting.range_m + look.common_rad / (2.0 * k);
        let points = self.looks.iter().map(|look| (look.pulse as f64, off(look)));
        let [slope, slope_sigma, _] = line(points);
        let sigma_m = self.looks[0].sighting.range_sigma_m;
        [
            -slope * 2.0 * k / TAU,
            slope_sigma * sigma_m * 2.0 * k / TAU,
        ]
    }

    /// Unwrapped directions of arrival, radians.
    pub(crate) fn bearings_rad(&self, array: &Array) -> impl Iterator<Item = f64> + Clone {
        let centre_m = array.centre_m();
        let about = (self.looks[0].arrival.at_m - centre_m).normalize_or_zero();
        let off = move |look: &Look| about.angle_to(look.arrival.at_m - centre_m);
        let first = libm::atan2(about.y, about.x);
        self.looks
            .iter()
            .map(off)
            .map(move |angle| first + angle)
            .collect::<Vec<_>>()
            .into_iter()
    }

    /// Phases of an echo's channels, unwrapped from pulse to pulse, radians.
    pub(crate) fn phases_rad(look: &Look) -> Vec<f64> {
        let phases = &look.arrival.phases_rad;
        let mean = phases.iter().sum::<f64>() / phases.len() as f64;
        let each = phases.iter();
        each.map(|phase| phase - mean + look.common_rad).collect()
    }
}

/// Unit vector of an angle.
pub(crate) fn unit(bearing_rad: f64) -> DVec2 {
    let (sin, cos) = libm::sincos(bearing_rad);
    DVec2::new(cos, sin)
}
