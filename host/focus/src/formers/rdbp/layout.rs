//! Sizes of the thesis's maps.

use std::ops::Range;

use crate::sub_cpi::{breaks, cut, shared_band};
use crate::{Aim, FormError};
use subaperture_model::phase_history::Band;
use subaperture_signal::fast_length::fast_length;

/// Upsampling of the range axis (5.2).
const RANGE_PADDING: usize = 10;

/// Sizes of maps.
pub(super) struct Layout {
    pub(super) band: Band,
    pub(super) sub_cpis: Vec<Range<usize>>,
    /// Pulses of the longest.
    pub(super) longest: usize,
    pub(super) doppler_length: usize,
    pub(super) range_length: usize,
}

impl Layout {
    /// Of sub-CPIs of `sub_cpi` pulses, Doppler padded so many times.
    pub(super) fn new(
        aim: &Aim,
        sub_cpi: usize,
        doppler_padding: usize,
    ) -> Result<Self, FormError> {
        let band = shared_band(aim.collection)?;
        let num_pulses = aim.collection.pulses.len();
        let longest = sub_cpi.min(num_pulses);
        let breaks = breaks(aim.collection);
        Ok(Self {
            sub_cpis: cut(num_pulses, &breaks, sub_cpi),
            longest,
            doppler_length: fast_length(doppler_padding * longest),
            range_length: fast_length(RANGE_PADDING * band.count),
            band,
        })
    }
}
