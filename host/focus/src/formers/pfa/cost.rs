//! Cost of polar format with kernels of `W` taps and a raster of [`RasterSize`] for each patch and sub-aperture: gridding `4 W^2` per sample and patch, a
//! transform over each axis of each raster; per pixel and sub-aperture the two-way paths, 22, from each of [`FIT_PULSES`] pulses, a phasor, 20, interpolation `4 W^2`. All
//! steps of an undivided grid except the pixels are done once and shared by all tiles. Patches count as the one in the middle. Accuracy about
//! 25 %: pre-emphasis and positions are omitted.

use super::layout::Layout;
use super::plane::FIT_PULSES;
use super::raster::{RasterSize, SPREADING, TRANSFORMS};
use crate::ImageSpec;
use crate::cost::{Copies, Cost, StageCost, transform};
use crate::read_ahead::BLOCKS_HELD;

/// Pulses gridded at a time.
pub(super) const BLOCK_PULSES: usize = 256;

/// Stage name of pixel interpolation.
pub(super) const PIXELS: &str = "pixels";

/// Cost for `spec` with `layout` and the rasters of the sub-apertures of its middle patch.
pub(super) fn cost(spec: &ImageSpec, layout: &Layout, rasters: &[RasterSize]) -> Cost {
    let (num_samples, num_pulses) = (spec.collection.num_samples, spec.collection.pulses.len());
    let model = spec.numerics.model;
    let patches = layout.patches(spec.grid).count() as f64;
    let (mut transforms, mut transforms_ns, mut bytes) = (0.0, 0.0, 0u128);
    for size in rasters {
        let [cells, lengths] = [size.cells, size.lengths].map(|n| n.map(|n| n as f64));
        let columns = size.kept[1] as f64;
        transforms += cells[0] * transform(lengths[1]) + columns * transform(lengths[0]);
        let [short, long] = [lengths[1], lengths[0]].map(|length| model.transform(length));
        transforms_ns += cells[0] * short + columns * long;
        bytes = bytes.max(size.bytes());
    }
    let taps = rasters.first().map_or(0, |size| size.taps);
    let reading = 4.0 * (taps * taps) as f64;
    let samples = (num_samples * num_pulses) as f64;
    let taps_ns = model.raster_tap_ns * (taps * taps) as f64;
    let pixel = 22.0 * FIT_PULSES as f64 + 20.0 + reading;
    let held = (num_samples * num_pulses.min(BLOCK_PULSES)) as f64;
    let pixels = spec.grid.num_pixels() as f64 * rasters.len() as f64;
    // Each path of a position fit takes about as long as a phasor.
    let pixel_ns = taps_ns + model.phasor_ns * (1 + FIT_PULSES) as f64;
    let is_whole = layout.is_whole(spec.grid);
    let (stage, rasters): (fn(_, _, _) -> StageCost, _) = match is_whole {
        true => (StageCost::shared, Copies::Image),
        false => (StageCost::new, Copies::Pixels),
    };
    let spread = samples * patches;
    let cost = Cost::of([
        stage(SPREADING, reading * spread, taps_ns * spread),
        stage(TRANSFORMS, transforms * patches, transforms_ns * patches),
        StageCost::new(PIXELS, pixel * pixels, pixel_ns * pixels),
    ])
    .holding("raster", rasters, bytes as f64 * patches)
    .holding("pulses", Copies::Pass, (8 * BLOCKS_HELD) as f64 * held);
    match is_whole {
        true => cost,
        false => cost.holding("pulse copies", Copies::Thread, 8.0 * held),
    }
}
