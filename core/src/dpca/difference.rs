//! Difference of the aligned maps.

use num_complex::Complex32;

use super::Dpca;
use crate::stream::{PatchMap, Setup};

/// Difference of the aligned maps of two channels, computed cell by cell.
#[derive(Clone, Copy, Debug)]
pub struct Difference<'a> {
    /// Settings of the kept map.
    pub dpca: &'a Dpca,
    /// Settings of the run.
    pub setup: &'a Setup,
    /// Map of channel 1.
    pub map: &'a PatchMap<'a>,
    /// Kept map of channel 0 ([`Dpca::keep_row`]).
    pub kept: &'a [Complex32],
    /// Factor from channel 1 to channel 0 ([`Balance::gain`](super::Balance::gain)).
    pub gain: Complex32,
}

impl Difference<'_> {
    /// Number of Doppler bins and of range bins.
    pub fn shape(&self) -> [usize; 2] {
        let patch = &self.map.header.patch;
        [patch.num_doppler_bins(), patch.num_range_bins()]
    }

    /// Power `|h x_1 - y_0|^2` of a cell, or `None` outside the map. Row 0 is the lowest Doppler bin, column 0 the nearest range bin.
    // Inlined at every access of a search it would take more flash.
    #[inline(never)]
    pub fn power(&self, row: usize, column: usize) -> Option<f32> {
        let patch = &self.map.header.patch;
        let bin = |index: usize, reach: u16| (index as i32).wrapping_sub(reach.into());
        let (doppler_bin, range_bin) = (
            bin(row, patch.doppler_reach),
            bin(column, patch.range_reach),
        );
        let first = self.kept.get(row * patch.num_range_bins() + column)?;
        let second = self.map.at(doppler_bin, range_bin);
        Some((second * self.gain - first).norm_sqr())
    }

    /// Aligned values of channels 0 and 1 in a cell, counted in bins from the patch centre. Both are equal for a stationary scatterer; the
    /// phase of the second relative to the first is `4 pi v_r tau / lambda`. Zero outside the map.
    pub fn values(&self, (doppler_bin, range_bin): (i32, i32)) -> [Complex32; 2] {
        let patch = &self.map.header.patch;
        let row = doppler_bin.saturating_add(patch.doppler_reach.into());
        let column = range_bin.saturating_add(patch.range_reach.into());
        let [rows, columns] = self.shape();
        let inside = (0..rows as i32).contains(&row) && (0..columns as i32).contains(&column);
        if !inside {
            return [Complex32::ZERO; 2];
        }
        let first = self.kept.get(row as usize * columns + column as usize);
        let phasor = self.dpca.phase(self.setup, doppler_bin).phasor().conj();
        let second = self.map.at(doppler_bin, range_bin) * self.gain;
        [first.copied().unwrap_or(Complex32::ZERO), second].map(|value| value * phasor)
    }
}
