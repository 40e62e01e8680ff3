//! Patches of the scene, and the maps made of them.

use num_complex::Complex32;

use crate::Sc16;

/// A patch of the scene: its centre, and how much of the range-Doppler map around it is kept.
///
/// A map has the bins `-range_reach ..= range_reach` and `-doppler_reach ..= doppler_reach` about the
/// patch's centre.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
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
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Node {
    /// Transmitter.
    pub transmitter_m: [f64; 3],
    /// Receiver.
    pub receiver_m: [f64; 3],
}

/// What a map is of: everything that forming an image from it needs, beside the axes.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
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

/// Samples of a map, Doppler bin by Doppler bin (ascending), range bins (ascending) contiguous.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MapSamples<'a> {
    /// By the floating-point path.
    Float(&'a [Complex32]),
    /// By the fixed-point path, in blocks of a common exponent.
    Fixed(BlockFloat<'a>),
}

/// 16-bit samples in blocks of a common exponent: sample `i` of a row is
/// `mantissas[i] 2^exponents[i / BLOCK]`, `mantissas` in `[-1, 1)`. Every row begins a new block.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlockFloat<'a> {
    /// Row by row.
    pub mantissas: &'a [Sc16],
    /// Row by row, [`BlockFloat::blocks`] each.
    pub exponents: &'a [i8],
}

impl BlockFloat<'_> {
    /// Samples that share an exponent.
    pub const BLOCK: usize = 32;

    /// Exponents of a row of `len` samples.
    pub const fn blocks(len: usize) -> usize {
        len.div_ceil(Self::BLOCK)
    }
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
        let index = row * width + column;
        let value = match self.samples {
            MapSamples::Float(samples) => samples.get(index).copied(),
            MapSamples::Fixed(block_float) => {
                let mantissa = block_float.mantissas.get(index);
                let place = row * BlockFloat::blocks(width) + column / BlockFloat::BLOCK;
                let exponent = block_float.exponents.get(place);
                mantissa
                    .zip(exponent)
                    .map(|(mantissa, exponent)| mantissa.to_complex32() * power_of_two(*exponent))
            }
        };
        value.unwrap_or(Complex32::ZERO)
    }
}

/// `2^exponent`, exact.
pub fn power_of_two(exponent: i8) -> f32 {
    // Within the normal numbers for exponents above -127; -127 and -128 are denormal and exact too.
    let biased = i32::from(exponent) + 127;
    if biased > 0 {
        f32::from_bits((biased as u32) << 23)
    } else {
        f32::from_bits(1 << (22 + biased))
    }
}
