//! Header of a small map for tests.

use subaperture_core::stream::{MapHeader, Node, Patch};

/// Map of 3 Doppler x 41 range bins: more than one exponent block per row, the last one incomplete.
pub(crate) fn header() -> MapHeader {
    MapHeader {
        sub_cpi: 0,
        patch_index: 0,
        channel: 0,
        num_pulses: 1,
        patch: Patch {
            centre_m: [0.0; 3],
            range_reach: 20,
            doppler_reach: 1,
        },
        time_s: [0.0; 2],
        weight_sum: 1.0,
        nodes: [Node::default(); 2],
    }
}
