//! Noncoherent accumulation of patch maps.

use super::{AccumulateError, PowerMap};
use crate::stream::PatchMap;

impl<const CAPACITY: usize> PowerMap<CAPACITY> {
    /// Add the power of a patch map. The first map after [`PowerMap::clear`] sets the shape. The caller must ensure
    /// that all patches cover the same place.
    ///
    /// # Errors
    /// [`AccumulateError`] if the map exceeds the capacity or has another shape. The sum is then unchanged.
    pub fn accumulate_patch(&mut self, map: &PatchMap<'_>) -> Result<(), AccumulateError> {
        let patch = &map.header.patch;
        let bins = [patch.num_doppler_bins(), patch.num_range_bins()];
        let (d, r) = (i32::from(patch.doppler_reach), i32::from(patch.range_reach));
        let samples = (-d..=d).flat_map(|d| (-r..=r).map(move |r| map.at(d, r)));
        self.add(bins, samples)
    }
}
