//! Owned map.

use num_complex::Complex32;
use subaperture_core::Sc16;
use subaperture_core::stream::{BlockFloat, MapHeader, MapSamples, Patch, PatchMap, power_of_two};

/// Map with owned samples, bit-identical to those the module sent.
#[derive(Clone, Debug, PartialEq)]
pub struct OwnedMap {
    /// Sub-CPI, patch and geometry of the map.
    pub header: MapHeader,
    /// Samples, `header.patch.map_len()` of them.
    pub samples: OwnedSamples,
}

/// Owned form of [`MapSamples`].
#[derive(Clone, Debug, PartialEq)]
pub enum OwnedSamples {
    /// Complex float32 samples of the floating-point path.
    Float(Vec<Complex32>),
    /// Block floating-point samples of the fixed-point path.
    Fixed {
        /// Mantissas in row-major order.
        mantissas: Vec<Sc16>,
        /// Exponents in row-major order, [`BlockFloat::blocks`] per row.
        exponents: Vec<i8>,
    },
}

impl From<&PatchMap<'_>> for OwnedMap {
    fn from(map: &PatchMap<'_>) -> Self {
        Self {
            header: map.header,
            samples: match map.samples {
                MapSamples::Float(samples) => OwnedSamples::Float(samples.to_vec()),
                MapSamples::Fixed(block_float) => OwnedSamples::Fixed {
                    mantissas: block_float.mantissas.to_vec(),
                    exponents: block_float.exponents.to_vec(),
                },
            },
        }
    }
}

impl OwnedMap {
    /// Borrowed view, as the processor returns maps.
    pub fn view(&self) -> PatchMap<'_> {
        PatchMap {
            header: self.header,
            samples: match &self.samples {
                OwnedSamples::Float(samples) => MapSamples::Float(samples),
                OwnedSamples::Fixed {
                    mantissas,
                    exponents,
                } => MapSamples::Fixed(BlockFloat {
                    mantissas,
                    exponents,
                }),
            },
        }
    }

    /// Samples as complex numbers, `[doppler][range]`, range contiguous.
    pub fn into_values(self) -> Vec<Complex32> {
        match self.samples {
            OwnedSamples::Float(samples) => samples,
            OwnedSamples::Fixed {
                mantissas,
                exponents,
            } => {
                let width = self.header.patch.num_range_bins();
                let blocks = BlockFloat::blocks(width);
                let rows = mantissas.chunks(width).zip(exponents.chunks(blocks));
                rows.flat_map(|(row, exponents)| {
                    row.chunks(BlockFloat::BLOCK)
                        .zip(exponents)
                        .flat_map(|(block, &exponent)| {
                            let scale = power_of_two(exponent);
                            block.iter().map(move |value| value.to_complex32() * scale)
                        })
                })
                .collect()
            }
        }
    }

    /// Upper bound in bytes for the samples of a map of `patch`, as stored and as complex numbers.
    pub fn bytes(patch: &Patch) -> u64 {
        // At most 8 bytes per sample in either form; both exist during conversion.
        16 * patch.map_len() as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::maps::example;

    #[test]
    fn owned_values_match_borrowed_view() {
        let blocks = BlockFloat::blocks(41);
        let map = OwnedMap {
            header: example::header(),
            samples: OwnedSamples::Fixed {
                mantissas: (0..123).map(|i| Sc16::from_bits(i * 11, -i)).collect(),
                exponents: (0..3 * blocks as i8).map(|i| i * 3 - 8).collect(),
            },
        };
        let values = map.clone().into_values();
        assert_eq!(values.len(), 123);
        for doppler in -1..=1 {
            for range in -20..=20 {
                let index = (doppler + 1) * 41 + range + 20;
                assert_eq!(values[index as usize], map.view().at(doppler, range));
            }
        }
    }
}
