//! Range intervals of the pulses used for motion compensation, and their sampling.
//!
//! From pulse `n` pixels lie between the ranges `low_n` and `high_n`. The profile is unchanged there, tapers to zero over a length `F` on
//! either side, and is then periodic:
//!
//! ```text
//! period = max_n (high_n - low_n) + 2 F,   kappa'_m = kappa_c + (m - M / 2) 2 pi / period
//! ```
//!
//! `M` evenly spaced wavenumbers represent it. A tone `exp(j kappa (rho + d(rho)))` under that window occupies the spectrum at
//! `kappa (1 + d'(rho))`, widened on both sides by the tapers, `2 beta / F` ([`super::super::fall`]). The wavenumbers therefore extend beyond the
//! recorded band by
//!
//! ```text
//! guard = kappa_max max |d'| + 2 beta / F
//! ```
//!
//! at either end. Without the guard, the band edges would be cut where the profile is stretched. `F = sqrt(2 beta length / band)` minimises the
//! number of wavenumbers, `period (band + 2 guard) / 2 pi`. `F` is limited to half of the retained interval, or some wavelengths, since pixels do not
//! constrain the polynomials there. The number is often smaller than the recorded one, because ranges without pixels are omitted.
//!
//! For widely different directions a polynomial of high degree may be steep beyond the pixels and the guard wide. A lower
//! degree is then used.

use std::f64::consts::TAU;

use rayon::prelude::*;

use super::Bounds;
use super::deviations::{Deviation, Interval, fitted};
use super::positions::Positions;
use crate::frequency_domain::fall::Fall;
use crate::{FormError, Reason, Remedy};
use subaperture_model::geometry::ImageGrid;
use subaperture_model::phase_history::Collection;
use subaperture_signal::fast_length::fast_length;

/// Kaiser shape parameter of the tapers at the ends of a profile.
const BETA: f64 = 14.0;
/// Longest taper as a fraction of the nearest range; functions of `1 / rho` stay smooth over it.
const LONGEST_FALL: f64 = 0.25;
/// Spectral width of the shortest taper as a fraction of the wavenumber, on either side.
const WIDEST_GUARD: f64 = 0.2;
/// Largest spectral spread of a deviation, relative to the band and the tapers, for which its degree is kept if a lower degree has less.
const STEEP: f64 = 0.5;
/// Number of positions at which the slope of a deviation is sampled.
const SLOPES: usize = 64;
/// Margin factor for slopes between the samples.
const SLOPE_MARGIN: f64 = 1.2;
/// Upper limit on the number of wavenumbers; more would not fit any memory.
const MOST: f64 = 1e7;

/// Bytes stored per pulse.
pub(super) const PULSE_BYTES: usize = size_of::<Deviation>();

/// Sampling of the profiles of all pulses.
pub(in crate::frequency_domain) struct Profiles {
    deviations: Vec<Deviation>,
    /// Window: 1 at ranges of pixels, tapering to 0 at both ends, for each of `M` positions.
    pub(super) window: Vec<f32>,
    /// Spacing of the positions, metres.
    pub(super) step_m: f64,
    /// Wavenumber `M / 2`, rad/m.
    pub(super) centre: f64,
    /// Spacing of the wavenumbers, rad/m.
    pub(super) wavenumber_step: f64,
}

impl Profiles {
    /// Choose the sampling for the arguments of [`Motion::new`](super::Motion::new).
    pub(super) fn new(
        collection: &Collection,
        grid: &ImageGrid,
        positions: &Positions,
        bounds: &Bounds,
        wavenumbers: &[f64],
    ) -> Result<Self, FormError> {
        let ranges: Vec<[f64; 2]> = (0..collection.pulses.len())
            .map(|n| ranges_m(bounds, positions.along_m(n)))
            .collect();
        let length_m = ranges
            .iter()
            .map(|[low, high]| high - low)
            .fold(0.0, f64::max);
        let middle_m = |[low, high]: &[f64; 2]| (low + high) / 2.0;
        let nearest_m = ranges.iter().map(middle_m).fold(f64::INFINITY, f64::min) - length_m / 2.0;
        let count = wavenumbers.len();
        let (first, last) = (wavenumbers[0], wavenumbers[count - 1]);
        let band = last - first;
        let centre = wavenumbers[count / 2];
        let fall_m = (2.0 * BETA * length_m / band)
            .sqrt()
            .min(length_m / 2.0)
            .max(2.0 * BETA / (WIDEST_GUARD * centre))
            .min(LONGEST_FALL * nearest_m);
        let half_m = length_m / 2.0 + fall_m;
        if !(fall_m > 0.0 && half_m.is_finite()) {
            return Err(unsuited("an antenna passes too near the pixels"));
        }
        let intervals: Vec<Interval> = ranges
            .iter()
            .map(|range| Interval::new(middle_m(range), half_m))
            .collect();
        let of_falls = 2.0 * BETA / fall_m;
        let of_degree = |degree| -> Result<(Vec<Deviation>, f64), FormError> {
            let deviations =
                fitted(collection, grid, positions, &intervals, degree).ok_or_else(|| {
                    unsuited(
                        "the deviation of the track from its line exceeds the range of float64",
                    )
                })?;
            let steepest = deviations.par_iter().map(steepest).reduce(|| 0.0, f64::max);
            Ok((deviations, SLOPE_MARGIN * last * steepest))
        };
        let mut degree = intervals.iter().map(Interval::degree).max().unwrap_or(1);
        let (mut deviations, mut of_deviations) = of_degree(degree)?;
        while degree > 1 && of_deviations > STEEP * (band + 2.0 * of_falls) {
            degree -= 1;
            (deviations, of_deviations) = of_degree(degree)?;
        }
        let guard = of_deviations + of_falls;
        let wavenumber_step = TAU / (2.0 * half_m);
        let reach = (centre - first).max(last - centre) + guard;
        let each_side = (reach / wavenumber_step).ceil() + 1.0;
        if each_side.is_nan() || each_side > MOST {
            return Err(unsuited("the track deviates too far from its line"));
        }
        let size = fast_length(2 * each_side as usize);
        if centre - (size / 2) as f64 * wavenumber_step <= 0.0 {
            return Err(unsuited(
                "the track's deviation from its line varies with range as fast as the phase",
            ));
        }
        let step_m = 2.0 * half_m / size as f64;
        let fall = Fall::new(BETA);
        let window = |i: usize| {
            let from_middle_m = (i as f64 - (size / 2) as f64).abs() * step_m;
            fall.at((half_m - from_middle_m) / fall_m) as f32
        };
        Ok(Self {
            deviations,
            window: (0..size).map(window).collect(),
            step_m,
            centre,
            wavenumber_step,
        })
    }

    /// Two-way wavenumbers of the profiles, rad/m.
    pub(in crate::frequency_domain) fn wavenumbers(&self) -> Vec<f64> {
        let half = self.window.len() / 2;
        let at = |m: usize| self.centre + (m as f64 - half as f64) * self.wavenumber_step;
        (0..self.window.len()).map(at).collect()
    }

    /// Deviation `d_n` at a range from the line, metres.
    #[inline]
    pub(super) fn deviation_m(&self, n: usize, range_m: f64) -> f64 {
        self.deviations[n].at(range_m)
    }

    /// Centre of the range interval of pulse `n`, metres.
    pub(super) fn middle_m(&self, n: usize) -> f64 {
        self.deviations[n].interval.middle_m
    }
}

/// Nearest and farthest range from an along-track position to pixels within bounds, metres.
fn ranges_m(bounds: &Bounds, along_m: f64) -> [f64; 2] {
    let [before_m, behind_m] = bounds.along_m.map(|x| x - along_m);
    let nearest_m = 0f64.clamp(before_m, behind_m);
    let farthest_m = before_m.abs().max(behind_m.abs());
    let [near_m, far_m] = bounds.range_m;
    [
        libm::hypot(near_m, nearest_m),
        libm::hypot(far_m, farthest_m),
    ]
}

/// Largest slope of a deviation on its interval, metres per metre.
fn steepest(deviation: &Deviation) -> f64 {
    let Interval {
        middle_m, half_m, ..
    } = deviation.interval;
    let step_m = 2.0 * half_m / SLOPES as f64;
    let at = |i: usize| deviation.at(middle_m - half_m + i as f64 * step_m);
    let slopes = (0..SLOPES).map(|i| (at(i + 1) - at(i)).abs() / step_m);
    slopes.fold(0.0, f64::max)
}

fn unsuited(why: &str) -> FormError {
    let why = Reason::new(format!(
        "range-dependent motion compensation is not possible: {why}"
    ));
    FormError::Unsuited(why.helped_by(&[Remedy::OtherFormer(&["bp", "ffbp"])]))
}
