//! Cost of polar format with kernels of `W` taps and a raster of [`RasterSize`]: gridding `4 W^2` per sample, a transform
//! over each axis; per pixel the two-way paths, 22, from each of [`FIT_PULSES`] pulses, a phasor, 20, interpolation `4 W^2`. All steps except the pixels
//! are done once and shared by all tiles. Accuracy about 25 %: pre-emphasis and positions are omitted.

use super::plane::FIT_PULSES;
use super::raster::{RasterSize, SPREADING, TRANSFORMS};
use crate::ImageSpec;
use crate::cost::{Copies, Cost, StageCost, transform};
use crate::read_ahead::BLOCKS_HELD;

/// Pulses gridded at a time.
pub(super) const BLOCK_PULSES: usize = 256;

/// Stage name of pixel interpolation.
pub(super) const PIXELS: &str = "pixels";

/// Cost for `spec` on a raster of `size`.
pub(super) fn cost(spec: &ImageSpec, size: &RasterSize) -> Cost {
    let (num_samples, num_pulses) = (spec.collection.num_samples, spec.collection.pulses.len());
    let reading = 4.0 * (size.taps * size.taps) as f64;
    let [cells, lengths] = [size.cells, size.lengths].map(|n| n.map(|n| n as f64));
    let transforms = cells[0] * transform(lengths[1]) + size.kept[1] as f64 * transform(lengths[0]);
    let model = spec.numerics.model;
    let [short, long] = [lengths[1], lengths[0]].map(|length| model.transform(length));
    let transforms_ns = cells[0] * short + size.kept[1] as f64 * long;
    let samples = (num_samples * num_pulses) as f64;
    let taps_ns = model.raster_tap_ns * (size.taps * size.taps) as f64;
    let pixel = 22.0 * FIT_PULSES as f64 + 20.0 + reading;
    let held = (num_samples * num_pulses.min(BLOCK_PULSES)) as f64;
    let pixels = spec.grid.num_pixels() as f64;
    // Each path of a position fit takes about as long as a phasor.
    let pixel_ns = taps_ns + model.phasor_ns * (1 + FIT_PULSES) as f64;
    Cost::of([
        StageCost::shared(SPREADING, reading * samples, taps_ns * samples),
        StageCost::shared(TRANSFORMS, transforms, transforms_ns),
        StageCost::new(PIXELS, pixel * pixels, pixel_ns * pixels),
    ])
    .holding("raster", Copies::Image, size.bytes() as f64)
    .holding("pulses", Copies::Pass, (8 * BLOCKS_HELD) as f64 * held)
}
