//! What a frequency-domain former takes, with arrays as [`Sizes`] has them: `K` transforms over slow time, one back to the track
//! for each range bin, 40 operations a pixel, and what its method takes beside ([`RangeMethod::operations`]). All but the pixels is
//! done for any tile, and kept for all. A quarter more or less: filters and weights are left out.

use super::{Fitted, RangeMethod, Sizes};
use crate::cost::{Cost, Each, transform};
use subaperture_model::geometry::ImageGrid;

/// Operations of reading a pixel.
const PIXEL: f64 = 40.0;

/// Of all of `grid` by `method`.
pub(super) fn cost(grid: &ImageGrid, fitted: &Fitted, method: &dyn RangeMethod) -> Cost {
    let sizes = Sizes::of(&fitted.axes);
    let samples = fitted.axes.wavenumbers.len();
    let (k, n) = (samples as f64, fitted.track.num_pulses as f64);
    let (q, r) = (sizes.along_wavenumbers as f64, sizes.ranges as f64);
    let (padded, along) = (sizes.padded_pulses as f64, sizes.along_length as f64);
    let spectrum =
        k * transform(padded) + r * transform(along) + method.operations(samples, &sizes);
    // Two arrays at a time, one made from the other.
    let steps = [k * (n + q), q * (k + r), r * (q + sizes.columns as f64)];
    let most = steps.into_iter().fold(0.0, f64::max);
    Cost::new(spectrum + PIXEL * grid.num_pixels() as f64, spectrum)
        .holding("two-dimensional spectrum", Each::Image, 8.0 * most)
        .holding("transforms", Each::Thread, 8.0 * 3.0 * padded.max(along))
}
