//! Length and angle of an aperture, independent of the order of its pulses.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

use super::{median, positive};
use crate::SPEED_OF_LIGHT_M_S;
use crate::phase_history::{Collection, Pulse};
use crate::resolution::support::path_gradient;

/// Number of azimuth bins along a track around the scene.
const BINS: usize = 72;
/// Azimuth span above which the length is measured along the track instead of end to end, radians.
const AROUND_RAD: f64 = 0.35;

/// Extent of the antenna positions.
pub(super) struct Aperture {
    /// Length from end to end, or along a track around the scene, metres.
    pub(super) length_m: f64,
    /// Largest distance between two antenna positions, metres.
    pub(super) chord_m: f64,
    /// Largest angle between two antenna positions seen from the scene, radians.
    pub(super) angle_rad: f64,
    /// Azimuth span, radians, at most 2 pi.
    pub(super) azimuth_rad: f64,
}

impl Aperture {
    pub(super) fn of(pulses: &[Pulse], centre_m: DVec3) -> Self {
        let places: Vec<DVec3> = pulses.iter().map(Pulse::phase_centre_m).collect();
        let seen = |place: &DVec3| (*place - centre_m).normalize_or_zero();
        let directions: Vec<DVec3> = places.iter().map(seen).collect();
        let mut azimuths: Vec<(f64, DVec3)> = places
            .iter()
            .map(|place| {
                let to = (*place - centre_m).truncate();
                (to.to_angle(), *place)
            })
            .collect();
        azimuths.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (azimuth_rad, first) = azimuth_span(&azimuths);
        azimuths.rotate_left(first);
        let straight_m = widest(&places, |a, b| a.distance(b));
        Self {
            chord_m: straight_m,
            length_m: match azimuth_rad > AROUND_RAD {
                true => straight_m.max(length_around(&azimuths, azimuth_rad)),
                false => straight_m,
            },
            angle_rad: widest(&directions, super::angle_between),
            azimuth_rad,
        }
    }
}

/// Largest distance between two of `points`, by repeated search for the farthest point, which finds the ends of
/// any elongated set.
fn widest(points: &[DVec3], distance: impl Fn(DVec3, DVec3) -> f64) -> f64 {
    let Some(&first) = points.first() else {
        return 0.0;
    };
    let (mut from, mut widest) = (first, 0.0);
    for _ in 0..4 {
        let far = points
            .iter()
            .map(|&point| (distance(from, point), point))
            .max_by(|a, b| a.0.total_cmp(&b.0));
        let Some((length, point)) = far else {
            return widest;
        };
        widest = f64::max(widest, length);
        from = point;
    }
    widest
}

/// Azimuth span: 2 pi minus the widest gap between ascending azimuths, and the index after that gap. A gap not much wider than
/// the others belongs to a full circle.
fn azimuth_span(ascending: &[(f64, DVec3)]) -> (f64, usize) {
    let count = ascending.len();
    if count < 2 {
        return (0.0, 0);
    }
    let gap = |i: usize| match i {
        0 => ascending[0].0 + TAU - ascending[count - 1].0,
        _ => ascending[i].0 - ascending[i - 1].0,
    };
    let widest = (0..count).max_by(|&a, &b| gap(a).total_cmp(&gap(b)));
    let first = widest.unwrap_or(0);
    let usual = median((0..count).map(gap)).unwrap_or(0.0);
    match gap(first) < 4.0 * usual && count > 8 {
        true => (TAU, first),
        false => (TAU - gap(first), first),
    }
}

/// Length of a track around the scene: polyline of mean positions in azimuth bins, and both ends.
fn length_around(around: &[(f64, DVec3)], span_rad: f64) -> f64 {
    let start = around[0].0;
    let mut bins = vec![(DVec3::ZERO, 0.0); BINS];
    for &(azimuth, place) in around {
        let part = (azimuth - start).rem_euclid(TAU) / span_rad;
        let bin = &mut bins[((part * BINS as f64) as usize).min(BINS - 1)];
        *bin = (bin.0 + place, bin.1 + 1.0);
    }
    let means = bins.into_iter().filter(|bin| bin.1 > 0.0);
    let means: Vec<DVec3> = means.map(|(sum, count)| sum / count).collect();
    let mut polyline = Vec::with_capacity(BINS + 2);
    match span_rad < TAU {
        true => {
            polyline.push(around[0].1);
            polyline.extend(&means);
            polyline.push(around[around.len() - 1].1);
        }
        false => {
            polyline.extend(&means);
            polyline.push(means[0]);
        }
    }
    polyline.windows(2).map(|w| w[0].distance(w[1])).sum()
}

/// Unambiguous extent in the scene plane across the line of sight: one over the median cross-range step between
/// looks in order of azimuth, at the band centre.
pub(super) fn unambiguous_cross_m(
    collection: &Collection,
    centre_m: DVec3,
    limit_m: f64,
) -> Option<f64> {
    let middle = collection.num_samples as f64 / 2.0 - 0.5;
    let mut looks: Vec<(f64, f64)> = collection
        .pulses
        .iter()
        .filter_map(|pulse| {
            let gradient: DVec2 =
                path_gradient(pulse.transmitter_m, pulse.receiver_m, centre_m).truncate();
            let cycles = (pulse.start_hz + middle * pulse.step_hz) / SPEED_OF_LIGHT_M_S;
            gradient
                .try_normalize()
                .map(|look| (look.to_angle(), gradient.length() * cycles))
        })
        .collect();
    looks.sort_by(|a, b| a.0.total_cmp(&b.0));
    let steps: Vec<f64> = looks
        .windows(2)
        .map(|w| (w[1].0 - w[0].0) * w[1].1)
        .collect();
    // Coincident looks of overlapping channels are excluded.
    let mean = steps.iter().sum::<f64>() / steps.len().max(1) as f64;
    let extent_m = 1.0 / median(steps.into_iter().filter(|&step| step > 0.01 * mean))?;
    // Steps of rounding size are no movement.
    (extent_m.is_finite() && extent_m < 1e6 * limit_m).then_some(extent_m)
}

/// Extent in the scene plane along the line of sight of the `middle` pulse, centred on the scene centre, that the samples of every pulse contain,
/// metres; `None` if a pulse states no interval of paths or does not contain the centre.
pub(super) fn recorded_range_m(pulses: &[Pulse], middle: &Pulse, centre_m: DVec3) -> Option<f64> {
    let mut margin_m = f64::INFINITY;
    for pulse in pulses {
        let [shortest_m, longest_m] = pulse.recorded_path_m?;
        let path_m = pulse.path_m(centre_m);
        margin_m = margin_m.min(path_m - shortest_m).min(longest_m - path_m);
    }
    let gradient = path_gradient(middle.transmitter_m, middle.receiver_m, centre_m).truncate();
    positive(2.0 * margin_m / gradient.length())
}

/// Unambiguous extent in the scene plane along the line of sight, metres.
pub(super) fn unambiguous_range_m(pulse: &Pulse, centre_m: DVec3) -> Option<f64> {
    let gradient = path_gradient(pulse.transmitter_m, pulse.receiver_m, centre_m).truncate();
    positive(1.0 / (pulse.step_hz * gradient.length() / SPEED_OF_LIGHT_M_S))
}
