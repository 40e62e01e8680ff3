//! Cost of the exact sum.
//!
//! ```text
//! a pixel, pulse and frequency: a multiplication and an addition, complex                              8
//! where the antennas move meanwhile: two antennas moved 24, path 21, phasor 20, sum 8                 73
//! ```
//!
//! Neglected for antennas at rest: the setup of Horner's rule, about 50 operations per pixel and pulse.

use crate::ImageSpec;
use crate::cost::{Copies, Cost, StageCost};
use crate::read_ahead::BLOCKS_HELD;

/// Largest number of buffered pulses, so that progress and cancellation are prompt.
pub(super) const BLOCK_PULSES: usize = 16;

/// Name of the only stage.
pub(super) const SUM: &str = "sum";

/// Operations per pixel, pulse and frequency.
const AT_ONCE: f64 = 8.0;
const IN_MOTION: f64 = 73.0;

/// Cost for `spec`, with `pixel_bytes` per pixel being formed.
pub(super) fn cost(spec: &ImageSpec, pixel_bytes: u64) -> Cost {
    let (num_samples, num_pulses) = (spec.collection.num_samples, spec.collection.pulses.len());
    let pixels = spec.grid.num_pixels() as f64;
    let model = spec.numerics.model;
    let (each, each_ns) = match spec.collection.sweeps() {
        true => (IN_MOTION, model.swept_sum_ns),
        false => (AT_ONCE, model.sum_ns),
    };
    let samples = (num_samples * num_pulses) as f64;
    let held = (num_samples * num_pulses.min(BLOCK_PULSES)) as f64;
    let pairs = pixels * samples;
    Cost::of([StageCost::new(SUM, each * pairs, each_ns * pairs)])
        .holding(
            "points and sums",
            Copies::Pixels,
            pixel_bytes as f64 * pixels,
        )
        .holding("pulses", Copies::Pass, (8 * BLOCKS_HELD) as f64 * held)
}
