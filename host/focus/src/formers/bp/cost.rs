//! Cost of backprojection with profiles of `L` bins and splines of degree `d`.
//!
//! ```text
//! a pixel and pulse: place 2, bin 3, spline 4 d, carrier 10, sum 8                                    23 + 4 d
//! by its own path:   path 11 and 14 of reducing it                                                    54 + 4 d
//! with motion from sample to sample: path and rate 34, place 7, four values read 18, phasor 21, sum 8      88
//! a profile: a transform of L, and of each piece 2 (d + 1)^2 operations of taps and 2 (d + 1) of its weight
//! ```
//!
//! With intra-pulse motion a pulse, or each of its parts, has one profile per step of the quadratic phase. Profiles are computed for any tile; they are
//! the shared work of tiles.
//!
//! **Times** are single-core times by the timing model.

use super::{Choices, MAX_PARTS, PixelPaths};
use crate::cost::{Copies, Cost, StageCost, transform};
use crate::{ImageSpec, TimeModel};
use subaperture_kernels::tile::{Pieces, Window};

/// Operations per pixel and pulse, without the spline: in a tile, and with an exact path.
const TILE: f64 = 23.0;
const POINT: f64 = 54.0;
/// Operations per pixel and pulse with intra-pulse motion.
const BLURRED: f64 = 88.0;

/// Stage names.
pub(super) const PROFILES: &str = "profiles";
pub(super) const PIXELS: &str = "pixels";

/// Time of a pulse on a tile with the given number of pixel groups, ns.
pub(super) fn tile_ns(model: &TimeModel, degree: usize, window: Window, groups: usize) -> f64 {
    let plane = match window {
        Window::Narrow => model.narrow_plane_ns,
        Window::Wide => model.wide_plane_ns,
        _ => model.scattered_plane_ns,
    };
    model.tile_pulse_ns + groups as f64 * (model.tile_group_ns + plane * (degree as f64 + 1.0))
}

/// Time of the profile of a pulse and of the given number of intervals, ns.
pub(super) fn profile_ns(model: &TimeModel, degree: usize, length: usize, pieces: usize) -> f64 {
    model.transform(length as f64) + model.piece_ns * pieces as f64 * (degree as f64 + 1.0)
}

/// Cost for `spec` with profiles of `pieces` intervals, `pixel_ns` per pixel and pulse, and `pulse_bytes` per buffered pulse.
pub(super) fn cost(
    spec: &ImageSpec,
    choices: &Choices,
    pieces: &Pieces,
    pixel_ns: f64,
    pulse_bytes: u64,
) -> Cost {
    let model = spec.numerics.model;
    let num_pulses = spec.collection.pulses.len();
    let (pulses, d) = (num_pulses as f64, choices.degree as f64);
    let bins = pieces.length() as f64;
    let (pixel, profile, profile_ns) = match choices.paths {
        PixelPaths::Blurs(blurs) => {
            let parts = blurs.parts as f64;
            let count = parts * blurs.count as f64;
            (
                parts * BLURRED,
                count * transform(bins),
                count * model.transform(bins),
            )
        }
        paths => {
            let row = pieces.row();
            let profile_ns = profile_ns(model, choices.degree, pieces.length(), row);
            let piece = 2.0 * (d + 1.0) * (d + 1.0) + 2.0 * (d + 1.0);
            let pixel = match paths {
                PixelPaths::Points => POINT,
                _ => TILE,
            };
            let profile = transform(bins) + row as f64 * piece;
            (pixel + 4.0 * d, profile, profile_ns)
        }
    };
    let held = num_pulses.min(MAX_PARTS * choices.summed_pulses) as f64;
    let pairs = pulses * spec.grid.num_pixels() as f64;
    Cost::of([
        StageCost::shared(PROFILES, pulses * profile, pulses * profile_ns),
        StageCost::new(PIXELS, pairs * pixel, pairs * pixel_ns),
    ])
    .holding("profiles", Copies::Pass, held * pulse_bytes as f64)
}
