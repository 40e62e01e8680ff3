//! What the sum takes.
//!
//! ```text
//! a pixel, pulse and frequency: a multiplication and an addition, complex                              8
//! where the antennas move meanwhile: two antennas moved 24, path 21, phasor 20, sum 8                 73
//! ```
//!
//! Neglected of the first: what Horner's rule begins with, some 50 a pixel and pulse.

use super::BLOCK_PULSES;
use crate::Aim;
use crate::cost::{Cost, Each, StageCost};
use crate::read_ahead::BLOCKS_HELD;

/// The stage.
pub(super) const SUM: &str = "sum";

/// Operations a pixel, pulse and frequency.
const AT_ONCE: f64 = 8.0;
const IN_MOTION: f64 = 73.0;

/// Of all of `aim`; a pixel in hand takes `pixel_bytes`.
pub(super) fn cost(aim: &Aim, pixel_bytes: u64) -> Cost {
    let (num_samples, num_pulses) = (aim.collection.num_samples, aim.collection.pulses.len());
    let pixels = aim.grid.num_pixels() as f64;
    let model = aim.means.model;
    let (each, each_ns) = match aim.collection.sweeps() {
        true => (IN_MOTION, model.swept_sum_ns),
        false => (AT_ONCE, model.sum_ns),
    };
    let samples = (num_samples * num_pulses) as f64;
    let held = (num_samples * num_pulses.min(BLOCK_PULSES)) as f64;
    let pairs = pixels * samples;
    Cost::of([StageCost::new(SUM, each * pairs, each_ns * pairs)])
        .holding("points and sums", Each::Pixels, pixel_bytes as f64 * pixels)
        .holding("pulses", Each::Pass, (8 * BLOCKS_HELD) as f64 * held)
}
