//! Axes of the two-dimensional spectrum and of the image over along-track position and range.

use std::f64::consts::{PI, TAU};

use subaperture_signal::fast_length::fast_length;

use super::bounds::Bounds;
use super::motion::{Compensation, Motion};
use super::taper::{BETA, Taper};
use super::taps::{TAPS, cells};
use crate::straight_track::StraightTrack;
use crate::{FormError, Reason, Remedy};

/// Largest sine of an angle off broadside, including the taper. Beyond it range changes so fast with
/// angle that transform lengths grow without bound.
const LARGEST_SINE: f64 = 0.985;

/// Largest number of along-track wavenumbers; planning with more would take too long.
pub(super) const MAX_BINS: f64 = 2e6;

/// Largest length of a slow-time transform; longer ones would not fit any memory.
const LONGEST: f64 = 1e9;

/// Evenly spaced axis of the image, `first + i step`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ImageAxis {
    /// Value of element 0, metres.
    pub(crate) first_m: f64,
    /// Step, metres; half of the Nyquist step.
    pub(crate) step_m: f64,
    pub(crate) count: usize,
    /// Carrier wavenumber removed from the image, rad/m.
    pub(crate) carrier: f64,
}

impl ImageAxis {
    /// Value of element `i`, metres.
    pub(crate) fn at(&self, i: usize) -> f64 {
        self.first_m + i as f64 * self.step_m
    }
}

/// Axes that the processing stages work on.
#[derive(Clone, Debug)]
pub(crate) struct Axes {
    /// Two-way wavenumber `4 pi f_k / c` of every frequency, rad/m.
    pub(crate) wavenumbers: Vec<f64>,
    /// Smallest and largest closest range of all pixels, metres.
    pub(crate) range_m: [f64; 2],
    /// Smallest and largest along-track offset of a pixel from a pulse, metres.
    pub(super) reach_m: [f64; 2],
    /// Band of directions covered, with tapered ends.
    pub(super) taper: Taper,
    /// Period of slow time, pulses of the line.
    pub(super) period: usize,
    /// Period of slow time along the track, metres.
    pub(super) period_m: f64,
    /// Length of the slow-time transform: the period in pulses, or the cells onto which uneven pulses are gridded.
    pub(super) slow_length: usize,
    /// Step of the along-track wavenumber, rad/m.
    pub(super) along_wavenumber_step: f64,
    /// Index of the first retained along-track wavenumber; the spectrum is periodic with `period`.
    pub(super) first_bin: i64,
    /// Number of retained along-track wavenumbers.
    pub(super) num_bins: usize,
    /// Length of the inverse transform to along-track position.
    pub(super) along_length: usize,
    /// Index of the first image column in that transform, relative to `x = 0`.
    pub(super) first_along: i64,
    /// Image axis along the track.
    pub(super) along: ImageAxis,
    /// Image axis of closest range.
    pub(crate) range: ImageAxis,
}

impl Axes {
    /// Choose axes for pixels within `bounds` and samples of the given wavenumbers.
    ///
    /// # Errors
    /// [`FormError::Unsuited`] if pixels lie too close to the track, or at too large a squint.
    pub(super) fn new(
        motion: &Motion,
        wavenumbers: Vec<f64>,
        bounds: &Bounds,
        range_wavenumber: &dyn Fn(f64, f64) -> f64,
    ) -> Result<Self, FormError> {
        let track = &motion.positions.track;
        let (least, most) = (wavenumbers[0], wavenumbers[wavenumbers.len() - 1]);
        let Bounds { along_m, range_m } = *bounds;
        let [first_m, last_m] = motion.positions.span_m();
        let reach_m = [along_m[0] - last_m, along_m[1] - first_m];
        let taper = directions(reach_m, range_m, least)?;
        let ends = taper.ends;
        let along_low = (least * ends[0]).min(most * ends[0]);
        let along_high = (least * ends[1]).max(most * ends[1]);
        let pulses = pulses_a_period(track, &taper, reach_m, range_m, least);
        let bins = (along_high - along_low) * pulses * track.spacing_m / TAU;
        if !(pulses < LONGEST && bins < MAX_BINS) {
            let why = format!(
                "the transform along the track needs {pulses:.1e} pulses {:.3e} m apart and {bins:.1e} wavenumbers: expected at most \
                 {LONGEST:.0e} and {MAX_BINS:.0e}",
                track.spacing_m
            );
            let remedies = [Remedy::OtherFormer(&["bp"]), Remedy::SmallerGrid];
            return Err(FormError::Unsuited(Reason::new(why).helped_by(&remedies)));
        }
        let period = fast_length((pulses as usize).max(track.num_pulses));
        let period_m = period as f64 * track.spacing_m;
        let along_wavenumber_step = TAU / period_m;
        let first_bin = (along_low / along_wavenumber_step).floor() as i64;
        let last_bin = (along_high / along_wavenumber_step).ceil() as i64;
        let num_bins = (last_bin - first_bin + 1) as usize;
        let slow_length = match motion.compensation {
            Compensation::Point => period,
            Compensation::Places | Compensation::Ranges => cells(num_bins),
        };
        let along_length = cells(num_bins);
        let carrier = (first_bin + num_bins as i64 / 2) as f64 * along_wavenumber_step;
        let (first_along, along) = along_axis(along_m, period_m / along_length as f64, carrier);
        Ok(Self {
            range: range_axis(range_wavenumber, [least, most], ends, range_m)?,
            wavenumbers,
            range_m,
            reach_m,
            taper,
            period,
            period_m,
            slow_length,
            along_wavenumber_step,
            first_bin,
            num_bins,
            along_length,
            first_along,
            along,
        })
    }

    /// Centre of the swath, metres.
    pub(crate) fn reference_range_m(&self) -> f64 {
        (self.range_m[0] + self.range_m[1]) / 2.0
    }

    /// Smallest and largest sine of the directions in which pixels are seen.
    pub(crate) fn needed_sines(&self) -> [f64; 2] {
        self.taper.needed
    }

    /// Along-track wavenumber of retained bin `q`, rad/m.
    pub(super) fn along_wavenumber(&self, q: usize) -> f64 {
        (self.first_bin + q as i64) as f64 * self.along_wavenumber_step
    }
}

/// Band of directions in which pixels are seen; `wavenumber` is the smallest one.
fn directions(reach_m: [f64; 2], range_m: [f64; 2], wavenumber: f64) -> Result<Taper, FormError> {
    let sine = |u_m: f64, r_m: f64| u_m / libm::hypot(r_m, u_m);
    let needed = [
        sine(reach_m[0], range_m[0]).min(sine(reach_m[0], range_m[1])),
        sine(reach_m[1], range_m[0]).max(sine(reach_m[1], range_m[1])),
    ];
    let taper = Taper::new(needed, range_m[0] * wavenumber);
    let steepest = taper.ends[0].abs().max(taper.ends[1].abs());
    match range_m[0] > 0.0 && wavenumber > 0.0 && steepest < LARGEST_SINE {
        true => Ok(taper),
        false => {
            let why = format!(
                "pixels are too near for a frequency-domain former: {:.3} m from the track's line, seen up to {:.0} degrees from \
                 broadside",
                range_m[0],
                libm::asin(needed[0].abs().max(needed[1].abs())).to_degrees()
            );
            let remedies = [Remedy::OtherFormer(&["bp"]), Remedy::FartherGrid];
            Err(FormError::Unsuited(Reason::new(why).helped_by(&remedies)))
        }
    }
}

/// Period of slow time, pulses, that keeps periodic images of the reference off the pixels.
fn pulses_a_period(
    track: &StraightTrack,
    taper: &Taper,
    reach_m: [f64; 2],
    range_m: [f64; 2],
    wavenumber: f64,
) -> f64 {
    let tangent = |s: f64| s / (1.0 - s * s).sqrt();
    let spread_m = 2.0 * BETA / (taper.fall[0].min(taper.fall[1]) * wavenumber);
    let end_m = |s: f64| (range_m[0] * tangent(s), range_m[1] * tangent(s));
    let (low_a, low_b) = end_m(taper.ends[0]);
    let (high_a, high_b) = end_m(taper.ends[1]);
    let (low_m, high_m) = (low_a.min(low_b) - spread_m, high_a.max(high_b) + spread_m);
    let period_m = (reach_m[1] - low_m).max(high_m - reach_m[0]);
    (period_m / track.spacing_m).ceil() + 1.0
}

/// Axis along the track, and the index of its first column relative to `x = 0`.
fn along_axis(along_m: [f64; 2], step_m: f64, carrier: f64) -> (i64, ImageAxis) {
    let margin = TAPS as i64 / 2 + 1;
    let first = (along_m[0] / step_m).floor() as i64 - margin;
    let last = (along_m[1] / step_m).ceil() as i64 + margin;
    let axis = ImageAxis {
        first_m: first as f64 * step_m,
        step_m,
        count: (last - first + 1) as usize,
        carrier,
    };
    (first, axis)
}

/// Axis of closest range, sampled for the range wavenumbers of the method.
fn range_axis(
    range_wavenumber: &dyn Fn(f64, f64) -> f64,
    wavenumbers: [f64; 2],
    ends: [f64; 2],
    range_m: [f64; 2],
) -> Result<ImageAxis, FormError> {
    // Extremes lie at the ends of the band of directions or at broadside.
    let broadside = 0f64.clamp(ends[0], ends[1]);
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for kappa in wavenumbers {
        for sine in [ends[0], ends[1], broadside] {
            let value = range_wavenumber(kappa, kappa * sine);
            if !value.is_finite() {
                let why = "the band is too wide for an expansion about its centre at these angles";
                let remedies = [Remedy::OtherFormer(&["omega-k", "bp"])];
                return Err(FormError::Unsuited(Reason::new(why).helped_by(&remedies)));
            }
            low = low.min(value);
            high = high.max(value);
        }
    }
    // Two per cent for extremes in between, and a minimum width for a single frequency.
    let width = (1.02 * (high - low)).max(1e-4 * high.abs());
    let step_m = PI / width;
    let margin = TAPS as f64 / 2.0 + 1.0;
    let samples = ((range_m[1] - range_m[0]) / step_m).ceil() + 2.0 * margin + 1.0;
    if samples >= LONGEST {
        let why = Reason::new(format!(
            "the grid needs {samples:.1e} range bins, expected at most {LONGEST:.0e}"
        ));
        return Err(FormError::Unsuited(why.helped_by(&[Remedy::SmallerGrid])));
    }
    Ok(ImageAxis {
        first_m: range_m[0] - margin * step_m,
        step_m,
        count: samples as usize,
        carrier: (low + high) / 2.0,
    })
}
