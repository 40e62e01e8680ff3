//! Items: one file per figure, or group of figures that share data.

mod chim_ambiguity;
mod chim_arrival;
mod chim_autofocus;
mod chim_fusion;
mod chim_fusion_tracks;
mod chim_increments;
mod chim_module;
mod chim_mpga;
mod chim_mpga_pictures;
mod chim_omega_k;
mod chim_painting;
mod chim_radar;
mod chim_radio;
mod chim_rail;
mod chim_range_doppler;
mod chim_residual_phase;
mod chim_resolution;
mod chim_stepped;
mod chim_strip;
mod chim_truck;
mod cost;
mod difference;
mod forming;
mod gmti;
mod gmti_scene;
mod gmti_sub_cpis;
mod large_scene;
mod long_sub_cpis;
mod measure;
mod migration;
mod moving;
mod point;
mod point_cuts;

pub(super) use forming::{grid_about, lone_scatterer, thesis};

use super::Item;

/// All items, in the order of the page.
pub fn items() -> Vec<Item> {
    [
        migration::ITEMS.as_slice(),
        &point::ITEMS,
        &difference::ITEMS,
        &long_sub_cpis::ITEMS,
        &moving::ITEMS,
        &cost::ITEMS,
        &gmti::ITEMS,
        &gmti_sub_cpis::ITEMS,
        &chim_ambiguity::ITEMS,
        &chim_residual_phase::ITEMS,
        &chim_range_doppler::ITEMS,
        &chim_omega_k::ITEMS,
        &chim_painting::ITEMS,
        &chim_truck::ITEMS,
        &chim_resolution::ITEMS,
        &chim_radio::CHIRP,
        &chim_stepped::ITEMS,
        &chim_radio::STEPPED,
        &chim_module::MODULE,
        &chim_autofocus::ITEMS,
        &chim_arrival::ITEMS,
        &chim_mpga::ITEMS,
        &chim_increments::ITEMS,
        &chim_fusion::ITEMS,
    ]
    .concat()
}
