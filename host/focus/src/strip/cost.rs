//! What a frequency-domain former takes, with arrays as [`Sizes`] has them: `K` transforms over slow time, one back to the track
//! for each range bin, 40 operations a pixel, and what its method takes beside ([`RangeMethod::operations`]). All but the pixels is
//! done for any tile, and kept for all. A quarter more or less: filters and weights are left out.

use super::{Fitted, RangeMethod, Sizes, TAPS};
use crate::TimeModel;
use crate::cost::{Cost, Each, StageCost, transform};
use subaperture_model::geometry::ImageGrid;

/// The stages.
pub(super) const SPECTRUM: &str = "spectrum along the track";
pub(super) const RANGES: &str = "frequency to range";
pub(super) const COMPRESSION: &str = "compression along the track";
pub(super) const PIXELS: &str = "pixels";

/// Operations of reading a pixel.
const PIXEL: f64 = 40.0;

/// Of all of `grid` by `method`.
pub(super) fn cost(
    model: &TimeModel,
    grid: &ImageGrid,
    fitted: &Fitted,
    method: &dyn RangeMethod,
) -> Cost {
    let sizes = Sizes::of(&fitted.axes);
    let samples = fitted.axes.wavenumbers.len();
    let (k, n) = (samples as f64, fitted.track.num_pulses as f64);
    let (q, r) = (sizes.along_wavenumbers as f64, sizes.ranges as f64);
    let (padded, along) = (sizes.padded_pulses as f64, sizes.along_length as f64);
    // Two arrays at a time, one made from the other.
    let steps = [k * (n + q), q * (k + r), r * (q + sizes.columns as f64)];
    let most = steps.into_iter().fold(0.0, f64::max);
    let pixels = grid.num_pixels() as f64;
    // A filter's phase is a phasor; samples are weighted, referred and written apart: another.
    let [filtered, sample] = [q * k, n * k].map(|count| model.phasor_ns * count);
    let [padded_ns, along_ns] = [padded, along].map(|length| model.transform(length));
    let pixel_ns = 2.0 * model.phasor_ns + model.raster_tap_ns * (TAPS * TAPS) as f64;
    Cost::of([
        StageCost::shared(SPECTRUM, k * transform(padded), k * padded_ns + sample),
        StageCost::shared(
            RANGES,
            method.operations(samples, &sizes),
            method.time_ns(model, samples, &sizes) + filtered,
        ),
        StageCost::shared(COMPRESSION, r * transform(along), r * along_ns),
        StageCost::new(PIXELS, PIXEL * pixels, pixel_ns * pixels),
    ])
    .holding("two-dimensional spectrum", Each::Image, 8.0 * most)
    .holding("transforms", Each::Thread, 8.0 * 3.0 * padded.max(along))
}
