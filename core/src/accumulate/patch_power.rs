//! Power of patch maps, in the same owner as that of whole maps.

use super::{AccumulateError, PowerMap};
use crate::stream::PatchMap;

impl<const CAPACITY: usize> PowerMap<CAPACITY> {
    /// Adds a patch's map. The first since [`PowerMap::clear`] sets the shape. Whether the patches are
    /// of one place is for the caller to know.
    ///
    /// # Errors
    /// [`AccumulateError`] if it does not fit or is of another shape; the sum then stays.
    pub fn accumulate_patch(&mut self, map: &PatchMap<'_>) -> Result<(), AccumulateError> {
        let patch = &map.header.patch;
        let bins = [patch.num_doppler_bins(), patch.num_range_bins()];
        let (d, r) = (i32::from(patch.doppler_reach), i32::from(patch.range_reach));
        let samples = (-d..=d).flat_map(|d| (-r..=r).map(move |r| map.at(d, r)));
        self.add(bins, samples)
    }
}
