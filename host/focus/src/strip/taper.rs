//! The band of directions that a reference function covers, with smooth ends.
//!
//! A reference `exp(j kappa sqrt(r^2 + u^2))` without ends has a smooth spectrum, and every direction
//! `sin(theta) = kx / kappa` of that spectrum stands for one place `u = r tan(theta)`. A band of
//! directions that is cut sharply would ring all over `u`; one that falls off as the integral of a Kaiser
//! window rings about the end only. The natural unit of `kx` there is `sqrt(kappa cos^3(theta) / r)`: a direction's
//! neighbours within it are in phase. In that unit the fall begins [`GAP`] beyond the directions that are needed and is `2`
//! [`HALF_FALL`] wide. What it leaves at a place that is seen at the very end of the needed directions, and what it takes:
//!
//! | `beta` | gap | half of the fall | together | left, dB |
//! |---|---|---|---|---|
//! | 12 | 0 | 3.46 | 6.9 | -42 |
//! | 12 | 0 | 4.9 | 9.8 | -58 |
//! | 8 | 3 | 2 | 7 | -58 |
//! | 10 | 3 | 2.5 | 8 | -69 |
//! | 10 | 4 | 2.25 | 8.5 | -77 |
//! | 14 | 3 | 3 | 9 | -81 |
//!
//! (`|integral of (T - 1) exp(j k^2 / 2)| / sqrt(2 pi)` over that end, by quadrature.)

use super::fall::Fall;

/// Shape of the Kaiser window.
pub(super) const BETA: f64 = 10.0;
/// From the directions needed to the fall, in units of `sqrt(kappa cos^3(theta) / r)`.
const GAP: f64 = 4.0;
/// Half of the fall, in the same.
const HALF_FALL: f64 = 2.25;

/// 1 over a band of directions, falling to 0 outside of it.
#[derive(Clone, Debug)]
pub(super) struct Taper {
    /// Sines of the directions needed, least and most.
    pub(super) needed: [f64; 2],
    /// Sines of the first and last direction that is not zero.
    pub(super) ends: [f64; 2],
    /// Widths of the falls at either end.
    pub(super) fall: [f64; 2],
    /// The shape of both falls.
    shape: Fall,
}

impl Taper {
    /// 1 over `needed`, for the nearest range and smallest wavenumber with product `range_waves`.
    pub(super) fn new(needed: [f64; 2], range_waves: f64) -> Self {
        let unit = needed.map(|sine| {
            let cosine = (1.0 - sine * sine).max(0.0).sqrt();
            (cosine.powi(3) / range_waves).sqrt()
        });
        let fall = unit.map(|unit| 2.0 * HALF_FALL * unit);
        let beyond = |i: usize| GAP * unit[i] + fall[i];
        Self {
            needed,
            ends: [needed[0] - beyond(0), needed[1] + beyond(1)],
            fall,
            shape: Fall::new(BETA),
        }
    }

    /// The weight of the direction `sine`.
    pub(super) fn at(&self, sine: f64) -> f64 {
        let [first, last] = self.ends;
        let rise = |from: f64, width: f64| self.shape.at(from / width);
        rise(sine - first, self.fall[0]) * rise(last - sine, self.fall[1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_one_where_needed_and_falls_evenly() {
        let taper = Taper::new([-0.2, 0.3], 2000.0);
        for sine in [-0.2, 0.0, 0.11, 0.3] {
            assert_eq!(taper.at(sine), 1.0);
        }
        let [first, last] = taper.ends;
        assert_eq!((taper.at(first), taper.at(last)), (0.0, 0.0));
        // The integral of an even window is a half in its middle.
        assert!((taper.at(last - taper.fall[1] / 2.0) - 0.5).abs() < 1e-12);
        // 4.5 and 8.5 sqrt((1 - 0.04)^1.5 / 2000).
        assert!((taper.fall[0] - 0.097_59).abs() < 1e-5);
        assert!((-0.2 - first - 0.184_34).abs() < 1e-5);
    }
}
