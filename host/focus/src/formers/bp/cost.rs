//! What backprojection takes, with profiles of `L` bins read as splines of degree `d`.
//!
//! ```text
//! a pixel and pulse: place 2, bin 3, spline 4 d, carrier 10, sum 8                                    23 + 4 d
//! by its own path:   path 11 and 14 of reducing it                                                    54 + 4 d
//! with motion from sample to sample: path and rate 34, place 7, four values read 18, phasor 21, sum 8      88
//! a profile: a transform of L, and of each piece 2 (d + 1)^2 operations of taps and 2 (d + 1) of its weight
//! ```
//!
//! With motion from sample to sample a pulse has a profile for each step of its blur. Profiles are made for any tile: they are what
//! tiles share.
//!
//! **Times** are of one core, by the time model.

use super::{Choices, MOST_PARTS, Way};
use crate::cost::{Cost, Each, StageCost, transform};
use crate::{Aim, TimeModel};
use subaperture_kernels::tile::{Pieces, Window};

/// Operations a pixel and pulse in a tile, and by its own path; both less those of the spline.
const TILE: f64 = 23.0;
const POINT: f64 = 54.0;
/// Those with motion from sample to sample.
const BLURRED: f64 = 88.0;

/// The stages.
pub(super) const PROFILES: &str = "profiles";
pub(super) const PIXELS: &str = "pixels";

/// Nanoseconds of a pulse on a tile of so many groups.
pub(super) fn tile_ns(model: &TimeModel, degree: usize, window: Window, groups: usize) -> f64 {
    let plane = match window {
        Window::Narrow => model.narrow_plane_ns,
        Window::Wide => model.wide_plane_ns,
        _ => model.scattered_plane_ns,
    };
    model.tile_pulse_ns + groups as f64 * (model.tile_group_ns + plane * (degree as f64 + 1.0))
}

/// Nanoseconds of a pulse's profile and so many pieces of it.
pub(super) fn profile_ns(model: &TimeModel, degree: usize, length: usize, pieces: usize) -> f64 {
    model.transform(length as f64) + model.piece_ns * pieces as f64 * (degree as f64 + 1.0)
}

/// Of all of `aim` so done, with such `pieces` of profiles and `pixel_ns` a pixel and pulse; of a pulse in hand there are `pulse_bytes`.
pub(super) fn cost(
    aim: &Aim,
    choices: &Choices,
    pieces: &Pieces,
    pixel_ns: f64,
    pulse_bytes: u64,
) -> Cost {
    let model = aim.means.model;
    let num_pulses = aim.collection.pulses.len();
    let (pulses, d) = (num_pulses as f64, choices.degree as f64);
    let bins = pieces.length() as f64;
    let (pixel, profile, profile_ns) = match choices.way {
        Way::Blurs(blurs) => {
            let count = blurs.count as f64;
            (
                BLURRED,
                count * transform(bins),
                count * model.transform(bins),
            )
        }
        way => {
            let row = pieces.row();
            let profile_ns = profile_ns(model, choices.degree, pieces.length(), row);
            let piece = 2.0 * (d + 1.0) * (d + 1.0) + 2.0 * (d + 1.0);
            let pixel = match way {
                Way::Points => POINT,
                _ => TILE,
            };
            let profile = transform(bins) + row as f64 * piece;
            (pixel + 4.0 * d, profile, profile_ns)
        }
    };
    let held = num_pulses.min(MOST_PARTS * choices.summed_pulses) as f64;
    let pairs = pulses * aim.grid.num_pixels() as f64;
    Cost::of([
        StageCost::shared(PROFILES, pulses * profile, pulses * profile_ns),
        StageCost::new(PIXELS, pairs * pixel, pairs * pixel_ns),
    ])
    .holding("profiles", Each::Pass, held * pulse_bytes as f64)
}
