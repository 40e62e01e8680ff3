//! Patch of the grid seen from a sub-aperture: spectral support of its pulses, and pixel positions in the linear path model.

use glam::{DMat2, DVec2, DVec3};

use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::phase_history::Pulse;

/// Number of pulses to which a pixel position is fitted.
pub(super) const FIT_PULSES: usize = 16;
/// Points per side at which the grid's image is sampled: a circle exceeds a chord of a 32nd of it by
/// half a per cent of the radius.
const PROBE_POINTS: usize = 33;
/// Margin around the sampled positions, as a fraction of their extent.
const MARGIN: f64 = 0.02;
/// Smallest half extent, metres, for a grid of a single pixel.
const MIN_HALF_M: f64 = 1e-3;

/// Rectangle by centre and half extents.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent {
    /// Position of the centre, metres.
    pub(super) centre_m: DVec2,
    /// Half of each side, metres.
    pub(super) half_m: DVec2,
}

/// Rectangle of spatial frequency, cycles per metre.
#[derive(Clone, Copy, Debug)]
pub(super) struct Band {
    /// Lowest spatial frequency per axis.
    pub(super) low: DVec2,
    /// Highest spatial frequency per axis.
    pub(super) high: DVec2,
}

/// Coordinates in the grid plane, along and across the mean line of sight of some pulses, and the position fit.
pub(super) struct Plane<'a> {
    pub(super) centre_m: DVec3,
    pulses: &'a [Pulse],
    along: DVec3,
    across: DVec3,
    fit: Vec<FitPulse<'a>>,
    /// Pseudo-inverse of the sum of `g g^T`.
    inverse: DMat2,
}

/// Pulse used by the position fit.
struct FitPulse<'a> {
    pulse: &'a Pulse,
    gradient: DVec2,
    centre_path_m: f64,
}

impl<'a> Plane<'a> {
    /// Plane of `grid` for `pulses`, with paths linear about `centre_m`, by default the grid's centre.
    pub(super) fn new(pulses: &'a [Pulse], grid: &ImageGrid, centre_m: Option<DVec3>) -> Self {
        let centre_m = centre_m.unwrap_or_else(|| middle(grid));
        let normal = grid.x_axis.cross(grid.y_axis);
        let mean: DVec3 = pulses
            .iter()
            .map(|pulse| path_gradient(pulse, centre_m))
            .sum();
        // A full circle has no mean direction; any direction is valid.
        let along = (mean - normal * mean.dot(normal))
            .try_normalize()
            .unwrap_or(grid.x_axis);
        let mut plane = Self {
            centre_m,
            pulses,
            along,
            across: normal.cross(along),
            fit: Vec::new(),
            inverse: DMat2::ZERO,
        };
        plane.fit = plane.some_pulses(FIT_PULSES);
        let mut sum = DMat2::ZERO;
        for p in &plane.fit {
            let g = p.gradient;
            sum += DMat2::from_cols(g * g.x, g * g.y);
        }
        plane.inverse = pseudo_inverse(sum);
        plane
    }

    /// At most `count` pulses, each at the centre of its share of the aperture.
    fn some_pulses(&self, count: usize) -> Vec<FitPulse<'a>> {
        let pulses = self.pulses;
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

    /// Path gradient `u_t + u_r` in the plane.
    pub(super) fn gradient(&self, pulse: &Pulse) -> DVec2 {
        self.flat(path_gradient(pulse, self.centre_m))
    }

    fn flat(&self, v: DVec3) -> DVec2 {
        DVec2::new(v.dot(self.along), v.dot(self.across))
    }

    /// Position at which the linear paths fit those to `point` best, metres from the centre.
    pub(super) fn place(&self, point: DVec3) -> DVec2 {
        let flat = self.flat(point - self.centre_m);
        let mut sum = DVec2::ZERO;
        for p in &self.fit {
            let path_m = p.pulse.path_m(point) - p.centre_path_m;
            sum += p.gradient * (path_m - p.gradient.dot(flat));
        }
        flat + self.inverse * sum
    }

    /// Extent of the spatial frequencies of all samples.
    pub(super) fn spectrum(&self, num_samples: usize) -> Band {
        let mut band = Band {
            low: DVec2::INFINITY,
            high: DVec2::NEG_INFINITY,
        };
        for pulse in self.pulses {
            let cycles = self.gradient(pulse) / SPEED_OF_LIGHT_M_S;
            for k in [0, num_samples.saturating_sub(1)] {
                let place = cycles * pulse.frequency_hz(k);
                band.low = band.low.min(place);
                band.high = band.high.max(place);
            }
        }
        band
    }

    /// Extent of the pixel positions.
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
            half_m: half_m.max(DVec2::splat(MIN_HALF_M)),
        }
    }
}

fn path_gradient(pulse: &Pulse, point: DVec3) -> DVec3 {
    (point - pulse.transmitter_m).normalize_or_zero()
        + (point - pulse.receiver_m).normalize_or_zero()
}

/// Plane point at the grid centre, or the pole of a polar grid with a large angular extent.
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

/// Grid of `side * side` points from first to last row and column.
fn probe_points(grid: &ImageGrid, side: usize) -> impl Iterator<Item = DVec3> {
    let at = move |axis: &subaperture_model::geometry::Axis, i: usize| {
        let fraction = i as f64 / (side - 1) as f64;
        axis.start + fraction * (axis.count - 1) as f64 * axis.step
    };
    (0..side * side)
        .map(move |i| grid.point_m(at(&grid.rows, i / side), at(&grid.columns, i % side)))
}

/// Pseudo-inverse of a positive semidefinite matrix. A direction that the aperture does not resolve
/// (one pulse, or pulses from one position) is excluded.
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
    // Below an aperture of a microradian, rounding dominates.
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
