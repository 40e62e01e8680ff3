//! Map sizes of the thesis mode.

use std::ops::Range;

use crate::sub_cpi::{breaks, cut, shared_band};
use crate::{FormError, ImageSpec};
use subaperture_model::phase_history::Band;
use subaperture_signal::fast_length::fast_length;

/// Upsampling factor of the range axis (5.2).
const RANGE_PADDING: usize = 10;

/// Map sizes of the thesis mode.
pub(super) struct Layout {
    pub(super) band: Band,
    pub(super) sub_cpis: Vec<Range<usize>>,
    /// Pulses of the longest sub-CPI.
    pub(super) longest: usize,
    pub(super) doppler_length: usize,
    pub(super) range_length: usize,
}

impl Layout {
    /// Choose sizes for sub-CPIs of `sub_cpi` pulses with the given Doppler padding factor.
    pub(super) fn new(
        spec: &ImageSpec,
        sub_cpi: usize,
        doppler_padding: usize,
    ) -> Result<Self, FormError> {
        let band = shared_band(spec.collection)?;
        let num_pulses = spec.collection.pulses.len();
        let longest = sub_cpi.min(num_pulses);
        let breaks = breaks(spec.collection);
        Ok(Self {
            sub_cpis: cut(num_pulses, &breaks, sub_cpi),
            longest,
            doppler_length: fast_length(doppler_padding * longest),
            range_length: fast_length(RANGE_PADDING * band.count),
            band,
        })
    }
}
