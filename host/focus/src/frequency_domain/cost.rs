//! Cost of a frequency-domain former with arrays of [`Sizes`]: `K` transforms over slow time, one inverse along-track transform
//! per range bin, 40 operations per pixel, and the cost of its method ([`RangeMethod::operations`]). All steps except the pixels are
//! done once and shared by all tiles. Accuracy about 25 %: filters and weights are omitted.
//!
//! Pulses at uneven positions are gridded, 4 operations per tap, before a shorter transform. Range-dependent motion compensation of a profile takes transforms of
//! twice its `K` samples and of the `M` wavenumbers that replace them, and for each of these a polynomial, taps and a phasor.

use super::motion::warp::profile_length;
use super::{Fitted, RangeMethod, Sizes, TAPS};
use crate::TimeModel;
use crate::cost::{Copies, Cost, StageCost, transform};
use subaperture_model::geometry::ImageGrid;

/// Names of the stages.
pub(super) const COMPENSATION: &str = "motion compensation";
pub(super) const SPECTRUM: &str = "spectrum along the track";
pub(super) const RANGES: &str = "frequency to range";
pub(super) const COMPRESSION: &str = "compression along the track";
pub(super) const PIXELS: &str = "pixels";

/// Operations of interpolating a pixel.
const PIXEL: f64 = 40.0;
/// Operations per gridding or interpolation tap.
const TAP: f64 = 4.0;
/// Operations of a phasor.
const PHASOR: f64 = 20.0;
/// Cost of a filter value in phasors: one phasor, the roll-off of a kernel, roots.
const FILTER: f64 = 8.0;
/// Operations of a polynomial in range.
const POLYNOMIAL: f64 = 25.0;

/// Cost of forming `grid` by `method`.
pub(super) fn cost(
    model: &TimeModel,
    grid: &ImageGrid,
    fitted: &Fitted,
    method: &dyn RangeMethod,
) -> Cost {
    let sizes = Sizes::of(&fitted.axes);
    let samples = fitted.axes.wavenumbers.len();
    let (k, n) = (
        samples as f64,
        fitted.motion.positions.track.num_pulses as f64,
    );
    let (q, r) = (sizes.along_wavenumbers as f64, sizes.ranges as f64);
    let (padded, along) = (sizes.padded_pulses as f64, sizes.along_length as f64);
    // Two arrays exist at a time, one computed from the other.
    let steps = [k * (n + q), q * (k + r), r * (q + sizes.columns as f64)];
    let most = steps.into_iter().fold(0.0, f64::max);
    let pixels = grid.num_pixels() as f64;
    // Weighting, phase reference and scattered write of a sample take as long as a phasor.
    let [filtered, sample] = [FILTER * q * k, n * k].map(|count| model.phasor_ns * count);
    let [padded_ns, along_ns] = [padded, along].map(|length| model.transform(length));
    let pixel_ns = 2.0 * model.phasor_ns + model.raster_tap_ns * (TAPS * TAPS) as f64;
    let compensation = compensation(model, fitted);
    let moved_ns = if compensation.is_some() { 0.0 } else { sample };
    let (spread, spread_ns) = match fitted.motion.positions.is_uneven() {
        true => (TAP * TAPS as f64, model.raster_tap_ns * TAPS as f64),
        false => (0.0, 0.0),
    };
    let along_track = StageCost::shared(
        SPECTRUM,
        k * (transform(padded) + n * spread),
        k * (padded_ns + n * spread_ns) + moved_ns,
    );
    let after = [
        along_track,
        StageCost::shared(
            RANGES,
            method.operations(samples, &sizes),
            method.time_ns(model, samples, &sizes) + filtered,
        ),
        StageCost::shared(COMPRESSION, r * transform(along), r * along_ns),
        StageCost::new(PIXELS, PIXEL * pixels, pixel_ns * pixels),
    ];
    let cost = Cost::of(compensation.into_iter().chain(after))
        .holding("two-dimensional spectrum", Copies::Image, 8.0 * most)
        .holding("transforms", Copies::Thread, 8.0 * 3.0 * padded.max(along));
    match fitted.motion.bytes() {
        0 => cost,
        bytes => cost.holding(COMPENSATION, Copies::Image, bytes as f64),
    }
}

/// Cost of range-dependent motion compensation, where it is done.
fn compensation(model: &TimeModel, fitted: &Fitted) -> Option<StageCost> {
    let Fitted {
        motion,
        wavenumbers,
        axes,
    } = fitted;
    motion.profiles()?;
    let pulses = motion.positions.track.num_pulses as f64;
    let (samples, kept) = (wavenumbers.len() as f64, axes.wavenumbers.len() as f64);
    let length = profile_length(wavenumbers.len()) as f64;
    let place = TAP * TAPS as f64 + POLYNOMIAL + 2.0 * PHASOR;
    let operations = transform(length) + transform(kept) + PHASOR * samples + place * kept;
    let place_ns = model.raster_tap_ns * TAPS as f64 + 2.0 * model.phasor_ns;
    let ns = model.transform(length)
        + model.transform(kept)
        + model.phasor_ns * samples
        + place_ns * kept;
    Some(StageCost::shared(
        COMPENSATION,
        pulses * operations,
        pulses * ns,
    ))
}
