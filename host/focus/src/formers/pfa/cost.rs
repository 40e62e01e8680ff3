//! What polar format takes, with kernels of `W` taps and a raster as [`RasterSize`] has it: spreading `4 W^2` a sample, a transform
//! over each axis; a pixel two-way paths 22 from each of [`FIT_PULSES`] pulses, a phasor 20, reading `4 W^2`. All but the pixels
//! is done for any tile, and kept for all: a quarter more or less, for emphasis and places are left out.

use super::raster::{RasterSize, SPREADING, TRANSFORMS};
use super::{BLOCK_PULSES, FIT_PULSES};
use crate::Aim;
use crate::cost::{Cost, Each, StageCost, transform};
use crate::read_ahead::BLOCKS_HELD;

/// The stage of reading pixels.
pub(super) const PIXELS: &str = "pixels";

/// Of all of `aim` on a raster of `size`.
pub(super) fn cost(aim: &Aim, size: &RasterSize) -> Cost {
    let (num_samples, num_pulses) = (aim.collection.num_samples, aim.collection.pulses.len());
    let reading = 4.0 * (size.taps * size.taps) as f64;
    let [cells, lengths] = [size.cells, size.lengths].map(|n| n.map(|n| n as f64));
    let transforms = cells[0] * transform(lengths[1]) + size.kept[1] as f64 * transform(lengths[0]);
    let model = aim.means.model;
    let [short, long] = [lengths[1], lengths[0]].map(|length| model.transform(length));
    let transforms_ns = cells[0] * short + size.kept[1] as f64 * long;
    let samples = (num_samples * num_pulses) as f64;
    let taps_ns = model.raster_tap_ns * (size.taps * size.taps) as f64;
    let pixel = 22.0 * FIT_PULSES as f64 + 20.0 + reading;
    let held = (num_samples * num_pulses.min(BLOCK_PULSES)) as f64;
    let pixels = aim.grid.num_pixels() as f64;
    // Each way of fitting a place is as long as a phasor, about.
    let pixel_ns = taps_ns + model.phasor_ns * (1 + FIT_PULSES) as f64;
    Cost::of([
        StageCost::shared(SPREADING, reading * samples, taps_ns * samples),
        StageCost::shared(TRANSFORMS, transforms, transforms_ns),
        StageCost::new(PIXELS, pixel * pixels, pixel_ns * pixels),
    ])
    .holding("raster", Each::Image, size.bytes() as f64)
    .holding("pulses", Each::Pass, (8 * BLOCKS_HELD) as f64 * held)
}
