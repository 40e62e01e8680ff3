//! Which maps belong to which patch, and which are missing.

use std::collections::BTreeMap;

use subaperture_core::stream::Patch;

use crate::maps::Maps;
use subaperture_focus::FormError;

/// A patch and its maps.
#[derive(Clone, Debug, PartialEq)]
pub struct PatchMaps {
    /// The patch.
    pub patch: Patch,
    /// Indices of its maps, by sub-CPI.
    pub maps: Vec<usize>,
    /// Sum of their pulses' weights.
    pub weight_sum: f64,
}

/// The patches of which there are maps, by their index.
///
/// # Errors
/// [`FormError::Unsuited`] if there are no maps, if those of one index are of different patches, or if the
/// weights of a patch sum to nothing.
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
                "the maps of patch {} are not all of the same patch: give maps of one run",
                header.patch_index
            )));
        }
        patch.maps.push(index);
    }
    if patches.is_empty() {
        return Err(FormError::unsuited(format!(
            "there are no maps in '{}': record some first",
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
                "the weights of the pulses of patch {index} sum to {}, and a positive sum is needed",
                patch.weight_sum
            )));
        }
    }
    Ok(patches.into_values().collect())
}

/// Sub-CPIs of which there should be maps: those between the first and last that any patch has, or as
/// many as the pulses sent make, whichever are more.
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

/// Smallest share of the weight sent that a patch has.
pub(super) fn least_weight_share(maps: &dyn Maps, patches: &[PatchMaps]) -> Option<f64> {
    let sent = maps.closing()?.weight_sum;
    let shares = patches.iter().map(|patch| patch.weight_sum / sent);
    shares
        .filter(|share| share.is_finite())
        .min_by(f64::total_cmp)
}
