//! Checksum of a map in the frames of the link.

use super::Fnv1a;
use crate::link::{EncodeError, Encoder, Encoding, Report, TransferChecksum, write_map_row};
use crate::stream::{MapSamples, PatchMap};

/// Add the frames of `map`, number `number` of a run, to `checksum`. `row` must hold a row of the map, `frame` its frame.
pub(super) fn add_frames(
    checksum: &mut Fnv1a,
    encoder: &mut Encoder,
    number: u32,
    map: &PatchMap<'_>,
    row: &mut [u8],
    frame: &mut [u8],
) -> Result<(), EncodeError> {
    let mut send = |report: &Report<'_>| {
        checksum.add_bytes(encoder.encode(report, frame)?);
        Ok(())
    };
    let encoding = match map.samples {
        MapSamples::Float(_) => Encoding::Complex32,
        MapSamples::Fixed(_) => Encoding::Sc16,
    };
    send(&Report::MapStart {
        map: number,
        header: map.header,
        encoding,
    })?;
    let mut transfer = TransferChecksum::new(&map.header);
    let rows = map.header.patch.num_doppler_bins() as u16;
    for index in 0..rows {
        let room = row.len();
        let samples = write_map_row(map, index.into(), row).ok_or(EncodeError::Room { room })?;
        transfer.add_row(samples);
        send(&Report::MapRow {
            map: number,
            row: index,
            samples,
        })?;
    }
    send(&Report::MapEnd {
        map: number,
        rows,
        crc: transfer.value(),
    })
}
