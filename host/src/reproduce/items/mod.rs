//! The items, a file a figure or group of figures that share their data.

mod chim_ambiguity;
mod chim_omega_k;
mod chim_painting;
mod chim_range_doppler;
mod chim_residual_phase;
mod chim_resolution;
mod chim_stepped;
mod chim_strip;
mod forming;
mod migration;
mod point;

use super::Item;

/// All items, in the order of the page.
pub fn items() -> Vec<Item> {
    [
        migration::ITEMS.as_slice(),
        point::ITEMS.as_slice(),
        chim_ambiguity::ITEMS.as_slice(),
        chim_residual_phase::ITEMS.as_slice(),
        chim_range_doppler::ITEMS.as_slice(),
        chim_omega_k::ITEMS.as_slice(),
        chim_painting::ITEMS.as_slice(),
        chim_resolution::ITEMS.as_slice(),
        chim_stepped::ITEMS.as_slice(),
    ]
    .concat()
}
