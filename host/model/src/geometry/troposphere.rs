//! Tropospheric delay as an extra path length, metres in vacuum.
//!
//! Exponential profile: refractivity `N(h) = N0 exp(-h / H)` at height `h` above the ellipsoid, with `N0` in parts
//! per million (about 313 at sea level on average) and `H = 7.35 km`. The one-way extra path is
//!
//! ```text
//! 1e-6 integral of N(h(s)) ds      along the straight line from the one to the other
//! ```
//!
//! At the zenith it is 2.3 m; at other elevations, as long as the Earth's curvature is negligible, that divided by
//! the sine of the elevation. Neglected: bending, which lengthens the path by less than 1e-3 of that above 10 degrees
//! of elevation; weather, which changes `N0` by 10 or 20 % and its wet part by more; the ionosphere.

use std::fmt;
use std::str::FromStr;

use glam::DVec3;

use super::{Geodetic, SceneFrame};

/// Scale height of refractivity, metres.
const SCALE_HEIGHT_M: f64 = 7350.0;

/// Upper limit of the integral above the lower end, scale heights; the neglected part is 1e-8 of the rest.
const HIGHEST: f64 = 18.0;

/// Panels of the integral, each by four-point Gauss-Legendre quadrature over about one scale height, with a remainder
/// below 1e-9.
const PANELS: usize = 18;

/// Nodes from -1 to 1, and weights.
const NODES: [[f64; 2]; 4] = [
    [-0.861_136_311_594_052_6, 0.347_854_845_137_453_85],
    [-0.339_981_043_584_856_26, 0.652_145_154_862_546_1],
    [0.339_981_043_584_856_26, 0.652_145_154_862_546_1],
    [0.861_136_311_594_052_6, 0.347_854_845_137_453_85],
];

/// Bisection steps to find where a line leaves the air, to 1e-12 of its length.
const HALVINGS: usize = 40;

/// Exponential profile of refractivity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Troposphere {
    /// Refractivity at height 0, parts per million.
    pub refractivity: f64,
}

impl Troposphere {
    /// Mean refractivity at sea level, parts per million.
    pub const MEAN_REFRACTIVITY: f64 = 313.0;

    /// One-way extra path between two points of a scene, metres; `None` in a local frame, which has no heights above the ellipsoid.
    pub fn extra_path_m(&self, frame: &SceneFrame, one_m: DVec3, other_m: DVec3) -> Option<f64> {
        let heights = [one_m, other_m].map(|p| frame.geodetic(p).map(|place| place.height_m));
        let [one, other] = [heights[0]?, heights[1]?];
        let (low, high, low_height_m, high_height_m) = match one <= other {
            true => (one_m, other_m, one, other),
            false => (other_m, one_m, other, one),
        };
        let length_m = low.distance(high);
        let direction = (high - low).normalize_or_zero();
        let height_m = |s: f64| {
            let place = Geodetic::from_ecf_m(frame.to_ecf_m(low + direction * s));
            place.height_m
        };
        let highest_m = low_height_m + HIGHEST * SCALE_HEIGHT_M;
        let mut end_m = length_m;
        if high_height_m > highest_m {
            let (mut below, mut above) = (0.0, length_m);
            for _ in 0..HALVINGS {
                let middle = 0.5 * (below + above);
                match height_m(middle) > highest_m {
                    true => above = middle,
                    false => below = middle,
                }
            }
            end_m = above;
        }
        let half = 0.5 * end_m / PANELS as f64;
        let mut sum = 0.0;
        for panel in 0..PANELS {
            let middle = (2 * panel + 1) as f64 * half;
            for [node, weight] in NODES {
                sum += weight * libm::exp(-height_m(middle + half * node) / SCALE_HEIGHT_M);
            }
        }
        Some(1e-6 * self.refractivity * sum * half)
    }
}

impl fmt::Display for Troposphere {
    /// Text that [`FromStr`] reads.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "exponential:{}", self.refractivity)
    }
}

impl FromStr for Troposphere {
    type Err = String;

    /// Read `exponential` (mean refractivity) or `exponential:N`.
    fn from_str(text: &str) -> Result<Self, String> {
        let refractivity = match text.split_once(':') {
            None if text == "exponential" => Some(Self::MEAN_REFRACTIVITY),
            Some(("exponential", number)) => number.parse().ok(),
            _ => None,
        };
        match refractivity.filter(|n| (0.0..=1000.0).contains(n)) {
            Some(refractivity) => Ok(Self { refractivity }),
            None => Err("give none, exponential, or exponential:N with 0 to 1000 parts in a million at sea level (as exponential:313)".to_owned()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reference: in the equatorial plane heights are distances from the centre minus the semi-major axis, so the
    /// integral is a fine sum along the line.
    #[test]
    fn extra_paths_equal_numerical_integral() {
        let radius_m = 6_378_137.0;
        let at = |angle: f64, height_m: f64| {
            let r = radius_m + height_m;
            DVec3::new(r * angle.cos(), r * angle.sin(), 0.0)
        };
        // Frame with the Earth's own axes.
        let frame = SceneFrame::Earth {
            origin_ecf_m: DVec3::ZERO,
            x_axis_ecf: DVec3::X,
            y_axis_ecf: DVec3::Y,
        };
        let air = Troposphere {
            refractivity: 300.0,
        };
        for (from, to) in [
            (at(0.0, 0.0), at(0.0, 600e3)),
            (at(0.0, 250.0), at(0.08, 600e3)),
            (at(0.0, 1200.0), at(0.002, 4000.0)),
            (at(0.0, 0.0), at(0.004, 12e3)),
        ] {
            let count = 200_000;
            let step = (to - from) / f64::from(count);
            let mut sum = 0.0;
            for i in 0..count {
                let height = (from + step * (f64::from(i) + 0.5)).length() - radius_m;
                sum += (-height / 7350.0).exp() * step.length();
            }
            let expected = 300e-6 * sum;
            for [a, b] in [[from, to], [to, from]] {
                let got = air.extra_path_m(&frame, a, b).unwrap();
                // Error of the midpoint rule: (3 m / 7.35 km)^2 / 24; of the truncated tail: 2e-8.
                assert!((got / expected - 1.0).abs() < 1e-7, "{got} {expected}");
            }
        }
        // At the zenith: N H, minus the part above 600 km.
        let zenith = air
            .extra_path_m(&frame, at(0.3, 0.0), at(0.3, 600e3))
            .unwrap();
        assert!((zenith - 300e-6 * 7350.0).abs() < 1e-6, "{zenith}");
        assert_eq!(
            air.extra_path_m(&SceneFrame::Local, DVec3::ZERO, DVec3::Z),
            None
        );
    }
}
