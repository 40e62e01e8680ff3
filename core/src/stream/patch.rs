//! Patches of the scene and their range-Doppler maps.

use num_complex::Complex32;

use super::MapSamples;

/// Patch of the scene: its centre and the extent of the range-Doppler map kept around it.
///
/// The map has the bins `-range_reach ..= range_reach` and `-doppler_reach ..= doppler_reach` about the
/// patch centre.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "link", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Patch {
    /// Patch centre in metres, in the frame of the antenna positions.
    pub centre_m: [f64; 3],
    /// Range half-width of the map in bins.
    pub range_reach: u16,
    /// Doppler half-width of the map in bins.
    pub doppler_reach: u16,
}

impl Patch {
    /// One-bin patch at the origin; initial value of a patch list.
    pub const EMPTY: Self = Self {
        centre_m: [0.0; 3],
        range_reach: 0,
        doppler_reach: 0,
    };

    /// Number of range bins of the map, `2 range_reach + 1`.
    pub const fn num_range_bins(&self) -> usize {
        2 * self.range_reach as usize + 1
    }

    /// Number of Doppler bins of the map, `2 doppler_reach + 1`.
    pub const fn num_doppler_bins(&self) -> usize {
        2 * self.doppler_reach as usize + 1
    }

    /// Number of samples of the map.
    pub const fn map_len(&self) -> usize {
        self.num_range_bins() * self.num_doppler_bins()
    }
}

/// Antenna phase centres at one node of the fitted track, in metres.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "link", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Node {
    /// Transmitter position (x, y, z) in metres.
    pub transmitter_m: [f64; 3],
    /// Receiver position (x, y, z) in metres.
    pub receiver_m: [f64; 3],
}

/// Description of a patch map: everything except the axes that image formation needs.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "link", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MapHeader {
    /// Sub-CPI number: number of its first pulse divided by the pulses of a full sub-CPI.
    pub sub_cpi: u32,
    /// Index of the patch in the patch list.
    pub patch_index: u16,
    /// Channel of the pulses, from 0.
    pub channel: u16,
    /// Number of pulses `M` in this sub-CPI. The last sub-CPI of a run may have fewer than the others.
    pub num_pulses: u16,
    /// Patch that the map covers.
    pub patch: Patch,
    /// Times of the first and last pulse in seconds.
    pub time_s: [f64; 2],
    /// Sum of the pulses' slow-time weights.
    pub weight_sum: f32,
    /// Antennas at `u = -u_g` and `u = +u_g`, `u_g^2 = (M^2 - 1) / 12`: the Gauss quadrature nodes of a quadratic
    /// fitted to the positions, with `u` in pulses from the middle of the sub-CPI.
    pub nodes: [Node; 2],
}

/// Range-Doppler map of one patch and one sub-CPI, borrowed from the processor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PatchMap<'a> {
    /// Sub-CPI, patch and geometry of the map.
    pub header: MapHeader,
    /// Samples of the map, `[Doppler bin][range bin]`.
    pub samples: MapSamples<'a>,
}

impl PatchMap<'_> {
    /// Value at a bin counted from the patch centre. Zero outside the map.
    pub fn at(&self, doppler_bin: i32, range_bin: i32) -> Complex32 {
        let patch = &self.header.patch;
        // A negative bin wraps to an index outside any map; a saturated sum is outside as well.
        let row = doppler_bin.saturating_add(patch.doppler_reach.into()) as usize;
        let column = range_bin.saturating_add(patch.range_reach.into()) as usize;
        let width = patch.num_range_bins();
        if column >= width || row >= patch.num_doppler_bins() {
            return Complex32::ZERO;
        }
        let value = self.samples.at(width, row, column);
        value.unwrap_or(Complex32::ZERO)
    }
}
