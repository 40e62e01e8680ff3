//! Patches of the scene, and the maps made of them.

use num_complex::Complex32;

use super::MapSamples;

/// A patch of the scene: its centre, and how much of the range-Doppler map around it is kept.
///
/// A map has the bins `-range_reach ..= range_reach` and `-doppler_reach ..= doppler_reach` about the
/// patch's centre.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "link", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Patch {
    /// Centre, metres, in the frame of the antenna positions.
    pub centre_m: [f64; 3],
    /// Range bins kept on either side of the centre.
    pub range_reach: u16,
    /// Doppler bins kept on either side of zero.
    pub doppler_reach: u16,
}

impl Patch {
    /// A patch at the origin of one bin: what fills an empty list.
    pub const EMPTY: Self = Self {
        centre_m: [0.0; 3],
        range_reach: 0,
        doppler_reach: 0,
    };

    /// Range bins of a map, `2 range_reach + 1`.
    pub const fn num_range_bins(&self) -> usize {
        2 * self.range_reach as usize + 1
    }

    /// Doppler bins of a map, `2 doppler_reach + 1`.
    pub const fn num_doppler_bins(&self) -> usize {
        2 * self.doppler_reach as usize + 1
    }

    /// Samples of a map.
    pub const fn map_len(&self) -> usize {
        self.num_range_bins() * self.num_doppler_bins()
    }
}

/// Antennas at one place of the fitted track, metres.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "link", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Node {
    /// Transmitter.
    pub transmitter_m: [f64; 3],
    /// Receiver.
    pub receiver_m: [f64; 3],
}

/// What a map is of: everything that forming an image from it needs, beside the axes.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "link", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MapHeader {
    /// Number of the sub-CPI: first pulse's number divided by the pulses of a full sub-CPI.
    pub sub_cpi: u32,
    /// Index of the patch in the list.
    pub patch_index: u16,
    /// Pulses in it, `M`; the last sub-CPI of a run may have fewer than the others.
    pub num_pulses: u16,
    /// The patch.
    pub patch: Patch,
    /// Times of the first and last pulse, seconds.
    pub time_s: [f64; 2],
    /// Sum of the pulses' weights.
    pub weight_sum: f32,
    /// Antennas at `u = -u_g` and `u = +u_g`, `u_g^2 = (M^2 - 1) / 12`: Gauss's nodes, from a quadratic
    /// fitted to the positions, `u` in pulses from the sub-CPI's middle.
    pub nodes: [Node; 2],
}

/// A map as the processor hands it out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PatchMap<'a> {
    /// What it is of.
    pub header: MapHeader,
    /// Its samples.
    pub samples: MapSamples<'a>,
}

impl PatchMap<'_> {
    /// The value at a bin, counted from the patch's centre; zero outside the map.
    pub fn at(&self, doppler_bin: i32, range_bin: i32) -> Complex32 {
        let patch = &self.header.patch;
        // Negative wraps to beyond any map; a sum that saturates is beyond it too.
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
