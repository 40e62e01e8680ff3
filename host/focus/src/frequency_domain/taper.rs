//! Band of directions covered by a reference function, with smooth ends.
//!
//! An unlimited reference `exp(j kappa sqrt(r^2 + u^2))` has a smooth spectrum, and every direction
//! `sin(theta) = kx / kappa` of that spectrum corresponds to one position `u = r tan(theta)`. A sharply truncated band of
//! directions would ring over all `u`; a taper that is the integral of a Kaiser
//! window rings near the end only. The natural unit of `kx` there is `sqrt(kappa cos^3(theta) / r)`: neighbouring
//! directions within it are in phase. In that unit the taper begins [`GAP`] beyond the needed directions and is `2`
//! [`HALF_FALL`] wide. The table gives the error at a position seen at the very end of the needed directions, and the width required:
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

/// Shape parameter of the Kaiser window.
pub(super) const BETA: f64 = 10.0;
/// Distance from the needed directions to the taper, in units of `sqrt(kappa cos^3(theta) / r)`.
const GAP: f64 = 4.0;
/// Half-width of the taper, in the same unit.
const HALF_FALL: f64 = 2.25;

/// Weight of 1 over a band of directions with a taper to 0 on either side.
#[derive(Clone, Debug)]
pub(super) struct Taper {
    /// Smallest and largest sine of the needed directions.
    pub(super) needed: [f64; 2],
    /// Sines of the first and last direction with nonzero weight.
    pub(super) ends: [f64; 2],
    /// Widths of the tapers at both ends, in sine.
    pub(super) fall: [f64; 2],
    /// Shape of both tapers.
    shape: Fall,
}

impl Taper {
    /// Make a weight of 1 over `needed`, for the nearest range and smallest wavenumber with product `range_waves`.
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

    /// Weight of the direction `sine`.
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
    fn taper_is_one_over_needed_directions_and_symmetric() {
        let taper = Taper::new([-0.2, 0.3], 2000.0);
        for sine in [-0.2, 0.0, 0.11, 0.3] {
            assert_eq!(taper.at(sine), 1.0);
        }
        let [first, last] = taper.ends;
        assert_eq!((taper.at(first), taper.at(last)), (0.0, 0.0));
        // The integral of an even window is one half at its centre.
        assert!((taper.at(last - taper.fall[1] / 2.0) - 0.5).abs() < 1e-12);
        // 4.5 and 8.5 sqrt((1 - 0.04)^1.5 / 2000).
        assert!((taper.fall[0] - 0.097_59).abs() < 1e-5);
        assert!((-0.2 - first - 0.184_34).abs() < 1e-5);
    }
}
