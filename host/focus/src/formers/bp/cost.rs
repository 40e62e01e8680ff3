//! What backprojection takes, with profiles of `L` bins.
//!
//! ```text
//! a pixel and pulse: path 11, place 3, linear reading 6, phasor 21, sum 8                             49
//! a profile: a transform of L
//! ```
//!
//! With motion from sample to sample a pixel and pulse take twice as much (paths with their rates, a second profile to
//! read), and a pulse has a profile for each step of its blur. Profiles are made for any tile: they are what tiles share.

use super::{MOST_PARTS, pulse_bytes};
use crate::Aim;
use crate::cost::{Cost, Each, transform};

/// Operations a pixel and pulse.
const PIXEL_AND_PULSE: f64 = 49.0;

/// Of all of `aim` with so many profiles a pulse, each of `length` bins, and so many pulses in a sum.
pub(super) fn cost(aim: &Aim, length: usize, profiles_each: usize, summed_pulses: usize) -> Cost {
    let (num_samples, num_pulses) = (aim.collection.num_samples, aim.collection.pulses.len());
    let pulses = num_pulses as f64;
    let pixel = match aim.collection.sweeps() {
        true => 2.0 * PIXEL_AND_PULSE,
        false => PIXEL_AND_PULSE,
    };
    let profiles = pulses * profiles_each as f64 * transform(length as f64);
    let held = num_pulses.min(MOST_PARTS * summed_pulses) as f64;
    let pulse_bytes = pulse_bytes(num_samples, profiles_each, length) as f64;
    Cost::new(
        pixel * aim.grid.num_pixels() as f64 * pulses + profiles,
        profiles,
    )
    .holding("profiles", Each::Pass, held * pulse_bytes)
}
