//! What backprojection takes, with profiles of `L` bins read as splines of degree `d`.
//!
//! ```text
//! a pixel and pulse: place 4, bin 3, spline 4 d, phasor 15, sum 8                                     30 + 4 d
//! by its own path:   path 11 and 14 of reducing it                                                    54 + 4 d
//! with motion from sample to sample: path and rate 34, place 7, four values read 18, phasor 21, sum 8      88
//! a profile: a transform of L, and of each piece 2 (d + 1)^2 operations of taps and 6 (d + 1) of its carrier
//! ```
//!
//! With motion from sample to sample a pulse has a profile for each step of its blur. Profiles are made for any tile: they are what
//! tiles share.
//!
//! **Times** are those of one core with 512-bit registers at 3.5 GHz, measured once (`cargo bench --bench kernels`); here, so that
//! every machine makes the same choice.

use super::{Choices, MOST_PARTS, Way};
use crate::Aim;
use crate::cost::{Cost, Each, transform};
use subaperture_kernels::tile::{Pieces, Window};

/// Operations a pixel and pulse in a tile, and by its own path; both less those of the spline.
const TILE: f64 = 30.0;
const POINT: f64 = 54.0;
/// Those with motion from sample to sample.
const BLURRED: f64 = 88.0;

/// Nanoseconds a pixel and pulse by its own path.
pub(super) const POINT_NS: f64 = 9.0;

/// Nanoseconds of a pulse on a tile of so many groups.
pub(super) fn tile_ns(degree: usize, coarse: bool, window: Window, groups: usize) -> f64 {
    let group = if coarse { 4.7 } else { 5.5 };
    let plane = match window {
        Window::Narrow => 1.1,
        Window::Wide => 1.6,
        _ => 20.0,
    };
    110.0 + groups as f64 * (group + plane * (degree as f64 + 1.0))
}

/// Nanoseconds of a pulse's profile and so many pieces of it.
pub(super) fn profile_ns(degree: usize, length: usize, pieces: usize) -> f64 {
    let length = length as f64;
    0.3 * length * length.log2() + pieces as f64 * (degree as f64 + 1.0)
}

/// Of all of `aim` so done, with such `pieces` of profiles; of a pulse in hand there are `pulse_bytes`.
pub(super) fn cost(aim: &Aim, choices: &Choices, pieces: &Pieces, pulse_bytes: u64) -> Cost {
    let num_pulses = aim.collection.pulses.len();
    let (pulses, bins, d) = (
        num_pulses as f64,
        pieces.length() as f64,
        choices.degree as f64,
    );
    let (pixel, profile) = match choices.way {
        Way::Blurs(blurs) => (BLURRED, blurs.count as f64 * transform(bins)),
        way => {
            let piece = 2.0 * (d + 1.0) * (d + 1.0) + 6.0 * (d + 1.0);
            let pixel = match way {
                Way::Points => POINT,
                _ => TILE,
            };
            (
                pixel + 4.0 * d,
                transform(bins) + pieces.row() as f64 * piece,
            )
        }
    };
    let held = num_pulses.min(MOST_PARTS * choices.summed_pulses) as f64;
    Cost::new(
        pulses * (pixel * aim.grid.num_pixels() as f64 + profile),
        pulses * profile,
    )
    .holding("profiles", Each::Pass, held * pulse_bytes as f64)
}
