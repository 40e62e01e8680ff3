//! A map that owns its samples.

use num_complex::Complex32;
use subaperture_core::Sc16;
use subaperture_core::stream::{BlockFloat, MapHeader, MapSamples, Patch, PatchMap, power_of_two};

/// A map and its samples, bit by bit as the module sent them.
#[derive(Clone, Debug, PartialEq)]
pub struct OwnedMap {
    /// What it is of.
    pub header: MapHeader,
    /// Its samples, `header.patch.map_len()` of them.
    pub samples: OwnedSamples,
}

/// Samples of a map, as [`MapSamples`].
#[derive(Clone, Debug, PartialEq)]
pub enum OwnedSamples {
    /// By the floating-point path.
    Float(Vec<Complex32>),
    /// By the fixed-point path.
    Fixed {
        /// Row by row.
        mantissas: Vec<Sc16>,
        /// Row by row, [`BlockFloat::blocks`] each.
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
    /// The map as the processor hands it out.
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

    /// The samples as complex numbers: Doppler bin by Doppler bin, range bins contiguous.
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

    /// Bytes that the values of a map of `patch` take, as they are and as complex numbers.
    pub fn bytes(patch: &Patch) -> u64 {
        // At most 8 a sample either way, and the complex numbers beside them for a moment.
        16 * patch.map_len() as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::maps::example;

    #[test]
    fn values_are_those_of_the_view() {
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
