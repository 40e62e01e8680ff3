//! The grid's plane: spectral support of the collection in it, and where the linear model has a pixel.

use std::f64::consts::TAU;

use glam::{DMat2, DVec2, DVec3};
use rayon::prelude::*;

use crate::probes::{Shares, probes, turned};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::phase_history::{Collection, Pulse, Weights};

/// Pulses over which a pixel's place is fitted.
pub(super) const FIT_PULSES: usize = 16;
/// Paths over which residuals are predicted, at most.
const PROBED_PATHS: usize = 8_000_000;
/// Points a side at which the grid's image is looked at: a circle bulges from a chord of a 32nd of it by
/// half a percent of the radius.
const PROBE_POINTS: usize = 33;
/// Margin about the places so found, as a fraction of their extent.
const MARGIN: f64 = 0.02;
/// Least half extent, metres: a grid may be a single pixel.
const LEAST_HALF_M: f64 = 1e-3;

/// A rectangle: middle and half extents.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent {
    /// Middle, metres.
    pub(super) centre_m: DVec2,
    /// Half of its sides, metres.
    pub(super) half_m: DVec2,
}

/// A rectangle of spatial frequency, cycles a metre.
#[derive(Clone, Copy, Debug)]
pub(super) struct Band {
    /// Least.
    pub(super) low: DVec2,
    /// Greatest.
    pub(super) high: DVec2,
}

/// Coordinates in the grid's plane, along and across the mean line of sight, and the fit of places.
pub(super) struct Plane<'a> {
    pub(super) centre_m: DVec3,
    along: DVec3,
    across: DVec3,
    fit: Vec<FitPulse<'a>>,
    /// Pseudo-inverse of the sum of `g g^T`.
    inverse: DMat2,
}

/// A pulse that the fit uses.
struct FitPulse<'a> {
    pulse: &'a Pulse,
    gradient: DVec2,
    centre_path_m: f64,
}

impl<'a> Plane<'a> {
    pub(super) fn new(
        collection: &'a Collection,
        grid: &ImageGrid,
        centre_m: Option<DVec3>,
    ) -> Self {
        let centre_m = centre_m.unwrap_or_else(|| middle(grid));
        let normal = grid.x_axis.cross(grid.y_axis);
        let mean: DVec3 = collection
            .pulses
            .iter()
            .map(|pulse| path_gradient(pulse, centre_m))
            .sum();
        // A full circle has no mean direction: any will do.
        let along = (mean - normal * mean.dot(normal))
            .try_normalize()
            .unwrap_or(grid.x_axis);
        let mut plane = Self {
            centre_m,
            along,
            across: normal.cross(along),
            fit: Vec::new(),
            inverse: DMat2::ZERO,
        };
        plane.fit = plane.some_pulses(collection, FIT_PULSES);
        let mut sum = DMat2::ZERO;
        for p in &plane.fit {
            let g = p.gradient;
            sum += DMat2::from_cols(g * g.x, g * g.y);
        }
        plane.inverse = pseudo_inverse(sum);
        plane
    }

    /// At most `count` pulses, each in the middle of its share of the aperture.
    fn some_pulses(&self, collection: &'a Collection, count: usize) -> Vec<FitPulse<'a>> {
        let pulses = &collection.pulses;
        let count = count.min(pulses.len());
        (0..count)
            .map(|i| {
                let pulse = &pulses[(2 * i + 1) * pulses.len() / (2 * count)];
                FitPulse {
                    pulse,
                    gradient: self.gradient(pulse),
                    centre_path_m: pulse.path_m(self.centre_m),
                }
            })
            .collect()
    }

    /// `u_t + u_r` in the plane: how the path grows with the place.
    pub(super) fn gradient(&self, pulse: &Pulse) -> DVec2 {
        self.flat(path_gradient(pulse, self.centre_m))
    }

    fn flat(&self, v: DVec3) -> DVec2 {
        DVec2::new(v.dot(self.along), v.dot(self.across))
    }

    /// The place at which the linear paths fit those to `point` best, metres from the centre.
    pub(super) fn place(&self, point: DVec3) -> DVec2 {
        let flat = self.flat(point - self.centre_m);
        let mut sum = DVec2::ZERO;
        for p in &self.fit {
            let path_m = p.pulse.path_m(point) - p.centre_path_m;
            sum += p.gradient * (path_m - p.gradient.dot(flat));
        }
        flat + self.inverse * sum
    }

    /// Spatial frequencies of all samples.
    pub(super) fn spectrum(&self, collection: &Collection) -> Band {
        let mut band = Band {
            low: DVec2::INFINITY,
            high: DVec2::NEG_INFINITY,
        };
        for pulse in &collection.pulses {
            let cycles = self.gradient(pulse) / SPEED_OF_LIGHT_M_S;
            for k in [0, collection.num_samples.saturating_sub(1)] {
                let place = cycles * pulse.frequency_hz(k);
                band.low = band.low.min(place);
                band.high = band.high.max(place);
            }
        }
        band
    }

    /// Where the pixels' places lie.
    pub(super) fn image_extent(&self, grid: &ImageGrid) -> Extent {
        let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        for point in probe_points(grid, PROBE_POINTS) {
            let place = self.place(point);
            low = low.min(place);
            high = high.max(place);
        }
        let half_m = (high - low) / 2.0 * (1.0 + 2.0 * MARGIN);
        Extent {
            centre_m: (low + high) / 2.0,
            half_m: half_m.max(DVec2::splat(LEAST_HALF_M)),
        }
    }

    /// The relative RMS error to expect of the worst pixel: what turns the terms of its sum by the phase that
    /// linear paths leave.
    pub(super) fn residual(
        &self,
        collection: &Collection,
        weights: &Weights,
        grid: &ImageGrid,
    ) -> f64 {
        let points = probes(grid);
        let count = collection.pulses.len();
        let most = (PROBED_PATHS / points.len()).max(1);
        // Evenly, but by a golden ratio off the beat of what repeats.
        let chosen: Vec<usize> = if count <= most {
            (0..count).collect()
        } else {
            let place = |i: usize| {
                let beside = (i as f64 * 0.618_033_988_749_895).fract();
                ((i as f64 + beside) * count as f64 / most as f64) as usize
            };
            (0..most).map(place).collect()
        };
        let slow: Vec<f64> = chosen.iter().map(|&n| weights.slow[n]).collect();
        let (slow, fast) = (Shares::new(&slow), Shares::new(&weights.fast));
        let known: Vec<(&Pulse, DVec2, f64, f64)> = chosen
            .iter()
            .map(|&n| {
                let pulse = &collection.pulses[n];
                let squares = (0..collection.num_samples).map(|k| pulse.frequency_hz(k).powi(2));
                let rms_hz = fast.worst(squares).sqrt();
                let centre_path_m = pulse.path_m(self.centre_m);
                (pulse, self.gradient(pulse), centre_path_m, rms_hz)
            })
            .collect();
        let worst = points.par_iter().map(|&point| {
            let place = self.place(point);
            slow.worst(
                known
                    .iter()
                    .map(|(pulse, gradient, centre_path_m, rms_hz)| {
                        let left_m = pulse.path_m(point) - centre_path_m - gradient.dot(place);
                        turned(TAU * rms_hz * left_m / SPEED_OF_LIGHT_M_S)
                    }),
            )
        });
        worst.reduce(|| 0.0, f64::max).sqrt()
    }
}

fn path_gradient(pulse: &Pulse, point: DVec3) -> DVec3 {
    (point - pulse.transmitter_m).normalize_or_zero()
        + (point - pulse.receiver_m).normalize_or_zero()
}

/// The point of the plane in the middle of the grid; the pole of a polar one that goes far around it.
fn middle(grid: &ImageGrid) -> DVec3 {
    let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for point in probe_points(grid, PROBE_POINTS) {
        let offset = point - grid.origin_m;
        let place = DVec2::new(offset.dot(grid.x_axis), offset.dot(grid.y_axis));
        low = low.min(place);
        high = high.max(place);
    }
    let middle = (low + high) / 2.0;
    grid.origin_m + grid.x_axis * middle.x + grid.y_axis * middle.y
}

/// `side * side` points from the grid's first row and column to its last.
fn probe_points(grid: &ImageGrid, side: usize) -> impl Iterator<Item = DVec3> {
    let at = move |axis: &subaperture_model::geometry::Axis, i: usize| {
        let fraction = i as f64 / (side - 1) as f64;
        axis.start + fraction * (axis.count - 1) as f64 * axis.step
    };
    (0..side * side)
        .map(move |i| grid.point_m(at(&grid.rows, i / side), at(&grid.columns, i % side)))
}

/// Of a symmetric matrix without negative eigenvalues. A direction of which the aperture tells nothing
/// (one pulse, or pulses from one place) is left alone.
fn pseudo_inverse(m: DMat2) -> DMat2 {
    let (a, b, d) = (m.x_axis.x, m.x_axis.y, m.y_axis.y);
    let (mean, difference) = ((a + d) / 2.0, (a - d) / 2.0);
    let root = libm::hypot(difference, b);
    let (large, small) = (mean + root, mean - root);
    if large <= 0.0 {
        return DMat2::ZERO;
    }
    let angle = libm::atan2(b, difference) / 2.0;
    let (sin, cos) = libm::sincos(angle);
    let (u, v) = (DVec2::new(cos, sin), DVec2::new(-sin, cos));
    let outer = |v: DVec2| DMat2::from_cols(v * v.x, v * v.y);
    let mut inverse = outer(u) * (1.0 / large);
    // Below an aperture of a microradian, rounding is all there is.
    if small > 1e-12 * large {
        inverse += outer(v) * (1.0 / small);
    }
    inverse
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inverses_of_full_and_of_deficient_matrices() {
        let m = DMat2::from_cols(DVec2::new(3.0, 1.0), DVec2::new(1.0, 2.0));
        assert!((pseudo_inverse(m) * m).abs_diff_eq(DMat2::IDENTITY, 1e-12));
        let v = DVec2::new(0.6, 0.8);
        let projection = DMat2::from_cols(v * v.x, v * v.y);
        assert!(pseudo_inverse(projection * 4.0).abs_diff_eq(projection * 0.25, 1e-12));
        assert_eq!(pseudo_inverse(DMat2::ZERO), DMat2::ZERO);
    }
}
