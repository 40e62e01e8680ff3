//! Assignment of maps to patches, and detection of missing maps.

use std::collections::BTreeMap;

use subaperture_core::stream::Patch;

use crate::maps::Maps;
use subaperture_focus::FormError;

/// Patch with its maps.
#[derive(Clone, Debug, PartialEq)]
pub struct PatchMaps {
    /// Centre and extent of the patch.
    pub patch: Patch,
    /// Indices of the maps, in order of sub-CPIs.
    pub maps: Vec<usize>,
    /// Sum of the slow-time weights of the maps' pulses.
    pub weight_sum: f64,
}

/// Patches that have maps, in order of their index.
///
/// # Errors
/// [`FormError::Unsuited`] if there are no maps, maps with the same patch index have different patches, or the weights of a
/// patch do not have a positive sum.
pub fn patches(maps: &dyn Maps) -> Result<Vec<PatchMaps>, FormError> {
    let mut patches: BTreeMap<u16, PatchMaps> = BTreeMap::new();
    let headers = maps.headers();
    for (index, header) in headers.iter().enumerate() {
        let patch = patches.entry(header.patch_index).or_insert(PatchMaps {
            patch: header.patch,
            maps: Vec::new(),
            weight_sum: 0.0,
        });
        if patch.patch != header.patch {
            return Err(FormError::unsuited(format!(
                "maps with patch index {} have different patches: use maps of one run only",
                header.patch_index
            )));
        }
        patch.maps.push(index);
    }
    if patches.is_empty() {
        return Err(FormError::unsuited(format!(
            "no maps in '{}': record some first",
            maps.run().name
        )));
    }
    for (index, patch) in &mut patches {
        patch.maps.sort_by_key(|&map| headers[map].sub_cpi);
        let weights = patch
            .maps
            .iter()
            .map(|&map| f64::from(headers[map].weight_sum));
        patch.weight_sum = weights.sum();
        if patch.weight_sum.is_nan() || patch.weight_sum <= 0.0 {
            return Err(FormError::unsuited(format!(
                "pulse weights of patch {index}: expected a positive sum, found {}",
                patch.weight_sum
            )));
        }
    }
    Ok(patches.into_values().collect())
}

/// Number of sub-CPIs that should have maps: those between the first and last of any patch, or those of the pulses sent,
/// whichever is larger.
pub(super) fn expected_sub_cpis(maps: &dyn Maps) -> u64 {
    let numbers = maps.headers().iter().map(|header| header.sub_cpi);
    let (first, last) = (numbers.clone().min(), numbers.max());
    let seen = match (first, last) {
        (Some(first), Some(last)) => u64::from(last - first) + 1,
        _ => 0,
    };
    let sent = maps.closing().map_or(0, |closing| closing.num_pulses);
    seen.max(sent.div_ceil(u64::from(maps.run().setup.num_pulses).max(1)))
}

/// Smallest fraction of the weight sent to the module that the maps of a patch contain.
pub(super) fn least_weight_share(maps: &dyn Maps, patches: &[PatchMaps]) -> Option<f64> {
    let sent = maps.closing()?.weight_sum;
    let shares = patches.iter().map(|patch| patch.weight_sum / sent);
    shares
        .filter(|share| share.is_finite())
        .min_by(f64::total_cmp)
}
