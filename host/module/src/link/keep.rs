//! Writes received maps to their file.

use subaperture_core::Sc16;
use subaperture_core::link::{AssembledMap, Encoding, complex32s, sc16s};
use subaperture_core::stream::BlockFloat;

use super::ending::SinkError;
use super::products::MapSink;
use crate::maps::{OwnedMap, OwnedSamples};
use crate::maps_file::MapWriter;

impl From<&AssembledMap<'_>> for OwnedMap {
    fn from(map: &AssembledMap<'_>) -> Self {
        let samples = match map.encoding {
            Encoding::Complex32 => OwnedSamples::Float(complex32s(map.bytes).collect()),
            Encoding::Sc16 => {
                let width = map.header.patch.num_range_bins();
                let split = width * Encoding::Sc16.sample_bytes();
                let mut mantissas: Vec<Sc16> = Vec::with_capacity(map.header.patch.map_len());
                let mut exponents = Vec::new();
                for row in map.bytes.chunks(split + BlockFloat::blocks(width)) {
                    let (samples, rest) = row.split_at(split.min(row.len()));
                    mantissas.extend(sc16s(samples));
                    exponents.extend(rest.iter().map(|byte| i8::from_le_bytes([*byte])));
                }
                OwnedSamples::Fixed {
                    mantissas,
                    exponents,
                }
            }
        };
        Self {
            header: map.header,
            samples,
        }
    }
}

impl MapSink for MapWriter {
    fn accept(&mut self, map: &AssembledMap<'_>) -> Result<(), SinkError> {
        Ok(self.append(&OwnedMap::from(map).view())?)
    }
}

impl<S: MapSink + ?Sized> MapSink for &mut S {
    fn accept(&mut self, map: &AssembledMap<'_>) -> Result<(), SinkError> {
        (**self).accept(map)
    }
}

#[cfg(test)]
mod tests {
    use num_complex::Complex32;
    use subaperture_core::link::write_block_row;

    use super::*;
    use crate::maps::example;

    #[test]
    fn fixed_point_rows_round_trip_through_link_bytes() {
        let mut bytes = Vec::new();
        for row in 0..3i16 {
            let mantissas: Vec<Sc16> = (0..41).map(|i| Sc16::from_bits(i, 16 * row)).collect();
            let exponents = [3 - row as i8, -5];
            let mut buffer = [0; 41 * 4 + 2];
            bytes.extend_from_slice(write_block_row(&mantissas, &exponents, &mut buffer).unwrap());
        }
        let map = AssembledMap {
            map: 0,
            header: example::header(),
            encoding: Encoding::Sc16,
            bytes: &bytes,
        };
        let by_rows: Vec<Complex32> = map
            .rows()
            .flat_map(|row| row.values().collect::<Vec<_>>())
            .collect();
        assert_eq!(OwnedMap::from(&map).into_values(), by_rows);
        assert_eq!(by_rows.len(), 3 * 41);
    }
}
