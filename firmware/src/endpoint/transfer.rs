//! Transfer in progress.

use subaperture_core::link::TransferChecksum;

/// Transfer in progress.
#[derive(Debug)]
pub(super) enum Transfer {
    Nothing,
    /// A map is complete and its products are being computed.
    Products,
    MapStart,
    MapRow {
        row: u16,
        checksum: TransferChecksum,
    },
    MapEnd {
        checksum: TransferChecksum,
    },
    /// Detections of the last map sent, from this index on.
    Detections(usize),
    ChipStart,
    ChipPart {
        part: u16,
        checksum: TransferChecksum,
    },
    ChipEnd {
        checksum: TransferChecksum,
    },
    ProfileStart,
    ProfileRow {
        row: u16,
        checksum: TransferChecksum,
    },
    ProfileEnd {
        checksum: TransferChecksum,
    },
}
